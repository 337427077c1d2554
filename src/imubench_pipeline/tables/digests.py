"""Digests of files, and JSON of which no bit changes unseen: a digest of it stands at its end."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from imubench_pipeline.tables.files import write_json

_DIGEST = "digest"


def write_sealed_json(data: Mapping[str, Any], path: Path) -> None:
    """Write a mapping with a digest of it, atomically.

    Parameters
    ----------
    data : mapping
        What JSON can hold, no NaN among it.
    path : Path
    """
    plain = json.loads(json.dumps(data, allow_nan=False))
    write_json(plain | {_DIGEST: _digest(plain)}, path)


def read_sealed_json(path: Path) -> dict[str, Any]:
    """Return what `write_sealed_json` wrote.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is not, letter for letter, as it was written.
    """
    text = path.read_bytes().decode()
    data = json.loads(text)
    if not isinstance(data, dict) or json.dumps(data, indent=1, allow_nan=False) + "\n" != text:
        raise ValueError(f"{path}: is not laid out as it was written")
    if data.pop(_DIGEST, None) != _digest(data):
        raise ValueError(f"{path}: its digest is another one")
    return data


def digest_of(path: Path) -> str:
    """Return the SHA-256 of the content of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _digest(data: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()

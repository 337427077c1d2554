"""Digests of files, and JSON files that end with a digest of themselves."""

import hashlib
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path

from imubench_pipeline.tables.files import write_content
from imubench_pipeline.typing import JsonObject

_END = "\n}"
_LAST_LINE = re.compile(r',\n "digest": "[0-9a-f]{64}"\n\}\n\Z')


def write_sealed_json(data: Mapping[str, object], path: Path) -> None:
    """Write a mapping of JSON values without NaN, with its digest, atomically."""
    text = json.dumps(dict(data), indent=1, allow_nan=False)
    write_content(text.removesuffix(_END) + _last_line(text), path)


def read_sealed_json(path: Path) -> JsonObject:
    """Return the data of `write_sealed_json`; ValueError if any byte has changed, or OSError."""
    # All letters count, and not only what they mean.
    with open(path, "rb", opener=open_without_waiting) as file:
        text = file.read().decode()
    seal = _LAST_LINE.search(text)
    rest = text[: seal.start()] + _END if seal else text
    if seal is None or seal[0] != _last_line(rest):
        raise ValueError(f"{path}: its digest is another one")
    try:
        data: JsonObject = json.loads(rest)
    except RecursionError:
        raise ValueError(f"{path}: is nested deeper than permitted") from None
    return data


def open_without_waiting(path: str, flags: int) -> int:
    """Open a file without blocking: a pipe without a writer is empty."""
    return os.open(path, flags | os.O_NONBLOCK)


def compute_digest(path: Path) -> str:
    """Return the SHA-256 of the content of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _last_line(text: str) -> str:
    """Return the last line of a file: the digest of the text of a JSON object."""
    return f',\n "digest": "{hashlib.sha256(text.encode()).hexdigest()}"{_END}\n'

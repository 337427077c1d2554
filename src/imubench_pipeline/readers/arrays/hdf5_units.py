"""The units that an HDF5 file states in attributes of its data sets.

The library does not come back from every damaged text of variable length. A process of its own
reads these, and is ended where it does not answer.
"""

from __future__ import annotations

import json
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import h5py

_NAMES = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")
_LONGEST_WAIT = 3.0
_LONGEST = 40
_LONGEST_STORED = 1 << 12


def stated_unit(data: h5py.Dataset) -> str | None:
    """Return the unit that an attribute of a data set states."""
    name = next((name for name in _NAMES if name in data.attrs), None)
    if name is None:
        return None
    kind = data.attrs.get_id(name)
    if kind.shape != () or kind.dtype.itemsize > _LONGEST_STORED:
        return None
    if kind.dtype.kind == "S":
        text = bytes(data.attrs[name]).decode("utf-8", "replace")
    elif h5py.check_string_dtype(kind.dtype) is not None:
        path = Path(data.file.filename).resolve()
        status = path.stat()
        units = _texts_of_variable_length(str(path), status.st_mtime_ns, status.st_size)
        text = units.get(str(data.name), "")
    else:
        return None
    return text.strip("\0 \t\r\n")[:_LONGEST] or None


@lru_cache(maxsize=4)
def _texts_of_variable_length(path: str, *_: int) -> dict[str, str]:
    """Return the units of a file by data set; none where they cannot be read."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _READING, path, *_NAMES],
            capture_output=True,
            timeout=_LONGEST_WAIT,
            check=True,
        )
        found = json.loads(done.stdout)
    except (subprocess.SubprocessError, OSError, ValueError):
        return {}
    return {str(name): str(unit) for name, unit in found.items()}


_READING = """
import json, sys
import h5py

found = {}

def visit(name, item):
    if isinstance(item, h5py.Dataset):
        for key in sys.argv[2:]:
            if key in item.attrs:
                text = item.attrs[key]
                found["/" + name] = text if isinstance(text, str) else text.decode()

with h5py.File(sys.argv[1], "r") as file:
    file.visititems(visit)
print(json.dumps(found))
"""

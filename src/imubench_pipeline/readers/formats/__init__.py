"""The formats of log files that can be read: one module each, with the name of the ``reader``.

A module declares its format as ``FORMAT``, with a function that imports the code that reads it;
extensions add others. The names are as in `imubench_pipeline.settings.sensor.Reader`: a module
without a name there, or a name without a module, fails the import of this one.
"""

import pkgutil
from collections.abc import Mapping
from importlib import import_module
from typing import get_args

from imubench_pipeline.readers.file_format import FileFormat
from imubench_pipeline.readers.other_formats import EXTENSION_MARKS
from imubench_pipeline.registry import Hook
from imubench_pipeline.settings.sensor import Reader

_MODULE_PATTERN = "imubench_pipeline.readers.formats.*"

_ADDED: Hook[FileFormat] = Hook("formats")
_formats: dict[str, FileFormat] = _ADDED.by_key() | {
    module.name: import_module(_MODULE_PATTERN.replace("*", module.name)).FORMAT
    for module in pkgutil.iter_modules(__path__)
}
if _missing := (_formats.keys() ^ get_args(Reader)) - (EXTENSION_MARKS.keys() - _formats.keys()):
    raise ImportError(
        f"{', '.join(sorted(_missing))}: a format of log files has a module in readers/formats, or "
        "an extension, and its name in settings.sensor.Reader; one of them is missing"
    )
if _wrong := [name for name, found in _formats.items() if found.name != name]:
    raise ImportError(f"{_wrong[0]} declares the format {_formats[_wrong[0]].name!r}")

FILE_FORMATS: Mapping[Reader, FileFormat] = {
    name: _formats[name] for name in get_args(Reader) if name in _formats
}
"""All formats by the value of ``reader`` in a sensor file."""

TEXT = FILE_FORMATS["csv"]  # format of files without a known signature: text has none

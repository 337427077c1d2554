"""The formats of log files that can be read: one module each, with the name of the ``reader``.

A module declares its format as ``FORMAT``, with a function that imports the code that reads it. The
names are as in `imubench_pipeline.settings.sensor.Reader`: a module without a name there, or a
name without a module, fails the import of this one.
"""

import pkgutil
from collections.abc import Mapping
from importlib import import_module
from typing import get_args

from imubench_pipeline.readers.file_format import FileFormat
from imubench_pipeline.settings.sensor import Reader

_MODULE_PATTERN = "imubench_pipeline.readers.formats.*"


def _load_format(name: str) -> FileFormat:
    file_format: FileFormat = import_module(_MODULE_PATTERN.replace("*", name)).FORMAT
    if file_format.name != name:
        raise ImportError(f"{_MODULE_PATTERN.replace('*', name)} declares {file_format.name!r}")
    return file_format


_modules = {module.name for module in pkgutil.iter_modules(__path__)}
if _missing := _modules.symmetric_difference(get_args(Reader)):
    raise ImportError(
        f"{', '.join(sorted(_missing))}: a format of log files has a module in readers/formats "
        "and its name in settings.sensor.Reader; one of them is missing"
    )

FILE_FORMATS: Mapping[Reader, FileFormat] = {name: _load_format(name) for name in get_args(Reader)}
"""All formats by the value of ``reader`` in a sensor file."""

TEXT = FILE_FORMATS["csv"]  # format of files without a known signature: text has none

"""The formats of log files that can be read: a module each, called as ``reader`` states it.

A module declares its format as ``FORMAT``, and has the code that reads it, or says where it is. The
names are those of `imubench_pipeline.settings.sensor.Reader`: a module without a name there, or a
name without a module, fails the import of this one.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from importlib import import_module
from typing import get_args

from imubench_pipeline.readers.file_format import FileFormat
from imubench_pipeline.settings.sensor import Reader

_MODULES = "imubench_pipeline.readers.formats.*"


def _declared(name: str) -> FileFormat:
    file_format: FileFormat = import_module(_MODULES.replace("*", name)).FORMAT
    if file_format.name != name:
        raise ImportError(f"{_MODULES.replace('*', name)} declares {file_format.name!r}")
    return file_format


def _check_names() -> None:
    modules = {module.name for module in pkgutil.iter_modules(__path__)}
    if missing := modules.symmetric_difference(get_args(Reader)):
        raise ImportError(
            f"{', '.join(sorted(missing))}: a format of log files has a module in readers/formats "
            "and its name in settings.sensor.Reader; one of them is missing"
        )


_check_names()

FILE_FORMATS: Mapping[Reader, FileFormat] = {name: _declared(name) for name in get_args(Reader)}
"""Every format, by the name that ``reader`` of a sensor file has for it."""

TEXT = FILE_FORMATS["csv"]
"""What a file is that has the signature of no format: text has none."""

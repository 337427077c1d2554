"""Declaration of a program that a noise model can be exported to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.smallest_model import Family


@dataclass(frozen=True)
class Target:
    """A program, declared in the module of the function that writes its file.

    Attributes
    ----------
    name, program : str
        Identifier in commands and settings, and the name for people.
    file_name : str
        The usual name of its file.
    write : callable
        Imu -> content of the file: str, or bytes. Raises ExportError if the program needs a
        quantity without estimate, or a density above 0.
    family : str
        Terms that the program supports; an overbound for it has these.
    """

    name: str
    program: str
    file_name: str
    write: Callable[[Imu], str | bytes]
    family: Family

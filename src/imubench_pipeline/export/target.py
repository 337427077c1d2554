"""What is declared of a program that a noise model can be written for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.smallest_model import Family


@dataclass(frozen=True)
class Target:
    """A program; its module declares it beside the function that writes its file.

    Attributes
    ----------
    name, program : str
        What the command and the settings call it, and what people do.
    file_name : str
        Its usual one.
    write : callable
        Imu -> content of the file: str, or bytes. Raises ExportError where the program needs what
        has no estimate, or a density above 0.
    family : str
        Terms that it holds: those of an overbound for it.
    """

    name: str
    program: str
    file_name: str
    write: Callable[[Imu], str | bytes]
    family: Family

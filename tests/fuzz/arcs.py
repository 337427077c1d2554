"""Which steps from line to line a piece of code takes: what inputs are kept for.

The code is traced and not changed, for numba compiles some of it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

Arc = tuple[int, int, int]
Trace = Callable[[FrameType, str, Any], Any]


class Arcs:
    """Notes, within a ``with`` block, each step from a line to another in some modules.

    Parameters
    ----------
    folder : Path
        That of the modules.

    Attributes
    ----------
    taken : set
        The steps of the last block.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = f"{folder}/"
        self.taken: set[Arc] = set()

    def __enter__(self) -> Arcs:
        self.taken = set()
        sys.settrace(self._called)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def _called(self, frame: FrameType, _event: str, _: Any) -> Trace | None:
        code = frame.f_code
        if not code.co_filename.startswith(self._folder):
            return None
        taken, key, last = self.taken, id(code), -1

        def stepped(frame: FrameType, event: str, _: Any) -> Trace:
            nonlocal last
            if event == "line":
                taken.add((key, last, frame.f_lineno))
                last = frame.f_lineno
            return stepped

        return stepped

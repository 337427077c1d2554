"""What the first use compiles, in a process of its own beside the imports and the reading."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType

from imubench_pipeline.estimators.compilation import compile_kernels
from imubench_pipeline.readers.bounded import Bounded

_MAX_COMPILE_TIME, _MAX_COMPILE_MEMORY = 600.0, 4 << 30
_MESSAGE_DELAY = 3.0
"""s; who waits for longer is told for what."""


class Compilation:
    """Compiles the kernels of estimates where that was not done before; begins at once.

    As a context it ends its process where nobody waited for it.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._process = Bounded(_MAX_COMPILE_MEMORY, compile_kernels)
        self._told = threading.Timer(_MESSAGE_DELAY, self._tell)

    def expected(self) -> None:
        """Tell of it from now on, where it takes long: there will be somebody who waits for it."""
        self._told.start()

    def finish(self) -> None:
        """Wait for its end, and load the kernels, so that no fork does so again."""
        self._process.result(_MAX_COMPILE_TIME)
        self._told.cancel()
        compile_kernels()

    def _tell(self) -> None:
        with suppress(OSError):  # its pipe was closed meanwhile: it has ended
            if self._process.answered:
                return
            self._say("compiling, once after the installation: some seconds")

    def __enter__(self) -> Compilation:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._told.cancel()
        self._process.end()

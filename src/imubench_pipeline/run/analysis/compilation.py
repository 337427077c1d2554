"""Compile kernels at the first use in a separate process, in parallel with imports and reading."""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress

from imubench_pipeline.estimators.posterior_kernels import compile_kernels
from imubench_pipeline.readers.bounded import Bounded

_MAX_COMPILE_TIME, _MAX_COMPILE_MEMORY = 600.0, 4 << 30
_MESSAGE_DELAY = 3.0  # delay of the message about the compilation, s


class Compilation(AbstractContextManager["Compilation"]):
    """Compiles the kernels of estimates unless cached; as a context manager it ends its process."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._process = Bounded(_MAX_COMPILE_MEMORY, compile_kernels)
        self._timer = threading.Timer(_MESSAGE_DELAY, self._tell)
        self._finished = False

    def expected(self) -> None:
        """Start the timer of the message: the caller will wait for the compilation."""
        if not self._finished:
            self._timer.start()

    def finish(self) -> None:
        """Wait for the end, and load the kernels, so that forks need not load them."""
        if self._finished:
            return
        self._process.result(_MAX_COMPILE_TIME)
        self._timer.cancel()
        compile_kernels()
        self._finished = True

    def _tell(self) -> None:
        with suppress(OSError):  # its pipe was closed meanwhile: it has ended
            if self._process.answered:
                return
            self._say("compiling, once after the installation: some seconds")

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        self._process.end()

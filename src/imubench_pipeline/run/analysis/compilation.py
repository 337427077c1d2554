"""Compile kernels at the first use in separate processes, in parallel with imports and reading."""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress

import numpy as np

from imubench_pipeline.estimators.posterior_kernels import compile_kernels
from imubench_pipeline.readers.bounded import Bounded

_MAX_COMPILE_TIME, _MAX_COMPILE_MEMORY = 600.0, 4 << 30
_MESSAGE_DELAY = 3.0  # delay of the message about the compilation, s


def _compile_curve_kernels() -> None:
    """Compile the kernels of curves, and of the fit to them (see `compile_kernels`)."""
    from imubench_pipeline.allan import octave, of_blocks
    from imubench_pipeline.estimators.robust.active_sets import TermSearch

    samples = np.random.default_rng(1).standard_normal(octave.MIN_DECIMATED_SAMPLES)
    of_blocks([samples], len(samples), 1.0, holes=False)
    tau = np.array([1.0, 2.0])
    TermSearch(tau, 1.0, tau, tau).solve(tau[None], np.eye(2))


_PARTS = (compile_kernels, _compile_curve_kernels)


class Compilation(AbstractContextManager["Compilation"]):
    """Compiles the kernels of estimates, unless cached, in processes that end with the context."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._processes = [Bounded(_MAX_COMPILE_MEMORY, compile_part) for compile_part in _PARTS]
        self._timer = threading.Timer(_MESSAGE_DELAY, self._tell)
        self._finished = False

    def expected(self) -> None:
        """Start the timer of the progress message; call it before waiting for the compilation."""
        if not self._finished:
            self._timer.start()

    def finish(self) -> None:
        """Wait for the compilation, and load the kernels, so that forks need not load them."""
        if self._finished:
            return
        for process in self._processes:
            process.result(_MAX_COMPILE_TIME)
        self._timer.cancel()
        for compile_part in _PARTS:
            compile_part()
        self._finished = True

    def _tell(self) -> None:
        with suppress(OSError):  # its pipe was closed meanwhile: it has ended
            if all(process.answered for process in self._processes):
                return
            self._say("compiling, once after the installation: some seconds")

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        for process in self._processes:
            process.end()

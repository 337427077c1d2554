"""The progress of long work in this process, on the standard error."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_INTERVAL = 3.0  # s, between two lines where there is no terminal


@contextmanager
def show_progress(size: int, done: str) -> Iterator[Callable[[int], None]]:
    """Show the progress of work; yield a function to call with each finished amount of ``size``.

    A terminal shows a bar, a file gets lines: the percentage, then ``done``, such as ``simulated``.
    """
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import Progress

        with Progress(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(done, total=size)
            yield lambda more: bar.advance(task, more)
        return
    last, total = time.monotonic(), 0

    def advance(more: int) -> None:
        nonlocal last, total
        total += more
        if time.monotonic() - last >= _INTERVAL and total < size:
            last = time.monotonic()
            print(f"{100 * total / size:.0f} % {done}", file=sys.stderr, flush=True)

    yield advance

"""`imubench formats`: list the supported log formats, and what extensions add."""

import argparse
from collections.abc import Callable, Iterator, Sequence

from imubench_pipeline.registry import Hook

Line = Sequence[str]
Listing = tuple[str, Sequence[Line]]  # a title, and lines: first the header

_ADDED: Hook[Callable[[], Listing]] = Hook("listings")


def run(_: argparse.Namespace) -> int:
    """Print all tables; return the exit status."""
    listings = (list_log_formats(), *(listed() for listed in _ADDED.objects()))
    parts = ["\n".join([title, *_aligned(lines)]) for title, lines in listings]
    print("\n\n".join(parts))
    return 0


def list_log_formats() -> Listing:
    """Return the title and the lines of the table of log formats."""
    # Only this command needs these: the others answer at once.
    from imubench_pipeline.readers.formats import FILE_FORMATS

    heads = ("reader", "format", "files", "compressed", "columns of time", "settings of its own")
    lines = [
        (
            name,
            log_format.title,
            " ".join(log_format.endings),
            "yes" if log_format.streamed else "no",
            ", ".join(log_format.time_columns) or "any",
            ", ".join(log_format.settings) or "none",
        )
        for name, log_format in FILE_FORMATS.items()
    ]
    title = "Logs that are read: `reader` of a sensor file, mostly found in the file itself"
    return title, [heads, *lines]


def _aligned(lines: Sequence[Line]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        cells = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        yield f"  {'  '.join(cells)}".rstrip()

"""`imubench formats`: list the supported log formats and export programs."""

import argparse
from collections.abc import Iterator, Sequence

Line = Sequence[str]


def run(_: argparse.Namespace) -> int:
    """Print both tables; return the exit status."""
    print("Logs that are read: `reader` of a sensor file, mostly found in the file itself")
    print("\n".join(_aligned(list(list_log_formats()))))
    print("\nPrograms that files are written for: `imubench export --target`, `exports: targets`")
    print("\n".join(_aligned(list(list_export_targets()))))
    return 0


def list_log_formats() -> Iterator[Line]:
    """Yield the header and a line per format of log files."""
    # Only this command needs these: the others answer at once.
    from imubench_pipeline.readers.formats import FILE_FORMATS

    yield "reader", "format", "files", "compressed", "columns of time", "settings of its own"
    for name, log_format in FILE_FORMATS.items():
        yield (
            name,
            log_format.title,
            " ".join(log_format.endings),
            "yes" if log_format.streamed else "no",
            ", ".join(log_format.time_columns) or "any",
            ", ".join(log_format.settings) or "none",
        )


def list_export_targets() -> Iterator[Line]:
    """Yield the header and a line per program for exported noise models."""
    from imubench_pipeline.export.targets import TARGETS

    yield "target", "program", "file", "terms"
    for target in TARGETS.values():
        yield target.name, target.program, target.file_name, target.family


def _aligned(lines: Sequence[Line]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        cells = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        yield f"  {'  '.join(cells)}".rstrip()

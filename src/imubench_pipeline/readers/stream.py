"""The bytes of a log in blocks, as far as they can be read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from imubench_pipeline.readers.compressed import open_bytes
from imubench_pipeline.tables.findings import Finding

BLOCK_BYTES = 1 << 20


def blocks(path: Path, findings: list[Finding]) -> Iterator[bytes]:
    """Yield the bytes of a log, compressed or not, in blocks of about `BLOCK_BYTES`.

    Parameters
    ----------
    findings : list of Finding
        What is found goes here: that compressed data end early.

    Raises
    ------
    RecordingError
        If the file cannot be opened, or compressed data are corrupt.
    """
    with closing(open_bytes(path)) as stream:
        while True:
            held: list[bytes] = []
            left = BLOCK_BYTES
            while left > 0 and (read := stream.read(left)):
                held.append(read)
                left -= len(read)
            if held:
                yield b"".join(held)
            if left > 0:
                break
        early = stream.ended_early
    if early:
        findings.append(
            Finding(
                "truncated_file",
                "warning",
                f"{path.name}: the compressed file ends early; read as far as it goes",
                1,
            )
        )

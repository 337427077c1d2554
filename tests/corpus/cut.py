"""Every text log of the corpus once more, in gzip and cut short."""

from __future__ import annotations

import gzip
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from tests.corpus.entry import Cut, Entry, Written, part


def cut_short(entries: Iterable[Entry]) -> Iterator[Entry]:
    """Yield each of some entries, of one text file each, in gzip and cut at 70 %."""
    for entry in entries:
        yield replace(entry, name=f"{entry.name} (cut)", write=_cut(entry.write), expected=Cut())


def _cut(write: Written) -> Written:
    def then(folder: Path) -> Path:
        whole = write(folder)
        packed = whole.with_name(f"{whole.name}.gz")
        packed.write_bytes(part(gzip.compress(whole.read_bytes(), 1), 0.7))
        whole.unlink()
        return packed

    return then

"""Join the tables of all sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa

from imubench_pipeline.tables.failures import Failure, read_with_failures, with_failures


def tables_of_all(parts: Mapping[str, Sequence[Path]]) -> dict[str, pa.Table]:
    """Return every table, of its files in their order, and what failed in ``failures``."""
    joined, failures = {}, dict[Failure, None]()
    for name, paths in parts.items():
        joined[name], failed = read_with_failures(name, paths)
        failures |= dict.fromkeys(failed)
    return with_failures(joined, list(failures))

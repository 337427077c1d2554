"""Join the tables of all sensors, and describe them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa

from imubench_pipeline.model.recordings import DoubtRow, RecordingRow
from imubench_pipeline.recordings.fitness import WITH_DOUBTS, attach_doubts, exclude_simulated
from imubench_pipeline.tables.datapackage import describe_tables as describe_tables
from imubench_pipeline.tables.failures import Failure, mark_failures, read_with_failures
from imubench_pipeline.tables.files import build


def join_all_tables(parts: Mapping[str, Sequence[Path]]) -> dict[str, pa.Table]:
    """Return every table, joined from its files in order, with failed steps in ``failures``."""
    joined, failures = {}, dict[Failure, None]()
    for name, paths in parts.items():
        joined[name], failed = read_with_failures(name, paths)
        failures |= dict.fromkeys(failed)
    # Tables in which no simulated recording decides beside measured ones of any sensor
    tables = mark_failures(joined, list(failures))
    recordings, new = exclude_simulated(RecordingRow.rows_of(tables["recordings"]))
    if not new:
        return tables
    doubts = [*new, *DoubtRow.rows_of(tables["doubts"])]
    return tables | {
        "recordings": build("recordings", recordings),
        "doubts": build("doubts", doubts),
        **{
            name: build(name, attach_doubts(WITH_DOUBTS[name].rows_of(tables[name]), recordings))
            for name in WITH_DOUBTS.keys() & tables.keys()
        },
    }

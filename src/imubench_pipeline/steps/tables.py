"""Join the tables of all sensors, and describe them."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa

from imubench_pipeline.model.recordings import DoubtRow, RecordingRow
from imubench_pipeline.recordings.fitness import WITH_DOUBTS, attach_doubts, exclude_simulated
from imubench_pipeline.tables.failures import Failure, mark_failures, read_with_failures
from imubench_pipeline.tables.files import build, link_part, make_folder
from imubench_pipeline.tables.keys import split_table


def join_all_tables(parts: Mapping[str, Sequence[Path]]) -> dict[str, pa.Table]:
    """Join each table from its files; failed steps are rows of the table ``failures``."""
    joined, failures = {}, dict[Failure, None]()
    for name, paths in parts.items():
        joined[name], failed = read_with_failures(name, paths)
        failures |= dict.fromkeys(failed)
    # Tables in which no simulated recording decides beside measured ones of any sensor
    tables = mark_failures(joined, list(failures))
    recordings, new = exclude_simulated(RecordingRow.rows_of(tables["recordings"]))
    if not new:
        return tables
    return tables | {
        "recordings": build("recordings", recordings),
        "doubts": build("doubts", [*new, *DoubtRow.rows_of(tables["doubts"])]),
        **{
            name: build(name, attach_doubts(WITH_DOUBTS[name].rows_of(tables[name]), recordings))
            for name in WITH_DOUBTS.keys() & tables.keys()
        },
    }


_STORE = ".parts"
"""The parts of all tables, beside these. Snakemake removes the folder of a table before it is made
again; an unchanged part is linked from here."""


def write_parts(table: pa.Table, folder: Path, recordings: pa.Table) -> None:
    """Write a table with rows of recordings as a folder, with a file for each sensor and month.

    The month is of the first sample of a recording, else ``undated``. A file with the same rows is
    left as it is. ``recordings``: the table of that name.
    """
    months = {
        (row.sensor, row.recording): (row.started or "undated")[:7]
        for row in RecordingRow.rows_of(recordings)
    }
    keys = zip(table["sensor"].to_pylist(), table["recording"].to_pylist(), strict=True)
    labels = pa.array([months.get(key, "undated") for key in keys], pa.string())
    parts = split_table(table.append_column(_MONTH, labels), "sensor", _MONTH)
    store = folder.parent / _STORE / folder.stem
    shutil.rmtree(folder, ignore_errors=True)
    with make_folder(folder) as made:
        if not parts:
            link_part(folder.stem, table, store / "empty.parquet", made)
        for (sensor, month), part in parts.items():
            rows = part.drop_columns(_MONTH)
            link_part(folder.stem, rows, store / f"{sensor}.{month}.parquet", made)
    for old in {path.name for path in store.iterdir()} - {path.name for path in folder.iterdir()}:
        (store / old).unlink()


def remove_parts(path: Path) -> None:
    """Remove the folder and the stored parts of a table, before it is written as one file."""
    if path.is_dir():
        shutil.rmtree(path)
    shutil.rmtree(path.parent / _STORE / path.stem, ignore_errors=True)


_MONTH = " month"  # no column of a table has such a name

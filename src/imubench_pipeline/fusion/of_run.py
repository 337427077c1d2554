"""The table ``fusion`` of a run, from its tables of recordings and parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pyarrow as pa

from imubench_pipeline.config import FusionSettings
from imubench_pipeline.fusion.equivalence import Candidate, equivalence_rows
from imubench_pipeline.results import estimate_of
from imubench_pipeline.units import quantity_to_si

Row = Mapping[str, Any]


def candidates(recordings: pa.Table, parameters: pa.Table) -> Iterator[Candidate]:
    """Yield the channels of a run, each with the estimate of the method to use.

    Parameters
    ----------
    recordings, parameters : pyarrow.Table
        The tables of these names.

    Yields
    ------
    Candidate
    """
    about = {(row["sensor"], row["recording"]): row for row in recordings.to_pylist()}
    groups: dict[tuple[str, str, str, str], list[Row]] = {}
    for row in parameters.filter(parameters["recommended"]).to_pylist():
        key = (row["sensor"], row["recording"], row["channel"], row["method"])
        groups.setdefault(key, []).append(row)
    for (sensor, recording, channel, method), rows in groups.items():
        of = about[sensor, recording]
        yield Candidate(
            sensor,
            recording,
            channel,
            of["simulated"],
            of["duration"] or 0.0,
            estimate_of(method, rows),
        )


def fusion_rows(recordings: pa.Table, parameters: pa.Table, how: FusionSettings) -> Iterator[Row]:
    """Return the rows of the table ``fusion``.

    Parameters
    ----------
    recordings, parameters : pyarrow.Table
    how : FusionSettings

    Returns
    -------
    iterator of mapping
    """
    return equivalence_rows(
        candidates(recordings, parameters),
        [quantity_to_si(tau, "time") for tau in how.tau],
        how.common.model_dump(),
        longest=how.longest,
        draws=how.draws,
        seed=how.seed,
    )

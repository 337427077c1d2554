"""Recordings of a sensor that hold the same samples: one log that lies in its folder twice.

Such a copy counts as another specimen, with no spread between the two. The likelihood of a channel
and its mean are those of its samples: to nine digits they are the same of no other log.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Row

_DIGITS = ".8e"


def recorded_twice(models: Iterable[Row], biases: Iterable[Row]) -> Iterator[Row]:
    """Yield the rows of the table ``findings`` about recordings that another one holds, too.

    Parameters
    ----------
    models, biases : iterable of mapping
        Rows of the tables ``models`` and ``fixed_bias``, in the order of the recordings. The first
        of several copies is taken for the log.
    """
    means = {_place(row): row["value"] for row in biases}
    first: dict[tuple[Any, ...], str] = {}
    copies: dict[tuple[str, str], dict[str, list[str]]] = {}
    for row in models:
        mean = means.get(_place(row))
        if not row["chosen"] or row["log_likelihood"] is None or mean is None:
            continue
        samples = format(row["log_likelihood"], _DIGITS), format(mean, _DIGITS)
        sensor, recording, channel = _place(row)
        of = first.setdefault((sensor, channel, *samples), recording)
        if of != recording:
            copies.setdefault((sensor, recording), {}).setdefault(of, []).append(channel)
    for (sensor, recording), found in copies.items():
        for of, channels in found.items():
            detail = (
                f"{recording} has the samples of {of} ({', '.join(channels)}): one log lies in the "
                "folder of the sensor twice, and would count as two; remove one of them"
            )
            finding = Finding("recording_twice", "warning", detail, float(len(channels)))
            yield finding.row(sensor, recording)


def _place(row: Row) -> tuple[str, str, str]:
    return row["sensor"], row["recording"], row["channel"]

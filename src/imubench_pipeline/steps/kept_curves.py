"""The Allan curves that the steps of a recording have left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.tables import read
from imubench_pipeline.tables.keys import divided


def curves(path: Path, samples: Mapping[str, int]) -> dict[str, AllanCurve]:
    """Read the curves of a recording from its table ``allan`` or the first of it, by channel.

    `samples`: how many each channel has, missing ones with them.
    """
    by_channel = divided(read("allan", [path]), "channel")
    return {
        channel: AllanCurve(
            tau=table["tau"].to_numpy(),
            cluster_size=table["cluster_size"].to_numpy(),
            variance=table["adev"].to_numpy() ** 2,
            samples=samples[channel],
            exponent=table["exponent"].to_numpy(),
            averaged=table["averaged"].to_numpy(),
            share=table["share"].to_numpy(),
            **degrees_of(table),
        )
        for (channel,), table in by_channel.items()
    }


def degrees_of(table: pa.Table) -> dict[str, Any]:
    """Return the degrees of freedom of a curve from the columns of its table."""
    return {
        "edf": table["edf"].to_numpy(),
        "edf_upper": table["edf_upper"].to_numpy(),
        "edf_source": tuple(table["edf_source"].to_pylist()),
    }


def compensated_curves(path: Path, measured: Mapping[str, AllanCurve]) -> dict[str, AllanCurve]:
    """Read the table ``allan_compensated`` of a recording, by channel.

    `measured`: the curves of the log as it is, with the same clusters.
    """
    by_channel = divided(read("allan_compensated", [path]), "channel")
    return {
        channel: replace(
            measured[channel], variance=table["adev"].to_numpy() ** 2, **degrees_of(table)
        )
        for (channel,), table in by_channel.items()
    }

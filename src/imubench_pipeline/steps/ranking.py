"""Rank the sensors for each requirement, and say what would help the verdicts most."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.compute as pc

from imubench_pipeline.navigation.in_outages import outage_rows
from imubench_pipeline.navigation.selection import ranked
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import judgements
from imubench_pipeline.navigation.verdicts.next_steps import next_step_rows
from imubench_pipeline.settings.requirements import requirements_of
from imubench_pipeline.tables import build, read, write_arrow


def write_ranking(tables: dict[str, Path], settings: str, outputs: list[Path]) -> None:
    """Write the tables ``ranking`` and ``next_steps``, as Parquet and CSV."""
    sections = json.loads(settings)
    requirements = requirements_of(sections["requirements"])
    joined = {name: read(name, [path]) for name, path in tables.items()}
    asked = joined.pop("error_budget").filter(pc.field("requirement").is_valid())
    navigation = joined.pop("navigation")
    columns = ["sensor", "recording", "channel", "recommended", "value"]
    recommended = joined["parameters"].select(columns).filter(pc.field("recommended"))
    basis = Basis.of(
        joined["recordings"].to_pylist(),
        joined["doubts"].to_pylist(),
        recommended.to_pylist(),
        joined["backtest"].to_pylist(),
    )
    sensors = sections["sensors"]
    outages = outage_rows(navigation.to_pylist(), joined["recordings"].to_pylist(), requirements)
    of_sensors = [row for row in (*asked.to_pylist(), *outages) if row["sensor"] in sensors]
    judged = list(judgements(of_sensors, requirements, sensors, basis))
    built = {
        "ranking": build("ranking", ranked(judged, basis)),
        "next_steps": build("next_steps", next_step_rows(judged, basis)),
    }
    for output in outputs:
        write_arrow(built[output.stem], output)

"""The models of the sensors, with which a page judges them by a requirement of the reader."""

import json
from typing import Any

from imubench_pipeline.estimators.rows import read_recommended_estimates
from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.navigation.error_budget.in_use import (
    collect_figures_in_use,
    read_stated_figures,
)
from imubench_pipeline.navigation.suitability import Abilities
from imubench_pipeline.navigation.verdicts import compact
from imubench_pipeline.recordings.fitness import list_excluded
from imubench_pipeline.report.site import Site
from imubench_pipeline.tables.keys import group_rows


def make_models(site: Site) -> str:
    """Return requirements and noise models as JSON; ``null`` if the settings have no models."""
    settings = site.settings.get("models")
    if not settings:
        return "null"
    packed = [compact.pack_requirement(*one) for one in site.requirements.items()]
    temperature = group_rows(site.rows(TemperatureRow), lambda row: (row.sensor, row.recording))
    apart = list_excluded(view.row for view in site.views)
    sensors: dict[str, Any] = {}
    for name, about in settings["sensors"].items():
        own = [view for view in site.views if view.sensor == name and view.static]
        usable = [view for view in own if view.full_name not in apart and not view.left_out]
        used, most = compact.select_recordings(usable)
        recordings = []
        for view in used:
            folder = site.results / "recordings" / name / view.name
            if not (folder / "parameters.parquet").is_file():
                continue
            estimates = read_recommended_estimates(
                folder / "parameters.parquet", folder / "draws.parquet"
            )
            figures = collect_figures_in_use(
                read_stated_figures(about["figures"]),
                estimates,
                temperature.get(view.full_name, ()),
            )
            channels = compact.pack_channels(estimates, figures, most=most, **settings["drawn"])
            recordings.append({"device": view.row.device, "channels": channels})
        has, price = Abilities.model_validate(about["abilities"]), about["price_class"]
        sensors[name] = {
            "simulated": all(view.simulated for view in own),
            "recordings": recordings,
            "demands": {
                key: compact.pack_demands(requirement, price, has)
                for key, requirement in site.requirements.items()
            },
        }
    listed = [one for one in packed if one]
    content = {"requirements": listed, "sensors": sensors, "mine": _list_own_numbers(site)}
    return json.dumps(content, separators=(",", ":"))


def _list_own_numbers(site: Site) -> dict[str, dict[str, float]]:
    """Return the numbers of each sensor that others are compared with.

    They are recommended parameters of its longest recording, a usable and measured one if there is
    one, by channel and symbol; and its margins, by requirement, and error and time of a limit.
    """
    numbers: dict[str, dict[str, float]] = {sensor: {} for sensor in site.sensors}
    chosen: dict[str, str] = {}
    for view in sorted(
        (view for view in site.views if view.static and not view.left_out),
        key=lambda view: (not view.row.decides, view.simulated, -(view.row.duration or 0.0)),
    ):
        chosen.setdefault(view.sensor, view.name)
    table = site.tables["parameters"]
    table = table.filter(table["recommended"]).select(
        ["sensor", "recording", "channel", "parameter", "component", "value"]
    )
    for row in table.to_pylist():
        if row["component"] == 1 and row["value"] and chosen.get(row["sensor"]) == row["recording"]:
            numbers[row["sensor"]][f"{row['channel']}.{row['parameter']}"] = row["value"]
    for ranked in site.rows(RankingRow):
        if ranked.margin:
            own, name = numbers.setdefault(ranked.sensor, {}), ranked.requirement
            own[f"{name}/{ranked.error}/{ranked.time:g}"] = ranked.margin
            if ranked.decides:
                own[name] = ranked.margin
    return numbers

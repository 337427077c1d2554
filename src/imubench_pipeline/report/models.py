"""The models of the sensors, with which a page judges them by a requirement of the reader."""

import json
from typing import Any

from imubench_pipeline.estimators.rows import read_recommended_estimates
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.navigation.error_budget.in_use import (
    collect_figures_in_use,
    read_stated_figures,
)
from imubench_pipeline.navigation.suitability import Abilities
from imubench_pipeline.navigation.verdicts import compact
from imubench_pipeline.recordings.fitness import list_excluded
from imubench_pipeline.report.site import Site
from imubench_pipeline.settings.requirements import validate_requirements


def make_models(site: Site) -> str:
    """Return requirements and models as JSON; ``null`` if there are none."""
    settings = site.settings.get("models")
    requirements = validate_requirements(site.settings["requirements"])
    packed = [compact.pack_requirement(*one) for one in requirements.items()]
    if not settings or not any(packed):
        return "null"
    temperature: dict[tuple[str, str], list[TemperatureRow]] = {}
    for row in site.rows(TemperatureRow):
        temperature.setdefault((row.sensor, row.recording), []).append(row)
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
                for key, requirement in requirements.items()
            },
        }
    listed = [one for one in packed if one]
    return json.dumps({"requirements": listed, "sensors": sensors}, separators=(",", ":"))

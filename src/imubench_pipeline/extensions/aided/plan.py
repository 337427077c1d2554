"""Select the sensors for navigation runs, and their settings."""

import json

from imubench_pipeline.extensions.aided.settings import NavigateSettings
from imubench_pipeline.run.plan import Plan, to_json


def list_navigated_sensors(plan: Plan) -> list[str]:
    """Return the sensors with static recordings that the settings select for navigation."""
    of = plan.run.section(NavigateSettings).of
    return [
        sensor
        for sensor, recordings in plan.at_rest.items()
        if of == "all"
        or (of == "simulated" and all((sensor, r) in plan.simulated for r in recordings))
    ]


def dump_navigate_settings(plan: Plan, sensor: str) -> str:
    """Return, as JSON, the settings of the navigation runs of a sensor."""
    declared = plan.sensors.get(sensor)
    return to_json(
        {
            "navigate": plan.run.section(NavigateSettings).model_dump(mode="json", exclude={"of"}),
            "asked": sorted(
                {
                    (limit.trajectory, limit.outage)
                    for requirement in plan.requirements.values()
                    for limit in requirement.in_outages
                }
            ),
            "sensor": declared.model_dump(mode="json", exclude_unset=True) if declared else None,
            "truths": json.loads(plan.truths(sensor)),
        }
    )

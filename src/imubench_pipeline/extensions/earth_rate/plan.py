"""Settings of the predictions for sensors at rest."""

from imubench_pipeline.extensions.earth_rate.settings import EarthRateSettings
from imubench_pipeline.run.plan import Plan, to_json


def select_outlook_settings(plan: Plan, sensor: str) -> str:
    """Return, as JSON, the settings of the predictions for a sensor at rest."""
    declared = plan.sensors.get(sensor)
    biases = {key: {"bias_repeatability", "offset"} for key in ("gyro", "accel")}
    printed = declared.datasheet.model_dump(mode="json", include=biases) if declared else {}
    settings = plan.run.section(EarthRateSettings).model_dump(mode="json")
    return to_json({"earth_rate": settings, "datasheet": printed})

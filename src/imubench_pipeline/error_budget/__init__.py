"""What a noise model means for navigation: errors of dead reckoning, by what they come of."""

from imubench_pipeline.error_budget.budget import (
    Budget,
    Contribution,
    Levelled,
    Quantity,
    Start,
    budget,
)
from imubench_pipeline.error_budget.growth import Calibrated, Uncalibrated
from imubench_pipeline.error_budget.gyrocompass import EARTH_RATE, Gyrocompass
from imubench_pipeline.error_budget.uncertainty import (
    chance_within,
    draw_models,
    drawn_jointly,
    interval,
)
from imubench_pipeline.error_budget.until import time_until

__all__ = [
    "EARTH_RATE",
    "Budget",
    "Calibrated",
    "Contribution",
    "Gyrocompass",
    "Levelled",
    "Quantity",
    "Start",
    "Uncalibrated",
    "budget",
    "chance_within",
    "draw_models",
    "drawn_jointly",
    "interval",
    "time_until",
]

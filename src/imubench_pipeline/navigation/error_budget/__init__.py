"""Dead-reckoning errors from a noise model, by source."""

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.navigation.error_budget.budget import Levelled, Start, budget, time_until
from imubench_pipeline.navigation.error_budget.gyrocompass import Gyrocompass
from imubench_pipeline.navigation.error_budget.in_use import (
    NO_FIGURES,
    NO_USE,
    Figure,
    Figures,
    Use,
)
from imubench_pipeline.navigation.error_budget.parts import Budget, Contribution, Missing, Quantity
from imubench_pipeline.navigation.error_budget.uncertainty import (
    compute_chance_within,
    compute_interval,
    draw_models,
)
from imubench_pipeline.noise.growth import Calibrated, Uncalibrated

__all__ = [
    "EARTH_RATE",
    "NO_FIGURES",
    "NO_USE",
    "Budget",
    "Calibrated",
    "Contribution",
    "Figure",
    "Figures",
    "Gyrocompass",
    "Levelled",
    "Missing",
    "Quantity",
    "Start",
    "Uncalibrated",
    "Use",
    "budget",
    "compute_chance_within",
    "compute_interval",
    "draw_models",
    "time_until",
]

"""Heading error of gyrocompassing: north from the Earth's rate, at rest.

An error dw of the mean of a horizontal gyro across north gives a heading error of
dw / (w_ie cos(latitude)). Neglected are the levelling error (tan(latitude) times the tilt about
north) and large angles.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.navigation.error_budget import in_use
from imubench_pipeline.navigation.error_budget.parts import (
    Budget,
    Contribution,
    Missing,
    compute_figure_contribution,
    describe_term,
)
from imubench_pipeline.noise import NoiseModel, Sinusoid
from imubench_pipeline.words.reasons import budgets as texts

_WINDOW_LENGTHS: NDArray[np.float64] = np.geomspace(1e-3, 1e9, 601)


@dataclass(frozen=True, kw_only=True)
class Gyrocompass:
    """A horizontal gyro for north-finding; ValueError for a value out of its range."""

    gyro: NoiseModel
    latitude: float  # rad, between the poles
    # turn-on bias, 1 sigma, rad/s; None: from ``figures``, else left out with a note
    bias: float | None = None
    # 2: the gyro is turned by 180 degrees after half the time; half the difference of the two means
    # has no turn-on bias
    positions: Literal[1, 2] = 1
    figures: in_use.Figures = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not abs(self.latitude) < math.pi / 2.0:
            raise ValueError(f"latitude is {self.latitude}, expected one between the poles, in rad")
        in_use.check_not_negative(bias=self.bias or 0.0)
        if self.positions not in (1, 2):
            raise ValueError(f"positions is {self.positions}, expected 1 or 2")

    def heading(self, time: float) -> Budget:
        """Return the heading error after a static window, s, by source, rad.

        At one position the error of the mean has, by term, the variance `Term.mean_variance`; at
        two positions sigma^2(t/2) / 2, with sigma^2 the Allan variance (Britting, "Inertial
        Navigation Systems Analysis", Wiley 1971). Raises a ValueError if the time is not above 0.
        """
        if not (math.isfinite(time) and time > 0):
            raise ValueError(f"time is {time}, expected a time above 0")
        biases = self._list_bias_errors()
        missing = [part for part in biases if isinstance(part, Missing)]
        return Budget(
            time,
            "heading",
            [
                *self._list_noise_errors(time, swings=True),
                *(part for part in biases if isinstance(part, Contribution)),
            ],
            [texts.HEADING_BIAS_NOT_KNOWN] if missing else [],
            missing,
        )

    def time_needed(self, accuracy: float) -> float | None:
        """Return the shortest static window, s, that gives a heading accuracy, 1 sigma, rad.

        The window is from 1 ms to 30 years; None if none is sufficient, because of turn-on bias,
        flicker noise, walk or ramp. For lines, the envelope of their mean is used. Raises a
        ValueError if the accuracy is not above 0.
        """
        if not (math.isfinite(accuracy) and accuracy > 0):
            raise ValueError(f"accuracy is {accuracy}, expected an angle above 0")

        biases = [part.sigma for part in self._list_bias_errors() if isinstance(part, Contribution)]

        def excess(logarithm: float) -> float:
            time = math.exp(logarithm)
            sigmas = (part.sigma for part in self._list_noise_errors(time, swings=False))
            return math.hypot(*sigmas, *biases) / accuracy - 1.0

        at = np.log(_WINDOW_LENGTHS)
        values = np.array([excess(float(x)) for x in at])
        reached = np.flatnonzero(values <= 0)
        if reached.size:
            first = int(reached[0])
            after = float(at[first])
        else:
            # The best window may lie between two of the sampled times.
            first = int(np.clip(np.argmin(values), 1, len(at) - 2))
            best = minimize_scalar(
                excess,
                bounds=(at[first - 1], at[first + 1]),
                method="bounded",
                options={"xatol": 1e-10},
            )
            after = float(best.x)
            if excess(after) > 0:
                return None
        if first == 0:
            return float(_WINDOW_LENGTHS[0])
        return math.exp(brentq(excess, float(at[first - 1]), after, xtol=1e-12))

    @property
    def _north_rate(self) -> float:
        """North component of the Earth's rate, rad/s."""
        return EARTH_RATE * math.cos(self.latitude)

    def _list_bias_errors(self) -> list[Contribution | Missing]:
        """Return the contributions of the gyro bias, which do not decrease with time."""
        if self.positions == 2:
            return []
        if self.bias is not None:
            sigma = self.bias / self._north_rate
            return [Contribution(ErrorSource("turn_on_bias", "gyro"), sigma, in_use.STATED_FIGURE)]
        parts = (
            compute_figure_contribution("gyro", cause, 1.0 / self._north_rate, self.figures)
            for cause in in_use.BIAS_CAUSES
        )
        return [part for part in parts if part is not None]

    def _list_noise_errors(self, time: float, *, swings: bool) -> Iterator[Contribution]:
        for term in self.gyro.terms:
            if isinstance(term, Sinusoid) and not swings:
                # The mean of a line is 0 after each whole period: use its envelope, of
                # |sin(x) / x| at one position, of sin^2(x/2) / (x/2) at two.
                x = math.pi * term.frequency * time / self.positions
                most = min(1.0, 1.0 / x) if self.positions == 1 else min(x, 1.0 / x)
                sigma = term.amplitude * most / math.sqrt(2.0)
            elif self.positions == 1:
                sigma = math.sqrt(term.mean_variance(time, 0.0))
            else:
                sigma = math.sqrt(float(term.allan_variance(np.array([time / 2.0]))[0]) / 2.0)
            yield Contribution(describe_term("gyro", term), sigma / self._north_rate)

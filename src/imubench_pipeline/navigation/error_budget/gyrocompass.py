"""Heading error of gyrocompassing: north from the Earth's rate, at rest.

An error dw of the mean of a horizontal gyro across north gives a heading error of
dw / (w_ie cos(latitude)). A tilt about north, the bias of the accelerometer divided by g,
projects the vertical part of the Earth's rate onto that gyro: a heading error of tan(latitude)
times the tilt. At several positions, with half turns between, both biases cancel. Large angles are
neglected.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.earth import EARTH_RATE, STANDARD_GRAVITY
from imubench_pipeline.model.states import Cause, Measured
from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.navigation.error_budget import in_use
from imubench_pipeline.navigation.error_budget.parts import Budget, Contribution, describe_term
from imubench_pipeline.noise import NoiseModel, Sinusoid
from imubench_pipeline.noise.terms.base import Term

_WINDOW_LENGTHS: NDArray[np.float64] = np.geomspace(1e-3, 1e9, 601)


@dataclass(frozen=True, kw_only=True)
class Gyrocompass:
    """A horizontal gyro for north-finding."""

    gyro: NoiseModel
    latitude: float  # rad, between the poles
    accel: NoiseModel = field(default_factory=NoiseModel)  # levels the gyro
    # turn-on biases, 1 sigma, rad/s and m/s^2; None: from the figures
    bias: float | None = None
    accel_bias: float | None = None
    # 1, or an even number: the gyro is turned by 180 degrees between equal parts of the time; the
    # alternating mean has no turn-on bias
    positions: int = 1
    figures: in_use.Figures = field(default_factory=dict)
    accel_figures: in_use.Figures = field(default_factory=dict)
    temperature_change: float = 0.0  # during the whole time, linear, K

    def heading(self, time: float) -> Budget:
        """Return the contributions to the heading error, rad, after a static window, s.

        At one position the error of the mean has, by term, the variance `Term.mean_variance`; at
        n positions sigma^2(t/n) / n, with sigma^2 the Allan variance (Britting, "Inertial
        Navigation Systems Analysis", Wiley 1971, for two).
        """
        noise = self._list_noise_errors(time, swings=True)
        return Budget(time, "heading", [*noise, *self._list_figure_errors()])

    def time_needed(self, accuracy: float) -> float | None:
        """Return the shortest static window, s, that gives a heading accuracy, 1 sigma, rad.

        The window is from 1 ms to 30 years; None if none is sufficient, because of turn-on bias,
        flicker noise, walk or ramp. For lines, the envelope of their mean is used.
        """
        biases = [part.sigma for part in self._list_figure_errors()]

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
        return EARTH_RATE * math.cos(self.latitude)

    @property
    def _tilt_factor(self) -> float:
        """Heading error from a tilt about north of 1 rad."""
        return abs(math.tan(self.latitude))

    def _list_figure_errors(self) -> Iterator[Contribution]:
        """Yield the contributions of the figures, which do not decrease with time."""
        per_rate, per_force = 1.0 / self._north_rate, self._tilt_factor / STANDARD_GRAVITY
        heated = self.temperature_change / (2.0 * self.positions)
        levers: list[tuple[Measured, Cause, float]] = [
            ("gyro", "temperature", per_rate * heated),
            ("accel", "temperature", per_force * heated),
        ]
        if self.positions == 1:
            levers.append(("accel", "misalignment", self._tilt_factor))
            biases: list[tuple[Measured, float | None, float]] = [
                ("gyro", self.bias, per_rate),
                ("accel", self.accel_bias, per_force),
            ]
            for measured, stated, lever in biases:
                if stated is None:
                    levers.append((measured, "turn_on_bias", lever))
                else:
                    source = ErrorSource("turn_on_bias", measured)
                    yield Contribution(source, stated * lever, in_use.STATED_FIGURE)
        for measured, cause, lever in levers:
            figure = (self.figures if measured == "gyro" else self.accel_figures).get(cause)
            if figure is not None and lever > 0.0:
                levelled = measured == "accel"
                source = ErrorSource(cause, measured, "initial_tilt" if levelled else None)
                yield Contribution(source, lever * figure.sigma, figure)

    def _list_noise_errors(self, time: float, *, swings: bool) -> Iterator[Contribution]:
        for term in self.gyro.terms:
            if isinstance(term, Sinusoid) and not swings:
                # The mean of a line is 0 after each whole period: use its envelope, of
                # |sin(x) / x| at one position, of sin^2(x/2) / (x/2) at several.
                x = math.pi * term.frequency * time / self.positions
                most = min(1.0, 1.0 / x) if self.positions == 1 else min(x, 1.0 / x)
                sigma = term.amplitude * most / math.sqrt(2.0)
            else:
                sigma = self._compute_mean_error(term, time)
            yield Contribution(describe_term("gyro", term), sigma / self._north_rate)
        for term in self.accel.terms:
            tilt = self._compute_mean_error(term, time) / STANDARD_GRAVITY
            source = describe_term("accel", term, "initial_tilt")
            yield Contribution(source, self._tilt_factor * tilt)

    def _compute_mean_error(self, term: Term, time: float) -> float:
        """Return the standard deviation of the mean, alternating over the positions."""
        if self.positions == 1:
            return math.sqrt(term.mean_variance(time, 0.0))
        part = np.array([time / self.positions])
        return math.sqrt(float(term.allan_variance(part)[0]) / self.positions)

"""Several sensors on one board: noise models, rates, and shared processes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_RATIO_TOLERANCE = 1e-9  # relative distance of a ratio of rates from a whole number (rounding)
_SHARED_PARAMETERS = ("N", "B", "K", "R")  # that sensors may share, each the root of a variance


@dataclass(frozen=True)
class Shared:
    """A process, such as a temperature, that acts on all sensors, each with a sensitivity."""

    model: NoiseModel  # the process in its own unit, such as kelvin, at the fused rate
    sensitivity: Sequence[float]  # of each sensor, signed: its SI unit per unit of the process


@dataclass(frozen=True)
class Parts:
    """Variances of the sensors of a board at several tau.

    The covariance of the sensors is diag(own) + sum over s of shared_s g_s g_s^T. The parts are
    stored separately, since the sum loses precision if the shared part is by far the largest.
    """

    own: Array  # shape (m, n); independent part of each sensor, SI^2
    shared: Array  # shape (m, s); shared processes, in their squared units
    sensitivities: Array  # shape (s, n); g: SI per these units

    def of_sum(self, weights: Array) -> tuple[Array, Array]:
        """Return independent and shared variance, SI^2, (m,) each, of a weighted sum of sensors."""
        alone = np.sum(self.own * weights**2, axis=1)
        return alone, np.sum(self.shared * (self.sensitivities @ weights) ** 2, axis=1)


@dataclass(frozen=True)
class Board:
    """Sensors that measure the same signal, all in SI; ValueError if they do not match.

    The fused rate is the lowest. A faster sensor is decimated by block means, which change neither
    N nor the Allan variance.
    """

    models: Sequence[NoiseModel]  # noise of each sensor, independent of the others
    rates: Sequence[float]  # Hz, one a sensor
    shared: Sequence[Shared] = ()  # independent of each other and of the models

    def __post_init__(self) -> None:
        if not self.models or len(self.models) != len(self.rates):
            raise ValueError(
                f"found {len(self.models)} models and {len(self.rates)} rates, expected one of "
                "each for every sensor"
            )
        if not all(math.isfinite(rate) and rate > 0 for rate in self.rates):
            raise ValueError(f"rates are {list(self.rates)}, expected numbers above 0")
        for rate in self.rates:
            ratio = rate / self.rate
            if abs(ratio - round(ratio)) > _RATIO_TOLERANCE * ratio:
                raise ValueError(
                    f"a rate of {rate:g} Hz is not a whole multiple of the lowest, {self.rate:g} "
                    "Hz; resample that sensor first"
                )
        for process in self.shared:
            sensitivity = np.asarray(process.sensitivity, dtype=np.float64)
            if sensitivity.shape != (len(self.models),) or not np.all(np.isfinite(sensitivity)):
                raise ValueError(f"found {sensitivity}, expected one finite sensitivity per sensor")

    @classmethod
    def alike(
        cls,
        model: NoiseModel,
        number: int,
        rate: float,
        correlation: Mapping[str, float] | None = None,
    ) -> "Board":
        """Return a board of ``number`` equal sensors; rate in Hz; correlation as in `divided`."""
        own, common = divided(model, correlation or {})
        shared = [Shared(common, [1.0] * number)] if common.terms else []
        return cls([own] * number, [rate] * number, shared)

    @property
    def sensors(self) -> int:
        """Number of sensors."""
        return len(self.models)

    @property
    def rate(self) -> float:
        """Fused rate, Hz."""
        return min(self.rates)

    @property
    def blocks(self) -> list[int]:
        """Number of samples of each sensor in one fused sample."""
        return [round(rate / self.rate) for rate in self.rates]

    @property
    def sensitivities(self) -> Array:
        """Sensitivities to all shared processes, shape (s, n)."""
        return np.array([process.sensitivity for process in self.shared], dtype=np.float64).reshape(
            len(self.shared), self.sensors
        )

    def check_weights(self, weights: Array) -> None:
        """Raise ValueError unless there is a weight for each sensor, and the sum is 1.

        With this sum, the common signal passes unchanged.
        """
        if weights.shape != (self.sensors,) or not abs(weights.sum() - 1.0) <= 1e-9:
            raise ValueError(f"weights are {weights}, expected {self.sensors} with a sum of 1")

    def allan_parts(self, tau: ArrayLike) -> Parts:
        """Return the Allan variances of the sensors at tau, s, (m,), rounded to whole samples."""
        t = np.atleast_1d(np.asarray(tau, dtype=np.float64))
        t = np.maximum(np.rint(t * self.rate), 1.0) / self.rate
        own = [m.allan_variance(t, r) for m, r in zip(self.models, self.rates, strict=True)]
        common = [process.model.allan_variance(t, self.rate) for process in self.shared]
        shared = np.array(common).reshape(len(self.shared), len(t))
        return Parts(np.column_stack(own), shared.T, self.sensitivities)


def divided(model: NoiseModel, correlation: Mapping[str, float]) -> tuple[NoiseModel, NoiseModel]:
    """Split the noise of a sensor into an independent part and one shared by all specimens.

    ``correlation`` has the shared fraction of the variance of N, B, K and R, 0 to 1; ValueError
    for another name or value. The fraction of B also applies to further Gauss-Markov processes.
    Quantization and lines are independent.
    """
    for name, value in correlation.items():
        if name not in _SHARED_PARAMETERS or not 0.0 <= value <= 1.0:
            raise ValueError(f"correlation of {name} is {value}; expected 0 to 1, of N, B, K or R")
    parts = []
    for common in (False, True):
        share = {
            name: math.sqrt(correlation.get(name, 0.0) if common else 1 - correlation.get(name, 0))
            for name in _SHARED_PARAMETERS
        }
        parts.append(
            replace(
                model,
                Q=0.0 if common else model.Q,
                **{name: getattr(model, name) * share[name] for name in _SHARED_PARAMETERS},
                further=[term.scaled(share["B"]) for term in model.further if share["B"] > 0],
                sinusoids=() if common else model.sinusoids,
            )
        )
    return parts[0], parts[1]

"""Several sensors on one board: noise models, rates, and shared processes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_RATIO_TOLERANCE = 1e-9  # relative distance of a ratio of rates from a whole number (rounding)
_SHARED_PARAMETERS = ("N", "B", "K", "R")  # that sensors may share, each the root of a variance


@dataclass(frozen=True)
class Shared:
    """One process, such as a temperature, that acts on several sensors with sensitivities."""

    model: NoiseModel  # the process in its own unit, such as kelvin, at the fused rate
    sensitivity: Sequence[float]  # SI unit of the sensors per that unit, one a sensor, with sign


@dataclass(frozen=True)
class Parts:
    """Variances of the sensors of a board at several frequencies or tau.

    The covariance of the sensors is diag(own) + sum over s of shared_s g_s g_s^T. The parts are
    stored separately, since the sum loses precision if the shared part is far the largest.
    """

    own: Array  # shape (m, n); independent part of each sensor, SI^2
    shared: Array  # shape (m, s); shared processes, in their squared units
    sensitivities: Array  # shape (s, n); g: SI per these units

    def of_sum(self, weights: NDArray[Any]) -> Array:
        """Return the independent and shared variances of sums, weighted (m, n): SI^2, (m, 2)."""
        alone = np.sum(self.own * np.abs(weights) ** 2, axis=1)
        common = np.sum(self.shared * np.abs(weights @ self.sensitivities.T) ** 2, axis=1)
        return np.column_stack((alone, common))


@dataclass(frozen=True)
class Board:
    """Sensors that measure the same signal, all in SI; ValueError if they do not match.

    The fused rate is the lowest. A faster sensor is decimated by block means: N and the Allan
    variance do not change; the spectrum above the fused Nyquist frequency is aliased below it,
    attenuated by |sin(m w/2) / (m sin(w/2))|^2.
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
                    "Hz; "
                    "resample that sensor first"
                )
        for process in self.shared:
            sensitivity = np.asarray(process.sensitivity, dtype=np.float64)
            if sensitivity.shape != (len(self.models),) or not np.all(np.isfinite(sensitivity)):
                raise ValueError("expected one finite sensitivity for every sensor")

    @classmethod
    def alike(
        cls,
        model: NoiseModel,
        number: int,
        rate: float,
        correlation: Mapping[str, float] | None = None,
    ) -> "Board":
        """Return a board of equal sensors, at a rate in Hz; the correlation is as for `divided`."""
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

    def allan_parts(self, tau: ArrayLike) -> Parts:
        """Return the Allan variances of the sensors at whole samples next to tau, s, shape (m,)."""
        t = np.atleast_1d(np.asarray(tau, dtype=np.float64))
        t = np.maximum(np.rint(t * self.rate), 1.0) / self.rate
        own = [m.allan_variance(t, r) for m, r in zip(self.models, self.rates, strict=True)]
        common = [process.model.allan_variance(t, self.rate) for process in self.shared]
        return self._make_parts(own, common, len(t))

    def spectral_parts(self, omega: ArrayLike) -> Parts:
        """Return the spectra without ramps and lines at omega, rad per sample, shape (m,)."""
        w = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        spectra: dict[tuple[int, int], Array] = {}  # specimens of one sensor have the same spectrum
        keys = [(id(m), size) for m, size in zip(self.models, self.blocks, strict=True)]
        for key, model, rate in zip(keys, self.models, self.rates, strict=True):
            if key not in spectra:
                spectra[key] = block_mean_spectrum(model, w, rate, key[1])
        common = [process.model.sampled_spectrum(w, self.rate) for process in self.shared]
        return self._make_parts([spectra[key] for key in keys], common, len(w))

    def _make_parts(self, own: Sequence[Array], common: Sequence[Array], points: int) -> Parts:
        shared = np.array(common).reshape(len(self.shared), points)
        return Parts(np.column_stack(own), shared.T, self.sensitivities)


def divided(model: NoiseModel, correlation: Mapping[str, float]) -> tuple[NoiseModel, NoiseModel]:
    """Split the noise of a sensor into an independent part and one shared by all specimens.

    ``correlation`` has the shared fraction of the variance of N, B, K and R, 0 to 1, or
    ValueError. The fraction of B applies to further Gauss-Markov processes, too. Quantization and
    lines are independent.
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


def block_mean_spectrum(model: NoiseModel, omega: Array, rate: float, size: int) -> Array:
    """Return the spectrum of block means of ``size`` (m) samples, with all aliases, SI^2.

    sum over k of P((w + 2 pi k)/m) sin^2(w/2) / (m^3 sin^2((w + 2 pi k)/(2m))), with w ``omega``,
    shape (m,), rad per block, above 0 and up to pi; the rate of the samples is in Hz.
    """
    if size == 1:
        return model.sampled_spectrum(omega, rate)
    total = np.zeros_like(omega)
    for fold in range(size):
        folded = (omega + 2.0 * np.pi * fold) / size
        transfer = (np.sin(omega / 2.0) / np.sin(folded / 2.0)) ** 2 / size**3
        total += transfer * model.sampled_spectrum(folded, rate)
    return total


def stochastic(model: NoiseModel) -> NoiseModel:
    """Return a model without its ramp and lines, which have no spectral density."""
    return replace(model, R=0.0, sinusoids=())

"""Channels that may represent their sensor, and the number of sensors that equals a better one."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.estimators.estimate import Estimate, JointDraws
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import pools as texts

_MIN_RELEVANT_SHARE = 0.1
"""Minimum share of the Allan variance for which an unknown parameter matters."""


def compute_number_needed(own: ArrayLike, common: ArrayLike, wanted: ArrayLike) -> Array:
    """Return the number of sensors of one kind whose mean has a given Allan variance.

    The mean of n sensors has ``own / n + common``. n is not rounded, may be below 1, and is
    infinite if no number is enough. The Allan variances of the independent and of the common part,
    and the wanted one, array_like, are in (rad/s)^2 or (m/s^2)^2.
    """
    own, common, wanted = np.broadcast_arrays(own, common, wanted)
    room = np.asarray(wanted - common, dtype=np.float64)
    return np.divide(own, room, out=np.full(room.shape, math.inf), where=room > 0.0)


@dataclass(frozen=True)
class TemperaturePart:
    """Temperature effect on a channel, which is common to all specimens on a board."""

    tau: Array  # shape (t,); s
    deviation: Array  # shape (t,); its Allan deviation over the recording, (rad/s) or (m/s²)
    relative_error: float  # standard deviation of the sensitivity over its value

    def variance(self, tau: float) -> float:
        """Return its Allan variance at a tau in s, (rad/s)² or (m/s²)²."""
        log_deviation = np.log(np.maximum(self.deviation, 1e-300))
        return math.exp(2.0 * float(np.interp(math.log(tau), np.log(self.tau), log_deviation)))

    def drawn(self, tau: float, draws: int, rng: np.random.Generator) -> Array:
        """Return Allan variances, shape (draws,), of sensitivities drawn from their interval."""
        factor = 1.0 + self.relative_error * rng.standard_normal(draws)
        return np.asarray(factor**2 * self.variance(tau))


@dataclass(frozen=True)
class ComparedChannel:
    """A channel that may represent its sensor."""

    sensor: str
    recording: str
    channel: str
    simulated: bool
    duration: float  # of the recording, s
    # the recommended one, after removal of the temperature effect, if any
    estimate: Estimate
    temperature: TemperaturePart | None = None  # removed temperature effect
    # loads the joint draws, if the estimate does not contain them: in a run, they are read only for
    # the representative channels
    joint: Callable[[], JointDraws | None] | None = None

    def drawn(self, draws: int, rng: np.random.Generator) -> list[NoiseModel]:
        """Return noise models drawn from the estimate (`draw_models`)."""
        estimate = self.estimate
        if estimate.draws is None and self.joint is not None:
            estimate = replace(estimate, draws=self.joint())
        return draw_models(estimate, draws, rng)

    @cached_property
    def model(self) -> NoiseModel:
        """The noise model of the estimate."""
        return self.estimate.model

    def variance(self, tau: float) -> float:
        """Return the Allan variance, (rad/s)² or (m/s²)², at a tau in s."""
        return float(self.model.allan_variance(tau)) + self.of_temperature(tau)

    def of_temperature(self, tau: float) -> float:
        """Return the Allan variance from temperature, (rad/s)² or (m/s²)², at a tau in s."""
        return 0.0 if self.temperature is None else self.temperature.variance(tau)

    def unknown(self, tau: float) -> Iterator[str]:
        """Yield the parameters that are not determined and may matter at a tau in s."""
        total = self.variance(tau)
        groups = [self.estimate.parameters, *self.estimate.further]
        for group in groups:
            for name, parameter in group.items():
                if parameter.value is not None or parameter.status in ("absent", "not_shown"):
                    continue
                # The largest Allan variance of a parameter, from its value or upper limit
                size = {
                    key: parameter.in_model if parameter.upper is None else parameter.upper
                    for key, parameter in group.items()
                }
                if name in ("B", "T_B"):
                    time = group["T_B"].in_model if "T_B" in group else None
                    model = NoiseModel(B=size["B"] or 0.0, T_B=time or None)
                else:
                    of = {key: (size[name] or 0.0) * (key == name) for key in ("Q", "N", "K", "R")}
                    model = NoiseModel(Q=of["Q"], N=of["N"], K=of["K"], R=of["R"])
                part = float(model.allan_variance(tau))
                if part > _MIN_RELEVANT_SHARE * total:
                    recording = f"{self.sensor}/{self.recording}"
                    yield texts.undetermined(name, recording, self.channel, parameter.status)

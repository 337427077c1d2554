"""Result of every estimator: parameters with their status, and their noise model."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from imubench_pipeline import units
from imubench_pipeline.noise import PARAMETERS as TERM_PARAMETERS
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid, TermParameter
from imubench_pipeline.settings.sensor import QUANTITIES
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import estimates as texts

_OF_POWERS = {
    (1.0, 1.0): "{quantity}_quantization",
    (1.0, 0.5): "{quantity}_density",
    (1.0, 0.0): "{signal}",
    (1.0, -0.5): "{quantity}_random_walk",
    (1.0, -1.0): "{quantity}_ramp",
    (0.0, 1.0): "time",
    (0.0, -1.0): "frequency",
}
"""Dimension (`units.SI_UNITS`) by the powers of the signal and of seconds."""


def _get_dimension(quantity: str, parameter: TermParameter) -> str:
    powers = parameter.signal, parameter.seconds
    if powers not in _OF_POWERS:
        raise ValueError(
            f"the parameter {parameter.symbol} has the dimension signal^{powers[0]:g} "
            f"s^{powers[1]:g}, expected a dimension with a unit in `units.SI_UNITS`"
        )
    return _OF_POWERS[powers].format(quantity=quantity, signal=QUANTITIES[quantity])


DIMENSIONS: Mapping[str, Mapping[str, str]] = {
    quantity: {symbol: _get_dimension(quantity, each) for symbol, each in TERM_PARAMETERS.items()}
    | {"N_sensor": f"{quantity}_density"}
    | {"B_curve": signal, "sigma_min": signal, "tau_min": "time"}
    for quantity, signal in QUANTITIES.items()
}
"""Dimension (`units.SI_UNITS`) of each parameter and figure beside them, by quantity."""

Status = Literal["ok", "doubtful", "not_shown", "at_bound", "not_identified", "absent"]

PARAMETERS = ("N", "B", "T_B", "K")
"""The parameters of the papers' model."""

FAMILY = ("Q", "N", "B", "T_B", "K", "R")
"""The parameters of all terms; lines have an amplitude and a frequency in addition."""

CURVE = ("B_curve", "sigma_min", "tau_min")
"""Figures of the Allan deviation of any model (`imubench_pipeline.estimators.curve_bias`)."""

SENSOR = "N_sensor"
"""Density of the white noise before a low-pass filter or interpolation found in the spectrum, and
before aliasing. N is the density in the log; N_sensor never replaces it."""

SHOWN = ("Q", "N", SENSOR, "B_curve", "sigma_min", "tau_min", "B", "T_B", "K", "R")
"""Display order of the parameters."""

COMPARED = ("N", "B_curve", "sigma_min", "K")
"""Parameters that are the same quantity in all models, and are compared between sensors."""

MAX_LIMIT_RATIO = 4.0
"""Upper over lower 95 % limit of a value, above which only its interval is given."""

_MAX_OPEN_RATIO = 10.0
"""Ratio of the limits of a parameter without a value, above which the lower one is set to 0."""

BROADBAND_TIME = 1.0
"""Correlation time below which a Gauss-Markov process is broadband noise, no bias instability, s.
"""

SIGMAS = 1.96
"""Standard errors on either side of a value in a 95 % interval."""

SI_UNITS: dict[str, dict[str, str]] = {
    quantity: {symbol: units.SI_UNITS[dimension] for symbol, dimension in dimensions.items()}
    for quantity, dimensions in DIMENSIONS.items()
}
"""SI unit of each parameter, by quantity."""


@dataclass(frozen=True)
class Parameter:
    """One estimated parameter."""

    value: float | None  # SI; None where the status says why there is none
    status: Status = "ok"
    """``ok``; ``doubtful``: something about the log or the fit says that the value may be wrong;
    ``not_shown``: the curve does not show it; ``at_bound``: the fit ran into the end of its search;
    ``not_identified``: the log cannot determine it; ``absent``: the model has no such term."""
    reason: str | None = None
    lower: float | None = None  # 95 % limits, where the method gives them
    upper: float | None = None
    duration_needed: float | None = None  # length of a log that would give the value to 10 %, s
    fitted: float | None = None  # the value in the model of the log, where no value is given

    @property
    def in_model(self) -> float | None:
        """The value in the model of the log: ``fitted`` if it is set, else ``value``."""
        return self.value if self.fitted is None else self.fitted

    def checked(self) -> "Parameter":
        """Return the parameter; an ``ok`` one with too wide an interval is ``not_identified``."""
        if self.status != "ok" or self.lower is None or self.upper is None:
            return self
        near, far = sorted((abs(self.lower), abs(self.upper)))
        signs = np.sign(self.lower) * np.sign(self.upper)
        if signs > 0 and far <= MAX_LIMIT_RATIO * near:
            return self
        if signs > 0:
            reason = texts.wide_interval(far / near)
        else:
            reason = texts.interval_with_zero(at_limit=signs == 0)
        # The prior, and not the data, decides how far down such draws reach.
        is_open = signs > 0 and self.lower > 0.0 and far > _MAX_OPEN_RATIO * near
        return replace(self.withheld(reason), lower=0.0 if is_open else self.lower)

    def withheld(self, reason: str) -> "Parameter":
        """Return the parameter as ``not_identified``, with its value moved to ``fitted``."""
        fitted = self.in_model
        return replace(self, value=None, status="not_identified", reason=reason, fitted=fitted)


@dataclass(frozen=True, eq=False)
class JointDraws:
    """Noise models drawn from the posterior of an estimate, over the models the log allows."""

    first: Array
    """(d, 6): Q, N, B, T_B, K and R, SI, of each draw; 0 for an absent term. T_B is NaN where B is
    flicker noise, or 0."""
    further: Array
    """(d, g, 2): B and T_B of the further Gauss-Markov processes; 0 and NaN where there is none."""

    def __len__(self) -> int:
        return len(self.first)

    def model(self, number: int, sinusoids: Sequence[Sinusoid] = ()) -> NoiseModel:
        """Return the noise model of a draw, numbered from 0, with ``sinusoids`` added."""
        Q, N, B, T_B, K, R = self.first[number].tolist()
        time = T_B if T_B > 0.0 else None
        further = [GaussMarkov(b, t) for b, t in self.further[number].tolist() if b > 0.0]
        return NoiseModel(Q=Q, N=N, B=B, T_B=time, K=K, R=R, further=further, sinusoids=sinusoids)


@dataclass(frozen=True)
class Estimate:
    """The parameters of one channel by one method.

    A value is ``ok`` only where its interval is narrow enough (`Parameter.checked`).
    """

    method: str
    parameters: Mapping[str, Parameter]
    """Q, N, B, T_B, K, R as far as the method knows them, and N_sensor where a low-pass or an
    interpolation shows."""
    further: Sequence[Mapping[str, Parameter]] = ()
    """Components beyond the first: B and T_B of a second Gauss-Markov process."""
    lines: Sequence[Mapping[str, Parameter]] = ()  # amplitude and frequency of each sinusoid
    curve: Mapping[str, Parameter] = field(default_factory=dict)  # figures of the curve, `CURVE`
    draws: JointDraws | None = field(default=None, compare=False, repr=False)
    """Noise models drawn jointly from the posterior, without lines; None for other methods."""

    def __post_init__(self) -> None:
        # The class is frozen.
        for name in ("parameters", "curve"):
            object.__setattr__(self, name, _checked(getattr(self, name)))
        for name in ("further", "lines"):
            object.__setattr__(self, name, [_checked(group) for group in getattr(self, name)])

    def components(self) -> Iterator[tuple[int, str, Parameter]]:
        """Yield component number, name and parameter, the first component first."""
        groups = [(1, self.parameters), (1, self.curve), *enumerate(self.further, start=2)]
        for number, group in [*groups, *enumerate(self.lines, start=1)]:
            for name, parameter in group.items():
                yield number, name, parameter

    def revised(self, change: Callable[[str, Parameter], Parameter]) -> "Estimate":
        """Return the estimate with changed parameters of the first component and of the curve."""
        parameters, curve = (
            {name: change(name, each) for name, each in group.items()}
            for group in (self.parameters, self.curve)
        )
        return replace(self, parameters=parameters, curve=curve)

    @property
    def model(self) -> NoiseModel:
        """The noise model with all parameters that have a value, or a fitted one."""
        values = {name: parameter.in_model for name, parameter in self.parameters.items()}
        amplitudes = {name: values.get(name) or 0.0 for name in ("Q", "N", "B", "K", "R")}
        pairs = [(group["B"].in_model, group["T_B"].in_model) for group in self.further]
        waves = [(group["amplitude"].in_model, group["frequency"].in_model) for group in self.lines]
        return NoiseModel(
            **amplitudes,
            T_B=values.get("T_B"),
            further=[GaussMarkov(B, T_B) for B, T_B in pairs if B and T_B],
            sinusoids=[Sinusoid(A, f) for A, f in waves if A and f],
        )


def _checked(group: Mapping[str, Parameter]) -> dict[str, Parameter]:
    return {name: parameter.checked() for name, parameter in group.items()}


def not_shown(method: str, reason: str) -> Estimate:
    """Return an estimate in which N, B, T_B, K and the curve are ``not_shown``, with a reason."""
    nothing = Parameter(None, "not_shown", reason)
    return Estimate(method, dict.fromkeys(PARAMETERS, nothing), curve=dict.fromkeys(CURVE, nothing))

"""The true figures of a simulated axis, in the terms of what is estimated from its log."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from imubench_pipeline.estimators.estimate import SI_UNITS
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.settings.simulated_sensor import AxisSettings
from imubench_pipeline.simulate.model import in_the_log
from imubench_pipeline.simulate.models import axis_model


@dataclass(frozen=True)
class Figure:
    """One true figure.

    Attributes
    ----------
    name : str
        Of the parameter, as the tables have it.
    value : float
        SI; degC for a temperature.
    unit : str
    setting : str
        Key of `AxisSettings` that it is from.
    component : int
        Number of a repeated term, from 1.
    """

    name: str
    value: float
    unit: str
    setting: str
    component: int = 1


def figures_of(settings: AxisSettings, channel: str, rate: float) -> Iterator[Figure]:
    """Yield the true figures of an axis.

    N is the density before the low-pass; ``N in the log``, that its low frequencies show, stands
    beside it where there is one.

    Parameters
    ----------
    settings : AxisSettings
    channel : str
    rate : float
        Of the log, Hz.
    """
    quantity = quantity_of(channel)
    units, plain = SI_UNITS[quantity], SI_UNITS[quantity]["B"]
    model = axis_model(settings, channel)
    for name, value in settings.si(channel).items():
        if name == "N":
            shown = in_the_log(model, rate)
            N = model.noise.N if model.low_pass is not None else shown
            yield Figure(name, N, units[name], name)
            if model.low_pass is not None:
                yield Figure("N in the log", shown, units[name], name)
        elif name in ("Q", "K", "R"):
            yield Figure(name, value, units[name], name)
        elif name == "bias":
            yield Figure(name, value, plain, name)
    for number, (figures, setting) in enumerate(_processes(settings, channel), start=1):
        for name, value in figures.items():
            yield Figure(name, value, units[name], setting, number)
    lines = sorted((line.si(quantity) for line in settings.sinusoids), key=lambda f: f["frequency"])
    for number, line in enumerate(lines, start=1):
        for name, value in line.items():
            yield Figure(name, value, units[name], "sinusoids", number)
    if settings.drift is not None:
        of_drift = {
            "sensitivity": f"{plain}/K",
            "reference": "degC",
            "quadratic": f"{plain}/K^2",
            "lag": "s",
        }
        for name, value in settings.drift.si(quantity).items():
            yield Figure(name, value, of_drift[name], "drift")
    if model.low_pass is not None:
        yield Figure("cutoff", model.low_pass.cutoff, "Hz", "low_pass")


def _processes(settings: AxisSettings, channel: str) -> list[tuple[dict[str, float], str]]:
    """Return B and T_B of each process as estimates number them: flicker noise first, then T_B."""
    own = settings.si(channel)
    found = [(process.si(quantity_of(channel)), "further") for process in settings.further]
    if "B" in own:
        found.append(({name: own[name] for name in ("B", "T_B") if name in own}, "B"))
    return sorted(found, key=lambda process: process[0].get("T_B", 0.0))

"""Dimension of each noise parameter, as declared by its term: its SI unit in tables."""

from __future__ import annotations

from collections.abc import Mapping

from imubench_pipeline.noise import PARAMETERS, TermParameter
from imubench_pipeline.settings.sensor import QUANTITIES

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


def _dimension(quantity: str, parameter: TermParameter) -> str:
    powers = parameter.signal, parameter.seconds
    if powers not in _OF_POWERS:
        raise ValueError(
            f"the parameter {parameter.symbol} has the dimension signal^{powers[0]:g} "
            f"s^{powers[1]:g}, expected one of which `units.SI_UNITS` has the unit"
        )
    return _OF_POWERS[powers].format(quantity=quantity, signal=QUANTITIES[quantity])


DIMENSIONS: Mapping[str, Mapping[str, str]] = {
    quantity: {symbol: _dimension(quantity, parameter) for symbol, parameter in PARAMETERS.items()}
    | {"N_sensor": f"{quantity}_density"}
    | {"B_curve": signal, "sigma_min": signal, "tau_min": "time"}
    for quantity, signal in QUANTITIES.items()
}
"""Dimension (`units.SI_UNITS`) of each parameter and figure beside them, by quantity."""

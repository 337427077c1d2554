"""What the figures call channels, logs and noise terms."""

from __future__ import annotations

from imubench_pipeline.noise import PARAMETERS, TERMS
from imubench_pipeline.report.view import QUANTITY_NAMES, ChannelView

_OF_CHANNEL = {
    "gyro": {"signal": "rate", "integral": "angle"},
    "accel": {"signal": "acceleration", "integral": "velocity"},
}

TERM_NAMES = {
    quantity: {kind.symbol: kind.standard_name.format(**words) for kind in TERMS}
    for quantity, words in _OF_CHANNEL.items()
}
"""The field's names of the terms, by quantity and symbol of the term."""

_GREEK = ("beta", "omega", "sigma", "tau")


def _set(symbol: str) -> str:
    """Return a symbol as mathematics sets it."""
    letter, _, index = symbol.partition("_")
    letter = f"\\{letter}" if letter in _GREEK else letter
    return letter + (f"_{index}" if len(index) < 2 else f"_{{{index}}}") * bool(index)


SYMBOLS = {
    symbol: f"$|{_set(symbol)}|$" if parameter.signed else f"${_set(symbol)}$"
    for symbol, parameter in PARAMETERS.items()
}
SYMBOLS |= {"B_curve": "$B$ of the curve", "sigma_min": r"$\sigma_\mathrm{min}$"}
SYMBOLS |= {"tau_min": r"$\tau_\mathrm{min}$"}
"""The parameters as they are set; a logarithmic axis has no sign of R."""


def channel_name(channel: str) -> str:
    """Return a channel in words, such as ``Gyroscope, x axis``."""
    quantity, axis = channel.split("_", maxsplit=1)
    return f"{QUANTITY_NAMES[quantity]}, {axis} axis"


def log_name(view: ChannelView) -> str:
    """Return what the curve of a log is called: never measured, where it is simulated."""
    return "simulated log" if view.simulated else "measured"


def entitled(view: ChannelView) -> tuple[str, str]:
    """Return the names of the user, and what follows them in the title of a channel's figure."""
    name = channel_name(view.channel)
    rest = " (simulated)" * view.simulated + f": {name[0].lower()}{name[1:]}"
    return f"{view.sensor} / {view.recording}", rest

"""Names of channels, logs and noise terms in the figures."""

from __future__ import annotations

from imubench_pipeline.noise import PARAMETERS, TERMS
from imubench_pipeline.report.view import QUANTITY_NAMES, ChannelView

_QUANTITY_WORDS = {
    "gyro": {"signal": "rate", "integral": "angle"},
    "accel": {"signal": "acceleration", "integral": "velocity"},
}

TERM_NAMES = {
    quantity: {kind.symbol: kind.standard_name.format(**words) for kind in TERMS}
    for quantity, words in _QUANTITY_WORDS.items()
}
"""Standard names of the terms, by quantity and symbol of the term."""

_GREEK_LETTERS = ("beta", "omega", "sigma", "tau")


def _set(symbol: str) -> str:
    """Return a symbol in TeX notation."""
    letter, _, index = symbol.partition("_")
    letter = f"\\{letter}" if letter in _GREEK_LETTERS else letter
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
    """Return the name of the curve of a log: measured or simulated."""
    return "simulated log" if view.simulated else "measured"


def entitled(view: ChannelView) -> tuple[str, str]:
    """Return sensor and recording, and the rest of the title of a channel's figure."""
    name = channel_name(view.channel)
    rest = " (simulated)" * view.simulated + f": {name[0].lower()}{name[1:]}"
    return f"{view.sensor} / {view.recording}", rest

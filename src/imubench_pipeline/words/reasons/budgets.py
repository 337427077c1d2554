"""Assumptions and reasons of error budgets, by a log or by a datasheet."""

from collections.abc import Mapping, Sequence

from imubench_pipeline.model.states import Status
from imubench_pipeline.settings.printed import SENSORS
from imubench_pipeline.words.estimates import STATUS_WORDS, symbol_text
from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import join_names

_NUMBERS: Mapping[str, str] = {
    "sigma": "value",
    "lower": "lower limit",
    "upper": "upper limit",
    "within": "probability",
    "limit": "limit to meet",
}
"""Numbers of an error that a verdict needs."""


def not_recorded(quantity: str) -> str:
    return f"the recording has no {SENSORS[quantity]}"


def noise_not_known(channels: Sequence[str], reason: str | None) -> str:
    names = join_names(list(map(channel_name, channels)))
    return f"the noise of {names} is not known: {reason or 'the log does not show it'}"


def channel_not_used(channel: str, reason: str | None) -> str:
    return f"{channel_name(channel)} is not used, as {noise_not_known([channel], reason)}"


def parameter_status(symbol: str, channel: str, status: Status) -> str:
    return f"{symbol_text(symbol)} of {channel_name(channel)} is {STATUS_WORDS[status]}"


def independent_draws(method: str, channel: str) -> str:
    return (
        f"method {method} gives separate intervals for the parameters of {channel_name(channel)}: "
        "the interval of the error may be too wide"
    )


def missing_numbers(names: Sequence[str]) -> str:
    """Return the missing numbers of an error; ``names``: column names."""
    return f"the error has {join_names([f'no {_NUMBERS[name]}' for name in names])}"


NOISE_NOT_PRINTED = "its datasheet does not print all noise parameters: a log is needed"

"""Doubts about recordings in words, by their codes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from imubench_pipeline.words.findings import FINDINGS
from imubench_pipeline.words.numbers import join_names

_TEXTS: Mapping[str, str] = {
    "suspicious_unit": "the unit of {channels} looks wrong",
    "rate_implausible": "the sampling rate looks wrong",
    "turning": "the sensor was turning",
    "simulated_beside_measured": "it is simulated, and other recordings are measured",
    "not_sold": "this sensor is not sold",
    "not_explained": "no model explains the spectrum of {channels}",
    "doubtful": "the decisive parameter is doubtful",
    "bias_step": "the bias of {channels} changes suddenly",
    "warm_up_drift": "warm-up drift of {channels}",
    "periodic_drift": "periodic drift of {channels}",
    "telegraph_noise": "telegraph noise in {channels}",
    "K_differs": "the random walk of {channels} differs between the halves of the log",
    "slow_noise_differs": "the slow noise of {channels} differs between the halves of the log",
    "slow_noise_missing": "the slow noise of {channels} is missing",
    "noise_grows": "the white noise of {channels} changes over the log",
    "noise_varies": "the white noise of {channels} differs between parts of the log",
    "backtest_contradicts": "the drift of {channels} exceeds the prediction",
    "strong_line": "a strong spectral line in {channels}",
}


def doubt_text(code: str, channels: Sequence[str] = ()) -> str:
    """Return a doubt in words: ``the unit of gyro z looks wrong``."""
    where = join_names([channel.replace("_", " ") for channel in channels])
    declared = FINDINGS.get(code)
    if text := _TEXTS.get(code) or (declared and declared.doubt):
        return text.format(channels=where or "the data", are="is" if len(channels) == 1 else "are")
    return code.replace("_", " ") + (f" ({where})" if where else "")

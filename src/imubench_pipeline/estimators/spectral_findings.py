"""What the spectrum of a channel tells of its quality: lines, and where a filter begins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from imubench_pipeline.estimators.carried_lines import MOST, joined_finding
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.findings import Finding

_STRONG = 0.5
"""Part of what white noise integrates to in a second from which a sinusoid counts in budgets."""


def line_findings(
    lines: Iterable[Mapping[str, Any]], white: Mapping[str, float] | None = None
) -> list[Finding]:
    """Return a note for each channel with lines, from rows of the table ``lines``.

    There is a warning where they are too many for a noise model to carry each on, and where one is
    so strong that it is a good part of an error budget: a sensor seldom makes such a line itself.

    Parameters
    ----------
    lines : iterable of mapping
        With ``channel``, ``kind``, ``frequency`` (Hz), ``amplitude`` (SI) and ``ratio``.
    white : mapping of str to float, optional
        N of each channel, where it is known.
    """
    by_channel: dict[str, list[Mapping[str, Any]]] = {}
    for line in lines:
        if line["kind"] != "alias":
            by_channel.setdefault(line["channel"], []).append(line)
    findings = []
    for channel, group in by_channel.items():
        strongest = max(group, key=lambda line: line["ratio"])
        sinusoids = [line for line in group if line["kind"] == "sinusoid"]
        number = len(sinusoids)
        detail = (
            f"{channel} has {number} sinusoids and {len(group) - number} bands of noise, the "
            f"strongest at {strongest['frequency']:.5g} Hz, {strongest['ratio']:.3g} times the "
            "noise there; they are left out of the likelihood"
        )
        findings.append(Finding("lines", "note", detail, strongest["frequency"], channel))
        strong = _strong(channel, sinusoids, (white or {}).get(channel))
        findings += [strong] if strong else []
        if number > MOST:
            findings.append(joined_finding(channel, quantity_of(channel), sinusoids))
    return findings


def _strong(
    channel: str, sinusoids: Iterable[Mapping[str, Any]], white: float | None
) -> Finding | None:
    """Return a warning of the sinusoid that integrates to most in a second.

    Its integral A / (2 pi f) differs by A sin(pi f t) / (pi f sqrt(2)) rms after t; the sine is
    at most 1, or its argument.
    """
    if not white:
        return None
    parts = {
        line["amplitude"] / (math.sqrt(2.0) * max(1.0, math.pi * line["frequency"])) / white: line
        for line in sinusoids
    }
    most = max(parts, default=0.0)
    if most < _STRONG:
        return None
    frequency = parts[most]["frequency"]
    detail = (
        f"a sinusoid of {channel} at {frequency:.5g} Hz integrates to {most:.3g} times what its "
        "white noise does in a second, and is in the error budgets: if it is a vibration of the "
        "place, and not of the sensor, record elsewhere, or on softer ground"
    )
    return Finding("strong_line", "warning", detail, most, channel)


def band_finding(channel: str, highest: float, source: str) -> list[Finding]:
    """Return a note where the band of a channel ends before Nyquist by what its spectrum shows.

    Parameters
    ----------
    channel : str
    highest : float
        Hz.
    source : str
        How it was found (`imubench_pipeline.estimators.band.Band`).
    """
    if not source.startswith(("found: beyond", "default")):
        return []
    return [Finding("band_limit", "note", f"{channel}: {source}", highest, channel)]

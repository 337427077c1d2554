"""What the spectrum of a channel tells of its quality: lines, and where a filter begins."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from imubench_pipeline.estimators.carried_lines import MOST, joined_finding
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.findings import Finding


def line_findings(lines: Iterable[Mapping[str, Any]]) -> list[Finding]:
    """Return a note for each channel with lines, from rows of the table ``lines``.

    There is a warning where they are too many for a noise model to carry each on.

    Parameters
    ----------
    lines : iterable of mapping
        With ``channel``, ``kind``, ``frequency`` (Hz), ``amplitude`` (SI) and ``ratio``.
    """
    by_channel: dict[str, list[Mapping[str, Any]]] = {}
    for line in lines:
        if line["kind"] != "alias":
            by_channel.setdefault(line["channel"], []).append(line)
    findings = []
    for channel, found in by_channel.items():
        strongest = max(found, key=lambda line: line["ratio"])
        sinusoids = [line for line in found if line["kind"] == "sinusoid"]
        number = len(sinusoids)
        detail = (
            f"{channel} has {number} sinusoids and {len(found) - number} bands of noise, the "
            f"strongest at {strongest['frequency']:.5g} Hz, {strongest['ratio']:.3g} times the "
            "noise there; they are left out of the likelihood"
        )
        findings.append(Finding("lines", "note", detail, strongest["frequency"], channel))
        if number > MOST:
            findings.append(joined_finding(channel, quantity_of(channel), sinusoids))
    return findings


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

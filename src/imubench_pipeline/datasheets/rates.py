"""Whether a sensor can sample at the rate of a log, and which unit of time would explain it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from imubench_pipeline.tables.findings import Finding

_SLOWEST, _FASTEST = 0.105, 1e4
"""Hz, of any log. 0.1 Hz is what stamps in ms at 100 Hz come to where they are taken for s."""

_READ_OVER = 100.0
_SAMPLED_OVER = 10.0
"""Times the bandwidth that a log is read at, at most; and that a sensor samples at, at most: those
that the shipped sensor files print are sampled at 2 to 8 times theirs."""

_USUAL = 100.0
_FACTORS: Mapping[float, float] = {60.0: 1.0, 1e3: 0.0, 1e6: 0.0, 1e9: 0.0}
"""Ratios of two units of time, and decades from the usual rate (Hz) that each is taken to be less
likely: no sensor file can state minutes."""


def implausible_rates(
    rates: Mapping[str, float], bandwidths: Mapping[str, float | None]
) -> list[Finding]:
    """Return the rates that are far from what a sensor can do.

    Parameters
    ----------
    rates : mapping of str to float
        Of each channel, Hz.
    bandwidths : mapping of str to float or None
        The widest that the datasheet of the sensor prints for each channel, Hz.

    Returns
    -------
    list of Finding
        The value of each is the factor that mends times.
    """
    by_rate: dict[tuple[float, float], list[str]] = {}
    for name, rate in rates.items():
        fastest = _fastest(bandwidths[name])
        if not _SLOWEST <= rate <= fastest:
            by_rate.setdefault((rate, fastest), []).append(name)
    found = []
    for (rate, fastest), names in by_rate.items():
        factor = time_factor(rate, fastest)
        longer = factor if factor > 1.0 else 1.0 / factor
        detail = (
            f"the rate is {rate:.4g} Hz; expected {_SLOWEST:.1g} to {fastest:.5g} Hz: is the unit "
            f"of time {longer:g} times as {'long' if factor > 1.0 else 'short'}? It would be "
            f"{rate / factor:.4g} Hz then; mend 'unit' of 'time', or 'rate', in the sensor file"
        )
        channels = [None] if len(names) == len(rates) else names
        found += [Finding("rate_implausible", "warning", detail, factor, one) for one in channels]
    return found


def time_factor(rate: float, fastest: float = _FASTEST) -> float:
    """Return by what times are to be multiplied, so that a rate is likely.

    Parameters
    ----------
    rate : float
        Hz.
    fastest : float
        That the sensor can do, Hz.
    """
    sign = 1.0 if rate > fastest else -1.0
    return min(
        (factor**sign for factor in _FACTORS),
        key=lambda one: abs(math.log10(rate / one / _USUAL)) + _FACTORS[round(one**sign)],
    )


def _fastest(bandwidth: float | None) -> float:
    """Return the highest rate of a log of a sensor, Hz."""
    if bandwidth is None:
        return _FASTEST
    return min(max(_FASTEST, _SAMPLED_OVER * bandwidth), _READ_OVER * bandwidth)

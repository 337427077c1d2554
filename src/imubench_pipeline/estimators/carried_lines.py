"""The lines that a noise model carries on: a bounded number, with the power of all.

Each line is two states of a Kalman filter and an integral of an error budget; some steps cost the
square or the cube of their number. So the strongest are carried as they are. The weaker ones are
joined in a few groups of neighbours, a floor of the same power: of n sinusoids A_i at f_i,

    A^2 = sum A_i^2,   f^2 = A^2 / sum (A_i / f_i)^2,

which keeps the variance of the signal, and of its integral.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from imubench_pipeline.estimators.estimate import SI_UNITS, Parameter
from imubench_pipeline.estimators.lines import Line
from imubench_pipeline.tables.findings import Finding

STRONGEST = 12
"""Lines that are carried as they are where there are too many."""

GROUPS = 4
"""Groups of the weaker ones."""

MOST = STRONGEST + GROUPS
"""So many lines are carried without being joined."""


def carried_sinusoids(lines: Sequence[Line]) -> list[dict[str, Parameter]]:
    """Return amplitude and frequency of the sinusoids that a model carries on, by frequency.

    Parameters
    ----------
    lines : sequence of Line
        All that were found, by frequency; bands of noise and aliases are left out.
    """
    narrow = [line for line in lines if line.narrow]
    if len(narrow) <= MOST:
        return [_line_parameters(line) for line in narrow]
    single = set(strongest([line.amplitude for line in narrow]))
    weaker = [line for place, line in enumerate(narrow) if place not in single]
    sinusoids = [_line_parameters(narrow[place]) for place in single]
    sinusoids += [_joined([weaker[i] for i in group]) for group in _groups(len(weaker))]
    return sorted(sinusoids, key=lambda sinusoid: sinusoid["frequency"].value or 0.0)


def strongest(amplitudes: Sequence[float]) -> list[int]:
    """Return the places of the lines that are carried as they are; all where they are few."""
    number = len(amplitudes) if len(amplitudes) <= MOST else STRONGEST
    order = sorted(range(len(amplitudes)), key=lambda place: -amplitudes[place])
    return sorted(order[:number])


def joined_finding(channel: str, quantity: str, sinusoids: Sequence[Mapping[str, Any]]) -> Finding:
    """Return the warning about a channel with more sinusoids than a model carries on.

    Parameters
    ----------
    channel : str
    quantity : {"gyro", "accel"}
    sinusoids : sequence of mapping
        With ``amplitude``, SI; more than `MOST`.
    """
    single = set(strongest([sinusoid["amplitude"] for sinusoid in sinusoids]))
    powers = [0.5 * sinusoid["amplitude"] ** 2 for sinusoid in sinusoids]
    rest = math.fsum(power for place, power in enumerate(powers) if place not in single)
    share = rest / math.fsum(powers)
    number = len(sinusoids) - len(single)
    detail = (
        f"{channel} has {len(sinusoids)} sinusoids: the {len(single)} strongest go into error "
        f"budgets, simulations and filters as they are, the other {number} as {GROUPS} of their "
        f"power, {100 * share:.3g} % of that of all lines ({math.sqrt(rest):.3g} "
        f"{SI_UNITS[quantity]['amplitude']} rms)"
    )
    return Finding("too_many_lines", "warning", detail, float(len(sinusoids)), channel)


def _groups(number: int) -> list[list[int]]:
    return [part.tolist() for part in np.array_split(np.arange(number), GROUPS)]


def _line_parameters(line: Line) -> dict[str, Parameter]:
    return {
        "amplitude": Parameter(
            line.amplitude, lower=line.amplitude_lower, upper=line.amplitude_upper
        ),
        "frequency": Parameter(
            line.frequency, lower=line.frequency_lower, upper=line.frequency_upper
        ),
    }


def _joined(lines: Sequence[Line]) -> dict[str, Parameter]:
    amplitude, low, high = (
        math.hypot(*values)
        for values in (
            [line.amplitude for line in lines],
            [line.amplitude_lower for line in lines],
            [line.amplitude_upper for line in lines],
        )
    )
    frequency = amplitude / math.hypot(*(line.amplitude / line.frequency for line in lines))
    first, last = lines[0].frequency, lines[-1].frequency
    reason = f"{len(lines)} weak lines from {first:.4g} to {last:.4g} Hz together"
    return {
        "amplitude": Parameter(amplitude, reason=reason, lower=low, upper=high),
        "frequency": Parameter(frequency, reason=reason, lower=first, upper=last),
    }

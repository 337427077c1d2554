"""What several terms put into a filter behind them, together."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from imubench_pipeline.noise.terms import Term
from imubench_pipeline.noise.terms.traits import Process


@dataclass(frozen=True)
class Drives:
    """The sum of what terms put into a filter.

    Attributes
    ----------
    white : float
        Density N^2, SI^2/Hz.
    flicker : float
        B^2 of flicker noise, SI^2.
    processes : tuple of Process
        Gauss-Markov processes.
    walks : tuple of Process
        Random walks, whose correlation time is infinite.
    """

    white: float
    flicker: float
    processes: tuple[Process, ...]
    walks: tuple[Process, ...]


def drives_of(terms: Iterable[Term]) -> Drives:
    """Return what terms put into a filter; those without a density have no part in it.

    Parameters
    ----------
    terms : iterable of Term
    """
    drives = [term.drive for term in terms if term.drive is not None]
    processes = [drive.process for drive in drives if drive.process is not None]
    return Drives(
        sum(drive.white for drive in drives),
        sum(drive.flicker**2 for drive in drives),
        tuple(process for process in processes if math.isfinite(process.T_B)),
        tuple(process for process in processes if math.isinf(process.T_B)),
    )

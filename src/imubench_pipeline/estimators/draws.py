"""Noise models drawn jointly: what a log leaves open of all parameters together.

The interval of a parameter says nothing of the others: where N and K trade off, or B and T_B, or
where the log allows a model with a random walk as well as one without, what is computed from all of
them (an error budget, a density, a prediction) is surer, or less sure, than independent parameters
would make it. A draw is one noise model that the log allows, its terms included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid

if TYPE_CHECKING:  # what reads draws back does without the machinery that makes them
    from imubench_pipeline.estimators.posterior import Posterior
    from imubench_pipeline.estimators.whittle import Terms

Array = NDArray[np.float64]

NUMBER = 200
"""Draws that are kept of an estimate."""

SCALARS = ("Q", "N", "B", "T_B", "K", "R")
"""What a draw has of the first component."""


@dataclass(frozen=True, eq=False)
class JointDraws:
    """Noise models drawn from the posterior of an estimate, over the models the log allows.

    Attributes
    ----------
    first : ndarray, shape (d, 6)
        Q, N, B, T_B, K and R, SI, of each draw; 0 for a term that it does not have. T_B is NaN
        where B is flicker noise, or 0.
    further : ndarray, shape (d, g, 2)
        B and T_B of the further Gauss-Markov processes; B is 0, T_B NaN, where it has fewer.
    """

    first: Array
    further: Array

    def __len__(self) -> int:
        return len(self.first)

    def model(self, number: int, sinusoids: Sequence[Sinusoid] = ()) -> NoiseModel:
        """Return the noise model of a draw.

        Parameters
        ----------
        number : int
            Of the draw, from 0.
        sinusoids : sequence of Sinusoid
            Lines beside the noise.
        """
        Q, N, B, T_B, K, R = self.first[number].tolist()
        return NoiseModel(
            Q=Q,
            N=N,
            B=B,
            T_B=T_B if T_B > 0.0 else None,
            K=K,
            R=R,
            further=[GaussMarkov(b, t) for b, t in self.further[number].tolist() if b > 0.0],
            sinusoids=sinusoids,
        )


def joint_draws(
    parts: Sequence[tuple[Terms, Posterior, float]], number: int = NUMBER
) -> JointDraws:
    """Return draws from the posteriors of several models, as many of each as its share asks.

    The draws of a model are picked at even distances from its posterior, so that nothing is left
    to chance and neighbours in a chain do not stand for each other.

    Parameters
    ----------
    parts : sequence of (Terms, Posterior, float)
        Models that the log does not rule out, with their shares of any sum.
    number : int
        Draws of all together.

    Returns
    -------
    JointDraws

    Raises
    ------
    ValueError
        If there is no model, or no share above 0.
    """
    shares = np.array([share for _, _, share in parts])
    if not len(parts) or not shares.sum() > 0.0:
        raise ValueError("expected models with shares above 0")
    most = max(terms.gauss_markov for terms, _, _ in parts)
    found = [
        _of_model(terms, posterior, count, most)
        for (terms, posterior, _), count in zip(parts, _counts(shares, number), strict=True)
        if count
    ]
    return JointDraws(
        np.concatenate([first for first, _ in found]),
        np.concatenate([further for _, further in found]),
    )


def _counts(shares: Array, number: int) -> list[int]:
    """Return whole numbers of a sum that are nearest to shares."""
    edges = np.rint(number * np.cumsum(shares) / shares.sum()).astype(int)
    return [int(n) for n in np.diff(edges, prepend=0)]


def _of_model(terms: Terms, posterior: Posterior, count: int, most: int) -> tuple[Array, Array]:
    """Return the first components and the further processes of draws of one model."""
    rows = picked(posterior, count)
    linear, processes = len(terms.linear), terms.gauss_markov
    parameters, times = posterior.parameters[rows], posterior.times[rows]
    first = np.zeros((count, len(SCALARS)))
    first[:, SCALARS.index("T_B")] = np.nan
    first[:, SCALARS.index("R")] = posterior.ramps[rows]
    for place, letter in enumerate(terms.linear):
        first[:, SCALARS.index("B" if letter == "F" else letter)] = parameters[:, place]
    pairs = np.stack([parameters[:, linear:], times], axis=2)
    if processes and "F" not in terms.linear:
        # As everywhere: the first component is flicker noise, or else the fastest process.
        first[:, SCALARS.index("B")], first[:, SCALARS.index("T_B")] = pairs[:, 0].T
        pairs = pairs[:, 1:]
    further = np.tile([0.0, np.nan], (count, most, 1))
    further[:, : pairs.shape[1]] = pairs
    return first, further


def picked(posterior: Posterior, count: int) -> NDArray[np.int64]:
    """Return the places of draws at even distances in a posterior.

    Parameters
    ----------
    posterior : Posterior
    count : int
        Draws to pick.

    Returns
    -------
    ndarray of int, shape (count,)
    """
    drawn = len(posterior.parameters)
    return np.asarray((np.arange(count) + 0.5) * drawn / count, dtype=np.int64)

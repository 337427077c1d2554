"""The Earth's rate from pairs of dwells, with the standard error that the noise model gives.

    w = (w_N - w_S) / (2 cos(latitude))    (Silva et al., eq. 14)

for each pair of consecutive dwells, and the mean over pairs. A drift of the gyro appears as
rotation; A-B-A differences remove its linear part. The fixed bias drops out. The standard error of
an estimate with weights w on the means of the dwells is the root of w^T C w with C the covariance
of these means in closed form.
"""

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.extensions.calibration.experiment import Blocks, block_mean_covariance
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Differences:
    """The running mean of estimates from differences between dwells, with its standard error."""

    time: Array  # shape (p,); end of the last dwell of each, s from the first sample
    rate: Array  # shape (runs, p); mean of the estimates up to each, rad/s
    sigma: Array  # shape (p,); its standard error, rad/s


def by_pairs(means: Array, blocks: Blocks, model: NoiseModel) -> Differences:
    """Estimate the rate from pairs of dwells, each in one pair at most (Silva et al., eq. 14).

    The block means are in rad/s, shape (runs, b). Raises ValueError if there is no pair.
    """
    dwells = blocks.of_dwells()
    differences, i = [], 0
    while i + 1 < len(dwells):
        if dwells.sense[i] == dwells.sense[i + 1]:
            i += 1
            continue
        differences.append([(i, dwells.sense[i] / 2.0), (i + 1, dwells.sense[i + 1] / 2.0)])
        i += 2
    return _estimate_differences(
        differences, means, blocks, dwells, model, "pair of dwells north and south"
    )


def by_triples(means: Array, blocks: Blocks, model: NoiseModel) -> Differences:
    """Estimate the rate by A-B-A differences, which remove a drift that is linear in time.

    The middle of three alternating dwells is compared with the line through the outer two; triples
    overlap. Shapes and errors are as in `by_pairs`.
    """
    dwells = blocks.of_dwells()
    # The mean time of the samples present is taken from their blocks.
    middle = blocks.means_of_dwells(blocks.middle[None, :])[0]
    differences = []
    for i in range(1, len(dwells) - 1):
        before, sense, after = dwells.sense[i - 1 : i + 2]
        if before == sense or after == sense:
            continue
        part = (middle[i] - middle[i - 1]) / (middle[i + 1] - middle[i - 1])
        differences.append(
            [(i - 1, -sense * (1.0 - part) / 2.0), (i, sense / 2.0), (i + 1, -sense * part / 2.0)]
        )
    return _estimate_differences(
        differences, means, blocks, dwells, model, "three dwells of alternate sense"
    )


def _estimate_differences(
    differences: list[list[tuple[int, float]]],
    means: Array,
    blocks: Blocks,
    dwells: Blocks,
    model: NoiseModel,
    wanted: str,
) -> Differences:
    if not differences:
        raise ValueError(f"the experiment has no {wanted} one after the other")
    weights = np.zeros((len(differences), len(dwells)))
    for row, parts in zip(weights, differences, strict=True):
        for place, weight in parts:
            row[place] = weight
    weights /= np.cos(blocks.latitude)
    each = blocks.means_of_dwells(means) @ weights.T
    covariance = weights @ block_mean_covariance(model, dwells) @ weights.T
    number = np.arange(1, len(differences) + 1)
    # Sums of the leading parts of the covariance.
    total = np.diag(np.cumsum(np.cumsum(covariance, axis=0), axis=1))
    last = np.array([parts[-1][0] for parts in differences])
    return Differences(
        dwells.end[last],
        np.cumsum(each, axis=1) / number,
        np.sqrt(np.maximum(total, 0.0)) / number,  # 0 for a ramp in triples
    )

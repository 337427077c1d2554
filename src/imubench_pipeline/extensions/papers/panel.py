"""Compare the errors of the methods on simulated logs of one channel with the Cramér-Rao bound.

The channel is the gyro of the MTi-7 by Table 2 of Maia et al., its logs of 10 h at a tenth of its
rate: N, B, T_B and K are the same, and so is the information about B, T_B and K.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators import least_squares
from imubench_pipeline.estimators.estimate import PARAMETERS
from imubench_pipeline.estimators.identifiability import compute_cramer_rao_bounds
from imubench_pipeline.estimators.model_choice import PAPERS_MODEL
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.whittle import Whittle, make_whittle
from imubench_pipeline.extensions.papers.maia import DURATION, MTI_GYRO
from imubench_pipeline.extensions.papers.tables import AccuracyRow
from imubench_pipeline.noise.simulate import channel_rng, simulate

LOGS = 100  # enough to separate ratios of 1.1 and 1.5; `benchmarks/accuracy.py` has more

_RATE = MTI_GYRO.rate / 10.0
_FIT_METHODS: tuple[Literal["paper", "weighted"], ...] = ("paper", "weighted")

Values = Mapping[str, float | None]


def make_accuracy_rows(logs: int = LOGS) -> Iterator[AccuracyRow]:
    """Yield the rows of the table ``accuracy``; the likelihood has the model of the papers."""
    model = MTI_GYRO.table_2
    bounds = compute_cramer_rao_bounds(model, _RATE, DURATION, _RATE / 2.0)
    by_method: dict[str, list[Values]] = {}
    whittle: Whittle | None = None
    for number in range(logs):
        estimates, whittle = _estimate_log(number, whittle)
        for method, values in estimates.items():
            by_method.setdefault(method, []).append(values)
    for method, of_logs in by_method.items():
        for name in PARAMETERS:
            truth = float(getattr(model, name))
            given = [value for values in of_logs if (value := values[name]) is not None]
            errors = np.array(given) / truth - 1.0
            rmse = math.sqrt(float(np.mean(errors**2))) if given else None
            # Relative standard deviation of the rms of n normal errors: 1 / sqrt(2 n).
            spread = 1.96 / math.sqrt(2.0 * len(given)) if given else 0.0
            ratio = None if rmse is None else rmse / bounds[name]
            yield AccuracyRow(
                method=method,
                parameter=name,
                logs=logs,
                given=len(given),
                rmse=rmse,
                bias=float(np.mean(errors)) if given else None,
                bound=bounds[name],
                ratio=ratio,
                ratio_lower=None if ratio is None else ratio * (1.0 - spread),
                ratio_upper=None if ratio is None else ratio * (1.0 + spread),
            )


def _estimate_log(number: int, before: Whittle | None) -> tuple[dict[str, Values], Whittle]:
    """Return the estimates by method, and the likelihood, with the shapes of the one `before`."""
    samples = round(DURATION * _RATE)
    rng = channel_rng(1, MTI_GYRO.sensor, MTI_GYRO.channel, f"panel {number}")
    log = simulate(MTI_GYRO.table_2, _RATE, samples, rng)
    curve = allan_variance(log, _RATE, overlap="octave")
    estimates = [reading.read(curve), *(least_squares.solve(curve, method=m) for m in _FIT_METHODS)]
    spectrum, _ = compute_spectra([log], samples, _RATE)
    whittle = before.of(spectrum) if before else make_whittle(spectrum, _RATE / 2.0)
    best = whittle.maximum(PAPERS_MODEL)
    powers = [best.parameter("N"), float(best.biases[0]), float(best.times[0]), best.parameter("K")]
    by_likelihood = {
        name: value if value > 0.0 else None for name, value in zip(PARAMETERS, powers, strict=True)
    }
    of_curve: dict[str, Values] = {
        estimate.method: {name: estimate.parameters[name].value for name in PARAMETERS}
        for estimate in estimates
    }
    return of_curve | {"likelihood_gm": by_likelihood}, whittle

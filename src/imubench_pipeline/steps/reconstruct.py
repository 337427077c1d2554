"""Reconstruction of a log from an estimate, and its agreement with the measured curve."""

from collections.abc import Container
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.estimators.rows import read_estimates, read_recommended_estimates
from imubench_pipeline.estimators.score import beats, rms, score
from imubench_pipeline.model.estimates import ReconstructionRow, ScoreRow
from imubench_pipeline.noise import simulate
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.recordings.recording import LogWriter
from imubench_pipeline.settings.config import ReconstructionSettings
from imubench_pipeline.steps.allan import read_compensated_curves, read_curves
from imubench_pipeline.tables.files import replace_file
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.words.reasons import simulations as texts


@dataclass(frozen=True)
class Reconstruction:
    """Rows of the tables ``reconstruction`` and ``scores`` of one channel and method."""

    curve_rows: list[ReconstructionRow]
    score_row: ScoreRow
    differences: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """RMS difference from the log of each member, taus equally weighted (Maia et al., Table 3)."""


def reconstruct(
    key: Key,
    estimate: Estimate,
    measured: AllanCurve,
    rate: float,
    settings: ReconstructionSettings,
    series: Path,
) -> Reconstruction:
    """Simulate full-length logs and an ensemble from an estimate, and score them.

    The reconstruction has the length and the tau of `measured`; `rate` in Hz; `series`: file for
    the first full-length log, if it is stored.
    """
    names = asdict(key) | {"method": estimate.method}
    model = estimate.model
    if not model.terms:
        reasons = {p.reason for p in estimate.parameters.values() if p.reason}
        reason = texts.nothing_to_simulate(sorted(reasons))
        return Reconstruction([], ScoreRow(**names, reason=reason))
    sizes, samples = measured.cluster_size, measured.samples

    def stream(use: str) -> np.random.Generator:
        return simulate.channel_rng(settings.seed, repr(model), key.channel, use)

    if settings.keep_series:
        about = {"simulated": True, "rate": rate, "rows": samples, "model": asdict(model)}
        columns = {"simulated": pa.float64()}
        with replace_file(series) as temporary, LogWriter(temporary, columns) as log:
            for block in simulate.simulate_blocks(model, rate, samples, stream("member 1")):
                log.write({"simulated": block})
            log.finish(about)
    variances = [
        simulate.reconstructed_variance(model, rate, samples, sizes, stream(f"member {number}"))
        for number in range(1, settings.members + 1)
    ]
    reconstructed = np.sqrt(np.mean(variances, axis=0))
    deviations = np.sqrt(
        simulate.ensemble(model, rate, samples, sizes, settings.band_members, stream("band"))
    )
    quantiles = np.quantile(deviations, [0.025, 0.5, 0.975], axis=0)
    of_model = np.sqrt(model.allan_variance(measured.tau, rate))
    scores = score(measured.deviation, 1.0 / np.sqrt(2.0 * measured.edf), of_model, deviations)
    points = np.column_stack([measured.tau, *quantiles, reconstructed]).tolist()
    rows = [
        ReconstructionRow(
            **names, tau=tau, lower=lower, adev=median, upper=upper, reconstructed=of_full_length
        )
        for tau, lower, median, upper, of_full_length in points
    ]
    differences = rms(deviations, measured.deviation)
    return Reconstruction(rows, ScoreRow(**names, **asdict(scores)), differences)


@dataclass(frozen=True)
class ReconstructionRows:
    """Rows of the tables ``reconstruction`` and ``scores``."""

    reconstruction: list[ReconstructionRow] = field(default_factory=list)
    scores: list[ScoreRow] = field(default_factory=list)


def reconstruct_recording(
    folder: Path, settings: ReconstructionSettings, channels: Container[str] | None = None
) -> ReconstructionRows:
    """Return the rows of a recording's channels with estimates; ``channels``: these, or all."""
    about = Quality.read(folder / "quality.json")
    measured = read_curves(folder / "allan.parquet", about.grids)
    left = read_compensated_curves(folder / "allan_compensated.parquet", measured)
    parameters = folder / "parameters.parquet"
    best = read_recommended_estimates(parameters)
    rows = ReconstructionRows()
    for channel, by_method in read_estimates(parameters).items():
        if channels is not None and channel not in channels:
            continue
        key = Key(about.recording.sensor, about.recording.recording, channel)
        rate = about.channels[channel].rate
        results = {}
        for estimate in by_method:
            series = folder / "series" / f"{channel}.{estimate.method}.parquet"
            curve = (left if estimate.method == "compensated" else measured)[channel]
            results[estimate.method] = reconstruct(key, estimate, curve, rate, settings, series)
        recommended = results[best[channel].method].differences
        for method, result in results.items():
            # The compensated log has another curve, so that its RMS cannot be compared.
            same = method != "compensated" and result.differences.size and recommended.size
            chance = beats(result.differences, recommended) if same else None
            rows.scores.append(replace(result.score_row, beats=chance))
            rows.reconstruction.extend(result.curve_rows)
    return rows

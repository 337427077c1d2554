"""Predict the accuracy of attitude, north and Earth rate from a sensor at rest.

Its noise is that of a static recording: a measured one before a simulated one, the longest of
several. A log may have fewer than three axes: those that are there stand for the others.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path

from imubench_pipeline.estimators.rows import read_recommended_estimates
from imubench_pipeline.extensions.calibration.alignment.accuracy import accuracies
from imubench_pipeline.extensions.calibration.alignment.fine import UNIFORM_HEADING_SIGMA
from imubench_pipeline.extensions.calibration.alignment.triad import Site, Triad
from imubench_pipeline.extensions.earth_rate.prediction import Outlook, prediction_rows
from imubench_pipeline.extensions.earth_rate.settings import EarthRateSettings
from imubench_pipeline.extensions.earth_rate.tables import AlignmentRow, EarthRatePredictionRow
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.printed import Datasheet, QuantityDatasheet
from imubench_pipeline.settings.sensor import QUANTITIES
from imubench_pipeline.steps.noise_source import find_static_recordings
from imubench_pipeline.units import parse_quantity

TIMES = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 1800.0, 3600.0)  # durations of rest, s
DWELL = 28.0  # length of each dwell of the predicted turns, s; with the turn half a minute
TURN_TIME = 2.0  # duration of a turn, s

_SIMULATED_TRIADS = 400  # number of simulated triads of the check; their rms is accurate to 3.5 %

_CHECK_SEED = 20260101
_TYPICAL_KINDS = ("1sigma", "typ")


@dataclass(frozen=True)
class Noise:
    """The noise of a sensor at rest."""

    recording: str
    rate: float  # Hz
    models: dict[str, NoiseModel]  # by channel

    def three(self, quantity: str) -> dict[str, NoiseModel]:
        """Return the models of x, y and z by axis; a missing axis has the noise of another."""
        names = [name for name in self.models if name.startswith(quantity)]
        models = {}
        for place, axis in enumerate("xyz"):
            own = f"{quantity}_{axis}"
            name = own if own in self.models else names[place % len(names)]
            models[f"{axis}: {name}"] = self.models[name]
        return models


def load_noise_at_rest(folders: Sequence[Path]) -> Noise | None:
    """Return the noise of a sensor from its static recordings; None if none has an estimate."""
    for row, folder in find_static_recordings(folders, lambda row: (row.simulated,)):
        best = read_recommended_estimates(folder / "parameters.parquet")
        models = {name: estimate.model for name, estimate in best.items() if estimate.model.N}
        if row.rate is not None and any(name.startswith("gyro_") for name in models):
            return Noise(row.recording, row.rate, models)
    return None


def make_outlook_tables(
    folders: Sequence[Path], sensor: str, settings: str
) -> dict[str, Sequence[TableRow]]:
    """Return the rows of ``alignment`` and ``earth_rate_prediction`` of a sensor at rest.

    `folders`: of its static recordings; `settings`: of `plan.select_outlook_settings`. There are no
    rows without the noise of a gyro, and none of ``alignment`` without an accelerometer.
    """
    rows: dict[str, Sequence[TableRow]] = {"alignment": [], "earth_rate_prediction": []}
    sections = json.loads(settings)
    how = EarthRateSettings.model_validate(sections["earth_rate"])
    noise = load_noise_at_rest(folders)
    if noise is None:
        return rows
    variances = {
        name: float(model.allan_variance(DWELL))
        for name, model in noise.models.items()
        if name.startswith("gyro_")
    }
    # The gyro with the median Allan deviation over a dwell; there is at least one.
    gyro = sorted(variances, key=variances.__getitem__)[len(variances) // 2]
    latitude = parse_quantity(how.latitude, "angle")
    outlook = Outlook(noise.models[gyro], latitude, TURN_TIME, noise.rate)
    run_time = max(parse_quantity(how.run_time, "time"), 3.0 * DWELL)
    row = partial(EarthRatePredictionRow, sensor=sensor, recording=noise.recording, channel=gyro)
    predictions = prediction_rows(outlook, DWELL, how.goals, run_time)
    rows["earth_rate_prediction"] = [row(**predicted) for predicted in predictions]
    if any(name.startswith("accel_") for name in noise.models):
        printed = Datasheet.model_validate(sections["datasheet"])
        rows["alignment"] = list(_predict_alignment(sensor, noise, printed, how))
    return rows


def _predict_alignment(
    sensor: str, noise: Noise, printed: Datasheet, how: EarthRateSettings
) -> Iterator[AlignmentRow]:
    gyros, accelerometers = noise.three("gyro"), noise.three("accel")
    gyro_bias, gyro_words = _find_bias(printed, "gyro", how)
    accelerometer_bias, accelerometer_words = _find_bias(printed, "accel", how)
    triad = Triad(
        gyros=tuple(gyros.values()),
        accelerometers=tuple(accelerometers.values()),
        gyro_bias=gyro_bias,
        accelerometer_bias=accelerometer_bias,
    )
    site = Site(latitude=parse_quantity(how.latitude, "angle"))
    rng = channel_rng(_CHECK_SEED, repr(triad), "alignment")
    for accuracy in accuracies(triad, site, noise.rate, TIMES, runs=_SIMULATED_TRIADS, rng=rng):
        roll, pitch, heading = (float(value) for value in accuracy.sigma)
        errors = [None] * 3 if accuracy.errors is None else accuracy.errors.tolist()
        of_roll, of_pitch, of_heading = (
            None if error is None or math.isnan(error) else error for error in errors
        )
        yield AlignmentRow(
            sensor=sensor,
            recording=noise.recording,
            positions=accuracy.positions,
            method=accuracy.method,
            time=accuracy.time,
            roll=roll,
            pitch=pitch,
            heading=heading if heading < UNIFORM_HEADING_SIGMA else None,
            reason=accuracy.reason,
            error_roll=of_roll,
            error_pitch=of_pitch,
            error_heading=of_heading,
            simulated=None if accuracy.errors is None else accuracy.simulated,
            latitude=site.latitude,
            gyro_bias=gyro_bias,
            gyro_bias_from=gyro_words,
            accelerometer_bias=accelerometer_bias,
            accelerometer_bias_from=accelerometer_words,
            gyros=", ".join(gyros),
            accelerometers=", ".join(accelerometers),
        )


def _find_bias(printed: Datasheet, quantity: str, how: EarthRateSettings) -> tuple[float, str]:
    """Return the standard deviation of the fixed bias in SI, and its source."""
    dimension = QUANTITIES[quantity]
    sheet: QuantityDatasheet | None = getattr(printed, quantity)
    for name, kind in product(("bias_repeatability", "offset"), _TYPICAL_KINDS):
        for figure in sheet.printed(name) if sheet else ():
            value = figure.on_axis("x")
            if figure.kind == kind and isinstance(value, float):
                source = f"{name.replace('_', ' ')} {value:g} {figure.unit} ({kind}), datasheet"
                return parse_quantity(f"{value!r} {figure.unit}", dimension), source
    key = {"gyro": "gyro_bias", "accel": "accelerometer_bias"}[quantity]
    assumed = getattr(how, key)
    return parse_quantity(assumed, dimension), f"{assumed} (earth_rate.{key}), assumed"

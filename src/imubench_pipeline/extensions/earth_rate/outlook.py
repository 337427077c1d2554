"""Predict the accuracy of the Earth's rate and north by a gyro, and attitude by a triad at rest.

The Earth's rate has the Cramér-Rao bound of runs of equal dwells (`extensions.earth_rate.bound`),
for a turned gyro or with the noise of a static recording: a measured one before a simulated one,
the longest of several. Axes that a log does not have take the noise of others.
"""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.alignment.accuracy import accuracies
from imubench_pipeline.extensions.calibration.alignment.fine import UNIFORM_HEADING_SIGMA
from imubench_pipeline.extensions.calibration.alignment.triad import Site, Triad
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.calibration.noise_source import (
    NoiseAtRest,
    lend_axes,
    load_noise_at_rest,
)
from imubench_pipeline.extensions.earth_rate.bound import (
    MAX_BLOCKS,
    choose_block_length,
    compute_information,
    convert_to_sigma,
)
from imubench_pipeline.extensions.earth_rate.settings import EarthRateSettings
from imubench_pipeline.extensions.earth_rate.tables import AlignmentRow, EarthRatePredictionRow
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.printed import Datasheet, QuantityDatasheet
from imubench_pipeline.settings.sensor import QUANTITIES
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_quantity

_MAX_COMPUTED_DWELLS = 64  # beyond, the information grows as over their latter half
_MIN_COMPUTED_DWELLS = 8  # least number of computed dwells, if 64 of them have too many blocks
_INFORMATION_TOLERANCE = 1e-9  # relative tolerance of the information for rounding
_NEARLY_BEST_LOSS = 0.01  # relative rise of sigma within which a dwell is nearly the best
_DWELL_CURVE_POINTS = 40  # approximate number of points on a curve over the dwell
_REFINEMENT_POINTS = 15  # number of further points about the best one

MAX_TURNS = 10**12  # of a goal; at one a second they take 30 000 years
_TIME_CURVE_POINTS = 60  # number of points on the curve over time
_MAX_CURVE_TURNS = 20_000  # largest number of turns on the curve over time; goals may need more


@dataclass(frozen=True)
class DwellCurve:
    """The least standard deviation of the rate as a function of the dwell, for one run length."""

    dwells: NDArray[np.int64]  # shape (k,); number of dwells, increasing
    dwell: Array  # shape (k,); data in each, s
    sigma: Array  # shape (k,); rad/s

    @property
    def best(self) -> int:
        """Index of the least standard deviation."""
        return int(np.argmin(self.sigma))

    @property
    def nearly_best(self) -> NDArray[np.bool_]:
        """Whether each dwell, and all between it and the best one, lose 1 % at most, shape (k,)."""
        worse = self.sigma > (1.0 + _NEARLY_BEST_LOSS) * self.sigma[self.best]
        stretch = np.cumsum(worse)
        return np.asarray((stretch == stretch[self.best]) & ~worse)


@dataclass(frozen=True)
class Outlook:
    """Predicts how well a turned gyro finds the Earth's rate; extrapolates beyond 64 dwells."""

    model: NoiseModel
    latitude: float  # rad
    turning: float  # time that a turn takes, s
    rate: float  # sampling rate, Hz
    turn_on_bias: float = math.inf  # of the fixed bias, rad/s; by default unknown

    def run_time(self, dwell: float, turns: int) -> float:
        """Return the length, s, of a run with a number of turns and dwells of ``dwell``, s."""
        return (turns + 1) * dwell + turns * self.turning

    def sigmas_after(self, dwell: float, turns: int) -> Array:
        """Return the bound, rad/s, after each turn and its following dwell, s, shape (turns,)."""
        return convert_to_sigma(self._compute_information(dwell, turns + 1)[1:])

    def turns_needed(self, dwell: float, relative: float) -> int | None:
        """Return the turns that are needed for a relative standard deviation of the Earth's rate.

        None: more than `MAX_TURNS`. Each dwell has ``dwell`` s of data. Raises ValueError if
        ``relative``, such as 0.01, is not above 0.
        """
        if not relative > 0:
            raise ValueError(f"relative is {relative}, expected a number above 0")
        wanted = (relative * EARTH_RATE) ** -2
        information = self._compute_information(dwell, _MAX_COMPUTED_DWELLS)
        reached = np.flatnonzero(information >= wanted * (1.0 - _INFORMATION_TOLERANCE))
        if len(reached):
            return int(reached[0])
        left = (wanted - information[-1]) / max(_compute_growth(information), math.ulp(0.0))
        if left > MAX_TURNS:
            return None
        return _MAX_COMPUTED_DWELLS - 1 + math.ceil(left - _INFORMATION_TOLERANCE * left)

    def sigma_after(self, dwell: float, turns: int) -> float:
        """Return the bound after a number of turns and the dwell after the last, rad/s."""
        information = self._compute_information(dwell, _MAX_COMPUTED_DWELLS)
        beyond = max(turns + 1 - _MAX_COMPUTED_DWELLS, 0)
        last = information[min(turns, _MAX_COMPUTED_DWELLS - 1)] + (
            _compute_growth(information) * beyond if beyond else 0.0
        )
        return float(convert_to_sigma(np.array([last]))[0])

    def over_dwell(self, run_time: float) -> DwellCurve:
        """Return the bound of a run of ``run_time``, s, as a function of the length of its dwells.

        The longest dwells have a single turn between them. The shortest are a fourth of the turning
        time, or one second. Raises ValueError if there is no time for two dwells and a turn.
        """
        if run_time - self.turning < 2.0 / self.rate:
            raise ValueError(f"a run of {run_time:g} s is too short for two dwells and a turn")
        shortest = max(self.turning / 4.0, 1.0, 2.0 / self.rate)
        most = max(int((run_time + self.turning) / (shortest + self.turning)), 2)
        number = np.unique(np.rint(np.geomspace(2, most, _DWELL_CURVE_POINTS)).astype(np.int64))
        sigma = self._compute_sigma(run_time, number)
        best = int(np.argmin(sigma))
        around = number[max(best - 1, 0)], number[min(best + 1, len(number) - 1)]
        between = np.rint(np.linspace(*around, _REFINEMENT_POINTS)).astype(np.int64)
        between = np.setdiff1d(between, number)
        sigma = np.concatenate([sigma, self._compute_sigma(run_time, between)])
        number = np.concatenate([number, between])
        order = np.argsort(number)
        number = number[order]
        return DwellCurve(number, (run_time - (number - 1) * self.turning) / number, sigma[order])

    def _compute_sigma(self, run_time: float, dwells: NDArray[np.int64]) -> Array:
        """Return the bound of a run for these numbers of dwells, shape (k,)."""
        lengths = ((run_time - (n - 1) * self.turning) / n for n in dwells.tolist())
        pairs = zip(lengths, dwells.tolist(), strict=True)
        return convert_to_sigma(np.array([self._compute_information(*pair)[-1] for pair in pairs]))

    def _compute_information(self, dwell: float, dwells: int) -> Array:
        """Return the information after each of a number of dwells."""
        design = Experiment.regular(
            dwell=dwell,
            turning=self.turning,
            dwells=min(dwells, _MAX_COMPUTED_DWELLS),
            rate=self.rate,
            latitude=self.latitude,
        )
        longest = choose_block_length(design, self.model)
        each = -(-design.samples_in_dwells // len(design.dwells) // longest)
        summed = max(MAX_BLOCKS // each, _MIN_COMPUTED_DWELLS)
        blocks = replace(design, dwells=design.dwells[:summed]).blocks(longest)
        last = np.flatnonzero(np.diff(blocks.dwell, append=-1))
        information = compute_information(blocks, self.model, self.turn_on_bias)[last]
        more = np.arange(1, dwells - len(information) + 1)
        if not len(more):
            return information
        return np.append(information, information[-1] + _compute_growth(information) * more)


def _compute_growth(information: Array) -> float:
    """Return the mean information that a dwell of the latter half adds."""
    half = len(information) // 2
    return float(information[-1] - information[-1 - half]) / half


def prediction_rows(
    key: Key, outlook: Outlook, dwell: float, goals: Sequence[float], run_time: float
) -> Iterator[EarthRatePredictionRow]:
    """Yield the rows of the table ``earth_rate_prediction``.

    ``dwell``: data in each dwell, s; ``goals``: relative standard deviations; ``run_time``: length
    of the run for the best dwell, s. Raises ValueError if this is too short for two dwells.
    """
    row = partial(EarthRatePredictionRow, **asdict(key), latitude=outlook.latitude)
    most = 1
    for goal in sorted(goals, reverse=True):
        turns = outlook.turns_needed(dwell, goal)
        if turns is None:
            continue
        most = max(most, turns)
        time = outlook.run_time(dwell, turns)
        # The reached value: the last necessary turn may give far more than the goal.
        sigma = outlook.sigma_after(dwell, turns)
        yield _add_sigma(row(of="goal", goal=goal, dwell=dwell, turns=turns, time=time), sigma)
    sigmas = outlook.sigmas_after(dwell, min(max(most, 2), _MAX_CURVE_TURNS))
    shown = np.rint(np.geomspace(1, len(sigmas), _TIME_CURVE_POINTS)).astype(np.int64)
    for turns in np.unique(shown).tolist():
        time = outlook.run_time(dwell, turns)
        reached = row(of="time", dwell=dwell, turns=turns, time=time)
        yield _add_sigma(reached, float(sigmas[turns - 1]))
    curve = outlook.over_dwell(run_time)
    for k, (number, near) in enumerate(
        zip(curve.dwells.tolist(), curve.nearly_best.tolist(), strict=True)
    ):
        tried = row(of="dwell", dwell=float(curve.dwell[k]), turns=number - 1, time=run_time)
        tried = replace(tried, best=k == curve.best, nearly_best=near)
        yield _add_sigma(tried, float(curve.sigma[k]))


def _add_sigma(row: EarthRatePredictionRow, sigma: float) -> EarthRatePredictionRow:
    if not math.isfinite(sigma):
        return row
    # The heading of a gyro perpendicular to north: half the difference of its readings, with the
    # error sigma cos(latitude), is w_ie cos(latitude) times the (small) heading error.
    return replace(row, sigma=sigma, relative=sigma / EARTH_RATE, heading=sigma / EARTH_RATE)


TIMES = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 1800.0, 3600.0)  # durations of rest, s
DWELL = 28.0  # length of each dwell of the predicted turns, s; with the turn half a minute
TURN_TIME = 2.0  # duration of a turn, s

_SIMULATED_TRIADS = 400  # number of simulated triads of the check; their rms is accurate to 3.5 %

_CHECK_SEED = 20260101
_TYPICAL_KINDS = ("1sigma", "typ")


def make_outlook_tables(
    folders: Sequence[Path], sensor: str, settings: str
) -> dict[str, Sequence[TableRow]]:
    """Return the rows of ``alignment`` and ``earth_rate_prediction`` of a sensor at rest.

    `folders`: results of its static recordings; `settings`: from `plan.select_outlook_settings`.
    There are no rows without gyro noise, and no rows of ``alignment`` without an accelerometer.
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
    key = Key(sensor, noise.recording, gyro)
    rows["earth_rate_prediction"] = list(prediction_rows(key, outlook, DWELL, how.goals, run_time))
    if any(name.startswith("accel_") for name in noise.models):
        printed = Datasheet.model_validate(sections["datasheet"])
        rows["alignment"] = list(_predict_alignment(sensor, noise, printed, how))
    return rows


def _predict_alignment(
    sensor: str, noise: NoiseAtRest, printed: Datasheet, how: EarthRateSettings
) -> Iterator[AlignmentRow]:
    axes = lend_axes(noise.models)
    gyros, accelerometers = (
        tuple(axes[f"{quantity}_{axis}"] for axis in "xyz") for quantity in QUANTITIES
    )
    gyro_bias, gyro_words = _find_bias(printed, "gyro", how)
    accelerometer_bias, accelerometer_words = _find_bias(printed, "accel", how)
    triad = Triad(
        gyros=tuple(noise.models[name] for name in gyros),
        accelerometers=tuple(noise.models[name] for name in accelerometers),
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
            simulated=None if accuracy.errors is None else _SIMULATED_TRIADS,
            latitude=site.latitude,
            gyro_bias=gyro_bias,
            gyro_bias_from=gyro_words,
            accelerometer_bias=accelerometer_bias,
            accelerometer_bias_from=accelerometer_words,
            gyros=gyros,
            accelerometers=accelerometers,
        )


def _find_bias(printed: Datasheet, quantity: str, how: EarthRateSettings) -> tuple[float, str]:
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

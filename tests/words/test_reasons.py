"""Each reason is plain English: complete, short sentences, without codes."""

import inspect
import pkgutil
import re
from collections.abc import Callable
from importlib import import_module
from typing import Any

import pytest

from imubench_pipeline.extensions.calibration import reasons as calibration
from imubench_pipeline.extensions.exports import reasons as exports
from imubench_pipeline.words import reasons
from imubench_pipeline.words.reasons import (
    budgets,
    curves,
    datasheets,
    estimates,
    files,
    pools,
    simulations,
    spectra,
)

_MAX_WORDS = 25

Example = tuple[Callable[..., str], tuple[Any, ...], dict[str, Any], str]


def of(function: Callable[..., str], part: str, *args: Any, **kwargs: Any) -> Example:
    """Return a function with its arguments, and a part of its text."""
    return function, args, kwargs, part


ESTIMATES = [
    of(estimates.models_alike, "N+F, which includes it, fits about as well as N", ["N+F"], "N"),
    of(estimates.models_alike, "N+F and N+K, which include it", ["N+F", "N+K"], "N"),
    of(estimates.correlation_bound, "longest correlation time", 4444.4, longest=True),
    of(estimates.correlation_bound, "shortest correlation time", 0.1, longest=False),
    of(estimates.wide_interval, "11 times", 11.2),
    of(estimates.wide_limits, "11 times", 11.2),
    of(estimates.interval_with_zero, "lower 95 % limit is 0", at_limit=True),
    of(estimates.interval_with_zero, "includes 0", at_limit=False),
    of(estimates.excluded_by_reference, "0.52 to 0.61 times", "N", 0.52, 0.61),
    of(estimates.no_reference, "no K: not in the model", "K", "absent", None),
    of(estimates.no_reference, "no K: the log is too short", "K", "absent", "the log is too short"),
    of(estimates.model_disfavoured, "BIC prefers N+F to N+GM+K by 12.3", "N+F", "N+GM+K", 12.3),
    of(estimates.small_temperature_range, "only 0.2 K", 0.2),
    of(estimates.temperature_preferred, "with temperature by 12.3", 12.3),
    of(estimates.temperature_preferred, "without temperature by 2.3", -2.3),
    of(estimates.settling_excluded, "first 600 s", 600.0),
    of(estimates.lag_range, "lags from 3 to 90 s", 3.0, 90.0),
    of(estimates.temperature_like_ramp, "95 % of the information", 0.95),
]

CURVES = [
    of(curves.changes_between_parts, "differ by 4 %", 0.04),
    of(curves.few_points, "3 of the 4 points", 3, 1 / 9, 4),
    of(curves.no_white_slope, "between −0.9 and −0.7", -0.9, -0.7),
    of(curves.no_rise, "less than 3 standard errors", 20.0, 3.0),
    of(curves.no_walk_slope, "has the slope 0.31", 0.31),
    of(curves.no_walk_slope, "near its end", None),
    of(curves.no_peak, "4444 s", 4444.4),
    of(curves.like_white_noise, "0.1 s", 0.1),
    of(curves.fitted_from, "τ = 0.1 s", 0.1),
    of(curves.large_error, "of N is 63 %, above 50 %", "N", 0.63, 0.5),
    of(curves.large_error, "of N is 1000 % or more", "N", 10.0),
    of(curves.no_significant_peak, "of T_B is 90 %", 0.9),
    of(curves.no_significant_peak, "of B is 20 %, but 90 % for T_B", 0.9, 0.2),
    of(curves.broadband_process, "0.3 s is broadband noise", 0.3),
    of(curves.no_model_minimum, "still falls at 4000 s", 4000.0),
    of(curves.no_model_minimum, "rises from its shortest", None),
]

SPECTRA = [
    of(spectra.filter_text, "bilinear low-pass of order 2 at 2 Hz", "bilinear", 2, 2.0),
    of(spectra.filter_text, "running mean (boxcar) at 24.8 Hz", "boxcar", 1, 24.8),
    of(spectra.band_text, "up to 7 Hz are fitted, as set", "set", 7.0),
    of(spectra.band_text, "up to the Nyquist", "whole", 7.0),
    of(spectra.band_text, "boxcar", "filtered", 7.0, "running mean (boxcar) at 24.8 Hz"),
    of(spectra.band_text, "order 2", "attenuated", 7.0, "bilinear low-pass of order 2 at 2 Hz"),
    of(spectra.cutoff_range, "cut-offs from 1 to 2 Hz", 1.0, 2.0),
    of(spectra.unknown_filter, "none of the 12 filters", 12),
    of(spectra.filter_or_quantization, "from 1 to 2 Hz", 1.0, 2.0),
    of(spectra.few_bins, "12 bins, 24 are needed", 12, 24),
    of(spectra.few_bins_left, "12 bins", 12, 20, 5.0, 0),
    of(spectra.few_bins_left, "lines hide 8 bins", 12, 20, 5.0, 8),
    of(spectra.unfiltered_noise, "1.04 times", 0.08, "bilinear low-pass of order 2 at 2 Hz", 1.04),
    of(spectra.worst_band, "at 1 to 2 Hz, 3.2 standard errors above", 1.0, 2.0, 3.2, above=True),
    of(spectra.worst_band, "below it", 1.0, 2.0, 3.2, above=False),
    of(spectra.grouped_lines, "4 weak lines from 1 to 5 Hz", 4, 1.0, 5.0),
]

POOLS = [
    of(pools.not_comparable, "no 95 % limits", "ok"),
    of(pools.not_comparable, "in doubt", "does_not_decide"),
    of(pools.not_comparable, "not determined", "not_identified"),
    of(pools.not_pooled, "2 recordings not used (no mean)", 2, "no mean"),
    of(pools.contradicting_limits, "1 recording not used", 1),
    of(pools.absent_in, "2 of 5 recordings", 2, 5),
    of(pools.recordings_differ, "the devices differ, or", of_devices=True),
    of(pools.recordings_differ, "differ: the sensor", of_devices=False),
    of(pools.status_reason, "not determined: too short", "not_identified", "too short"),
    of(pools.status_reason, "not in the model", "absent", None),
    of(pools.first_value, "first value with GM", "GM"),
    of(pools.first_value, "the first value", ""),
    of(pools.few_earlier, "only 1 earlier recording at", 1),
    of(pools.outlier_before, "night 15 was an outlier", "night 15"),
    of(pools.level_changed, "above the range expected from 15 earlier", 15, above=True),
    of(pools.level_changed, "below", 15, above=False),
    of(pools.operand_status, "the first value is not determined", "first", "not_identified"),
    of(pools.tau_beyond, "τ up to 400 s", 400.0),
    of(
        pools.undetermined,
        "in recording s/r, K of gyro x is",
        "K",
        "s/r",
        "gyro_x",
        "not_identified",
    ),
    of(pools.short_for_windows, "3 consecutive windows of 120 s", 3, 120.0, 360.0, 300.0),
    of(pools.gaps_between_windows, "5 overlapping windows", 5, 3, 120.0, 360.0),
    of(pools.long_sampling_interval, "0.1 Hz", 0.1),
    of(pools.recording_not_used, "recording r is not used: it was moved", "r", "it was moved"),
    of(
        pools.recordings_not_used,
        "recording a is not used: x; recording b is",
        [("a", "x"), ("b", "y")],
    ),
]

BUDGETS = [
    of(budgets.not_recorded, "has no gyro", "gyro"),
    of(budgets.noise_not_known, "gyro x and gyro y is", ["gyro_x", "gyro_y"], "short log"),
    of(budgets.noise_not_known, "the log does not show it", ["gyro_x"], None),
    of(budgets.channel_not_used, "gyro y is not used, as the noise", "gyro_y", None),
    of(budgets.parameter_status, "K of gyro x is bounded", "K", "gyro_x", "at_bound"),
    of(budgets.independent_draws, "may be too wide", "weighted", "gyro_x"),
    of(budgets.missing_numbers, "no value and no probability", ["sigma", "within"]),
]

DATASHEETS = [
    of(datasheets.other_option, "sensor file states C", "A", ["C"]),
    of(datasheets.other_option, "State the options", "A", []),
    of(datasheets.unpublished, "does not publish", looked_up=True),
    of(datasheets.unpublished, "does not state", looked_up=False),
    of(datasheets.density_of_rms, "√(2 bandwidth)"),
    of(datasheets.density_of_rms, "with 50 Hz (first order)", "50 Hz", "first order"),
    of(datasheets.curve_plateau, "0.664 B", 0.6643),
    of(datasheets.density_side, "N is the density / √2", "one-sided", assumed=True),
    of(datasheets.density_side, "two-sided density: N", "two-sided", assumed=False),
    of(datasheets.limits_decide, "follows from the limits", "not determined"),
    of(datasheets.interval_spans, "“as printed”", "as printed", "worse than typ"),
    of(datasheets.curve_not_shown, "at 500 s", 500.0),
    of(datasheets.mean_is_not_gravity, "8.2 m/s²", 8.2),
    of(datasheets.slope_at, "from readings of 21 to 34 °C", 27.0, 21.0, 34.0, bends=True),
    of(datasheets.slope_at, "slope at 27 °C", 27.0, None, None, bends=False),
]

EXPORTS = [
    of(
        exports.chosen_axis,
        "gyro x of recording r by method likelihood",
        *("gyro_x", "r", "likelihood", exports.axis_rank(3, "worst"), 60.0, 1e-3, "rad"),
    ),
    of(exports.axis_rank, "the worst of 3 axes", 3, "worst"),
    of(exports.axis_rank, "the only axis of d", 1, "worst", "d"),
    of(
        exports.axes_not_used,
        "(less noise at 60 s): gyro x and gyro y of a; and of 1 more recording",
        *("less_noise", 60.0, {"a": ["gyro_x", "gyro_y"], "b": ["gyro_x"]}, 1),
    ),
    of(
        exports.families_compared,
        "Smaller excess: N+GM 1.2 times",
        *("N+K", (4.0, 60.0), None, [("N+GM", 1.2)], 1.2),
    ),
    of(
        exports.families_compared,
        "No family is closer than 3.5 times",
        *("N+K", (4.0, 60.0), "a random walk cannot follow", [], 3.5),
    ),
    of(exports.temperature_range, "from 18 to 41 degC", 30.0, "warm", "serial 7", 18.0, 41.0),
    of(exports.axis_not_included, "axis z is not included", "z", exports.NO_TEMPERATURE_FIT),
    of(exports.axis_slope, "no lag", "x", 2e-4, (1e-4, 3e-4), 0.0, "rad/s", None),
    of(exports.axis_slope, "square", "x", 2e-4, (1e-4, 3e-4), 1e-6, "rad/s", 60.0),
    of(exports.status_reason, "not determined (why)", "the sensitivity", "not_identified", "why"),
    of(exports.effect_not_shown, "does not show an effect", None),
    of(exports.value_kind, "upper limit of K", "N+K", "N+K", True),
    of(exports.value_kind, "from the upper limit of K", "N+K", "N+GM", True),
    of(exports.value_kind, "slow terms of N+F+K together", "N+F+K", "N+K", False),
    of(exports.limit_of_walk, "Allan variance at 60 s", 1e-6, 60.0),
    of(
        exports.channel_in_use, "lines at 48 Hz (2.86 °/s rms)", "gyro_x", 1e-3, 0.1, [(48.0, 0.05)]
    ),
    of(exports.channel_in_use, "motion of 5.73 °/s rms removed", "gyro_x", 1e-3, 0.1, []),
    of(exports.noise_in_use, "Below 10 Hz all is taken as motion", 10.0, ["gyro x N = 1 °/s/√Hz"]),
    of(exports.floor_in_use, "Measure it with --in-use LOG", "the defaults of EKF2"),
    of(exports.raised, "at rest, K at least", 1e-4, 2e-4, 1e-6),
    of(exports.pooled, "in 2 recordings of the device: a, b", "gyro_x", ["a", "b"]),
    of(exports.status_reason, "its lag is not determined", "its lag", "not_identified", None),
]

SIMULATIONS = [
    of(simulations.of_data_sheet, "datasheet of s: sheet 1", "s", "sheet 1"),
    of(simulations.of_data_sheet, "the datasheet of s", "s", None),
    of(
        simulations.printed_figure,
        "N 0.01 dps: typ, datasheet (why)",
        "N",
        0.01,
        "dps",
        "typ",
        "why",
    ),
    of(
        calibration.describe_printed_noise,
        "typical figures (",
        simulations.of_data_sheet("s", None),
    ),
    of(
        calibration.describe_static_noise,
        "static recording r; method likelihood",
        "r",
        "likelihood",
    ),
    of(
        calibration.describe_static_noise,
        "of another specimen, 8, simulated, of its gyro y, as gyro x has",
        *("r", "likelihood"),
        device="8",
        simulated=True,
        channels=("gyro_y", "gyro_x"),
    ),
    of(calibration.explain_segments, "2 segments", 2),
    of(simulations.nothing_to_simulate, "no term has a value: a; b", ["a", "b"]),
    of(simulations.no_model_explains, "spectrum of gyro x", "gyro_x"),
]

FILES = [
    of(files.editor_backup, "ends in ~", "a.csv~"),
    of(files.still_transferred, "ending .part", ".part"),
    of(files.hidden, "begins with a dot", ".a.csv"),
    of(files.notes_without_log, "without a log night", "night"),
    of(files.misnamed_notes, "rename the file to night.yaml", "night.yaml"),
    of(files.unreadable, "(Permission denied)", "Permission denied"),
]

EXAMPLES = [
    *ESTIMATES,
    *CURVES,
    *SPECTRA,
    *POOLS,
    *BUDGETS,
    *DATASHEETS,
    *EXPORTS,
    *SIMULATIONS,
    *FILES,
]


MODULES = [
    import_module(f"{reasons.__name__}.{found.name}")
    for found in pkgutil.iter_modules(reasons.__path__)
] + [calibration, exports]
CONSTANTS = [
    value
    for module in MODULES
    for name, value in vars(module).items()
    if name.isupper() and not name.startswith("_") and isinstance(value, str)
]


def check_english(text: str) -> None:
    assert not re.search(r"\bnan\b|\binf\b|∞|–|None|\{|\(\)", text), text
    assert not re.search(r"not_|at_bound|gyro_|accel_|  ", text), text
    assert text == text.strip() and not text.endswith((".", ";", ":"))
    for sentence in re.split(r"[.?] ", text):
        assert len(sentence.split()) <= _MAX_WORDS, sentence
    for each in re.split(r"[.?] ", text)[1:]:
        assert each[0].isupper(), text


@pytest.mark.parametrize("text", CONSTANTS)
def test_a_constant_reason_is_plain_english(text: str) -> None:
    check_english(text)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example[0].__name__)
def test_a_reason_is_plain_english(example: Example) -> None:
    function, args, kwargs, part = example
    text = function(*args, **kwargs)
    assert part in text, text
    check_english(text)


def test_every_reason_has_an_example() -> None:
    functions = {
        function
        for module in MODULES
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if function.__module__ == module.__name__ and not name.startswith("_")
    }
    assert functions == {example[0] for example in EXAMPLES}

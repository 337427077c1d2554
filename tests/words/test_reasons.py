"""Each reason is plain English: complete, short sentences, without codes."""

import inspect
import pkgutil
import re
from collections.abc import Callable
from importlib import import_module
from typing import Any

import pytest

from imubench_pipeline.words import reasons
from imubench_pipeline.words.reasons import curves, estimates, spectra

_MAX_WORDS = 25

Example = tuple[Callable[..., str], tuple[Any, ...], dict[str, Any], str]


def of(function: Callable[..., str], part: str, *args: Any, **kwargs: Any) -> Example:
    """Return a function with its arguments, and a part of its text."""
    return function, args, kwargs, part


ESTIMATES = [
    of(estimates.absent, "do not support"),
    of(estimates.absent_below, "upper limit is at 95 %"),
    of(estimates.models_alike, "N+F, which includes it, fits about as well as N", ["N+F"], "N"),
    of(estimates.models_alike, "N+F and N+K, which include it", ["N+F", "N+K"], "N"),
    of(estimates.bias_models_alike, "about as well"),
    of(estimates.correlation_bound, "longest correlation time", 4444.4, longest=True),
    of(estimates.correlation_bound, "shortest correlation time", 0.1, longest=False),
    of(estimates.flicker_without_time, "no correlation time"),
    of(estimates.wide_interval, "11 times", 11.2),
    of(estimates.interval_with_zero, "lower 95 % limit is 0", at_limit=True),
    of(estimates.interval_with_zero, "includes 0", at_limit=False),
    of(estimates.excluded_by_likelihood, "0.52 to 0.61 times", "N", 0.52, 0.61),
    of(estimates.no_reference, "no K: not in the model", "K", "absent", None),
    of(estimates.no_reference, "no K: the log is too short", "K", "absent", "the log is too short"),
    of(estimates.criteria_disagree, "AIC prefers N+K by 2.4", "N+K", 2.4, "N", 1.3),
    of(estimates.model_disfavoured, "BIC prefers N+F to N+GM+K by 12.3", "N+F", "N+GM+K", 12.3),
    of(estimates.hardly_worse_without, "N, without Q", "Q", "N", "Q+N", 3.1),
    of(estimates.hardly_worse_bias, "another B. B_curve", "N+GM", "N+2GM", 3.1, several=True),
    of(estimates.hardly_worse_bias, "has no B", "N", "N+GM", 3.1, several=False),
    of(estimates.other_bias_terms, "AIC prefers N+2GM", "N+2GM", 5.0),
    of(estimates.slow_process, "may look like a random walk", "N+GM", 4.2),
    of(estimates.ramp_explains, "0.1 times as large", "N+K+R", 4.2, 0.1),
    of(estimates.drift_or_walk, "the 5 lowest", 5, "N"),
    of(estimates.smooth_drift, "f⁻⁴", "N", 9.1),
    of(estimates.few_frequencies, "Record a longer log", 5),
    of(estimates.signal_or_walk, "about as well as a random walk", estimates.warm_up(300.0)),
    of(estimates.signals_hide_walk, "deterministic"),
    of(estimates.pause_steps, "a step of the bias at a pause", 1),
    of(estimates.pause_steps, "at 3 pauses", 3),
    of(estimates.step_at, "at 123.4 s", 123.4),
    of(estimates.warm_up, "300 s", 300.0),
    of(estimates.periodic_drift, "period of 600 s", 600.0),
    of(estimates.curve_bias_unknown, "not determined", None),
    of(estimates.curve_bias_unknown, "short log", "short log"),
    of(estimates.band_excluded, "above 5 Hz", 5.0),
    of(estimates.short_log, "too short"),
    of(estimates.small_temperature_range, "only 0.2 K", 0.2),
    of(estimates.sensitivity_with_zero, "includes 0"),
    of(estimates.temperature_preferred, "by 12.3", 12.3, enough=True),
    of(estimates.temperature_preferred, "not enough", 2.3, enough=False),
    of(estimates.settling_excluded, "first 600 s", 600.0),
    of(estimates.lag_not_asked, "no lag"),
    of(estimates.no_effect_to_lag, "no effect"),
    of(estimates.lag_range, "lags from 3 to 90 s", 3.0, 90.0),
    of(estimates.temperature_like_ramp, "95 % of the information", 0.95),
    of(estimates.monotone_temperature, "Vary it up and down"),
    of(estimates.temperature_by_chance, "by chance"),
]

CURVES = [
    of(curves.repeated_samples, "samples repeat exactly"),
    of(curves.few_points, "3 of the 4 points", 3, 1 / 9, 4),
    of(curves.short_curve, "Record a longer log"),
    of(curves.no_white_slope, "between −0.9 and −0.7", -0.9, -0.7),
    of(curves.no_fall, "lowest at its shortest τ"),
    of(curves.no_rise, "less than 3 standard errors", 20.0, 3.0),
    of(curves.read_at_minimum, "N and K add to B"),
    of(curves.no_walk_slope, "has the slope 0.31", 0.31),
    of(curves.no_walk_slope, "near its end", None),
    of(curves.fit_without_term, "without this term"),
    of(curves.no_peak, "4444 s", 4444.4),
    of(curves.like_white_noise, "0.1 s", 0.1),
    of(curves.fitted_from, "τ = 0.1 s", 0.1),
    of(curves.no_noise, "no noise"),
    of(curves.large_error, "of N is 63 %, above 50 %", "N", 0.63, 0.5),
    of(curves.large_error, "of N is 1000 % or more", "N", 10.0),
    of(curves.no_significant_peak, "of T_B is 90 %", 0.9),
    of(curves.no_significant_peak, "of B is 20 %, but 90 % for T_B", 0.9, 0.2),
    of(curves.broadband_process, "0.3 s is broadband noise", 0.3),
    of(curves.broadband_peak, "below 1 s", 0.3, 1.0),
    of(curves.rises_to_end, "still rise at 4000 s", 4000.0),
    of(curves.time_at_bound, "not determined", estimates.correlation_bound(9.0, longest=True)),
    of(curves.no_bias_terms, "no flicker noise"),
    of(curves.no_model_minimum, "still falls at 4000 s", 4000.0),
    of(curves.no_model_minimum, "rises from its shortest", None),
    of(curves.minimum_beyond, "a ninth"),
    of(curves.white_level_of_model, "0.7 decades", 0.7),
    of(curves.white_level_of_curve, "a correlation time of 0.2 s", 0.3, 4.0, [0.2]),
    of(curves.white_level_of_curve, "correlation times of 0.1 s and 0.2 s", 0.3, 4.0, [0.1, 0.2]),
]

SPECTRA = [
    of(spectra.filter_text, "bilinear low-pass of order 2 at 2 Hz", "bilinear", 2, 2.0),
    of(spectra.filter_text, "running mean (boxcar) at 24.8 Hz", "boxcar", 1, 24.8),
    of(spectra.band_text, "up to 7 Hz are fitted, as set", "set", 7.0),
    of(spectra.band_text, "a tenth of the stated", "bandwidth", 7.0),
    of(spectra.band_text, "bends above 7 Hz", "bend", 7.0),
    of(spectra.band_text, "a twentieth", "no_model", 7.0),
    of(spectra.band_text, "up to the Nyquist", "whole", 7.0),
    of(spectra.band_text, "boxcar", "filtered", 7.0, "running mean (boxcar) at 24.8 Hz"),
    of(spectra.band_text, "order 2", "attenuated", 7.0, "bilinear low-pass of order 2 at 2 Hz"),
    of(spectra.cutoff_range, "cut-offs from 1 to 2 Hz", 1.0, 2.0),
    of(spectra.unknown_filter, "none of the 12 filters", 12),
    of(spectra.filter_or_quantization, "from 1 to 2 Hz", 1.0, 2.0),
    of(spectra.no_filter, "no low-pass"),
    of(spectra.few_bins, "12 bins, 24 are needed", 12, 24),
    of(spectra.few_bins_left, "12 bins", 12, 20, 5.0, 0),
    of(spectra.few_bins_left, "lines hide 8 bins", 12, 20, 5.0, 8),
    of(spectra.process_or_filter, "T_B = 0.05 s", 0.05, 3.18),
    of(spectra.fast_process_or_filter, "State the bandwidth", 0.05),
    of(spectra.unfiltered_noise, "1.04 times", 0.08, "bilinear low-pass of order 2 at 2 Hz", 1.04),
    of(spectra.worst_band, "at 1 to 2 Hz, 3.2 standard errors above", 1.0, 2.0, 3.2, above=True),
    of(spectra.worst_band, "below it", 1.0, 2.0, 3.2, above=False),
    of(spectra.grouped_lines, "4 weak lines from 1 to 5 Hz", 4, 1.0, 5.0),
]

EXAMPLES = [*ESTIMATES, *CURVES, *SPECTRA]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example[0].__name__)
def test_a_reason_is_plain_english(example: Example) -> None:
    function, args, kwargs, part = example
    text = function(*args, **kwargs)
    assert part in text, text
    assert not re.search(r"\bnan\b|\binf\b|∞|–|None|\{|\(\)", text), text
    assert not re.search(r"not_|at_bound|gyro_|accel_|  ", text), text
    assert text == text.strip() and not text.endswith((".", ";", ":"))
    for sentence in re.split(r"[.?] ", text):
        assert len(sentence.split()) <= _MAX_WORDS, sentence
    for each in re.split(r"[.?] ", text)[1:]:
        assert each[0].isupper(), text


def test_every_reason_has_an_example() -> None:
    modules = [
        import_module(f"{reasons.__name__}.{found.name}")
        for found in pkgutil.iter_modules(reasons.__path__)
    ]
    functions = {
        function
        for module in modules
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if function.__module__ == module.__name__ and not name.startswith("_")
    }
    assert functions == {example[0] for example in EXAMPLES}

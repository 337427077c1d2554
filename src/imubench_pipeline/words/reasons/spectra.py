"""Reasons for what a spectrum shows: the fitted band, the filter of the sensor, lines."""

from imubench_pipeline.model.states import BandSource
from imubench_pipeline.words.numbers import counted, number_text, percent_text

NO_FILTER = "the spectrum shows no low-pass"


def filter_text(kind: str, order: int, cutoff: float) -> str:
    """Return a low-pass filter: ``analogue low-pass of order 2 at 5 Hz``."""
    name = "running mean (boxcar)" if kind == "boxcar" else f"{kind} low-pass of order {order}"
    return f"{name} at {number_text(cutoff)} Hz"


def band_text(source: BandSource, highest: float, low_pass: str = "") -> str:
    """Return why the spectrum is fitted up to a frequency, Hz; ``low_pass``: filter in it."""
    limit = f"{number_text(highest)} Hz"
    match source:
        case "set":
            return f"frequencies up to {limit} are fitted, as set"
        case "whole":
            return "the spectrum follows its model up to the Nyquist frequency"
        case "filtered":
            return (
                f"with a filter ({low_pass}), the spectrum follows its model up to the Nyquist "
                "frequency"
            )
        case "attenuated":
            return f"the spectrum is fitted up to {limit}, below the bend of a filter ({low_pass})"


def cutoff_range(lower: float, upper: float) -> str:
    return f"cut-offs from {number_text(lower)} to {number_text(upper)} Hz fit the log"


def unknown_filter(number: int) -> str:
    """Return why a bend is no known filter; ``number``: how many filters were tried."""
    return f"the spectrum bends, but like none of the {number} filters that were tried"


def filter_or_quantization(lower: float, upper: float) -> str:
    return (
        "the spectrum rises towards the Nyquist frequency. Quantization noise explains it as well "
        f"as a low-pass with a cut-off from {number_text(lower)} to {number_text(upper)} Hz"
    )


def few_bins(bins: int, needed: int) -> str:
    return f"the spectrum has {bins} bins, {needed} are needed. Record a longer log"


def few_bins_left(bins: int, needed: int, highest: float, hidden: int) -> str:
    """Return why nothing is fitted up to a frequency, Hz; ``hidden``: number of bins with lines."""
    text = (
        f"the log is too short: {counted(bins, 'bin')} of the spectrum up to "
        f"{number_text(highest)} Hz can be fitted, {needed} are needed"
    )
    return f"{text}. Spectral lines hide {counted(hidden, 'bin')}" if hidden else text


def unfiltered_noise(share: float, low_pass: str, factor: float) -> str:
    """Return the part of N_sensor that bypasses a filter.

    ``share``: power of the noise that bypasses the filter, divided by the filtered power;
    ``factor``: largest N_sensor divided by the estimate.
    """
    return (
        f"white noise with {percent_text(share, 2)} of the filtered power bypasses the {low_pass}, "
        f"as in interpolated logs. N_sensor may be up to {number_text(factor, 3)} times as high"
    )


def worst_band(first: float, last: float, sigmas: float, *, above: bool) -> str:
    side = "above" if above else "below"
    return (
        f"the spectrum is furthest from the model at {number_text(first, 3)} to "
        f"{number_text(last, 3)} Hz, {number_text(sigmas, 2)} standard errors {side} it"
    )


def grouped_lines(lines: int, first: float, last: float) -> str:
    return (
        f"{counted(lines, 'weak line')} from {number_text(first)} to {number_text(last)} Hz, merged"
    )

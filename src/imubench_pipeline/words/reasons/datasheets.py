"""Reasons for comparisons of measured with printed figures."""

from collections.abc import Mapping, Sequence

from imubench_pipeline.words.numbers import number_text

ONE_LOG_OBSTACLES: Mapping[str, str] = {
    "bias_repeatability": "a spread between runs: see the table repeatability",
    "drift": "the datasheet does not define this drift",
    "temperature_total": (
        "a total over the temperature range of the datasheet, and the log has another range"
    ),
    "temperature_rms": (
        "an rms over the temperature profile of the datasheet, and the log has another profile"
    ),
}
"""Why figures cannot be compared with one log."""


ONLY_MINIMUM = "only a minimum is printed"
RMS_WITHOUT_BANDWIDTH = "an rms without its bandwidth does not give a density"
DEVIATION_WITHOUT_TIME = "an Allan deviation without its averaging time cannot be compared"
WALK_IS_DENSITY = "the printed random walk is N"
CURVE_MINIMUM = "compared with the minimum of the curve"
CURVE_AT_TIME = "compared with the curve at this averaging time"
EARTH_RATE_IN_MEAN = "mean of the recording, which includes up to ±15 °/h of the Earth's rotation"
GRAVITY_NEEDS_THREE_AXES = "three axes are needed to subtract gravity"
AXIS_NOT_VERTICAL = "the axis is not vertical, so its offset cannot be separated from tilt"
NORM_LESS_GRAVITY = (
    "norm of the three axes less standard gravity. It includes the scale factor error, and "
    "local gravity differs by up to 0.027 m/s²"
)
NO_TEMPERATURE = "the log has no temperature readings"
NO_INTERVAL = "it has no interval"


def other_option(option: str, stated: Sequence[str]) -> str:
    """Return why a figure of an option is not compared; ``stated``: options in the sensor file."""
    if stated:
        return f"printed for the option {option}, but the sensor file states {', '.join(stated)}"
    return f"printed for the option {option}. State the options of the logged sensor in its file"


def unpublished(*, looked_up: bool) -> str:
    return "the vendor does not publish it" if looked_up else "the sensor file does not state it"


def density_of_rms(bandwidth: str | None = None, low_pass: str | None = None) -> str:
    text = "N is the printed rms / √(2 bandwidth)"
    return text if bandwidth is None else f"{text}, with {bandwidth} ({low_pass})"


def curve_plateau(floor: float) -> str:
    """Return that a plateau is compared; ``floor``: Allan deviation of flicker noise / B."""
    return f"compared with the plateau of the bias instability, {number_text(floor, 3)} B"


def density_side(sidedness: str, *, assumed: bool) -> str:
    unsure = " (assumed, as the datasheet does not state it)" if assumed else ""
    root = " / √2" if sidedness == "one-sided" else ""
    return f"{sidedness} density{unsure}: N is the density{root}"


def limits_decide(reason: str) -> str:
    return f"{reason}; the verdict follows from the limits"


def interval_spans(least: str, largest: str) -> str:
    return f"the 95 % interval extends from “{least}” to “{largest}”"


def curve_not_shown(tau: float) -> str:
    return f"the log does not show the curve at {number_text(tau)} s"


def mean_is_not_gravity(norm: float) -> str:
    """Return why the bias of an accelerometer is not known; ``norm`` in m/s²."""
    return f"the mean acceleration is {number_text(norm)} m/s², which is not gravity"


def slope_at(reference: float, lowest: float | None, highest: float | None, *, bends: bool) -> str:
    """Return the temperatures of a sensitivity, °C; ``bends``: it changes with temperature."""
    text = f"slope at {number_text(reference, 3)} °C"
    if lowest is not None and highest is not None:
        text += (
            f", from readings of {number_text(lowest, 3)} to {number_text(highest, 3)} °C. "
            "The range of the vendor differs"
        )
    return f"{text}; the slope changes with temperature" if bends else text

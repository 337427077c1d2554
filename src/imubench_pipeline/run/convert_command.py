"""`imubench convert`: figures of inertial sensors from one unit or quantity to another."""

import argparse
import math

from imubench_pipeline import units

_SIGNALS = {"gyro": "angular_rate", "accel": "acceleration"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.description = (
        "Convert a figure to another unit: a noise density to a random walk, with --rate the "
        "standard deviation of samples to a density, with --horizon a bias instability to a rate "
        "random walk, with --sensitivity counts to SI."
    )
    parser.add_argument("figure", help="with its unit, such as '0.005 deg/s/sqrt(Hz)'")
    parser.add_argument("--to", required=True, metavar="UNIT", help="such as 'deg/sqrt(h)'")
    parser.add_argument(
        "--one-sided",
        action="store_true",
        help="the figure is a one-sided density: N is the density over sqrt(2)",
    )
    parser.add_argument("--rate", help="of the samples, such as '100 Hz'")
    parser.add_argument(
        "--horizon",
        help="time at which the random walk has the Allan deviation of the bias instability, "
        "such as '1 h'",
    )
    parser.add_argument("--sensitivity", help="of the counts, such as '131 LSB/(deg/s)'")


def run(arguments: argparse.Namespace) -> int:
    """Print the converted figure and the formula of the conversion; return the exit status."""
    from imubench_pipeline.words.numbers import number_text

    value, relation = convert_figure(
        arguments.figure,
        arguments.to,
        one_sided=arguments.one_sided,
        rate=arguments.rate,
        horizon=arguments.horizon,
        sensitivity=arguments.sensitivity,
    )
    print(f"{arguments.figure} = {number_text(value, 6)} {arguments.to}{relation}")
    return 0


def convert_figure(
    figure: str,
    to: str,
    *,
    one_sided: bool = False,
    rate: str | None = None,
    horizon: str | None = None,
    sensitivity: str | None = None,
) -> tuple[float, str]:
    """Return a figure in the unit ``to``, and a text with the formula of the conversion, if any.

    ``figure`` includes its unit; ``rate``, ``horizon`` and ``sensitivity`` are texts such as
    "100 Hz", "1 h" and "131 LSB/(deg/s)". Raises a `UnitError` if the units do not match.

    Examples
    --------
    >>> round(convert_figure("0.005 deg/s/sqrt(Hz)", "deg/sqrt(h)", one_sided=True)[0], 4)
    0.2121
    """
    number, unit = units.split_quantity(figure)
    if one_sided:
        if not any(_is_a(unit, f"{sensor}_density") for sensor in _SIGNALS):
            raise units.UnitError(f"--one-sided: {unit!r} is no density; omit the option")
        value = units.convert(number, unit, to) / math.sqrt(2.0)
        return value, " (N: one-sided density / sqrt(2))"
    if rate is not None:
        option, result = "--rate", "density"
        factor = 1.0 / math.sqrt(units.parse_quantity(rate, "frequency"))
        relation = f" (standard deviation / sqrt({rate}))"
    elif horizon is not None:
        option, result = "--horizon", "random_walk"
        factor = math.sqrt(3.0 / units.parse_quantity(horizon, "time"))
        relation = f" (K: bias instability x sqrt(3 / {horizon}))"
    elif sensitivity is not None:
        scale, scale_unit = units.split_quantity(sensitivity)
        for sensor, signal in _SIGNALS.items():
            if unit in ("LSB", "counts") and _is_a(scale_unit, f"{sensor}_sensitivity"):
                per_si = units.find_conversion(scale_unit, f"{sensor}_sensitivity")[0] * scale
                return units.convert_from_si(number / per_si, to, signal), f" (at {sensitivity})"
        raise units.UnitError(
            f"--sensitivity: found a figure in {unit!r} and a sensitivity in {scale_unit!r}; "
            "expected a figure in LSB, and a sensitivity such as '131 LSB/(deg/s)'"
        )
    else:
        return float(units.convert(number, unit, to)), ""
    for sensor, signal in _SIGNALS.items():
        if _is_a(unit, signal):
            si = units.find_conversion(unit, signal)[0] * number
            return units.convert_from_si(factor * si, to, f"{sensor}_{result}"), relation
    raise units.UnitError(f"{option}: found the unit {unit!r}; expected one such as deg/s or mg")


def _is_a(unit: str, dimension: str) -> bool:
    try:
        units.find_conversion(unit, dimension)
    except units.UnitError:
        return False
    return True

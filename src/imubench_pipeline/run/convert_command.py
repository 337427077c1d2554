"""`imubench convert`: figures of inertial sensors from one unit or quantity to another."""

import argparse
import math
from typing import TYPE_CHECKING

from imubench_pipeline.settings.command_line import CommandError

if TYPE_CHECKING:
    from collections.abc import Callable

_SENSORS = ("gyro", "accel")
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
    """Print the converted figure with its relation; return the exit status."""
    from imubench_pipeline.units import UnitError
    from imubench_pipeline.words.numbers import number_text

    try:
        value, relation = convert_figure(
            arguments.figure,
            arguments.to,
            one_sided=arguments.one_sided,
            rate=arguments.rate,
            horizon=arguments.horizon,
            sensitivity=arguments.sensitivity,
        )
    except UnitError as error:
        raise CommandError(str(error)) from error
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
    """Return a figure in another unit, and the relation that was used, in words.

    ``figure`` has its unit; ``rate``, ``horizon`` and ``sensitivity`` are quantities as
    `imubench convert` takes them. Raises a `UnitError` for units that do not belong together.

    Examples
    --------
    >>> round(convert_figure("0.005 deg/s/sqrt(Hz)", "deg/sqrt(h)", one_sided=True)[0], 4)
    0.2121
    """
    from imubench_pipeline.units import (
        UnitError,
        convert,
        convert_from_si,
        find_conversion,
        parse_quantity,
        split_quantity,
    )

    number, unit = split_quantity(figure)
    if one_sided:
        if not any(_is_a(unit, f"{sensor}_density") for sensor in _SENSORS):
            raise UnitError(f"{unit!r} is no density, so --one-sided does not apply")
        value = convert(number, unit, to) / math.sqrt(2.0)
        return value, " (N: one-sided density / sqrt(2))"

    def follow(
        stated: str, of: "Callable[[str], str]", result: str, factor: float, relation: str
    ) -> tuple[float, str]:
        """Return the figure times a factor, of the sensor whose dimensions both units have."""
        for sensor in _SENSORS:
            if _is_a(unit, of(sensor)):
                si = find_conversion(unit, of(sensor))[0] * number
                return convert_from_si(factor * si, to, result.format(sensor)), relation
        raise UnitError(f"{unit!r} does not belong to {stated}; expected such as deg/s or mg")

    if rate is not None:
        samples = parse_quantity(rate, "frequency")
        factor, relation = 1.0 / math.sqrt(samples), f" (standard deviation / sqrt({rate}))"
        return follow("--rate", _SIGNALS.__getitem__, "{}_density", factor, relation)
    if horizon is not None:
        seconds = parse_quantity(horizon, "time")
        factor = math.sqrt(3.0 / seconds)
        relation = f" (K: bias instability x sqrt(3 / {horizon}))"
        return follow("--horizon", _SIGNALS.__getitem__, "{}_random_walk", factor, relation)
    if sensitivity is not None:
        for sensor in _SENSORS:
            scale, scale_unit = split_quantity(sensitivity)
            if unit in ("LSB", "counts") and _is_a(scale_unit, f"{sensor}_sensitivity"):
                per_si = find_conversion(scale_unit, f"{sensor}_sensitivity")[0] * scale
                value = convert_from_si(number / per_si, to, _SIGNALS[sensor])
                return value, f" (at {sensitivity})"
        raise UnitError("expected a figure in LSB and a sensitivity such as '131 LSB/(deg/s)'")
    return float(convert(number, unit, to)), ""


def _is_a(unit: str, dimension: str) -> bool:
    from imubench_pipeline.units import UnitError, find_conversion

    try:
        find_conversion(unit, dimension)
    except UnitError:
        return False
    return True

"""How well estimates of real logs repeat: pieces of a recording against each other and the curve.

python benchmarks/real_logs.py [--logs FOLDER] [--method robust] [--pieces 2 4] [--only NAME]
python benchmarks/real_logs.py --rate 100 LOG.csv ...

Each recording is cut into equal pieces, and each channel of each piece is estimated by the public
interface at default settings. FOLDER holds real recordings (default: ../shared/logs); a LOG is a
table with columns gyro_x to accel_z in SI. Printed for each parameter, gyros and accelerometers
apart:

given     share of the pieces with a value and a lower limit above 0
z         of neighbouring pieces: (ln a - ln b) / hypot(s_a, s_b), where s is the distance to the
          limit that faces the other value, |ln(limit / value)| / 1.96
agree     share of the pairs with |z| < 1.96; a value agrees with a bound if its lower limit is
          below that bound; 95 % limits of a binomial share (Clopper and Pearson)
spread    median |ln a - ln b|
width     median ln(upper / lower)
bound     of the pieces without a value of K, those with a useful upper limit:
          K sqrt(tau / 3) <= 3 sigma(tau) at tau = a ninth of the piece
on curve  N over the level of sigma sqrt(tau) on the first -1/2 stretch of the piece
predicts  model of a piece against the curve of the next one, by decade of tau: median |ln ratio|,
          and the share of the points within 1.96 standard errors of both curves

References
----------
C. J. Clopper and E. S. Pearson, Biometrika 26, 1934.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from scipy.stats import beta

import imubench_pipeline as imu
from imubench_pipeline.allan import AllanCurve, allan_variance
from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.library.estimates import ChannelEstimate
from imubench_pipeline.settings.config import Method
from imubench_pipeline.typing import Array

CHANNELS = tuple(f"{quantity}_{axis}" for quantity in ("gyro", "accel") for axis in "xyz")
PARAMETERS = ("N", "B_curve", "B", "K", "T_B", "sigma_min", "tau_min")
LOGS = Path(__file__).resolve().parents[2] / "shared/logs"
MIN_SAMPLES, MIN_DURATION = 20_000, 3_600.0  # of a piece: so many samples, or so long (s)
DECADES = range(-3, 5)

MIN_DECADES = 0.7  # Length of a stretch
MIN_CLUSTER = 3  # Samples; fewer show the register and the sensor's filter
MAX_ERROR = 0.03  # Relative standard error of the deviation within a stretch

FLAT_WITHIN, MAX_FLAT_WITHIN = 0.03, 0.06
"""Maximum distance from the median: the first, or two standard errors up to the second."""


@dataclass(frozen=True)
class WhiteStretch:
    """The first stretch of slope -1/2 of an Allan deviation."""

    level: float  # median of sigma sqrt(tau), SI
    first: float  # shortest tau, s
    last: float  # longest tau, s


def find_white_stretch(curve: AllanCurve) -> WhiteStretch | None:
    """Return the first -1/2 stretch of an Allan deviation; None without one.

    The first 0.7 decade or more, from clusters of 3 samples on, whose points all lie within 3 % of
    their median (or two standard errors, at most 6 %), up to a standard error of 3 %.
    """
    n, averaged = curve.cluster_size.astype(np.float64), curve.averaged
    degrees = 1.5 * curve.samples / (2.0 * n) * 4.0 * n**2 / (4.0 * n**2 + 5.0) - 1.0
    error = 0.5 * np.sqrt(2.0 / np.maximum(degrees, 1.0))
    # Where samples are missing, white noise is averaged over fewer than n: as at a shorter tau.
    level = curve.deviation * np.sqrt(averaged / curve.rate)
    within = np.clip(2.0 * error, FLAT_WITHIN, MAX_FLAT_WITHIN)
    for start in np.flatnonzero(n >= MIN_CLUSTER):
        stop = start
        while stop < len(n) and error[stop] < MAX_ERROR:
            part = level[start : stop + 1]
            middle = np.median(part)
            if not middle > 0.0 or np.any(np.abs(part / middle - 1.0) > within[start : stop + 1]):
                break
            stop += 1
        if stop > start and math.log10(n[stop - 1] / n[start]) >= MIN_DECADES:
            first, last = float(curve.tau[start]), float(curve.tau[stop - 1])
            return WhiteStretch(float(np.median(level[start:stop])), first, last)
    return None


@dataclass(frozen=True)
class Recording:
    """A real recording in SI."""

    name: str
    samples: Array  # (L, channels)
    rate: float  # Hz
    channels: tuple[str, ...]


@dataclass(frozen=True)
class Figure:
    """A parameter of a piece; NaN for what is not given."""

    value: float
    lower: float
    upper: float
    status: str

    @property
    def given(self) -> bool:
        """Whether there is a value with a lower limit above 0."""
        return self.value > 0.0 and self.lower > 0.0 and not np.isnan(self.upper)


@dataclass(frozen=True)
class Measured:
    """The Allan deviation of a piece, and its relative standard error for white noise."""

    tau: Array
    deviation: Array
    error: Array


@dataclass(frozen=True)
class Piece:
    """One channel of one piece of a recording, estimated."""

    log: str
    channel: str
    method: str
    pieces: int
    piece: int
    figures: Mapping[str, Figure]
    level: float | None  # of sigma sqrt(tau) on the first -1/2 stretch, SI
    longest: float  # a ninth of the piece, s
    deviation: float  # at that tau, SI
    predicts: Mapping[int, tuple[float, float]]  # by decade of tau

    def precedes(self, other: Piece) -> bool:
        """Tell whether another piece follows this one in the same recording."""
        same = ("log", "channel", "method", "pieces")
        return self.piece + 1 == other.piece and all(
            getattr(self, name) == getattr(other, name) for name in same
        )


def recordings(folder: Path, only: str = "") -> Iterator[Recording]:
    """Yield the real recordings with a part of a name: of ADIS16405, CATS and MPU-6050."""
    import pandas as pd

    def find(pattern: str) -> Iterator[tuple[Path, str]]:
        for path in sorted(folder.glob(pattern)):
            name = path.name.split(".")[0].removeprefix("mpu6050_")
            name = f"{path.parent.name}/{name}"
            if only in name:
                yield path, name

    for path, name in find("adis16405/*.csv.gz"):
        samples = pd.read_csv(path)[list(CHANNELS)].to_numpy()
        samples = samples * np.repeat([np.pi / 180.0, STANDARD_GRAVITY], 3)
        yield Recording(name, samples, 100.0, CHANNELS)
    for path, name in find("cats/*.csv.gz"):
        table = pd.read_csv(path)
        gyros, accels = ([c for c in table if c.startswith(q)] for q in ("gyro", "accel"))
        samples = np.column_stack([table[gyros].to_numpy() * 1e-3, table[accels].to_numpy()])
        yield Recording(name, samples, 1.0, CHANNELS)
    for kind, unit, channels in (
        ("gyroscope", np.pi / 180.0, CHANNELS[:3]),
        ("accelerometer", STANDARD_GRAVITY, CHANNELS[3:]),
    ):
        for path, name in find(f"mpu6050/mpu6050_{kind}.mat"):
            import h5py

            with h5py.File(path) as file:
                arrays = (np.asarray(entry) for key, entry in file.items() if "#" not in key)
                matrix = next(array for array in arrays if array.ndim == 2 and 4 in array.shape)
            rows = matrix if matrix.shape[1] == 4 else matrix.T
            rate = (len(rows) - 1) / float(rows[-1, 0] - rows[0, 0])
            yield Recording(name, rows[:, 1:] * unit, rate, channels)


def tables(paths: Iterable[str], rate: float) -> Iterator[Recording]:
    """Yield recordings that are tables in SI."""
    import pandas as pd

    for path in paths:
        table = pd.read_csv(path)
        yield Recording(path, table.to_numpy(), rate, tuple(table.columns))


def white_level(curve: Measured, sizes: Array) -> float | None:
    """Return the median of sigma sqrt(tau) on the first -1/2 stretch of a curve, or None.

    It is 0.7 decade or longer, from clusters of 3 samples on, within 3 % of its median (or two
    standard errors, at most 6 %), up to a standard error of 3 %.
    """
    level, within = curve.deviation * np.sqrt(curve.tau), np.clip(2.0 * curve.error, 0.03, 0.06)
    for start in np.flatnonzero(sizes >= 3):
        stop = start
        while stop < len(sizes) and curve.error[stop] < 0.03:
            part = level[start : stop + 1]
            middle = np.median(part)
            if not middle > 0.0 or np.any(np.abs(part / middle - 1.0) > within[start : stop + 1]):
                break
            stop += 1
        if stop > start and sizes[stop - 1] >= 10.0**0.7 * sizes[start]:
            return float(np.median(level[start:stop]))
    return None


def measured(samples: Array, rate: float) -> tuple[Measured, float | None]:
    """Return the curve of a piece, 8 tau a decade up to a fifth of it, and its -1/2 level."""
    n = len(samples)
    sizes = np.unique(np.rint(10 ** np.arange(0.0, np.log10(n / 5), 1 / 8)).astype(int))
    curve = allan_variance(samples, rate, cluster_sizes=sizes)
    degrees = 1.5 * n / (2.0 * sizes) * (4.0 * sizes**2 / (4.0 * sizes**2 + 5.0)) - 1.0
    error = 0.5 * np.sqrt(2.0 / np.maximum(1.0, degrees))
    piece = Measured(curve.tau, curve.deviation, error)
    return piece, white_level(piece, curve.cluster_size.astype(np.float64))


def pieces_of(recording: Recording, channel: str, pieces: int, method: Method) -> Iterator[Piece]:
    """Yield the pieces of a channel, estimated; none where they are too short."""
    length, rate = len(recording.samples) // pieces, recording.rate
    if length < MIN_SAMPLES and length / rate < MIN_DURATION:
        return
    column = recording.samples[:, recording.channels.index(channel)]
    parts = [column[i * length : (i + 1) * length] for i in range(pieces)]
    curves = [measured(part, rate) for part in parts]
    for i, part in enumerate(parts):
        estimates = imu.estimate(part[:, None], rate, channels=[channel], method=method)
        estimate = estimates[channel]
        curve, level = curves[i]
        longest = length / rate / 9.0
        yield Piece(
            recording.name,
            channel,
            method,
            pieces,
            i,
            {name: figure_of(estimate, name) for name in PARAMETERS},
            level,
            longest,
            float(np.interp(longest, curve.tau, curve.deviation)),
            predictions(estimate, rate, curve, curves[i + 1][0]) if i + 1 < pieces else {},
        )


def figure_of(estimate: ChannelEstimate | Mapping[str, Parameter], name: str) -> Figure:
    """Return a parameter; without a value where the estimate does not know it."""
    try:
        parameter = estimate[name]
    except KeyError:
        return Figure(np.nan, np.nan, np.nan, "none")
    figures = (parameter.value, parameter.lower, parameter.upper)
    value, lower, upper = (np.nan if figure is None else figure for figure in figures)
    return Figure(value, lower, upper, parameter.status)


def predictions(
    estimate: ChannelEstimate, rate: float, own: Measured, following: Measured
) -> dict[int, tuple[float, float]]:
    """Return by decade of tau how the model of a piece predicts the curve of the next one."""
    model = np.sqrt(estimate.model.allan_variance(following.tau, rate))
    ratio = np.abs(np.log(following.deviation / model))
    allowed = 1.96 * np.hypot(following.error, np.interp(following.tau, own.tau, own.error))
    decades = np.floor(np.log10(following.tau) + 1e-9)
    return {
        decade: (float(np.median(ratio[at])), float(np.mean(ratio[at] < allowed[at])))
        for decade in DECADES
        if (at := decades == decade).any()
    }


def compare(first: Figure, second: Figure) -> float | bool | None:
    """Return z of two values, whether a value agrees with a bound, or None of two bounds."""
    if first.given and second.given:
        a, b = np.log(first.value), np.log(second.value)

        def side(figure: Figure, up: bool) -> float:
            ends = (figure.upper, figure.value) if up else (figure.value, figure.lower)
            return max(float(np.log(ends[0] / ends[1])) / 1.96, 1e-9)

        return float((a - b) / np.hypot(side(first, a < b), side(second, b < a)))
    value, bound = (first, second) if first.given else (second, first)
    if not value.given or np.isnan(bound.upper):
        return None
    return bool(value.lower <= bound.upper)


def share(part: int, number: int) -> str:
    """Return a share with its 95 % limits, in words."""
    if not number:
        return "-"
    lower = beta.ppf(0.025, part, number - part + 1) if part else 0.0
    upper = beta.ppf(0.975, part + 1, number - part) if part < number else 1.0
    return f"{part}/{number} = {part / number:4.0%} ({lower:.0%} to {upper:.0%})"


def on_curve(pieces: Iterable[Piece]) -> list[float]:
    """Return N over the level of the curve, of the pieces that have both."""
    return [
        piece.figures["N"].value / piece.level
        for piece in pieces
        if piece.level and piece.figures["N"].value > 0.0
    ]


def line(name: str, kind: str, pieces: Sequence[Piece]) -> str:
    """Return what is printed of a parameter of the gyros or the accelerometers."""
    figures = [piece.figures[name] for piece in pieces]
    pairs = [(a.figures[name], b.figures[name]) for a, b in pairwise(pieces) if a.precedes(b)]
    compared = [c for a, b in pairs if (c := compare(a, b)) is not None]
    z = np.array([c for c in compared if not isinstance(c, bool)])
    agree = sum(c if isinstance(c, bool) else abs(c) < 1.96 for c in compared)
    given = [figure for figure in figures if figure.given]
    text = f"{name:9s} {kind:5s} given {share(len(given), len(figures))}; "
    text += f"agree {share(agree, len(compared))}"
    if len(z):
        spread = [abs(np.log(a.value / b.value)) for a, b in pairs if a.given and b.given]
        width = [np.log(figure.upper / figure.lower) for figure in given]
        text += f"; rms z {np.sqrt(np.mean(z**2)):.2f}; spread {np.median(spread):.3f}; "
        text += f"width {np.median(width):.3f}"
    if name == "K":
        left = [piece for piece in pieces if not piece.figures["K"].given]
        useful = sum(
            piece.figures["K"].upper * np.sqrt(piece.longest / 3.0) <= 3.0 * piece.deviation
            for piece in left
        )
        text += f"; bound {share(useful, len(left))}"
    if name == "N" and (ratios := on_curve(pieces)):
        near = sum(abs(ratio - 1.0) < 0.03 for ratio in ratios)
        worst = max(ratios, key=lambda ratio: abs(np.log(ratio)))
        text += f"; on curve within 3 % {share(near, len(ratios))}, worst {worst:.2f}"
    return text


def report(pieces: Sequence[Piece]) -> Iterator[str]:
    """Yield the lines that are printed of the pieces of one method."""
    for name, kind in product(PARAMETERS, ("gyro", "accel")):
        if own := [piece for piece in pieces if piece.channel.startswith(kind)]:
            yield line(name, kind, own)
    for decade in DECADES:
        if found := [piece.predicts[decade] for piece in pieces if decade in piece.predicts]:
            yield (
                f"predicts, tau {10.0**decade:g} to {10.0 ** (decade + 1):g} s: median |ln ratio| "
                f"{np.median([ratio for ratio, _ in found]):.3f}, within "
                f"{np.mean([inside for _, inside in found]):.0%}"
            )


def main() -> int:
    """Print the tables; return 1 with --check where N is not on the curve."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("tables", nargs="*", metavar="LOG")
    parser.add_argument("--rate", type=float, help="of each LOG, Hz")
    parser.add_argument("--logs", type=Path, default=LOGS, metavar="FOLDER")
    parser.add_argument("--method", nargs="*", default=["robust"])
    parser.add_argument("--pieces", type=int, nargs="*", default=[2, 4])
    parser.add_argument("--only", default="", metavar="NAME", help="part of a recording's name")
    parser.add_argument("--channels", nargs="*", default=CHANNELS)
    parser.add_argument("--json", type=Path, help="file for the figures of all pieces")
    parser.add_argument(
        "--check", action="store_true", help="fail unless N is on the curve: 90 %%, 0.93 to 1.07"
    )
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if options.tables and not options.rate:
        parser.error("--rate is missing; expected the sampling rate of the logs in Hz")
    source = (
        tables(options.tables, options.rate)
        if options.tables
        else recordings(options.logs, options.only)
    )
    every: list[Piece] = []
    for recording in source:
        if options.only not in recording.name:
            continue
        for pieces, channel, method in product(options.pieces, recording.channels, options.method):
            if channel in options.channels:
                every += pieces_of(recording, channel, pieces, method)
        print(f"{recording.name}: done", file=sys.stderr, flush=True)
    if options.json:
        options.json.write_text(json.dumps([asdict(piece) for piece in every]))
    for method in options.method:
        print(f"\n== {method}")
        for text in report([piece for piece in every if piece.method == method]):
            print(text)
    ratios = on_curve(every)
    near = sum(abs(ratio - 1.0) < 0.03 for ratio in ratios)
    held = bool(ratios) and near >= 0.9 * len(ratios) and all(0.93 < r < 1.07 for r in ratios)
    if options.check and not held:
        print("N is not on the curve", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

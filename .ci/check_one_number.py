"""Check that every channel of a run has one N, B and K: in tables, models, pages, exports, budgets.

python .ci/check_one_number.py RESULTS [SENSOR=LOG ...] [--channels CHANNEL ...]

With LOG, the file or folder of a recording, and the sensor file that it is read by, the library is
asked for the same numbers: of all channels, or of some.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import io
import json
import math
import re
import sys
import zlib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pyarrow.parquet as pq

import imubench_pipeline as imu
from imubench_pipeline.estimators.rows import read_recommended_estimates
from imubench_pipeline.run.cli import main as imubench

NAMES = ("N", "B", "K")
Numbers = dict[str, float | None]  # by parameter; None: no value
Channel = tuple[str, str, str]  # sensor, recording, channel

wrong: list[str] = []
checked: dict[str, int] = {}


class Printed(float):
    """A printed number, with half a unit of its last digit."""

    half_unit: float


def check(where: str, channel: Channel, name: str, expected: float | None, found: object) -> None:
    """Note a number that differs; printed ones may differ by half a unit of their last digit."""
    checked[where] = checked.get(where, 0) + 1
    # Linear algebra on several cores, which a job of a run does not use, rounds otherwise.
    within = {"page": 2e-6, "library": 1e-7}.get(where, 1e-12)
    if isinstance(found, Printed) and expected is not None:
        same = abs(found - expected) <= found.half_unit * (1.0 + 1e-9)
    elif isinstance(found, float) and expected is not None:
        same = math.isclose(found, expected, rel_tol=within)
    else:
        same = found == expected
    if not same:
        wrong.append(f"{'/'.join(channel)}: {name} is {expected}, {where} has {found}")


class Page(HTMLParser):
    """Reads the first number of each cell of the recommended lines, by channel and symbol."""

    def __init__(self) -> None:
        super().__init__()
        self.numbers: dict[str, Numbers] = {}
        self._symbols: list[str] = []
        self._channel = ""
        self._cell, self._recommended, self._none, self._methods = -1, False, True, False

    def handle_starttag(self, tag: str, pairs: list[tuple[str, str | None]]) -> None:
        given = dict(pairs)
        if tag == "section":
            self._channel = given.get("aria-labelledby") or self._channel
        elif tag == "table":
            self._methods = "methods" in (given.get("class") or "").split()
            self._symbols = self._symbols if not self._methods else []
        elif tag == "th" and given.get("data-unit") and self._methods:
            self._symbols.append(str(given["data-unit"]).partition(".")[2])
        elif tag == "tr":
            self._recommended = self._methods and given.get("class") == "recommended"
            self._cell = -2  # the first cell is the model
        elif tag == "td":
            self._cell += 1
            self._none = "none" in (given.get("class") or "").split()
        elif tag == "data" and self._reads():
            own = self.numbers.setdefault(self._channel, {})
            own.setdefault(self._symbols[self._cell], float(str(given["value"])))

    def _reads(self) -> bool:
        of_symbol = 0 <= self._cell < len(self._symbols)
        return self._recommended and of_symbol and not self._none


def unfolded(path: Path) -> str:
    """Return a page with the parts that are unfolded when it opens."""
    text = path.read_text()
    packed = re.findall(r'<script type="text/html"[^>]*data-packed>([^<]*)</script>', text)
    return text + "".join(zlib.decompress(base64.b64decode(part)).decode() for part in packed)


def of_terminal(
    results: Path, channel: str, recordings: list[tuple[str, str]]
) -> Iterator[tuple[Channel, Numbers]]:
    """Yield what `imubench show` prints of a channel of the recordings, in SI."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        imubench(["show", str(results), "--units=si", "--width=600", f"--channel={channel}"])
    columns: list[str] = []
    before: list[str] = []
    for line in printed.getvalue().splitlines():
        cells = re.split(r"\s{2,}", line.strip())
        if cells[0] in ("recording", "channel"):  # and units; the line before has the symbols
            columns = before
        before = cells
        # Where there is one recording only, it is not named.
        match = re.match(rf"(?:(\S+) / (\S+) )?{channel}\b", cells[0])
        if match and columns and len(cells) == len(columns) + 1:
            numbers = dict(zip(columns, map(number_of, cells[1:]), strict=True))
            sensor, recording = match.groups() if match[1] else recordings[0]
            yield (sensor, recording, channel), numbers


def number_of(text: str) -> Printed | None:
    """Return a number as it is printed, or None of a word."""
    match = re.match(r"(-?[\d.]+)(?:×10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?(?: |$)", text)
    if match is None:
        return None
    exponent = (match[2] or "⁰").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    number = Printed(f"{match[1]}e{exponent}")
    decimals = len(match[1].partition(".")[2])
    number.half_unit = 0.5 * 10.0 ** (int(exponent) - decimals)
    return number


def of_exports(results: Path) -> Iterator[tuple[Channel, Numbers]]:
    """Yield the models that the files for any Kalman filter have."""
    for path in sorted(results.glob("exports/*/json/noise.json")):
        written = json.loads(path.read_text())
        for quantity in ("gyro", "accel"):
            lines = (
                text for text in written["about"] if text.startswith(f"{quantity}: {quantity}_")
            )
            about = next(lines, "")
            match = re.match(rf"{quantity}: (\S+) of recording (\S+) by", about)
            if match and quantity in written:
                yield (path.parts[-3], match[2], match[1]), written[quantity]["parameters"]


def narrow(lower: float, upper: float) -> bool:
    """Tell whether limits are at most four times apart."""
    return 0.0 < upper <= 4.0 * lower


def main(results: Path, logs: list[str], channels: list[str] | None) -> int:
    """Compare all numbers of a run; return the exit status."""
    values: dict[Channel, Numbers] = {}
    for row in pq.read_table(results / "tables/parameters.parquet").to_pylist():
        if row["recommended"] and row["component"] == 1 and row["parameter"] in NAMES:
            channel = (row["sensor"], row["recording"], row["channel"])
            values.setdefault(channel, {})[row["parameter"]] = row["value"]
            limits = (row["lower"], row["upper"])
            if row["status"] == "ok" and None not in limits and not narrow(*limits):
                wrong.append(f"{channel}: {row['parameter']} is ok, its limits are far apart")
    pages: dict[tuple[str, str], Page] = {}
    for sensor, recording, name in values:
        channel = (sensor, recording, name)
        folder = results / "recordings" / sensor / recording
        model = read_recommended_estimates(folder / "parameters.parquet")[name].model
        if (sensor, recording) not in pages:
            page = pages[sensor, recording] = Page()
            page.feed(unfolded(results / f"report/recordings/{sensor}/{recording}.html"))
        shown = pages[sensor, recording].numbers.get(name, {})
        for symbol, value in values[channel].items():
            if value is not None:
                check("model", channel, symbol, value, getattr(model, symbol))
            check("page", channel, symbol, value, shown.get(symbol))
    for name in {channel[2] for channel in values}:
        for channel, numbers in of_terminal(results, name, list(pages)):
            for symbol in NAMES:
                check("terminal", channel, symbol, values[channel][symbol], numbers.get(symbol))
    for channel, numbers in of_exports(results):
        for symbol in NAMES:
            if values[channel][symbol] is not None:
                check("export", channel, symbol, values[channel][symbol], numbers[symbol])
    for row in pq.read_table(results / "tables/error_budget.parquet").to_pylist():
        # White noise of density N grows to N sqrt(t) in the attitude, right from the start.
        own = (row["error"], row["quantity"], row["source"], row["through"], row["time"])
        if own == ("attitude", "gyro", "N", None, 1.0):
            channel = (row["sensor"], row["recording"], row["gyro"])
            check("budget", channel, "N", values[channel]["N"], row["sigma"])
    for log in logs:
        sensor, _, path = log.partition("=")
        estimates = imu.estimate(imu.read_log(path, sensor=sensor), channels=channels)
        for name, estimate in estimates.items():
            channel = (estimates.log.sensor, estimates.log.recording, name)
            for symbol in NAMES:
                check("library", channel, symbol, values[channel][symbol], estimate[symbol].value)
    print(f"one number in {', '.join(f'{where} ({n})' for where, n in checked.items())}")
    missing = {"model", "page", "terminal", "budget"} - checked.keys()
    print(*wrong, *(f"nothing was compared in {where}" for where in missing), sep="\n")
    return 1 if wrong or missing else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("results", type=Path)
    parser.add_argument("logs", nargs="*")
    parser.add_argument("--channels", nargs="*")
    sys.exit(main(**vars(parser.parse_args())))

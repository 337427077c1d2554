"""Mutated declarations and notes: ``python -m tests.fuzz.declared --minutes 10``.

Settings, notes beside logs, requirements, units, tables that exports are made of, and what a run
keeps for the next one. Each input is taken, or refused with the error of the project that names the
file, in 10 s and 600 MB, and in few words: never another exception.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import random
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from imubench_pipeline.extensions.nightly.summary import State, StateError, read_state
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.readers.bounded import limit_memory
from imubench_pipeline.recordings.kept import AnalysedChannel, Quality
from imubench_pipeline.report.publish import _read_keys
from imubench_pipeline.run.faults import Faults
from imubench_pipeline.run.lock import _describe_holder, read_note
from imubench_pipeline.run.recovery import was_restarted
from imubench_pipeline.settings.config import read_run
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import RecordingNotes, Sensor, merged_log
from imubench_pipeline.settings.simulated_recordings import read_simulated
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.settings.yaml_files import read_yaml
from imubench_pipeline.simulate.models import read_model_file
from imubench_pipeline.tables.failures import Failure, read_failure
from imubench_pipeline.tables.files import TableError, read, write
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.units import SI_UNITS, UnitError, find_conversion, parse_quantity
from tests.conftest import PROJECT
from tests.fuzz.mutations import mutated
from tests.rows import typed

SEEDS = Path(__file__).with_name("seeds")
"""Inputs that something failed with once, a folder a subject."""

_LONGEST_S = 10.0
_MOST_MIB = 600
_LONGEST_MESSAGE = 20_000
"""Letters: 20 faults of a file, each of a line at most."""
_LONGEST_LINE = 3000
_WORDS = (
    *(
        b"null",
        b"true",
        b"[]",
        b"{}",
        b"[",
        b"{",
        b"- ",
        b": ",
        b"&a ",
        b"*a",
        b"<<: *a",
        b"!!set ",
    ),
    *(b"!!timestamp ", b"!!binary ", b"!!float x", b"|\n", b"? ", b"---\n", b"...", b"%YAML 1.1\n"),
    *(
        b".inf",
        b".nan",
        b"1e400",
        b"-0",
        b"0x1F",
        b"1_000",
        b"12:30:45",
        b"2001-01-01",
        b"\xc2\x85",
    ),
    *(
        b"deg/s/sqrt(Hz)",
        b"deg^99999",
        b"m/s^2",
        b"(" * 50,
        b"1/" * 50,
        b"^^",
        b"**9",
        b"\xc2\xb5g",
    ),
    *(b"[" * 2000, b"9" * 5000, b'"\\ud800"', b"1e-400", b"NaN", b"-Infinity", b"-1", b'""', b"\t"),
)
"""What stands in such files; tokens of logs come from `tests.fuzz.mutations`."""

Take = Callable[[Path], object]


@dataclass(frozen=True)
class Subject:
    """What is read, and how.

    Attributes
    ----------
    name : str
        Of the file.
    take : callable
        Reads it.
    seeds : sequence of bytes
    refusals : tuple of type
        What it may raise.
    """

    name: str
    take: Take
    seeds: Sequence[bytes]
    refusals: tuple[type[Exception], ...] = (ConfigError,)


def _settings(*patterns: str) -> list[bytes]:
    return [path.read_bytes() for pattern in patterns for path in sorted(PROJECT.glob(pattern))]


def _yaml(*given: object) -> list[bytes]:
    return [yaml.safe_dump(one).encode() for one in given]


_SENSOR = parse(
    Sensor,
    {
        "vendor": "V",
        "model": "M",
        "log": {
            "time": {"column": "t", "unit": "s"},
            "channels": {"gyro_x": {"column": "w", "unit": "deg/s"}},
        },
    },
    "sensor",
)
_NOTES = _yaml(
    {"device": "serial 7", "power_cycled": True, "log": {"rate": "100 Hz", "delimiter": ";"}},
    {
        "two_position": {
            "latitude": "40 deg", "dwell": "30 s", "turning": "1.5 s", "first": "north"
        }
    },
    {
        "rate_table": {
            "steps": [{"start": "0 s", "end": "60 s", "rate": "10 deg/s"}],
            "axis": {"latitude": "45 deg", "elevation": "90 deg"},
        }
    },
    {"pointing": {"latitude": "40 deg", "heading": "90 deg", "heading_sigma": "1 deg"}},
    {"use": {"start": "10 s", "end": "1 h"}, "temperature": {"column": "T", "unit": "degC"}},
)  # fmt: skip
_FIGURES = {"gyro_x": {"N": "0.01 deg/s/sqrt(Hz)"}}
_MODELS = _yaml({"source": "a paper", "axes": _FIGURES})
_SIMULATED = _yaml(
    {
        "recordings": [
            {
                "sensor": "s", "recording": "sim_a", "duration": "40 s", "rate": "100 Hz",
                "seed": 1, "source": "none", "channels": _FIGURES,
            }
        ]
    }
)  # fmt: skip
_UNITS = [
    f"{number} {unit}".encode()
    for number in ("0.005", "-3e-2", "10/3", "1,5")
    for unit in ("deg/s/sqrt(Hz)", "°/√h", "µg", "m/s²", "LSB/g", "(deg/h)^2/Hz", "dps/√Hz", "degC")
]
_FAILURE = Failure("s", "a", "estimate", "error", "the step estimate failed: ValueError: no")


def _take_model(model: type[Any], path: Path) -> object:
    return parse(model, read_yaml(path), str(path))


def _take_notes(path: Path) -> object:
    notes = parse(RecordingNotes, read_yaml(path) or {}, str(path))
    return merged_log(_SENSOR, notes, str(path))


def _take_run(path: Path) -> object:
    given = read_yaml(path)
    if not isinstance(given, Mapping):
        raise ConfigError(f"{path}: found no keys and values")  # Snakemake refuses it itself
    return read_run(given, str(path))


def _take_simulated(path: Path) -> object:
    return read_simulated(path, {"s": _SENSOR})


def _take_unit(path: Path) -> object:
    text = path.read_bytes().decode("utf-8", "replace")
    refused = 0
    for dimension in SI_UNITS:
        for take in (parse_quantity, find_conversion):
            try:
                take(text, dimension)
            except UnitError as error:
                _check(error, "", len(text))
                refused += 1
    return refused


def _take_table(path: Path) -> object:
    read_failure(path)
    return read("fixed_bias", [path]).to_pylist()


def _take_quality(path: Path) -> object:
    read_failure(path)
    found = Quality.read(path)
    return found.fault(path.parent, whole=True)


def _take_note(path: Path) -> object:
    note = read_note(path)
    return _describe_holder(note), was_restarted(note)


def _take_record(path: Path) -> object:
    faults = Faults(path.parents[3])
    return [faults.attempt(("estimate", "s", "a")), list(faults.now()), faults.left_out()]


def _made(write_to: Callable[[Path], object], name: str) -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        write_to(path)
        return [path.read_bytes()]


def subjects() -> dict[str, Subject]:
    """Return all that is fuzzed here, by name."""
    sensors = _settings("config/sensors/*.yaml")
    requirements = _settings("config/requirements/*.yaml")
    bias = {
        "sensor": "s", "recording": "a", "channel": "gyro_x", "value": 1e-4, "unit": "rad/s"
    }  # fmt: skip
    channel = AnalysedChannel(
        mean=0.0, density=(1e-3, None), unit="rad/s", rate=100.0, grid=9, segments=((0, 9),),
        present=9, used=9, knocks=0, repeated=0,
    )  # fmt: skip
    quality = Quality(*typed(RecordingRow, [{"sensor": "s"}]), [], {"gyro_x": channel})
    now = datetime(2026, 1, 1, tzinfo=UTC)
    state = State(finished=now, recordings={"s/a": ("ab12", None)}, skipped={"s/b": now})
    record = {"attempt": 1, "failed": True, "log": "l", **asdict(_FAILURE)}
    note = {"process": 1, "host": "h", "since": now.isoformat(), "snakemake": 2, "boot": 1.0}
    held = [json.dumps(one, indent=1).encode() for one in (record, note, {"index.html": "ab"})]
    return {
        "yaml": Subject("a.yaml", read_yaml, [*_NOTES, *sensors[:3], b"a: &a [1]\nb: *a\n"]),
        "sensor": Subject("s.yaml", partial(_take_model, Sensor), sensors),
        "notes": Subject("a.yaml", _take_notes, _NOTES),
        "requirement": Subject("r.yaml", partial(_take_model, Requirement), requirements),
        "run": Subject("config.yaml", _take_run, _settings("config/config.yaml")),
        "simulated": Subject("s.yaml", _take_simulated, _SIMULATED),
        "model": Subject("m.yaml", read_model_file, _MODELS),
        "unit": Subject("unit", _take_unit, _UNITS),
        "table": Subject(
            "fixed_bias.parquet",
            _take_table,
            _made(lambda path: write("fixed_bias", [bias], path), "fixed_bias.parquet"),
            (TableError,),
        ),
        "quality": Subject(
            "quality.json",
            _take_quality,
            _made(quality.write, "quality.json"),
            (RecordingError,),
        ),
        "state": Subject("state.json", read_state, _made(state.write, "state.json"), (StateError,)),
        "record": Subject("faults/recordings/s/estimate.json", _take_record, held[:1], ()),
        "note": Subject("lock", _take_note, held[1:2], ()),
        "pages": Subject("pages.json", _read_keys, held[2:], ()),
    }  # fmt: skip


class WrongError(Exception):
    """Something was refused as nothing should be."""


def _check(error: Exception, name: str, size: int) -> None:
    said = str(error)
    if name not in said:
        raise WrongError(f"the file is not named: {said[:300]}") from error
    if (
        len(said) < 10
        or len(said) > _LONGEST_MESSAGE
        or any(len(x) > 3000 for x in said.split("\n"))
    ):
        raise WrongError(f"{len(said)} letters of {size}: {said[:300]}") from error


def tried(subject: Subject, data: bytes, folder: Path) -> str:
    """Take an input; return how it was refused, or nothing.

    Raises
    ------
    Exception
        Whatever is none of the refusals, or is refused in the wrong way.
    """
    path = folder / subject.name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    begin = time.process_time()
    refused = ""
    try:
        subject.take(path)
    except subject.refusals as error:
        _check(error, path.name, len(data))
        refused = type(error).__name__
    if (took := time.process_time() - begin) > _LONGEST_S:
        raise WrongError(f"took {took:.1f} s")
    return refused


def changed(subject: Subject, rng: random.Random) -> bytes:
    """Return a seed with changes."""
    data = rng.choice(subject.seeds)
    if rng.random() < 0.6:
        place = rng.randrange(len(data) + 1)
        end = place + rng.choice((0, 0, 1, 4, 16))
        data = data[:place] + rng.choice(_WORDS) * rng.choice((1, 1, 1, 3, 50)) + data[end:]
        if rng.random() < 0.6:
            return data
    return mutated(data, subject.seeds, rng)


def fuzz(
    name: str, seconds: float, rng: random.Random, failures: Path, most: int | None = None
) -> tuple[Counter[str], Counter[str]]:
    """Take changed inputs for some time; return how they were refused, and what failed.

    An input that something fails with is kept in the folder ``failures``, and one that ends the
    process, or takes longer than a minute, stands there as ``current``.
    """
    subject = subjects()[name]
    outcomes, failed = Counter[str](), Counter[str]()
    failures.mkdir(parents=True, exist_ok=True)
    kept = sorted((SEEDS / name).glob("*"))
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="imubench.fuzz.") as place:
        while time.monotonic() < end and (most is None or outcomes.total() < most):
            data = kept.pop().read_bytes() if kept else changed(subject, rng)
            (failures / "current").write_bytes(data)
            faulthandler.dump_traceback_later(60.0, exit=True)
            try:
                outcomes[tried(subject, data, Path(place)) or "taken"] += 1
            except Exception as error:
                outcomes["failed"] += 1
                trace = traceback.extract_tb(error.__traceback__)
                ours = [one for one in trace if "imubench_pipeline" in one.filename] or trace
                kind = f"{type(error).__name__} at {Path(ours[-1].filename).name}:{ours[-1].lineno}"
                if not failed[kind]:
                    (failures / f"{name}_{len(failed)}").write_bytes(data)
                    print(f"{name}: {kind}: {str(error)[:300]}", flush=True)
                failed[kind] += 1
            faulthandler.cancel_dump_traceback_later()
    return outcomes, failed


def main() -> int:
    """Fuzz each subject, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    names = list(subjects())
    parser.add_argument("--subject", choices=[*names, "all"], default="all")
    parser.add_argument("--minutes", type=float, default=10.0, help="of all together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--failures", type=Path, default=Path(tempfile.gettempdir()) / "imubench-fuzz-declared"
    )
    given = parser.parse_args()
    warnings.simplefilter("error")
    chosen = names if given.subject == "all" else [given.subject]
    for subject in subjects().values():  # what is imported and compiled is not counted
        with tempfile.TemporaryDirectory() as place:
            tried(subject, subject.seeds[0], Path(place))
    limit_memory(_MOST_MIB << 20)
    bad = 0
    for name in chosen:
        seconds = 60.0 * given.minutes / len(chosen)
        outcomes, failed = fuzz(name, seconds, random.Random(given.seed), given.failures)
        bad += failed.total()
        told = ", ".join(f"{count} {kind}" for kind, count in outcomes.most_common())
        print(f"{name:12}{outcomes.total():8} inputs: {told}", flush=True)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())

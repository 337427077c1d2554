"""Reports whose numbers are known beforehand, made of noise models and without a run.

Of two sensors that are compared, `alpha` has a datasheet, a rejected recording, and one that is
simulated. `beta` has no accelerometer and no datasheet, but a device that was recorded five times
and has changed in the last. Of `gamma` there is a rejected recording alone.
"""

import functools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pyarrow as pa

from imubench_pipeline.datasheets.catalogue import list_catalogue
from imubench_pipeline.datasheets.comparable import read_comparables
from imubench_pipeline.datasheets.coverage import by_vendor, coverage
from imubench_pipeline.datasheets.deltas import bias_deltas, curve_rms, deltas
from imubench_pipeline.estimators.curve_bias import compute_curve_figures, make_averaging_times
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.fusion.fusion import NEEDED, yield_fusion_rows
from imubench_pipeline.model.estimates import FixedBiasRow, ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.drift import drift_rows
from imubench_pipeline.navigation.expected_errors import (
    list_error_rows,
    list_growth_rows,
    list_requirement_questions,
    list_standard_questions,
)
from imubench_pipeline.navigation.pooled import list_pooled_rows
from imubench_pipeline.navigation.ratios import ComparedChannel, list_deviation_rows
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng, simulate
from imubench_pipeline.recordings.overview import overview
from imubench_pipeline.recordings.recording import LogWriter
from imubench_pipeline.report import publish as publishing
from imubench_pipeline.report.publish import make_site, publish
from imubench_pipeline.report.site import Site
from imubench_pipeline.settings.config import FusionSettings, Run
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import Sensor, quantity_of
from imubench_pipeline.tables.files import build, write
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES
from tests.ranking import ranking_rows
from tests.report.tables import SCORES
from tests.rows import typed

Rows = dict[str, list[Mapping[str, Any]]]

DEGREE = math.pi / 180
GRAVITY = 9.80665
TRUTH = {
    "gyro": {"N": 0.3 * DEGREE / 60, "B": 10 * DEGREE / 3600, "T_B": 100.0,
             "K": 5 * DEGREE / 3600 / 60},
    "accel": {"N": 60e-6 * GRAVITY, "B": 30e-6 * GRAVITY, "T_B": 60.0, "K": 100e-6 * GRAVITY / 60},
}  # fmt: skip
BIAS = {"gyro": 0.2 * DEGREE, "accel": GRAVITY}
RATE, SAMPLES = 10.0, 9000
BUDGET = {"draws": 20, "seed": 1}
TAU = np.geomspace(0.1, 400.0, 30)
METHODS = ("likelihood", "likelihood_gm", "curve", "paper", "weighted")
TITLE = "Bench <1> & more"
REASON = "line 7: found '<b>nan</b>', expected a number"
STEP = (300.0, 420.0)
"""Where a finding says that the sensor was moved, s."""

SENSORS = {
    name: Sensor.model_validate(
        {"vendor": vendor, "model": model, "price_class": price, "datasheet": sheet}
        | {"log": {"rate": "10 Hz", "channels": {"gyro_x": {"column": "x", "unit": "rad/s"}}}}
    )
    for name, vendor, model, price, sheet in (
        ("alpha", "Vendor & Sons", "A-1", "consumer", {
            "document": "A-1 data", "source": "primary",
            "gyro": {"noise_density": {"value": 0.007, "unit": "deg/s/sqrt(Hz)"},
                     "bias_instability": {"value": 8, "unit": "deg/h", "kind": "max"},
                     "offset": {"value": 1, "unit": "deg/s"}, "correlation_time": None},
            "accel": {"noise_density": {"value": 60, "unit": "ug/sqrt(Hz)",
                                        "sidedness": "two-sided"}, "bias_instability": None},
        }),
        ("beta", "Other", "B", None, {}),
        ("gamma", "Other", "C", None, {}),
    )
}  # fmt: skip
REQUIREMENTS = {
    "rover": Requirement.model_validate(
        {"title": "Rover", "static_window": "60 s",
         "limits": [{"error": "heading", "after": "60 s", "at_most": "1 deg"},
                    {"error": "velocity", "after": "10 s", "at_most": "0.5 m/s"}]}
    ),
    "wheels": Requirement.model_validate(
        {"title": "Wheels & heading", "static_window": "30 s", "axis": "median",
         "limits": [{"error": "heading", "after": "120 s", "at_most": "0.6 deg"}]}
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Log:
    """One recording: its noise is that of `TRUTH`, times its level."""

    sensor: str
    recording: str
    device: str = ""
    started: str | None = None
    channels: Sequence[str] = ("gyro_x", "accel_x")
    level: float = 1.0
    simulated: bool = False
    warm: bool = False
    methods: Sequence[str] = METHODS
    best: Mapping[str, str] = field(default_factory=dict)
    """The method to use, where it is not the likelihood."""
    odd: Mapping[tuple[str, str], Parameter] = field(default_factory=dict)
    """Parameters of a channel that have no plain value."""
    findings: Sequence[Finding] = ()

    def key(self, channel: str) -> Key:
        return Key(self.sensor, self.recording, channel)

    def parameters(self, channel: str) -> dict[str, Parameter]:
        truth = TRUTH[quantity_of(channel)]
        sizes = {name: v * (1.0 if name == "T_B" else self.level) for name, v in truth.items()}
        known = {name: Parameter(v, lower=0.9 * v, upper=1.13 * v) for name, v in sizes.items()}
        odd = {name: one for (of, name), one in self.odd.items() if of == channel}
        return known | odd

    def estimates(self, channel: str) -> list[Estimate]:
        """Those of the other methods are a few per cent beside the likelihood."""
        found = []
        for place, method in enumerate(self.methods):
            parameters = self.parameters(channel)
            for name, one in parameters.items():
                if one.value is not None and place:
                    parameters[name] = replace(one, value=one.value * (1.0 + 0.02 * place))
            found.append(Estimate(method, parameters, curve=_curve_of(parameters)))
        return found

    def recommended(self, channel: str) -> Estimate:
        method = self.best.get(channel, "likelihood")
        return next(one for one in self.estimates(channel) if one.method == method)


def _curve_of(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return the figures of the curve, with limits as wide as those of B."""
    found = compute_curve_figures(
        Estimate("", parameters).model, make_averaging_times(10.0, 36_000.0)
    )
    known = {
        name: replace(one, lower=0.9 * one.value, upper=1.13 * one.value)
        for name, one in found.items()
        if one.value is not None
    }
    return found | known


NIGHT = Log(
    "alpha",
    "night 1 (+20 C)",
    started="2026-03-01T20:00:00",
    channels=("gyro_x", "gyro_y", "accel_x"),
    warm=True,
    best={"gyro_y": "likelihood_gm"},
    odd={
        ("gyro_y", "K"): Parameter(None, "absent", "the data ask for none", 0.0, 1e-7),
        ("accel_x", "T_B"): Parameter(
            None, "not_identified", "too short", 20.0, 500.0, duration_needed=36000.0, fitted=60.0
        ),
    },
    findings=(
        Finding("missing_samples", "warning", "12 samples are missing", 12.0),
        Finding("step", "warning", "gyro_x was moved", 14.0, "gyro_x", *STEP),
        Finding("lines", "note", "a line at 2 Hz", 1.0, "gyro_x"),
        Finding("short_recording", "note", "the recording lasts 900 s", 900.0),
    ),
)
SIMULATED = Log(
    "alpha",
    "sim_published",
    level=1.1,
    simulated=True,
    # Half of the last digit that is shown, in binary exactly.
    odd={("gyro_x", "T_B"): Parameter(100.25, lower=90.0, upper=113.0)},
)
DEVICE = "unit 7/b"
DATED = tuple(
    Log("beta", f"run_{month}", DEVICE, f"2026-0{month}-15T08:00:00", ("gyro_x",), 3.0 * level)
    for month, level in enumerate((1.0, 1.02, 0.99, 1.01, 3.0), start=1)
)
LOGS = (NIGHT, SIMULATED, *DATED)
CHANGED = DATED[-1].recording
REJECTED = (("alpha", "night 2"), ("gamma", "only"))


def channel_rows(log: Log, channel: str) -> Rows:
    key = asdict(log.key(channel))
    truth = NoiseModel(**{name: v for name, v in TRUTH[quantity_of(channel)].items()})
    adev = log.level * np.sqrt(truth.allan_variance(TAU))
    spread = 1.0 + 0.5 * TAU / TAU[-1]
    best, every = log.recommended(channel), log.estimates(channel)
    frequency = np.geomspace(1e-3, RATE / 2, 50)
    density = log.level**2 * truth.psd(frequency)
    line = 2 * BIAS["gyro"] / 1000
    sheet = SENSORS[log.sensor].datasheet
    means = {channel: BIAS[quantity_of(channel)] * log.level}
    return {
        "allan": [
            key | {"tau": t, "cluster_size": round(t * RATE), "adev": a, "lower": a / s,
                   "upper": a * s, "edf": 9.0, "edf_upper": 9.0,
                     "edf_source": "fitted spectrum", "exponent": 0, "share": 1.0}
            for t, a, s in zip(TAU.tolist(), adev.tolist(), spread.tolist(), strict=True)
        ],
        "parameters": [
            row
            for one in every
            for row in make_parameter_rows(log.key(channel), one, recommended=one.method ==
            best.method)
        ],
        "models": [
            key | {"model": name, "chosen": not place, "free": 4, "log_likelihood": 0.0,
                   "bic": 3.0 * place, "aic": 0.0, "weight": 0.5, "deviance": 1.1,
                   "verdict": "explained", "bins": 50}
            for place, name in enumerate((best.model.name, "N+F"))
        ],
        "lines": [
            key | {"kind": "sinusoid", "frequency": 2.0, "frequency_lower": 1.9,
                   "frequency_upper": 2.1, "amplitude": line, "amplitude_lower": 0.8 * line,
                   "amplitude_upper": 1.2 * line, "ratio": 30.0}
        ] * (channel == "gyro_x" and log.warm),
        "spectrum": [
            key | {"frequency": f, "lower": f, "upper": f, "ordinates": 9.0,
                   "density": d * (1.0 + 0.3 * (-1) ** n), "fitted": d, "used": n % 7 > 0}
            for n, (f, d) in enumerate(zip(frequency.tolist(), density.tolist(), strict=True))
        ],
        "fixed_bias": [key | {"value": means[channel], "unit": "SI"}],
        "reconstruction": [
            key | {"method": one.method, "tau": t, "adev": a, "lower": a / 1.3, "upper": a * 1.3,
                   "reconstructed": a * 1.05}
            for one in every
            for t, a in zip(
                TAU.tolist(), np.sqrt(one.model.allan_variance(TAU)).tolist(), strict=True
            )
        ],
        "scores": [
            key | SCORES | {"method": one.method, "rms_log10": 0.01 * n}
            for n, one in enumerate(every, start=1)
        ],
        "datasheet": [
            *(key | {"method": best.method} | asdict(d)
              for d in deltas(sheet, channel, best, TAU, 0.1)),
            *(key | {"method": "mean"} | asdict(d)
              for d in bias_deltas(sheet, channel, means, 0.1)),
        ],
        "datasheet_curve": [
            key | asdict(one)
            for one in curve_rms(list(read_comparables(sheet, channel)), TAU, adev)
        ],
        "simulated_truth": [
            key | {"parameter": name, "component": 1, "value": log.level * value, "unit": "SI",
                   "assumed": False, "source": "Table 1"}
            for name, value in TRUTH[quantity_of(channel)].items()
        ] * log.simulated,
    }  # fmt: skip


def recording_row(log: Log) -> Mapping[str, Any]:
    return {
        "sensor": log.sensor, "recording": log.recording, "device": log.device or log.recording,
        "kind": "static", "started": log.started, "simulated": log.simulated, "status": "ok",
        "rate": RATE, "rate_from": "stamps", "samples": SAMPLES, "duration": SAMPLES / RATE,
        "temperature_min": 20.0 if log.warm else None,
        "temperature_max": 35.0 if log.warm else None,
    }  # fmt: skip


def rejected_row(sensor: str, recording: str) -> Mapping[str, Any]:
    names = {"sensor": sensor, "recording": recording, "device": recording, "kind": "static"}
    return names | {"simulated": False, "status": "rejected", "reason": REASON}


def rows_of(logs: Sequence[Log], rejected: Sequence[tuple[str, str]] = ()) -> Rows:
    rows: Rows = {name: [] for name in TABLES if name not in OF_ONE_RECORDING}
    for log in logs:
        rows["recordings"].append(recording_row(log))
        rows["findings"] += [one.row(log.sensor, log.recording) for one in log.findings]
        for channel in log.channels:
            for table, found in channel_rows(log, channel).items():
                rows[table] += found
        names = {"sensor": log.sensor, "recording": log.recording}
        questions = [*list_standard_questions([10.0, 60.0], 60.0, 45 * DEGREE, ["worst"])]
        for name, one in REQUIREMENTS.items():
            questions += list_requirement_questions(name, one)
        estimates = {channel: log.recommended(channel) for channel in log.channels}
        rows["error_budget"] += list_error_rows(names, estimates, questions, **BUDGET)
    for sensor, recording in rejected:
        rows["recordings"].append(rejected_row(sensor, recording))
        rows["findings"].append(Finding("rejected", "fatal", REASON, 1.0).row(sensor, recording))
    best = [row for row in rows["parameters"] if row["recommended"]]
    devices = {(row["sensor"], row["recording"]): row["device"] for row in rows["recordings"]}
    estimated, biases = typed(ParameterRow, best), typed(FixedBiasRow, rows["fixed_bias"])
    rows["drift"] = [*drift_rows(estimated, biases, typed(RecordingRow, rows["recordings"]))]
    rows["pooled"] = [*list_pooled_rows(estimated, biases, devices)]
    prices = {name: {"price_class": one.price_class} for name, one in SENSORS.items()}
    errors = build("error_budget", rows["error_budget"]).to_pylist()
    rows["ranking"] = [*ranking_rows(errors, REQUIREMENTS, prices, parameters=best)]
    tables = {name: build(name, rows.get(name, [])) for name in NEEDED}
    rows["fusion"] = [*yield_fusion_rows(tables, FusionSettings(draws=100))]
    covered = coverage(SENSORS)
    rows["catalogue"] = [row.columns() for row in list_catalogue(SENSORS)]
    rows["coverage"] = [row.columns() for row in covered]
    rows["coverage_by_vendor"] = [row.columns() for row in by_vendor(covered)]
    return rows


def write_samples(log: Log, results: Path) -> None:
    """Write the log as a run keeps it, and its envelope and histogram beside it."""
    folder = results / "recordings" / log.sensor / log.recording
    folder.mkdir(parents=True)
    columns = {}
    for channel in log.channels:
        truth = NoiseModel(**TRUTH[quantity_of(channel)])
        stream = channel_rng(1, log.sensor, log.recording, channel)
        noise = simulate(truth, RATE, SAMPLES, stream)
        columns[channel] = BIAS[quantity_of(channel)] + log.level * noise
    holes = {channel: False for channel in columns}
    if log.warm:
        columns["temperature"] = np.linspace(20.0, 35.0, SAMPLES)
    with LogWriter(folder / "log.parquet", {name: pa.float64() for name in columns}) as writer:
        writer.write(columns)
        writer.finish(
            {"rate": RATE, "grid": SAMPLES, "segments": [[0, SAMPLES]], "holes": holes,
             "unusable": [], "reader": "csv", "begins": 0.0,
             "sources": [{"name": "log.csv", "size": 123456, "sha256": "0f" * 32}]}
        )  # fmt: skip
    seen = overview(folder, log.sensor, log.recording)
    write("envelope", seen.envelope, folder / "envelope.parquet")
    write("histogram", seen.histogram, folder / "histogram.parquet")


DRAWN = {"draws": 60, "seed": 1}


def fused(log: Log, channel: str) -> ComparedChannel:
    """Return a channel of a log as it is compared with another."""
    names = (log.sensor, log.recording, channel, log.simulated)
    return ComparedChannel(*names, SAMPLES / RATE, log.recommended(channel))


@functools.cache
def growth_of(log: Log) -> list[Mapping[str, Any]]:
    names = {"sensor": log.sensor, "recording": log.recording}
    if log in DATED[1:]:  # nobody asks for theirs
        return [row | names for row in growth_of(DATED[0])]
    estimates = {channel: log.recommended(channel) for channel in log.channels}
    return [*list_growth_rows(names, estimates, times=[10.0, 60.0], window=60.0, **BUDGET)]


def write_compared(log: Log, folder: Path) -> None:
    """Write what a comparison of any two logs needs of this one."""
    write("error_growth", growth_of(log), folder / "error_growth.parquet")
    deviations = [
        row
        for channel in log.channels
        for row in list_deviation_rows(fused(log, channel), RATE, longest=1 / 9, **DRAWN)
    ]
    write("drawn_deviations", deviations, folder / "drawn_deviations.parquet")


def settings_of(sensors: Mapping[str, Sensor], requirements: Mapping[str, Requirement]) -> str:
    run = Run()
    sections = (
        "allan", "estimate", "reconstruction", "quality", "datasheet", "error_budget", "fusion",
    )  # fmt: skip
    return json.dumps(
        {
            "report": {"title": TITLE, "units": "practical"},
            "results": "results",
            "settings": {name: getattr(run, name).model_dump(mode="json") for name in sections},
            "models": {"drawn": {"draws": 2, "seed": 1}, "sensors": {}},
            "sensors": {
                name: one.model_dump(
                    mode="json", include={"vendor", "model", "price_class", "sold"}
                )
                for name, one in sensors.items()
            },
            "requirements": {
                name: one.model_dump(mode="json") for name, one in requirements.items()
            },
        }
    )


@dataclass(frozen=True)
class Report:
    """A report, and the rows of the tables that it shows."""

    folder: Path
    rows: Rows

    @property
    def pages(self) -> list[str]:
        found = self.folder.rglob("*.html")
        return sorted(path.relative_to(self.folder).as_posix() for path in found)

    def page(self, begin: str) -> str:
        """Return the one page whose path begins so."""
        (path,) = (path for path in self.pages if path.startswith(begin))
        return path

    def of(self, table: str, **values: object) -> list[Mapping[str, Any]]:
        """Return the rows that have these values."""
        return [
            row
            for row in self.rows[table]
            if all(row[name] == value for name, value in values.items())
        ]


def tables_of(rows: Rows) -> dict[str, pa.Table]:
    return {name: build(name, found) for name, found in rows.items()}


def bench(results: Path) -> tuple[Site, Rows]:
    """Return the report of all that can occur, and the rows of its tables."""
    for log in LOGS:
        write_samples(log, results)
        write_compared(log, results / "recordings" / log.sensor / log.recording)
    rows = rows_of(LOGS, REJECTED)
    return make_site(tables_of(rows), settings_of(SENSORS, REQUIREMENTS), results), rows


def single(results: Path) -> Site:
    """Return the report of one recording."""
    log = Log("beta", "alone")
    write_samples(log, results)
    settings = settings_of({"beta": SENSORS["beta"]}, REQUIREMENTS)
    return make_site(tables_of(rows_of([log])), settings, results)


OF_SENSORS = ("ranking", "fusion", "catalogue", "coverage", "coverage_by_vendor", "pooled", "drift")


def many(results: Path, sensors: int, each: int) -> Site:
    """Return the report of many recordings of six channels, copies of one at other levels."""
    channels = [f"{quantity}_{axis}" for quantity in TRUTH for axis in "xyz"]
    methods = ("likelihood", "likelihood_gm")
    one = tables_of(rows_of([Log("alpha", "one", channels=channels, methods=methods)]))
    names = [(f"sensor_{s:02d}", f"run_{r:02d}") for r in range(each) for s in range(sensors)]
    factors = np.exp(0.2 * np.random.default_rng(1).standard_normal(len(names)))
    tables = {
        table: build(table, [])
        if table in OF_SENSORS or not found.num_rows
        else pa.concat_tables(
            [_copy(found, *name, f) for name, f in zip(names, factors, strict=True)]
        )
        for table, found in one.items()
    }
    catalogue = {
        f"sensor_{s:02d}": SENSORS["alpha"].model_copy(update={"model": f"model {s:02d}"})
        for s in range(sensors)
    }
    return make_site(tables, settings_of(catalogue, {}), results)


def named(results: Path, names: Sequence[str]) -> Site:
    """Return the report of copies of one log: sensors, recordings and devices of these names."""
    log = Log("alpha", "one", channels=("gyro_x",), methods=("likelihood",))
    of_one = rows_of([log])
    tables = {}
    for table, rows in of_one.items():
        found = build(table, rows)
        copies = [_copy(found, name, name, 1.0) for name in names] if rows else [found]
        tables[table] = pa.concat_tables(copies)
    for name in names:
        write_samples(replace(log, sensor=name, recording=name), results)
    return make_site(tables, settings_of({}, REQUIREMENTS), results)


def _copy(table: pa.Table, sensor: str, recording: str, factor: float) -> pa.Table:
    names = {"sensor": sensor, "recording": recording, "device": recording}
    columns: list[pa.ChunkedArray | pa.Array] = []
    for name in table.column_names:
        column = table[name]
        if name in names:
            column = pa.array([names[name]] * table.num_rows, pa.string())
        elif name in ("adev", "lower", "upper", "value") and pa.types.is_floating(column.type):
            column = pa.array(column.to_numpy() * factor, from_pandas=True)
        columns.append(column)
    return pa.Table.from_arrays(columns, schema=table.schema)


def publish_some(site: Site, folder: Path, paths: Sequence[str]) -> None:
    """Write a few pages of a large report, which alone are opened."""
    chosen = [page for page in publishing.list_pages(site) if page.path in paths]
    with mock.patch.object(publishing, "list_pages", lambda _: chosen):
        publish(site, folder)

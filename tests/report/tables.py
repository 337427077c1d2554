"""Small results of a run, as it leaves them: tables, settings, and the files of recordings."""

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.fusion.fusion import yield_fusion_rows
from imubench_pipeline.extensions.papers.papers import make_rows_without_run
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.estimates import BacktestRow, FixedBiasRow, ParameterRow
from imubench_pipeline.model.recordings import DoubtRow, RecordingRow
from imubench_pipeline.navigation.drift import drift_rows
from imubench_pipeline.navigation.expected_errors import (
    list_error_rows,
    list_requirement_questions,
    list_standard_questions,
)
from imubench_pipeline.navigation.pooled import list_pooled_rows
from imubench_pipeline.navigation.selection import rank_sensors
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import judge_sensors
from imubench_pipeline.navigation.verdicts.next_steps import list_next_step_rows
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.recordings.recording import LogWriter
from imubench_pipeline.report.publish import make_site
from imubench_pipeline.report.site import Site
from imubench_pipeline.settings.config import FusionSettings
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.tables.files import build, write, write_arrow
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES

Row = dict[str, Any]
Rows = dict[str, list[Row]]
Tables = dict[str, pa.Table]

DEGREE = math.pi / 180
HOUR = DEGREE / 3600  # of a degree an hour
RATE = 100.0
TAU = np.geomspace(0.01, 1e3, 12)
MODEL = NoiseModel(N=20 * HOUR, B=10 * HOUR, T_B=100.0, K=0.1 * HOUR)
KNOWN = {
    "N": Parameter(MODEL.N, lower=0.9 * MODEL.N, upper=1.1 * MODEL.N),
    "B": Parameter(MODEL.B, lower=0.8 * MODEL.B, upper=1.3 * MODEL.B),
    "T_B": Parameter(MODEL.T_B, lower=80.0, upper=130.0),
    "K": Parameter(MODEL.K, lower=0.5 * MODEL.K, upper=2.0 * MODEL.K),
}
WITHOUT_K = KNOWN | {"K": Parameter(None, "absent", "not there", upper=0.5 * MODEL.K)}
# Fewer draws than a run may have: of the limits no test here asks how sure they are.
FUSION = FusionSettings().model_copy(update={"draws": 20})
ROBOT = {
    "title": "a robot",
    "static_window": "10 s",
    "limits": [
        {"error": "heading", "after": "100 s", "at_most": "1 deg"},
        {"error": "position", "after": "100 s", "at_most": "10 m"},
    ],
}


def recording_rows(
    sensor: str = "imu",
    recording: str = "day1",
    channels: Sequence[str] = ("gyro_x",),
    *,
    parameters: Mapping[str, Parameter] = KNOWN,
    simulated: bool = False,
    printed: bool = True,
    found: Sequence[float] = (),
    findings: Sequence[Row] = (),
    temperature: str | None = None,
    requirements: Mapping[str, Any] | None = None,
    **about: Any,
) -> Rows:
    """What a run finds in one recording; ``temperature``: followed, or why not."""
    names = {"sensor": sensor, "recording": recording}
    row = {"device": recording, "kind": "static", "simulated": simulated, "status": "ok",
           "rate": RATE, "rate_from": "stated", "duration": 7200.0, "samples": 720_000}  # fmt: skip
    rows: Rows = {
        "recordings": [names | row | about],
        "findings": [
            names | {"value": 1.0, "severity": "warning", "detail": "look"} | one
            for one in findings
        ],
    }
    for channel in channels:
        own = _channel_rows(Key(sensor, recording, channel), parameters, simulated, printed, found)
        for table, more in own.items():
            rows.setdefault(table, []).extend(more)
        if temperature is not None:
            for table, more in thermal_rows(Key(sensor, recording, channel), temperature).items():
                rows.setdefault(table, []).extend(more)
    questions = [*list_standard_questions([60.0], 60.0, math.pi / 4, ["worst"])]
    for name, given in (requirements or {}).items():
        questions += list_requirement_questions(name, Requirement.model_validate(given))
    estimates = dict.fromkeys(channels, Estimate("likelihood", parameters))
    rows["error_budget"] = list(list_error_rows(names, estimates, questions, draws=3, seed=1))
    return rows


def _channel_rows(
    key: Key,
    parameters: Mapping[str, Parameter],
    simulated: bool,
    printed: bool,
    found: Sequence[float],
) -> Rows:
    names = {"sensor": key.sensor, "recording": key.recording, "channel": key.channel}
    best, papers = (Estimate(method, parameters) for method in ("likelihood", "likelihood_gm"))
    curve = Estimate("curve", {"N": KNOWN["N"]} | dict.fromkeys(("B", "T_B", "K"), _not_shown()))
    model = best.model
    adev = np.sqrt(model.allan_variance(TAU))
    frequency = np.geomspace(1e-4, RATE / 2, 9)
    density = model.sampled_spectrum(2 * np.pi * frequency / RATE, RATE) / RATE
    method = names | {"method": "likelihood"}
    figure = {"quantity": "N", "statistic": "N", "printed": 0.005, "unit": "deg/s/sqrt(Hz)",
              "kind": "typ", "sidedness": "two-sided", "verdict": "as printed",
              "comparable": 18 * HOUR, "measured": 20 * HOUR, "lower": 18 * HOUR,
              "upper": 22 * HOUR, "delta": 1 / 9, "delta_lower": 0.0,
              "delta_upper": 2 / 9}  # fmt: skip
    unpublished = {"quantity": "K", "statistic": "K", "verdict": "not published"}
    tried = {"free": 4, "log_likelihood": 0.0, "aic": 0.0, "weight": 0.5, "bins": 60}
    judged = {"deviance": 1.03, "chance": 0.4, "verdict": "explained"}
    return {
        "allan": [
            names | {"tau": t, "cluster_size": round(t * RATE), "adev": a, "lower": a / 1.2,
                     "upper": a * 1.2, "edf": 9.0, "edf_upper": 9.0,
                     "edf_source": "fitted spectrum", "exponent": 0, "share": 1.0}
            for t, a in zip(TAU, adev, strict=True)
        ],
        "parameters": [
            row
            for number, estimate in enumerate((best, papers, curve))
            for row in make_parameter_rows(key, estimate, recommended=number == 0)
        ],
        "reconstruction": [
            method | {"tau": t, "adev": a, "lower": a / 2, "upper": a * 2, "reconstructed": a}
            for t, a in zip(TAU, adev, strict=True)
        ],
        "scores": [method | SCORES],
        "datasheet": [method | figure, method | unpublished] * printed,
        "datasheet_curve": [
            names | {"N": 18 * HOUR, "rms": HOUR, "rms_log10": 0.05, "sidedness": "two-sided"},
        ] * printed,
        "spectrum": [
            names | {"frequency": f, "lower": f, "upper": f, "ordinates": 9.0, "density": d,
                     "fitted": d, "used": True}
            for f, d in zip(frequency, density, strict=True)
        ],
        "models": [
            names | tried | judged | {"model": model.name, "chosen": True, "bic": 10.0},
            names | tried | judged | {"model": "N+F", "chosen": False, "bic": 13.5},
        ],
        "lines": [
            names | {"kind": "sinusoid", "frequency": f, "frequency_lower": 0.98 * f,
                     "frequency_upper": 1.02 * f, "amplitude": HOUR, "amplitude_lower": HOUR / 2,
                     "amplitude_upper": 2 * HOUR, "ratio": 30.0, "false_alarm": 1e-6}
            for f in found
        ],
        "deterministic": [
            names | {"kind": "bias_step", "start": 400.0, "end": 400.0, "size": 30 * HOUR,
                     "size_lower": 25 * HOUR, "size_upper": 35 * HOUR, "unit": "rad/s",
                     "place_error": 2.0, "gain": 90.0},
            names | {"kind": "warm_up_drift", "start": 0.0, "end": 7200.0, "size": 40 * HOUR,
                     "size_lower": 25 * HOUR, "size_upper": 55 * HOUR, "unit": "rad/s",
                     "time": 613.0, "time_lower": 500.0, "time_upper": 700.0, "gain": 60.0},
        ],
        "fixed_bias": [names | {"value": 5 * HOUR, "unit": "rad/s"}],
        "simulated_truth": [
            names | {"parameter": "N", "component": 1, "value": MODEL.N, "unit": "rad/s/sqrt(Hz)",
                     "assumed": True, "source": "a table"},
        ] * simulated,
    }  # fmt: skip


def thermal_rows(key: Key, temperature: str) -> Rows:
    """What is found of temperature, which is ``followed`` or not, and of a low-pass."""
    names = {"sensor": key.sensor, "recording": key.recording, "channel": key.channel}
    followed = temperature == "followed"
    s = 90 * HOUR
    figures = {
        "T_0": (22.5, None, None, "degC", "ok", None),
        "sensitivity": (s, 0.9 * s, 1.1 * s, "rad/s/K", "ok", temperature),
        "quadratic": (None, None, None, "rad/s/K^2", "absent", "not asked for"),
        "lag": (None, 0.0, 60.0, "s", "not_identified", "it may be 0"),
        "bias": (5 * HOUR, 4 * HOUR, 6 * HOUR, "rad/s", "ok", None),
    }
    cutoff = {"cutoff": (64.0, 63.0, 65.0, "Hz", "ok", None)}
    sensor = {"N_sensor": Parameter(14 * HOUR, lower=13 * HOUR, upper=15 * HOUR)}
    columns = ("value", "lower", "upper", "unit", "status", "reason")

    def of(about: Row, given: Mapping[str, tuple[Any, ...]]) -> list[Row]:
        return [
            names | about | {"parameter": name} | dict(zip(columns, one, strict=True))
            for name, one in given.items()
        ]

    adev = np.sqrt(MODEL.allan_variance(TAU))
    left = [
        names
        | {
            "tau": t,
            "adev": a / 2,
            "lower": a / 2.4,
            "upper": a / 1.6,
            "edf_source": "fitted spectrum",
            "temperature": a * math.sqrt(0.75),
        }
        for t, a in zip(TAU, adev, strict=True)
    ]
    half = {
        name: Parameter(
            one.value if name == "T_B" else one.value / 2, lower=one.lower, upper=one.upper
        )
        for name, one in KNOWN.items()
        if one.value is not None
    }
    best = make_parameter_rows(key, Estimate("compensated", half), recommended=False)
    before = make_parameter_rows(key, Estimate("likelihood", sensor), recommended=True)
    return {
        "parameters": [*list(best) * followed, *before],
        "temperature": of({"compensated": followed}, figures),
        "allan_compensated": left * followed,
        "low_pass": of({"order": 1}, cutoff),
    }


SCORES = {
    "rms": 1e-5, "rms_log10": 0.05, "drawn": 2e-5, "drawn_lower": 1e-5, "drawn_upper": 4e-5,
    "drawn_log10": 0.08, "drawn_log10_lower": 0.04, "drawn_log10_upper": 0.2, "whole": 3e-5,
    "whole_lower": 1e-5, "whole_upper": 9e-5, "inside_band": 0.98,
}  # fmt: skip
"""Of one model, in SI and in decades."""


def _not_shown() -> Parameter:
    return Parameter(None, "not_shown", "the curve does not rise")


def rejected_rows(
    sensor: str = "imu", recording: str = "bad", reason: str = "line 3: found 'x'", **about: Any
) -> Rows:
    """What a run leaves of a recording that cannot be used."""
    names = {"sensor": sensor, "recording": recording}
    row = {"device": recording, "kind": "static", "simulated": False, "status": "rejected"}
    finding = {"finding": "rejected", "severity": "fatal", "detail": reason, "value": 1.0}
    return {
        "recordings": [names | row | {"reason": reason} | about],
        "findings": [names | finding],
    }


def coverage_rows(*sensors: str) -> Rows:
    """Who publishes what: of each sensor N and no K."""
    return {
        "coverage": [
            {"sensor": sensor, "vendor": "V & Co", "model": sensor, "quantity": "gyro",
             "figure": figure, "published": published, "as_printed": printed}
            for sensor in sensors
            for figure, published, printed in (("N", "yes", "5 m°/s/√Hz"), ("K", "no", None))
        ],
        "catalogue": [
            {"sensor": sensor, "vendor": "V & Co", "model": sensor, "quantity": "gyro",
             "figure": "random_walk", "state": "published", "value": 0.3, "unit": "°/√h",
             "value_si": 0.005 * DEGREE, "kind": "typ", "as_printed": "0.3 °/√h"}
            for sensor in sensors
        ],
    }  # fmt: skip


@cache
def without_rows(table: str) -> pa.Table:
    return build(table, [])


def tables_of(*several: Rows) -> Tables:
    """The tables of these rows; most have none, and are the same ones each time."""
    rows = {name: [row for one in several for row in one.get(name, [])] for name in TABLES}
    return {name: build(name, own) if own else without_rows(name) for name, own in rows.items()}


def joined(
    *several: Rows, requirements: Mapping[str, Any] | None = None, papers: bool = False
) -> Tables:
    """The tables of a run: the rows of its recordings, and what it makes of them together."""
    made = tables_of(*several)
    recommended = [row for row in ParameterRow.rows_of(made["parameters"]) if row.recommended]
    biases = FixedBiasRow.rows_of(made["fixed_bias"])
    about = RecordingRow.rows_of(made["recordings"])
    devices = {(row.sensor, row.recording): row.device for row in about}
    asked = {n: Requirement.model_validate(one) for n, one in (requirements or {}).items()}
    sensors = {row.sensor: {"price_class": None} for row in about}
    shown = BacktestRow.rows_of(made["backtest"])
    basis = Basis.of(about, DoubtRow.rows_of(made["doubts"]), recommended, shown)
    errors = ErrorBudgetRow.rows_of(made["error_budget"])
    judged = list(judge_sensors(errors, asked, sensors, basis))
    return made | {
        "pooled": build("pooled", list_pooled_rows(recommended, biases, devices)),
        "drift": build("drift", drift_rows(recommended, biases, about)),
        "ranking": build("ranking", rank_sensors(judged, basis)),
        "next_steps": build("next_steps", list_next_step_rows(judged, basis)),
        "fusion": build("fusion", yield_fusion_rows(made, FUSION)),
        "published": build("published", make_rows_without_run() if papers else ()),
    }


def settings_of(
    tables: Mapping[str, pa.Table],
    *,
    requirements: Mapping[str, Any] | None = None,
    boards: Mapping[str, Any] | None = None,
    units: str = "practical",
    title: str = "A title",
    given: Sequence[str] = (),
    named: str = "results",
    not_sold: Sequence[str] = (),
) -> str:
    """What a plan says of the report; ``named``: the folder of the results."""
    sensors = dict.fromkeys(tables["recordings"]["sensor"].to_pylist())
    return json.dumps(
        {
            "report": {"title": title, "units": units},
            "results": named,
            "given": list(given),
            "settings": {
                "allan": {"overlap": "octave"},
                "error_budget": {"static_window": "60 s", "latitude": "45 deg"},
                "fusion": FUSION.model_dump(mode="json"),
            },
            "sensors": {
                name: {
                    "vendor": "V & Co",
                    "model": name,
                    "price_class": "cheap",
                    "sold": name not in not_sold,
                }
                for name in sensors
            },
            "boards": boards or {},
            "requirements": {
                name: Requirement.model_validate(one).model_dump(mode="json")
                for name, one in (requirements or {}).items()
            },
        },
        sort_keys=True,
    )


def site(tables: Mapping[str, pa.Table], results: Path = Path("nowhere"), **given: Any) -> Site:
    """The site of tables."""
    return make_site(tables, settings_of(tables, **given), results)


def put_samples(results: Path, sensor: str, recording: str, channel: str = "gyro_x") -> None:
    """Write what the samples of a channel look like, as the ingest does."""
    folder = results / "recordings" / sensor / recording
    names = {"sensor": sensor, "recording": recording, "channel": channel}
    envelope = [
        names | {"start": 18.0 * i, "end": 18.0 * (i + 1), "samples": 1800 if i != 2 else 0}
        | ({"low": -1e-3, "high": 1e-3 + 1e-5 * i, "mean": 1e-6 * i} if i != 2 else {})
        for i in range(400)
    ]  # fmt: skip
    histogram = [
        names | {"lower": 1e-5 * i, "upper": 1e-5 * (i + 1), "count": 7 * i} for i in range(-50, 50)
    ]
    counted = [row | {"count": abs(row["count"])} for row in histogram]
    write("envelope", envelope, folder / "envelope.parquet")
    write("histogram", counted, folder / "histogram.parquet")


def put_log(results: Path, sensor: str, recording: str, **about: Any) -> None:
    """Write a log as the ingest keeps it, of which the report reads the metadata alone."""
    folder = results / "recordings" / sensor / recording
    folder.mkdir(parents=True, exist_ok=True)
    with LogWriter(folder / "log.parquet", {"gyro_x": pa.float64()}) as log:
        log.write({"gyro_x": np.zeros(3)})
        log.finish({"rate": 1.0, "grid": 3, "segments": [[0, 3]], "holes": {}} | about)


def put_tables(tables: Mapping[str, pa.Table], results: Path) -> None:
    """Write the joined tables, as the workflow does."""
    for name in set(TABLES) - set(OF_ONE_RECORDING):
        write_arrow(tables[name], results / f"tables/{name}.parquet")

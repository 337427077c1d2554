"""What a run leaves of one recording: library objects to rows of the tables, and back."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.backtest import verdicts
from imubench_pipeline.drift import drift_rows
from imubench_pipeline.estimators.estimate import (
    CURVE,
    FAMILY,
    SI_UNITS,
    Estimate,
    JointDraws,
    Parameter,
    Status,
)
from imubench_pipeline.failures import read_with_failures, with_failures, without
from imubench_pipeline.faults import Failure
from imubench_pipeline.fitness import (
    doubts,
    judged,
    left_out,
    undecided,
    with_doubts,
    with_doubts_of_all,
)
from imubench_pipeline.pooled import pooled_rows
from imubench_pipeline.published import published_rows, truth_rows
from imubench_pipeline.quality.plausibility import implausible
from imubench_pipeline.quality.rotation import GravityTurn
from imubench_pipeline.quality.spectral import band_finding, line_findings
from imubench_pipeline.quality.twins import recorded_twice
from imubench_pipeline.sensor import Sensor, quantity_of
from imubench_pipeline.suspicion import unusual_rows
from imubench_pipeline.tables import build, read

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Key:
    """What names a channel in every table."""

    sensor: str
    recording: str
    channel: str


@dataclass(frozen=True)
class Quality:
    """``quality.json``: what the ingest found, and the channels that go on.

    With the digest of the samples that were kept, the file is another one whenever they are: what
    stands on them is made again, even if the run that read them was stopped in between.
    """

    recording: dict[str, Any]
    findings: list[dict[str, Any]]
    channels: dict[str, dict[str, Any]]
    samples: str | None
    failure: dict[str, Any] | None = None
    """Why the ingest failed (`imubench_pipeline.failures.Failure`)."""
    gravity: dict[str, Any] | None = None
    """How gravity turns against the sensor (`imubench_pipeline.quality.rotation.GravityTurn`)."""

    @classmethod
    def read(cls, path: Path) -> Quality:
        """Read the file that `ingest` wrote."""
        return cls(**json.loads(path.read_text(encoding="utf-8")))

    def implausible(self, sensor: Sensor | None) -> list[dict[str, Any]]:
        """Return the rows of findings on what can be of no sensor at rest in its unit.

        Parameters
        ----------
        sensor : Sensor or None
            What the file of the sensor says; None: there is none.
        """
        about = self.recording
        turn = GravityTurn(**self.gravity) if self.gravity else None
        static = about.get("kind", "static") == "static"
        found = implausible(self.channels, turn, sensor, static=static)
        return [dict(finding.row(about["sensor"], about["recording"])) for finding in found]


def allan_rows(key: Key, curve: AllanCurve) -> Iterator[Row]:
    """Yield the rows of the table ``allan``."""
    for i, about in enumerate(limit_rows(curve)):
        yield (
            asdict(key)
            | about
            | {
                "cluster_size": int(curve.cluster_size[i]),
                "averaged": float(curve.averaged[i]),
                "exponent": int(curve.exponent[i]),
                "share": float(curve.share[i]),
            }
        )


def limit_rows(curve: AllanCurve) -> Iterator[dict[str, Any]]:
    """Yield what every table of a measured curve says at each tau."""
    lower, upper = curve.limits(0.95)
    for i, tau in enumerate(curve.tau):
        yield {
            "tau": float(tau),
            "adev": float(curve.deviation[i]),
            "lower": float(lower[i]),
            "upper": float(upper[i]),
            "edf": float(curve.edf[i]),
            "edf_upper": float(curve.edf_upper[i]),
            "edf_source": curve.edf_source[i],
        }


def curves(path: Path, quality: Quality) -> dict[str, AllanCurve]:
    """Read the curves of a recording from its table ``allan`` or the first of it, by channel."""
    by_channel = _by(read("allan", [path]), "channel")
    return {
        channel: AllanCurve(
            tau=table["tau"].to_numpy(),
            cluster_size=table["cluster_size"].to_numpy(),
            variance=table["adev"].to_numpy() ** 2,
            samples=int(quality.channels[channel]["grid"]),
            exponent=table["exponent"].to_numpy(),
            averaged=table["averaged"].to_numpy(),
            share=table["share"].to_numpy(),
            **degrees_of(table),
        )
        for (channel,), table in by_channel.items()
    }


def degrees_of(table: pa.Table) -> dict[str, Any]:
    """Return the degrees of freedom of a curve from the columns of its table."""
    return {
        "edf": table["edf"].to_numpy(),
        "edf_upper": table["edf_upper"].to_numpy(),
        "edf_source": tuple(table["edf_source"].to_pylist()),
    }


def compensated_curves(path: Path, measured: Mapping[str, AllanCurve]) -> dict[str, AllanCurve]:
    """Read the table ``allan_compensated`` of a recording, by channel.

    Parameters
    ----------
    path : Path
    measured : mapping of str to AllanCurve
        Of the log as it is, with the same clusters.
    """
    by_channel = _by(read("allan_compensated", [path]), "channel")
    return {
        channel: replace(
            measured[channel], variance=table["adev"].to_numpy() ** 2, **degrees_of(table)
        )
        for (channel,), table in by_channel.items()
    }


def parameter_rows(key: Key, estimate: Estimate, *, recommended: bool) -> Iterator[Row]:
    """Yield the rows of the table ``parameters``."""
    units = SI_UNITS[quantity_of(key.channel)]
    for component, name, parameter in estimate.components():
        yield asdict(key) | {
            "method": estimate.method,
            "recommended": recommended,
            "model": estimate.model.name,
            "component": component,
            "parameter": name,
            "unit": units[name],
            **asdict(parameter),
        }


def draw_rows(key: Key, estimate: Estimate) -> Iterator[Row]:
    """Yield the rows of the table ``draws``; none of an estimate that has no joint draws."""
    if estimate.draws is None:
        return
    for number, (first, further) in enumerate(
        zip(estimate.draws.first.tolist(), estimate.draws.further.tolist(), strict=True)
    ):
        about = asdict(key) | {"method": estimate.method, "draw": number}
        there = {name: value for name, value in zip(FAMILY, first, strict=True) if value}
        yield about | {"component": 1} | there
        for component, (B, T_B) in enumerate(further, start=2):
            if B:
                yield about | {"component": component, "B": B, "T_B": T_B}


def draws(path: Path) -> dict[tuple[str, str], JointDraws]:
    """Read the table ``draws`` of a recording, by channel and method."""
    found = {}
    for (channel, method), table in _by(read("draws", [path]), "channel", "method").items():
        columns = {name: table[name].to_numpy().astype(np.float64) for name in FAMILY}
        draw, component = table["draw"].to_numpy(), table["component"].to_numpy()
        count = int(draw.max()) + 1
        first = np.zeros((count, len(FAMILY)))
        further = np.tile([0.0, np.nan], (count, int(component.max()) - 1, 1))
        for place, name in enumerate(FAMILY):
            own = component == 1
            values = columns[name][own]
            first[draw[own], place] = values if name == "T_B" else np.nan_to_num(values)
        for number in range(further.shape[1]):
            own = component == number + 2
            further[draw[own], number] = np.column_stack((columns["B"][own], columns["T_B"][own]))
        found[str(channel), str(method)] = JointDraws(first, further)
    return found


def estimates(path: Path, joint: Path | None = None) -> dict[str, list[Estimate]]:
    """Read the estimates of a recording from its table ``parameters``, by channel.

    Parameters
    ----------
    path : Path
    joint : Path, optional
        Of its table ``draws``; without it no estimate has joint draws.
    """
    return _estimates(read("parameters", [path]), joint)


def recommended_estimates(path: Path, joint: Path | None = None) -> dict[str, Estimate]:
    """Read the recommended estimate of each channel (see `estimates`)."""
    table = read("parameters", [path])
    found = _estimates(table.filter(table["recommended"]), joint)
    return {channel: by_method[0] for channel, by_method in found.items()}


def _estimates(table: pa.Table, joint: Path | None) -> dict[str, list[Estimate]]:
    drawn = draws(joint) if joint is not None else {}
    found: dict[str, list[Estimate]] = {}
    for (channel, method), rows in _by(table, "channel", "method").items():
        estimate = estimate_of(method, rows.to_pylist())
        estimate = replace(estimate, draws=drawn.get((channel, method)))
        found.setdefault(channel, []).append(estimate)
    return found


def estimate_of(method: str, rows: Iterable[Row]) -> Estimate:
    """Return the estimate that rows of the table ``parameters`` stand for."""
    components: dict[int, dict[str, Parameter]] = {}
    lines: dict[int, dict[str, Parameter]] = {}
    of_curve: dict[str, Parameter] = {}
    for row in rows:
        name = row["parameter"]
        group = lines if name in ("amplitude", "frequency") else components
        place = of_curve if name in CURVE else group.setdefault(row["component"], {})
        place[name] = Parameter(
            row["value"],
            cast(Status, row["status"]),
            row["reason"],
            row["lower"],
            row["upper"],
            row["duration_needed"],
            row["fitted"],
        )
    first = components.pop(1, {})
    return Estimate(method, first, list(components.values()), list(lines.values()), of_curve)


def _by(table: pa.Table, *names: str) -> dict[tuple[str, ...], pa.Table]:
    """Divide a table by the values of columns, in the order in which they appear."""
    keys = list(zip(*(table[name].to_pylist() for name in names), strict=True))
    order = dict.fromkeys(keys)
    labels = {key: i for i, key in enumerate(order)}
    which = np.array([labels[key] for key in keys], dtype=np.int64)
    return {key: table.filter(pa.array(which == label)) for key, label in labels.items()}


def joined_tables(
    parts: Mapping[str, list[Path]], truths: str, catalogue: str, decide: str = "{}"
) -> dict[str, pa.Table]:
    """Join the results of the recordings of a sensor.

    Parameters
    ----------
    parts : mapping of str to list of Path
        Files of each table, in the order of the recordings; ``quality`` for the JSON files.
    truths : str
        Those that are simulated, as the plan wrote them.
    catalogue : str
        The sensor files, likewise.
    decide : str
        The section of the configuration that says which recordings decide, as JSON.

    Returns
    -------
    dict
        Every table of recordings.
    """
    qualities = [Quality.read(path) for path in parts["quality"]]
    told = [Failure(**quality.failure) for quality in qualities if quality.failure]
    joined = {}
    for name, paths in parts.items():
        if name != "quality":
            joined[name], failed = read_with_failures(name, paths)
            told += failed
    failures = list(dict.fromkeys(told))
    joined = without(joined, {(one.sensor, one.recording) for one in failures})
    about = [quality.recording for quality in qualities]
    devices = {(row["sensor"], row["recording"]): row["device"] for row in about}
    recommended = joined["parameters"].filter(joined["parameters"]["recommended"])
    estimated, biases = recommended.to_pylist(), joined["fixed_bias"].to_pylist()
    joined["drift"] = build("drift", drift_rows(estimated, biases, about))
    of_logs = without_doubles(
        (row for quality in qualities for row in quality.findings),
        joined["deterministic"],
        {(row["sensor"], row["recording"]): row.get("duration") or 0.0 for row in about},
    )
    sensors = sensors_of(catalogue)
    of_levels = (
        row
        for quality in qualities
        for row in quality.implausible(sensors.get(quality.recording["sensor"]))
    )
    unusual = unusual_rows(estimated, sensors)
    of_estimates = joined.pop("estimate_findings").to_pylist()
    twins = recorded_twice(joined["models"].to_pylist(), biases)
    found = [*of_logs, *of_levels, *of_estimates, *spectral_rows(joined), *unusual, *twins]
    if "backtest" in joined:
        found += verdicts.findings(joined["backtest"].to_pylist())
    joined["findings"] = build("findings", found)
    doubted = list(doubts(joined["findings"].to_pylist(), estimated, joined["models"].to_pylist()))
    about = judged(about, doubted, json.loads(decide).get("include", ()))
    joined["recordings"] = build("recordings", about)
    joined["doubts"] = build("doubts", (one.row() for one in doubted))
    apart = left_out(about)
    pools = pooled_rows(undecided(estimated, apart), undecided(biases, apart), devices)
    joined["pooled"] = build("pooled", with_doubts_of_all(pools, about))
    for name in _JUDGED & joined.keys():
        joined[name] = build(name, with_doubts(joined[name].to_pylist(), about))
    truth = list(truth_rows(truths))
    joined["simulated_truth"] = build("simulated_truth", truth)
    joined["published"] = build("published", published_rows(truths, truth, joined))
    return with_failures(joined, failures)


_JUDGED = {"error_budget", "datasheet"}
"""Tables of a recording's own step whose rows say what is doubted of the recording."""

_OF_LOGS = {"step": "bias_step", "warm_up": "warm_up_drift"}
"""What is found of a log as it is read, and found again, with its size, beside its noise."""

_NEAR = 1 / 100
"""Part of a recording within which two steps are one."""


def without_doubles(
    findings: Iterable[Row],
    deterministic: pa.Table,
    durations: Mapping[tuple[str, str], float],
) -> Iterator[Row]:
    """Yield the findings of the ingest that the table ``deterministic`` does not tell better.

    Parameters
    ----------
    findings : iterable of mapping
        Rows of the table ``findings``.
    deterministic : pyarrow.Table
    durations : mapping
        Of each sensor and recording, s.
    """
    known: dict[tuple[str, str, str], list[Row]] = {}
    for row in deterministic.to_pylist():
        known.setdefault((row["sensor"], row["recording"], row["channel"]), []).append(row)
    for finding in findings:
        kind = _OF_LOGS.get(finding["finding"])
        if kind is None:
            yield finding
            continue
        place = (finding["sensor"], finding["recording"], finding["channel"])
        same = (row for row in known.get(place, ()) if row["kind"] == kind)
        near = _NEAR * durations.get((finding["sensor"], finding["recording"]), 0.0)
        if not any(abs(row["start"] - (finding["start"] or 0.0)) <= near for row in same):
            yield finding


def spectral_rows(tables: Mapping[str, pa.Table]) -> Iterator[Row]:
    """Yield the rows of the table ``findings`` that the tables ``lines`` and ``models`` tell."""
    for (sensor, recording), lines in _by(tables["lines"], "sensor", "recording").items():
        for finding in line_findings(lines.to_pylist()):
            yield finding.row(sensor, recording)
    models = tables["models"]
    for row in models.filter(models["chosen"]).to_pylist():
        if row["band"] is not None:
            for finding in band_finding(row["channel"], row["band"], row["band_source"] or ""):
                yield finding.row(row["sensor"], row["recording"])


def sensors_of(catalogue: str) -> dict[str, Sensor]:
    """Return the sensors as the plan wrote them."""
    return {name: Sensor.model_validate(one) for name, one in json.loads(catalogue).items()}

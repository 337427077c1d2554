"""Memory and time that a job asks for on a cluster, from the size of the log.

The numbers are what steps took of logs of up to 60 million samples, with a margin
(docs/cluster.md). A job has one core whatever its log: no step computes with more. A run on one
computer is not held to any of it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypedDict

from imubench_pipeline.recordings.drop_zone import COMPRESSED, Recording
from imubench_pipeline.run.bounded_steps import Limit, Limits
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.step_modules import OF_SENSOR
from imubench_pipeline.units import quantity_to_si

_BESIDE = 900
"""MB that a step does not have to itself: two Snakemakes and the process that forks, 550, and two
small steps of the same group."""

_START = 60
"""s; a cold start of Python from a shared file system, and the compilers of a first run."""

_STARTED = {"sensor_tables", "outlook"}
"""Steps of which one group has so many that each cannot ask for a start of its own."""

_MARGIN = 10
"""A busy node and a slow file system may take that many times the time measured."""

_TEXT = {".csv", ".txt", ".log", ".tsv", ".dat", ".asc", ".nmea"}
_AS_TEXT = {"text": 1, "binary": 3, "compressed": 6}
"""How many times the samples of text a byte of a log may hold."""

_BYTES_OF_A_VALUE = 7
"""Of text. Nine digits take eleven, small counts three: for these the margin is there."""


class Resources(TypedDict):
    """What a job asks for: memory in MB, time in minutes."""

    mem_mb: int
    runtime: int


Asked = Callable[[Mapping[str, str], int, str], int]
"""Takes the wildcards of a job, its attempt and the name of its rule."""


@dataclass(frozen=True)
class Extent:
    """How much there is to compute.

    Attributes
    ----------
    million_samples : float
        Of one channel.
    channels : int
    recordings : int
        Of the run, or of one sensor.
    """

    million_samples: float = 0.0
    channels: int = 1
    recordings: int = 1


_OF_A_RECORDING: Mapping[str, tuple[float, float, float, float, float]] = {
    # MB, MB a million samples of a channel; s, s a channel, s a million values
    "simulate": (300, 0, 1, 0, 0.2),
    "ingest": (400, 0, 1, 0, 0.15),
    "allan": (400, 20, 10, 0, 0.2),
    "estimate": (400, 5, 10, 0.7, 0.1),
    "reconstruct": (350, 15, 1, 1.3, 0.6),
    "datasheet": (300, 0, 1, 0, 0),
    "error_budget": (350, 0, 3, 0.5, 0.05),
    "earth_rotation": (450, 60, 15, 0, 3),
    "calibration": (450, 60, 5, 0, 1),
}

_OF_ALL: Mapping[str, tuple[float, float, float, float]] = {
    # MB, MB a recording; s, s a recording
    "sensor_tables": (300, 2, 1, 0.03),
    "outlook": (350, 0.1, 3, 0.005),
    "tables": (300, 0.5, 1, 0.005),
    "ranking": (300, 0.1, 1, 0.01),
    "shortlist": (300, 0.2, 3, 0.01),
    "repeatability": (300, 0.1, 1, 0.01),
    "fusion": (300, 0.2, 6, 0.01),
    "coverage": (300, 0, 1, 0),
    "exports": (300, 0.5, 1, 0.05),
    "figures": (350, 3, 12, 0.06),
    "report": (350, 3, 2, 0.12),
}


def resources_of(rule: str, extent: Extent, attempt: int = 1) -> Resources:
    """Return what a job asks for; each attempt asks for twice as much as the one before.

    Parameters
    ----------
    rule : str
        A step of the workflow.
    extent : Extent
    attempt : int
        Counted from 1.
    """
    if rule in _OF_ALL:
        memory, more_memory, time, more_time = _OF_ALL[rule]
        memory += more_memory * extent.recordings
        time += more_time * extent.recordings
    else:
        memory, of_samples, time, of_channels, of_values = _OF_A_RECORDING[rule]
        memory += of_samples * extent.million_samples
        time += (of_channels + of_values * extent.million_samples) * extent.channels
    start = 0 if rule in _STARTED else _START
    times: int = 2 ** (attempt - 1)
    return {
        "mem_mb": times * math.ceil((_BESIDE + memory) / 100) * 100,
        "runtime": times * math.ceil((start + _MARGIN * time) / 60),
    }


def asked(plan: Plan) -> dict[str, Asked]:
    """Return what rules of Snakemake state as their resources.

    Parameters
    ----------
    plan : Plan
    """
    extent = _extents(plan)

    def of_job(wildcards: Mapping[str, str], attempt: int, rulename: str) -> Resources:
        found = extent(wildcards.get("sensor"), wildcards.get("recording"))
        return resources_of(rulename, found, attempt)

    # Snakemake knows by their names what its functions take.
    def mem_mb(wildcards: Mapping[str, str], attempt: int, rulename: str) -> int:
        return of_job(wildcards, attempt, rulename)["mem_mb"]

    def runtime(wildcards: Mapping[str, str], attempt: int, rulename: str) -> int:
        return of_job(wildcards, attempt, rulename)["runtime"]

    return {"mem_mb": mem_mb, "runtime": runtime}


def time_limits(plan: Plan) -> Limits:
    """Return how long each step of a recording or a sensor may take, as the plan sets it.

    Parameters
    ----------
    plan : Plan
    """
    extent = _extents(plan)
    given = plan.run.limits
    seconds = {
        key: quantity_to_si(value, "time") for key, value in given.model_dump(mode="json").items()
    }

    def limit(step: str, wildcards: Mapping[str, str]) -> Limit:
        found = extent(wildcards.get("sensor"), wildcards.get("recording"))
        if step in OF_SENSOR:
            more = seconds["each_recording"] * found.recordings
            return Limit(seconds["sensor"] + more, "limits.sensor, limits.each_recording")
        more = seconds["million_values"] * found.million_samples * found.channels
        return Limit(seconds["recording"] + more, "limits.recording, limits.million_values")

    return limit


def _extents(plan: Plan) -> Callable[[str | None, str | None], Extent]:
    """Return what tells the extent of a recording, a sensor or all, and keeps it."""

    @cache
    def extent(sensor: str | None, name: str | None) -> Extent:
        if sensor is None:
            return Extent(recordings=len(plan.recordings))
        if name is None:
            return Extent(recordings=sum(of == sensor for of, _ in plan.recordings))
        return _extent(plan, plan.recordings[sensor, name])

    return extent


def _extent(plan: Plan, recording: Recording) -> Extent:
    if recording.simulated:
        text = plan.simulated_settings(recording.sensor, recording.name)
        made = json.loads(text)["recording"]
        seconds = quantity_to_si(made["duration"], "time")
        samples = seconds * quantity_to_si(made["rate"], "frequency")
        return Extent(samples / 1e6, len(made["channels"]))
    sensor = plan.sensors.get(recording.sensor)
    channels = len(sensor.log.channels) if sensor else 1
    try:
        size = sum(size_as_text(path) for path in recording.files)
    except OSError:
        size = 0  # the ingest says what is wrong with it
    return Extent(size / (_BYTES_OF_A_VALUE * channels) / 1e6, channels)


def size_as_text(path: Path) -> int:
    """Return the size that a file might have as text, in bytes; 0 if there is none.

    Parameters
    ----------
    path : Path
        A file of a log. Its samples may be packed: counts in binary, compressed text.
    """
    if not path.is_file():
        return 0
    suffix = path.suffix.lower()
    kind = "compressed" if suffix in COMPRESSED else "text" if suffix in _TEXT else "binary"
    return path.stat().st_size * _AS_TEXT[kind]

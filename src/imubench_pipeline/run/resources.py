"""Memory and time that a job asks for on a cluster, from the size of the log.

The costs that the rules state are what steps took of logs of up to 60 million samples
(docs/how-to/cluster.md); here a margin is added. A job has one core whatever its log: no step
computes with more. A run on one computer is held to the limits alone, far above what steps take.
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
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.units import quantity_to_si

_BESIDE = 900
"""MB that a step does not have to itself: two Snakemakes and the process that forks, 550, and two
small steps of the same group."""

_START = 60
"""s; a cold start of Python from a shared file system, and the compilers of a first run."""

_MB = 10**6

_MARGIN = 10
"""A busy node and a slow file system may take that many times the time measured."""

_TEXT = {".csv", ".txt", ".log", ".tsv", ".dat", ".asc", ".nmea"}
_AS_TEXT = {"text": 1, "binary": 3, "compressed": 6}
"""How many times the samples of text a byte of a log may hold."""

_BYTES_OF_A_VALUE = 7
"""Of text. Nine digits take eleven, small counts three: for these the margin is there."""


@dataclass(frozen=True)
class Limit:
    """What a step may take: time in s, and memory in bytes beside what the process that forks has.

    ``words``: where that is set.
    """

    seconds: float
    words: str
    memory: int


Limits = Callable[[str, str | None], Limit]
"""Takes the sensor and the recording of a job; None: a step of the whole sensor."""


class Resources(TypedDict):
    """What a job asks for: memory in MB, time in minutes."""

    mem_mb: int
    runtime: int


Asked = Callable[[Mapping[str, str], int], int]
"""Takes the wildcards of a job, and its attempt."""


@dataclass(frozen=True)
class Extent:
    """How much there is to compute, of one recording, a sensor or the run.

    ``million_samples`` are those of one channel.
    """

    million_samples: float = 0.0
    channels: int = 1
    recordings: int = 1


@dataclass(frozen=True, kw_only=True)
class OfRecording:
    """What a step of one recording takes.

    Memory in MB, and MB a million samples of a channel; time in s, s a channel, and s a million
    values of all channels.
    """

    memory: float
    memory_of_samples: float = 0.0
    time: float
    time_of_channels: float = 0.0
    time_of_values: float = 0.0

    def of(self, extent: Extent) -> tuple[float, float]:
        """Return memory in MB and time in s."""
        values = self.time_of_values * extent.million_samples
        return (
            self.memory + self.memory_of_samples * extent.million_samples,
            _START + _MARGIN * (self.time + (self.time_of_channels + values) * extent.channels),
        )


@dataclass(frozen=True, kw_only=True)
class OfMany:
    """What a step of many recordings takes, of one sensor or of all: memory in MB, and time in s.

    ``many_jobs``: one group has so many of them that each cannot ask for a start of its own.
    """

    memory: float
    memory_of_each: float = 0.0
    time: float
    time_of_each: float = 0.0
    many_jobs: bool = False

    def of(self, extent: Extent) -> tuple[float, float]:
        """Return memory in MB and time in s."""
        start = 0.0 if self.many_jobs else _START
        return (
            self.memory + self.memory_of_each * extent.recordings,
            start + _MARGIN * (self.time + self.time_of_each * extent.recordings),
        )


Cost = OfRecording | OfMany


def resources_of(cost: Cost, extent: Extent, attempt: int = 1) -> Resources:
    """Return what a job asks for; each attempt, counted from 1, for twice as much as the last."""
    memory, seconds = cost.of(extent)
    times: int = 2 ** (attempt - 1)
    return {
        "mem_mb": times * math.ceil((_BESIDE + memory) / 100) * 100,
        "runtime": times * math.ceil(seconds / 60),
    }


def asked(plan: Plan) -> Callable[[Cost], dict[str, Asked]]:
    """Return what makes of the cost of a rule what it states as its resources."""
    extent = _extents(plan)

    def stated(cost: Cost) -> dict[str, Asked]:
        def of_job(wildcards: Mapping[str, str], attempt: int) -> Resources:
            size = extent(wildcards.get("sensor"), wildcards.get("recording"))
            return resources_of(cost, size, attempt)

        # Snakemake knows by their names what its functions take.
        def mem_mb(wildcards: Mapping[str, str], attempt: int) -> int:
            return of_job(wildcards, attempt)["mem_mb"]

        def runtime(wildcards: Mapping[str, str], attempt: int) -> int:
            return of_job(wildcards, attempt)["runtime"]

        return {"mem_mb": mem_mb, "runtime": runtime}

    return stated


def limits_of_steps(plan: Plan) -> Limits:
    """Return what each step of a recording or a sensor may take, as the plan sets it."""
    extent = _extents(plan)
    limits = plan.run.limits
    seconds = {
        key: quantity_to_si(getattr(limits, key), "time")
        for key in ("recording", "million_values", "sensor", "each_recording")
    }

    def limit(sensor: str, recording: str | None) -> Limit:
        of = extent(sensor, recording)
        if recording is None:
            time = seconds["sensor"] + seconds["each_recording"] * of.recordings
            memory = limits.memory + limits.memory_of_each_recording * of.recordings
            words = "limits.sensor, limits.each_recording"
        else:
            values = of.million_samples * of.channels
            time = seconds["recording"] + seconds["million_values"] * values
            memory = limits.memory + math.ceil(limits.memory_of_million_values * values)
            words = "limits.recording, limits.million_values"
        return Limit(time, words, memory * _MB)

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
    """Return the size that a file of a log might have as text, in bytes; 0 if there is none.

    Its samples may be packed: counts in binary, compressed text.
    """
    if not path.is_file():
        return 0
    suffix = path.suffix.lower()
    kind = "compressed" if suffix in COMPRESSED else "text" if suffix in _TEXT else "binary"
    return path.stat().st_size * _AS_TEXT[kind]

"""Memory and time requests of a job on a cluster, from the size of the log.

The costs in the rules were measured with logs of up to 60 million samples (docs/how-to/cluster.md);
this module adds a margin. A job has one core for any log: no step uses more.
"""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from imubench_pipeline.recordings.drop_zone import COMPRESSED, Recording
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.units import parse_quantity

_OVERHEAD_MEMORY = 900
"""Memory of a job besides the step, MB: 550 for two Snakemake processes and the process that forks,
the rest for two small steps of the same group."""

_START_TIME = 60  # s; Python from a shared file system, and compilation in a first run
_BYTES_PER_MB = 10**6
_TIME_MARGIN = 10  # factor on measured times, for a busy node and a slow file system
_TEXT_SUFFIXES = {".csv", ".txt", ".log", ".tsv", ".dat", ".asc", ".nmea"}
_BINARY_EXPANSION, _COMPRESSED_EXPANSION = 3, 6  # max. samples per byte of a log, relative to text.
_BYTES_PER_VALUE = 7  # of text: nine digits take eleven, small counts three


@dataclass(frozen=True)
class Limit:
    """Limits of a step: time in s, the settings of that time, and additional memory in bytes."""

    seconds: float
    words: str
    memory: int


Limits = Callable[[str, str | None], Limit]  # of sensor and recording; None: the whole sensor

Asked = Callable[[Mapping[str, str], int], int]  # takes the wildcards of a job, and its attempt


@dataclass(frozen=True)
class Extent:
    """Size of the data of a recording, a sensor or the run; ``million_samples`` are per channel."""

    million_samples: float = 0.0
    channels: int = 1
    recordings: int = 1


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Memory and time that a step needs, as linear functions of the size of its data.

    Memory in MB, and MB per million samples of a channel and per recording. Time in s, s per
    channel, s per million values of all channels, and s per recording. ``many_jobs``: a group
    contains many such jobs, which do not each request a start-up time.
    """

    memory: float
    memory_of_samples: float = 0.0
    memory_of_each: float = 0.0
    time: float
    time_of_channels: float = 0.0
    time_of_values: float = 0.0
    time_of_each: float = 0.0
    many_jobs: bool = False

    def of(self, extent: Extent) -> tuple[float, float]:
        """Return the memory, MB, and the time, s, for data of a size; the time has a margin."""
        memory = self.memory + self.memory_of_samples * extent.million_samples
        of_channel = self.time_of_channels + self.time_of_values * extent.million_samples
        time = self.time + of_channel * extent.channels + self.time_of_each * extent.recordings
        start = 0.0 if self.many_jobs else _START_TIME
        return memory + self.memory_of_each * extent.recordings, start + _TIME_MARGIN * time


def compute_resources(cost: Cost, extent: Extent, attempt: int = 1) -> dict[str, int]:
    """Return the memory in MB and the minutes that a job requests, doubled at each `attempt`."""
    memory, seconds = cost.of(extent)
    times: int = 2 ** (attempt - 1)
    return {
        "mem_mb": times * math.ceil((_OVERHEAD_MEMORY + memory) / 100) * 100,
        "runtime": times * math.ceil(seconds / 60),
    }


def make_resource_functions(plan: Plan) -> Callable[[Cost], dict[str, Asked]]:
    """Return a function that turns the cost of a rule into its resource functions for Snakemake."""
    extent = _make_extent_lookup(plan)

    def stated(cost: Cost) -> dict[str, Asked]:
        def of_job(what: str) -> Asked:
            # Snakemake passes arguments by their names.
            def amount(wildcards: Mapping[str, str], attempt: int) -> int:
                size = extent(wildcards.get("sensor"), wildcards.get("recording"))
                return compute_resources(cost, size, attempt)[what]

            return amount

        return {what: of_job(what) for what in ("mem_mb", "runtime")}

    return stated


def make_step_limits(plan: Plan) -> Limits:
    """Return a function that gives the limits of a step from the settings and the data size."""
    extent = _make_extent_lookup(plan)
    limits = plan.run.limits
    seconds = {
        key: parse_quantity(getattr(limits, key), "time")
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
        return Limit(time, words, memory * _BYTES_PER_MB)

    return limit


def _make_extent_lookup(plan: Plan) -> Callable[[str | None, str | None], Extent]:
    @cache
    def extent(sensor: str | None, name: str | None) -> Extent:
        if sensor is None:
            return Extent(recordings=len(plan.recordings))
        if name is None:
            return Extent(recordings=sum(of == sensor for of, _ in plan.recordings))
        return _estimate_extent(plan, plan.recordings[sensor, name])

    return extent


def _estimate_extent(plan: Plan, recording: Recording) -> Extent:
    if recording.simulated:
        made = json.loads(plan.simulated_settings(recording.sensor, recording.name))["recording"]
        seconds = parse_quantity(made["duration"], "time")
        samples = seconds * parse_quantity(made["rate"], "frequency")
        return Extent(samples / 1e6, len(made["channels"]))
    sensor = plan.sensors.get(recording.sensor)
    channels = len(sensor.log.channels) if sensor else 1
    try:
        size = sum(estimate_text_size(path) for path in recording.files)
    except OSError:
        size = 0  # the ingest reports the fault
    return Extent(size / (_BYTES_PER_VALUE * channels) / 1e6, channels)


def estimate_text_size(path: Path) -> int:
    """Estimate the size, bytes, that a log file would have as text; 0 if there is no file."""
    if not path.is_file():
        return 0
    suffix = path.suffix.lower()
    if suffix in COMPRESSED:
        return path.stat().st_size * _COMPRESSED_EXPANSION
    return path.stat().st_size * (1 if suffix in _TEXT_SUFFIXES else _BINARY_EXPANSION)

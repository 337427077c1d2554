"""The workflow with many recordings: what it costs beside the computation, and what is fast.

python benchmarks/workflow_scale.py [--recordings 1000] [--at-once N] [--gyro] [--folder DIR]

Short logs of one sensor model each, analysed by `weighted` alone so that they take little time,
with ``--gyro`` of one gyro axis only. At most ``--at-once`` recordings are new in a run. The
overhead of a recording is the CPU time of the whole run, less the steps for all recordings, less
what the steps of a recording compute where everything is imported and compiled already.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import runpy
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import yaml

from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.processes import COSTS
from imubench_pipeline.settings.yaml_files import read_yaml

PROJECT = Path(__file__).parents[1]
SENSORS = 20
SAMPLES = 3000
COMPUTED = 20
"""Recordings of which the computation is timed."""

CHANNELS = {
    "gyro_x": {"column": "wx", "unit": "rad/s"},
    "accel_x": {"column": "ax", "unit": "m/s^2"},
}
OF_A_RECORDING = ("ingest", "allan", "estimate", "reconstruct", "datasheet", "error_budget")
ESTIMATED = ("parameters", "models", "lines", "spectrum", "fixed_bias")


@dataclass(frozen=True)
class Costs:
    """What each step of a run has cost: CPU time in s and memory in MB."""

    cpu: dict[str, list[float]]
    memory: dict[str, float]


class Lab:
    """Logs and sensor files in a folder, and the results of runs."""

    def __init__(self, folder: Path, channels: Sequence[str]) -> None:
        self.folder = folder
        self.channels = channels
        self.costs = folder / "costs"
        self.settings = {
            "logs": str(folder / "logs"),
            "sensors": str(folder / "sensors"),
            "results": str(folder / "results"),
            "simulated": "false",
            "estimate": '{"methods": ["weighted"]}',
        }

    def put_sensors(self) -> None:
        """Write the sensor files."""
        for number in range(SENSORS):
            path = self.folder / f"sensors/sensor_{number:02d}.yaml"
            path.parent.mkdir(parents=True, exist_ok=True)
            log = {"rate": "100 Hz", "channels": {name: CHANNELS[name] for name in self.channels}}
            datasheet = {"gyro": {"noise_density": {"value": 0.01, "unit": "deg/s/sqrt(Hz)"}}}
            about = {"vendor": "Benchmark", "model": path.stem, "log": log, "datasheet": datasheet}
            path.write_text(yaml.safe_dump(about))

    def put_log(self, number: int) -> None:
        """Write a log of white noise and a random walk."""
        rng = np.random.default_rng(number)
        noise = rng.normal(0.0, 1e-3, (SAMPLES, 2)) + rng.normal(0.0, 1e-5, (SAMPLES, 2)).cumsum(0)
        path = self.folder / f"logs/sensor_{number % SENSORS:02d}/night_{number // SENSORS:03d}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = (f"{wx:.9g},{ax + 9.81:.9g}\n" for wx, ax in noise)
        path.write_text("wx,ax\n" + "".join(lines))

    def run(self, *flags: str) -> tuple[float, float, float]:
        """Run the workflow; return time and CPU time in s, and the memory of Snakemake in MB."""
        before = _used()
        start = time.perf_counter()
        said = self.folder / "said"
        with said.open("wb") as output:
            done = subprocess.run(
                [sys.executable, "-m", "snakemake", "-c2", "--quiet", "all", *flags, "--config",
                 *(f"{key}={value}" for key, value in self.settings.items())],
                cwd=PROJECT, check=False, stdout=output, stderr=subprocess.STDOUT,
                env=os.environ | {COSTS: str(self.costs)},
            )  # fmt: skip
        if done.returncode:
            sys.exit(said.read_text()[-3000:])
        return time.perf_counter() - start, _used() - before, _peak()

    def taken(self) -> Costs:
        """Return what the steps have cost since this was asked last."""
        cpu: dict[str, list[float]] = defaultdict(list)
        memory: dict[str, float] = defaultdict(float)
        for line in self.costs.read_text().splitlines() if self.costs.is_file() else ():
            step = json.loads(line)
            cpu[step["step"]].append(step["cpu"])
            memory[step["step"]] = max(memory[step["step"]], step["memory"])
        self.costs.unlink(missing_ok=True)
        return Costs(cpu, memory)

    def computation(self, numbers: Sequence[int]) -> float:
        """Return the CPU time that a recording's steps compute, in s: the mean of some."""
        config = read_yaml(PROJECT / "config/config.yaml")
        assert isinstance(config, dict)
        plan = Plan(config | _parsed(self.settings))
        times = []
        for number in (numbers[0], *numbers):
            start = time.process_time()
            sensor, name = f"sensor_{number % SENSORS:02d}", f"night_{number // SENSORS:03d}"
            for step in OF_A_RECORDING:
                given = _given(plan, step, sensor, name, self.folder / "results/recordings")
                script = str(PROJECT / f"workflow/scripts/{step}.py")
                runpy.run_path(script, init_globals={"snakemake": given}, run_name="__main__")
            times.append(time.process_time() - start)
        return float(np.mean(times[1:]))  # the first one imports and compiles


class Named(dict[str, Any]):
    """Stands for the files that Snakemake gives a step, by name and by position."""

    def __getattr__(self, name: str) -> Any:
        return self[name]

    def __iter__(self) -> Any:
        return iter(self.values())

    def __getitem__(self, key: Any) -> Any:
        return list(self.values())[key] if isinstance(key, int) else super().__getitem__(key)


def _given(plan: Plan, step: str, sensor: str, name: str, recordings: Path) -> SimpleNamespace:
    def files(*stems: str) -> Named:
        folder = recordings / sensor / name
        ending = {"quality": ".json"}
        return Named({stem: str(folder / (stem + ending.get(stem, ".parquet"))) for stem in stems})

    inputs: dict[str, tuple[str, ...]] = {
        "allan": ("quality",),
        "estimate": ("quality", "allan"),
        "reconstruct": ("quality", "allan", "parameters"),
        "datasheet": ("quality", "allan", "parameters", "fixed_bias"),
        "error_budget": ("quality", "parameters", "draws", "temperature", "deterministic"),
    }
    outputs = {
        "ingest": ("quality", "envelope", "histogram"),
        "allan": ("curve",),
        "estimate": ESTIMATED,
        "reconstruct": ("reconstruction", "scores"),
        "datasheet": ("datasheet", "datasheet_curve"),
        "error_budget": ("error_budget", "backtest"),
    }
    settings = {
        "ingest": lambda: plan.ingest_settings(sensor, name),
        "allan": lambda: plan.settings("allan"),
        "estimate": lambda: plan.estimate_settings(sensor, name),
        "reconstruct": lambda: plan.settings("reconstruction"),
        "datasheet": lambda: plan.datasheet_settings(sensor),
        "error_budget": lambda: plan.error_budget_settings(sensor),
    }
    params = {"settings": settings[step](), "source": str(plan.recordings[sensor, name].path)}
    return SimpleNamespace(
        input=files(*inputs.get(step, ())),
        output=files(*outputs[step]),
        params=Named(params),
        wildcards=Named(sensor=sensor, recording=name),
    )


def _parsed(settings: dict[str, str]) -> dict[str, object]:
    return {key: yaml.load(value, Loader=yaml.BaseLoader) for key, value in settings.items()}


def _used() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024 / 1e6  # KiB


def measure(lab: Lab, recordings: int, at_once: int) -> None:
    """Make the logs, run, and print what each run takes."""
    lab.put_sensors()
    lab.put_log(0)
    lab.run()  # compiles what was not yet
    lab.taken()
    print(f"{'recordings':>10} {'s':>7} {'CPU s':>7}  steps for all recordings: CPU s (peak MB)")
    done = 1
    for part in sorted({*range(at_once, recordings, at_once), recordings}):
        for number in range(done, part):
            lab.put_log(number)
        taken, cpu, peak = lab.run()
        costs = lab.taken()
        shared = {step: cpu for step, cpu in costs.cpu.items() if step not in OF_A_RECORDING}
        shown = ", ".join(f"{s} {sum(c):.1f} ({costs.memory[s]:.0f})" for s, c in shared.items())
        figures = f"{part:>10} {taken:>7.0f} {cpu:>7.0f}  {shown}; any process {peak:.0f} MB"
        print(figures, flush=True)
        cost = (cpu - sum(map(sum, shared.values()))) / (part - done)
        done = part
    computed = lab.computation(range(0, recordings, max(recordings // COMPUTED, 1)))
    print(f"a recording: {cost:.2f} s of CPU, of that {computed:.2f} s of computation and")
    print(f"  {cost - computed:.2f} s of overhead")
    lab.run("--touch")  # the computation has written its files again
    taken, cpu, _ = lab.run()
    if lab.taken().cpu:
        sys.exit("a run for nothing has run steps")
    print(f"nothing to do: {taken:.1f} s")
    lab.put_log(recordings)
    taken, _, _ = lab.run()
    own = sum(sum(c) for s, c in lab.taken().cpu.items() if s in OF_A_RECORDING)
    print(f"one more log: {taken:.1f} s, of that {own:.1f} s its own analysis")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=1000)
    parser.add_argument("--at-once", type=int, default=500)
    parser.add_argument("--gyro", action="store_true", help="logs of one gyro axis only")
    parser.add_argument("--folder", type=Path, help="where to work; default: a temporary folder")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = (given.folder or Path(temporary)).absolute()
        folder.mkdir(parents=True, exist_ok=True)
        channels = ("gyro_x",) if given.gyro else tuple(CHANNELS)
        measure(Lab(folder, channels), given.recordings, given.at_once)


if __name__ == "__main__":
    main()

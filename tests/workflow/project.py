"""Small projects of real files, for real runs of Snakemake."""

from __future__ import annotations

import gzip
import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import yaml

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.run.lock import INHERITED, Lock
from tests.conftest import PROJECT
from tests.workflow.dry_runs import dry_run

CHANNELS = {
    "gyro_x": {"column": "wx", "unit": "deg/s"},
    "accel_x": {"column": "ax", "unit": "m/s^2"},
}
DATASHEET = {"gyro": {"noise_density": {"value": 0.01, "unit": "deg/s/sqrt(Hz)"}}}

STEPS = ("ingest", "allan", "estimate", "reconstruct", "datasheet", "error_budget")
"""Rules for one recording, in their order."""

TOGETHER = (
    "tables",
    "files",
    "ranking",
    "shortlist",
    "repeatability",
    "fusion",
    "papers",
    "exports",
    "figures",
    "report",
)
"""Rules for all recordings of all sensors, once those of each sensor are joined."""

Job = tuple[str, str]
"""A rule, and what a job of it is for: a recording (sensor and name), a sensor, or all."""

_JOB = re.compile(r"^( *)(?:local)?rule (\w+):\n((?:\1 .*\n)*)", re.MULTILINE)
_WILDCARDS = re.compile(r"wildcards: sensor=(.+?)(?:, recording=(.+))?$", re.MULTILINE)


FEW = [
    'error_budget={"draws": 20}',
    'earth_rate={"draws": 20, "goals": [1], "run_time": "90 s"}',
    'fusion={"draws": 100}',
]
"""Few models for an interval: what is looked at here is what runs, and not how wide it is."""


BAD = {
    "corrupt": "line ",
    "empty": "the file is empty",
    "text": "line 2002, column 'ax': found 'abc', expected a number",
}
"""Logs that cannot be used, and what their reasons say."""


@dataclass
class Project:
    """Logs and sensor files in a folder, and the results of their runs.

    ``place`` is the folder to run in, made by `linked`: two projects never share notes and locks;
    ``settings`` go to the command line, as ``key=value``; ``environment`` is that of the run.
    """

    folder: Path
    results: Path
    place: Path
    settings: list[str] = field(default_factory=list)
    environment: dict[str, str] | None = None

    def command(self, *flags: str, cores: int = 2) -> list[str]:
        return [sys.executable, "-m", "snakemake", f"-c{cores}", *flags, "--config", *self.config()]

    def nightly_command(self, *flags: str, cores: int = 2) -> list[str]:
        """`imubench nightly`, which takes logs as they are."""
        command = "import sys; from imubench_pipeline.run.cli import main; sys.exit(main())"
        return [sys.executable, "-c", command, "nightly", "--project", str(self.place),
                f"-c{cores}", "--settle", "0", *flags, "--config", *self.config()]  # fmt: skip

    def config(self) -> list[str]:
        return [f"logs={self.folder / 'logs'}", f"sensors={self.folder / 'sensors'}",
                f"results={self.results}", "simulated=false", *FEW, *self.settings]  # fmt: skip

    def run(
        self, *flags: str, cores: int = 2, lock: Lock | None = None, time_limit: float = 600
    ) -> subprocess.CompletedProcess[str]:
        """Run Snakemake, which inherits a lock on the results if one is given."""
        if flags == ("-n",) and self.environment is None:
            return dry_run(self.place, [f"-c{cores}", "--config", *self.config()])
        environment = os.environ if self.environment is None else self.environment
        return subprocess.run(
            self.command(*flags, cores=cores),
            cwd=self.place,
            env=environment | ({INHERITED: str(lock.descriptor)} if lock else {}),
            pass_fds=(lock.descriptor,) if lock else (),
            capture_output=True,
            text=True,
            check=False,
            timeout=time_limit,
        )

    def jobs(self) -> dict[str, int]:
        """How many jobs of each rule a run would do now."""
        counts: dict[str, int] = {}
        for rule, _ in self.job_list():
            counts[rule] = counts.get(rule, 0) + 1
        return counts

    def job_list(self) -> set[Job]:
        """What a run would do now."""
        done = self.run("-n")
        assert done.returncode == 0, done.stdout + done.stderr
        jobs = set()
        for _, rule, about in _JOB.findall(done.stdout):
            of = _WILDCARDS.search(about)
            jobs.add((rule, "/".join(filter(None, of.groups())) if of else ""))
        stated = re.search(r"^total +(\d+)$", done.stdout, re.MULTILINE)
        assert len(jobs) == (int(stated[1]) if stated else 0), done.stdout
        return jobs - {("all", "")}

    def pages(self) -> dict[str, int]:
        """When each page of the report was written."""
        report = self.results / "report"
        return {
            path.relative_to(report).as_posix(): path.stat().st_mtime_ns
            for path in report.rglob("*.html")
        }

    def table(self, name: str) -> list[dict]:
        return pq.read_table(self.results / f"tables/{name}.parquet").to_pylist()


def linked(folder: Path) -> Path:
    """Make a folder to run in, with notes and locks of Snakemake of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("Snakefile", "config", "profiles", "workflow"):
        (folder / name).symlink_to(PROJECT / name)
    return folder


def put_log(path: Path, seed: int, samples: int = 20_000) -> None:
    rng = np.random.default_rng(seed)
    wx = np.degrees(simulate(NoiseModel(N=1e-4, B=1e-4, T_B=5.0), 100.0, samples, rng))
    ax = 9.81 + simulate(NoiseModel(N=1e-3, K=1e-3), 100.0, samples, rng)
    rows = "".join(f"{w:.9g},{a:.9g}\n" for w, a in zip(wx, ax, strict=True))
    path.parent.mkdir(parents=True, exist_ok=True)
    text = ("wx,ax\n" + rows).encode()
    path.write_bytes(gzip.compress(text) if path.suffix == ".gz" else text)


def put_sensor(path: Path, **changes: object) -> None:
    sensor = {"vendor": "V", "model": path.stem, "log": {"rate": "100 Hz", "channels": CHANNELS}}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(sensor | {"datasheet": DATASHEET} | changes))


def put_bad_logs(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    good = "wx,ax\n" + "0.5,9.81\n0.25,9.82\n" * 1000
    middle = len(good) // 2
    (folder / "corrupt.csv").write_text(good[:middle] + "\x01\x02garbage\n" + good[middle:])
    (folder / "empty.csv").write_text("")
    (folder / "text.csv").write_text(good + "0.5,abc\n" + "0.5,9.81\n")

"""Run the steps of the workflow for a few logs while the user waits.

It uses the functions and settings of the rules, so that the numbers are the same. The channels of
a recording are estimated and reconstructed in parallel, in forks of one process.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields
from itertools import chain
from pathlib import Path
from typing import TypeVar

import pyarrow as pa

from imubench_pipeline.model.table import TableRow
from imubench_pipeline.readers.bounded import BoundError, run_bounded
from imubench_pipeline.recordings.ingest import write_failed
from imubench_pipeline.recordings.recording import open_static_logs
from imubench_pipeline.report.run_summary import fold_text
from imubench_pipeline.run.analysis.compilation import Compilation
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.resources import make_step_limits
from imubench_pipeline.settings.config import AllanSettings, ReconstructionSettings
from imubench_pipeline.steps import allan as allan_step
from imubench_pipeline.steps.datasheet import compare_with_datasheet
from imubench_pipeline.steps.error_budget import compute_error_tables
from imubench_pipeline.steps.estimate import Estimation, estimate_recording
from imubench_pipeline.steps.ingest import write_recording
from imubench_pipeline.steps.reconstruct import ReconstructionRows, reconstruct_recording
from imubench_pipeline.steps.sensor_tables import join_tables
from imubench_pipeline.steps.tables import join_all_tables
from imubench_pipeline.tables.failures import Failure, describe_error, write_empty
from imubench_pipeline.tables.files import build, write, write_arrow, write_each
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES

T = TypeVar("T")
K = TypeVar("K", bound=tuple[str, ...])
Say = Callable[[str], None]

_ESTIMATE_TABLES = tuple(
    field.name for field in fields(Estimation) if field.name not in ("estimates", "paths")
)
_COMPARISON_TABLES = (
    *("datasheet", "datasheet_curve", "error_budget", "backtest"),
    *("error_growth", "drawn_deviations"),
)
_RECONSTRUCTION_TABLES = ("reconstruction", "scores")
_TABLES_OF_STEP: dict[str, tuple[str, ...]] = {  # output tables of each step
    "ingest": ("envelope", "histogram"),
    "estimate": (),  # they are written together, like the tables of the reconstruction
    "datasheet": _COMPARISON_TABLES,
    "reconstruct": (),
}
_MIN_REPORTED_TIME = 3.0  # steps that take longer, s, are reported


class Analysis:
    """Runs the steps for all recordings of a plan, in parallel; ``say`` prints a progress line."""

    def __init__(self, plan: Plan, compiling: Compilation, cores: int, say: Say) -> None:
        self._plan, self._compiling, self._cores, self._say = plan, compiling, cores, say
        self._limits = make_step_limits(plan)
        self._failed: dict[tuple[str, str], Failure] = {}
        self._series: list[tuple[str, str, str]] = []

    def estimates(self) -> dict[str, pa.Table]:
        """Read the logs and estimate; return tables by name, empty where `for_pages` fills them."""
        self._compiling.expected()
        with ThreadPoolExecutor(self._cores) as beside:
            channels = _collect_results(
                self._submit(beside, "ingest", self._plan.recordings, self._read)
            )
            self._series = [(*key, channel) for key, own in channels.items() for channel in own]
            self._compiling.finish()
            parts = _collect_results(self._submit(beside, "estimate", self._series, self._estimate))
        self._write_parts(_ESTIMATE_TABLES, parts)
        return self._join_tables(_ESTIMATE_TABLES)

    def for_pages(self) -> dict[str, pa.Table]:
        """Compute the results that only pages need, after `estimates`; return tables by name."""
        with ThreadPoolExecutor(self._cores) as beside:
            compared = self._submit(beside, "datasheet", self._plan.recordings, self._compare)
            parts = _collect_results(
                self._submit(beside, "reconstruct", self._series, self._reconstruct)
            )
            _collect_results(compared)
        self._write_parts(_RECONSTRUCTION_TABLES, parts)
        return self._join_tables((*_ESTIMATE_TABLES, *_COMPARISON_TABLES, *_RECONSTRUCTION_TABLES))

    def _read(self, sensor: str, recording: str) -> list[str]:
        folder = self._get_folder(sensor, recording)
        source = self._plan.recordings[sensor, recording].path
        settings = self._plan.ingest_settings(sensor, recording)
        write_recording(source, settings, sensor, recording, folder)
        how = AllanSettings.model_validate_json(self._plan.settings("allan"))
        write(
            "allan",
            allan_step.yield_allan_rows(folder, sensor, recording, how),
            folder / "curve.parquet",
        )
        return list(open_static_logs(folder))

    def _estimate(self, sensor: str, recording: str, channel: str) -> Estimation:
        folder = self._get_folder(sensor, recording)
        settings = self._plan.estimate_settings(sensor, recording)
        rows = estimate_recording(folder, sensor, recording, settings, {channel})
        rows.paths.clear()
        return rows

    def _write_parts(
        self,
        tables: Sequence[str],
        parts: Mapping[tuple[str, str, str], Estimation | ReconstructionRows],
    ) -> None:
        for key in self._plan.recordings:
            own = [part for (*of, _), part in parts.items() if tuple(of) == key]
            failure = self._failed.get(key)
            for table in tables:
                path = self._get_folder(*key) / f"{table}.parquet"
                if failure is not None:
                    write_empty([path], failure)
                else:
                    write(table, chain.from_iterable(getattr(part, table) for part in own), path)

    def _compare(self, sensor: str, recording: str) -> None:
        folder, plan = self._get_folder(sensor, recording), self._plan
        tables: dict[str, Iterable[TableRow]] = {
            **compare_with_datasheet(folder, sensor, recording, plan.datasheet_settings(sensor)),
            **compute_error_tables(folder, sensor, recording, plan.error_budget_settings(sensor)),
        }
        write_each(tables, (folder / f"{name}.parquet" for name in tables))

    def _reconstruct(self, sensor: str, recording: str, channel: str) -> ReconstructionRows:
        folder = self._get_folder(sensor, recording)
        settings = ReconstructionSettings.model_validate_json(self._plan.settings("reconstruction"))
        return reconstruct_recording(folder, settings, {channel})

    def _join_tables(self, made: Sequence[str]) -> dict[str, pa.Table]:
        """Join the tables that were made, by sensor and of all sensors; the others are empty."""
        plan = self._plan
        names = [name for name in made if name not in OF_ONE_RECORDING]
        parts: dict[str, list[Path]] = {}
        for sensor in dict.fromkeys(sensor for sensor, _ in plan.recordings):
            folders = [self._get_folder(*key) for key in plan.recordings if key[0] == sensor]
            own = {name: [folder / f"{name}.parquet" for folder in folders] for name in names}
            own["quality"] = [folder / "quality.json" for folder in folders]
            tables = join_tables(
                own,
                plan.truths(sensor),
                plan.catalogue("price_class", "sold", sensor=sensor),
                plan.usual,
                plan.settings("decide"),
            )
            for name, table in tables.items():
                path = plan.run.results / "sensors" / sensor / f"{name}.parquet"
                write_arrow(table, path)
                parts.setdefault(name, []).append(path)
        every = join_all_tables(parts)
        absent = (name for name in TABLES if name not in every and name not in OF_ONE_RECORDING)
        return every | {name: build(name, ()) for name in absent}

    def _get_folder(self, sensor: str, recording: str) -> Path:
        return self._plan.run.results / "recordings" / sensor / recording

    def _submit(
        self, beside: ThreadPoolExecutor, step: str, keys: Iterable[K], function: Callable[..., T]
    ) -> dict[K, Future[T | None]]:
        return {key: beside.submit(self._run_bounded, step, function, key) for key in keys}

    def _run_bounded(self, step: str, function: Callable[..., T], key: tuple[str, ...]) -> T | None:
        """Call a step in a separate process; if it fails, its recording is omitted."""
        sensor, recording, *_ = key
        folder = self._get_folder(sensor, recording)
        tables = (folder / f"{name}.parquet" for name in _TABLES_OF_STEP[step])
        if (earlier := self._failed.get((sensor, recording))) is not None:
            write_empty(tables, earlier)
            return None
        limit = self._limits(sensor, recording)
        begun = time.monotonic()
        try:
            value = run_bounded(limit.seconds, limit.memory, function, *key)
        except BoundError as error:
            failure = Failure(sensor, recording, step, "time", f"the step {step} {error}")
        except Exception as error:  # the others go on
            words = fold_text(f"the step {step} failed: {describe_error(error)}")
            failure = Failure(sensor, recording, step, "error", words)
        else:
            if time.monotonic() - begun > _MIN_REPORTED_TIME:
                self._say(f"{'/'.join(key[1:])}: {step} done")
            return value
        self._failed.setdefault((sensor, recording), failure)
        if step == "ingest":
            settings = self._plan.ingest_settings(sensor, recording)
            write_failed(settings, failure, folder / "quality.json")
        write_empty(tables, failure)
        return None


def _collect_results(begun: Mapping[K, Future[T | None]]) -> dict[K, T]:
    return {key: value for key, done in begun.items() if (value := done.result()) is not None}

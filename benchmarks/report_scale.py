"""The report of many recordings: time, size, what is written again, and how fast pages open.

python benchmarks/report_scale.py [--recordings 300]

One recording of six simulated channels is made by the workflow; the others are copies of it under
other names, their estimates a few per cent off.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import yaml

from imubench_pipeline.extensions.figures.figures import list_drawings
from imubench_pipeline.model.estimates import FixedBiasRow, ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.drift import drift_rows
from imubench_pipeline.report.compare import KEPT as COMPARED
from imubench_pipeline.report.publish import make_site, publish
from imubench_pipeline.tables.files import build, read, write_arrow
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES
from resident import peak_memory

PROJECT = Path(__file__).parents[1]
SENSORS = 20
FIRST_NIGHT = date(2026, 1, 1)
TRUTH = {
    "gyro": {"N": "0.3 deg/sqrt(h)", "B": "10 deg/h", "T_B": "100 s", "K": "5 deg/h/sqrt(h)"},
    "accel": {"N": "60 ug/sqrt(Hz)", "B": "30 ug", "T_B": "60 s", "K": "100 ug/sqrt(h)"},
}
CHANNELS = [f"{quantity}_{axis}" for quantity in TRUTH for axis in "xyz"]
SCALED = ("adev", "lower", "upper", "value", "sigma")
OF_ALL = (
    "ranking",
    "shortlist",
    "repeatability",
    "fusion",
    "catalogue",
    "coverage",
    "coverage_by_vendor",
    "pooled",
    "drift",
)


def one_recording(folder: Path) -> Path:
    """Run the workflow on one simulated recording; return its results."""
    sensors = folder / "sensors"
    sensors.mkdir()
    units = {"gyro": "rad/s", "accel": "m/s^2"}
    channels = {c: {"column": c, "unit": units[c.split("_")[0]]} for c in CHANNELS}
    log = {"rate": "50 Hz", "channels": channels}
    sheet = {
        "gyro": {"noise_density": {"value": 0.007, "unit": "deg/s/sqrt(Hz)"}},
        "accel": {"bias_instability": {"value": 20, "unit": "ug"}},
    }
    described = {"vendor": "Benchmark", "model": "one", "log": log, "datasheet": sheet}
    (sensors / "one.yaml").write_text(yaml.safe_dump(described))
    entry = {"sensor": "one", "recording": "sim_one", "duration": "4 h", "rate": "50 Hz"}
    made = entry | {
        "seed": 1,
        "source": "benchmark",
        "channels": {c: TRUTH[c.split("_")[0]] for c in CHANNELS},
    }
    (folder / "simulated.yaml").write_text(yaml.safe_dump({"recordings": [made]}))
    settings = [f"sensors={sensors}", f"results={folder / 'results'}", f"logs={folder / 'logs'}"]
    subprocess.run(
        [sys.executable, "-m", "snakemake", "-c2", "--quiet", "all", "--config", *settings,
         f"simulated={folder / 'simulated.yaml'}"],
        cwd=PROJECT, check=True,
    )  # fmt: skip
    return folder / "results"


def multiplied(results: Path, number: int) -> dict[str, pa.Table]:
    """Return the tables of many copies of the recording, and keep its samples for each."""
    rng = np.random.default_rng(1)
    factors = np.exp(0.03 * rng.standard_normal(number))
    names = [(f"sensor_{k % SENSORS:02d}", f"night_{k // SENSORS:03d}") for k in range(number)]
    tables = {}
    for table in TABLES:
        if table in OF_ONE_RECORDING:
            continue
        one = read(table, [results / f"tables/{table}.parquet"])
        if table in OF_ALL or not one.num_rows:
            tables[table] = one.slice(0, 0)
            continue
        tables[table] = pa.concat_tables(
            [
                _copy(one, *name, k, f)
                for k, (name, f) in enumerate(zip(names, factors, strict=True))
            ]
        )
    recommended = tables["parameters"].filter(tables["parameters"]["recommended"])
    rows = drift_rows(
        ParameterRow.rows_of(recommended),
        FixedBiasRow.rows_of(tables["fixed_bias"]),
        RecordingRow.rows_of(tables["recordings"]),
    )
    tables["drift"] = build("drift", rows)
    kept = results / "recordings/one/sim_one"
    compared = {table: read(table, [kept / f"{table}.parquet"]) for table in COMPARED}
    for (sensor, recording), factor in zip(names, factors, strict=True):
        target = results / "recordings" / sensor / recording
        target.mkdir(parents=True)
        for path in kept.glob("*.parquet"):
            if path.stem in (*OF_ONE_RECORDING, "log"):
                (target / path.name).hardlink_to(path)
        # Arrays that are alike stand in a page once.
        for table, one in compared.items():
            own = _copy(one, sensor, recording, 0, factor)
            write_arrow(own, target / f"{table}.parquet")
    return tables


def _copy(table: pa.Table, sensor: str, recording: str, number: int, factor: float) -> pa.Table:
    changed = {"sensor": sensor, "recording": recording}
    if "device" in table.column_names:
        changed |= {
            "device": f"unit {sensor}",
            "started": str(FIRST_NIGHT + timedelta(number // SENSORS)),
        }
    columns = []
    for name in table.column_names:
        column = table[name]
        if name in changed:
            column = pa.array([changed[name]] * table.num_rows, pa.string())
        elif name in ("adev", "lower", "upper", "value", "sigma") and pa.types.is_floating(
            column.type
        ):
            column = pa.array(column.to_numpy() * factor, from_pandas=True)
        columns.append(column)
    return pa.Table.from_arrays(columns, schema=table.schema)


def settings_of(results: Path) -> dict[str, Any]:
    """Return the settings of the run, with all sensors."""
    found: dict[str, Any] = json.loads((results / "report/settings.json").read_text())
    one = found["sensors"]["one"]
    names = [f"sensor_{k:02d}" for k in range(SENSORS)]
    return found | {"sensors": {name: one | {"model": name} for name in names}}


def opening(report: Path) -> Iterator[tuple[str, float, float, float]]:
    """Yield when a page can be read in Chromium, when its first figure is seen, and can be used."""
    from playwright.sync_api import sync_playwright

    pages = ["index.html", "sensors/sensor_00.html", "recordings/sensor_00/night_000.html"]
    pages += ["compare.html", "recordings.html"]
    with sync_playwright() as driver:
        root = ["--no-sandbox"] if os.geteuid() == 0 else []
        browser = driver.chromium.launch(
            executable_path=os.environ.get("PLAYWRIGHT_CHROMIUM") or shutil.which("chromium"),
            args=root,
        )
        for page in pages:
            tab = browser.new_page()
            start = time.perf_counter()
            tab.goto((report / page).as_uri(), wait_until="commit")
            tab.wait_for_function("document.documentElement?.dataset.ready === 'yes'")
            ready = time.perf_counter() - start  # what is packed is unfolded, too
            seen = drawn = ready
            if tab.locator("figure[data-kind]").count():
                tab.locator("figure[data-kind]").first.scroll_into_view_if_needed()
                tab.wait_for_selector("figure[data-drawn]")
                drawn = time.perf_counter() - start
                # The page itself notes when what it sketched is painted.
                painted = "performance.getEntriesByName('painted')[0].startTime"
                seen = tab.evaluate(painted) / 1000
            yield page, ready, seen, drawn
            tab.close()
        browser.close()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=300)
    parser.add_argument("--keep", type=Path, help="folder for the report, to look at it")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        results = one_recording(Path(name))
        tables = multiplied(results, given.recordings)
        settings = json.dumps(settings_of(results))
        report = given.keep or Path(name) / "report"

        def timed(what: str) -> None:
            start = time.perf_counter()
            written = publish(make_site(tables, settings, results), report, processes=2)
            print(f"{what}: {time.perf_counter() - start:.1f} s, {len(written)} files written")

        timed(f"{given.recordings} recordings x {len(CHANNELS)} channels")
        start = time.perf_counter()
        for draw in list_drawings(tables, "practical", report / "figures"):
            draw()
        print(f"figures for print, a step of their own: {time.perf_counter() - start:.1f} s")
        files = [path for path in report.rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files) / 1e6
        twins = sum(p.stat().st_size for p in (report / "figures").iterdir()) / 1e6
        print(f"{len(files)} files, {size:.1f} MB, of that {twins:.1f} MB figures for print")
        timed("nothing changed")
        scores = tables["scores"].to_pylist()
        scores[0]["rms_log10"] = 0.123
        tables["scores"] = build("scores", scores)
        timed("one recording changed")
        print(f"peak memory {peak_memory():.0f} MB")
        for page, read, seen, drawn in opening(report):
            print(
                f"{page} can be read after {read:.2f} s, its first figure is seen after "
                f"{seen:.2f} s and can be used after {drawn:.2f} s"
            )


if __name__ == "__main__":
    main()

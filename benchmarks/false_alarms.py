"""Findings in clean simulated logs, where there should be none.

python benchmarks/false_alarms.py [--logs 200] [--first 0] [--processes 2]

Each log has six channels, of sensors from quiet to noisy, with and without flicker noise and
random walk, and lasts from a quarter of an hour to three hours. A third has no register, others one
of 0.3 to 6 standard deviations of the noise, of which some are rounded again to few digits. That a
register is coarse is what is wanted, and counted apart.
"""

from __future__ import annotations

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

from imubench_pipeline.datasheets.plausibility import implausible
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.recordings.quality.columns import check_columns
from imubench_pipeline.recordings.quality.copies import find_copied_channels
from imubench_pipeline.recordings.quality.knocks import find_outlier_blocks
from imubench_pipeline.recordings.quality.levels import detect_quantisation, summarise_level
from imubench_pipeline.recordings.quality.rotation import detect_gravity_turn
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.tables.findings import Finding

GYROS = (
    NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7),
    NoiseModel(N=7e-4, B=1.8e-4, K=1e-5),
    NoiseModel(N=1e-4, K=3e-6),
    NoiseModel(N=1e-4, B=3e-4),
)
ACCELEROMETERS = (
    NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5),
    NoiseModel(N=4.5e-3, B=2.5e-3, K=3e-4),
    NoiseModel(N=1e-3, B=1e-3),
)
GRAVITY = (0.3, -0.2, 9.8)
UNITS = {"gyro": "rad/s", "acce": "m/s^2"}
REGISTERS = (0.0, 0.0, 0.3, 1.0, 3.0, 6.0)
"""Steps over the noise."""

DIGITS = (0.0, 0.0, 0.13, 0.41)
"""Digits over the step of the register."""


def of_log(number: int) -> list[Finding]:
    """Return the findings of one log, knocks among them."""
    rng = np.random.default_rng([number, 17])
    rate = float(rng.choice([20.0, 50.0, 100.0]))
    samples = int(rng.choice([0.25, 1.0, 3.0]) * 3600.0 * rate)
    gyro, accelerometer = rng.choice(len(GYROS)), rng.choice(len(ACCELEROMETERS))
    coarse, digits = float(rng.choice(REGISTERS)), float(rng.choice(DIGITS))
    columns: dict[str, ColumnSummary] = {}
    settings = QualitySettings()
    found = []
    for index, name in enumerate([f"{q}_{axis}" for q in ("gyro", "accel") for axis in "xyz"]):
        model = GYROS[gyro] if index < 3 else ACCELEROMETERS[accelerometer]
        log = simulate(model, rate, samples, rng)
        log += 0.01 * rng.standard_normal() if index < 3 else GRAVITY[index - 3]
        if coarse:
            step = coarse * model.N * np.sqrt(rate)
            log = np.round(log / step) * step
            log = np.round(log / (digits * step)) * (digits * step) if digits else log
        columns[name] = ColumnSummary()
        columns[name].add(log)
        steps = detect_quantisation(columns[name])
        if len(
            find_outlier_blocks(
                columns[name].blocks(), settings.knock, steps.step if steps else None
            )[0]
        ):
            found.append(Finding("knocks", "warning", f"{name}, {rate} Hz", 1, name))
    levels = {
        name: summarise_level(column, rate, UNITS[name[:4]]) for name, column in columns.items()
    }
    turn = detect_gravity_turn([columns[f"accel_{axis}"].blocks() for axis in "xyz"], rate)
    found += implausible(levels, turn, None)
    found += check_columns(columns, rate, settings)
    found += find_copied_channels(columns)
    of_register = {"coarse", "stuck"} if coarse >= 1.0 else set()
    return [f if f.finding not in of_register else replace(f, severity="note") for f in found]


def main() -> None:
    """Print how many logs have warnings and fatal findings, and which."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="number of the first of them")
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    with ProcessPoolExecutor(given.processes) as pool:
        logs = list(pool.map(of_log, range(given.first, given.first + given.logs)))
    for severity in ("fatal", "warning", "note"):
        touched = sum(any(f.severity == severity for f in found) for found in logs)
        names = Counter(f.finding for found in logs for f in found if f.severity == severity)
        print(f"{severity}: in {touched} of {given.logs} clean simulated logs {dict(names)}")
    for found in logs:
        for finding in found:
            if finding.severity != "note":
                print(f"  {finding.finding}: {finding.detail}")


if __name__ == "__main__":
    main()

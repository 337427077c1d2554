"""Results of other, trusted programs on the same data."""

import csv
from pathlib import Path

import numpy as np
import pyarrow.csv as pacsv
import pytest

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.allan.confidence import deviation_limits, equivalent_degrees


def test_adis16405_by_an_independent_program(shared: Path) -> None:
    log = pacsv.read_csv(shared / "logs/adis16405/imu1.csv.gz")
    with (shared / "oracles/adis16405_imu1_oadev.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 108
    for channel in log.column_names:
        chosen = [row for row in rows if row["channel"] == channel]
        sizes = [round(float(row["tau"]) * 100.0) for row in chosen]
        curve = allan_variance(log[channel].to_numpy(), 100.0, cluster_sizes=sizes)
        np.testing.assert_allclose(
            curve.deviation, [float(row["adev"]) for row in chosen], rtol=1e-5
        )


def stable32(path: Path) -> np.ndarray:
    """Columns: cluster size, tau, terms, noise type, lower, deviation, upper."""
    lines = path.read_text().splitlines()
    return np.array(
        [[float(v) for v in line.split()] for line in lines if line.strip()[:1].isdigit()]
    )


def phase_to_samples(path: Path) -> np.ndarray:
    return np.diff(np.loadtxt(path, comments="#"))  # numpy opens .gz by itself


@pytest.mark.parametrize(
    ("data", "result"),
    [
        ("phasedat/PHASE.DAT", "phasedat/phase_dat_oadev.txt"),
        ("phasedat/PHASE.DAT", "phasedat/phase_dat_oadev_octave.txt"),
        ("cs5071a/5071A_phase.txt.gz", "cs5071a/oadev_decade.txt"),
        ("ocxo/ocxo_frequency.txt", "ocxo/stable32_oadev_alltau.txt"),
    ],
)
def test_stable32(shared: Path, data: str, result: str) -> None:
    folder = shared / "oracles/stable32"
    rows = stable32(folder / result)
    if "frequency" in data:
        frequency = np.loadtxt(folder / data, comments="#")
        samples = (frequency - 10e6) / 10e6
    else:
        samples = phase_to_samples(folder / data)
    sizes = rows[:, 0].astype(int)
    curve = allan_variance(samples, 1.0, cluster_sizes=sizes)
    assert len(curve.tau) == len(rows)
    half_digit = 0.5e-4 * 10.0 ** np.floor(np.log10(rows[:, 5]))
    # Stable32 prints five digits; its own sums and ours may differ in the last of them
    np.testing.assert_array_less(np.abs(curve.deviation - rows[:, 5]), 1.02 * half_digit)


@pytest.mark.parametrize(
    ("data", "result", "fewest"),
    [
        ("phasedat/PHASE.DAT", "phasedat/phase_dat_oadev_octave.txt", 5),
        ("cs5071a/5071A_phase.txt.gz", "cs5071a/oadev_decade.txt", 8),
    ],
)
def test_limits_of_stable32_where_the_noise_type_is_the_same(
    shared: Path, data: str, result: str, fewest: int
) -> None:
    folder = shared / "oracles/stable32"
    rows = stable32(folder / result)
    curve = allan_variance(
        phase_to_samples(folder / data), 1.0, cluster_sizes=rows[:, 0].astype(int)
    )
    same = curve.exponent == rows[:, 3]
    assert same.sum() >= fewest
    lower, upper = curve.limits(0.683)
    width = (rows[:, 6] - rows[:, 4])[same]
    np.testing.assert_array_less(np.abs(lower - rows[:, 4])[same], 0.1 * width)
    np.testing.assert_array_less(np.abs(upper - rows[:, 6])[same], 0.1 * width)
    # and with Stable32's own noise types, at every tau
    edf = np.array(
        [
            equivalent_degrees(int(row[3]), int(row[0]), curve.samples - 2 * int(row[0]) + 1)
            for row in rows
        ]
    )
    lower, upper = deviation_limits(curve.deviation, edf, 0.683)
    width = rows[:, 6] - rows[:, 4]
    np.testing.assert_array_less(np.abs(lower - rows[:, 4]), 0.1 * width)
    np.testing.assert_array_less(np.abs(upper - rows[:, 6]), 0.1 * width)

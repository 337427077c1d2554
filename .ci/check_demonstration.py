"""Compare the demonstration's N with the truth that it was simulated from, and its filters."""

import sys
from pathlib import Path

import pyarrow.parquet as pq

tables = Path(sys.argv[1]) / "tables"
key = ("sensor", "recording", "channel", "parameter")
truth = {
    tuple(row[k] for k in key): row["value"]
    for row in pq.read_table(tables / "simulated_truth.parquet").to_pylist()
}
checked = 0
for row in pq.read_table(tables / "parameters.parquet").to_pylist():
    if not row["recommended"] or row["parameter"] != "N":
        continue
    error = row["value"] / truth[tuple(row[k] for k in key)] - 1
    print(f"{row['sensor']:12} {row['channel']:8} N {100 * error:+.3f} %")
    if abs(error) > 0.02:
        sys.exit("N is more than 2 % off")
    checked += 1
if checked != 38:
    sys.exit(f"{checked} channels, expected 38")

# Each requirement compares: it judges four sensors or more, some meet its limits and some do not.
MEET = {"meets", "likely_meets", "meets_if"}
FAIL = {"fails", "likely_fails", "cannot_meet"}
verdicts: dict[str, dict[str, str]] = {}
for row in pq.read_table(tables / "ranking.parquet").to_pylist():
    if row["decides"]:
        verdicts.setdefault(row["requirement"], {})[row["sensor"]] = row["verdict"]
for requirement, of_sensors in verdicts.items():
    judged = {name: verdict for name, verdict in of_sensors.items() if verdict in MEET | FAIL}
    print(f"{requirement:16} {len(judged)} judged: {judged}")
    if len(judged) < 4 or not MEET & {*judged.values()} or not FAIL & {*judged.values()}:
        sys.exit(f"{requirement} compares too little: {of_sensors}")

# A filter of the drives that has the true model is as sure as it says. The errors of the other
# sensors grow beyond what a linearised filter can tell, and their rows say so.
filters = {
    (row["sensor"], row["tuning"]): row
    for row in pq.read_table(tables / "navigation.parquet").to_pylist()
    if row["outage"] is None
}
for sensor in ("mti_7", "sirrs01_03", "scc2130_x25"):
    right, wrong = filters[sensor, "true"], filters[sensor, "times_ten"]
    print(f"{sensor:12} errors inside their 95 % in {100 * right['nees_inside']:.1f} %")
    if abs(right["nees_inside"] - 0.95) > 3 * right["nees_error"]:
        sys.exit("a filter with the true model is not as sure as it says")
    if not wrong["nees_gyro"] < 0.8 < right["nees_gyro"]:
        sys.exit("a filter that doubts the gyro tenfold is not told from the right one")

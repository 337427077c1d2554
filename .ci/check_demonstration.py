"""Compare the demonstration's N with the truth that it was simulated from."""

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
    if row["method"] != "likelihood" or row["parameter"] != "N":
        continue
    error = row["value"] / truth[tuple(row[k] for k in key)] - 1
    print(f"{row['sensor']:12} {row['channel']:8} N {100 * error:+.3f} %")
    if abs(error) > 0.02:
        sys.exit("N is more than 2 % off")
    checked += 1
if checked != 14:
    sys.exit(f"{checked} channels, expected 14")

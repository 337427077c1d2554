"""Check that a run analysed so many recordings, all of them."""

import sys
from pathlib import Path

import pyarrow.parquet as pq

rows = pq.read_table(Path(sys.argv[1]) / "tables/recordings.parquet").to_pylist()
for row in rows:
    print(row["sensor"], row["recording"], row["status"], row["reason"] or "")
if [row["status"] for row in rows] != ["ok"] * int(sys.argv[2]):
    sys.exit(f"expected {sys.argv[2]} recordings, all ok")

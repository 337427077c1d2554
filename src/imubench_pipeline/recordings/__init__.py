"""A recording: found, read in parts, put onto a time base, judged, and kept as Parquet in SI."""

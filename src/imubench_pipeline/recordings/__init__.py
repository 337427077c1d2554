"""Recordings: find and read logs, build time bases, check quality, store Parquet in SI."""

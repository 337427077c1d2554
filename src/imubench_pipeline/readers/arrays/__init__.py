"""Logs that are arrays or tables: MATLAB, NumPy, HDF5, Parquet and Feather."""

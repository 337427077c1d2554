"""Export noise models as input files of public filters and simulators.

A program has a pure function of an `imubench_pipeline.export.imu.Imu`, which describes the
convention of the program and cites its documentation. `targets` lists the programs; `request`
makes a file from the tables of a run.
"""

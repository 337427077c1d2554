"""What a filter or a simulator can load: noise models as files of public programs.

One module a program, each a pure function of an `imubench_pipeline.export.imu.Imu` with the
convention of its program and where it is documented; `targets` lists them, `request` makes a file
from the tables of a run.
"""

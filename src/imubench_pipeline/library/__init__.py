"""The Python interface: the functions and classes of ``import imubench_pipeline as imu``.

This package reads logs, arrays and tables of users (`logs`, `given`), calls the functions of the
workflow, and shows the results in engineers' units, as plots and as tables (`curves`, `estimates`,
`comparison`). It contains no calculations.
"""

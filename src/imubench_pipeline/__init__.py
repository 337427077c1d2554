"""Benchmark of inertial sensors: from static logs to a cross-IMU report.

Arrays and parameters are SI throughout: rad/s and m/s² for samples, s for times, Hz for
rates. A unit is converted once, where a file is read (`readers`) or a page is drawn
(`report`).
"""

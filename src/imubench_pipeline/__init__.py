"""Benchmark of inertial sensors: from static logs to a cross-IMU report.

Functions
---------
``import imubench_pipeline as imu`` gives

===========================  ======================================================================
imu.read_log(path, sensor)   a log of any format in SI, on a time base, with its findings
imu.allan_variance(data)     Allan curves with 95 % limits, of a log, an array or a table
imu.estimate(data)           noise parameters with 95 % intervals, status and reason, and models
imu.export(models, target)   input file of a filter or simulator; estimates have .export, too
imu.compare(a, b)            ratio of the noise of two logs
imu.simulate(model, rate)    samples of a noise model
imu.NoiseModel(N=, B=, ...)  Allan variance, spectrum and state space of a sum of noise terms
imu.convert(x, unit, to)     figures from one unit of a vendor to another
imu.__version__
===========================  ======================================================================

Units
-----
SI throughout: rad/s and m/s^2 for samples, s for times, Hz for rates, ordinary frequencies and
bandwidths, degC for temperatures. Spectral densities are two-sided, in SI^2/Hz. A unit is converted
once, where a file is read (`readers`, `settings`) or a page is drawn (`report`).

Names
-----
=============  ====================================================================================
gyro_x         a channel: quantity and axis; gyro_x to gyro_z, accel_x to accel_z
rate           sampling rate, Hz; its inverse is the sampling interval T
tau            cluster length, s; n samples are a cluster of n T
Q              angle or velocity quantization, rad or m/s
N              angle or velocity random walk, rad/sqrt(s) or m/s/sqrt(s)
B              bias instability as in IEEE Std 952: the curve's plateau is 0.664 B; rad/s, m/s^2
T_B            correlation time of the Gauss-Markov process that models B, s
K              rate or acceleration random walk, rad/s/sqrt(s) or m/s^2/sqrt(s)
R              rate or acceleration ramp, rad/s^2 or m/s^3
F, GM          flicker noise; a first-order Gauss-Markov process
B_curve        highest Allan deviation of all F and GM terms, over 0.664
sigma_min      lowest point of the curve, at tau_min
=============  ====================================================================================

Types
-----
`typing.Array` is an array of 64-bit floats: the samples of one channel have shape (n,), missing
ones are NaN. A row of a table has a class in `model`, with a field for each column. A log that is
longer than memory goes as an iterator of blocks, arrays of consecutive samples.

Packages
--------
From the lowest layer: `units`, `earth` and `typing`; `model` (the rows of every table); `settings`
(declarations of users), `allan` (the Allan variance), `tables` (columns, reading, writing), `noise`
(noise terms), `readers` (log files), `recordings` (logs, checked and stored), `estimators`
(parameters), `datasheets`, `simulate` (a whole sensor), `navigation` (errors in use), `report`,
`steps` (one module for each rule of the workflow), `library` (these functions), `run` (plan,
processes, commands) and `extensions`, such as `extensions.exports` (files for filters). Only
`report`, `steps` and `run` know both the files and the settings of a run. ``docs/architecture.md``
lists the permitted imports.

References
----------
.. [1] IEEE Std 952-2020 and IEEE Std 647: single-axis interferometric fibre optic gyros, and ring
   laser gyros; the noise terms and the Allan variance.
.. [2] J. A. Farrell, F. O. Silva, F. Rahman, J. Wendel, "Inertial Measurement Unit Error Modeling
   Tutorial", IEEE Control Systems Magazine 42(6), 2022.
.. [3] W. J. Riley, "Handbook of Frequency Stability Analysis", NIST Special Publication 1065, 2008.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from imubench_pipeline.extensions.exports.of_models import export
    from imubench_pipeline.library.comparison import compare
    from imubench_pipeline.library.curves import allan_variance
    from imubench_pipeline.library.estimates import estimate
    from imubench_pipeline.library.logs import read_log
    from imubench_pipeline.noise import NoiseModel
    from imubench_pipeline.simulate import simulate
    from imubench_pipeline.units import convert

    __version__: str

__all__ = [
    "NoiseModel",
    "__version__",
    "allan_variance",
    "compare",
    "convert",
    "estimate",
    "export",
    "read_log",
    "simulate",
]

_WHERE = {
    "NoiseModel": "noise",
    "allan_variance": "library.curves",
    "compare": "library.comparison",
    "convert": "units",
    "estimate": "library.estimates",
    "read_log": "library.logs",
}
"""The module of each name, imported on first use: numerics take a second to load."""


def __getattr__(name: str) -> Any:
    from importlib import import_module, metadata

    if name == "__version__":
        return metadata.version(__name__)
    if name == "simulate":
        return import_module(f"{__name__}.{name}")  # the package, which is called
    if name == "export":
        return import_module(f"{__name__}.registry").find_function(name)
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)

"""Write noise models as input files of filters and simulators."""

from collections.abc import Mapping
from pathlib import Path

from imubench_pipeline.extensions.exports.imu import AxisNoise, ExportError, Imu
from imubench_pipeline.extensions.exports.modes import Mode, apply_mode, choose_mode
from imubench_pipeline.extensions.exports.programs import Program
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.tables.files import write_content
from imubench_pipeline.units import parse_setting


def export(
    models: Mapping[str, NoiseModel],
    target: str,
    path: str | Path | None = None,
    *,
    rate: float | str,
    name: str = "sensor",
    mode: Mode | None = None,
    horizon: float | str = 60.0,
) -> str | bytes:
    """Return the input file of a filter or simulator for noise models.

    Parameters
    ----------
    models : mapping of str to NoiseModel
        Noise of ``gyro`` and ``accel``, SI; some programs take one of them.
    target : str
        The program, such as ``kalibr``; ``imubench formats`` lists all.
    path : str or Path, optional
        Where to write the file, too; a file there is replaced.
    rate : float or str
        Rate of the samples that the program gets: Hz, or ``"100 Hz"``.
    name : str
        Name of the sensor, for the comments.
    mode : {"bench", "in-use"}, optional
        The models as they are (bench), or at least the noise that the authors of the program use
        or recommend; by default ``in-use`` for programs that fly, else ``bench``.
    horizon : float or str
        Longest time without a measurement, s, for the replacement of terms that the program does
        not support.

    Returns
    -------
    str or bytes

    Raises
    ------
    ValueError
        If the program is not known or does not support the noise (`ExportError`), or a setting
        cannot be used.

    Examples
    --------
    >>> import imubench_pipeline as imu
    >>> gyro, accel = imu.NoiseModel(N=1e-4, K=1e-6), imu.NoiseModel(N=1e-3, K=2e-5)
    >>> text = imu.export({"gyro": gyro, "accel": accel}, "kalibr", rate="200 Hz")
    >>> "gyroscope_noise_density: 1.000000e-04" in text
    True
    """
    if unknown := set(models) - {"gyro", "accel"}:
        raise ValueError(f"models: found {min(unknown)!r}, expected only 'gyro' and 'accel'")
    if mode == "bounded":
        raise ValueError("mode 'bounded' needs a log; use the method export of its Estimates")
    program = find_target(target)
    axes = {
        key: AxisNoise(models[key], "a given model") for key in ("gyro", "accel") if key in models
    }
    built = Imu(
        sensor=name,
        rate=parse_setting(rate, "frequency", "rate"),
        estimated=axes,
        horizon=parse_setting(horizon, "time", "horizon"),
    )
    return write_file(program, apply_mode(built, program, choose_mode(mode, target)), path)


def find_target(target: str) -> Program:
    """Return a program by its name; ExportError names all if it is not known."""
    if target not in TARGETS:
        raise ExportError(f"target {target!r} is not known; there are: {', '.join(TARGETS)}")
    return TARGETS[target]


def write_file(program: Program, imu: Imu, path: str | Path | None) -> str | bytes:
    """Return the file of a program, and write it if there is a path."""
    content = program.write(imu)
    if path is not None:
        write_content(content, Path(path))
    return content

"""What an installation weighs, and how long it takes to a first number.

python benchmarks/installed.py [--wheel FILE] [--constraints FILE]

Makes an environment of a wheel, one with the workflow and one with all extras, adds up their files,
and times what a new user does first, in processes of their own: the import of the package, a
command that answers at once, and ``imubench analyse`` of six axes of an hour at 100 Hz, with no
compiled cache and with one. Times are of a whole process, and of this machine: compare them on a
quiet one.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

PROJECT = Path(__file__).resolve().parents[1]
HOURS, RATE = 1.0, 100.0
UNITS = ["--rate", "100 Hz", "--gyro-unit", "deg/s", "--accel-unit", "m/s^2"]


def main() -> None:
    """Print the sizes and times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wheel", type=Path, help="of this package; default: it is built")
    parser.add_argument(
        "--constraints",
        type=Path,
        default=PROJECT / "constraints.txt",
        help="the versions to install; default: those of %(default)s",
    )
    given = parser.parse_args()
    wheel: Path | None = given.wheel
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel = wheel or built(folder)
        for extras in ("", "[workflow]", "[all]"):
            environment = folder / f"venv{len(extras)}"
            subprocess.run([sys.executable, "-m", "venv", str(environment)], check=True)
            empty, begun = size(environment), time.monotonic()
            install(environment, f"{wheel}{extras}", given.constraints)
            took, weight = time.monotonic() - begun, size(environment) - empty
            print(
                f"pip install imubench_pipeline{extras}: {took:.0f} s, "
                f"{weight / 1e6:.0f} MB in site-packages"
            )
        python = environment / "bin/python"
        cache = {"NUMBA_CACHE_DIR": str(folder / "compiled")}
        log = folder / "run.csv"
        write_log(log)
        imubench = str(environment / "bin/imubench")
        for what, command in (
            ("import imubench_pipeline", [str(python), "-c", "import imubench_pipeline"]),
            ("imubench --version", [imubench, "--version"]),
            ("imubench analyse, first use", [imubench, "analyse", str(log), *UNITS]),
            ("imubench analyse, again", [imubench, "analyse", str(log), *UNITS]),
        ):
            wall, cpu = timed(command, cache)
            print(f"{what}: {wall:.2f} s, {cpu:.2f} s of CPU")


def built(folder: Path) -> Path:
    """Build the wheel of this checkout."""
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation",
         "--wheel-dir", str(folder), str(PROJECT)],
        check=True,
    )  # fmt: skip
    (wheel,) = folder.glob("*.whl")
    return wheel


def install(environment: Path, what: str, constraints: Path) -> None:
    """Install the package into an environment, in the versions that are tested."""
    subprocess.run(
        [str(environment / "bin/python"), "-m", "pip", "install", "--quiet", "--no-compile",
         "-c", str(constraints), what],
        check=True,
    )  # fmt: skip


def size(environment: Path) -> int:
    """Return the bytes of all packages, without what Python compiles of them when it runs."""
    (packages,) = environment.glob("lib/python*/site-packages")
    files = (path for path in packages.rglob("*") if path.is_file() and not path.is_symlink())
    return sum(path.stat().st_size for path in files if path.suffix != ".pyc")


def write_log(path: Path) -> None:
    """Write six axes of white noise with a walk."""
    rng = np.random.default_rng(1)
    samples = round(HOURS * 3600 * RATE)
    noise = rng.standard_normal((samples, 6)) * 0.05
    values = noise + np.cumsum(rng.standard_normal((samples, 6)) * 1e-5, axis=0)
    values[:, 5] += 9.81
    head = "gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(path, values, fmt="%.6f", delimiter=",", header=head, comments="")


def timed(command: list[str], variables: dict[str, str]) -> tuple[float, float]:
    """Return wall-clock and CPU time of a command, s."""
    before, begun = os.times(), time.monotonic()
    subprocess.run(command, check=True, capture_output=True, env=os.environ | variables)
    wall, after = time.monotonic() - begun, os.times()
    return wall, sum(after[i] - before[i] for i in (2, 3))


if __name__ == "__main__":
    main()

"""Modes of an exported file: as measured at rest, an upper bound, or the noise in use.

At rest a sensor has less noise than on a vehicle, and most filters need more than the Allan
variance says. ``bench`` is the noise at rest; ``bounded`` an upper bound of it (`overbound`);
``in-use`` is at least the broadband noise of a log in use or, without such a log, the values that
the authors of the program use or recommend.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from imubench_pipeline.extensions.exports import reasons as texts
from imubench_pipeline.extensions.exports.imu import AxisNoise, ExportError, Imu
from imubench_pipeline.extensions.exports.in_use import InUseNoise
from imubench_pipeline.extensions.exports.mapping import as_walk
from imubench_pipeline.extensions.exports.programs import Program

Mode = Literal["bench", "bounded", "in-use"]

Densities = Mapping[str, tuple[float, float]]  # N and K of gyro and accel, SI


@dataclass(frozen=True)
class Floor:
    """Least noise in use that a program's authors recommend; it applies without a log in use."""

    source: str
    factor: float = 1.0  # on all densities at rest
    gyro: tuple[float, float] = (0.0, 0.0)  # deviations per step: N and K over its root, SI
    accel: tuple[float, float] = (0.0, 0.0)
    step: float | None = None  # s; None: from one sample to the next

    def densities(self, rate: float) -> Densities:
        """Return the least N and K, SI, of each quantity for samples at a rate, Hz."""
        root = math.sqrt(self.step or 1.0 / rate)
        steps = {"gyro": self.gyro, "accel": self.accel}
        return {name: (N * root, K * root) for name, (N, K) in steps.items()}


_TIMES_10 = Floor(
    "10 times the noise at rest, the least that the documentation of OpenVINS recommends", 10.0
)
_TEN_TIMES = ("kalibr", "openvins", "basalt", "orb-slam3", "gtsam", "matlab-factor", "ceres")
_EKF2 = Floor("the defaults of EKF2", gyro=(0.015, 1e-3), accel=(0.35, 3e-3), step=0.01)

FLOORS: Mapping[str, Floor] = {
    **dict.fromkeys(_TEN_TIMES, _TIMES_10),
    "lio-sam": Floor(
        "the example configuration of LIO-SAM",
        gyro=(1.564e-3, 3.564e-5),
        accel=(3.994e-3, 6.436e-5),
        step=1.0,  # densities
    ),
    "fast-lio": Floor(
        "the example configurations of FAST-LIO",
        gyro=(math.sqrt(0.1), math.sqrt(1e-4)),
        accel=(math.sqrt(0.1), math.sqrt(1e-4)),
    ),
    "vins-fusion": Floor(
        "the example configurations of VINS-Fusion",
        gyro=(0.01 / math.sqrt(2.0), 1e-4),
        accel=(0.1 / math.sqrt(2.0), 1e-3),
    ),
    "px4": _EKF2,
    "px4-mavparm": _EKF2,
    "ardupilot": Floor("the defaults of EKF3", gyro=(0.015, 1e-3), accel=(0.35, 0.02), step=0.012),
}
"""Floors by target. Sources: rpng/open_vins, docs/gs-calibration.dox; HKUST-Aerial-Robotics/
VINS-Fusion, config/euroc/euroc_mono_imu_config.yaml; TixiaoShan/LIO-SAM, config/params.yaml;
hku-mars/FAST_LIO, config/avia.yaml; PX4-Autopilot, src/modules/ekf2 (parameters
EKF2_GYR_NOISE, EKF2_ACC_NOISE, EKF2_GYR_B_NOISE, EKF2_ACC_B_NOISE, at EKF2_PREDICT_US); ArduPilot,
libraries/AP_NavEKF3/AP_NavEKF3.cpp (GYRO_P_NSE_DEFAULT and so on, the same of all vehicles)."""

_MIN_RATIO_IN_USE = 1.2
"""Of the noise in use over the noise at rest: below it, the sensor was hardly in use."""

FLIGHT_TARGETS = frozenset({"px4", "px4-mavparm", "ardupilot"})
"""Programs that fly: noise at rest is written for them only if it is asked for."""


def choose_mode(mode: Mode | None, target: str) -> Mode:
    """Return ``mode``; if it is None, ``in-use`` for a program that flies, else ``bench``."""
    return mode or ("in-use" if target in FLIGHT_TARGETS else "bench")


def apply_mode(
    imu: Imu, target: Program, mode: Mode, measured: Mapping[str, InUseNoise] | None = None
) -> Imu:
    """Set the mode of an export: raise the noise if ``in-use``, and store the mode in words.

    ``measured`` is the noise of a log in use by channel. Raises ExportError in use without such a
    log, if the authors of the program recommend no noise either.
    """
    if mode != "in-use":
        return replace(imu, mode=texts.MODE_WORDS[mode])
    if measured is not None:
        floors = {
            quantity: (max(own.N for own in channels.values()), 0.0)
            for quantity in ("gyro", "accel")
            if (channels := {c: own for c, own in measured.items() if c.startswith(quantity)})
        }
        each = [
            texts.channel_in_use(channel, own.N, own.motion, own.lines)
            for channel, own in measured.items()
        ]
        words = texts.noise_in_use(next(iter(measured.values())).cutoff, each)
        if all(
            floors[name][0] < _MIN_RATIO_IN_USE * axis.model.N
            for name, axis in imu.axes.items()
            if name in floors
        ):
            words = f"{texts.NO_MORE_THAN_AT_REST} {words}"
        return _raise_to(imu, target, floors, 1.0, words)
    if target.name not in FLOORS:
        raise ExportError(
            f"the authors of {target.title} recommend no noise in use; add --in-use LOG, a log of "
            "the sensor with motors on or under way"
        )
    floor = FLOORS[target.name]
    words = texts.floor_in_use(floor.source)
    return _raise_to(imu, target, floor.densities(imu.rate), floor.factor, words)


def _raise_to(imu: Imu, target: Program, floors: Densities, factor: float, words: str) -> Imu:
    """Return the noise raised to densities N and K, or by a factor."""

    def raise_axis(axis: AxisNoise, quantity: str) -> AxisNoise:
        least_N, least_K = floors.get(quantity, (0.0, 0.0))
        model = axis.model.scaled(factor)
        notes = list(axis.notes)
        if least_K > 0.0 and target.family == "N+K":
            mapped = as_walk(model, imu.horizon, imu.rate)
            model = replace(mapped.model, K=max(mapped.model.K, least_K))
            notes += mapped.words
        model = replace(model, N=max(model.N, least_N))
        notes.insert(0, texts.raised(axis.model.N, model.N, model.K))
        each = {letter: raise_axis(one, quantity) for letter, one in axis.each.items()}
        limited = axis.slow_limited and model.K == axis.model.K
        return replace(axis, model=model, notes=notes, each=each, slow_limited=limited)

    raised = {name: raise_axis(axis, name) for name, axis in imu.estimated.items()}
    return replace(imu, estimated=raised, mode=words)

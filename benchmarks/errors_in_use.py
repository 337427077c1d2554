"""Error budgets in use against drives of a strapdown navigator, simulated step by step.

python benchmarks/errors_in_use.py [--runs 2000] [--settings 20]

Each setting has its own time, turn or change of speed, temperature, vibration and figures. Each run
draws the errors of a triad of gyros and accelerometers, which is at rest and is levelled, or
starts with turn-on biases and a known tilt; then it drives, and its measurements are integrated in
three dimensions. The simulation shares no code with the budgets. Compared are the 95 % quantiles of
the errors: radii of velocity and position, heading and the cross-track error of an odometer. The
vibration is a sine of random phase on each axis. The exit status is 1 if the rms difference is
above 5 %, or one above 15 %; 2,000 runs tell a quantile to 2 % (1 sigma).
"""

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from imubench_pipeline.model.states import Cause
from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.navigation.error_budget.in_use import Figure, Use
from imubench_pipeline.navigation.error_budget.parts import Quantity
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Uncalibrated
from imubench_pipeline.typing import Array

G = 9.80665
RATE = 100.0
WINDOW = 10.0
LARGEST_RMS, LARGEST = 0.05, 0.15
QUANTILE = 1.959964
QUANTITIES: tuple[Quantity, ...] = ("attitude", "heading", "velocity", "position", "cross_track")
GYRO: dict[Cause, float] = {
    "turn_on_bias": 1e-3,
    "temperature": 1e-5,
    "scale_factor": 2e-3,
    "scale_factor_temperature": 5e-5,
    "nonlinearity": 5e-4,
    "misalignment": 1e-3,
    "g_sensitivity": 2e-5,
    "vibration_rectification": 1e-7,
}
ACCEL: dict[Cause, float] = {
    "turn_on_bias": 0.01,
    "temperature": 5e-4,
    "scale_factor": 2e-3,
    "scale_factor_temperature": 5e-5,
    "nonlinearity": 5e-4,
    "misalignment": 1e-3,
    "vibration_rectification": 1e-5,
}
"""1 sigma, SI; each setting multiplies every figure by 0.1 to 3."""


@dataclass(frozen=True)
class Setting:
    """One drive and one sensor."""

    time: float
    use: Use
    gyro: dict[Cause, float]
    accel: dict[Cause, float]
    levelled: bool


def draw_settings(number: int) -> Iterator[Setting]:
    """Yield settings at random: turns at speed and straight drives, one after the other."""
    rng = np.random.default_rng(51)

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    for place in range(number):
        time = between(5.0, 60.0)
        use = Use(
            temperature_change=between(0.5, 10.0),
            vibration=between(0.1, 10.0),
            vibration_frequency=between(8.0, 20.0),
            over=time,
        )
        if place % 2:
            use = replace(use, speed_change=between(1.0, 20.0))
        else:
            # Each fourth turn is on the spot.
            speed = between(0.5, 10.0) if (place + 2) % 8 else 0.0
            use = replace(use, turns=between(0.3, 6.0), speed=speed)
        figures = [
            {cause: between(0.1, 3.0) * s for cause, s in of.items()} for of in (GYRO, ACCEL)
        ]
        yield Setting(time, use, figures[0], figures[1], levelled=place % 4 < 3)


def simulate(setting: Setting, runs: int, rng: np.random.Generator) -> dict[Quantity, Array]:
    """Return the absolute errors of all runs at the end."""
    use, step = setting.use, 1.0 / RATE
    steps = round(setting.time * RATE)
    step = setting.time / steps

    def draw(of: dict[Cause, float], cause: Cause, *shape: int) -> Array:
        return of[cause] * rng.standard_normal((runs, *shape))

    def draw_matrix(of: dict[Cause, float]) -> tuple[Array, Array]:
        """Return matrices of the scale factors at the beginning, and their change by kelvin."""
        diagonal = draw(of, "scale_factor", 3) + draw(of, "nonlinearity", 3)
        aslant = draw(of, "misalignment", 3, 3) * (1.0 - np.eye(3))
        change = draw(of, "scale_factor_temperature", 3)
        return aslant + diagonal[:, :, None] * np.eye(3), change[:, :, None] * np.eye(3)

    gyro_matrix, gyro_change = draw_matrix(setting.gyro)
    accel_matrix, accel_change = draw_matrix(setting.accel)
    sensitivity = draw(setting.gyro, "g_sensitivity", 3, 3)
    gyro_bias, accel_bias = (
        draw(setting.gyro, "turn_on_bias", 3),
        draw(setting.accel, "turn_on_bias", 3),
    )
    gyro_heat, accel_heat = (
        draw(setting.gyro, "temperature", 3),
        draw(setting.accel, "temperature", 3),
    )
    gyro_shaken = draw(setting.gyro, "vibration_rectification", 3) * use.vibration**2
    accel_shaken = draw(setting.accel, "vibration_rectification", 3) * use.vibration**2
    phase = rng.uniform(0.0, 2.0 * math.pi, (runs, 3))

    up = np.array([0.0, 0.0, G])
    at_rest = up + accel_matrix @ up + accel_bias
    attitude = Rotation.identity(runs)
    known_gyro, gravity = np.zeros((runs, 3)), up
    known_accel = np.zeros((runs, 3))
    if setting.levelled:
        known_gyro = gyro_bias
        axis = np.cross(at_rest, up)
        sine = np.linalg.norm(axis, axis=1)
        angle = np.arctan2(sine, at_rest @ up)
        attitude = Rotation.from_rotvec(axis / sine[:, None] * angle[:, None])
        gravity = np.linalg.norm(at_rest, axis=1)[:, None] * up / G
    velocity, position, way = np.zeros((runs, 3)), np.zeros((runs, 3)), np.zeros((runs, 2))
    speed = use.speed if use.turns else use.speed_change
    velocity[:, 0] = use.speed if use.turns else 0.0
    rate = use.turns / setting.time
    forward = use.speed_change / setting.time
    true_velocity, true_position, true_way = velocity[0].copy(), np.zeros(3), np.zeros(2)
    for place in range(steps):
        now = (place + 0.5) * step
        share = now / setting.time if setting.levelled else 1.0
        heated = use.temperature_change * share
        turned = rate * now
        force = np.array([forward, rate * speed if use.turns else 0.0, G])
        swing = (
            math.sqrt(2.0)
            * use.vibration
            * np.sin(2.0 * math.pi * use.vibration_frequency * now + phase)
        )
        omega = np.array([0.0, 0.0, rate])
        change = use.temperature_change  # the whole change, as in the budget
        read = omega + np.einsum("rij,j->ri", gyro_matrix + change * gyro_change, omega)
        moved = force - up + swing
        read += np.einsum("rij,rj->ri", sensitivity, moved) + gyro_bias + gyro_heat * heated
        read += gyro_shaken - known_gyro
        felt = force + np.einsum("rij,j->ri", accel_matrix, force)
        felt += np.einsum("rij,j->ri", change * accel_change, force - up)
        felt += accel_bias + accel_heat * heated + accel_shaken - known_accel
        half = attitude * Rotation.from_rotvec(read * (step / 2.0))
        acceleration = half.apply(felt) - gravity
        position += velocity * step + acceleration * (step**2 / 2.0)
        velocity += acceleration * step
        heading = np.arctan2(*half.as_matrix()[:, [1, 0], 0].T)
        way += speed * step * np.column_stack([np.cos(heading), np.sin(heading)])
        attitude = attitude * Rotation.from_rotvec(read * step)
        true_force = Rotation.from_euler("z", turned).apply(force) - up
        true_position += true_velocity * step + true_force * (step**2 / 2.0)
        true_velocity += true_force * step
        true_way += speed * step * np.array([math.cos(turned), math.sin(turned)])
    end = attitude.as_matrix()
    heading = np.arctan2(end[:, 1, 0], end[:, 0, 0]) - rate * setting.time
    return {
        "attitude": np.abs(end[:, 2, 1]),  # about the first axis of the vehicle
        "heading": np.abs((heading + math.pi) % (2.0 * math.pi) - math.pi),
        "velocity": np.linalg.norm((velocity - true_velocity)[:, :2], axis=1),
        "position": np.linalg.norm((position - true_position)[:, :2], axis=1),
        "cross_track": np.linalg.norm(way - true_way, axis=1),
    }


def compute_budget(setting: Setting, quantity: Quantity) -> float:
    """Return the 1 sigma of an error by its budget, in the plane where it is a radius."""
    figures = [
        {cause: Figure(sigma=sigma, origin="datasheet") for cause, sigma in of.items()}
        for of in (setting.gyro, setting.accel)
    ]
    use = setting.use if setting.use.turns else replace(setting.use, speed=setting.use.speed_change)
    switched_on = Uncalibrated(bias=None, on_time=WINDOW)
    start = (
        Start.calibrated(WINDOW) if setting.levelled else Start(gyro=switched_on, accel=switched_on)
    )
    nothing = NoiseModel()
    made = budget(
        quantity,
        setting.time,
        gyro=nothing,
        accel=nothing,
        start=start,
        use=use,
        gyro_figures=figures[0],
        accel_figures=figures[1],
    )
    return (made.to_radius(0.95) if quantity in ("velocity", "position") else made).total


def main() -> int:
    """Print the table; return 1 if the differences are too large."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--settings", type=int, default=20)
    given = parser.parse_args()
    print(
        "setting                                      error         budget     simulated  differs"
    )
    differences = []
    for place, setting in enumerate(draw_settings(given.settings)):
        errors = simulate(setting, given.runs, np.random.default_rng(place))
        use = setting.use
        motion = (
            f"{math.degrees(use.turns):3.0f} deg at {use.speed:4.1f} m/s"
            if use.turns
            else f"straight, +{use.speed_change:4.1f} m/s "
        )
        begin = "levelled" if setting.levelled else "turn-on"
        # The budget has the largest tilt of a turn, which is past after half of it.
        for quantity in QUANTITIES[use.turns > math.pi :]:
            simulated = float(np.quantile(errors[quantity], 0.95)) / QUANTILE
            closed = compute_budget(setting, quantity)
            if not closed:
                continue  # the odometer does not move
            difference = simulated / closed - 1.0
            differences.append(difference)
            line = f"{place + 1:2} {motion}, {setting.time:4.1f} s, {begin:8}  {quantity:11}"
            print(
                f"{line} {closed:10.4g}  {simulated:10.4g}  {100 * difference:+6.1f} %", flush=True
            )
    rms = math.sqrt(float(np.mean(np.square(differences))))
    largest = max(map(abs, differences))
    print(
        f"{len(differences)} errors, {given.runs} runs each: differences of {100 * rms:.1f} % "
        f"(rms), {100 * largest:.1f} % at most"
    )
    return int(rms > LARGEST_RMS or largest > LARGEST)


if __name__ == "__main__":
    sys.exit(main())

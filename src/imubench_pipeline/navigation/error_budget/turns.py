"""Errors of a vehicle that turns evenly at constant speed, as vectors in the horizontal plane.

The heading is psi = omega t until the turn ends after T, and the velocity v exp(i psi), with the
north axis real. Each function returns the error from a figure of 1, as a complex number: m + 1
integrations of an acceleration, as in `budget` (m = 0 velocity, 1 position); m = -1 is the angle.

- An error s of the scale factor of the upright gyro gives the heading error s psi, and so the
  acceleration error i s psi times the centripetal acceleration i omega v exp(i psi).
- A misalignment e turns the rate into the horizontal gyros, e omega exp(i psi): a tilt
  -i e (exp(i psi) - 1), which projects gravity.
- An error of an accelerometer is that part of the centripetal acceleration.
"""

import cmath
from dataclasses import dataclass

from imubench_pipeline.earth import STANDARD_GRAVITY


@dataclass(frozen=True)
class Turn:
    """An even turn by an angle above 0, rad, in a time, s, at a speed, m/s."""

    angle: float
    over: float
    speed: float

    def _split(self, time: float) -> tuple[float, complex, float, float]:
        """Return the heading, its unit vector, the rate, and the time since the end of the turn."""
        turned = self.angle * min(time / self.over, 1.0)
        return turned, cmath.exp(1j * turned), self.angle / self.over, max(time - self.over, 0.0)

    def scale_factor(self, order: int, time: float) -> complex:
        """Return the velocity or position error from a scale factor of the upright gyro."""
        psi, unit, rate, after = self._split(time)
        velocity = -self.speed * ((psi / 1j + 1.0) * unit - 1.0)
        if order == 0:
            return velocity
        position = self.speed / rate * (psi * (unit + 1.0) + 2j * (unit - 1.0))
        return position + velocity * after

    def misalignment(self, order: int, time: float) -> complex:
        """Return the tilt, velocity or position error from a misalignment of the gyros."""
        psi, unit, rate, after = self._split(time)
        tilt = -1j * (unit - 1.0)
        if order < 0:
            return tilt
        velocity = STANDARD_GRAVITY / rate * (1.0 - unit + 1j * psi)
        pull = STANDARD_GRAVITY * tilt * after
        if order == 0:
            return velocity + pull
        position = STANDARD_GRAVITY / rate**2 * (psi + 1j * (unit - 1.0) + 0.5j * psi**2)
        return position + velocity * after + pull * after / 2.0

    def accelerometer(self, order: int, time: float) -> complex:
        """Return the velocity or position error from a scale factor of the accelerometers."""
        psi, unit, rate, after = self._split(time)
        velocity = self.speed * (unit - 1.0)
        if order == 0:
            return velocity
        return self.speed / rate * ((unit - 1.0) / 1j - psi) + velocity * after

    def cross_track(self, time: float) -> complex:
        """Return the position error of a vehicle with odometer from a scale factor of its gyro."""
        psi, unit, rate, after = self._split(time)
        position = 1j * self.speed / rate * (psi * unit / 1j + unit - 1.0)
        return position + 1j * self.speed * psi * unit * after

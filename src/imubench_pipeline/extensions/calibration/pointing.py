"""The Earth's rate along an axis of fully or partly known direction.

With latitude L, heading h (from north towards east) and elevation e (above the horizon) the axis
senses

    w = w_ie (cos(L) cos(e) cos(h) + sin(L) sin(e)).

Heading and elevation are normal about the stated angles: E[cos x] = cos(m) e^(-s^2/2). For an
unknown heading, w has the U-shaped distribution of the sine of a uniform angle, whose standard
deviation is the half width over sqrt(2) (JCGM 101:2008, 6.4.6).
"""

import math
from dataclasses import dataclass

from imubench_pipeline.earth import EARTH_RATE


@dataclass(frozen=True, kw_only=True)
class Pointing:
    """Direction of a sensitive axis, rad, with standard deviations; ValueError if out of range."""

    latitude: float  # north positive
    heading: float | None  # of the horizontal part, from north towards east; None: not known
    elevation: float = 0.0  # above the horizon: 0 level, pi/2 up, -pi/2 down
    heading_sigma: float = 0.0
    elevation_sigma: float = 0.0

    def __post_init__(self) -> None:
        if not abs(self.latitude) <= math.pi / 2.0:
            raise ValueError(f"latitude is {self.latitude}, expected -pi/2 to pi/2, in rad")
        for name in ("heading", "elevation"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{name} is {value}, expected a finite angle, in rad")
        for name in ("heading_sigma", "elevation_sigma"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} is {value}, expected a finite number, 0 or more")

    @property
    def rate(self) -> float:
        """Mean of the Earth's rate along the axis, rad/s."""
        return self._moments()[0]

    @property
    def rate_sigma(self) -> float:
        """Standard deviation of `rate` due to the uncertain direction, rad/s."""
        mean, square = self._moments()
        return math.sqrt(max(square - mean**2, 0.0))

    @property
    def half_width(self) -> float:
        """Half of the range of the rate over all headings, rad/s: w_ie cos(L) |cos(e)|."""
        return EARTH_RATE * math.cos(self.latitude) * abs(math.cos(self.elevation))

    @property
    def tilt_sigma(self) -> float:
        """Effect of ``elevation_sigma`` on the rate at the worst heading, to first order, rad/s."""
        most = abs(math.cos(self.latitude) * math.sin(self.elevation))
        most += abs(math.sin(self.latitude) * math.cos(self.elevation))
        return EARTH_RATE * most * self.elevation_sigma

    def _moments(self) -> tuple[float, float]:
        level, up = EARTH_RATE * math.cos(self.latitude), EARTH_RATE * math.sin(self.latitude)
        if self.heading is None:
            cos_h, cos2_h = 0.0, 0.5
        else:
            cos_h = math.cos(self.heading) * math.exp(-(self.heading_sigma**2) / 2.0)
            cos2_h = _cos_squared(self.heading, self.heading_sigma)
        e, s = self.elevation, self.elevation_sigma
        half, twice = math.exp(-(s**2) / 2.0), math.exp(-2.0 * s**2)
        cos2_e = _cos_squared(e, s)
        mean = level * cos_h * math.cos(e) * half + up * math.sin(e) * half
        square = (
            level**2 * cos2_h * cos2_e
            + level * up * cos_h * math.sin(2.0 * e) * twice
            + up**2 * (1.0 - cos2_e)
        )
        return mean, square


def _cos_squared(mean: float, sigma: float) -> float:
    """Return E[cos^2 x] of a normal angle."""
    return 0.5 * (1.0 + math.cos(2.0 * mean) * math.exp(-2.0 * sigma**2))

"""Effect of the Earth on a sensor at rest: rate of rotation, and gravity."""

EARTH_RATE = 7.292115e-5
"""w_ie, rad/s (WGS 84)."""

STANDARD_GRAVITY = 9.80665
"""m/s² in one g."""

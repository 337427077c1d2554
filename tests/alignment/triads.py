"""Triads and places that the tests of alignment share."""

import math

from imubench_pipeline.extensions.calibration.alignment.attitude import matrix
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Site, Triad
from imubench_pipeline.noise import NoiseModel

SITE = Site(latitude=-0.4, gravity=9.79)
ATTITUDE = matrix(0.3, -0.2, 1.1)

GYRO = NoiseModel(N=2e-6, B=5e-8, T_B=200.0, K=1e-9)
ACCELEROMETER = NoiseModel(N=1e-3, B=2e-4, T_B=100.0)
ALIKE = Triad(
    gyros=[GYRO] * 3, accelerometers=[ACCELEROMETER] * 3, gyro_bias=1e-6, accelerometer_bias=5e-3
)
UNLIKE = Triad(
    gyros=(GYRO, NoiseModel(N=4e-6, K=1e-8), NoiseModel(Q=1e-6, N=1e-6, B=1e-7)),
    accelerometers=(ACCELEROMETER, NoiseModel(N=3e-3, K=1e-5), NoiseModel(N=1e-3, B=1e-4)),
    gyro_bias=1e-6,
    accelerometer_bias=5e-3,
)
ONE = Positions.at_rest(600.0, 20.0, 10.0)
TWO = Positions.turned_about_z([0.0, math.pi], dwell=300.0, turning=10.0, block=20.0, rate=10.0)
FOUR = Positions.turned_about_z(
    [0.0, math.pi, 0.5 * math.pi, -0.5 * math.pi], dwell=150.0, turning=5.0, block=15.0, rate=10.0
)
POSITIONS = {"one": ONE, "two": TWO, "four": FOUR}

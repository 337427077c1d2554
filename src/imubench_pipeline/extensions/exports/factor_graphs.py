"""Factor graphs with preintegrated measurements: white noise N and random walk K of each axis."""

from imubench_pipeline.extensions.exports import programs
from imubench_pipeline.extensions.exports.imu import ExportError, Imu

GTSAM = programs.declare(
    "gtsam",
    "GTSAM",
    "gtsam_imu.py",
    "https://github.com/borglab/gtsam/blob/HEAD/gtsam/navigation/PreintegrationCombinedParams.h",
    "Covariances are densities N^2 and K^2: continuous in time, two-sided, SI. GTSAM divides N^2 "
    "by the interval of the samples, and multiplies K^2 by it.",
    (programs.WHITE_DENSITY, "setGyroscopeCovariance", "setAccelerometerCovariance"),
    (programs.WALK_DENSITY, "setBiasOmegaCovariance", "setBiasAccCovariance"),
    each=True,
    positive=True,
    line="    params.{name}(np.diag([{xyz}]))  # {about}",
    layout=programs.PYTHON_HEAD
    + '''
import gtsam
import numpy as np


def make_params(z_up=True):
    """Return the parameters for a navigation frame with z up (ENU) or down (NED)."""
    kind = gtsam.PreintegrationCombinedParams
    params = (kind.MakeSharedU if z_up else kind.MakeSharedD)({gravity})  # m/s^2
{lines}    params.setIntegrationCovariance(1e-7**2 * np.eye(3))  # of GTSAM's examples
    if hasattr(params, "setBiasAccOmegaInit"):
        params.setBiasAccOmegaInit(np.zeros((6, 6)))  # it acts as white noise
    return params
''',
)
"""``make_params()`` is for all preintegration of GTSAM.

``PreintegrationCombinedParams`` are ``PreintegrationParams``, too. A step of dt adds N^2 dt to the
variance of angle and velocity, and K^2 dt to the one of a bias. ``integrationCovariance`` is no
figure of the sensor, but the one of GTSAM's examples. ``biasAccOmegaInt`` (in versions with
``setBiasAccOmegaInit``) acts as white noise of its density, by default (1 rad/s)^2/Hz. It is 0, as
the prior of the graph has the uncertainty of the first bias.

Sources: borglab/gtsam, gtsam/navigation/PreintegrationParams.h and PreintegrationCombinedParams.h
("continuous-time"), CombinedImuFactor.cpp and ImuFactor.cpp (``integrateMeasurement``),
python/gtsam/examples/CombinedImuFactorExample.py (1e-7).
"""

CERES = programs.declare(
    "ceres",
    "C++ (Ceres)",
    "imu_noise.hpp",
    "https://doi.org/10.1109/TRO.2016.2597321",
    "N and K: continuous in time, two-sided, SI. Covariance of one step of dt seconds: N^2 dt of "
    "an angle or velocity, and K^2 dt of a bias. A program that multiplies noise of samples by dt "
    "gets the variances N^2 / dt and K^2 / dt. If it takes the two ends of a midpoint step as "
    "independent, as VINS-Mono does, it gets 2 N^2 / dt.",
    (programs.WHITE, "kGyroNoiseDensity", "kAccelNoiseDensity"),
    (programs.WALK, "kGyroRandomWalk", "kAccelRandomWalk"),
    each=True,
    mark="//",
    line="inline constexpr double {name}[3] = {{{xyz}}};  // {about}",
    # The empty line: a comment that ends with a backslash goes on in the next line.
    layout="{head}\n#pragma once\n\nnamespace imu_noise {{\n"
    "inline constexpr double kRate = {imu.rate!r};  // Hz\n"
    "inline constexpr double kGravity = {gravity};  // m/s^2\n"
    "{lines}}}  // namespace imu_noise\n",
)
"""A header of C++ 17 for preintegration that is optimised by Ceres.

Sources: C. Forster et al., "On-Manifold Preintegration for Real-Time Visual-Inertial Odometry",
IEEE Transactions on Robotics 33 (2017) (covariance of discrete noise: of continuous noise over dt);
HKUST-Aerial-Robotics/VINS-Mono, vins_estimator/src/factor/integration_base.h (midpoint).
"""

_MIN_MATLAB_RATE = 100.0  # Hz, of SampleRate


def write_matlab_factor(imu: Imu) -> str:
    """Return a script that creates ``factorIMUParameters`` of MATLAB's Navigation Toolbox.

    Raises ExportError below 100 Hz, the lowest SampleRate.

    Sources: MathWorks, reference page of factorIMUParameters (names, vectors, SampleRate); C++ code
    generated for factorGraph, imu_factor.cpp (``preOptimizationUpdate``: GyroscopeNoise/DeltaT,
    SumDeltaT*GyroscopeBiasNoise).
    """
    if imu.rate < _MIN_MATLAB_RATE:
        raise ExportError(
            f"the rate is {imu.rate:g} Hz, but factorIMUParameters needs a SampleRate of "
            f"{_MIN_MATLAB_RATE:g} Hz or more; if you interpolate the samples, state the new rate "
            "(--rate)"
        )
    return programs.fill_layout(imu, MATLAB_FACTOR)


MATLAB_FACTOR = programs.declare(
    "matlab-factor",
    "MATLAB (factorIMU)",
    "imu_factor.m",
    "https://www.mathworks.com/help/nav/ref/factorimuparameters.html",
    "Covariances are densities N^2 and K^2: continuous in time, two-sided, SI. The reference page "
    "gives (rad/s)^2 and (m/s^2)^2 as units, but the program itself divides the noise by the "
    "interval of the samples, and multiplies the bias noise by the time between two nodes.",
    (programs.WHITE_DENSITY, "GyroscopeNoise", "AccelerometerNoise"),
    (programs.WALK_DENSITY, "GyroscopeBiasNoise", "AccelerometerBiasNoise"),
    each=True,
    positive=True,
    mark="%",
    line="    {name}=[{xyz}], ...  % {about}",
    layout="{head}IMU = factorIMUParameters( ...\n{lines}    SampleRate={imu.rate:.9g});  % Hz\n",
    writer=write_matlab_factor,
)

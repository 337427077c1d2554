"""Values computed by hand, from papers and from datasheets that print a figure in two ways."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.settings.printed import (
    Sidedness,
    compute_noise_bandwidth,
    convert_density,
    convert_power_density,
    noise_of_rms,
)
from imubench_pipeline.units import convert_from_si, convert_to_si


def in_deg_per_root_hour(N: float) -> float:
    return convert_from_si(N, "°/√h", "gyro_density")


@pytest.mark.parametrize(("sidedness", "arw"), [("two-sided", 2.0), ("one-sided", 1.414213562)])
def test_engers_equations_6_to_8(sidedness: Sidedness, arw: float) -> None:
    # √14400 / 60 = 120 / 60 = 360 / √9 / 60 = 2; as printed they hold for a two-sided spectrum
    power = convert_to_si(14400.0, "(°/h)²/Hz", "gyro_power_density")
    amplitude = convert_to_si(120.0, "°/h/√Hz", "gyro_density")
    sigma = convert_to_si(360.0, "°/h", "angular_rate")
    for N in (
        convert_power_density(power, sidedness),
        convert_density(amplitude, sidedness),
        noise_of_rms(sigma, 9.0, sidedness),
    ):
        assert in_deg_per_root_hour(N) == pytest.approx(arw, rel=1e-9)


@pytest.mark.parametrize(
    ("density", "arw"),
    [(0.008, 0.339411255), (0.005, 0.212132034), (0.004, 0.169705627), (0.0135, 0.572756493)],
)
def test_one_sided_densities_in_degrees_by_root_hour(density: float, arw: float) -> None:
    N = convert_density(convert_to_si(density, "°/s/√Hz", "gyro_density"), "one-sided")
    assert in_deg_per_root_hour(N) == pytest.approx(arw, rel=1e-8)


@pytest.mark.parametrize(
    ("rms", "bandwidth", "density"),
    [(0.1, 47.0, 0.014586499), (0.028, 100.0, 0.0028), (0.05, 100.0, 0.005)],
)
def test_an_rms_over_a_bandwidth_is_a_one_sided_density(
    rms: float, bandwidth: float, density: float
) -> None:
    # BNO055, ICM-42688-P, MPU-6050
    assert noise_of_rms(rms, bandwidth) * 1.414213562 == pytest.approx(density, rel=1e-7)


def test_noise_bandwidths() -> None:
    assert compute_noise_bandwidth(100.0) == 100.0
    assert compute_noise_bandwidth(100.0, "first-order") == pytest.approx(157.079633, rel=1e-8)
    assert compute_noise_bandwidth(100.0, "second-order") == pytest.approx(111.072073, rel=1e-8)


@pytest.mark.parametrize(("poles", "filter_"), [(1, "first-order"), (2, "second-order")])
def test_noise_bandwidths_are_those_of_the_filters(poles: int, filter_: str) -> None:
    # the integral of 1 / (1 + f^2n) from 0 is (π/2n) / sin(π/2n)
    exact = (math.pi / 2 / poles) / math.sin(math.pi / 2 / poles)
    assert compute_noise_bandwidth(1.0, filter_) == pytest.approx(exact)  # type: ignore[arg-type]  # one of the filters, as text


@pytest.mark.parametrize("bandwidth", [0.0, -1.0])
def test_a_bandwidth_is_above_zero(bandwidth: float) -> None:
    with pytest.raises(ValueError, match="expected more than 0"):
        noise_of_rms(1.0, bandwidth)
    with pytest.raises(ValueError, match="expected 0 or more"):
        convert_power_density(bandwidth - 1.0, "one-sided")


@given(st.floats(1e-9, 1e3), st.floats(1e-3, 1e4))
def test_rms_and_density_there_and_back(N: float, bandwidth: float) -> None:
    rms = N * math.sqrt(2.0 * bandwidth)
    assert noise_of_rms(rms, bandwidth) == pytest.approx(N)
    one_sided = N * math.sqrt(2.0)
    assert convert_power_density(one_sided**2, "one-sided") == pytest.approx(N)

import pytest

from imubench_pipeline.extensions.exports.imu import (
    AxisNoise,
    ExportError,
    Imu,
    split_axes,
)
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from tests.exports.sensors import EACH, GYRO, imu, imu_of_each, write_text


def test_inflation_is_of_densities_and_amplitudes_and_not_of_times() -> None:
    model = NoiseModel(
        Q=1.0, N=2.0, B=3.0, T_B=4.0, K=5.0, R=-6.0, further=[GaussMarkov(7.0, 8.0)],
        sinusoids=[Sinusoid(9.0, 10.0)],
    )  # fmt: skip
    assert model.scaled(2.0) == NoiseModel(
        Q=2.0, N=4.0, B=6.0, T_B=4.0, K=10.0, R=-12.0, further=(GaussMarkov(14.0, 8.0),),
        sinusoids=(Sinusoid(18.0, 10.0),),
    )  # fmt: skip


def test_an_inflation_needs_a_reason_and_the_file_gives_it() -> None:
    with pytest.raises(ExportError, match="needs a reason"):
        imu(inflation=1.5)
    with pytest.raises(ExportError, match="needs a reason"):
        imu(inflation=1.5, because=" ")
    text = write_text("kalibr", imu(inflation=1.5, because="vibration in flight")).replace(
        "\n#  ", ""
    )
    assert "1.5 times" in text
    assert "vibration in flight" in text
    assert f"gyroscope_noise_density: {1.5 * GYRO.N:.6e}" in text


@pytest.mark.parametrize(
    "wrong", [{"rate": 0.0}, {"horizon": -1.0}, {"inflation": float("nan")}, {"horizon": 0.03}]
)
def test_numbers_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ExportError):
        imu(**wrong)  # type: ignore[arg-type]  # wrong on purpose


def test_a_program_that_needs_both_says_what_is_missing() -> None:
    alone = Imu(sensor="one", rate=100.0, estimated={"gyro": AxisNoise(GYRO, "gyro_x")})
    with pytest.raises(ExportError, match="one: no estimate of accel"):
        write_text("kalibr", alone)


def test_simulated_recordings_are_called_so() -> None:
    assert "SIMULATED" in write_text("kalibr", imu(simulated=True))
    assert "SIMULATED" not in write_text("kalibr", imu())


def test_an_inflation_is_of_each_axis() -> None:
    axes = split_axes(imu_of_each(inflation=2.0, because="test").axes)
    assert list(axes) == ["gyro x", "gyro z", "gyro", "accel x", "accel y", "accel z"]
    for name, axis in axes.items():
        quantity, letter = (name + " z").split()[:2]
        assert axis.model.N == 2.0 * EACH[quantity][letter].N

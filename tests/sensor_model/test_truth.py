import math
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import CURVE
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.settings.simulated_sensor import AxisSettings
from imubench_pipeline.simulate.models import TrueFigure, list_true_figures, make_axis_model
from imubench_pipeline.simulate.simulation import simulate
from tests.conftest import few

DEGREE = math.pi / 180
AXIS: dict[str, Any] = {
    "N": "0.36 deg/sqrt(h)",
    "B": "36 deg/h",
    "T_B": "100 s",
    "K": "2 deg/h/sqrt(h)",
    "R": "1 deg/h/h",
    "Q": "1e-4 deg",
    "bias": "-5 deg/s",
    "further": [{"B": "72 deg/h", "T_B": "5 s"}, {"B": "18 deg/h", "T_B": "20 min"}],
    "sinusoids": [{"amplitude": "0.1 deg/s", "frequency": "30 mHz"}],
    "drift": {
        "sensitivity": "0.015 deg/s/K", "quadratic": "1e-3 deg/s/K^2", "reference": "298.15 K",
        "lag": "5 min",
    },
    "low_pass": {"cutoff": "64 Hz"},
    "resolution": "0.0625 deg/s",
    "full_scale": "2000 deg/s",
}  # fmt: skip


def figures(channel: str = "gyro_x", rate: float = 100.0, **settings: Any) -> list[TrueFigure]:
    return list(list_true_figures(AxisSettings.model_validate(settings), channel, rate))


def named(found: list[TrueFigure]) -> dict[str, TrueFigure]:
    """Figures by name, with the component behind it where there are several."""
    names = [one.name for one in found]
    return {
        one.name if names.count(one.name) == 1 else f"{one.name} {one.component}": one
        for one in found
    }


def test_every_figure_has_its_si_value_and_unit() -> None:
    found = named(figures(**AXIS))
    x = math.pi * 0.64
    rounding = (0.0625 * DEGREE) ** 2 / (12 * 100)
    n = math.sqrt((0.006 * DEGREE) ** 2 * x / math.tanh(x) + rounding)
    expected = {
        "N_sensor": (0.006 * DEGREE, "rad/s/sqrt(Hz)"),
        "Q": (1e-4 * DEGREE, "rad"),
        "K": (2 * DEGREE / 3600 / 60, "rad/s/sqrt(s)"),
        "R": (DEGREE / 3600**2, "rad/s^2"),
        "bias": (-5 * DEGREE, "rad/s"),
        "B 1": (0.02 * DEGREE, "rad/s"),
        "T_B 1": (5.0, "s"),
        "B 2": (0.01 * DEGREE, "rad/s"),
        "T_B 2": (100.0, "s"),
        "B 3": (0.005 * DEGREE, "rad/s"),
        "T_B 3": (1200.0, "s"),
        "amplitude": (0.1 * DEGREE, "rad/s"),
        "frequency": (0.03, "Hz"),
        "sensitivity": (0.015 * DEGREE, "rad/s/K"),
        "quadratic": (1e-3 * DEGREE, "rad/s/K^2"),
        "reference": (25.0, "degC"),
        "lag": (300.0, "s"),
        "cutoff": (64.0, "Hz"),
        "N": (n, "rad/s/sqrt(Hz)"),
    }
    values = {name: one.value for name, one in found.items()}
    assert values == pytest.approx({name: value for name, (value, _) in expected.items()}, rel=1e-4)
    assert {name: one.unit for name, one in found.items()} == {
        name: unit for name, (_, unit) in expected.items()
    }


def test_the_setting_of_a_figure_is_one_that_can_be_assumed() -> None:
    for one in figures(**AXIS):
        assert one.setting in AXIS
    settings = {name: one.setting for name, one in named(figures(**AXIS)).items()}
    assert settings["B 1"] == settings["T_B 3"] == "further"
    assert settings["B 2"] == settings["T_B 2"] == "B"
    assert settings["cutoff"] == "low_pass" and settings["N_sensor"] == "N"
    assert settings["sensitivity"] == "drift" and settings["amplitude"] == "sinusoids"


def test_an_accelerometer_has_its_units() -> None:
    found = named(figures("accel_z", N="100 ug/sqrt(Hz)", drift={"sensitivity": "1 mg/K"}))
    assert found["N"].value == pytest.approx(9.80665e-4)
    assert found["N"].unit == "m/s^2/sqrt(Hz)"
    assert found["sensitivity"].value == pytest.approx(9.80665e-3)
    assert found["sensitivity"].unit == "m/s^2/K"


def test_without_a_filter_the_n_of_the_log_is_that_of_the_settings() -> None:
    found = figures(N="0.6 deg/sqrt(h)")
    assert [one.name for one in found] == ["N"]
    assert found[0].value == pytest.approx(0.01 * DEGREE, rel=1e-12)


@pytest.mark.parametrize("rate", [50.0, 500.0])
def test_the_n_of_the_log_depends_on_its_rate(rate: float) -> None:
    found = named(figures(N="0.6 deg/sqrt(h)", low_pass={"cutoff": "60 Hz"}, rate=rate))
    x = math.pi * 60 / rate
    shown = 0.01 * DEGREE * math.sqrt(x / math.tanh(x))
    assert found["N"].value == pytest.approx(shown, rel=1e-4)
    assert found["N_sensor"].value == pytest.approx(0.01 * DEGREE, rel=1e-12)


def test_flicker_noise_comes_first_then_processes_by_their_time() -> None:
    further = [{"B": "2 deg/h", "T_B": "50 s"}, {"B": "3 deg/h", "T_B": "5 s"}]
    found = [one for one in figures(B="1 deg/h", further=further) if one.name in ("B", "T_B")]
    assert [(one.name, one.component) for one in found] == [
        ("B", 1), ("B", 2), ("T_B", 2), ("B", 3), ("T_B", 3)
    ]  # fmt: skip
    assert [one.value for one in found if one.name == "B"] == pytest.approx(
        [DEGREE / 3600, 3 * DEGREE / 3600, 2 * DEGREE / 3600]
    )
    assert [one.value for one in found if one.name == "T_B"] == pytest.approx([5.0, 50.0])


def test_lines_are_numbered_on_their_own_by_their_frequency() -> None:
    lines = [{"amplitude": f"{a} deg/s", "frequency": f"{f} Hz"} for a, f in ((1, 3), (2, 1))]
    found = [one for one in figures(B="1 deg/h", sinusoids=lines) if one.name == "frequency"]
    assert [(one.component, one.value) for one in found] == [(1, 1.0), (2, 3.0)]


@pytest.mark.parametrize(
    "settings",
    few(
        [{"sinusoids": [{"amplitude": "0.02 deg/s", "frequency": "3 Hz"},
                        {"amplitude": "0.05 deg/s", "frequency": "1 Hz"}]}],
        [{"B": "900 deg/h", "T_B": "200 s", "further": [{"B": "300 deg/h", "T_B": "3 s"}]}],
    ),
)  # fmt: skip
def test_components_are_numbered_as_those_of_an_estimate(settings: dict[str, Any]) -> None:
    axis = AxisSettings.model_validate({"N": "0.3 deg/sqrt(h)"} | settings)
    log = simulate(make_axis_model(axis, "gyro_x"), 10.0, 100_000, np.random.default_rng(2))
    best = fit(log, 10.0).estimates[0]
    found = {
        (n, name): p.in_model
        for n, name, p in best.components()
        if p.in_model is not None and name not in CURVE
    }
    true = {(one.component, one.name): one.value for one in list_true_figures(axis, "gyro_x", 10.0)}
    assert set(found) == set(true)
    for key, value in true.items():
        assert found[key] == pytest.approx(value, rel=0.6), key

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import yaml

from imubench_pipeline.allan import AllanCurve, cluster_sizes
from imubench_pipeline.estimators.estimate import Estimate, JointDraws, Parameter
from imubench_pipeline.estimators.rows import make_allan_rows, make_draw_rows, make_parameter_rows
from imubench_pipeline.extensions.exports.exports import make_exports
from imubench_pipeline.extensions.exports.imu import ExportError
from imubench_pipeline.extensions.exports.request import Request, build_imu, load, make_content
from imubench_pipeline.extensions.exports.settings import ExportSettings
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.run.cli import main
from imubench_pipeline.tables.files import build, write, write_arrow
from imubench_pipeline.tables.keys import Key
from tests.conftest import few
from tests.exports.sensors import ACCEL, GYRO

CHANNELS = {
    "gyro_x": GYRO,
    "gyro_y": NoiseModel(N=2e-4, B=1e-4, T_B=50.0, K=1e-6),
    "accel_x": ACCEL,
}
RATE = 50.0


def curve(model: NoiseModel) -> AllanCurve:
    n = cluster_sizes(1_800_000)
    variance = model.allan_variance(n / RATE, RATE)
    return AllanCurve(n / RATE, n, variance, np.maximum(1_800_000 / n / 2.0, 1.0))


@pytest.fixture(scope="module")
def tables() -> dict[str, pa.Table]:
    parameters: list[TableRow] = []
    allan: list[TableRow] = []
    for channel, model in CHANNELS.items():
        key = Key("mti_7", "sim_a", channel)
        values = {name: Parameter(getattr(model, name)) for name in ("N", "B", "T_B", "K")}
        parameters += make_parameter_rows(key, Estimate("likelihood", values), recommended=True)
        allan += make_allan_rows(key, curve(model))
    recording = {
        "sensor": "mti_7", "device": "serial 1", "recording": "sim_a", "kind": "static",
        "simulated": True, "status": "ok", "rate": RATE, "samples": 1_800_000,
    }  # fmt: skip
    return {
        "recordings": build("recordings", [recording]),
        "parameters": build("parameters", parameters),
        "allan": build("allan", allan),
        "temperature": build("temperature", []),
    }


REQUEST = Request(sensor="mti_7", target="kalibr")


def test_the_file_of_the_worst_axes(tables: dict[str, pa.Table]) -> None:
    text = make_content(tables, REQUEST)
    assert isinstance(text, str)
    found = yaml.safe_load(text)
    assert found["gyroscope_noise_density"] == 2e-4
    assert found["accelerometer_noise_density"] == 1.1e-3
    assert found["update_rate"] == RATE
    assert "SIMULATED" in text
    assert "gyro y of recording sim_a by method likelihood, the worst of 2 axes" in text


def test_a_file_with_three_numbers_has_those_of_each_axis(tables: dict[str, pa.Table]) -> None:
    text = str(make_content(tables, replace(REQUEST, target="basalt")))
    found = json.loads(text)["value0"]
    worst = CHANNELS["gyro_y"].N
    assert found["gyro_noise_std"] == [CHANNELS["gyro_x"].N, worst, worst]
    assert found["accel_noise_std"] == [ACCEL.N] * 3
    assert "gyro x of recording sim_a by method likelihood, the only estimate" in text
    assert "gyro: the axes without an estimate have the following noise." in text
    # a bound is of the worst axis alone
    bounded = make_content(tables, replace(REQUEST, target="basalt", mode="bounded"))
    assert len(set(json.loads(str(bounded))["value0"]["gyro_noise_std"])) == 1


def test_an_axis_whose_walk_is_not_determined_has_its_own_limit(
    tables: dict[str, pa.Table],
) -> None:
    absent = {name: Parameter(None, "absent", "short") for name in ("B", "K")}
    rows = make_parameter_rows(
        Key("mti_7", "sim_a", "gyro_x"),
        Estimate("likelihood", {"N": Parameter(GYRO.N), **absent}),
        recommended=True,
    )
    others = [row for row in tables["parameters"].to_pylist() if row["channel"] != "gyro_x"]
    parameters = pa.concat_tables([build("parameters", [*rows]), build("parameters", others)])
    built = build_imu(tables | {"parameters": parameters}, replace(REQUEST, target="basalt"))
    x, y = (built.estimated["gyro"].each[axis] for axis in "xy")
    assert x.slow_limited and not y.slow_limited
    # above white noise the curve of gyro x has its process and walk: K^2 h / 3 is at least that
    slow = replace(GYRO, N=0.0).allan_variance(np.array([60.0]))[0]
    assert x.model.K == pytest.approx(np.sqrt(3.0 * slow / 60.0), rel=0.2)
    assert y.model.terms == CHANNELS["gyro_y"].terms == built.estimated["gyro"].model.terms


def judged(tables: dict[str, pa.Table], **changes: object) -> dict[str, pa.Table]:
    """Return the tables with what is thought of the recording."""
    (about,) = tables["recordings"].to_pylist()
    return tables | {"recordings": build("recordings", [about | changes])}


def marked(code: str) -> tuple[DoubtMark, ...]:
    return (DoubtMark("sim_a", code, ("gyro_x",)),)


def test_an_unfit_recording_is_exported_with_a_reason_alone(tables: dict[str, pa.Table]) -> None:
    moved = judged(tables, decides=False, fitness="unfit", doubts=marked("motion"))
    with pytest.raises(
        ExportError, match=r"recording sim_a is not used: the sensor was moved; .*--because"
    ):
        make_content(moved, REQUEST)
    text = make_content(moved, replace(REQUEST, because="the car stood still"))
    assert isinstance(text, str)
    said = " ".join(text.replace("#", "").split())
    assert "CAUTION: recording sim_a is not used: the sensor was moved; used all the same" in said
    assert "because: the car stood still." in said
    assert yaml.safe_load(text) == yaml.safe_load(str(make_content(tables, REQUEST)))


def test_doubts_stand_in_the_file(tables: dict[str, pa.Table]) -> None:
    doubted = judged(tables, decides=True, doubts=marked("knocks"))
    assert "CAUTION: sim_a is in doubt: knocks in gyro x." in str(make_content(doubted, REQUEST))
    assert make_content(judged(tables, decides=True, doubts=()), REQUEST) == make_content(
        tables, REQUEST
    )


def test_axes_and_recordings_that_are_left_out_are_named(tables: dict[str, pa.Table]) -> None:
    (about,) = tables["recordings"].to_pylist()
    bad = about | {"recording": "bad", "status": "rejected", "reason": "line 3: found 'x'"}
    several = tables | {"recordings": build("recordings", [about, bad])}
    said = " ".join(str(make_content(several, REQUEST)).replace("#", "").split())
    assert "gyro: axes not used (less noise at 60 s): gyro x of sim_a." in said
    assert "axes without an estimate: gyro z." in said
    assert "CAUTION: bad is not used, as it was rejected: line 3: found 'x'." in said
    gyros = several | {"parameters": tables["parameters"].slice(0, 8)}
    alone = make_content(gyros, replace(REQUEST, target="json"))
    assert "accel: not included, as there is no estimate." in json.loads(alone)["about"]


def test_the_temperature_of_the_recording_that_is_exported_is_in_the_file(
    tables: dict[str, pa.Table],
) -> None:
    figures = {"T_0": 30.0, "sensitivity": 2e-4, "quadratic": None, "lag": None}
    rows = [
        {"sensor": "mti_7", "recording": "sim_a", "channel": "gyro_x", "parameter": name,
         "compensated": True, "value": value, "status": "absent" if value is None else "ok",
         "lower": value and 0.9 * value, "upper": value and 1.1 * value, "unit": "SI"}
        for name, value in figures.items()
    ]  # fmt: skip
    warm = judged(tables, temperature_min=20.0, temperature_max=40.0)
    warm["temperature"] = build("temperature", rows)
    text = str(make_content(warm, replace(REQUEST, target="px4")))
    assert "TC_G0_X1_0\t0.0002\t9" in text and "TC_G0_TREF\t30\t9" in text
    assert "TC_G0_X1_1\t0\t9" in text and "TC_A0" not in text


def test_the_tables_of_a_run_are_found_in_its_folder(
    tables: dict[str, pa.Table], tmp_path: Path
) -> None:
    (tmp_path / "tables").mkdir()
    for name, table in tables.items():
        write_arrow(table, tmp_path / "tables" / f"{name}.parquet")
    assert make_content(load(tmp_path), REQUEST) == make_content(load(tmp_path / "tables"), REQUEST)
    assert make_content(load(tmp_path), REQUEST) == make_content(tables, REQUEST)
    with pytest.raises(ExportError, match="recordings"):
        load(tmp_path / "elsewhere")


@pytest.mark.parametrize("name", few(["px4"], ["matlab", "gnss-ins-sim"]))
def test_an_overbound_has_the_terms_that_the_program_holds(
    tables: dict[str, pa.Table], name: str
) -> None:
    gyros = tables | {"parameters": tables["parameters"].slice(0, 8)}
    sensor = build_imu(gyros, replace(REQUEST, target=name, mode="bounded"))
    assert set(sensor.estimated["gyro"].model.name.split("+")) <= set(
        TARGETS[name].family.split("+")
    )
    both = replace(sensor, estimated=dict.fromkeys(("gyro", "accel"), sensor.estimated["gyro"]))
    text = TARGETS[name].write(both)
    assert isinstance(text, str)
    assert "replaced by" not in text


@pytest.mark.release
def test_an_overbound_lies_above_the_draws_of_the_recording(
    tables: dict[str, pa.Table], tmp_path: Path
) -> None:
    def bounded(spread: float) -> NoiseModel:
        model = CHANNELS["gyro_y"]
        first = np.tile([0.0, model.N, model.B, model.T_B or np.nan, model.K, 0.0], (40, 1))
        first[:, [1, 2, 4]] *= np.geomspace(1.0 / spread, spread, 40)[:, None]
        drawn = JointDraws(first, np.empty((40, 0, 2)))
        rows = make_draw_rows(
            Key("mti_7", "sim_a", "gyro_y"), Estimate("likelihood", {}, draws=drawn)
        )
        write("draws", rows, tmp_path / "mti_7/sim_a/draws.parquet")
        found = build_imu(
            tables, replace(REQUEST, mode="bounded", horizon=600.0, most_excess=20.0), tmp_path
        )
        return found.estimated["gyro"].model

    without = build_imu(
        tables, replace(REQUEST, mode="bounded", horizon=600.0, most_excess=20.0)
    ).estimated["gyro"]
    # Sure of the fit, only the measured curve is widened; else the bound is as much larger.
    sure, unsure = bounded(1.001), bounded(2.0)
    assert sure.K < without.model.K < unsure.K
    assert 2e-4 < sure.N < 2e-4 * 1.1 < 2e-4 * 1.7 < unsure.N < 2e-4 * 2.3


@pytest.fixture(scope="module")
def bounded(tables: dict[str, pa.Table]) -> str:
    return str(make_content(tables, replace(REQUEST, mode="bounded")))


def test_an_overbound_is_larger_and_says_what_it_is(
    tables: dict[str, pa.Table], bounded: str
) -> None:
    plain, text = yaml.safe_load(make_content(tables, REQUEST)), bounded
    found = yaml.safe_load(text)
    for key in ("gyroscope_noise_density", "gyroscope_random_walk", "accelerometer_random_walk"):
        assert plain[key] < found[key] < 2.0 * plain[key]
    joined = text.replace("\n#  ", "")
    assert "the smallest N+K above the measured Allan variance" in joined
    assert "at every tau from 1 to 60 s (95 % for all together)" in joined


def test_a_bound_with_one_number_is_above_every_axis(tables: dict[str, pa.Table]) -> None:
    found = build_imu(tables, replace(REQUEST, target="gtsam", mode="bounded"))
    for axis in found.estimated.values():
        assert axis is not None
        for own in axis.each.values():
            assert axis.model.N >= own.model.N
            assert axis.model.K >= own.model.K


@pytest.mark.release
def test_the_head_of_an_overbound_says_where_its_density_holds(
    tables: dict[str, pa.Table], bounded: str
) -> None:
    joined = bounded.replace("\n#  ", "")
    assert "the spectral density is bounded above 0.00167 Hz only" in joined
    assert "average for longer than 600 s" in joined
    matrices = json.loads(make_content(tables, replace(REQUEST, target="json", mode="bounded")))
    assert matrices["gyro"]["density_bounded"] == pytest.approx([0.1 / 60.0, 1.0])
    assert (
        json.loads(make_content(tables, replace(REQUEST, target="json")))["gyro"]["density_bounded"]
        is None
    )


@pytest.mark.release
def test_a_walk_that_cannot_follow_is_refused(tables: dict[str, pa.Table]) -> None:
    settings = ExportSettings(targets=("kalibr",), mode="bounded", horizon="150 s", most_excess=1.2)
    ((place, content),) = make_exports(tables, settings)
    assert str(place) == "mti_7/not_made.txt"
    assert "At most 1.2 times is allowed; N+GM is supported by kf-gins" in str(content)
    assert "take a horizon shorter than 150 s" in str(content)


@pytest.mark.release
def test_a_walk_that_cannot_follow_is_warned_of(tables: dict[str, pa.Table]) -> None:
    text = make_content(tables, replace(REQUEST, mode="bounded", horizon=150.0))
    assert isinstance(text, str)
    joined = text.replace("\n#  ", "")
    assert "WARNING: the Allan deviation of the smallest N+K is" in joined
    assert "gnss-ins-sim; N+GM+K is supported by matlab, json, npz" in joined


def test_rate_and_inflation(tables: dict[str, pa.Table]) -> None:
    asked = replace(REQUEST, rate=200.0, inflation=2.0, because="it flies", axis="serial 1")
    sensor = build_imu(tables, asked)
    assert sensor.rate == 200.0
    assert sensor.axes["accel"].model.N == pytest.approx(2.2e-3)
    assert sensor.simulated


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"sensor": "other"}, "no sensor 'other'; there are: mti_7"),
        ({"target": "other"}, "there are: kalibr, openvins"),
        ({"axis": "serial 2"}, "there are: serial 1"),
        ({"inflation": 2.0}, "needs a reason"),
        ({"horizon": 1e6, "mode": "bounded"}, "the curve ends"),
    ],
)
def test_what_cannot_be_made_says_why(
    tables: dict[str, pa.Table], wrong: dict[str, object], words: str
) -> None:
    with pytest.raises(ExportError, match=words):
        make_content(tables, replace(REQUEST, **wrong))  # type: ignore[arg-type]  # wrong on purpose


def test_a_run_leaves_a_file_a_program_and_says_what_it_cannot(
    tables: dict[str, pa.Table],
) -> None:
    settings = ExportSettings(targets=("kalibr", "npz", "none"), horizon="30 s")
    found = {str(place): content for place, content in make_exports(tables, settings)}
    assert set(found) == {"mti_7/kalibr/imu.yaml", "mti_7/npz/noise.npz", "mti_7/not_made.txt"}
    assert "horizon of 30 s" in str(found["mti_7/kalibr/imu.yaml"])
    assert str(found["mti_7/not_made.txt"]).startswith("none: target 'none' is not known; ")


def test_the_command_writes_a_file_or_says_why_not(
    tables: dict[str, pa.Table], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, table in tables.items():
        write_arrow(table, tmp_path / f"tables/{name}.parquet")
    ask = ["export", str(tmp_path), "--sensor", "mti_7", "--target"]
    assert main([*ask, "kalibr"]) == 0
    printed = capsys.readouterr().out
    assert main([*ask, "kalibr", "--output", str(tmp_path / "imu.yaml")]) == 0
    assert (tmp_path / "imu.yaml").read_text() == printed
    assert yaml.safe_load(printed)["gyroscope_noise_density"] == 2e-4
    assert main([*ask, "npz", "--output", str(tmp_path / "a.npz")]) == 0
    assert main([*ask, "kalibr", "--horizon", "1 min", "--output", str(tmp_path / "same")]) == 0
    assert (tmp_path / "same").read_text() == printed
    with np.load(tmp_path / "a.npz") as arrays:
        assert len(arrays.files) > 0
    capsys.readouterr()
    for wrong, said in (
        ([*ask, "npz"], "add --output"),
        ([*ask, "kalibr", "--inflate", "2"], "--because"),
        ([*ask, "other"], "there are: kalibr"),
        (["export", str(tmp_path / "none"), *ask[2:], "json"], "none"),
    ):
        assert main(wrong) == 2
        assert said in capsys.readouterr().err

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.curve_bias import compute_curve_figures, make_averaging_times
from imubench_pipeline.estimators.estimate import CURVE
from imubench_pipeline.estimators.rows import read_estimates
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng, simulate
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.config import EstimateSettings, Method
from imubench_pipeline.steps.estimate import Estimation, estimate_channel, estimate_register_step
from imubench_pipeline.tables.files import build, write
from imubench_pipeline.tables.keys import Key
from tests.conftest import few
from tests.kept import curve_of, kept

RATE = 10.0
SAMPLES = 60_000
GYRO = NoiseModel(N=1e-3, B=2e-3, T_B=20.0)
ACCEL = NoiseModel(N=2e-3, K=1e-4)
WAVE = (5e-4, 1.7)
"""Amplitude and frequency of the line in the accelerometer."""

BIAS = {"gyro_x": -0.03, "accel_z": 9.81}
ALL: tuple[Method, ...] = ("robust", "likelihood", "likelihood_gm", "curve", "paper", "weighted")
UNITS = {
    "gyro_x": {"N": "rad/s/sqrt(Hz)", "B": "rad/s", "T_B": "s", "K": "rad/s/sqrt(s)",
               "B_curve": "rad/s", "sigma_min": "rad/s", "tau_min": "s"},
    "accel_z": {"N": "m/s^2/sqrt(Hz)", "B": "m/s^2", "T_B": "s", "K": "m/s^2/sqrt(s)",
                "B_curve": "m/s^2", "sigma_min": "m/s^2", "tau_min": "s",
                "amplitude": "m/s^2", "frequency": "Hz"},
}  # fmt: skip

Row = Mapping[str, Any]


def key(channel: str) -> Key:
    return Key("sensor", "sim_1", channel)


def samples_of(channel: str, samples: int = SAMPLES) -> np.ndarray:
    rng = channel_rng(20260109, channel)
    if channel == "gyro_x":
        return BIAS[channel] + simulate(GYRO, RATE, samples, rng)
    amplitude, frequency = WAVE
    line = amplitude * np.sin(2 * np.pi * frequency * np.arange(samples) / RATE)
    return BIAS[channel] + simulate(ACCEL, RATE, samples, rng) + line


def recorded(
    folder: Path, columns: dict[str, np.ndarray], holes: bool = False
) -> dict[str, ChannelLog]:
    return kept(folder, columns, RATE, holes=holes)


def estimated(log: ChannelLog, bandwidth: float | None = None, **settings: Any) -> Estimation:
    found = Estimation()
    how = EstimateSettings(**settings)
    estimate_channel(key(log.channel), log, curve_of(log), how, bandwidth, found)
    return found


def test_the_step_of_a_register_is_read_from_the_samples(tmp_path: Path) -> None:
    fine = {channel: samples_of(channel, 40_000) for channel in BIAS}
    step = 1e-3
    rounded = {channel: np.round(values / step) * step for channel, values in fine.items()}
    for channel, log in recorded(tmp_path / "rounded", rounded).items():
        assert estimate_register_step(log) == pytest.approx(step, rel=1e-6), channel
    for channel, log in recorded(tmp_path / "fine", fine).items():
        assert estimate_register_step(log) == 0.0, channel


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ChannelLog]:
    columns = {channel: samples_of(channel) for channel in BIAS}
    return recorded(tmp_path_factory.mktemp("recording"), columns)


@pytest.fixture(scope="module")
def found(logs: dict[str, ChannelLog]) -> Estimation:
    """Both channels, one after the other."""
    rows = Estimation()
    for channel, log in logs.items():
        estimate_channel(key(channel), log, curve_of(log), EstimateSettings(), None, rows)
    return rows


def of(rows: list[Row], channel: str, **wanted: object) -> list[Row]:
    return [
        row
        for row in rows
        if row["channel"] == channel and all(row[name] == what for name, what in wanted.items())
    ]


def tables(found: Estimation) -> dict[str, list[Row]]:
    names = ("parameters", "models", "lines", "spectrum", "fixed_bias")
    return {name: getattr(found, name) for name in names}


def test_every_row_fits_the_schema_of_its_table(found: Estimation) -> None:
    for name, rows in tables(found).items():
        assert rows
        assert build(name, rows).num_rows == len(rows)
        for row in rows:
            assert (row["sensor"], row["recording"]) == ("sensor", "sim_1")
            assert row["channel"] in BIAS


@pytest.mark.parametrize("channel", BIAS)
def test_the_fixed_bias_is_the_mean(found: Estimation, channel: str) -> None:
    (row,) = of(found.fixed_bias, channel)
    assert row["value"] == pytest.approx(samples_of(channel).mean(), rel=1e-12)
    assert row["unit"] == UNITS[channel]["B"]


@pytest.mark.parametrize("channel", BIAS)
def test_every_method_has_its_parameters_with_their_units(found: Estimation, channel: str) -> None:
    rows = of(found.parameters, channel)
    assert tuple(dict.fromkeys(row["method"] for row in rows)) == ALL
    noise = [row for row in rows if row["parameter"] not in ("amplitude", "frequency")]
    for method in ALL:
        names = [row["parameter"] for row in noise if row["method"] == method]
        four = ["N", "B", "T_B", "K"]
        shown = {"likelihood": ["Q", *four, "R"], "robust": [*four, "R"]}
        assert [name for name in names if name not in ("B", "T_B")] == [
            name for name in (*shown.get(method, four), *CURVE) if name not in ("B", "T_B")
        ]
        assert {"B", "T_B"} <= set(names)
    for row in rows:
        if row["parameter"] in UNITS[channel]:
            assert row["unit"] == UNITS[channel][row["parameter"]]
        assert (row["value"] is None) <= bool(row["reason"])
        if row["lower"] is not None and row["upper"] is not None:
            assert row["lower"] <= row["upper"]


@pytest.mark.parametrize(
    ("channel", "truth"), [("gyro_x", GYRO), ("accel_z", ACCEL)], ids=["gyro_x", "accel_z"]
)
def test_the_estimates_are_those_of_the_simulation(
    found: Estimation, channel: str, truth: NoiseModel
) -> None:
    for method in ALL:
        (row,) = of(found.parameters, channel, method=method, parameter="N")
        if channel == "gyro_x" or method.startswith(("likelihood", "robust")):  # a line bends it
            assert row["value"] == pytest.approx(truth.N, rel=0.03), method
    names = ("B", "T_B", "B_curve") if channel == "gyro_x" else ("K", "sigma_min", "tau_min")
    of_curve = compute_curve_figures(truth, make_averaging_times(RATE, SAMPLES / RATE))
    for name in names:
        (row,) = of(found.parameters, channel, method="likelihood", parameter=name)
        # Of a walk beside a line the limits are more than four times apart: no value is given.
        assert row["status"] == ("not_identified" if name == "K" else "ok")
        true = getattr(truth, name, None) or of_curve[name].value
        assert row["lower"] < true < row["upper"]


@pytest.mark.parametrize("channel", BIAS)
def test_one_method_is_recommended(found: Estimation, channel: str) -> None:
    for row in of(found.parameters, channel):
        assert row["recommended"] == (row["method"] == "robust")


@pytest.mark.parametrize("channel", BIAS)
def test_one_model_is_chosen_and_scores_add_up(found: Estimation, channel: str) -> None:
    rows = of(found.models, channel)
    (chosen,) = (row for row in rows if row["chosen"])
    assert chosen["bic"] == min(row["bic"] for row in rows)
    assert len({row["model"] for row in rows}) == len(rows) >= 10
    (name,) = {row["model"] for row in of(found.parameters, channel, method="likelihood")}
    assert name == chosen["model"] + ("+S" if channel == "accel_z" else "")
    for row in rows:
        # -2 log L + p log(bins), + 2 p, and the shares of e^(-BIC/2)
        bic = -2 * row["log_likelihood"] + row["free"] * np.log(row["bins"])
        # A slow process in place of a random walk pays 4 more, and a ramp beside a walk of 0;
        # every ramp, and quantization noise, pay 6.
        terms = row["model"].split("+")
        instead = ("GM" in terms and "K" not in terms) or "R" in terms
        more = row["bic"] - bic - 6.0 * (("R" in terms) + ("Q" in terms))
        assert more == pytest.approx(0.0, abs=1e-6) or (
            instead and more == pytest.approx(4.0, abs=1e-6)
        )
        assert row["aic"] == pytest.approx(-2 * row["log_likelihood"] + 2 * row["free"])
        assert row["weight"] / chosen["weight"] == pytest.approx(
            np.exp((chosen["bic"] - row["bic"]) / 2)
        )
        assert row["free"] == len(row["model"].split("+")) + row["model"].count("GM")
    assert sum(row["weight"] for row in rows) == pytest.approx(1.0)
    assert chosen["verdict"] == "explained"
    assert chosen["band"] == pytest.approx(RATE / 2)
    assert "Nyquist" in chosen["band_source"]
    assert chosen["deviance"] == pytest.approx(1.0, abs=0.35)


@pytest.mark.parametrize("channel", BIAS)
def test_a_richer_model_is_no_less_likely(found: Estimation, channel: str) -> None:
    likely = {row["model"]: row["log_likelihood"] for row in of(found.models, channel)}
    for less, more in (("N", "N+K"), ("N", "N+F"), ("N+F", "N+F+K"), ("N+GM", "N+GM+K"),
                       ("N+K", "N+GM+K"), ("N+GM", "N+GM+GM")):  # fmt: skip
        assert likely[more] >= likely[less] - 1e-3 * abs(likely[less]) ** 0.5


@pytest.mark.parametrize("channel", BIAS)
def test_the_spectrum_has_the_power_of_the_log(found: Estimation, channel: str) -> None:
    rows = of(found.spectrum, channel)
    power = RATE * sum(row["density"] * row["ordinates"] for row in rows)
    log = samples_of(channel)
    assert power == pytest.approx(np.sum((log - log.mean()) ** 2), rel=1e-9)
    assert sum(row["ordinates"] for row in rows) == SAMPLES - 1
    assert all(row["lower"] < row["frequency"] < row["upper"] for row in rows)
    (chosen,) = of(found.models, channel, chosen=True)
    used = [row for row in rows if row["used"]]
    assert len(used) == chosen["bins"]
    assert max(row["upper"] for row in used) <= chosen["band"] * (1 + 1e-6)
    ratios = [row["density"] / row["fitted"] for row in used]
    weights = [row["ordinates"] for row in used]
    assert np.average(ratios, weights=weights) == pytest.approx(1.0, abs=0.01)


def test_a_line_is_in_the_table_of_lines_and_beside_the_parameters(found: Estimation) -> None:
    assert not of(found.lines, "gyro_x")
    (line,) = of(found.lines, "accel_z")
    assert line["kind"] == "sinusoid"
    for name, truth in zip(("amplitude", "frequency"), WAVE, strict=True):
        assert line[f"{name}_lower"] < truth < line[f"{name}_upper"]
        for method in ("likelihood", "likelihood_gm"):
            (row,) = of(found.parameters, "accel_z", method=method, parameter=name)
            assert (row["component"], row["value"]) == (1, line[name])
            assert (row["lower"], row["upper"]) == (line[f"{name}_lower"], line[f"{name}_upper"])
    assert 0 <= line["false_alarm"] < 0.01
    used = [row for row in of(found.spectrum, "accel_z") if row["used"]]
    assert not any(row["lower"] <= WAVE[1] <= row["upper"] for row in used)


def test_the_table_of_parameters_gives_the_estimates_back(
    found: Estimation, tmp_path: Path
) -> None:
    write("parameters", found.parameters, tmp_path / "parameters.parquet")
    for channel, back in read_estimates(tmp_path / "parameters.parquet").items():
        assert [estimate.method for estimate in back] == list(ALL)
        for estimate in back:
            (name,) = {r["model"] for r in of(found.parameters, channel, method=estimate.method)}
            assert estimate.model.name == name


def test_the_table_of_draws_gives_the_noise_models_back(found: Estimation, tmp_path: Path) -> None:
    write("parameters", found.parameters, tmp_path / "parameters.parquet")
    write("draws", found.draws, tmp_path / "draws.parquet")
    for channel, back in read_estimates(
        tmp_path / "parameters.parquet", tmp_path / "draws.parquet"
    ).items():
        for estimate in back:
            if estimate.method in ("curve", "paper", "weighted"):
                assert estimate.draws is None
                continue
            assert estimate.draws is not None
            assert len(estimate.draws) == (400 if estimate.method == "robust" else 200)
            for name in ("N", "B", "K"):
                parameter = estimate.parameters[name]
                own = [getattr(estimate.draws.model(i), name) for i in range(200)]
                if parameter.status != "ok":
                    continue
                # The interval is of the models that have the parameter, as most draws do.
                low, high = np.quantile(own, [0.1, 0.9])
                assert parameter.lower <= high, (channel, estimate.method, name)
                assert low <= parameter.upper, (channel, estimate.method, name)
                assert low <= parameter.value <= high, (channel, estimate.method, name)


@pytest.mark.parametrize(
    ("methods", "best"),
    few(
        [
            (("curve", "paper", "weighted"), "weighted"),
            (("curve", "paper"), "paper"),
            (("curve",), "curve"),
        ],
        [
            (("paper", "likelihood_gm", "curve"), "likelihood_gm"),
            (("weighted", "likelihood"), "likelihood"),
        ],
    ),
)
def test_only_what_is_asked_for_is_there_and_the_best_of_it_is_recommended(
    tmp_path: Path, methods: tuple[Method, ...], best: str
) -> None:
    (log,) = recorded(tmp_path, {"gyro_x": samples_of("gyro_x", 5_000)}).values()
    found = estimated(log, methods=methods)
    assert tuple(dict.fromkeys(row["method"] for row in found.parameters)) == methods
    assert {row["method"] for row in found.parameters if row["recommended"]} == {best}
    assert all(row["recommended"] == (row["method"] == best) for row in found.parameters)
    likelihood = any(method.startswith("likelihood") for method in methods)
    assert bool(found.models) == bool(found.spectrum) == likelihood
    assert sum(row["chosen"] for row in found.models) == likelihood
    assert len(found.fixed_bias) == 1
    for name, rows in tables(found).items():
        build(name, rows)


@pytest.mark.release
def test_the_papers_model_alone_says_what_it_says_beside_the_others(
    found: Estimation, logs: dict[str, ChannelLog]
) -> None:
    alone = estimated(logs["gyro_x"], methods=("likelihood_gm",))
    beside = of(found.parameters, "gyro_x", method="likelihood_gm")
    assert [row["parameter"] for row in alone.parameters] == ["N", "B", "T_B", "K", *CURVE]
    assert [dict(row) | {"recommended": True} for row in beside] == alone.parameters
    assert alone.models == of(found.models, "gyro_x")
    assert alone.spectrum == of(found.spectrum, "gyro_x")


@pytest.mark.parametrize(("channel", "seed"), few([("gyro_x", 1)], [("gyro_y", None)]))
def test_the_seed_and_the_name_of_the_channel_make_the_draws(
    found: Estimation, tmp_path: Path, channel: str, seed: int | None
) -> None:
    def limits(rows: list[Row]) -> list[object]:
        # Whether a value is known well enough to be quoted is told by the draws.
        of_terms = [row for row in rows if row["parameter"] in ("N", "B", "T_B", "K")]
        return [
            (row["fitted"] if row["value"] is None else row["value"], row["lower"], row["upper"])
            for row in of_terms
        ]

    # That the same make the same, the test before this shows.
    first = limits(of(found.parameters, "gyro_x", method="likelihood_gm"))
    log = recorded(tmp_path, {channel: samples_of("gyro_x")})[channel]
    seed = EstimateSettings().seed if seed is None else seed
    other = limits(estimated(log, methods=("likelihood_gm",), seed=seed).parameters)
    assert [value for value, *_ in other] == [value for value, *_ in first]
    assert other != first


@pytest.mark.release
@pytest.mark.parametrize(
    ("settings", "bandwidth", "band", "source"),
    few(
        [({"band": "800 mHz"}, 20.0, 0.8, "set")],
        [
            ({}, 20.0, 5.0, "Nyquist"),
            ({"band": "0.5 Hz"}, None, 0.5, "set"),
            ({"band": "800 mHz"}, None, 0.8, "set"),
            ({}, None, 5.0, "Nyquist"),
        ],
    ),
)
def test_the_band_is_as_set_or_all_that_the_model_follows(
    tmp_path: Path, settings: dict[str, str], bandwidth: float | None, band: float, source: str
) -> None:
    (log,) = recorded(tmp_path, {"gyro_x": samples_of("gyro_x", 5_000)}).values()
    found = estimated(log, bandwidth, methods=("likelihood",), **settings)
    for row in found.models:
        assert row["band"] == pytest.approx(band)
        assert source in row["band_source"]
    used = [row["upper"] for row in found.spectrum if row["used"]]
    assert 0.9 * band < max(used) <= band * (1 + 1e-6)


def test_the_longest_tau_is_that_of_the_settings(tmp_path: Path) -> None:
    # Only tau up to 5 s: whether a random walk follows the white noise cannot be seen.
    log = simulate(NoiseModel(N=1e-3, K=3e-5), RATE, 100_000, np.random.default_rng(1))
    (kept,) = recorded(tmp_path, {"gyro_x": log}).values()
    walks = {}
    for part in (1 / 9, 0.0005):
        rows = estimated(kept, methods=("curve", "weighted"), longest=part).parameters
        walks[part] = [row["value"] for row in rows if row["parameter"] == "K"]
        (n,) = (r["value"] for r in rows if r["parameter"] == "N" and r["method"] == "weighted")
        assert n == pytest.approx(1e-3, rel=0.03)
    assert walks[1 / 9][1] == pytest.approx(3e-5, rel=0.5)
    assert walks[0.0005] == [None, None]


def lose_some(log: np.ndarray) -> None:
    log[np.random.default_rng(2).random(len(log)) < 0.05] = np.nan


def lose_one_part(log: np.ndarray) -> None:
    log[20_000:27_000] = np.nan


@pytest.mark.parametrize(
    ("lose", "methods"),
    few(
        [(lose_one_part, ("curve", "paper", "weighted"))],  # test_likelihood.py has holes every day
        [(lose_one_part, ALL), (lose_some, ALL)],
    ),
)
def test_missing_samples_are_neither_in_the_mean_nor_in_the_noise(
    tmp_path: Path, lose: Callable[[np.ndarray], None], methods: tuple[Method, ...]
) -> None:
    log = samples_of("gyro_x")
    lose(log)
    (kept,) = recorded(tmp_path, {"gyro_x": log}, holes=True).values()
    found = estimated(kept, methods=methods)
    assert found.fixed_bias[0]["value"] == pytest.approx(np.nanmean(log), rel=1e-12)
    for method in methods:
        (row,) = of(found.parameters, "gyro_x", method=method, parameter="N")
        assert row["value"] == pytest.approx(GYRO.N, rel=0.03), method
    for name in ("B", "T_B") if "likelihood" in methods else ():
        (row,) = of(found.parameters, "gyro_x", method="likelihood", parameter=name)
        assert row["lower"] < getattr(GYRO, name) < row["upper"]
    for name, rows in tables(found).items():
        build(name, rows)


@pytest.mark.parametrize("methods", few([("weighted",)], [(("weighted", "likelihood_gm"),)]))
def test_the_curve_of_the_channel_is_the_one_that_is_given(
    logs: dict[str, ChannelLog], methods: tuple[Method, ...]
) -> None:
    # The methods of the curve see nothing but the curve, and the likelihood nothing but the log.
    other = allan_variance(
        simulate(NoiseModel(N=5e-3), RATE, SAMPLES, np.random.default_rng(3)), RATE
    )
    rows = Estimation()
    settings = EstimateSettings(methods=methods)
    estimate_channel(key("gyro_x"), logs["gyro_x"], other, settings, None, rows)
    for method, truth in zip(methods, (5e-3, GYRO.N), strict=False):
        (row,) = of(rows.parameters, "gyro_x", method=method, parameter="N")
        assert row["value"] == pytest.approx(truth, rel=0.03)


def test_a_log_too_short_for_the_band_has_rows_with_reasons(tmp_path: Path) -> None:
    # 100 s have two ordinates up to 10 mHz.
    (log,) = recorded(tmp_path, {"accel_z": samples_of("accel_z", 1000)}).values()
    found = estimated(log, methods=("likelihood", "likelihood_gm"), band="0.01 Hz")
    assert not found.models
    assert found.parameters and found.spectrum
    for row in found.parameters:
        assert (row["value"], row["status"], row["model"]) == (None, "not_shown", "none")
        assert "too short" in row["reason"]
    assert not any(row["fitted"] for row in found.spectrum)
    assert {row["method"] for row in found.parameters if row["recommended"]} == {"likelihood"}
    for name, rows in tables(found).items():
        build(name, rows)


@pytest.mark.release
def test_a_short_log_behind_a_slow_filter_has_rows(tmp_path: Path) -> None:
    # The shortest log that is taken, 100 samples at 10 Hz, has 19 ordinates up to 1 Hz.
    (log,) = recorded(tmp_path, {"gyro_x": samples_of("gyro_x", 100)}).values()
    found = estimated(log, 10.0)
    assert {row["method"] for row in found.parameters} == set(ALL)
    for name, rows in tables(found).items():
        build(name, rows)


# Every day test_likelihood.py has noise behind a found filter, and beyond what is explained.
@pytest.mark.release
def test_where_a_drift_hides_all_below_a_found_cutoff_noise_is_told_behind_it(
    tmp_path: Path,
) -> None:
    # A chamber in steps, behind a lag: its line has skirts above the noise up to 2 Hz, and a
    # tenth of the cut-off is 1 Hz.
    rate, samples, N, cutoff, lag = 25.0, 290_000, 4e-4, 10.2, 200.0
    rng = np.random.default_rng(5)
    decay = np.exp(-2.0 * np.pi * cutoff / rate)
    driven = N * np.sqrt(np.pi * cutoff * (1.0 - decay**2)) * rng.standard_normal(samples)
    levels = 0.03 * np.array([0.3, -1.0, 0.8, -0.2, 1.0, -0.9, 0.1, 0.7])
    steps = np.repeat(levels, samples // 8)
    slow = np.exp(-1.0 / (lag * rate))
    values = lfilter([1.0], [1.0, -decay], driven) + lfilter([1.0 - slow], [1.0, -slow], steps)
    (log,) = kept(tmp_path, {"accel_z": values}, rate).values()
    found = estimated(log, methods=("likelihood",))
    (of_filter,) = (row for row in found.low_pass if row["parameter"] == "cutoff")
    assert of_filter["value"] == pytest.approx(cutoff, rel=0.05)
    (white,) = (row for row in found.parameters if row["parameter"] == "N")
    # Above the skirts the filter leaves enough of it.
    assert (white["status"], white["value"]) == ("ok", pytest.approx(N, rel=0.05))
    assert white["lower"] < N < white["upper"]

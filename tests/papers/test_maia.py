"""The lines of Maia et al. against truth of another source than their own code."""

import math
from collections.abc import Iterator
from typing import Any

import allantools
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from imubench_pipeline.extensions.papers import maia
from imubench_pipeline.extensions.papers.maia import (
    CHANNELS,
    GRIDS,
    MTI_GYRO,
    WEIGHED_AT,
    compute_weight_ratios,
    evaluate_as_printed,
    find_lowest_point,
    integrate_density,
    read_manufacturer,
    simulate_lottery,
    simulate_readings,
)
from imubench_pipeline.extensions.papers.papers import make_rows
from imubench_pipeline.extensions.papers.printed import Evidence, read_paper
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.settings.simulated_recordings import read_simulated
from tests.conftest import PROJECT, catalogue, few

GYRO = MTI_GYRO.table_2
PRINTED = {
    # N, B, K and T_B of Tables 1 and 2, digit by digit, and Table 3
    "MTi-7 accelerometer": ("9.5 3.6 1.5 84.6", "9.6 3.4 1.7 38.3", 3.9e-4, 1.0e-4),
    "MTi-7 gyro": ("8.5 5.7 1.0 223.5", "8.4 6.7 8.2 89.5", 4.2e-5, 8.6e-6),
    "C102-F9R accelerometer": ("1.1 7.2 1.5 18.5", "1.1 7.2 2.0 148.9", 4.2e-4, 1.2e-4),
    "C102-F9R gyro": ("5.8 3.0 1.3 29", "5.7 3.4 8.7 68.3", 1.8e-3, 5.0e-4),
}


@pytest.fixture(scope="module", params=few([60], [maia.MEMBERS]))
def members(request: pytest.FixtureRequest) -> Iterator[int]:
    """The number of reconstructions: less than what the page has, every day."""
    cached = (
        maia.simulate_lottery,
        maia.simulate_readings,
        maia._simulate_deviations,
        maia._count_in_range,
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maia, "MEMBERS", request.param)
        for function in cached:
            function.cache_clear()
        yield request.param
    for function in cached:
        function.cache_clear()


@pytest.fixture(scope="module")
def lines(members: int) -> dict[str, list[dict[str, Any]]]:
    assert members == maia.MEMBERS
    by_place: dict[str, list[dict[str, Any]]] = {}
    for row in make_rows(read_paper("maia"), Evidence()):
        by_place.setdefault(row["place"], []).append(dict(row))
    return by_place


def test_every_table_figure_and_equation_has_a_line(lines: dict[str, Any]) -> None:
    expected = {f"Table {n}" for n in range(1, 5)} | {f"Figure {n}" for n in range(1, 10)}
    assert lines.keys() == expected | {f"Equation {n}" for n in range(1, 28)}


def test_the_tables_are_typed_as_printed() -> None:
    for channel in CHANNELS.values():
        first, second, *table_3 = PRINTED[channel.name]
        for model, digits in ((channel.table_1, first), (channel.table_2, second)):
            shown = [f"{value:.1e}".split("e")[0] for value in (model.N, model.B, model.K)]
            assert " ".join([*shown, f"{model.T_B:g}"]) == digits
        assert list(channel.table_3) == table_3


def test_the_demonstration_simulates_table_2_and_has_table_1_beside_it() -> None:
    run = read_simulated(PROJECT / "config/simulated.yaml", catalogue())
    entries = {(entry.sensor, entry.recording): entry for entry in run.recordings}
    for channel in CHANNELS.values():
        entry = entries[channel.sensor, "sim_published"]
        axis = entry.channels[channel.channel]  # type: ignore[index]  # its names are those keys
        assert axis.read is not None
        for model, figures in (
            (channel.table_2, axis.si(channel.channel)),
            (channel.table_1, axis.read.si(channel.channel)),
        ):
            for name, value in figures.items():
                assert value == pytest.approx(getattr(model, name), rel=1e-9), name
        assert entry.rate == f"{channel.rate:g} Hz"


def test_what_differs_has_its_reason_and_what_agrees_none(lines: dict[str, Any]) -> None:
    for row in (row for rows in lines.values() for row in rows):
        assert (row["reason"] is None) == (row["verdict"] == "agrees"), row


def test_reading_the_curve_of_table_2(lines: dict[str, Any]) -> None:
    tau = np.geomspace(1, 18_000, 100_000)
    for channel in CHANNELS.values():
        N, B, K, T_B = (row for row in lines["Table 1"] if channel.name in row["quantity"][:40]
                        and "read from" in row["quantity"])  # fmt: skip
        adev = np.sqrt(channel.table_2.allan_variance(tau))
        assert B["found"] == pytest.approx(adev.min() / 0.6643, rel=1e-3)
        assert T_B["found"] == pytest.approx(tau[adev.argmin()] / 1.8926, rel=2e-3)
        assert N["found"] == pytest.approx(adev[0], rel=1e-6)
        assert K["found"] == pytest.approx(
            np.interp(4000, tau, adev) * math.sqrt(3 / 4000), rel=1e-4
        )


def test_printed_is_as_in_the_paper_and_what_is_not_printed_says_so(lines: dict[str, Any]) -> None:
    shown = {row["quantity"]: row["printed_as"] for rows in lines.values() for row in rows}
    for quantity, printed in (
        ("N of the MTi-7 accelerometer, manufacturer", "12,0·10⁻⁴ m/s^(3/2)"),
        ("N of the MTi-7 gyro, manufacturer", "12,0·10⁻⁵ rad/s^(1/2)"),
        ("B of the MTi-7 gyro, manufacturer", "4,8·10⁻⁵ rad/s"),
        ("K of the C102-F9R accelerometer, optimised", "2,0·10⁻⁵ m/s^(5/2)"),
        ("K of the MTi-7 gyro, optimised", "8,2·10⁻⁷ rad/s^(3/2)"),
        ("T_B of the C102-F9R gyro, read from the curve", "29,0 s"),
    ):
        assert shown[quantity] == printed
    for part in ("lowest point of", "deviation at", "error of", "over manufacturer", "line 0,664"):
        derived = {text.startswith("derived: ") for name, text in shown.items() if part in name}
        assert derived == {True}, part
    assert lines["Equation 8"][0]["printed_unit"] == "(rad/s)²/s"


def test_what_the_log_is_made_of_is_said_to_come_back(lines: dict[str, Any]) -> None:
    """The logs are of Table 2, which must be nearer; what is weighted is not what is printed."""
    weighted = [row for row in lines["Table 3"] if row["quantity"].startswith("weighted")]
    assert len(weighted) == 8
    for row in [*weighted, *(line for n in range(2, 6) for line in lines[f"Figure {n}"])]:
        assert row["basis"] == "round trip"
        assert row["ratio"] is None and row["tolerance"] is None


def test_the_numbers_of_table_1_do_not_fit_equation_26(lines: dict[str, Any]) -> None:
    taus = {channel.name: find_lowest_point(channel.table_1)[0] for channel in CHANNELS.values()}
    assert taus["MTi-7 gyro"] == pytest.approx(27.3, abs=0.1)
    for channel in CHANNELS.values():
        T_B = channel.table_1.T_B
        assert T_B is not None
        assert not 0.5 < taus[channel.name] / (1.89 * T_B) < 2.0
        # By the integral of the density the curve is lower there than at 1.89 T_B.
        here, there = (
            integrate_density(channel.table_1, tau) for tau in (taus[channel.name], 1.89 * T_B)
        )
        assert here < there
        # The process alone is below its peak there, and N and K do not make up for that.
        process = integrate_density(NoiseModel(B=channel.table_1.B, T_B=T_B), taus[channel.name])
        share = math.sqrt(process) / (0.6643 * channel.table_1.B)
        row = next(row for row in lines["Table 1"]
                   if row["quantity"] == f"{channel.name}: deviation at that point")  # fmt: skip
        side = "before" if taus[channel.name] < 1.89 * T_B else "past"
        told = f"is {side} its peak of 0.664 B, at {100 * share:.0f} % of it"
        assert share < 0.75 and (row["verdict"] == "agrees" or told in row["reason"])


def test_table_3_lies_in_the_spread_of_single_draws(lines: dict[str, Any], members: int) -> None:
    drawn = "RMS of one reconstruction, "
    rows = [row for row in lines["Table 3"] if row["quantity"].startswith(drawn)]
    assert len(rows) == 16
    differing = [row for row in rows if row["verdict"] == "differs"]
    outside = [row["quantity"].removeprefix(drawn) for row in differing]
    # Neither grid has all of them inside; each of them is inside by one of the two.
    assert outside == [
        "MTi-7 accelerometer, state space, at nine τ a decade",
        "MTi-7 accelerometer, optimised, at every n of equation 10",
        "MTi-7 gyro, state space, at nine τ a decade",
        "C102-F9R accelerometer, optimised, at every n of equation 10",
        "C102-F9R gyro, optimised, at every n of equation 10",
    ]
    for row in differing:
        assert "6 are inside at nine τ" in row["reason"] and "5 are inside" in row["reason"]
    for channel in CHANNELS.values():
        for grid in GRIDS:
            spread = simulate_lottery(channel, grid)
            assert 0.15 < spread.beats < 0.6  # never the 0 that one draw each seems to show
            assert spread.slow > 0.95
            for low, _, high in spread.ranges:
                assert high / low > (3.0 if members >= 200 else 2.5)


@pytest.fixture(scope="module")
def single() -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Curves of logs of Tables 2, 1 and 2, sample by sample at 1 Hz, by another Allan variance."""
    steps = np.outer(10 ** np.arange(5), np.arange(1, 10)).ravel()
    every = np.rint((np.arange(30) + 0.5) * 600).astype(int)
    taus = np.unique(np.concatenate([steps[steps <= 18_000], every])).astype(float)
    rng = np.random.default_rng(3)
    return taus, [
        np.array([
            allantools.oadev(simulate(model, 1.0, 36_000, rng), rate=1.0, data_type="freq",
                             taus=taus)[1]
            for _ in range(40)
        ])
        for model in (MTI_GYRO.table_2, MTI_GYRO.table_1, MTI_GYRO.table_2)
    ]  # fmt: skip


@pytest.mark.release  # test_table_3_lies_in_the_spread has the draws themselves every day
def test_single_draws_spread_as_full_length_logs_do(single: Any) -> None:
    taus, (measured, *drawn) = single
    short = np.outer([1, 10], np.arange(1, 10)).ravel() / 100.0  # only N there
    models = (MTI_GYRO.table_1, MTI_GYRO.table_2)
    for place, (curves, model) in enumerate(zip(drawn, models, strict=True)):
        square = (curves[:, None] - measured[None, :]) ** 2
        steps = np.isin(taus, np.outer(10.0 ** np.arange(5), np.arange(1, 10)))
        below = (((model.N - GYRO.N) ** 2) / short).sum()
        by_steps = np.sqrt((square[..., steps].sum(-1) + below) / (steps.sum() + short.size))
        by_every = np.sqrt(square[..., np.isin(taus, (np.arange(30) + 0.5) * 600)].mean(-1))
        for values, grid in ((by_steps, "steps"), (by_every, "every")):
            spread = simulate_lottery(MTI_GYRO, grid)  # type: ignore[arg-type]  # the two that there are
            expected = spread.ranges[place]
            assert np.median(values) == pytest.approx(expected[1], rel=0.35)
            beyond = float(np.mean(values >= MTI_GYRO.table_3[place]))
            assert beyond == pytest.approx(spread.beyond[place], abs=0.12)


@pytest.mark.release  # the test of a curve read by the closed form is run every day
def test_single_curves_are_read_as_full_length_logs_are(single: Any) -> None:
    taus, (measured, *_) = single
    kept = taus <= 4000
    curves, taus = measured[:, kept], taus[kept]
    ranges = simulate_readings(MTI_GYRO)
    for symbol, read in (
        ("N", curves[:, 0]),
        ("B", curves.min(axis=1) / 0.6643),
        ("K", curves[:, -1] * math.sqrt(3 / taus[-1])),
        ("T_B", taus[curves.argmin(axis=1)] / 1.8926),
    ):
        low, _, high = ranges[symbol]
        # Of 40, 36 are expected between them; N of logs at a hundredth of the rate scatters more.
        assert np.mean((read >= low * 0.99) & (read <= high * 1.01)) > 0.75, symbol
        assert np.mean(read < low * 0.99) < 0.2 and np.mean(read > high * 1.01) < 0.2, symbol


def test_table_4(lines: dict[str, Any]) -> None:
    # By a pocket calculator: 120 ug/sqrt(Hz), 0.007 deg/s/sqrt(Hz), 0.03 mg and 10 deg/h.
    vendor = {
        "accel_x": (120e-6 * 9.80665, 30e-6 * 9.80665),
        "gyro_x": (math.radians(0.007), math.radians(10.0 / 3600.0)),
    }
    for place, symbol in enumerate("NB"):
        for channel, figures in vendor.items():
            assert read_manufacturer(symbol, f"mti_{channel.removesuffix('_x')}") == pytest.approx(
                figures[place], rel=0.03
            )
    shown = {row["quantity"]: row for row in lines["Table 4"]}
    gyro = shown["N of the MTi-7 gyro, optimised over manufacturer"]
    assert gyro["printed"] == pytest.approx(0.70)
    assert gyro["found"] == pytest.approx(8.4e-5 / (math.radians(0.007) / math.sqrt(2)))
    floor = shown["B of the MTi-7 gyro, optimised over manufacturer"]
    assert floor["printed"] == pytest.approx(6.7 / 4.8)
    tau = np.geomspace(1, 1e4, 3000)
    lowest = min(math.sqrt(integrate_density(GYRO, t)) for t in tau[:: 3000 // 40])
    assert floor["found"] == pytest.approx(lowest / math.radians(10 / 3600), rel=0.05)
    on_1_s, line = lines["Figure 9"]
    assert on_1_s["found"] == pytest.approx(12.0e-5 / 8.42e-5, rel=1e-3)
    assert line["printed"] == pytest.approx(0.664 * 4.8e-5, rel=1e-3)


def test_figures_6_and_7(lines: dict[str, Any]) -> None:
    (accel,), (gyro,) = lines["Figure 6"], lines["Figure 7"]
    # The walks alone are 106 times apart, the white noise 68: it grows up to the end of the range.
    there = math.sqrt(
        integrate_density(CHANNELS["c102_gyro"].table_2, 18e3) / integrate_density(GYRO, 18e3)
    )
    assert gyro["found"] == pytest.approx(there, rel=1e-3)
    assert 68 < gyro["found"] < 8.7e-5 / 8.2e-7 and "18,000 s, the end" in gyro["found_words"]
    assert 1.1 / 0.96 < accel["found"] < 7.2 / 3.4 * 1.1


def test_lines_and_floor(lines: dict[str, Any]) -> None:
    assert lines["Figure 1"][0]["found_words"] == "-0.5, +0, +0.5"
    for model, tau, expected in (
        (NoiseModel(N=2.0), 1.0, 2.0),
        (NoiseModel(K=2.0), 3.0, 2.0),
        (NoiseModel(B=2.0), 7.0, 0.6643 * 2.0),
    ):
        assert math.sqrt(integrate_density(model, tau)) == pytest.approx(expected, rel=2e-3)
    floor, place = (row["found"] for row in lines["Equation 13"])
    assert floor == pytest.approx(math.sqrt(2 * math.log(2) / math.pi))
    process = NoiseModel(B=1.0, T_B=10.0)
    around = [integrate_density(process, 10.0 * place * factor) for factor in (0.9, 1.0, 1.1)]
    assert max(around) == around[1]
    assert math.sqrt(around[1]) == pytest.approx(floor, rel=1e-3)


def test_densities(lines: dict[str, Any]) -> None:
    B, T_B = GYRO.B, GYRO.T_B
    S_B = 2 * B**2 * math.log(2) / (math.pi * 0.4365**2 * T_B)
    assert lines["Equation 8"][0]["found"] == pytest.approx(S_B, rel=3e-4)
    f, corner = 1e-3, 1 / (2 * math.pi * T_B)
    process = S_B / (2 * math.pi * f) ** 2 * (f / corner) ** 2 / (1 + (f / corner) ** 2)
    expected = GYRO.N**2 + process + GYRO.K**2 / (2 * math.pi * f) ** 2
    assert float(GYRO.psd(f)) == pytest.approx(expected, rel=1e-3)


def test_the_discrete_model(lines: dict[str, Any]) -> None:
    """Van Loan's matrix exponential of the continuous model, equations 14 to 17."""
    T, T_B = 0.01, GYRO.T_B
    A = np.diag([-1 / T_B, 0.0])
    S_B = 2 * GYRO.B**2 * math.log(2) / (math.pi * 0.4365**2 * T_B)
    S = np.diag([S_B, GYRO.K**2])
    block = expm(np.block([[-A, S], [np.zeros((2, 2)), A.T]]) * T)
    phi = block[2:, 2:].T
    space = GYRO.state_space(100.0)
    assert space.transition == pytest.approx(phi, rel=1e-9)
    assert np.diag(space.process_noise) == pytest.approx(np.diag(phi @ block[:2, 2:]), rel=3e-4)
    assert space.output.tolist() == [1.0, 1.0]
    assert space.measurement_noise == pytest.approx(GYRO.N**2 / T)
    (step,) = lines["Equation 22"]
    assert step["found"] == pytest.approx(1 - T / T_B, abs=1e-6)
    assert lines["Equation 10"][0]["found"] == 7.0


@pytest.mark.parametrize(("members", "known"), few([(50, 0.3)], [(200, 0.15)]))
def test_the_weight_of_equation_25(members: int, known: float) -> None:
    """The standard deviation of the Allan variance over that of many logs, of a tenth the rate."""
    rng = np.random.default_rng(4)
    logs = [simulate(GYRO, 1.0, 36_000, rng) for _ in range(members)]
    taus = np.array(WEIGHED_AT)
    variances = np.array(
        [allantools.oadev(log, rate=1.0, data_type="freq", taus=taus)[1] ** 2 for log in logs]
    )
    relative = variances.std(axis=0) / variances.mean(axis=0)
    for tau, spread in zip(taus, relative / (2 * np.sqrt(taus / 72_000.0)), strict=True):
        meant, printed = compute_weight_ratios(tau)
        assert spread == pytest.approx(meant, rel=known)  # of 50 to 10 %, of 200 to 5
        assert 0.7 < meant < 1.1  # the weight meant takes about what is there
        assert printed < 1e-3  # in rad/s; in degrees it would be 57 times that


def test_the_sign_of_equation_26(lines: dict[str, Any]) -> None:
    for tau in (1.0, 30.0, 300.0, 3000.0):
        assert float(GYRO.allan_variance(tau)) == pytest.approx(
            integrate_density(GYRO, tau), rel=1e-6
        )
    assert evaluate_as_printed(GYRO, 100.0) > 10 * integrate_density(GYRO, 100.0)
    for number in (26, 27):
        assert lines[f"Equation {number}"][0]["verdict"] == "misprint"

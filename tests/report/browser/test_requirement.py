"""A requirement that the reader changes gives the verdicts of Python.

The script and `navigation` are compared on sensors with every kind of term, one and several
specimens, limits of the class and printed figures, and shipped requirements with random changes.
"""

import json
import random
import shutil
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser

from imubench_pipeline import report
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.error_budget.in_use import Figure, read_figures
from imubench_pipeline.navigation.expected_errors import (
    list_error_rows,
    list_requirement_questions,
)
from imubench_pipeline.navigation.selection import rank_sensors
from imubench_pipeline.navigation.suitability import Abilities, read_abilities
from imubench_pipeline.navigation.verdicts import compact
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import judge_sensors
from imubench_pipeline.noise import TERMS, GaussMarkov
from imubench_pipeline.noise.growth import Calibrated, Uncalibrated
from imubench_pipeline.noise.terms.flicker import Flicker
from imubench_pipeline.noise.terms.power_laws import Quantization, Ramp, RandomWalk, WhiteNoise
from imubench_pipeline.noise.terms.sinusoid import Sinusoid
from imubench_pipeline.settings.requirements import Requirement, read_requirements
from imubench_pipeline.settings.sensor import shipped_sensors
from imubench_pipeline.settings.shipped import CATALOGUE, list_folders
from tests.conftest import few
from tests.report.browser.made import Report
from tests.report.browser.reader import TOO_WIDE, Open

Recordings = Mapping[str, tuple[str, Mapping[str, Estimate]]]  # by name: device and estimates
Sensors = Mapping[str, tuple[Recordings, Mapping[str, Any], Abilities]]
SEED = 7


def compute_by_python(
    requirement: Requirement, sensors: Sensors, draws: int
) -> dict[str, tuple[str, float | None, int | None, int]]:
    """Return verdict, margin, rank and number of conditions by sensor."""
    questions = list(list_requirement_questions("r", requirement))
    rows, about = [], []
    for sensor, (recordings, figures, _) in sensors.items():
        for recording, (device, estimates) in recordings.items():
            names = {"sensor": sensor, "recording": recording}
            by_channel = dict(figures) | {c: figures[c.split("_")[0]] for c in estimates}
            rows += list_error_rows(
                names, estimates, questions, draws=draws, seed=SEED, figures=by_channel
            )
            about.append(
                RecordingRow(**names, device=device, kind="static", simulated=False, status="ok")
            )
    basis = Basis.of(about)
    described = {
        name: {"price_class": "consumer", "abilities": has.model_dump(mode="json")}
        for name, (_, _, has) in sensors.items()
    }
    judged = judge_sensors(rows, {"r": requirement}, described, basis)
    return {
        row.sensor: (row.verdict, row.margin, row.rank, len(row.conditions))
        for row in rank_sensors(list(judged), basis)
        if row.decides
    }


def pack(requirements: Mapping[str, Requirement], sensors: Sensors, draws: int) -> dict[str, Any]:
    """Return the models for the script."""
    packed = {}
    for name, (recordings, figures, has) in sensors.items():
        used, most = compact.select_recordings(list(recordings.values()))
        packed[name] = {
            "simulated": False,
            "recordings": [
                {
                    "device": device,
                    "channels": compact.pack_channels(
                        estimates,
                        dict(figures) | {c: figures[c.split("_")[0]] for c in estimates},
                        draws=draws,
                        seed=SEED,
                        most=most,
                    ),
                }
                for device, estimates in used
            ],
            "demands": {
                key: compact.pack_demands(requirement, "consumer", has)
                for key, requirement in requirements.items()
            },
        }
    return {"sensors": packed}


def change_at_random(requirement: Requirement, rng: random.Random) -> Requirement:
    """Return a requirement with other times, limits, rest, temperature change and turns."""
    stated = requirement.model_dump(mode="json")
    units = {"attitude": "rad", "heading": "rad", "velocity": "m/s"}
    for limit, of in zip(stated["limits"], requirement.limits, strict=True):
        limit["after"] = f"{of.seconds * 10 ** rng.uniform(-1, 1):.6g} s"
        limit["at_most"] = f"{of.size * 10 ** rng.uniform(-1.5, 2):.6g} {units.get(of.error, 'm')}"
    if stated["static_window"]:
        stated["static_window"] = f"{10 ** rng.uniform(0, 2.5):.6g} s"
    stated["environment"]["temperature_change"] = rng.choice(
        [None, f"{rng.uniform(0.1, 20):.4g} K"]
    )
    stated["environment"]["turns"] = rng.choice([None, f"{rng.uniform(10, 720):.4g} deg"])
    return Requirement.model_validate(stated)


def judge_by_script(
    browser: Browser, models: dict[str, Any], asked: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return the judgements of the script for packed requirements."""
    for one in asked:
        for limit in one["limits"]:
            limit["sigma"] = limit["at_most"] / one["sigmas"]
    judged: list[dict[str, Any]] = run_script(
        browser, "([models, asked]) => asked.map((one) => judgeSensors(models, one))", models, asked
    )
    return judged


def run_script(browser: Browser, function: str, *arguments: Any) -> Any:
    """Return the result of a function that calls the script."""
    script = Path(report.__file__).with_name("static") / "requirement.js"
    page = browser.new_page()
    try:
        page.add_script_tag(content=script.read_text(encoding="utf-8"))
        # A mapping from the browser has no infinite numbers.
        return json.loads(
            page.evaluate(f"(given) => JSON.stringify(({function})(given))", arguments)
        )
    finally:
        page.close()


@pytest.mark.parametrize("order", [0, 1, 2])
def test_every_term_grows_as_in_python(order: int, browser: Browser) -> None:
    terms = [Quantization(2.0), WhiteNoise(2.0), Flicker(2.0), RandomWalk(2.0), Ramp(2.0)]
    terms += [GaussMarkov(2.0, T_B) for T_B in (0.3, 20.0, 1e5)]
    terms += [Sinusoid(2.0, frequency) for frequency in (1e-4, 0.3)]
    assert {type(term) for term in terms} == set(TERMS)
    starts = [{"window": 1.0}, {"window": 300.0}, {"on": 60.0}]
    asked, expected = [], []
    for term, start, time in product(terms, starts, (2.0, 70.0)):
        asked.append([term.symbol, *([*term.values.values(), 0.0][:2]), order, time, start])
        window = start.get("window")
        calibrated = Calibrated(window) if window else Uncalibrated(bias=0.0, on_time=start["on"])
        expected.append(term.growth(order, time, calibrated))
    found = run_script(
        browser, "([asked]) => asked.map(([symbol, ...rest]) => GROWTHS[symbol](...rest))", asked
    )
    assert found == pytest.approx(expected, rel=1e-6)


def estimate(model: str, scale: float) -> Estimate:
    """Return an estimate with the terms of a name, whose limits are a factor of 1.3 away."""

    def known(value: float) -> Parameter:
        return Parameter(value * scale, lower=value * scale / 1.3, upper=value * scale * 1.3)

    sizes = {"Q": 1e-6, "N": 5e-5, "B": 3e-5, "K": 1e-6, "R": 1e-9}
    parameters = {name: known(sizes[name]) for name in sizes if name in model.replace("GM", "B")}
    if "GM" in model:
        parameters["T_B"] = Parameter(80.0, lower=40.0, upper=200.0)
    wave = {"amplitude": known(1e-4), "frequency": Parameter(0.07)}
    return Estimate("likelihood", parameters, lines=[wave] if "S" in model else [])


@pytest.fixture(scope="module")
def sensors() -> Sensors:
    shipped = shipped_sensors()
    made = {}
    for name, models, devices, scale in (
        ("mti_7", ("N+GM+K", "Q+N+B+K"), ("a",), 1.0),
        ("bmi088", ("N+GM", "N+GM+R"), ("a", "b", "c", "c"), 4.0),
        ("adis16465", ("N+B+K",), ("a", "a"), 0.2),
        ("scc2130", ("N+GM+K",), ("a",), 1.0),
    ):
        recordings = {}
        for place, device in enumerate(devices):
            size = scale * (1.0 + 0.15 * place)
            gyros = {f"gyro_{x}": estimate(one, size) for x, one in zip("xy", models, strict=False)}
            accels = {
                f"accel_{x}": estimate(one, 9.0 * size)
                for x, one in zip("xy", models, strict=False)
            }
            of_log = gyros if name == "scc2130" else gyros | accels
            recordings[f"{name}_{place}"] = device, of_log
        figures = {of: read_figures(shipped[name], of) for of in ("gyro", "accel")}
        if name == "mti_7":  # a temperature effect from a log
            figures["gyro"]["temperature"] = Figure(sigma=2e-6, spread=1e-6)
        made[name] = recordings, figures, read_abilities(shipped[name])
    return made


@pytest.mark.parametrize("changes", few([8], [30]))
def test_verdicts_and_margins_are_those_of_python(
    changes: int, browser: Browser, sensors: Sensors
) -> None:
    rng, draws = random.Random(20), 16
    requirements = read_requirements(list_folders([CATALOGUE], "requirements"))
    turned_on = requirements["drone_attitude"].model_dump(mode="json") | {"static_window": None}
    for name, bias in (("stated_biases", "20 mg"), ("printed_biases", None)):
        turn_on = {"turn_on": {"gyro": "0.02 deg/s" if bias else None, "accel": bias}}
        requirements[name] = Requirement.model_validate(turned_on | turn_on)
    models = pack(requirements, sensors, draws)
    asked: list[tuple[str, Requirement]] = []
    for name, requirement in requirements.items():
        number = changes if requirement.static_window else 2
        asked += [(name, requirement)]
        asked += [(name, change_at_random(requirement, rng)) for _ in range(number)]
    packed = [compact.pack_requirement(*one) for one in asked]
    judged = judge_by_script(browser, models, [one for one in packed if one])
    assert len(judged) == len(asked) > 3 * changes
    seen = set()
    for (name, requirement), found in zip(asked, judged, strict=True):
        expected = compute_by_python(requirement, sensors, draws)
        for sensor, (verdict, margin, rank, conditions) in expected.items():
            own, said = found[sensor], (name, sensor, requirement)
            assert (own["verdict"], own["rank"]) == (verdict, rank), said
            if margin is None:
                assert own["margin"] is None, said
            else:
                assert own["margin"] == pytest.approx(margin, rel=0.01), said
            assert own["conditions"] == conditions or not conditions, said
            seen.add(verdict)
    assert seen >= {"meets", "fails", "meets_if", "not_enough_data"}


def test_the_address_carries_the_requirement(
    read: Open, bench: Report, sensors: Sensors, tmp_path: Path
) -> None:
    folder = tmp_path / "report"
    shutil.copytree(bench.folder, folder)
    shipped = read_requirements(list_folders([CATALOGUE], "requirements"))
    requirements = {"rover": shipped["ground_robot"]}
    models = pack(requirements, {"alpha": sensors["adis16465"], "beta": sensors["bmi088"]}, 16)
    models["requirements"] = [compact.pack_requirement(*one) for one in requirements.items()]
    (folder / "assets/models.js").write_text(f"imubenchModels({json.dumps(models)});")
    page = read(folder).page
    assert page.locator(".own").count() == 0
    page.get_by_text("Your requirement").click()
    own = page.locator("[data-decisions] td.own")
    own.first.wait_for()
    before = own.all_inner_texts()
    page.get_by_label("Allowed heading (deg)").fill("200")
    after = own.all_inner_texts()
    assert after != before and "meets" in after[0] and "rank 1" in after[0]
    assert page.locator(".margins .own circle").count() == 2
    hash_of_page = page.evaluate("location.hash")
    assert "yours=rover*" in hash_of_page
    page = read(folder, f"compare.html{hash_of_page}&a=alpha&b=beta").page
    row = page.locator("table.requirements .own")
    row.wait_for()
    assert row.locator("th").inner_text() == "Yours: heading 200 deg in 600 s"
    assert row.locator("td").first.inner_text().startswith("meets, margin ")
    page = read(folder, f"index.html{hash_of_page}").page
    own.first.wait_for()
    assert own.all_inner_texts() == after
    assert page.get_by_label("Allowed heading (deg)").input_value() == "200"
    assert page.evaluate(TOO_WIDE) == []


def test_numbers_are_multiples_of_the_own_sensor_on_every_page(read: Open, bench: Report) -> None:
    page = read(bench.folder).page
    assert page.locator(".mine").count() == 0
    page.locator("[data-decisions]").get_by_role(
        "button", name="My sensor: Vendor & Sons A-1"
    ).click()
    page.locator(".mine").first.wait_for()
    assert "mine=alpha" in page.evaluate("location.hash")
    page = read(bench.folder, "sensors/beta.html#mine=alpha").page
    page.locator(".mine").first.wait_for(state="attached")  # most are folded
    for text in page.locator("td:has(> data) > .mine").all_inner_texts():
        assert text == "mine" or text.endswith(" × mine")
    margins = {
        (row["requirement"], row["error"]): {
            one["sensor"]: one["margin"]
            for one in bench.of("ranking", requirement=row["requirement"], error=row["error"])
        }
        for row in bench.of("ranking", sensor="beta")
        if row["margin"]
    }
    for (requirement, error), of in margins.items():
        place = f"[data-from^='ranking/{requirement}/beta/{error}/'][data-from$='/margin'] + .mine"
        said = page.locator(place).first.text_content() or ""
        assert float(said.split(" ")[0]) == pytest.approx(of["beta"] / of["alpha"], rel=0.06)
    page.locator("h1 .pin").click()  # beta instead
    assert "mine=beta" in page.evaluate("location.hash")
    page.locator("h1 .pin").click()
    assert page.locator(".mine").count() == 0 and "mine" not in page.evaluate("location.hash")

"""The pages of gyros that were turned between north and south."""

import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.extensions.earth_rate.page import (
    describe_published,
    describe_settling,
    summarise_earth_rate,
    summarise_needs,
)
from imubench_pipeline.extensions.earth_rate.tables import (
    EarthRatePredictionRow,
    EarthRatePublishedRow,
    EarthRateRow,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.report.pages import list_pages
from imubench_pipeline.report.publish import publish, render_one_file
from imubench_pipeline.report.site import Site
from imubench_pipeline.tables.files import build
from tests.earth_rate.recordings import EVERY_30, put, put_at_rest, run, turned_log
from tests.earth_rate.runs import PAPER, turned
from tests.report.pages import Read, read_pages, sound_pages
from tests.report.tables import DEGREE, Rows, joined, recording_rows, rejected_rows, site

pytestmark = pytest.mark.usefixtures("small_report")

HOUR = DEGREE / 3600
ABOUT: dict[str, Any] = {"device": "7", "kind": "two_position", "simulated": False, "status": "ok",
                         "rate": 32.0, "rate_from": "stated", "duration": 600.0,
                         "samples": 19_200}  # fmt: skip
PUBLISHED: dict[str, Any] = {
    "channel": "gyro_x",
    "part": "whole",
    "place": "section 6",
    "printed": "0.0004846 deg/s",
    "published": 1.745 * HOUR,
    "truth": 15.04 * HOUR,
    "duration": 720.0,
    "white": 1.845 * HOUR,
    "sigma": 1.915 * HOUR,
    "sigma_filter": 1.9 * HOUR,
    "off_sigma": -6.94,
    "verdict": "beyond the noise",
    "simulated": 14.1 * HOUR,
    "simulated_filter": 14.2 * HOUR,
    "assumed": "latitude",
}


def turned_rows(folder: Path, recording: str, static: list[Path], **declared: Any) -> Rows:
    """The rows of a recording of a gyro that was turned, as a run leaves them."""
    found = run(put(folder / recording, turned_log()), static, **declared)
    names = {"sensor": "s", "recording": recording}
    return {"recordings": [names | ABOUT]} | found


def some(folder: Path) -> list[Rows]:
    rest = put_at_rest(folder / "night")
    good = turned_rows(folder, "run", [rest], last=["5 min"])
    good["earth_rate_published"] = [{"sensor": "s", "recording": "run"} | PUBLISHED]
    return [
        recording_rows("s", "night"),
        good,
        turned_rows(folder, "unknown", []),
        rejected_rows("s", "bad", "bad.yaml: latitude is missing", kind="two_position"),
    ]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(joined(*some(tmp_path_factory.mktemp("kept"))))


@pytest.fixture(scope="module")
def published(made: Site, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    publish(made, folder)
    return folder


@pytest.fixture(scope="module")
def read(published: Path) -> dict[str, Read]:
    return sound_pages(published, {f"figures/allan_gyro_x.{kind}" for kind in ("svg", "pdf")})


def test_the_page_of_a_run_says_what_was_found(read: dict[str, Read]) -> None:
    page = read["recordings/s/run.html"]
    assert "The filter estimates an Earth's rate of" in page.text
    assert "19 turns between north and south, at latitude 0°" in page.text
    assert "it is not used for the Allan variance, noise parameters or ranking" in page.text
    assert "this is no estimate" in page.text
    kinds = {one.attributes.get("data-kind") for one in page.elements if one.tag == "figure"}
    assert kinds == {"dwells", "earth_rate", "bound"}  # of samples none are kept here
    parts = [one.attributes.get("data-part") for one in page.elements
             if one.attributes.get("data-kind") == "earth_rate"]  # fmt: skip
    assert parts == ["whole", "last 5 min"]
    courses = page.data["turned"]["parts"]["whole"]["courses"]
    given = {"known_rate", "known_rate_radians"}
    assert set(courses) == {"pairs", "triples", "filter", "smoother", "drift"} | given


def test_earth_rate_page_without_noise_model_shows_turns_and_reason(read: dict[str, Read]) -> None:
    page = read["recordings/s/unknown.html"]
    assert "The noise of this sensor is not known" in page.text
    assert page.naming("turn 19", "tr") and "Required recordings" not in page.text


def test_the_start_page_names_what_was_not_found(read: dict[str, Read]) -> None:
    text = read["index.html"].text
    assert (
        "1 turned recording without an estimate" in text
        and "The noise of this sensor is not known" in text
    )
    assert "two positions" in read["sensors/s.html"].text


def test_a_rejected_run_stands_with_its_reason(read: dict[str, Read]) -> None:
    assert "latitude is missing" in read["recordings/s/bad.html"].text
    assert "latitude is missing" in read["earth_rate.html"].text


def test_the_page_of_all_runs(read: dict[str, Read]) -> None:
    page = read["earth_rate.html"]
    assert len(page.naming("run", "tr")) >= 2
    assert "The noise that the source prints explains 0 published estimates" in page.text
    assert "run by −6.94 σ" in page.text and "0.0004846 deg/s" in page.text
    for goal in ("100 %", "10 %", "1 %"):
        assert page.naming(goal, "td")
    assert page.data["published"][0]["published"] == PUBLISHED["published"]


def test_earth_rate_page_is_linked_only_with_turned_runs(read: dict[str, Read]) -> None:
    assert "earth_rate.html" in read["experiments.html"].links
    others = site(joined(recording_rows("s", "night")))
    assert "earth_rate.html" not in {page.path for page in list_pages(others)}
    assert "earth_rate.html" not in {entry.file for entry in others.existing}


def test_a_page_is_written_again_only_where_its_run_changed(
    made: Site, published: Path, tmp_path: Path
) -> None:
    shutil.copytree(published, tmp_path, dirs_exist_ok=True)
    tables = dict(made.tables)
    again = replace(made)
    assert publish(again, tmp_path) == []
    rows = tables["earth_rate"].to_pylist()
    rows[0]["value"] *= 1.01
    changed = replace(made, tables=tables | {"earth_rate": build("earth_rate", rows)})
    written = {path for path in publish(changed, tmp_path) if path.endswith(".html")}
    assert "recordings/s/run.html" in written and "earth_rate.html" in written
    assert "recordings/s/unknown.html" not in written


def test_a_report_may_hold_nothing_but_such_runs(tmp_path: Path) -> None:
    publish(site(joined(turned_rows(tmp_path / "kept", "run", []))), tmp_path / "report")
    found = read_pages(tmp_path / "report")
    assert {path: page.faults for path, page in found.items() if page.faults} == {}
    assert "1 sensor 1 recording" in " ".join(found["index.html"].text.split())


@pytest.mark.release
def test_turns_that_nothing_shows_are_a_remark(tmp_path: Path) -> None:
    quiet = NoiseModel(N=PAPER.N / 2.0)
    rest = put_at_rest(tmp_path / "night", quiet)
    log = {"gyro_x": turned(EVERY_30, 600.0, peak=0.0, noise=quiet)}
    rows = {"recordings": [{"sensor": "s", "recording": "run"} | ABOUT]}
    rows |= run(put(tmp_path / "run", log), [rest])
    publish(site(joined(recording_rows("s", "night"), rows), tmp_path), tmp_path / "report")
    found = read_pages(tmp_path / "report")
    for path in ("earth_rate.html", "recordings/s/run.html"):
        assert "19 of 19 turns rest on the schedule" in found[path].text, path
        assert "ambiguous" in found[path].text


@pytest.mark.release  # every day tests/report/test_publish.py asks for all pages in one file
def test_all_pages_stand_in_one_file(made: Site) -> None:
    text = render_one_file(made)
    assert 'id="page:earth_rate.html"' in text and 'id="page:recordings/s/run.html"' in text


def _best_of(tried: list[float], nearly: list[float], best: float) -> str:
    predicted = partial(EarthRatePredictionRow, sensor="s", recording="run", channel="gyro_x",
                        latitude=0.0, turns=1)  # fmt: skip
    rows = [predicted(of="goal", goal=1.0, dwell=28.0, time=58.0, sigma=1.0, heading=0.1)]
    rows += [
        predicted(of="dwell", dwell=dwell, time=600.0, relative=0.1, best=dwell == best,
                  nearly_best=dwell in nearly)
        for dwell in tried
    ]  # fmt: skip
    found = summarise_needs(rows)
    assert found is not None
    return found.best


def test_sentences() -> None:
    estimate = partial(EarthRateRow, sensor="s", recording="run", channel="gyro_x", part="whole",
                       parameter="rate", unit="rad/s", truth=15.04 * HOUR,
                       latitude=0.0)  # fmt: skip
    row = estimate(method="filter", value=30 * HOUR, upper=32 * HOUR, status="ok", off_sigma=15.0)
    assert "15 standard deviations away" in summarise_earth_rate([row], "practical")
    assert "Noise does not explain this error" in summarise_earth_rate([row], "practical")
    assert (
        summarise_earth_rate([], "practical")
        == "This recording has no estimate of the Earth's rate."
    )
    assert _best_of([300.0, 20.0, 5.0], [300.0], 300.0).endswith(
        " It is the longest dwell that was tried."
    )
    longest = _best_of([300.0, 20.0, 5.0], [300.0, 20.0], 300.0)
    assert "tried; dwells down to 20 s are less" in longest
    shortest = _best_of([300.0, 20.0, 5.0], [20.0, 5.0], 5.0)
    assert "shortest dwell that was tried; dwells up to 20 s" in shortest
    assert "Dwells from 19 s to 21 s" in _best_of(
        [300.0, 21.0, 20.0, 19.0, 5.0], [21.0, 20.0, 19.0], 20.0
    )
    assert "All other dwells" in _best_of([300.0, 20.0, 5.0], [20.0], 20.0)
    names = {"sensor": "s", "recording": "a", "verdict": "within the noise"}
    assert describe_published([EarthRatePublishedRow(**PUBLISHED | names)]) == (
        "Noise explains the error of the published estimate. In these runs, σ of a filter that "
        "does not know the rate is 0.78 % smaller than that of the mean over pairs."
    )
    given = estimate(status="given", method="known_rate", settled=900.0)
    later = estimate(status="given", method="known_rate", settled=1800.0)
    other = estimate(status="given", method="known_rate_radians")
    assert "given rate after 15 min of data with P₀ in (°/s)²; never with P₀ in (rad/s)²" in (
        describe_settling([given, other])
    )
    assert "after 15 min to 30 min of data" in describe_settling([given, later])
    assert describe_settling([]) == ""
    assert describe_published([]) == "" and summarise_needs([]) is None

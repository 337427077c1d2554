import json
import os
import re
import shlex
import shutil
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pyarrow.compute as pc
import pytest

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.extensions.figures import figures
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.report import publish as publishing
from imubench_pipeline.report.folder import count_attempt, read_failed_pages
from imubench_pipeline.report.pages import list_pages
from imubench_pipeline.report.publish import load_site, publish, render_one_file
from imubench_pipeline.report.site import Site
from imubench_pipeline.report.start import START
from imubench_pipeline.tables.files import build
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES
from tests.conftest import few
from tests.report.pages import Read, lost_links, read_pages
from tests.report.tables import (
    KNOWN,
    MODEL,
    ROBOT,
    WITHOUT_K,
    Rows,
    Tables,
    coverage_rows,
    joined,
    put_log,
    put_samples,
    put_tables,
    recording_rows,
    rejected_rows,
    settings_of,
    site,
)

ASSETS = {
    f"assets/{name}"
    for name in ("report.css", "report.js", "search.js", "models.js", "plotly.min.js")
}
OF_ALL = {"index.html", "recordings.html", "datasheets.html", "fusion.html"}
ALWAYS = {"index.html", "recordings.html", "experiments.html", "theory.html", "made.html"}
PAGES_WITH_KEYS = ("recordings/", "devices/")  # made again only if their data changed
KEPT = {"pages.json", "settings.json"}
ASKED = {"robot": ROBOT}
THEORY_FIGURE = "data:image/svg+xml;base64,PHN2Zy8+"
PLOTTING = "var Plotly = {};"
MADE = publishing._make_page


@pytest.fixture(autouse=True, scope="module")
def _quick() -> Iterator[None]:
    """What is large and the same in every report is made by the tests of the command alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "encode_theory", lambda system: THEORY_FIGURE)
        patch.setattr(publishing, "read_plotting_script", lambda: PLOTTING)
        patch.setattr(publishing, "digest_sources", lambda *modules: "code")
        yield


def once(made: Site) -> set[str]:
    """The pages that there is one of: those of experiments and of catalogues are absent."""
    shown = {"datasheets.html": "coverage", "fusion.html": "fusion"}
    files = ALWAYS | {page for page, table in shown.items() if made.tables[table].num_rows}
    if any(view.static for view in made.views):
        files |= {"compare.html"}
    assert files == {entry.file for entry in made.existing}
    return files


def some() -> list[Rows]:
    """Results of a small run, to be changed at will."""
    return deepcopy(_some())


@cache
def _some() -> list[Rows]:
    findings = [
        {"finding": "missing_samples", "detail": "a long gap", "start": 60.0, "end": 7000.0},
        {"finding": "lines", "severity": "note", "detail": "0.5 Hz", "channel": "gyro_x"},
        {"finding": "stuck", "severity": "fatal", "detail": "dead", "channel": "gyro_y"},
    ]
    asked: dict[str, Any] = {"requirements": ASKED}
    both = ("gyro_x", "accel_x")
    return [
        recording_rows("one", "day1", both, findings=findings, found=[0.5], **asked,
                       started="2024-01-01T00:00:00Z", temperature_min=20.0, temperature_max=25.0),
        recording_rows("one", "day2", parameters=WITHOUT_K, device="unit 7", **asked),
        rejected_rows("one", "torn", "line 3: found '<x>' & more", device="unit 7"),
        recording_rows("two", "phantom", both, simulated=True, printed=False, **asked),
        coverage_rows("one", "two"),
    ]  # fmt: skip


def run(*several: Rows, asked: Mapping[str, Any] | None = None, **given: Any) -> Site:
    """The site of a run that has these results."""
    tables = joined(*several, requirements=asked)
    return site(tables, requirements=asked, **given)


@dataclass
class Report:
    folder: Path
    results: Path
    tables: Tables
    written: list[str]

    def anew(self) -> Site:
        """Its site, made as by another run."""
        return site(self.tables, self.results, requirements=ASKED)

    @cached_property
    def site(self) -> Site:
        return self.anew()


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    results = tmp_path_factory.mktemp("results")
    tables = joined(*some(), requirements=ASKED)
    put_tables(tables, results)
    put_samples(results, "one", "day1")
    made = site(tables, results, requirements=ASKED)
    return Report(results / "report", results, tables, publish(made, results / "report"))


@pytest.fixture(scope="module")
def read(report: Report) -> dict[str, Read]:
    return read_pages(report.folder)


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def age(folder: Path) -> None:
    for path in folder.rglob("*"):
        os.utime(path, (1.0, 1.0))


def touched(folder: Path) -> set[str]:
    """The files that were written since the folder was aged."""
    return {name for name in files(folder) if (folder / name).stat().st_mtime != 1.0}


def sound(folder: Path, channels: set[str] | None = None) -> dict[str, Read]:
    """Read a report, whose pages must be valid and whole and lead to what there is."""
    read = read_pages(folder)
    assert {path: page.faults for path, page in read.items() if page.faults} == {}
    assert {path: page.external() for path, page in read.items() if page.external()} == {}
    names = channels or {"gyro_x", "accel_x"}
    besides = {f"figures/allan_{name}.{kind}" for name in names for kind in ("svg", "pdf")}
    besides |= {
        f"../tables/{table}.{kind}"
        for table in set(TABLES) - set(OF_ONE_RECORDING)
        for kind in ("csv", "parquet")
    }
    assert lost_links(read, folder, besides) == set()
    return read


# What there is, and that it is sound.


def test_a_first_run_writes_every_page_and_the_start_page_last(report: Report) -> None:
    assert set(report.written) == ASSETS | once(report.site) | {
        "recordings/one/day1.html",
        "recordings/one/day2.html",
        "recordings/one/torn.html",
        "recordings/two/phantom.html",
        "devices/one/unit 7.html",
        "sensors/one.html",
        "sensors/two.html",
    }
    assert report.written[-1] == "index.html"
    assert len(report.written) == len(set(report.written))
    assert set(files(report.folder)) == set(report.written) | KEPT
    keys = json.loads((report.folder / "pages.json").read_text())
    assert set(keys) == set(report.written) - ASSETS


def test_pages_are_sound_and_lead_only_to_what_there_is(report: Report) -> None:
    read = sound(report.folder)
    for path, page in read.items():
        assert page.source.count("<main") == 1, path
        assert [one.text for one in page.elements if one.tag == "h1"] != [], path
        assert page.source.endswith("</html>\n")


def test_every_page_can_be_reached_from_the_start_page(read: dict[str, Read]) -> None:
    reached, todo = set(), ["index.html"]
    while todo:
        path = todo.pop()
        if path in reached or path not in read:
            continue
        reached.add(path)
        base = Path(path).parent
        for link in read[path].links:
            target = link.partition("#")[0].replace("%20", " ")
            todo.append(os.path.normpath(base / target) if target else path)
    assert reached == set(read)


def test_styles_and_scripts_fetch_nothing_from_elsewhere(report: Report) -> None:
    for name in ("report.css", "report.js"):
        text = (report.folder / "assets" / name).read_text()
        assert re.findall(r"https?://(?!www\.w3\.org/)\S*|url\((?!data:)", text) == []


def test_the_start_page_says_what_was_rejected_and_why(read: dict[str, Read]) -> None:
    page = read["index.html"]
    assert "2 sensors 4 recordings" in " ".join(page.text.split())
    assert "4 recordings of 2 sensors" in read["recordings.html"].text
    (head,) = (one for one in page.elements if one.attributes.get("id") == "rejected-head")
    assert head.text == "1 rejected"
    (reason,) = page.naming("line 3: found '<x>' & more", "li")
    assert reason.text.strip().startswith("V & Co one, torn")
    assert page.source.index("line 3") < page.source.index('id="comparison"')


def test_a_rejected_recording_says_why_wherever_it_is_listed(read: dict[str, Read]) -> None:
    reason = "line 3: found '<x>' & more"
    own = read["recordings/one/torn.html"]
    assert reason in own.text and "was rejected" in own.text
    for path in ("index.html", "recordings.html", "sensors/one.html", "devices/one/unit 7.html"):
        assert reason in read[path].text, path


def test_figures_of_a_rejected_recording_are_not_offered(read: dict[str, Read]) -> None:
    offered = "imubench figures results --sensor one --recording"
    assert offered in read["recordings/one/day1.html"].text
    assert offered not in read["recordings/one/torn.html"].text
    assert "To recompute the results: snakemake" in read["recordings/one/torn.html"].text


def test_pages_mark_simulated_recordings_as_simulated(
    read: dict[str, Read],
) -> None:
    naming = {path: page for path, page in read.items() if "phantom" in page.text}
    assert set(naming) >= {"index.html", "recordings.html", "sensors/two.html"}
    for path, page in naming.items():
        assert "imulated" in page.text, path
        for one in page.naming("phantom"):
            assert "imulated" in one.text, (path, one)
    for path in ("index.html", "sensors/two.html", "recordings/two/phantom.html"):
        drawn = [one for one in read[path].data["channels"] if one["sensor"] == "two"]
        assert drawn and all(one["simulated"] for one in drawn)
    assert (
        "Simulated from known parameters, not measured" in read["recordings/two/phantom.html"].text
    )
    assert "It is simulated" in read["sensors/two.html"].text


def test_what_is_measured_is_not_called_simulated(read: dict[str, Read]) -> None:
    for path in ("sensors/one.html", "recordings/one/day1.html", "devices/one/unit 7.html"):
        lines = [one.text for one in read[path].elements if one.tag in ("h1", "li", "tr")]
        assert not [line for line in lines if re.search(r"\bsimulated\b", line)], path


def test_recording_page_shows_the_simulated_truth(read: dict[str, Read]) -> None:
    rows = read["recordings/two/phantom.html"].naming("simulated with", "tr")
    assert len(rows) == 2 * 2  # of each channel: below its values, and below all methods
    assert all("assumed" in row.text for row in rows)
    assert "simulated with" not in read["recordings/one/day1.html"].text


def test_values_stand_in_the_units_of_engineers_and_keep_their_si_value(
    read: dict[str, Read],
) -> None:
    page = read["recordings/one/day1.html"]
    values = [one for one in page.elements if one.tag == "data"]
    shown = {(one.attributes["value"], one.text) for one in values}
    # 20 °/h of white noise at 1 s are 20 / 60 °/√h, known to 10 %.
    assert (f"{MODEL.N:.7g}", "0.33") in shown
    assert (f"{MODEL.B:.7g}", "10") in shown
    heads = [one.text for one in page.elements if one.tag == "th"]
    assert "N (°/√h)" in heads and "B (°/h)" in heads


def test_a_channel_without_a_random_walk_says_so(read: dict[str, Read]) -> None:
    page = read["recordings/one/day2.html"]
    (answer,) = (one for one in page.elements if one.attributes.get("class") == "answer")
    assert answer.text.startswith("N 0.33 °/√h (± 10 %); B 10 °/h (± 25 %); T_B 100 s (± 25 %);")
    assert "K" not in answer.text
    assert page.naming("K is not in the model: the data do not support it; below 3 °/h/√h.", "li")
    (row,) = (one for one in page.naming("likelihood", "tr") if "recommended" in one.text)
    assert re.search(r"below 3 \(95 %\)\s*not in the model", row.text)


def test_findings_stand_on_the_page_of_their_recording(read: dict[str, Read]) -> None:
    page = read["recordings/one/day1.html"]
    (row,) = page.naming("a long gap", "tr")
    assert "60 s" in row.text and "117 min" in row.text and "all" in row.text
    (row,) = page.naming("dead", "tr")
    assert "gyro y" in row.text
    assert [one["number"] for one in page.data["findings"]] == [1, 2, 3]
    assert page.text.index("dead") < page.text.index("a long gap") < page.text.index("0.5 Hz")
    # A channel of which there are no results has no section to lead to.
    assert "#gyro_y" not in page.links and "#gyro_x" in page.links
    assert "a long gap" not in read["recordings/one/day2.html"].text
    assert "1 recording in doubt" in read["index.html"].text


def test_a_warning_that_is_shown_on_purpose_says_so(report: Report) -> None:
    made = report.site
    (view,) = (view for view in made.views if view.warnings)
    shown = {view.warnings[0]["finding"]: "A mistake that is often made."}
    settings = {**made.settings, "on_purpose": {f"{view.sensor}/{view.name}": shown}}
    told = START.context(replace(made, settings=settings))
    assert told["in_doubt"].endswith("in doubt, all simulated with these faults")
    assert told["warned"][0]["on_purpose"] == ["A mistake that is often made."]
    assert START.context(made)["warned"][0]["on_purpose"] == []


def test_what_is_taken_out_of_the_noise_stands_on_the_page_of_its_recording(
    read: dict[str, Read],
) -> None:
    page = read["recordings/one/day1.html"]
    steps = page.naming("400± 2", "tr")
    assert all("bias step" in row.text for row in steps)
    assert "25 to 35" in steps[0].text
    assert all("warm-up drift" in row.text for row in page.naming("613500 to 700", "tr"))


def test_samples_are_drawn_where_they_are_kept(read: dict[str, Read]) -> None:
    drawn = read["recordings/one/day1.html"].data["samples"]
    assert (set(drawn["envelope"]), set(drawn["histogram"])) == ({"gyro_x"}, {"gyro_x"})
    kinds = [one.attributes.get("data-kind") for one in read["recordings/one/day1.html"].elements]
    assert kinds.count("timeline") == kinds.count("histogram") == 1
    assert read["recordings/two/phantom.html"].data["samples"] == {"envelope": {}, "histogram": {}}


def test_a_sensor_without_a_datasheet_says_so(read: dict[str, Read]) -> None:
    assert "The sensor file states no figures of a datasheet" in read["sensors/two.html"].text
    assert "The sensor file states no figures of a datasheet" not in read["sensors/one.html"].text
    assert read["sensors/one.html"].naming("0.005 deg/s/sqrt(Hz)", "tr")
    assert [one.attributes.get("data-sensor") for one in read["datasheets.html"].elements
            if one.attributes.get("data-sensor")] == ["V & Co one"] * 2  # fmt: skip


def test_start_page_and_sensor_pages_have_the_verdict_on_a_requirement(
    read: dict[str, Read],
) -> None:
    page = read["index.html"]
    (answer,) = (one for one in page.elements if one.attributes.get("class") == "answer")
    assert answer.text.startswith(
        "No sensor meets the limits. V & Co one is closest, but fails. Best of 2 sensors (weak "
    )
    cells = [one for one in page.elements if "data-word" in one.attributes]
    assert [one.attributes["data-word"] for one in cells] == ["fails", "fails"]
    for sensor in ("one", "two"):
        assert "requirement-robot" in read[f"sensors/{sensor}.html"].ids


@pytest.mark.release
def test_commands_can_be_copied_into_a_shell(tmp_path: Path) -> None:
    publish(run(recording_rows("my imu", "log (1)"), recording_rows("a&b", "r")), tmp_path)
    read = read_pages(tmp_path)
    codes = [
        one.text for one in read["recordings/my imu/log (1).html"].elements if one.tag == "code"
    ]
    again, figures = map(shlex.split, codes)
    assert again[-1] == "results/recordings/my imu/log (1)/scores.parquet"
    named = ["--sensor", "my imu", "--recording", "log (1)"]
    assert figures == ["imubench", "figures", "results", *named]
    codes = [one.text for one in read["recordings/a&b/r.html"].elements if one.tag == "code"]
    assert "a&b" in shlex.split(codes[1])
    assert all("'" in code for code in codes)  # else the shell would run what follows the &


def test_pages_tell_settings_and_versions(read: dict[str, Read]) -> None:
    text = read["made.html"].text
    assert "allan.overlap" in text and "octave" in text
    assert "numpy" in text and "imubench report results --one-file" in text


# Runs of other shapes.


SHAPES: dict[str, list[Rows]] = {
    "nothing": [],
    "rejected": [rejected_rows()],
    "coverage": [coverage_rows("a")],
    "one": [recording_rows()],
    "simulated": [recording_rows(printed=False, simulated=True)],
    "accel": [recording_rows(channels=("accel_x",), parameters=WITHOUT_K, found=[0.5, 3.0])],
    "unknown": [recording_rows(parameters={"N": Parameter(
        None, "not_identified", lower=1e-6, upper=1e-4, fitted=1e-5, duration_needed=1e5)})],
    "ramp": [recording_rows(parameters=KNOWN | {"R": Parameter(1e-9, "at_bound", "too short")})],
    "device": [recording_rows(rate_error=1e-3, started="2024-01-01T00:00:00Z", device="x y")],
}  # fmt: skip


@pytest.mark.parametrize(
    ("shape", "units"),
    few(
        [("unknown", "practical")],
        [
            ("accel", "si"),
            *((shape, "practical") for shape in SHAPES if shape != "unknown"),
            ("one", "si"),
            ("ramp", "si"),
        ],
    ),
)
def test_reports_of_every_shape_are_sound(tmp_path: Path, shape: str, units: str) -> None:
    made = run(*SHAPES[shape], units=units)
    publish(made, tmp_path)
    read = sound(tmp_path)
    recordings = sum(len(rows.get("recordings", [])) for rows in SHAPES[shape])
    assert f"{recordings} recording" in " ".join(read["index.html"].text.split())
    assert Read(render_one_file(made)).faults == []


def test_nothing_to_show_is_still_a_report(tmp_path: Path) -> None:
    written = publish(run(), tmp_path)
    assert set(written) == ASSETS | once(run())
    page = read_pages(tmp_path)["index.html"]
    assert "0 sensors 0 recordings" in " ".join(page.text.split())
    assert not {"comparison", "parameters", "verdict"} & page.ids


@pytest.mark.release  # every day the page of nothing has no verdict
def test_without_requirements_nothing_is_ranked(tmp_path: Path) -> None:
    publish(run(recording_rows()), tmp_path)
    page = read_pages(tmp_path)["index.html"]
    assert "Which sensor to choose" not in page.text
    assert not any("data-decisions" in one.attributes for one in page.elements)


def test_a_requirement_that_no_recording_answers_is_no_fault(tmp_path: Path) -> None:
    publish(run(rejected_rows(), asked=ASKED), tmp_path)
    assert "a robot" in sound(tmp_path)["index.html"].text


def test_a_sensor_without_a_file_is_called_by_its_folder(tmp_path: Path) -> None:
    made = run(rejected_rows("lost", "r", "no sensor file for lost"))
    del made.settings["sensors"]["lost"]  # type: ignore[attr-defined]  # settings are nested mappings
    publish(made, tmp_path)
    assert "lost" in sound(tmp_path)["sensors/lost.html"].text


def test_pages_open_in_si_where_the_settings_say_so(tmp_path: Path) -> None:
    publish(run(recording_rows(), units="si"), tmp_path)
    page = read_pages(tmp_path)["recordings/imu/day1.html"]
    chosen = [
        one.text for one in page.elements if one.tag == "option" and "selected" in one.attributes
    ]
    assert chosen == ["SI: rad/s", "SI: m/s²"]
    heads = [one.text for one in page.elements if one.tag == "th"]
    assert "N (rad/s/√Hz)" in heads
    assert "9.7×10⁻⁵" in page.text  # 20 °/h
    (body,) = (one for one in page.elements if one.tag == "body")
    assert json.loads(body.attributes["data-units"] or "")["gyro"] == "SI: rad/s"
    # Datasheets alone are quoted as they are printed.
    quoted = {one.text for one in page.naming("deg/s/sqrt(Hz)", "tr")}
    shown = page.text
    for text in quoted:
        shown = shown.replace(text, "")
    assert "°/h" not in shown.replace("°/h and °/√h", "")


@pytest.mark.release
def test_many_recordings_stand_in_a_table_that_is_made_when_asked_for(tmp_path: Path) -> None:
    names = [f"r{i:03} </script><b>" for i in range(103)]
    publish(run(*(rejected_rows(recording=name, reason=f"why {name}") for name in names)), tmp_path)
    page = sound(tmp_path)["recordings.html"]
    shown = [one for one in page.elements if one.tag == "tr" and "data-status" in one.attributes]
    (further,) = (one for one in page.scripts if one.attributes.get("class") == "rows")
    assert further.attributes["type"] == "text/html"
    rest = Read(further.text, fragment=True)
    assert rest.faults == []
    later = [one for one in rest.elements if one.tag == "tr"]
    assert (len(shown), len(later)) == (100, 3)
    for name, row in zip(names, [*shown, *later], strict=True):
        assert name in row.text


@pytest.mark.release
def test_a_device_that_has_changed_is_named_at_the_top(tmp_path: Path) -> None:
    def known(factor: float) -> dict[str, Parameter]:
        n = factor * MODEL.N
        return KNOWN | {"N": Parameter(n, lower=0.99 * n, upper=1.01 * n)}

    series = [
        recording_rows("imu", f"run{i}", device="unit 7", parameters=known(factor), simulated=True)
        for i, factor in enumerate([1.0, 1.001, 0.999, 1.0, 3.0], start=1)
    ]
    publish(run(*series), tmp_path)
    read = sound(tmp_path)
    (line,) = (one for one in read["index.html"].naming("run5", "li") if "N of gyro x" in one.text)
    assert "unit 7" in line.text
    device = read["devices/imu/simulated/unit 7.html"]
    (trend,) = (one for one in device.data["trends"] if one["parameter"] == "N")
    assert trend["verdict"] == [None, None, None, "as before", "changed"]
    assert trend["recordings"] == [f"run{i}" for i in range(1, 6)]
    assert device.naming("run5 (simulated), gyro x: N changed by +200 %", "li")
    # It is simulated: each line that names it says so.
    for path, page in read.items():
        for one in page.naming("run5"):
            assert "imulated" in one.text, (path, one)


HOSTILE = "<img src=x>&amp;\"'#1?%41 µ漢 </script><script>alert(1)</script>"


@pytest.mark.release
def test_names_of_any_kind_break_nothing(tmp_path: Path) -> None:
    name = HOSTILE.replace("/", "|")
    finding = {"finding": "missing_samples", "detail": HOSTILE, "channel": "gyro_x"}
    requirement = {"<r>": ROBOT | {"title": HOSTILE}}
    rows = recording_rows(name, name, device=HOSTILE, findings=[finding], started=HOSTILE,
                          requirements=requirement)  # fmt: skip
    for row in rows["datasheet"]:
        row |= {"unit": HOSTILE, "condition": HOSTILE, "reasons": [HOSTILE]}
    for row in rows["models"]:
        row |= {"note": HOSTILE, "band_source": HOSTILE}
    hostile = {"vendor": HOSTILE, "grade": HOSTILE, "condition": HOSTILE, "place": HOSTILE,
               "aliases": [HOSTILE], "technology": [HOSTILE]}  # fmt: skip
    several = [
        rows,
        recording_rows(name, "other", device=HOSTILE, simulated=True),
        rejected_rows(name, "bad" + name, HOSTILE),
        {
            "coverage": [coverage_rows(name)["coverage"][0] | {"document": HOSTILE}],
            "catalogue": [coverage_rows(name)["catalogue"][0] | hostile],
        },
    ]
    made = run(*several, asked=requirement, title=HOSTILE)
    made.settings["sensors"][name] |= {"vendor": HOSTILE, "model": HOSTILE, "price_class": HOSTILE}  # type: ignore[index]  # settings are nested mappings
    publish(made, tmp_path)
    read = sound(tmp_path)
    assert f"recordings/{name}/{name}.html" in read and f"sensors/{name}.html" in read
    for path, page in read.items():
        images = [one.attributes["src"] for one in page.elements if one.tag == "img"]
        assert all(address.startswith("data:image/svg+xml") for address in images), path
        assert all(one.text.strip().startswith("{") for one in page.scripts if one.text), path
        assert HOSTILE in page.text
    page = read[f"recordings/{name}/{name}.html"]
    assert page.data["channels"][0]["sensor"] == name
    assert page.naming(HOSTILE, "tr") and page.naming(name, "h1")
    assert HOSTILE in read["index.html"].naming("bad" + name, "li")[0].text
    (table,) = (one for one in read["recordings.html"].elements if "data-filters" in one.attributes)
    filters = json.loads(table.attributes["data-filters"] or "")
    assert filters["sensor"] == [f"{HOSTILE} {HOSTILE}"]
    whole = Read(render_one_file(made))
    assert whole.faults == []
    known = {one.tag for page in read.values() for one in page.elements} | {"template", "style"}
    assert {one.tag for one in whole.elements} <= known


@pytest.mark.release
def test_what_is_not_sold_is_not_said_to_lack_a_recording(tmp_path: Path) -> None:
    board = recording_rows("board", "r", ("gyro_x", "accel_x"), requirements=ASKED)
    (row,) = board["recordings"]
    board["recordings"] = [row | {"decides": False, "doubts": (DoubtMark("r", "not_sold"),)}]
    other = recording_rows("a", "r", ("gyro_x", "accel_x"), requirements=ASKED)
    made = run(board, other, asked=ASKED, not_sold=["board"])
    ranking = made.tables["ranking"]
    made.tables["ranking"] = ranking.filter(pc.field("sensor") != "board")  # type: ignore[index]  # made so
    publish(made, tmp_path)
    read = sound(tmp_path)
    assert not read["index.html"].naming("not judged", "tr")
    (line,) = read["index.html"].naming("Not compared", "p")
    assert "board" in line.text and "not sold" in line.text
    assert "this sensor is not sold" in read["sensors/board.html"].text


@pytest.mark.release
def test_a_tie_of_sensors_with_commas_in_their_names_is_told(tmp_path: Path) -> None:
    several = [recording_rows(f"a, {i}", "r", ("gyro_x", "accel_x"), requirements=ASKED)
               for i in range(2)]  # fmt: skip
    publish(run(*several, asked=ASKED), tmp_path)
    assert "is not statistically significant" in sound(tmp_path)["index.html"].text


# What is written again, and what is not.


def test_a_second_run_writes_nothing(report: Report) -> None:
    made = report.anew()
    age(report.folder)
    told: list[str] = []
    assert publish(made, report.folder, told.append) == []
    assert not [page for page in told if page.startswith(PAGES_WITH_KEYS)]
    assert touched(report.folder) == set()


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of some results, to be copied."""
    folder = tmp_path_factory.mktemp("first") / "report"
    publish(unchanged(), folder)
    return folder


@cache
def unchanged() -> Site:
    return run(*some(), asked=ASKED)


@cache
def renamed() -> Site:
    return run(*some(), asked=ASKED, title="New")


@pytest.fixture
def old(first: Path, tmp_path: Path) -> Path:
    """A report of some results, written long ago."""
    folder = shutil.copytree(first, tmp_path / "report")
    age(folder)
    return folder


def republished(folder: Path, *after: Rows) -> tuple[set[str], set[str]]:
    """Return what pages a run writes after another, and what it only looks at.

    What is there then is what a first run would write.
    """
    made: list[str] = []
    changed = run(*after, asked=ASKED)
    written = publish(changed, folder, made.append)
    assert touched(folder) - KEPT == set(written)
    publish(changed, folder.parent / "fresh")
    assert files(folder) == files(folder.parent / "fresh")
    return set(written) - ASSETS, set(made) - set(written)


def test_a_changed_score_rewrites_its_page_alone(old: Path) -> None:
    after = some()
    after[0]["scores"][0]["rms_log10"] = 0.07
    written, seen = republished(old, *after)
    assert written == {"recordings/one/day1.html"}
    # These show the tables of the recording, but not this column.
    assert seen == OF_ALL - {"fusion.html"} | {"sensors/one.html", "compare.html"}


@pytest.mark.release
def test_a_changed_parameter_rewrites_its_page_and_those_that_compare(old: Path) -> None:
    after = some()
    rows = after[0]["parameters"]
    (place,) = (
        place
        for place, row in enumerate(rows)
        if row.recommended and (row.channel, row.parameter) == ("gyro_x", "N")
    )
    rows[place] = replace(rows[place], upper=1.5 * rows[place].upper)
    written, seen = republished(old, *after)
    showing = {"sensors/one.html", "index.html", "compare.html"}
    assert written == {"recordings/one/day1.html"} | showing
    assert seen == OF_ALL - {"index.html"}


@pytest.mark.release  # every day a new finding does
def test_a_changed_reason_rewrites_all_pages_that_list_the_recording(old: Path) -> None:
    after = some()
    after[2]["recordings"][0]["reason"] = "another"
    written, seen = republished(old, *after)
    assert written == {
        "recordings/one/torn.html",
        "sensors/one.html",
        "devices/one/unit 7.html",
        "recordings.html",
        "index.html",
    }
    assert seen == {"datasheets.html"}


@pytest.mark.release
def test_a_new_finding_leaves_the_pages_of_other_recordings_alone(old: Path) -> None:
    after = some()
    finding = {"finding": "step", "severity": "warning", "detail": "moved", "value": 1.0}
    after[1]["findings"].append({"sensor": "one", "recording": "day2"} | finding)
    written, seen = republished(old, *after)
    assert written == {
        "recordings/one/day2.html",
        "sensors/one.html",
        "recordings.html",
        "compare.html",
        "index.html",
    }
    assert seen == {"datasheets.html", "devices/one/unit 7.html"}


@pytest.mark.release  # every day a new finding does
def test_a_new_recording_leaves_the_pages_of_other_sensors_alone(old: Path) -> None:
    after = some()
    after.insert(0, recording_rows("one", "day0", ("gyro_x", "gyro_y", "gyro_z"), found=[0.2]))
    written, seen = republished(old, *after)
    # What answers for the sensor is the same as before.
    showing = OF_ALL - {"fusion.html"} | {"compare.html"}
    assert written == showing | {"recordings/one/day0.html", "sensors/one.html"}
    assert seen == {"fusion.html"}


@pytest.mark.release  # every day a changed parameter does
def test_what_is_found_out_about_a_datasheet_reaches_all_pages_that_say_so(old: Path) -> None:
    after = some()
    (row,) = (r for r in after[4]["coverage"] if (r["sensor"], r["figure"]) == ("one", "K"))
    row["published"] = "not looked up"
    written, _ = republished(old, *after)
    assert written == {
        "datasheets.html",
        "sensors/one.html",
        "recordings/one/day1.html",
        "recordings/one/day2.html",
    }


@pytest.mark.release
def test_the_page_of_a_removed_recording_disappears(old: Path) -> None:
    after = some()
    del after[0]
    written, _ = republished(old, *after)
    # Of one recording less the interval is another, and with it the rank of the other sensor.
    assert written == OF_ALL | {"compare.html", "sensors/one.html", "sensors/two.html"}
    assert "recordings/one/day1.html" not in files(old)


@pytest.mark.release  # every day the page of a recording does
def test_the_pages_of_a_removed_sensor_disappear(old: Path) -> None:
    after = some()
    del after[3]
    republished(old, *after)
    left = set(files(old))
    assert not {"recordings/two/phantom.html", "sensors/two.html"} & left


@pytest.mark.release  # every day the page of a recording does
def test_a_device_page_disappears_with_its_device(old: Path) -> None:
    after = some()
    del after[1:3]
    republished(old, *after)
    assert "devices/one/unit 7.html" not in files(old)


@pytest.mark.release
def test_another_title_rewrites_every_page(old: Path) -> None:
    written = publish(renamed(), old)
    assert set(written) == set(files(old)) - ASSETS - KEPT
    assert all("New" in page.text for page in read_pages(old).values())


@pytest.mark.release
def test_another_script_or_style_is_written_alone(report: Report, tmp_path: Path) -> None:
    made = report.site
    publish(made, tmp_path)
    (tmp_path / "assets/report.css").write_text("old")
    (tmp_path / "assets/plotly.min.js").unlink()
    assert publish(made, tmp_path) == ["assets/report.css", "assets/plotly.min.js"]


@pytest.mark.release
def test_changed_samples_rewrite_the_page_of_their_recording_alone(tmp_path: Path) -> None:
    tables = joined(recording_rows("one", "day1"), recording_rows("one", "day2"))
    publish(site(tables, tmp_path), tmp_path / "report")
    put_samples(tmp_path, "one", "day1")
    written = publish(site(tables, tmp_path), tmp_path / "report")
    assert written == ["recordings/one/day1.html"]


@pytest.mark.release
def test_another_file_with_the_same_samples_rewrites_the_page_of_its_recording(
    tmp_path: Path,
) -> None:
    tables = joined(recording_rows("one", "day1"), recording_rows("one", "day2"))

    def written(name: str, digest: str) -> list[str]:
        source = {"name": name, "size": 12_345, "sha256": digest}
        put_log(tmp_path, "one", "day1", sources=[source], reader=None, segments=[[0, 9], [9, 3]])
        return publish(site(tables, tmp_path), tmp_path / "report")

    written("<log>.csv", 64 * "a")
    page = sound(tmp_path / "report")["recordings/one/day1.html"]
    assert re.sub(r"\s", "", page.naming(64 * "a", "tr")[0].text) == f"<log>.csv12345{64 * 'a'}"
    assert re.search(r"Format\s*detected from the content", page.text)
    assert re.search(r"Segments\s*2", page.text)
    assert written("log.csv", 64 * "b") == ["recordings/one/day1.html"]
    assert written("log.csv", 64 * "b") == []


@pytest.mark.parametrize(
    "damaged",
    few(
        [b"\xff\xfe\x00"],
        [b'{"index.html": 3}', b"", b'{"index.html": ', b"[]", b"null", b"7"],
    ),
)
def test_a_damaged_list_of_pages_is_healed(report: Report, tmp_path: Path, damaged: bytes) -> None:
    folder = shutil.copytree(report.folder, tmp_path / "report")
    (folder / "pages.json").write_bytes(damaged)
    (folder / "sensors/two.html").write_text("half")
    assert publish(report.site, folder) == ["sensors/two.html"]
    assert files(folder) == files(report.folder)


def test_a_damaged_list_of_pages_takes_nothing_outside_of_the_report(
    report: Report, tmp_path: Path
) -> None:
    made = report.site
    folder = tmp_path / "report"
    folder.mkdir()
    (tmp_path / "precious").write_text("kept")
    (folder / "pages.json").write_text(json.dumps({"../precious": "x", "theory": "y"}))
    publish(made, folder)
    assert (tmp_path / "precious").read_text() == "kept"


def test_missing_pages_are_written_again(report: Report, tmp_path: Path) -> None:
    made = report.site
    publish(made, tmp_path)
    (tmp_path / "sensors/one.html").unlink()
    (tmp_path / "index.html").unlink()
    assert publish(made, tmp_path) == ["sensors/one.html", "index.html"]
    assert files(tmp_path) == files(report.folder)


class Killed(BaseException):
    pass


def killed_at(patch: pytest.MonkeyPatch, name: str) -> None:
    """Let the write of a file end in its middle."""
    whole = Path.write_bytes

    def write_bytes(path: Path, data: Any) -> int:
        assert path.suffix == ".part" and path.name.startswith(".")
        if f".{Path(name).name}." in path.name:
            whole(path, bytes(data)[: len(data) // 2])
            raise Killed
        return whole(path, data)

    patch.setattr(Path, "write_bytes", write_bytes)


@pytest.mark.parametrize("name", few(["day2.html", "settings.json"], ["report.js", "index.html"]))
def test_a_write_that_is_killed_leaves_no_half_of_a_file(
    report: Report, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = report.site
    with monkeypatch.context() as patch, pytest.raises(Killed):
        killed_at(patch, name)
        publish(made, tmp_path)
    complete = files(report.folder)
    left = files(tmp_path)
    assert not {path for path in left if path.endswith(name)}
    left.pop("pages.json", None)
    assert left.items() <= complete.items()
    assert ("index.html" in left) == (name == "settings.json")
    publish(made, tmp_path)
    assert files(tmp_path) == complete


@pytest.mark.release  # every day of a first run
def test_a_kill_while_pages_are_written_again_leaves_the_old_or_the_new(
    old: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = files(old)
    other = renamed()
    with monkeypatch.context() as patch, pytest.raises(Killed):
        killed_at(patch, "day2.html")
        publish(other, old)
    left = files(old)
    assert set(left) == set(before)
    assert left["recordings/one/day2.html"] == before["recordings/one/day2.html"]
    assert left["recordings/one/day1.html"] != before["recordings/one/day1.html"]
    publish(other, old)
    assert all("New" in page.text for page in read_pages(old).values())


def test_what_a_killed_run_has_written_does_not_outlive_a_step_back(
    old: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = files(old)
    with monkeypatch.context() as patch, pytest.raises(Killed):
        killed_at(patch, "day2.html")
        publish(renamed(), old)
    # The edit is taken back before the run is repeated.
    publish(unchanged(), old)
    assert files(old) == before


@pytest.mark.release  # every day that of a recording that was new when it was killed
def test_the_page_of_a_recording_that_was_removed_does_not_outlive_a_kill(
    old: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fewer = run(*some()[1:], asked=ASKED)
    with monkeypatch.context() as patch, pytest.raises(Killed):
        killed_at(patch, "index.html")
        publish(fewer, old)
    publish(fewer, old)
    assert "recordings/one/day1.html" not in files(old)


def test_a_page_that_only_a_killed_run_has_written_is_removed(
    old: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = files(old)
    with monkeypatch.context() as patch, pytest.raises(Killed):
        killed_at(patch, "index.html")
        publish(run(*some(), recording_rows("one", "new"), asked=ASKED), old)
    assert "recordings/one/new.html" in files(old)
    publish(unchanged(), old)
    assert files(old) == before


@pytest.mark.release  # every day a finished run tells its site
def test_the_same_tables_give_the_same_bytes_in_any_folder(report: Report, tmp_path: Path) -> None:
    publish(report.anew(), tmp_path / "b/c")
    assert files(tmp_path / "b/c") == files(report.folder)


def test_a_finished_run_tells_its_site_itself(report: Report, tmp_path: Path) -> None:
    again = load_site(report.results)
    assert publish(again, report.folder) == []
    assert publish(again, tmp_path)[-1] == "index.html"
    assert files(tmp_path) == files(report.folder)


# All in one file.


@pytest.fixture(scope="module")
def whole(report: Report) -> Read:
    return Read(render_one_file(report.site))


def test_one_file_holds_every_page(report: Report, whole: Read) -> None:
    assert whole.faults == []
    made = report.site
    templates = [one for one in whole.elements if one.tag == "template"]
    assert [one.attributes["id"] for one in templates] == [
        f"page:{p.path}" for p in list_pages(made)
    ]
    folder = read_pages(report.folder)
    for one in templates:
        path = (one.attributes["id"] or "").removeprefix("page:")
        (main,) = (element for element in folder[path].elements if element.tag == "main")
        shown = main.text.replace("Save all figures as CSV", "")
        for table in ("All tables, in SI units", "For print: "):  # files that lie elsewhere
            shown = shown.partition(table)[0]
        assert " ".join(shown.split())[:5000] in " ".join(one.text.split()), path


def test_one_file_needs_no_other_file(report: Report, whole: Read) -> None:
    made = report.site
    paths = {page.path for page in list_pages(made)}
    ids: dict[str, set[str]] = {}
    for one in whole.elements:
        ids.setdefault(one.page.removeprefix("page:"), set()).add(one.attributes.get("id") or "")
    assert whole.external() == []
    assert not [one for one in whole.elements if "src" in one.attributes and one.tag != "img"]
    styles = [one for one in whole.elements if one.tag == "link"]
    assert [one.attributes["href"] for one in styles] == ["data:,"]
    for part in re.split(r"(?=<template id=)", whole.source):
        found = re.match(r'<template id="page:([^"]*)">', part)
        path = found[1] if found else "index.html"
        page = Read(part.partition("</template>")[0] + "</template>", fragment=True)
        for link in page.links:
            target, _, section = link.partition("#")
            if link.startswith("data:"):
                continue
            led = os.path.normpath(Path(path).parent / unquote(target)) if target else path
            assert led in paths, (path, link)
            state = "=" in section  # what is chosen on the page
            assert not section or state or unquote(section) in ids[led] | ids[""], (path, link)


@pytest.mark.release  # every day the whole file is asked
def test_one_file_has_pages_without_fault_each(whole: Read) -> None:
    for part in re.findall(r"<template.*?</template>", whole.source, flags=re.DOTALL):
        assert Read(part, fragment=True).faults == []


def test_a_report_of_one_log_is_one_page_with_its_name() -> None:
    site = run(recording_rows("imu", "night"))
    single = replace(site, settings={**site.settings, "at_once": "imubench analyse night.csv"})
    page = Read(render_one_file(single))
    paths = [one.attributes["id"] for one in page.elements if one.tag == "template"]
    assert paths == ["page:index.html", "page:theory.html", "page:made.html"]
    titles = {one.text for one in page.elements if one.tag in ("title", "h1")}
    assert {f"{single.names['imu']}: night"} == {one for one in titles if "night" in one}
    menus = [one for one in page.elements if one.tag == "nav"]
    assert [one.page for one in menus] == ["page:theory.html"]  # its own contents
    assert "sensors compared" not in page.text
    led = {link.partition("#")[0] for link in page.links if not link.startswith("data:")} - {""}
    assert led <= {"index.html", "theory.html", "made.html"}


@pytest.mark.release
def test_nothing_breaks_out_of_one_file() -> None:
    hostile = "</script></template><script>alert(1)</script><!-- <script>"
    finding = {"finding": "missing_samples", "detail": hostile, "channel": "gyro_x"}
    page = Read(
        render_one_file(run(recording_rows(device=hostile, findings=[finding], started=hostile)))
    )
    calm = Read(
        render_one_file(run(recording_rows(device="x", findings=[finding | {"detail": ""}])))
    )
    tags, calm_tags = ([one.tag for one in p.elements] for p in (page, calm))
    assert page.naming(hostile, "tr")
    assert tags.count("template") == calm_tags.count("template")
    assert [one.attributes for one in page.scripts] == [one.attributes for one in calm.scripts]
    inline = [one.text for one in page.scripts]
    assert not any("<!--" in text or "<script" in text.lower() for text in inline)


def test_settings_are_kept_beside_the_pages(report: Report) -> None:
    kept = json.loads((report.folder / "settings.json").read_text())
    assert kept == json.loads(settings_of(report.tables, requirements=ASKED))


def test_tables_without_rows_are_tables() -> None:
    assert run().views == []
    assert (
        list(list_pages(site({name: build(name, []) for name in TABLES})))[-1].path == "index.html"
    )


def test_a_page_that_fails_stops_no_other_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(site: Site) -> list[Any]:
        return [
            replace(page, context=lambda: {}["lost"]) if page.path == "theory.html" else page
            for page in list_pages(site)
        ]

    tables = joined(recording_rows("one", "day1"))
    monkeypatch.setattr(publishing, "list_pages", broken)
    monkeypatch.setattr(publishing, "_make_page", MADE)
    for attempt in range(2):
        assert count_attempt(tmp_path) == attempt
        made = site(tables)
        written = publish(made, tmp_path)
        assert made.failed == read_failed_pages(tmp_path) == {"theory.html": "KeyError: 'lost'"}
        assert ("recordings.html" in written) == (attempt == 0)
        assert "KeyError: &#39;lost&#39;" in (tmp_path / "theory.html").read_text()
    assert "KeyError" in capsys.readouterr().err
    assert "KeyError: &#39;lost&#39;" in render_one_file(site(tables))
    monkeypatch.setattr(publishing, "list_pages", list_pages)
    made = site(tables)
    assert publish(made, tmp_path) == ["theory.html"]
    assert (made.failed, read_failed_pages(tmp_path), count_attempt(tmp_path)) == ({}, {}, 0)


def test_a_full_disk_is_no_fault_of_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> str:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(publishing, "_make_page", MADE)
    monkeypatch.setattr(publishing, "_render", full)
    with pytest.raises(OSError, match="No space"):
        publish(site(joined(recording_rows("one", "day1"))), tmp_path)

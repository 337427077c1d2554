"""The page of the papers, and the same in the terminal."""

from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.report.pages import list_pages
from imubench_pipeline.report.publish import publish
from imubench_pipeline.run.cli import main
from imubench_pipeline.tables.files import build, write
from tests.report.browser.made import publish_some
from tests.report.pages import Read, sound_pages
from tests.report.tables import joined, recording_rows, site

pytestmark = pytest.mark.usefixtures("small_report")

HOSTILE = "a <b> & c"
LINE: dict[str, Any] = {
    "paper": "Maia et al.", "place": "Table 3", "quantity": "RMS of one draw",
    "printed_as": "2,0 °/s", "printed": 0.0349, "found": 0.0698, "lower": 0.0524,
    "upper": 0.0873, "found_words": HOSTILE, "ratio": 2.0, "tolerance": 0.05,
    "unit": "rad/s",
    "printed_unit": "°/s", "scale": 0.01745, "basis": "simulated", "verdict": "differs",
    "reason": "one draw ranks nothing", "page": "recordings/mti_7/sim_published.html#gyro_x",
    "check": "tests/test_score.py",
}  # fmt: skip
OTHER = LINE | {"place": "Equation 26", "quantity": "sign", "found": None, "ratio": None,
                "tolerance": None, "lower": None, "upper": None, "verdict": "misprint",
                "basis": "checked",
                "reason": "it grows", "page": "nowhere.html"}  # fmt: skip
PANEL = [
    {"method": "curve", "parameter": "N", "logs": 100, "given": 100, "rmse": 0.002, "bias": 0.0,
     "bound": 0.001, "ratio": 2.0, "ratio_lower": 1.7, "ratio_upper": 2.3},
    {"method": "curve", "parameter": "B", "logs": 100, "given": 17, "rmse": 0.3, "bias": -0.29,
     "bound": 0.04, "ratio": 7.0, "ratio_lower": 5.0, "ratio_upper": 9.0},
    {"method": "curve", "parameter": "K", "logs": 100, "given": 0, "bound": 0.28},
]  # fmt: skip


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Read]:
    tables = joined(recording_rows("mti_7", "sim_published", simulated=True)) | {
        "published": build("published", [LINE, OTHER]),
        "accuracy": build("accuracy", PANEL),
    }
    folder: Path = tmp_path_factory.mktemp("report")
    publish(site(tables), folder)
    return sound_pages(folder, {f"figures/allan_gyro_x.{kind}" for kind in ("svg", "pdf")})


def test_papers_page_shows_printed_and_computed_values_in_printed_units(
    read: dict[str, Read],
) -> None:
    page = read["papers.html"]
    (line,) = page.naming("Table 3", "tr")
    for text in ("2,0 °/s", "4 °/s (3 to 5)", HOSTILE, "differs", "one draw ranks nothing",
                 "tests/test_score.py", "simulated", "±5 %"):  # fmt: skip
        assert text in line.text
    assert 'href="recordings/mti_7/sim_published.html#gyro_x">Table 3' in page.source
    (line,) = page.naming("Equation 26", "tr")
    assert "misprint" in line.text and "–" in line.text
    assert "nowhere.html" not in page.source, "a page that there is none of"
    assert "Of 2 lines 1 differs, 1 is a misprint." in page.text
    assert "10 h are assumed" in page.text


def test_the_curves_of_its_figures_are_drawn(read: dict[str, Read]) -> None:
    page = read["papers.html"]
    assert 'id="maia-mti_7-gyro_x"' in page.source
    assert [channel["sensor"] for channel in page.data["channels"]] == ["mti_7"]


def test_the_panel_says_where_a_method_gives_no_value(read: dict[str, Read]) -> None:
    page = read["papers.html"]
    (line,) = page.naming("read from the curve", "tr")
    for text in ("0.2 %", "2 (1.7 to 2.3)", "30 %, in 17 logs", "no value"):
        assert text in line.text
    theory = read["theory.html"].text
    assert "In 100 simulated logs of 10 h it finds B in 17, 29 % too small, and K in none" in theory


def test_a_run_without_a_paper_has_no_page(tmp_path: Path) -> None:
    made = site(joined(recording_rows("one", "day")))
    publish_some(made, tmp_path, ["theory.html"])
    assert "papers.html" not in {page.path for page in list_pages(made)}
    assert "papers.html" not in (tmp_path / "theory.html").read_text(encoding="utf-8")


def test_the_command_prints_the_table(tmp_path: Path, capsys: Any) -> None:
    write("published", [LINE, OTHER], tmp_path / "tables/published.parquet")
    assert main(["papers", str(tmp_path), "--paper", "maia"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    for text in ("Maia et al.", "Table 3", "2,0 °/s", "misprint", "[1] one draw ranks nothing",
                 "2 ±5 %", "± the tolerance",
                 "misprint: as printed it is wrong"):  # fmt: skip
        assert text in printed
    assert main(["papers", str(tmp_path), "--place", "Table 3"]) == 0
    assert "Equation" not in capsys.readouterr().out
    assert main(["papers", str(tmp_path), "--place", "Table 9"]) == 2
    assert "no place 'Table 9'; there are: Table 3, Equation 26" in capsys.readouterr().err
    assert main(["papers", str(tmp_path / "none")]) == 2
    assert "no table published" in capsys.readouterr().err


@pytest.mark.release  # .ci/run asks the command for a paper every day
def test_without_a_run_it_prints_what_needs_no_log(capsys: Any) -> None:
    assert main(["papers", "--paper", "maia", "--place", "Equation 13"]) == 0
    assert "0,664" in capsys.readouterr().out

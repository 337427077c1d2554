import base64
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.report.page import render
from imubench_pipeline.report.practical import page_unit
from imubench_pipeline.tables import TABLES, build

SETTINGS = {
    "report": {"title": "A <title>", "units": "practical"},
    "sensors": {"s": {"vendor": "V", "model": "M"}},
    "settings": {"allan": {"overlap": "octave"}},
}


def tables(**rows: list[dict[str, Any]]) -> dict:
    return {name: build(name, rows.get(name, [])) for name in TABLES}


def recording(name: str, status: str = "ok", **values: object) -> dict[str, Any]:
    row = {"sensor": "s", "device": name, "recording": name, "kind": "static", "simulated": False}
    return row | {"status": status} | values


def channel(name: str) -> dict[str, list[dict[str, Any]]]:
    key = {"sensor": "s", "recording": name, "channel": "gyro_x"}
    tau = [0.01, 0.1, 1.0, 10.0]
    degree = np.pi / 180
    method = key | {"method": "weighted"}
    parameter = method | {"recommended": True, "model": "N", "component": 1}
    return {
        "allan": [
            key | {"tau": t, "cluster_size": int(t * 100), "adev": 1 / t, "lower": 0.9 / t,
                   "upper": 1.1 / t, "edf": 10.0, "exponent": 0}
            for t in tau
        ],
        "parameters": [
            parameter | {"parameter": "N", "value": degree / 60, "unit": "x", "status": "ok"},
            *(
                parameter | {"parameter": p, "unit": "x", "status": "absent", "reason": "not there"}
                for p in ("B", "T_B", "K")
            ),
        ],
        "reconstruction": [
            method | {"tau": t, "adev": 1 / t, "lower": 0.9 / t, "upper": 1.1 / t,
                      "reconstructed": 1 / t}
            for t in tau
        ],
        "scores": [method | {"rms": 1e-5, "rms_log10": 0.05, "inside_band": 0.98}],
        "datasheet": [
            method | {"quantity": "N", "statistic": "N", "printed": 1.0, "unit": "deg/sqrt(h)",
                      "kind": "typ", "comparable": degree / 60, "measured": degree / 60,
                      "delta": 0.0, "verdict": "as printed"},
            method | {"quantity": "K", "statistic": "K", "verdict": "not published"},
        ],
    }  # fmt: skip


class Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.ids: set[str] = set()
        self.outside: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if "id" in values:
            self.ids.add(values["id"] or "")
        for key in ("href", "src"):
            found = values.get(key) or ""
            if found.startswith("#"):
                self.targets.append(found[1:])
            elif found and not found.startswith("data:"):
                self.outside.append(found)


def test_a_page_is_whole_and_needs_nothing_else() -> None:
    page = render(tables(recordings=[recording("r")], **channel("r")), SETTINGS)
    links = Links()
    links.feed(page)
    assert set(links.targets) <= links.ids
    assert links.outside == []
    assert "A &lt;title&gt;" in page
    assert not re.search(r"https?://(?!www\.w3\.org)", page)
    figures = [base64.b64decode(found) for found in re.findall(r"base64,([^\"]+)", page)]
    assert "allan.overlap: octave" in page
    assert len(figures) == 3  # comparison, channel, datasheet
    assert all(figure.startswith(b"<?xml") and b"</svg>" in figure for figure in figures)


def test_values_have_the_units_of_engineers() -> None:
    page = render(tables(recordings=[recording("r")], **channel("r")), SETTINGS)
    assert "N (°/√h)" in page
    assert '<td class="number">1</td>' in page
    assert 'title="not there">absent<sup' in page
    assert "not published" in page
    si = render(
        tables(recordings=[recording("r")], **channel("r")),
        SETTINGS | {"report": {"title": "t", "units": "si"}},
    )
    assert "N (rad/s/√Hz)" in si and "0.0002909" in si


def test_a_rejected_recording_stands_at_the_top_with_its_reason() -> None:
    rows = [recording("r"), recording("bad", "rejected", reason="line 3: found 'x'")]
    page = render(tables(recordings=rows, **channel("r")), SETTINGS)
    assert "1 rejected" in page
    assert page.index("line 3: found &#39;x&#39;") < page.index('id="comparison"')


def test_warnings_stand_at_the_top_and_notes_at_the_end() -> None:
    finding = {"sensor": "s", "recording": "r", "value": 1.0}
    rows = [
        finding | {"finding": "gap", "severity": "warning", "detail": "a long gap"},
        finding | {"finding": "cut", "severity": "note", "detail": "a short end"},
    ]
    page = render(tables(recordings=[recording("r")], findings=rows, **channel("r")), SETTINGS)
    assert page.index("a long gap") < page.index('id="comparison"') < page.index("a short end")


def test_a_simulated_log_is_called_so_wherever_it_appears() -> None:
    truth = {"sensor": "s", "recording": "r", "channel": "gyro_x", "parameter": "N"}
    truth |= {"value": np.pi / 180 / 60, "unit": "x", "assumed": True, "source": "x"}
    found = tables(
        recordings=[recording("r", simulated=True)], simulated_truth=[truth], **channel("r")
    )
    page = render(found, SETTINGS)
    rows = re.findall(r"<t[hd].*?</t[hd]>", page, flags=re.DOTALL)
    named = [row for row in rows if "s / r" in row]
    assert len(named) == 4  # parameters, scores, datasheet, recordings
    assert all("simulated" in row for row in named)
    assert "truth of the simulation" in page and "1 (assumed)" in page
    assert all(
        "simulated" in base64.b64decode(figure).decode()
        for figure in re.findall(r"base64,([^\"]+)", page)
    )


def test_nothing_to_show_is_still_a_page() -> None:
    assert "0 recordings" in render(tables(), SETTINGS)


@pytest.mark.parametrize(
    ("quantity", "symbol", "sign", "si", "shown"),
    [
        ("gyro", "B", "°/h", np.pi / 180 / 3600, "1"),
        ("gyro", "K", "°/h/√h", np.pi / 180 / 3600 / 60, "1"),
        ("accel", "N", "µg/√Hz", 9.80665e-6, "1"),
        ("accel", "K", "µg/√h", 9.80665e-6 / 60, "1"),
        ("gyro", "T_B", "s", 89.512, "89.51"),
    ],
)
def test_page_units(quantity: str, symbol: str, sign: str, si: float, shown: str) -> None:
    unit = page_unit(quantity, symbol, "practical")
    assert (unit.sign, unit.text(si)) == (sign, shown)
    assert unit.text(None) == "–"

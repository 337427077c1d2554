import base64
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
from imubench_pipeline.report.page import render

from imubench_pipeline.report.practical import page_unit
from imubench_pipeline.schemas import TABLES
from imubench_pipeline.tables import build

SETTINGS = {
    "report": {"title": "A <title>", "units": "practical"},
    "sensors": {"s": {"vendor": "V", "model": "M"}},
    "settings": {
        "allan": {"overlap": "octave"},
        "error_budget": {"static_window": "60 s", "latitude": "45 deg"},
    },
    "requirements": {},
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
            parameter | {"parameter": "N", "value": degree / 60, "unit": "x", "status": "ok",
                         "lower": degree / 66, "upper": degree / 55},
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
    assert '<td class="number">1<br>0.909 to 1.09</td>' in page
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


def test_findings_stand_beside_the_results_that_they_touch() -> None:
    of_r = {"sensor": "s", "recording": "r", "value": 1.0, "severity": "warning"}
    rows = [
        of_r | {"finding": "missing_samples", "detail": "of all channels"},
        of_r
        | {
            "finding": "step",
            "detail": "it was moved",
            "channel": "gyro_x",
            "start": 60.0,
            "end": 61.0,
        },
        of_r | {"finding": "lines", "severity": "note", "detail": "1 Hz", "channel": "gyro_x"},
        of_r | {"finding": "motion", "detail": "elsewhere", "channel": "gyro_y"},
        of_r | {"finding": "knocks", "detail": "elsewhere", "recording": "q"},
    ]
    page = render(tables(recordings=[recording("r")], findings=rows, **channel("r")), SETTINGS)
    parameters = page[page.index('id="parameters"') : page.index('id="scores"')]
    doubts = re.findall(r'href="#(s-r-gyro_x-findings)">see: ([^<]*)</a>', parameters)
    assert doubts == [("s-r-gyro_x-findings", "missing samples, step")]
    section = page[page.index('id="s-r-gyro_x-findings"') : page.index('id="recordings"')]
    assert "of all channels" in section and "1 Hz" in section and "elsewhere" not in section
    assert "60 s to 61 s: (warning, step): it was moved" in section


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


def test_the_page_says_what_the_likelihood_says() -> None:
    key = {"sensor": "s", "recording": "r", "channel": "gyro_x"}
    model = key | {"free": 2, "log_likelihood": 1.0, "aic": 1.0, "weight": 0.5, "deviance": 1.234,
                   "chance": 0.4, "verdict": "explained", "bins": 10}  # fmt: skip
    parts = channel("r")
    for rows in parts.values():
        for row in rows:
            if row.get("method"):
                row["method"] = "likelihood"
    parts["parameters"][1] |= {
        "status": "not_identified", "lower": np.pi / 180 / 3600, "upper": np.pi / 180 / 360,
        "duration_needed": 7200.0, "fitted": 1e-5,
    }  # fmt: skip
    line = {"kind": "sinusoid", "frequency": 0.5, "frequency_lower": 0.49, "frequency_upper": 0.51,
            "amplitude": np.pi / 180 / 3600, "amplitude_lower": 0.0, "amplitude_upper": 1e-5,
            "ratio": 30.0}  # fmt: skip
    spectrum = {"lower": 0.1, "upper": 2.0, "ordinates": 3.0, "density": 1.0}
    page = render(
        tables(
            recordings=[recording("r")],
            models=[
                model | {"model": "N+F", "chosen": True, "bic": 10.0, "note": "AIC says else"},
                model | {"model": "N+GM+K", "chosen": False, "bic": 13.5},
            ],
            lines=[key | line],
            spectrum=[
                key | spectrum | {"frequency": 0.2, "fitted": 1.1, "used": True},
                key | spectrum | {"frequency": 1.0, "used": False},
            ],
            pooled=[
                {"sensor": "s", "channel": "gyro_x", "parameter": "bias", "recordings": 3,
                 "left_out": 0, "value": np.pi / 180 / 3600, "unit": "rad/s", "spread": 1e-6,
                 "reason": "because"},
            ],
            **parts,
        ),
        SETTINGS,
    )  # fmt: skip
    links = Links()
    links.feed(page)
    assert set(links.targets) <= links.ids
    assert "not identified<br>1 to 10" in page
    assert "a log of 2 h tells it to 10 %" in page
    assert "N+GM+K +3.5" in page and "1.23" in page and "AIC says else" in page
    assert "0.49 to 0.51" in page
    assert "fixed bias" in page and "because" in page
    assert len(re.findall(r"base64,", page)) == 4  # and the spectrum


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

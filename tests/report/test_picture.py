"""The picture for readers without JavaScript has the numbers of the tables at their places."""

import math
import re
import xml.etree.ElementTree as ET

import numpy as np

from imubench_pipeline.report.picture import draw_picture
from imubench_pipeline.report.view import gather_recordings
from tests.report.tables import joined, recording_rows

ARC_SECONDS = math.degrees(1.0) * 3600.0


def test_curves_are_at_their_places() -> None:
    (view,) = gather_recordings(joined(recording_rows()))
    (channel,) = view.channels()
    svg = ET.fromstring(draw_picture([channel], "practical"))
    texts = [one for one in svg if one.tag.endswith("text")]
    ticks: dict[str, list[tuple[float, float]]] = {"middle": [], "end": []}
    for one in texts:
        if (anchor := one.get("text-anchor")) and re.fullmatch(r"[\d.]+", one.text or ""):
            place = float(one.get("x" if anchor == "middle" else "y", 0.0))
            ticks[anchor].append((math.log10(float(one.text or 0.0)), place))
    (dots,) = (one.get("d", "") for one in svg if one.get("stroke-linecap") == "round")
    found = np.array([pair.split(",") for pair in re.findall(r"[\d.]+,[\d.]+", dots)], dtype=float)
    for place, anchor, values, shift in (
        (0, "middle", channel.tau, 0.0),
        (1, "end", channel.adev * ARC_SECONDS, -8.0),  # from a text to its line
    ):
        assert len(ticks[anchor]) > 1
        slope, begin = np.polyfit(*np.transpose(ticks[anchor]), 1)
        expected = begin + shift + slope * np.log10(values)
        np.testing.assert_allclose(found[:, place], expected, atol=2.0)  # of 1920
    assert {"gyro x", "consumer"} <= {one.text for one in texts}

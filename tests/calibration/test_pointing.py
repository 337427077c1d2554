import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.pointing import Pointing

angles = st.floats(-3.1, 3.1)
latitudes = st.floats(-1.57, 1.57)


@given(latitudes, angles, angles)
def test_the_rate_is_the_projection_of_the_earths(latitude, heading, elevation):
    # North, east, up; the Earth turns about its axis, which is above north by the latitude.
    earth = EARTH_RATE * np.array([math.cos(latitude), 0.0, math.sin(latitude)])
    axis = np.array(
        [
            math.cos(elevation) * math.cos(heading),
            math.cos(elevation) * math.sin(heading),
            math.sin(elevation),
        ]
    )
    found = Pointing(latitude=latitude, heading=heading, elevation=elevation)
    assert found.rate == pytest.approx(earth @ axis, abs=1e-12 * EARTH_RATE)
    assert found.rate_sigma < 1e-7 * EARTH_RATE


@given(latitudes, angles, angles)
def test_no_heading_at_all_is_the_limit_of_a_wide_one(latitude, heading, elevation):
    wide = Pointing(latitude=latitude, heading=heading, elevation=elevation, heading_sigma=9.0)
    none = Pointing(latitude=latitude, heading=None, elevation=elevation)
    assert none.rate == pytest.approx(wide.rate, abs=1e-12 * EARTH_RATE)
    assert none.rate_sigma == pytest.approx(wide.rate_sigma, abs=1e-7 * EARTH_RATE)
    assert none.rate_sigma == pytest.approx(none.half_width / math.sqrt(2), abs=1e-7 * EARTH_RATE)


@pytest.mark.parametrize("spread", [(0.0, 0.4), (0.7, 0.0), (0.02, 0.03), (1.5, 0.8)])
def test_mean_and_spread_are_those_of_drawn_directions(spread):
    rng = np.random.default_rng(1)
    latitude, heading, elevation = 0.7, 2.0, -0.4
    h = heading + spread[0] * rng.standard_normal(400_000)
    e = elevation + spread[1] * rng.standard_normal(400_000)
    drawn = EARTH_RATE * (
        math.cos(latitude) * np.cos(e) * np.cos(h) + math.sin(latitude) * np.sin(e)
    )
    found = Pointing(
        latitude=latitude,
        heading=heading,
        elevation=elevation,
        heading_sigma=spread[0],
        elevation_sigma=spread[1],
    )
    assert found.rate == pytest.approx(drawn.mean(), abs=5 * drawn.std() / math.sqrt(400_000))
    assert found.rate_sigma == pytest.approx(drawn.std(), rel=0.01)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"latitude": 2.0, "heading": 0.0}, "latitude"),
        ({"latitude": 0.0, "heading": math.nan}, "heading is"),
        ({"latitude": 0.0, "heading": 0.0, "elevation": math.inf}, "elevation"),
        ({"latitude": 0.0, "heading": 0.0, "heading_sigma": -1.0}, "heading_sigma"),
        ({"latitude": 0.0, "heading": 0.0, "elevation_sigma": math.nan}, "elevation_sigma"),
    ],
)
def test_what_is_no_direction_is_refused(given, says):
    with pytest.raises(ValueError, match=says):
        Pointing(**given)

"""Every file is read by the parser of its program, whatever names and reasons stand in it."""

import ast
import io
import json
import re
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.extensions.exports.imu import AxisNoise, Imu, TemperatureEffect
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from tests.exports.test_filters import ekf2, mavparm, opencv

Content = str | bytes


def without_words(text: Content) -> Any:
    found = json.loads(text)
    assert all(isinstance(line, str) and line.isprintable() for line in found["about"])
    return {key: value for key, value in found.items() if key not in ("about", "sensor")}


def program(text: Content) -> str:
    """Return Python as the interpreter takes the bytes of the file, a comment on them included."""
    assert isinstance(text, str)
    return ast.dump(ast.parse(text.encode()))


def script(text: Content) -> list[str]:
    """Return the statements of MATLAB: three points go on, and a per cent sign ends a line."""
    assert isinstance(text, str)
    assert not any(line.strip() in ("%{", "%}") for line in text.split("\n"))  # comments of blocks
    code = [line.split("%")[0].rstrip() for line in text.split("\n") if line.strip()]
    joined = "\n".join(line for line in code if line).replace("...\n", "")
    statements = joined.split("\n")
    for statement in statements:
        assert re.fullmatch(r"(IMU|imu)(\.\w+)? = .*;\s*", statement), statement
        for opened, closed in ("()", "[]"):
            assert statement.count(opened) == statement.count(closed)
    return statements


def arrays(content: Content) -> dict[str, Any]:
    assert isinstance(content, bytes)
    with np.load(io.BytesIO(content), allow_pickle=False) as found:
        return {name: found[name].tolist() for name in found.files if name != "about"}


def header(text: Content) -> str:
    """Return C++ without comments: a backslash at the end of a line joins the next (phase 2)."""
    assert isinstance(text, str)
    joined = text.replace("\\\n", "")
    return "\n".join(line.split("//")[0].rstrip() for line in joined.split("\n")).strip()


def sdf(text: Content) -> list[tuple[str, dict[str, str], str]]:
    """Return the elements of XML, which has no comment with two hyphens inside."""
    assert isinstance(text, str)
    root = ElementTree.fromstring(text.encode())
    return [(each.tag, each.attrib, (each.text or "").strip()) for each in root.iter()]


def about(content: Content) -> str:
    """Return all that a file says in words, on one line."""
    if isinstance(content, bytes):
        with np.load(io.BytesIO(content), allow_pickle=False) as found:
            return " ".join(found["about"].tolist())
    if content.startswith("{"):
        return " ".join(json.loads(content)["about"])
    lines = [line for line in content.split("\n") if line.startswith(("#", "%", "//"))]
    words = [line.lstrip("#%/") for line in lines]
    return re.sub(r"\s+", " ", " ".join(words))


PARSERS: dict[str, Callable[[Any], Any]] = {
    "kalibr": yaml.safe_load,
    "openvins": opencv,
    "vins-fusion": opencv,
    "basalt": without_words,
    "orb-slam3": opencv,
    "lio-sam": yaml.safe_load,
    "fast-lio": yaml.safe_load,
    "gtsam": program,
    "matlab-factor": script,
    "ceres": header,
    "px4": ekf2,
    "px4-mavparm": mavparm,
    "ardupilot": mavparm,
    "ros": yaml.safe_load,
    "pyins": program,
    "kf-gins": yaml.safe_load,
    "ob-gins": yaml.safe_load,
    "navego": script,
    "gazebo": sdf,
    "gnss-ins-sim": program,
    "matlab": script,
    "json": without_words,
    "npz": arrays,
}

positive = st.floats(1e-6, 1e-2)
models = st.builds(
    NoiseModel,
    N=positive,
    B=positive,
    T_B=st.none() | st.floats(1.0, 1e3),
    K=st.floats(1e-8, 1e-4),
    Q=st.just(0.0) | positive,
    R=st.just(0.0) | st.floats(1e-9, 1e-7),
    further=st.lists(st.builds(GaussMarkov, positive, st.floats(1.0, 1e3)), max_size=1),
    sinusoids=st.lists(st.builds(Sinusoid, positive, st.floats(0.1, 5.0)), max_size=1),
)
HOSTILE = "a\u2028gyro_x: 1\x85b\x00c\x1f: [\"'{}%#\\\r\n\t...\n\ufeff*/ é"
NAMES = (
    HOSTILE,
    "coding: utf-7 +AAo-import os+AAo-",  # in the first lines of Python, the encoding of the file
    "-*- coding: no_such -*-",
    "*/ int x; /*",
    "%{\n%}\nIMU = 1; %",
    "${HOME} $(id) `id`",
    "---\n...\n%YAML:1.0\nupdate_rate: 1",
    "'''\"\"\"\\\\'\"\nimport os #",
    "\n1\t1\tEKF2_GYR_NOISE\t1\t9\n",
    '"}, "value0": {"imu_update_rate": 1}',
    "--> <sdf version='1.9'> <!-- ]]> &amp; --",
    "ends with a backslash \\",
    "{noise} {0} %s",
    "x" * 1000,
    "\n: [" * 250,
)
names = st.text(min_size=1, max_size=20) | st.sampled_from(NAMES)
_LONGEST_LINE = 120


def lines_are_short_and_show(content: Content) -> None:
    """Assert that no comment is cut by an unseen line end, or longer than a reader takes."""
    if isinstance(content, str) and not content.startswith("{"):
        for line in content.split("\n"):
            assert line.replace("\t", "").isprintable()
            assert len(line) <= _LONGEST_LINE


def sensor(model: NoiseModel, said: str) -> Imu:
    axis = AxisNoise(model, f"gyro_x of recording {said}", [f"axes left out: {said}"])
    warm = TemperatureEffect(30.0, 20.0, 40.0, {"x": 1e-4}, {}, [f"axis y left out: {said}"])
    return Imu(
        sensor=said,
        rate=100.0,
        estimated={"gyro": axis, "accel": axis},
        inflation=1.5,
        because=f"it flies {said}",
        horizon=10.0,
        cautions=[f"left out: {said}"],
        temperature={"gyro": warm},
    )


def test_every_program_has_a_parser() -> None:
    lacks = TARGETS.keys() - PARSERS.keys()
    assert not lacks, f"PARSERS lacks {lacks}"


@pytest.mark.parametrize("name", TARGETS)
@settings(max_examples=4, deadline=None)
@given(model=models, said=names)
def test_words_never_reach_the_numbers(name: str, model: NoiseModel, said: str) -> None:
    write, parse = TARGETS[name].write, PARSERS[name]
    content = write(sensor(model, said))
    assert parse(content) == parse(write(sensor(model, "a")))
    lines_are_short_and_show(content)


@pytest.mark.parametrize("name", TARGETS)
def test_no_name_reaches_the_numbers(name: str) -> None:
    model = NoiseModel(N=1e-4, B=1e-4, T_B=90.0, K=1e-6)
    write, parse = TARGETS[name].write, PARSERS[name]
    plain = parse(write(sensor(model, "a")))
    for said in NAMES:
        content = write(sensor(model, said))
        assert parse(content) == plain, said[:40]
        lines_are_short_and_show(content)
        if name == "json":
            assert json.loads(content)["sensor"] == said


@pytest.mark.parametrize("name", TARGETS)
def test_every_file_says_what_is_left_out(name: str) -> None:
    rest = NoiseModel(N=1e-4, B=1e-4, K=1e-6, Q=1e-5, R=1e-8, sinusoids=[Sinusoid(1e-4, 2.0)])
    said = about(TARGETS[name].write(sensor(rest, "run 3")))
    for words in (
        "CAUTION: left out: run 3.",
        "gyro: axes left out: run 3.",
        "ixed biases",
        "gyro model (rad, s; N two-sided): Q = 1.000e-05, N = 1.000e-04",
        "because: it flies run 3.",
    ):
        assert words in said
    if name not in ("json", "npz"):  # they hold every term
        assert "line of amplitude 1.500e-04 at 2 Hz" in said
        assert re.search(
            r"Q = 1\.500e-05.{0,40} is not included|not included: Q = 1\.500e-05", said
        )

"""Files of YAML from strangers: bounded before anything is built of them."""

import importlib
import os
import pkgutil
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError, create_model
from pydantic.fields import FieldInfo

import imubench_pipeline.settings
from imubench_pipeline.settings.config import Run
from imubench_pipeline.settings.sensor import ColumnSource, RecordingNotes, Sensor
from imubench_pipeline.settings.validation import ConfigError, Strict, parse
from imubench_pipeline.settings.yaml_files import (
    MAX_BYTES,
    MAX_DEPTH,
    MAX_NODES,
    read_folder,
    read_settings,
    read_yaml,
)


def bomb(levels: int, each: int) -> str:
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join(each * [f'*a{k - 1}'])}]" for k in range(1, levels)]
    return "\n".join(lines)


HOSTILE = {
    "an alias bomb": (bomb(10, 9), f"line 6.*more than {MAX_NODES} keys and values"),
    "brackets": (200_000 * "[", f"nested more than {MAX_DEPTH} levels deep"),
    "braces": (200_000 * "{", f"nested more than {MAX_DEPTH} levels deep"),
    "nested maps": (
        "\n".join(" " * k + f"k{k}:" for k in range(2000)),
        f"nested more than {MAX_DEPTH} levels deep",
    ),
    "a list that contains itself": ("a: &a [1, *a]", r"line 1.*\*a contains itself"),
    "many keys": ("\n".join(f"k{k}: 1" for k in range(MAX_NODES)), f"more than {MAX_NODES} keys"),
    "a key twice": ("rate: 100 Hz\nunit: g\nrate: 50 Hz\n", "line 3.*'rate' occurs twice"),
    "a key twice inside": ("a:\n  - {b: 1, b: 2}\n", "line 2.*'b' occurs twice"),
    "an object": ("a: !!python/object/apply:os.system ['true']", "line 1: not readable as YAML"),
    "a number of many digits": ("a: " + 10_000 * "9", "not readable as YAML"),
    "a day that is none": ("a: !!timestamp 2021-13-45", "not readable as YAML"),
    "a list as a key": ("? [1, 2]\n: 3\n", "unhashable key"),
    "too large": ("#" * (MAX_BYTES + 1), "larger than 4 MB"),
    "a letter that is none": ("a: \x00", "not readable as YAML"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_at_once(name: str, tmp_path: Path) -> None:
    text, said = HOSTILE[name]
    path = tmp_path / "a.yaml"
    path.write_text(text)
    begin = time.process_time()
    with pytest.raises(ConfigError, match=said) as caught:
        read_yaml(path)
    assert time.process_time() - begin < 5.0
    assert str(caught.value).startswith(str(path)) and len(str(caught.value)) < len(str(path)) + 300


def fifo(path: Path) -> None:
    os.mkfifo(path)


@pytest.mark.parametrize("make", [fifo, Path.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_what_is_no_regular_file_is_refused(make: Callable[[Path], None], tmp_path: Path) -> None:
    make(tmp_path / "a.yaml")
    with pytest.raises(ConfigError, match="not a regular file"):
        read_yaml(tmp_path / "a.yaml")


def test_a_key_may_replace_one_that_is_merged(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("base: &b {rate: 1, unit: g}\nown:\n  <<: *b\n  rate: 2\n")
    assert read_yaml(path) == {"base": {"rate": 1, "unit": "g"}, "own": {"rate": 2, "unit": "g"}}


def test_errors_never_hold_more_than_a_line_of_the_file(tmp_path: Path) -> None:
    data = {"log": {"rate": "x" * 10**6}, "y" * 10**6: [0] * 10**5, "device": {"a": "z" * 10**6}}
    with pytest.raises(ConfigError) as caught:
        parse(RecordingNotes, data, "notes")
    assert len(str(caught.value)) < 3000
    with pytest.raises(ConfigError) as caught:
        parse(RecordingNotes, [data] * 1000, "notes")
    assert len(str(caught.value)) < 300


VALUES = st.recursive(
    st.none() | st.integers(-(10**9), 10**9) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=20,
)


@example("\x85")
@example({" ": None, "\x85": None})
@given(VALUES)
def test_what_is_written_is_read(value: object) -> None:
    # Escaped, and as people type it. PyYAML itself writes U+0085 without an escape where it is
    # allowed to, and folds it into a space when it reads, which may make two keys the same: what it
    # loses is not judged here.
    escaped, typed = yaml.safe_dump(value), yaml.safe_dump(value, allow_unicode=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.yaml")
        for text in (escaped, typed) if yaml.safe_load(typed) == value else (escaped,):
            path.write_text(text, encoding="utf-8")
            assert read_yaml(path) == value


def test_a_next_line_sign_is_read_where_it_is_escaped(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(r'"\x85"')
    assert read_yaml(tmp_path / "a.yaml") == "\x85"


# ------------------------------------------------------------------------- text stays text


def all_settings(model: type[Strict] = Strict) -> Iterator[type[Strict]]:
    """Yield the models of all files of YAML."""
    for module in pkgutil.walk_packages(
        imubench_pipeline.settings.__path__, "imubench_pipeline.settings."
    ):
        importlib.import_module(module.name)
    for below in model.__subclasses__():
        yield below
        yield from all_settings(below)


def written_as(declared: Any) -> str | None:
    """Return how YAML has a text where a type is declared; None where it need not be a text."""
    if get_origin(declared) is Annotated:
        return written_as(get_args(declared)[0])
    if get_origin(declared) in (Union, UnionType):
        options = [each for each in get_args(declared) if each is not type(None)]
        if any(get_origin(each) is Annotated for each in options):
            options = [get_args(o)[0] if get_origin(o) is Annotated else o for o in options]
        return "{}" if str in options and not {int, float} & set(options) else None
    if get_origin(declared) is tuple and get_args(declared)[-1] is Ellipsis:
        inner = written_as(get_args(declared)[0])
        return f"[{inner}]" if inner == "{}" else None
    return "{}" if declared is str else None


@cache
def texts() -> list[tuple[str, bool, str, type[BaseModel]]]:
    """Return name, whether any text will do, form, and a model of each text that is declared."""
    found = []
    for model in all_settings():
        for name, field in model.model_fields.items():
            form = written_as(Annotated[field.annotation, None])
            if form is not None:
                own: dict[str, Any] = {"v": (field.annotation, field)}
                free = form == "{}" and is_free(field)
                made = create_model("Own", __base__=Strict, **own)
                assert model.model_config == made.model_config
                found.append((f"{model.__name__}.{name}", free, form, made))
    return found


def is_free(field: FieldInfo) -> bool:
    """Return whether a field takes texts that have no figure, unit or pattern."""
    try:
        create_model("Own", __base__=Strict, v=(field.annotation, field))(v="some words")
    except ValidationError:
        return False
    return True


def test_every_file_has_texts() -> None:
    names = {name for name, free, _, _ in texts() if free}
    assert names >= {
        "RecordingNotes.device",
        "RecordingNotes.started",
        "Sensor.model",
        "Sensor.vendor",
        "ColumnSource.variable",
        "ColumnSource.file",
        "ExportSettings.axis",
        "Requirement.title",
    }
    assert len(texts()) > 60


MISTAKEN = st.one_of(
    *(
        st.from_regex(pattern, fullmatch=True)
        for pattern in (
            "[-+]?0[0-7_]{1,9}",
            "[-+]?0b[01_]{1,9}",
            "[-+]?0x[0-9a-fA-F]{1,9}",
            "[-+]?[1-9][0-9_]{0,9}",
            r"[-+]?[1-9][0-9_]{0,4}(:[0-5]?[0-9]){1,3}(\.[0-9]{0,4})?",
            r"[-+]?[0-9]{1,6}\.[0-9]{0,6}([eE][-+][0-9]{1,2})?",
            r"\.[0-9]{1,6}([eE][-+]?[0-9]{1,2})?",
            "[0-9]{1,3}[eE][-+]?[0-9]{1,3}",
            r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
            "[0-9]{4}-[01][0-9]-[0-3][0-9]",
            r"[0-9]{4}-[01]?[0-9]-[0-3]?[0-9]([Tt]| )[0-2]?[0-9]:[0-5][0-9]:[0-5][0-9]"
            r"(\.[0-9]{0,9})?( ?(Z|[-+][01]?[0-9](:[0-5][0-9])?))?",
            "yes|Yes|YES|no|No|NO|on|On|ON|off|Off|OFF|true|True|TRUE|false|False|FALSE|y|Y|n|N",
        )
    )
)


@example("0017")
@example("12:30:45")
@example("1.10")
@example("2026-01-01 12:00:00")
@example("No")
@given(MISTAKEN)
def test_a_text_is_what_is_written(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.yaml")
        path.write_text(f"alone: {text}\nlisted: [{text}]\n{text}: name\n")
        read = read_yaml(path)
    assert list(read)[2:] == [text] and type(list(read)[2]) is str
    for name, free, form, model in texts():
        value = read["alone"] if form == "{}" else read["listed"]
        try:
            (made,) = dict(model(v=value)).values()
        except ValidationError as error:
            # It is no figure of that dimension, and so on; but it was taken for a text.
            assert not free, name
            assert {fault["type"] for fault in error.errors()} & {"value_error", *_CHECKS}, name
        else:
            assert made in (text, (text,)), name


_CHECKS = {"string_pattern_mismatch", "string_too_short", "string_too_long", "literal_error"}


@pytest.mark.parametrize(
    ("column", "meant"), [("1", 1), ('"1"', "1"), ("wx", "wx"), ("12:30", "12:30"), ("on", "on")]
)
def test_a_column_is_a_number_or_a_name(column: str, meant: str | int, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(f"column: {column}\nunit: deg/s\n")
    source = read_settings(ColumnSource, tmp_path / "a.yaml")
    assert source.column == meant and type(source.column) is type(meant)


@pytest.mark.parametrize(
    ("word", "meant"), [("yes", True), ("No", False), ("TRUE", True), ("off", False), ("1", True)]
)
def test_words_are_true_or_false_where_a_setting_is(word: str, meant: bool, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(f"power_cycled: {word}\n")
    assert read_settings(RecordingNotes, tmp_path / "a.yaml").power_cycled is meant


def test_two_devices_are_two(tmp_path: Path) -> None:
    log = "log: {rate: 100 Hz, channels: {gyro_x: {column: 1, unit: deg/s}}}\nvendor: V\n"
    for name, model in {"a": "1.1", "b": "1.10", "c": "017", "d": "15"}.items():
        (tmp_path / f"{name}.yaml").write_text(f"{log}model: {model}\n")
    sensors = read_folder(Sensor, tmp_path, "sensor")
    assert [sensor.model for sensor in sensors.values()] == ["1.1", "1.10", "017", "15"]


@pytest.mark.parametrize("name", ["0017", "1.10", "1e2", "12:30", "0x10", "2026-01-01"])
@pytest.mark.parametrize("key", ["logs", "results", "sensors", "simulated", "requirements"])
def test_a_folder_may_look_like_a_number(key: str, name: str, tmp_path: Path) -> None:
    file = tmp_path / "config.yaml"
    file.write_text(f"{key}: {name}\n")
    assert getattr(read_settings(Run, file), key) == Path(name)


@pytest.mark.parametrize(
    ("key", "written", "value"),
    [
        ("shortest", "1e2", 100),
        ("shortest", "1.2E+3", 1200),
        ("longest_hole", "1e2", 100.0),
        ("longest_hole", "5.e-1", 0.5),
    ],
)
def test_numbers_may_have_an_exponent(key: str, written: str, value: float, tmp_path: Path) -> None:
    file = tmp_path / "config.yaml"
    file.write_text(f"quality:\n  {key}: {written}\n")
    assert getattr(read_settings(Run, file).quality, key) == value


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"logs: a\nresults: \x01b\n", "line 2: not readable as YAML: U+0001"),
        (b"logs: a\n\nresults: b\xe9\n", "line 3: byte 0xE9 is not UTF-8"),
        (b"logs: a\nresults: [1\n", "line 3: not readable as YAML"),
        (b"logs: 0017\nquality: {shortest: 1.50}\n", "quality.shortest: found 1.50;"),
    ],
)
def test_a_fault_is_found_by_its_line_and_as_written(
    content: bytes, found: str, tmp_path: Path
) -> None:
    file = tmp_path / "config.yaml"
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=re.escape(found)):
        read_settings(Run, file)

"""Files of YAML from strangers: bounded before anything is built of them."""

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from imubench_pipeline.settings.sensor import RecordingNotes
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.settings.yaml_files import DEEPEST, LARGEST, MOST, read_yaml


def bomb(levels: int, each: int) -> str:
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join(each * [f'*a{k - 1}'])}]" for k in range(1, levels)]
    return "\n".join(lines)


HOSTILE = {
    "an alias bomb": (bomb(10, 9), f"line 6.*more than {MOST} keys and values"),
    "brackets": (200_000 * "[", f"more than {DEEPEST} lists"),
    "braces": (200_000 * "{", f"more than {DEEPEST} lists"),
    "nested maps": (
        "\n".join(" " * k + f"k{k}:" for k in range(2000)),
        f"more than {DEEPEST} lists",
    ),
    "a list that holds itself": ("a: &a [1, *a]", r"line 1.*\*a holds itself"),
    "many keys": ("\n".join(f"k{k}: 1" for k in range(MOST)), f"more than {MOST} keys"),
    "a key twice": ("rate: 100 Hz\nunit: g\nrate: 50 Hz\n", "line 3.*'rate' stands twice"),
    "a key twice inside": ("a:\n  - {b: 1, b: 2}\n", "line 2.*'b' stands twice"),
    "an object": ("a: !!python/object/apply:os.system ['true']", "line 1: not readable as YAML"),
    "a number of many digits": ("a: " + 10_000 * "9", "not readable as YAML"),
    "a day that is none": ("a: 2021-13-45", "not readable as YAML"),
    "a list as a key": ("? [1, 2]\n: 3\n", "unhashable key"),
    "too large": ("#" * (LARGEST + 1), "larger than 4 MB"),
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
    with pytest.raises(ConfigError, match="no regular file"):
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
    st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.text(max_size=8),
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

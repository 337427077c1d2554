"""Every command that a page prints does in a shell what it says, whatever names stand in it."""

import os
import re
import subprocess
from html import unescape
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from imubench_pipeline.report.publish import publish
from imubench_pipeline.report.site import make_command, make_recompute_command
from imubench_pipeline.run.cli import main
from tests.report.tables import joined, put_log, put_samples, recording_rows, site

HOSTILE = "-r '\"\n$(touch made) `touch made`; touch made #\\"
names = st.text(
    st.sampled_from("-=a '\"\n\t$()`;&|<>*?[]!#~\\\u2028") | st.characters(codec="utf-8"),
    min_size=1,
    max_size=12,
).filter(lambda text: "\x00" not in text)


@pytest.fixture(scope="module")
def stubs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with programs that write their words, each ended by a null, into a file."""
    folder = tmp_path_factory.mktemp("stubs")
    for name in ("imubench", "snakemake"):
        program = folder / name
        program.write_text(f"#!/bin/sh\nprintf '%s\\0' {name} \"$@\" > words\n")
        program.chmod(0o755)
    return folder


def words_of(command: str, stubs: Path) -> list[str]:
    """Return the words that the program of a command is given by a shell."""
    path = f"{stubs}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(["sh", "-c", command], check=True, cwd=stubs, env={"PATH": path})
    assert sorted(one.name for one in stubs.iterdir()) == ["imubench", "snakemake", "words"]
    return (stubs / "words").read_bytes().decode().split("\x00")[:-1]


# Two processes each: every day eight of them, more before a release.
@settings(max_examples=max(8, settings().max_examples // 3), deadline=None)
@given(results=names, sensor=names, given_to=st.lists(names, max_size=1))
@example(HOSTILE, HOSTILE, [HOSTILE])
@example("--help", "--", [])
def test_each_word_arrives_as_it_is(
    stubs: Path, results: str, sensor: str, given_to: list[str]
) -> None:
    stated = [f"logs={name}" for name in given_to]
    config = ["--config", *stated] if stated else []
    assert words_of(make_recompute_command(results, stated), stubs) == (
        ["snakemake", "-c2", *config, "--forcerun", "ingest", "--", results]
    )
    name, place, *option = words_of(make_command("figures", results, {"--sensor": sensor}), stubs)[
        1:
    ]
    assert (name, os.path.normpath(place)) == ("figures", os.path.normpath(results))
    assert not place.startswith("-")
    assert option in (["--sensor", sensor], [f"--sensor={sensor}"])


def test_names_that_begin_with_a_dash_are_no_options(
    stubs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = {"--sensor": "-s", "--recording": "--help"}
    words = words_of(make_command("figures", "--help", options), stubs)
    assert main(words[1:]) == 2
    assert "--help" in capsys.readouterr().err  # the folder that is not there, and no usage


@pytest.mark.usefixtures("small_report")
def test_the_pages_print_these_commands(stubs: Path, tmp_path: Path) -> None:
    put_samples(tmp_path, "-s", "-r  2")
    put_log(tmp_path, "-s", "-r  2", sources=[])
    of = site(joined(recording_rows("-s", "-r  2")), tmp_path, named=HOSTILE)
    publish(of, tmp_path / "report", lambda _: None)
    printed = [
        unescape(code)
        for page in ("made.html", "recordings/-s/-r  2.html")
        for code in re.findall(
            r"<code>(.*?)</code>", (tmp_path / "report" / page).read_text(), re.S
        )
    ]
    commands = [code for code in printed if code.startswith(("imubench ", "snakemake "))]
    told = [words_of(command, stubs) for command in commands]
    assert ["snakemake", "-c2"] in told and len(told) == 7
    assert {words[1] for words in told if words[0] == "imubench"} == (
        {"show", "figures", "report", "export"}
    )
    assert all(words[2] == f"./{HOSTILE}" for words in told if words[0] == "imubench")
    assert ["imubench", "figures", f"./{HOSTILE}", "--sensor=-s", "--recording=-r  2"] in told
    target = f"{HOSTILE}/recordings/-s/-r  2/scores.parquet"
    assert ["snakemake", "-c2", "--forcerun", "ingest", "--", target] in told

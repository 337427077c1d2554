"""Every option that names an output, as the parser has them: nothing that is there is lost."""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from imubench_pipeline.extensions.figures import figures as static_files
from imubench_pipeline.report.publish import publish
from imubench_pipeline.run import cli
from imubench_pipeline.run.cli import main
from imubench_pipeline.settings.command_line import parse_path
from imubench_pipeline.tables.outputs import OutputFolder, StoreOutput
from tests.conftest import PROJECT
from tests.report.tables import joined, put_samples, put_tables, recording_rows, site

PARSER = cli.make_parser()
LOG = "Time (s),Gyroscope X (deg/s)\n" + "".join(
    f"{n / 100},{(n * 7919) % 101 / 100}\n" for n in range(200)
)

OUTPUTS = {
    ("analyse", "output"): ["run.csv", "--output", "{}"],
    ("calibrate", "output"): ["run.csv", "--target", "json", "--output", "{}"],
    ("init", "folder"): ["{}"],
    ("schema", "output"): ["sensor", "--output", "{}"],
    ("inspect", "output"): ["run.csv", "--output", "{}"],
    ("export", "output"): ["results", "--sensor", "imu", "--target", "json", "--output", "{}"],
    ("report", "one_file"): ["results", "--one-file", "{}"],
    ("report", "output"): ["results", "--output", "{}"],
    ("figures", "output"): ["results", "--kind", "theory", "--format", "svg", "--output", "{}"],
    ("compare", "output"): ["results", "results", "--output", "{}"],
    ("sensors", "class_limits"): ["--class-limits", "{}"],
    ("sensors", "csv"): ["--csv", "{}"],
    ("simulate", "out"): ["bno055", "--duration", "1 s", "--out", "{}"],
}
"""Every option that names an output, and the arguments of its command."""

INPUTS = {
    "analyse": {"logs", "sensor", "config"},
    "calibrate": {"logs", "sensor", "config", "in_use"},
    "demo": {"real"},
    "run": {"folder"},
    "check": {"logs", "sensors", "config"},
    "inspect": {"log"},
    "export": {"results", "in_use"},
    "show": {"results"},
    "papers": {"results"},
    "compare": {"run_a", "run_b"},
    "shortlist": {"sensors", "requirements", "results"},
    "sensors": {"sensors"},
    "report": {"results"},
    "figures": {"results"},
    "simulate": {"motion", "results", "sensors"},
    "nightly": {"folder", "project"},
    "verify": {"results"},
}
"""Every other option that names a path."""


def actions() -> Iterator[tuple[str, argparse.Action]]:
    (commands,) = (
        action for action in PARSER._actions if isinstance(action, argparse._SubParsersAction)
    )
    for name, parser in commands.choices.items():
        yield from ((name, action) for action in parser._actions)


def test_every_option_with_a_path_is_an_output_with_a_case_or_an_input() -> None:
    paths = [(name, action) for name, action in actions() if action.type is parse_path]
    outputs = {(name, action.dest) for name, action in paths if isinstance(action, StoreOutput)}
    # `demo` runs for minutes: tests/test_demo_command.py asks for its folder.
    assert outputs == OUTPUTS.keys() | {("demo", "folder")}
    inputs = {(name, action.dest) for name, action in paths if not isinstance(action, StoreOutput)}
    assert inputs == {(name, dest) for name, of in INPUTS.items() for dest in of}


FOLDERS = {
    (name, action.dest)
    for name, action in actions()
    if isinstance(action, StoreOutput) and isinstance(action.make(Path()), OutputFolder)
}
QUICK = [(name, "output") for name in ("schema", "inspect", "export")] + [("simulate", "out")]
FORCEABLE = [case for case in OUTPUTS if case != ("init", "folder")]


def call(case: tuple[str, str], target: object, *more: str) -> int:
    words = [word.format(target) for word in OUTPUTS[case]]
    if case == ("simulate", "out"):
        words += ["--sensors", str(PROJECT / "config/sensors")]
    try:
        return main([case[0], *words, *more])
    except SystemExit as ended:
        assert isinstance(ended.code, int)
        return ended.code


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with what a finished run leaves."""
    folder = tmp_path_factory.mktemp("lab")
    put_tables(joined(recording_rows("imu", "day 1")), folder / "results")
    put_samples(folder / "results", "imu", "day 1")
    publish(
        site(joined(recording_rows("imu", "day 1")), folder / "results"), folder / "results/report"
    )
    (folder / "results/seals").mkdir()
    for place in ("config/sensors", "logs/imu"):
        (folder / place).mkdir(parents=True)
    (folder / "config/config.yaml").write_text("logs: logs\n")
    (folder / "config/sensors/imu.yaml").write_text("vendor: x\n")
    (folder / "logs/imu/day.csv").write_text(LOG)
    (folder / "run.csv").write_text(LOG)
    return folder


@pytest.fixture
def lab(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    # In a folder of its own, so that nothing beside the project is missed.
    folder = Path(shutil.copytree(whole, tmp_path / "lab"))
    monkeypatch.chdir(folder)
    # The same parser each time: hundreds of commands are called.
    monkeypatch.setattr(cli, "make_parser", lambda: PARSER)
    return folder


def contents(folder: Path) -> dict[str, object]:
    """Return what is in a folder: inode, kind, and bytes or target of a link."""
    found: dict[str, object] = {}
    for path in folder.rglob("*"):
        status = path.lstat()
        content: object = None
        if path.is_symlink():
            content = path.readlink()
        elif path.is_file():
            content = path.read_bytes()
        found[str(path.relative_to(folder))] = (status.st_ino, status.st_mode, content)
    return found


PRECIOUS = {
    "log": "logs/imu/day.csv",
    "table": "results/tables/recordings.parquet",
    "settings": "config/config.yaml",
    "sensor": "config/sensors/imu.yaml",
}
ENDING = {("simulate", "out"): ".csv", ("inspect", "output"): ".yaml"}


def named(case: tuple[str, str], name: str) -> str:
    """Return a name that the command would take."""
    return name + ENDING.get(case, "")


@contextmanager
def kept(lab: Path) -> Iterator[None]:
    """Check that nothing changes, and nothing is added."""
    before = contents(lab)
    yield
    assert contents(lab) == before


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("case", OUTPUTS, ids="-".join)
def test_what_a_project_has_is_never_replaced(
    case: tuple[str, str], force: bool, lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = ["--force"] if force and case in FORCEABLE else []
    (lab / "other").mkdir()
    targets: list[str] = []
    for name, place in PRECIOUS.items():
        path = lab / place
        link = lab / named(case, f"link_{name}")
        link.symlink_to(path if name == "log" else place)
        targets += [place, str(path), f"other/../{place}", link.name]
        (lab / f"folder_{name}").symlink_to(path.parent)
        targets += [f"folder_{name}/{path.name}"]
    # New names in the places of other things, and the places themselves.
    (lab / "dangling").symlink_to("results/tables/new.csv")
    targets += ["results/tables/new.csv", "results/seals/new.csv", "dangling", "folder_table/x.csv"]
    targets += ["results/recordings", "config", "logs", "results", "."] if case in FOLDERS else []
    if case[0] != "simulate":
        targets += ["logs/new.csv", "logs/imu/new.csv", "folder_log/new.csv"]
    if case[0] != "inspect":
        targets += ["config/new.csv", "config/sensors/new.csv"]
    if case == ("init", "folder"):
        targets = [
            target for target in targets if target != "results"
        ]  # none of its files is in it
    with kept(lab):
        for target in targets:
            assert call(case, target, *flags) == 2, target
            out, err = capsys.readouterr()
            assert out == "" and err.count("\n") == 1, (target, err)


@pytest.mark.parametrize("case", OUTPUTS, ids="-".join)
def test_what_is_no_file_is_never_replaced(
    case: tuple[str, str], lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(lab / named(case, "pipe"))
    (lab / named(case, "device")).symlink_to("/dev/full")
    (lab / named(case, "loop")).symlink_to(named(case, "loop"))
    targets = [named(case, name) for name in ("pipe", "device", "loop")]
    targets += ["/dev/null", "/dev/full", "/dev/stdout", "a\nb", "", "a\0b", "x" * 300, "y/" * 3000]
    targets += ["run.csv", "run.csv/x"] if case in FOLDERS else ["logs", "results", "."]
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(named(case, "socket"))
        targets.append(named(case, "socket"))
        before = os.lstat("/dev/null").st_ino
        with kept(lab):
            for target in targets:
                for flags in ([], ["--force"]) if case in FORCEABLE else ([],):
                    assert call(case, target, *flags) == 2, target
                    out, err = capsys.readouterr()
                    last = err.splitlines()[-1]
                    assert out == "" and f"imubench {case[0]}: " in last, (target, err)
                    assert "Traceback" not in err
        assert os.lstat("/dev/null").st_ino == before


@pytest.mark.parametrize(
    "case",
    [
        case if case in QUICK else pytest.param(case, marks=pytest.mark.release)
        for case in FORCEABLE
    ],
    ids=str,
)
def test_an_output_is_replaced_with_force_alone(
    case: tuple[str, str], lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The file of a hard link, too, of which the other name keeps all."""
    log = lab / "logs/imu/day.csv"
    target = lab / named(case, "made")
    if case in FOLDERS:
        target.mkdir()
        (target / "theory.svg").hardlink_to(log)
        (target / "index.html").write_text("mine")
        (target / "mine.html").write_text("mine")
    else:
        target.hardlink_to(log)
    (lab / named(case, "link")).symlink_to(target.name)
    with kept(lab):
        assert call(case, target) == 2
        assert "--force" in capsys.readouterr().err
    old = contents(lab)
    assert call(case, named(case, "link"), "--force") == 0, capsys.readouterr().err
    new = contents(lab)
    changed = {path for path in new if new[path] != old.get(path)} | (old.keys() - new.keys())
    assert changed and all(path.startswith(("made", "link.yaml")) for path in changed)
    if case in FOLDERS:
        assert (target / "mine.html").read_text() == "mine"
        assert not list(target.rglob(".*"))
    else:
        assert target.read_bytes() != log.read_bytes()


@pytest.mark.parametrize(
    "case", [("schema", "output"), ("inspect", "output"), ("simulate", "out")], ids="-".join
)
def test_nothing_is_lost_on_a_full_disk(
    case: tuple[str, str], lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = lab / named(case, "made")
    assert call(case, target) == 0  # compiles, too
    capsys.readouterr()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with kept(lab):
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
        try:
            status = call(case, target, "--force")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert status == 2
    err = capsys.readouterr().err
    assert err.startswith(f"imubench {case[0]}: {target}: File too large; "), err
    assert err.count("\n") == 1


@pytest.mark.parametrize("case", [("schema", "output"), ("figures", "output")], ids="-".join)
def test_a_place_that_cannot_be_written_is_named(
    case: tuple[str, str], lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for target in ("/proc/x", "/proc/x/y", "run.csv/x"):
        assert call(case, target) == 2
        err = capsys.readouterr().err.splitlines()[-1]
        assert err.startswith(f"imubench {case[0]}: {target}: "), err


def test_new_files_go_where_they_belong(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Simulated logs to the logs, sensor files to the configuration; no command replaces them."""
    places = {("simulate", "out"): "logs/bno055/x.csv", ("inspect", "output"): "config/sensors/x"}
    for case, target in places.items():
        assert call(case, target) == 0, capsys.readouterr().err
        with kept(lab):
            for flags in ([], ["--force"]):
                assert call(case, target, *flags) == 2
                assert "exists already" in capsys.readouterr().err
    assert (lab / "logs/bno055/x.yaml").is_file()


def test_an_output_is_not_what_the_command_reads(
    lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (lab / "same.csv").hardlink_to(lab / "run.csv")
    with kept(lab):
        for target in ("run.csv", "./run.csv", "same.csv"):
            assert call(("inspect", "output"), target, "--force") == 2
            assert "is an input of the command" in capsys.readouterr().err


def test_links_to_nothing_and_long_names_are_written(lab: Path) -> None:
    (lab / "link").symlink_to("elsewhere/made.json")
    assert call(("schema", "output"), "link") == 0
    assert (lab / "link").is_symlink() and (lab / "elsewhere/made.json").is_file()
    for name in ("x" * 255, "é" * 127):
        assert call(("schema", "output"), name) == 0
        assert (lab / name).is_file()


def test_an_earlier_report_is_replaced_and_nothing_beside_it(
    lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Seconds: the figures are drawn in the test of all outputs, before a release.
    monkeypatch.setattr(static_files, "list_drawings", lambda *_: [])
    case = ("report", "output")
    assert call(case, "site") == 0
    made = lab / "site"
    (made / "recordings/mine.html").write_text("mine")
    (made / "notes.txt").write_text("mine")
    page = made / "recordings/imu/day 1.html"
    expected = contents(made)
    page.write_text("old")
    keys = made / "pages.json"
    keys.write_text(keys.read_text().replace("{", '{"recordings/gone.html": "x",', 1))
    (made / "recordings/gone.html").write_text("old")
    assert call(case, "site") == 0
    found = contents(made)
    assert {name for name in found if found[name] != expected.get(name)} == {
        "pages.json",
        "recordings/imu/day 1.html",
    }
    assert found.keys() == expected.keys()
    # A link in it that leads out is not followed.
    (made / "index.html").unlink()
    (made / "index.html").symlink_to(lab / "run.csv")
    with kept(lab):
        assert call(case, "site") == 2


@pytest.mark.parametrize(
    ("command", "option", "values"),
    [
        ("simulate bno055 --duration 1s --out x.csv", "--seed", ["-1", "nan", "1e3", "9" * 5000]),
        ("simulate bno055 --rate 1kHz --out x.csv", "--duration", ["1e308 s", "nan s", "-1 s"]),
        ("simulate bno055 --duration 1s --out x.csv", "--temperature", ["1e308 degC", "-300 degC"]),
        ("export results --sensor imu --target json", "--horizon", ["nan", "-1", "1e308 s", "0"]),
        ("export results --sensor imu --target json", "--inflate", ["nan", "-1", "1e308", "inf"]),
        ("export results --sensor imu --target json", "--rate", ["nan", "-1", "0", "inf"]),
        ("export results --sensor imu --target json", "--excess", ["nan", "-1", "inf", ""]),
        ("show results", "--width", ["-1", "nan", "1" + "0" * 20, ""]),
        ("analyse run.csv", "--cores", ["-1", "nan", "0", ""]),
        ("nightly", "--settle", ["-1", "nan", "inf", "1e308", ""]),
        ("nightly", "--wait", ["-1", "nan", "inf", "1e308", ""]),
    ],
)
def test_numbers_out_of_range_are_refused(
    command: str,
    option: str,
    values: list[str],
    lab: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for value in values:
        try:
            status = main([*command.split(), f"{option}={value}"])
        except SystemExit as ended:
            status = ended.code  # type: ignore[assignment]  # argparse ends with a number
        out, err = capsys.readouterr()
        assert (status, out) == (2, ""), value
        assert option in err.splitlines()[-1] and "expected" in err.splitlines()[-1]
        assert len(err.splitlines()[-1]) < 300


COMMAND = [sys.executable, "-m", "imubench_pipeline.run.start"]


def test_a_terminal_that_cannot_be_written_is_no_traceback() -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = subprocess.run(
            [*COMMAND, "schema", "run"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert done.stderr.startswith("imubench schema: No space left on device; ")
    assert done.stderr.count("\n") == 1


@pytest.mark.release  # long: it waits for a process
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_command_that_is_stopped_leaves_nothing(lab: Path, number: signal.Signals) -> None:
    (lab / "made").mkdir()
    (lab / "made/x.csv").write_text("old")
    words = ["simulate", "bno055", "--hours", "1000", "--out", "made/x.csv", "--force"]
    sensors = ["--sensors", str(PROJECT / "config/sensors")]
    with kept(lab):
        process = subprocess.Popen([*COMMAND, *words, *sensors], stderr=subprocess.PIPE)
        while not list((lab / "made").glob(".x.csv.*.part")):
            assert process.poll() is None
            time.sleep(0.05)
        time.sleep(1.0)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert b"Traceback" not in err


def test_the_logs_that_a_report_names_are_a_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results/seals").mkdir(parents=True)
    (tmp_path / "results/report").mkdir()
    (tmp_path / "results/report/settings.json").write_text('{"results": "results", "logs": "drop"}')
    (tmp_path / "drop/s").mkdir(parents=True)
    log = tmp_path / "drop/s/a.csv"
    log.write_text("1,2\n")
    (tmp_path / "link").symlink_to(log)
    for name in ("link", "drop/s/a.csv", "drop/s/new.json"):
        assert main(["schema", "run", "--output", name, "--force"]) == 2
        assert "belongs to the logs" in capsys.readouterr().err
    assert log.read_text() == "1,2\n" and [*log.parent.iterdir()] == [log]


@pytest.mark.parametrize("place", ["results", "results/tables/new"])
def test_a_project_is_not_made_in_results(lab: Path, place: str) -> None:
    before = contents(lab)
    assert main(["init", str(lab / place)]) == 2
    assert contents(lab) == before

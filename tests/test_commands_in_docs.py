"""Every command of the README and of `docs/` is run here, or says what runs it instead."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from imubench_pipeline.run.cli import main, make_parser
from tests.conftest import PROJECT, few

PAGES = [
    *(
        PROJECT / name
        for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "config/README.md")
    ),
    *sorted(path for path in (PROJECT / "docs").rglob("*.md") if "_build" not in path.parts),
]
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"(^|\s+)#( .*)?$")

INSTALLS = "installs from an index: .ci/run"
OF_A_WHEEL = "installs from an index: benchmarks/installed.py"
HOURS = "minutes to hours: by hand before a release; its flags are tried by -m release"
ELSEWHERE = {
    "git clone <this repository> && cd imubench_pipeline": "needs a place where it is kept",
    "python3 -m venv .venv && .venv/bin/pip install -r requirements/dev.txt": INSTALLS,
    ".venv/bin/pip install --no-deps --no-build-isolation -e .": INSTALLS,
    "python3 -m venv .venv && .venv/bin/pip install uv && .venv/bin/uv pip install -p .venv "
    "-r requirements/run.txt && .venv/bin/uv pip install -p .venv --no-deps --no-build-isolation "
    "-e . && .venv/bin/snakemake -c2": INSTALLS,
    "python3 -m venv .venv-test && .venv-test/bin/pip install uv && .venv-test/bin/uv pip install "
    "-p .venv-test -r requirements/test.txt && .venv-test/bin/uv pip install -p .venv-test "
    "--no-deps --no-build-isolation -e . && .venv-test/bin/python -m pytest -n 2": INSTALLS,
    ".venv-test/bin/uv pip install -p .venv-test -r requirements/docs.txt && "
    ".venv-test/bin/sphinx-build -W -q docs docs/_build/html": INSTALLS,
    ".venv/bin/pip install -r requirements/docs.txt && .venv/bin/sphinx-build -W -q docs "
    "docs/_build/html": INSTALLS,
    "python3 -m venv .venv && .venv/bin/pip install '.[workflow]'": INSTALLS,
    "python3 -m venv .venv && .venv/bin/pip install '.[workflow]' && .venv/bin/imubench analyse "
    "run.csv --output run": INSTALLS,
    'python3 -m venv .venv && .venv/bin/pip install "$(echo imubench_pipeline-*.whl)[workflow]"': (
        OF_A_WHEEL
    ),
    '.venv/bin/pip install "$(echo imubench_pipeline-*.whl)[all]"': OF_A_WHEEL,
    '.venv/bin/pip install -c constraints-small.txt "$(echo imubench_pipeline-*.whl)[all]"': (
        OF_A_WHEEL
    ),
    ". .venv/bin/activate": "of a shell that is typed into: what it puts on the path is tested",
    ".venv/bin/ruff check . && .venv/bin/ruff format .": "of the whole project: .ci/run",
    ".venv/bin/snakefmt Snakefile workflow": "of the whole project: .ci/run",
    ".venv/bin/mypy": "of the whole project: .ci/run",
    ".venv/bin/python -m pytest -n 2": "these tests themselves: .ci/run",
    "cyclonedx-py environment --output-reproducible --of JSON -o sbom.json .venv": "an "
    "environment of its own, before a release",
    "pip-audit --disable-pip --require-hashes -r requirements/run.txt": "asks a service",
    "python3 -m venv .venv && .venv/bin/pip install -c constraints.txt -r requirements/build.in "
    "-e '.[cluster]'": INSTALLS,
    ".venv/bin/snakemake --workflow-profile profiles/slurm --config logs=/data/logs "
    "results=/data/results": "needs Slurm: tests/slurm",
    ".venv/bin/pip install -e '.[storage]'": INSTALLS,
    ".venv/bin/snakemake -c16 --workflow-profile profiles/s3 "
    "--default-storage-prefix s3://lab/imubench": "needs a bucket: tests/storage",
    ".venv/bin/imubench nightly -- --workflow-profile profiles/slurm": "needs Slurm: tests/slurm",
    "pip wheel --no-deps -w dist .": "asks an index for what builds it: "
    "tests/workflow/test_deployed.py builds it without",
    'eval "$(imubench completion bash)"': "of a shell that is typed into: tests/test_shipped.py",
    "imubench completion zsh > ~/.zfunc/_imubench": "of a shell that is typed into: "
    "tests/test_shipped.py",
    "snakemake -c2 --snakefile <checkout>/workflow/Snakefile": "tests/workflow/test_deployed.py",
    ".venv/bin/imubench compare before results --fail-on regression": "of two runs: "
    "tests/test_compare.py",
    '.venv/bin/imubench papers results --paper maia --place "Table 3"': "of the demonstration: "
    ".ci/run",
    "docker build -f container/Dockerfile -t imubench .": "needs Docker; nothing runs it here",
    "docker run --rm -v /srv/imubench:/data -v imubench:/opt/imubench/.snakemake imubench "
    "snakemake -c4 --config logs=/data/logs sensors=/data/sensors results=/data/results "
    "simulated=false": "needs Docker; nothing runs it here",
    "rclone sync lab:logs /scratch/logs": "needs a store; nothing runs it here",
    "rclone sync lab:imubench /scratch/imubench": "needs a store; nothing runs it here",
    "rclone sync /scratch/imubench lab:imubench": "needs a store; nothing runs it here",
    "rsync -a logger:/data/ /data/logs/mti_7/": "needs another machine; nothing runs it here",
    "systemctl daemon-reload && systemctl enable --now imubench.timer": "needs root and systemd; "
    "nothing runs it here",
    "systemctl start imubench.service; journalctl -u imubench.service": "needs root and systemd; "
    "nothing runs it here",
    ".venv-test/bin/python -m tests.release.mutants": "needs what `release` installs: "
    "tests/release/test_mutants.py",
    "snakemake -c2 --config simulated=my_simulated.yaml results=my_results": "10 h of two sensors: "
    "tests/test_simulated_recordings.py reads the page",
}
"""Commands that are not run here, as the pages have them, with the reason and what runs them."""

COSTLY = (
    ".venv/bin/imubench analyse run.csv",  # every day: tests/test_analyse.py
    ".venv/bin/imubench calibrate run.csv",  # every day: tests/library/test_exports.py
    ".venv/bin/imubench papers",  # every day: tests/report/test_papers.py
    ".venv/bin/imubench init lab",
    ".venv/bin/imubench run lab",
    "imubench init station/",
    "imubench run station/",
    "imubench nightly station/",
    ".venv/bin/imubench figures ",
    ".venv/bin/imubench nightly ",
    ".venv/bin/snakemake -c2 --config ",
    "snakemake -c16 ",
    "imubench simulate bno055 --hours 10 ",
    "imubench simulate mti_7 --hours 10 ",
    "#!/bin/sh",
    "for batch in ",
)
"""How those begin that take more than a few seconds, and are run before a release."""

OF_RESULTS = re.compile(r"\bresults\b(?!/)")
"""In what needs a finished run: before a release too. Every day such commands are asked of results
that are made by hand: tests/report/test_command.py, tests/test_show.py, tests/export and
tests/shortlist; `verify` of the demonstration, in .ci/run."""

ANALYSE = ".venv/bin/snakemake -c2"
"""What all others find done."""

FLAGGED = ("#!/bin/sh", ".venv/bin/imubench inspect bench.csv")
"""How those begin that end with 1: something is to be said, or left to fill in."""

STANDS_FOR = {"/srv/imubench": ".", "/data/": "data/", "/scratch/": "scratch/"}
"""Places of a reader, and those in the folder of the test."""


def commands_of(block: str) -> Iterator[str]:
    """The commands of a block, each in one line and without its comment; a script is one."""
    if block.startswith("#!") or re.search(r"^done$", block, re.MULTILINE):
        yield block.strip()
        return
    for line in re.sub(r" *\\\n *", " ", block).splitlines():
        if command := _COMMENT.sub("", line).strip():
            yield command


def listed() -> dict[str, str]:
    """Every command, and the page that has it first."""
    found: dict[str, str] = {}
    for page in PAGES:
        for language, block in _BLOCK.findall(page.read_text(encoding="utf-8")):
            if language == "sh":
                for command in commands_of(block):
                    found.setdefault(command, page.relative_to(PROJECT).as_posix())
    return found


TUTORIAL = "docs/tutorial/index.md"


def of_tutorial() -> list[str]:
    """The commands of the tutorial, of which each needs those before it."""
    blocks = _BLOCK.findall((PROJECT / TUTORIAL).read_text(encoding="utf-8"))
    return [one for language, block in blocks if language == "sh" for one in commands_of(block)]


def is_left(command: str) -> bool:
    """Whether a command is run before a release alone."""
    return command.startswith(COSTLY) or bool(OF_RESULTS.search(command))


COMMANDS = listed()
BENCHMARK = re.compile(r"(\w+=\w+ )?\.venv-test/bin/python (-m )?(benchmarks/\w+\.py|[\w.]+)( .*)?")
RUN = [
    pytest.param(command, marks=pytest.mark.release if is_left(command) else ())
    for command in COMMANDS
    if command not in {*ELSEWHERE, *of_tutorial(), ANALYSE} and not BENCHMARK.fullmatch(command)
]


def put_log(path: Path, names: list[str], separator: str, *, samples: int = 6000) -> None:
    rng = np.random.default_rng(1)
    gyro, accel = rng.normal(0.0, 8e-4, samples), rng.normal(9.81, 1e-2, samples)
    gyro *= 57.3 if "deg/s" in " ".join(names) else 1.0
    columns = [np.arange(samples) / 100.0, gyro, accel][-len(names) :]
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(
        path,
        np.column_stack(columns),
        "%.7f",
        delimiter=separator,
        header=separator.join(names),
        comments="",
    )


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout with one short log, and what the pages have beside it."""
    folder = tmp_path_factory.mktemp("lab")
    for name in ("Snakefile", "profiles", "workflow", "docs"):
        (folder / name).symlink_to(PROJECT / name)
    shutil.copytree(PROJECT / "config", folder / "config")
    (folder / ".venv").symlink_to(sys.prefix)
    config = folder / "config/config.yaml"
    settings = yaml.safe_load(config.read_text())
    settings["estimate"]["methods"] = ["likelihood"]
    settings["error_budget"]["draws"] = 20
    settings["simulated"] = False
    config.write_text(yaml.safe_dump(settings))
    sensor = folder / "config/sensors/mti_7.yaml"
    sensor.write_text(re.sub(r"    (gyro|accel)_[xy]: .*\n", "", sensor.read_text()))
    put_log(folder / "logs/mti_7/bench.txt", ["Gyr_Z", "Acc_Z"], "\t")
    shutil.copytree(folder / "logs", folder / "data/logs")
    shutil.copytree(folder / "logs", folder / "data/batches/batch_07")
    shutil.copytree(folder / "logs", folder / "scratch/logs")
    shutil.copytree(folder / "config/sensors", folder / "data/sensors")
    (folder / "results/nightly").mkdir(parents=True)
    units = ["t [s]", "gz [deg/s]", "az [m/s^2]"]
    for name in ("logs/mine/run.csv", "run.csv", "other.csv"):
        put_log(folder / name, units, ",", samples=2000)
    with zipfile.ZipFile(folder / "run.zip", "w") as archive:
        archive.write(folder / "logs/mine/run.csv", "run.csv")
    shutil.copy(folder / "logs/mti_7/bench.txt", folder / "run_7.csv")
    (folder / "bin").mkdir()
    (folder / "bin/mail").write_text("#!/bin/sh\ncat > mailed\n")  # a mailer that keeps it
    (folder / "bin/mail").chmod(0o755)
    (folder / "profile.csv").write_text("time [s],temperature [degC]\n0,20\n36000,30\n")
    for name, begin in {
        "my_model.yaml": "sensor: bno055",
        "turn.yaml": "temperature: {form",
    }.items():
        (folder / name).write_text(block_of("docs/how-to/simulator.md", begin))
    return folder


@pytest.fixture(scope="module")
def analysed(lab: Path) -> Path:
    """The same, analysed by the README's command."""
    run(ANALYSE, lab)
    return lab


def block_of(page: str, begin: str) -> str:
    """A block of a page by how it begins, as a reader copies it."""
    blocks = _BLOCK.findall((PROJECT / page).read_text(encoding="utf-8"))
    (found,) = (block for _, block in blocks if block.startswith(begin))
    return found


def run(command: str, folder: Path) -> None:
    """Run a command as the page has it; those of `imubench` here, where it is imported."""
    said = io.StringIO()
    for place, other in STANDS_FOR.items():
        command = command.replace(place, other if other == "." else f"{folder}/{other}")
    words = shlex.split(command, comments=False) if command.count("\n") == 0 else []
    of_shell = set(words) & {"&&", ";", "|", ">", "run"}  # `imubench run` becomes Snakemake
    if words[:1] in ([".venv/bin/imubench"], ["imubench"]) and not of_shell:
        out, err = contextlib.redirect_stdout(said), contextlib.redirect_stderr(said)
        with contextlib.chdir(folder), out, err:
            returned = main(words[1:])
    else:
        own = (str(Path(sys.executable).parent), str(folder / "bin"), os.environ["PATH"])
        done = subprocess.run(
            ["/bin/sh", "-c", command],
            cwd=folder,
            env=os.environ | {"PATH": os.pathsep.join(own)},
            capture_output=True,
            text=True,
            check=False,
            timeout=600,
        )
        returned = done.returncode
        said.write(done.stdout + done.stderr)
    assert returned == int(command.startswith(FLAGGED)), (
        f"{command}: exit status {returned}\n{said.getvalue()}"
    )


@pytest.mark.parametrize("command", RUN)
def test_it_runs(command: str, lab: Path, request: pytest.FixtureRequest) -> None:
    if is_left(command):
        request.getfixturevalue("analysed")
    run(command, lab)


OURS = [
    command
    for command in COMMANDS
    if re.match(r"(\.venv/bin/)?imubench ", command) and not re.search(r"&&|[;|>]", command)
]


@pytest.mark.parametrize("command", OURS)
def test_the_parser_knows_its_options(command: str) -> None:
    own = shlex.split(command)[1:]
    given = make_parser().parse_args(own[: own.index("--")] if "--" in own else own)
    assert given.command == own[0]


# Every day such a command is that of tests/workflow/test_failures.py.
@pytest.mark.release
def test_what_it_runs_on_was_analysed(analysed: Path) -> None:
    assert (analysed / "results/report/sensors/mti_7.html").is_file()


def test_what_is_not_run_is_still_there() -> None:
    assert ANALYSE in COMMANDS
    assert ELSEWHERE.keys() <= COMMANDS.keys()
    assert all(any(command.startswith(begin) for command in COMMANDS) for begin in COSTLY)


@pytest.mark.parametrize("reason", sorted(set(ELSEWHERE.values())))
def test_what_runs_it_instead_is_there(reason: str) -> None:
    where = reason.partition(": ")[2].split(" ")[0]
    assert not where or "/" not in where or (PROJECT / where).exists(), reason


@pytest.mark.release
def test_the_tutorial_from_first_to_last(analysed: Path) -> None:
    for command in of_tutorial():
        run(command, analysed)
    assert "accelerometer_noise_density" in (analysed / "safe.yaml").read_text()


def benchmarks() -> dict[str, str]:
    found = {}
    for command in COMMANDS:
        if (told := BENCHMARK.fullmatch(command)) and command not in ELSEWHERE:
            found[told[3]] = told[4] or ""
    return found


def test_every_benchmark_has_its_command() -> None:
    stated = {name for name in benchmarks() if name.startswith("benchmarks/")}
    helpers = {"bands", "resident", "silent_cases", "simulators", "workflow_steps"}
    there = {f"benchmarks/{path.name}" for path in (PROJECT / "benchmarks").glob("*.py")}
    assert stated == there - {f"benchmarks/{name}.py" for name in helpers}


@pytest.mark.release
@pytest.mark.parametrize(("name", "flags"), benchmarks().items())
def test_a_benchmark_takes_the_flags_of_its_command(name: str, flags: str) -> None:
    if name == "benchmarks/peers.py":
        flags = ""
    else:
        flags += " --help"
    what = name if name.endswith(".py") else f"-m {name}"
    done = subprocess.run(
        [sys.executable, *shlex.split(f"{what}{flags}")],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr


NO_PROGRAMS = {
    "docs/extending.md": "parts of modules that were not kept",
    "config/README.md": "a Snakefile: tests/workflow/test_deployed.py",
    "docs/how-to/calibration.md": "tests/calibration/test_documented.py",
    "docs/how-to/scaling.md": "reads the results of several batches",
    "docs/how-to/other_programs.md": "tests/test_other_programs.py",
}
"""Pages with Python that is not run here, and why."""


def programs() -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for page in PAGES:
        blocks = _BLOCK.findall(page.read_text(encoding="utf-8"))
        if parts := [block for language, block in blocks if language == "python"]:
            found[page.relative_to(PROJECT).as_posix()] = parts
    return found


LONG_PROGRAMS = (
    "docs/how-to/library.md",  # every day: the README has the same calls
    "docs/how-to/fusion.md",  # every day: tests/fusion
)

RUN_PROGRAMS = sorted(programs().keys() - NO_PROGRAMS.keys() - set(LONG_PROGRAMS))


@pytest.mark.parametrize("page", few(RUN_PROGRAMS, LONG_PROGRAMS))
def test_python_of_a_page_runs(page: str, lab: Path, rng: np.random.Generator) -> None:
    logs = rng.normal(0.0, 2e-3, (2, 20_000))
    names = {"rng": rng, "cheap_log": logs[0], "better_log": logs[1]}
    with contextlib.chdir(lab), contextlib.redirect_stdout(io.StringIO()):
        for part in programs()[page]:
            exec(compile(part, page, "exec"), names)


def sections(page: Path) -> set[str]:
    """The anchors of the headings of a page, and those that it names itself."""
    text = re.sub(r"^(```|~~~).*?^\1", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    headings = re.findall(r"^#+ +(.+?) *$", text, re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", re.sub(r"\]\([^)]*\)", "", each)) for each in headings)
    return {each.lower().replace(" ", "-") for each in plain} | set(
        re.findall(r"^\(([\w-]+)\)=$", text, re.MULTILINE)
    )


WITH_LINKS = sorted({
    *PROJECT.glob("*.md"),
    *PROJECT.glob("*/README.md"),
    *(path for path in (PROJECT / "docs").rglob("*.md") if "_build" not in path.parts),
})  # fmt: skip


@pytest.mark.parametrize("page", WITH_LINKS, ids=lambda page: page.relative_to(PROJECT).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\((?!\w+:)([^)#\s]*)(?:#([^)\s]+))?\)", page.read_text(encoding="utf-8"))
    assert links or page.parent != PROJECT or page.name == "CHANGELOG.md"  # which has none
    for path, section in links:
        there = page.parent / path if path else page
        assert there.exists(), path
        made = there.parent.name == "reference"  # the site makes most of its sections
        if section and there.suffix == ".md" and not made:
            assert section in sections(there), f"{path}#{section}"


def test_the_readme_is_short() -> None:
    assert len((PROJECT / "README.md").read_text(encoding="utf-8").splitlines()) < 120

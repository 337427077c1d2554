"""The same log in a checkout, by a wheel, and by a workflow that takes this one from a host."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path

import pytest
import yaml

from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.yaml_files import read_settings
from tests.conftest import PROJECT
from tests.workflow.dry_runs import dry_run
from tests.workflow.project import CHANNELS, FEW, put_log, put_sensor

pytestmark = pytest.mark.workflow

GIVEN = FEW
"""Settings that stand in no file: what a command passes on to Snakemake shows in the results."""

BUILT_OF = ("src", "Snakefile", "workflow", "config", "profiles", "pyproject.toml", "setup.py",
            "MANIFEST.in", "README.md", "LICENSE")  # fmt: skip

# Another workflow with a rule of a name that this one has, and another file of settings.
USING = """
module imu:
    snakefile: {snakefile}
    config: config["imu"]

use rule * from imu as imu_*

rule all:
    default_target: True
    input:
        {wanted},
        "own/lines.txt",

rule ingest:
    input: "results/tables/parameters.csv"
    output: "own/lines.txt"
    shell: "wc -l < {{input}} > {{output}}"

onstart: imu.onstart()
onsuccess: imu.onsuccess()
onerror: imu.onerror()
"""

# What snakedeploy 0.17.1 writes, but for the address.
SNAKEDEPLOY = """
from snakemake.utils import min_version
min_version("6.10.0")
configfile: "config/config.yaml"
module imubench_pipeline:
    snakefile:
        {snakefile}
    config:
        config
use rule * from imubench_pipeline
"""

GITHUB = 'github("someone/imubench_pipeline", path="workflow/Snakefile", tag="v1")'


def ended(command: list[str], place: Path, **environment: str) -> str:
    """What a command prints that ends well."""
    done = subprocess.run(
        command,
        cwd=place,
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def snakemake(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "snakemake", *arguments]


def with_logs(place: Path, logs: Path) -> Path:
    """A folder with the same logs and a sensor file of its own beside the catalogue."""
    shutil.copytree(logs, place / "logs", dirs_exist_ok=True)  # with their dates
    channels = {"rate": "10 Hz", "channels": CHANNELS}
    put_sensor(place / "config/sensors/mine.yaml", log=channels, datasheet={})
    return place


def left(results: Path) -> dict[str, bytes]:
    """All that says something of the logs, byte by byte."""
    folders = ("tables", "recordings", "sensors", "exports")
    return {
        path.relative_to(results).as_posix(): path.read_bytes()
        for folder in folders
        for path in sorted((results / folder).rglob("*"))
        if path.is_file() and path.name != "log.json"  # has the dates of the log's file
    }


def seals(results: Path) -> dict[str, dict]:
    """What each step was made of and with: the next run makes nothing again that has the same."""
    read = {path.stem: json.loads(path.read_text()) for path in results.glob("seals/**/*.json")}
    return {step: {key: seal[key] for key in ("form", "settings", "inputs")}
            for step, seal in read.items()}  # fmt: skip


@dataclass(frozen=True)
class Ways:
    """What is ready to analyse a log; ``checkout`` has done so."""

    checkout: Path
    commands: Path  # of the environment that has the wheel, and not the checkout
    package: Path  # in it
    hub: dict[str, str]  # the environment in which the git address is a repository of this disk
    folder: Path

    def imubench(self, *arguments: str | Path) -> list[str]:
        return [str(self.commands / "imubench"), *map(str, arguments)]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept")
    put_log(folder / "mine/run_1.csv", 1, samples=1_200)
    return folder


@pytest.fixture(scope="module")
def ways(logs: Path, tmp_path_factory: pytest.TempPathFactory) -> Ways:
    folder = tmp_path_factory.mktemp("deployed")
    checkout = with_logs(in_checkout(folder / "checkout"), logs)
    targets = [
        "tables",
        "files",
        "fusion",
        "papers",
        "ranking",
        "shortlist",
        "repeatability",
        "catalogue",
    ]
    targets.append("exports")
    ended(snakemake("-c1", *targets, "--config", *GIVEN), checkout)
    package = installed(built(folder), folder / "venv")
    return Ways(checkout, folder / "venv/bin", package, hosted(folder), folder)


def in_checkout(place: Path) -> Path:
    """A folder as a checkout is, without the demonstration."""
    without = shutil.ignore_patterns("simulated.yaml", "boards")
    shutil.copytree(PROJECT / "config", place / "config", ignore=without)
    for name in ("Snakefile", "workflow", "profiles"):
        (place / name).symlink_to(PROJECT / name)
    return place


def built(folder: Path) -> Path:
    """The wheel that is built of the source distribution."""
    source = folder / "source"
    source.mkdir()
    for name in BUILT_OF:
        if (PROJECT / name).is_dir():
            unneeded = shutil.ignore_patterns("__pycache__", "*.egg-info")
            shutil.copytree(PROJECT / name, source / name, ignore=unneeded)
        else:
            shutil.copy2(PROJECT / name, source / name)
    build = (
        "import sys; from setuptools import build_meta as b; getattr(b, sys.argv[1])(sys.argv[2])"
    )
    ended([sys.executable, "-c", build, "build_sdist", str(folder)], source)
    (packed,) = folder.glob("imubench_pipeline-*.tar.gz")
    with tarfile.open(packed) as archive:
        archive.extractall(folder, filter="data")
    unpacked = folder / packed.name.removesuffix(".tar.gz")
    ended([sys.executable, "-c", build, "build_wheel", str(folder)], unpacked)
    (wheel,) = folder.glob("*.whl")
    return wheel


def installed(wheel: Path, environment: Path) -> Path:
    """The package in an environment that has all packages of this one but the checkout."""
    ended([sys.executable, "-m", "venv", "--without-pip", str(environment)], environment.parent)
    python = environment / "bin/python"
    ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(ended([str(python), "-c", ask], environment).strip())
    (packages / "others.pth").write_text(sysconfig.get_path("purelib") + "\n")
    install = ["install", "--quiet", "--no-deps", "--no-index", "--no-compile", str(wheel)]
    ended([sys.executable, "-m", "pip", "--python", str(python), *install], environment)
    package = packages / "imubench_pipeline"
    # What numba has compiled of the same sources, for half a minute, it would compile again.
    for compiled in (PROJECT / "src/imubench_pipeline").rglob("*.nb[ic]"):
        name = compiled.relative_to(PROJECT / "src/imubench_pipeline")
        (package / name).parent.mkdir(exist_ok=True)
        shutil.copy2(compiled, package / name)
        source = name.parents[1] / f"{compiled.name.partition('.')[0]}.py"
        about = (PROJECT / "src/imubench_pipeline" / source).stat()
        os.utime(package / source, ns=(about.st_atime_ns, about.st_mtime_ns))
    return package


def hosted(folder: Path) -> dict[str, str]:
    """A bare repository of the workflow alone, and what has git find it at a host's address."""
    work, bare = folder / "work", folder / "hub/someone/imubench_pipeline"
    for name in ("workflow", "config", "profiles"):
        shutil.copytree(PROJECT / name, work / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(PROJECT / "Snakefile", work)
    who = ["-c", "user.name=nobody", "-c", "user.email=nobody@localhost"]
    for arguments in (["init", "-q"], ["add", "."], [*who, "commit", "-qm", "v1"], ["tag", "v1"],
                      ["clone", "-q", "--bare", ".", str(bare)]):  # fmt: skip
        ended(["git", *arguments], work)
    return {
        "GIT_CONFIG_COUNT": "1",
        "GIT_CONFIG_KEY_0": f"url.file://{folder}/hub/.insteadOf",
        "GIT_CONFIG_VALUE_0": "https://github.com/",
        "XDG_CACHE_HOME": str(folder / "cache"),
    }


def using(place: Path, logs: Path, snakefile: str, wanted: str) -> Path:
    """A folder with a workflow of its own that uses this one."""
    with_logs(place, logs)
    given = {key: json.loads(value) for key, value in (entry.split("=") for entry in GIVEN)}
    (place / "config/all.yaml").write_text(yaml.safe_dump({"imu": given, "other": 1}))
    (place / "Snakefile").write_text(USING.format(snakefile=snakefile, wanted=wanted))
    return place


@pytest.mark.release
def test_a_wheel_goes_on_where_a_checkout_has_ended(ways: Ways, logs: Path) -> None:
    lab = ways.folder / "on"
    ended(ways.imubench("init", lab), ways.folder)
    with_logs(lab, logs)
    for name in ("results", ".snakemake"):
        shutil.copytree(ways.checkout / name, lab / name)
    # Snakemake's own notion of the code is where a script lies; the parameters have its digest.
    flags = ["-n", "--rerun-triggers", "mtime", "params", "input", "--config", *GIVEN]
    said = ended(ways.imubench("run", lab, "-c2", "--", *flags), ways.folder)
    rules = set(re.findall(r"rule (\w+):", said))
    assert rules == {"figures", "report", "all"}, said  # what the checkout was not asked for


@pytest.mark.release
def test_a_wheel_analyses_a_folder_of_logs_as_a_checkout_does(ways: Ways, logs: Path) -> None:
    lab = ways.folder / "lab"
    ended(ways.imubench("init", lab), ways.folder)
    with_logs(lab, logs)
    said = ended(ways.imubench("run", lab, "-c2", "--", "--config", *GIVEN), ways.folder)
    assert "1 recording analysed, 0 rejected" in said and len(said.splitlines()) < 20, said
    assert (lab / "results/report/index.html").is_file()
    expected = left(ways.checkout / "results")  # of one core, and these of two
    assert {"tables/parameters.csv", "tables/shortlist.parquet"} < expected.keys()
    assert left(lab / "results") == expected
    made = seals(ways.checkout / "results")
    assert made.items() <= seals(lab / "results").items()


@pytest.mark.release
def test_a_wheel_holds_the_files_of_the_checkout(ways: Ways) -> None:
    shipped = ways.package / "project"
    kept = {path.relative_to(shipped): path.read_bytes()
            for path in shipped.rglob("*") if path.is_file()}  # fmt: skip
    folders = ("workflow", "config", "profiles")
    files = [PROJECT / "Snakefile", *(p for name in folders for p in (PROJECT / name).rglob("*"))]
    assert kept == {
        path.relative_to(PROJECT): path.read_bytes()
        for path in files
        if path.is_file() and "__pycache__" not in path.parts
    }
    (script,) = ways.package.glob("report/static/plotly.min.js")
    bundle = distribution("plotly").locate_file("plotly/package_data/plotly.min.js")
    assert script.read_bytes() == Path(str(bundle)).read_bytes()
    assert "MIT License" in script.with_name("plotly.LICENSE.txt").read_text()


@pytest.mark.release
def test_another_workflow_uses_the_rules_under_other_names_from_a_git_address(
    ways: Ways, logs: Path
) -> None:
    place = using(ways.folder / "using", logs, GITHUB, "rules.imu_ranking.output")
    said = ended(snakemake("-c2", "--configfile", "config/all.yaml"), place, **ways.hub)
    assert "imu_estimate" in said and "1 recording analysed" in said
    results, expected = left(place / "results"), left(ways.checkout / "results")
    assert {"tables/parameters.csv", "tables/ranking.csv"} < results.keys()
    assert results.items() <= expected.items()
    table = expected["tables/parameters.csv"].decode()
    assert (place / "own/lines.txt").read_text().strip() == str(len(table.splitlines()))
    assert seals(place / "results").items() <= seals(ways.checkout / "results").items()


@pytest.mark.release
def test_what_another_workflow_finds_damaged_is_made_again(ways: Ways, logs: Path) -> None:
    # Which jobs there are is known by the names of the rules, which are others here.
    snakefile = json.dumps(str(PROJECT / "workflow/Snakefile"))
    place = using(ways.folder / "again", logs, snakefile, "rules.imu_all.input")
    shutil.copytree(ways.checkout / "results", place / "results")
    shutil.copytree(ways.checkout / ".snakemake", place / ".snakemake")
    run = ["-c1", "--quiet", "host", "--configfile", "config/all.yaml"]
    first = dry_run(place, run)
    assert first.returncode == 0, first.stderr
    assert "imu_report" in first.stdout and "imu_ingest" not in first.stdout
    table = place / "results/recordings/mine/run_1/curve.parquet"
    table.write_bytes(table.read_bytes()[:-1])
    again = dry_run(place, run)
    assert "imu_allan" in again.stdout and "imu_ingest" not in again.stdout


@pytest.mark.release
def test_two_modules_with_results_of_their_own_do_not_mind_each_other(
    ways: Ways, logs: Path
) -> None:
    place = with_logs(ways.folder / "twice", logs)
    modules = (
        f'module {name}:\n    snakefile: "{PROJECT}/Snakefile"\n'
        f'    config: {{"results": "{name}"}}\nuse rule * from {name} as {name}_*\n'
        for name in ("a", "b")
    )
    asked = "rule all:\n    default_target: True\n    input: rules.a_all.input, rules.b_all.input\n"
    (place / "Snakefile").write_text("".join(modules) + asked)
    shutil.copytree(ways.checkout / "results", place / "b")
    done = dry_run(place, ["-c1", "--quiet", "host"])
    assert done.returncode == 0, done.stdout
    assert all(f"rule {name}_report" in done.stdout for name in ("a", "b"))
    assert "rule a_ingest" in done.stdout and "rule b_ingest" not in done.stdout


@pytest.mark.release
def test_a_prefix_of_paths_is_refused_with_what_does_that(logs: Path, tmp_path: Path) -> None:
    snakefile = json.dumps(str(PROJECT / "Snakefile")) + '\n    prefix: "elsewhere"'
    place = using(tmp_path, logs, snakefile, "rules.imu_all.input")
    done = dry_run(place, ["-c1", "--configfile", "config/all.yaml"])
    assert done.returncode == 1 and "expected the folder of the results" in done.stdout


@pytest.mark.parametrize("snakefile", ["Snakefile", "workflow/Snakefile"])
def test_any_folder_is_one_of_logs_for_a_snakefile_elsewhere(
    logs: Path, tmp_path: Path, snakefile: str
) -> None:
    place = with_logs(tmp_path, logs)
    done = dry_run(place, ["-c1", "--snakefile", str(PROJECT / snakefile)])
    assert done.returncode == 0, done.stderr
    assert "rule figures" in done.stdout and "rule simulate" not in done.stdout


@pytest.mark.release
def test_a_new_folder_says_what_it_holds_and_is_never_written_over(ways: Ways) -> None:
    lab = ways.folder / "new"
    ended(ways.imubench("init", lab, "--demonstration"), ways.folder)
    assert (lab / "config/config.yaml").read_bytes() == (
        PROJECT / "config/config.yaml"
    ).read_bytes()
    assert (lab / "config/boards/engers.yaml").is_file() and (lab / "logs").is_dir()
    assert read_settings(Sensor, lab / "config/example_sensor.yaml").log.channels
    again = subprocess.run(ways.imubench("init", lab), capture_output=True, text=True, check=False)
    assert again.returncode == 2 and "config/config.yaml exists already" in again.stderr
    none = subprocess.run(
        ways.imubench("run", ways.folder / "hub"), capture_output=True, text=True, check=False
    )
    assert none.returncode == 2 and "a folder of logs" in none.stderr


@pytest.mark.release
def test_a_night_in_a_folder_of_logs(ways: Ways, logs: Path) -> None:
    lab = ways.folder / "nights"
    ended(ways.imubench("init", lab), ways.folder)
    with_logs(lab, logs)
    said = ended(ways.imubench("nightly", lab, "--settle", "0", "-c2"), ways.folder)
    assert "1 new" in said
    said = ended(ways.imubench("nightly", lab, "--settle", "0", "-c2", "--", "-q"), ways.folder)
    assert "0 new, 0 analysed again" in said


@pytest.mark.release
def test_what_snakedeploy_writes_runs(ways: Ways, logs: Path) -> None:
    place = in_checkout(ways.folder / "snakedeploy")
    for name in ("Snakefile", "workflow"):
        (place / name).unlink()
    with_logs(place, logs)
    (place / "workflow").mkdir()
    (place / "workflow/Snakefile").write_text(SNAKEDEPLOY.format(snakefile=GITHUB))
    ended(snakemake("-c2", "--config", *GIVEN), place, **ways.hub)
    assert left(place / "results") == left(ways.checkout / "results")


@pytest.mark.release
@pytest.mark.parametrize("snakefile", ["Snakefile", "workflow/Snakefile"])
def test_a_snakefile_elsewhere_runs_in_any_folder(ways: Ways, snakefile: str, logs: Path) -> None:
    place = with_logs(ways.folder / f"any_{snakefile.replace('/', '_')}", logs)
    path = str(PROJECT / snakefile)
    ended(snakemake("-c2", "--snakefile", path, "--config", *GIVEN), place)
    assert left(place / "results") == left(ways.checkout / "results")

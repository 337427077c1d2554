"""Runs of Snakemake without steps, each in a fork of one process that has the imports."""

from __future__ import annotations

import atexit
import gc
import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import IO

from imubench_pipeline.tables.provenance import digest_sources
from tests.conftest import PROJECT


def dry_run(place: Path, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run ``snakemake -n`` in a folder, as a process of its own would."""
    return run_snakemake(place, ["-n", *arguments])


def run_snakemake(place: Path, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run Snakemake in a folder, as a process of its own would."""
    process = _server()
    assert process.stdin and process.stdout
    asked = {"place": str(place), "arguments": list(arguments)}
    process.stdin.write(json.dumps(asked) + "\n")
    process.stdin.flush()
    return subprocess.CompletedProcess(["snakemake"], **json.loads(process.stdout.readline()))


@cache
def _server() -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-m", __name__],
        cwd=PROJECT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    atexit.register(process.communicate)  # its input is closed, and it ends
    return process


IMPORTED = (
    "snakemake.cli", "snakemake.report.html_reporter", "smart_open",
    "imubench_pipeline.run.scripts", "imubench_pipeline.run.resources",
)  # fmt: skip
"""What each run needs: all but a third of its time."""


def _serve() -> None:
    cli, *_ = (importlib.import_module(name) for name in IMPORTED)
    for step in (PROJECT / "src/imubench_pipeline/steps").glob("[!_]*.py"):
        digest_sources(
            f"steps.{step.stem}"
        )  # what a module uses is found once, and not by each run
    gc.freeze()
    for line in sys.stdin:
        asked = json.loads(line)
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
            if (fork := os.fork()) == 0:
                _run(cli.main, asked["place"], asked["arguments"], out, err)
            _, status = os.waitpid(fork, 0)
            said = {"returncode": os.waitstatus_to_exitcode(status)}
            for name, file in (("stdout", out), ("stderr", err)):
                file.seek(0)
                said[name] = file.read()
        print(json.dumps(said), flush=True)


def _run(
    main: Callable[[], None], place: str, arguments: list[str], out: IO[str], err: IO[str]
) -> None:
    status = 1
    try:
        os.chdir(place)
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        sys.argv = ["snakemake", *arguments]
        main()
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


if __name__ == "__main__":
    _serve()

"""Kernels that several processes need at the same time."""

import subprocess
import sys
from pathlib import Path

import pytest

KERNEL = """
from numba import njit

@njit(cache=True)
def inner(x):
    return x + 1.0

@njit(cache=True)
def outer(x):
    return 2.0 * inner(x)
"""
PROGRAM = """
import sys
import kernel
from numba.core import event
from imubench_pipeline.run.step_server import compile_once

compiled = []

class Compiled(event.Listener):
    def on_start(self, ev):
        compiled.append(ev.data["dispatcher"].py_func.__name__)
    def on_end(self, ev):
        pass

event.register("numba:compile", Compiled())
compile_once(open(sys.argv[1], "a+b"))
print("ready", flush=True)
sys.stdin.readline()
assert kernel.outer(1.0) == 4.0
print(*(name for name in compiled if name in ("inner", "outer")))
"""


def started(folder: Path) -> "subprocess.Popen[str]":
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(folder / "locks")],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout and process.stdout.readline() == "ready\n"
    return process


@pytest.mark.release
def test_one_process_compiles_what_another_needs_at_the_same_time(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    processes = [started(tmp_path) for _ in range(2)]
    for process in processes:
        assert process.stdin
        process.stdin.write("now\n")
        process.stdin.flush()
    said = [process.communicate()[0].split() for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert sorted(said, key=len) == [[], ["outer", "inner"]]

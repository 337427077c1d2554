"""Scripts of the workflow, each run in a fork of a process that has their imports."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from imubench_pipeline.run.processes import Job, Processes, StepError


@pytest.fixture(scope="module")
def steps() -> Iterator[Processes]:
    """One process that forks for all of these tests: where it is killed, another begins."""
    made = Processes()
    yield made
    made.close()


def put(folder: Path, name: str, text: str) -> None:
    (folder / f"{name}.py").write_text(text)


def job(name: str, output: Path, **params: object) -> Job:
    script = output.with_name(f"{name}.py")
    return Job(script, ["in"], [str(output)], params, {"sensor": "s"}, output.with_suffix(".log"))


def run(steps: Processes, name: str, output: Path, **params: object) -> None:
    steps.run(job(name, output, **params))


SAY = """
import os
from pathlib import Path
here = snakemake
if __name__ == "__main__":
    said = (here.input, here.params["size"], here.wildcards["sensor"], os.getppid(), os.getpid())
    Path(here.output[0]).write_text(repr(said))
"""


def test_a_script_sees_what_it_is_given_in_a_process_of_its_own(
    steps: Processes, tmp_path: Path
) -> None:
    put(tmp_path, "say", SAY.replace("here = snakemake", "here = globals().get('snakemake')"))
    seen = []
    for size in (3, 10**6):
        run(steps, "say", tmp_path / "out", size="x" * size)
        source, text, sensor, parent, own = eval((tmp_path / "out").read_text())
        assert (source, len(text), sensor) == (["in"], size, "s")
        seen.append((parent, own))
    (first, one), (second, other) = seen
    assert first == second != os.getpid() and one != other


def test_imports_are_shared_and_what_a_step_leaves_is_not(steps: Processes, tmp_path: Path) -> None:
    put(
        tmp_path,
        "count",
        """
import sys, os
from pathlib import Path
with open(Path(__file__).with_name("imported"), "a") as file:
    file.write(f"{__name__} ")
if __name__ == "__main__":
    Path(snakemake.output[0]).write_text(str(hasattr(sys, "left_behind")))
    sys.left_behind = True
""",
    )
    for _ in range(3):
        run(steps, "count", tmp_path / "out")
        assert (tmp_path / "out").read_text() == "False"
    assert (tmp_path / "imported").read_text().split() == ["imports"] + ["__main__"] * 3


def test_a_script_that_fails_says_where(steps: Processes, tmp_path: Path) -> None:
    put(tmp_path, "bad", "def turn():\n    raise ValueError('upside down')\nturn()\n")
    with pytest.raises(StepError, match=r"^bad.py failed$") as caught:
        run(steps, "bad", tmp_path / "out")
    said = (tmp_path / "out.log").read_text()
    assert said == caught.value.trace
    assert said.startswith(f'Traceback (most recent call last):\n  File "{tmp_path / "bad.py"}"')
    assert said.endswith("ValueError: upside down\n") and "runpy" not in said
    put(tmp_path, "exits", "import sys\nsys.exit('no')")
    with pytest.raises(StepError, match=r"^exits.py failed$"):
        run(steps, "exits", tmp_path / "out")
    with pytest.raises(StepError, match=r"^missing.py failed$"):
        run(steps, "missing", tmp_path / "out")
    assert "No such file" in (tmp_path / "out.log").read_text()


def test_a_script_has_so_much_memory(steps: Processes, tmp_path: Path) -> None:
    text = "import numpy as np\nif __name__ == '__main__': np.ones({} * 10**6 // 8)\n"
    put(tmp_path, "modest", text.format(100))
    put(tmp_path, "greedy", text.format(300))
    limited = {
        name: replace(job(name, tmp_path / "out"), memory=200 * 10**6)
        for name in ("modest", "greedy")
    }
    steps.run(limited["modest"])
    with pytest.raises(StepError, match=r"^greedy.py failed$") as caught:
        steps.run(limited["greedy"])
    assert caught.value.cause == "error"
    assert "MemoryError: Unable to allocate 286. MiB" in caught.value.reason
    assert caught.value.reason.endswith("; limits.memory allows 200 MB")
    run(steps, "greedy", tmp_path / "out")


def test_a_script_that_is_killed_harms_no_other(steps: Processes, tmp_path: Path) -> None:
    put(tmp_path, "dies", "import os\nif __name__ == '__main__': os.kill(os.getpid(), 9)\n")
    put(tmp_path, "say", SAY.replace("here = snakemake", "here = globals().get('snakemake')"))
    with pytest.raises(StepError, match=r"^dies.py was killed$"):
        run(steps, "dies", tmp_path / "out")
    run(steps, "say", tmp_path / "out", size="x")


@pytest.mark.release
def test_a_request_that_dies_with_the_server_is_a_step_that_was_killed(
    steps: Processes, tmp_path: Path
) -> None:
    put(tmp_path, "say", SAY.replace("here = snakemake", "here = globals().get('snakemake')"))
    run(steps, "say", tmp_path / "out", size="x")
    parent = eval((tmp_path / "out").read_text())[3]
    os.kill(parent, signal.SIGSTOP)
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(run, steps, "say", tmp_path / "out", size="x" * 10**6)
        time.sleep(0.2)
        os.kill(parent, signal.SIGKILL)
        with pytest.raises(StepError, match=r"^say.py was killed$"):
            asked.result(timeout=10)
    # Another begins, for this step and those after it.
    run(steps, "say", tmp_path / "out", size="x")
    assert eval((tmp_path / "out").read_text())[3] != parent


# Every day such a server is killed with a request, above.
@pytest.mark.release
def test_a_server_that_was_killed_while_it_did_nothing_is_started_again(
    steps: Processes, tmp_path: Path
) -> None:
    put(tmp_path, "say", SAY.replace("here = snakemake", "here = globals().get('snakemake')"))
    run(steps, "say", tmp_path / "out", size="x")
    parent = eval((tmp_path / "out").read_text())[3]
    os.kill(parent, signal.SIGKILL)
    psutil.wait_procs([psutil.Process(parent)] if psutil.pid_exists(parent) else [], timeout=10)
    run(steps, "say", tmp_path / "out", size="x")
    assert eval((tmp_path / "out").read_text())[3] != parent


def test_threads_run_scripts_at_the_same_time(steps: Processes, tmp_path: Path) -> None:
    put(
        tmp_path,
        "meet",
        """
import time
from pathlib import Path
if __name__ == "__main__":
    Path(snakemake.output[0]).touch()
    while len(list(Path(snakemake.output[0]).parent.glob("here*"))) < 4:
        time.sleep(0.01)
""",
    )
    with ThreadPoolExecutor(4) as pool:
        outputs = [tmp_path / f"here{k}" for k in range(4)]
        list(pool.map(lambda output: run(steps, "meet", output), outputs, timeout=60))


WAIT = """
import os, time
from pathlib import Path
if __name__ == "__main__":
    Path(snakemake.output[0]).write_text(f"{os.getppid()} {os.getpid()} ")
    time.sleep(600)
"""

IMPORTS_LONG = """
import time
from pathlib import Path
if __name__ == "imports":
    Path(__file__).with_name("importing").touch()
    time.sleep(3)
else:
    Path(__file__).with_name("ran").touch()
"""

RUN_BOTH = """
import sys, threading
from pathlib import Path
from imubench_pipeline.run.processes import Job, Processes
folder = Path(sys.argv[1])
steps = Processes()
wait = Job(folder / "wait.py", [], [folder / "out"], [], [], folder / "log")
threading.Thread(target=steps.run, args=(wait,)).start()
while not (folder / "out").is_file():
    pass
steps.run(Job(folder / "imports_long.py", [], [], [], [], folder / "log"))
"""


def until_there(process: subprocess.Popen[bytes], path: Path, words: int = 0) -> list[str]:
    deadline = time.monotonic() + 60
    while not path.is_file() or len(path.read_text().split()) < words:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    return path.read_text().split()


@pytest.mark.release
@pytest.mark.skipif(sys.platform != "linux", reason="only on Linux, a fork learns of it")
def test_scripts_end_at_once_with_the_run_that_started_them(tmp_path: Path) -> None:
    put(tmp_path, "wait", WAIT)
    put(tmp_path, "imports_long", IMPORTS_LONG)
    process = subprocess.Popen([sys.executable, "-c", RUN_BOTH, str(tmp_path)])
    numbers = until_there(process, tmp_path / "out", 2)
    server, script = (psutil.Process(int(number)) for number in numbers)
    until_there(process, tmp_path / "importing")
    process.kill()
    process.wait()
    # A next run may have begun before the server has imported what the other script needs.
    script.wait(timeout=2)
    assert server.is_running()
    server.wait(timeout=30)
    time.sleep(0.5)
    assert not (tmp_path / "ran").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="only on Linux, the system ends a fork")
def test_a_script_that_runs_past_its_time_is_ended(steps: Processes, tmp_path: Path) -> None:
    put(tmp_path, "wait", WAIT)
    with pytest.raises(StepError, match=r"^wait.py ran for longer than 0.5 s$") as caught:
        steps.run(job("wait", tmp_path / "out"), seconds=0.5)
    assert caught.value.cause == "time"
    _, script = map(int, (tmp_path / "out").read_text().split())
    assert not psutil.pid_exists(script)


BLAMED = (
    ("raise ValueError('upside\\ndown')", "error", "ValueError: upside down"),
    (
        "import os; os.kill(os.getpid(), 9)",
        "killed",
        "SIGKILL, perhaps because memory was exhausted",
    ),
    ("import os; os.kill(os.getpid(), 11)", "killed", "SIGSEGV"),
    ("import os; os.kill(os.getpid(), 2)", None, "bad.py was killed"),
    ("raise OSError(28, 'No space left on device')", None, "OSError: [Errno 28]"),
)


def test_an_error_says_whether_what_it_was_run_for_is_to_blame(
    steps: Processes, tmp_path: Path
) -> None:
    for text, cause, reason in BLAMED:
        put(tmp_path, "bad", f"if __name__ == '__main__':\n    {text}\n")
        with pytest.raises(StepError) as caught:
            run(steps, "bad", tmp_path / "out")
        assert caught.value.cause == cause, text
        assert caught.value.reason.startswith(reason), text


def test_a_script_that_cannot_be_imported_is_nobodys_fault(
    steps: Processes, tmp_path: Path
) -> None:
    put(tmp_path, "bad", "import no_such_module\n")
    with pytest.raises(StepError) as caught:
        run(steps, "bad", tmp_path / "out")
    assert caught.value.cause is None


def test_what_a_script_prints_goes_to_its_log(
    steps: Processes, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    put(
        tmp_path,
        "talks",
        "import os\nif __name__ == '__main__':\n"
        "    print('in Python', flush=True)\n    os.system('echo beside it >&2')\n    1 / 0\n",
    )
    log = tmp_path / "new/talks.log"
    for _ in range(2):
        with pytest.raises(StepError) as caught:
            steps.run(replace(job("talks", tmp_path / "out"), log=log))
    assert capfd.readouterr() == ("", "")
    assert log.read_text() == 2 * f"in Python\nbeside it\n{caught.value.trace}"


# The last one here: after it another server would have to begin.
@pytest.mark.release
@pytest.mark.skipif(not Path("/proc/self/comm").is_file(), reason="names are set only on Linux")
def test_a_script_can_be_told_by_its_name_and_outlives_the_process_that_forked_it(
    steps: Processes, tmp_path: Path
) -> None:
    put(tmp_path, "wait", WAIT.replace("600", "1"))
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(run, steps, "wait", tmp_path / "out")
        while not (tmp_path / "out").is_file() or not (tmp_path / "out").read_text().endswith(" "):
            time.sleep(0.05)
        server, script = map(int, (tmp_path / "out").read_text().split())
        assert psutil.Process(script).name() == "wait"
        os.kill(server, signal.SIGKILL)
        running.result(timeout=10)

"""The progress of a run, in a terminal and in a pipe."""

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import few

pytestmark = pytest.mark.workflow

WORKFLOW = """
from imubench_pipeline.run.progress import OURS
rule all:
    input: expand("s/{recording}.done", recording=["a", "b", "bad"])
rule ingest:
    output: "{sensor}/{recording}.done"
    script: "ingest.py"
onstart:
    from imubench_pipeline.run.progress import follow
    of = (job.wildcards for job in workflow.dag.needrun_jobs() if job.name == "ingest")
    follow(((w.sensor, w.recording) for w in of), lambda s, r: f"{s}/{r}: of 3 channels")
onsuccess:
    logger.info("the summary", extra=OURS)
onerror:
    from pathlib import Path
    from imubench_pipeline.report.run_summary import failure
    logger.error("what failed")
    logger.error(failure(log, Path("s")), extra=OURS)
"""
SCRIPT = """
import os, time
from pathlib import Path
time.sleep(float(os.environ.get("PAUSE", "0")))
if snakemake.wildcards.recording == "bad" and "FAIL" in os.environ:
    raise ValueError("upside down\\nturn it over")
Path(snakemake.output[0]).touch()
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "Snakefile").write_text(WORKFLOW)
    (tmp_path / "ingest.py").write_text(SCRIPT)
    return tmp_path


def in_terminal(folder: Path, *flags: str, **variables: str) -> tuple[str, str]:
    """Return all that was written to a terminal, and what of it stays to be seen."""
    outer, inner = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "snakemake", "-c1", "--logger", "imubench", "--keep-going", *flags],
        cwd=folder, stdin=inner, stdout=inner, stderr=inner,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "100", "PAUSE": "0.6", **variables},
    )  # fmt: skip
    os.close(inner)
    written = b""
    while True:
        try:
            part = os.read(outer, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        written += part
    os.close(outer)
    process.wait(timeout=60)
    text = written.decode()
    return text, seen(text)


def seen(text: str) -> str:
    """What stays on a terminal: a line can be erased, and the cursor go up to the one before."""
    lines = [""]
    for part in re.split(r"(\n|\x1b\[2K|\x1b\[1A)", text):
        if part == "\n":
            lines.append("")
        elif part == "\x1b[2K":
            lines[-1] = ""
        elif part == "\x1b[1A":
            lines.pop()
        else:
            lines[-1] += re.sub(r"\x1b\[[?\d;]*[a-zA-Z]|\r", "", part)
    assert "\x1b[2A" not in text
    return "\n".join(lines)


# Every day: the line of a run in which a step fails, below, and the same said in a pipe by a run
# of tests/workflow/test_failures.py.
@pytest.mark.release
def test_a_terminal_has_one_line_that_moves(folder: Path) -> None:
    written, left = in_terminal(folder)
    assert re.search(r"first steps: ingest s/(a|b|bad) 0:00", written)
    assert re.search(r"1 of 4 steps, about \d+ s left: ingest s/(a|b|bad) 0:00", written)
    assert "steps, about" not in left and "rule ingest:" not in left
    assert "Job stats" not in left
    lines = [line.strip() for line in left.splitlines() if line.strip()]
    assert sorted(lines[:3]) == [f"s/{name}: of 3 channels" for name in ("a", "b", "bad")]
    assert lines[3] == "the summary" and lines[4].startswith("Complete log")
    (log,) = (folder / ".snakemake/log").iterdir()
    assert log.read_text().count("rule ingest:") == 3


@pytest.mark.release
def test_what_a_failing_step_says_is_not_drawn_over(folder: Path) -> None:
    written, left = in_terminal(folder, FAIL="1", PAUSE="0.4")
    assert re.search(r"first steps: ingest s/(a|b|bad) 0:00", written)
    assert re.search(r"[12] of 4 steps, about \d+ s left: ingest s/(a|b|bad) 0:00", written)
    # The line is erased each time, but for where a step writes to the terminal itself.
    assert left.count("steps, about") <= 1 and not re.search(r"(?<!in )rule ingest:", left)
    assert "Job stats" not in left
    assert left.count("s/a: of 3 channels") == left.count("s/b: of 3 channels") == 1
    assert "Traceback (most recent call last):\n" in left
    assert "ValueError: upside down\nturn it over\n" in left
    assert "Error in rule ingest:" in left and "output: s/bad.done" in left
    assert left.index("turn it over") < left.index("failed parts")
    # What a run says of its failures, by the log that it wrote.
    said = [line.strip() for line in left.partition("failed parts")[2].splitlines() if line.strip()]
    assert said[:2] == ["1 step failed; see above", "ingest"]
    assert said[2].endswith("run the same command again: it continues where this run stopped")


@pytest.mark.parametrize("flags", few([], [(("--quiet",),), (("--verbose",),)]))
def test_verbose_and_quiet_flags_replace_the_progress_lines(
    folder: Path, flags: tuple[str, ...]
) -> None:
    written, left = in_terminal(folder, *flags)
    assert "of 4 steps, about" not in written and "first steps" not in written
    assert ("rule ingest:" in left) == (flags == ("--verbose",))


@pytest.mark.release  # every day: what a run says in tests/workflow/test_failures.py
def test_a_pipe_gets_a_line_for_each_recording(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "-c1", "--logger", "imubench"], cwd=folder,
        capture_output=True, text=True, check=True, timeout=60,
        env={**os.environ, "FORCE_COLOR": "1"},
    )  # fmt: skip
    lines = done.stderr.splitlines()
    assert sorted(lines[:3]) == [f"s/{name}: of 3 channels" for name in ("a", "b", "bad")]
    assert lines[3] == "the summary"
    assert lines[4].startswith("Complete log") and len(lines) == 5

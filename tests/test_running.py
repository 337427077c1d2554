"""What a nightly run finds in the log of its Snakemake."""

from pathlib import Path

from imubench_pipeline.extensions.nightly.night import find_errors


def test_what_failed_in_a_step_is_found_in_what_the_run_said(tmp_path: Path) -> None:
    trace = 'Traceback (most recent call last):\n  File "a.py", line 1\n    b()\n    ^^^\n'
    said = f"{trace}OSError: [Errno 28] No space left on device\nRuleException:\n"
    (tmp_path / "log").write_text(f"Job stats:\n{said}\n{said}\n{trace}ValueError: no\nthe end\n")
    assert find_errors(tmp_path / "log") == [
        "OSError: [Errno 28] No space left on device",
        "ValueError: no",
    ]
    assert find_errors(tmp_path / "none") == []

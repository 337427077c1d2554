"""A process that forks for each log that it is told, and says what became of it and what it took.

It lists a log as the command does, and opens and reads it within the bounds of the workflow.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.bounded import BoundError, limit_memory, run_bounded
from imubench_pipeline.readers.formats import FILE_FORMATS
from imubench_pipeline.readers.inspection import inspect
from imubench_pipeline.recordings.availability import check_opening
from imubench_pipeline.run.analysis.project import INSPECTED_BYTES, INSPECTED_S
from imubench_pipeline.settings.config import LimitSettings
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import LogFormat

LONGEST_S = 60


def outcome(path: Path, given: dict[str, Any] | None) -> str:
    """Return the reason of a rejection; else how much there is."""
    try:
        if given is None:
            found = run_bounded(INSPECTED_S, INSPECTED_BYTES, inspect, path)
            return f"listed: {found.proof.said}"
        log = LogFormat.model_validate(given)
        check_opening(path, log, QualitySettings().opening)
        limit_memory(LimitSettings().memory * 10**6)
        files = read(path, log)
        rows = sum(len(batch) for file in files for batch in file.batches())
    except (RecordingError, BoundError) as error:
        return f"rejected: {error}"
    return f"read: {rows}"


def main() -> None:
    """Answer requests, a line of JSON each: a path, and the log format to read it by."""
    for known in FILE_FORMATS.values():
        known.code()
    for line in sys.stdin:
        path, given = json.loads(line)
        ours, theirs = os.pipe()
        fork = os.fork()
        if fork == 0:
            signal.alarm(LONGEST_S)
            os.write(theirs, outcome(Path(path), given).encode()[:60_000])
            os._exit(0)
        os.close(theirs)
        # Of this process and of those that it has waited for.
        _, status, used = os.wait4(fork, 0)
        with os.fdopen(ours, "rb") as stream:
            said = stream.read().decode() or f"ended by {os.waitstatus_to_exitcode(status)}"
        seconds = used.ru_utime + used.ru_stime
        print(json.dumps([said, seconds, used.ru_maxrss / 1024]), flush=True)


if __name__ == "__main__":
    main()

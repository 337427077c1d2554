"""Read mutated logs: ``python -m tests.fuzz --reader all --minutes 10``."""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from pathlib import Path

from tests.fuzz.held import Input
from tests.fuzz.inputs import READERS
from tests.fuzz.supervision import Fuzzing, Result, table
from tests.fuzz.target import outcome
from tests.fuzz.worker import Memory, limit_memory


def main(arguments: list[str]) -> int:
    """Fuzz readers, or read one input again; return 1 if a reader failed.

    Parameters
    ----------
    arguments : list of str
        Of the command line.
    """
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz",
        description="Read mutated logs until a reader crashes, hangs, takes more than 1 GiB, or "
        "raises anything but a RecordingError. Exit status: 1 if one did.",
    )
    parser.add_argument("--reader", choices=[*READERS, "all"], default="all")
    parser.add_argument("--minutes", type=float, default=10.0, help="of each reader; default: 10")
    parser.add_argument("--seed", type=int, default=0, help="of the mutations; default: 0")
    parser.add_argument("--processes", type=int, default=1, help="of each reader; default: 1")
    parser.add_argument(
        "--failures",
        type=Path,
        default=Path(tempfile.gettempdir()) / "imubench-fuzz",
        help="folder for inputs that fail; default: %(default)s",
    )
    parser.add_argument("--again", type=Path, help="read the input of this folder once, and end")
    given = parser.parse_args(arguments)
    if given.again:
        return _again(given.again)
    results = []
    for reader in READERS if given.reader == "all" else (given.reader,):
        fuzzing = Fuzzing(reader, 60.0 * given.minutes, given.failures, given.processes, given.seed)
        results.append(fuzzing.run(lambda line: print(line, flush=True)))
        _tell(results[-1])
    print(table(results), flush=True)
    return int(any(found.failures for found in results))


def _again(folder: Path) -> int:
    held = Input.kept(folder)
    warnings.simplefilter("error")
    limit_memory()
    with Memory():
        print(outcome(held.path_in(folder), held.format()))
    return 0


def _tell(found: Result) -> None:
    for kind, count in found.failures.most_common():
        print(f"{found.reader}: {count} times {kind}")
    for folder in found.folders:
        print(f"  python -m tests.fuzz --again {folder}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

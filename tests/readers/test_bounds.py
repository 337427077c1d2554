"""A file that asks for much is rejected alone, within the time and memory that are stated."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import few
from tests.readers.hostile import ATTACKS

LIMIT_S, LIMIT_MB = 10.0, 600.0
LONGEST_REASON = 1500

JUST_WITHIN = (
    "chunks of 128 MiB",
    "a chunk of 128 MiB",
    "an MCAP chunk of 128 MiB",
    "a directory just small enough",
)
"""As large as may be, and read: each takes a second or more. Every day what is beyond these bounds
is refused."""

DEAR = (
    "a header of 800 MB",
    "chunks of 130 MiB",
    "a chunk that unpacks to 4 GiB",
    "three chunks of 100 MB",
    "100000 members and no directory",
    "a packed file of 5 GiB",
    *("20 GB of zeros", "6 GB of comments"),  # test_bombs_are_stopped of test_compressed.py
    *("empty zstd frames", "empty xz streams", "empty bzip2 streams"),  # empty gzip members
    "8000 brackets",  # 8000 signs
    "10001 connections",  # 10001 channels
    "11000 cells",  # a MATLAB file of many sides; that an array is of cells: test_matlab.py
    *("20000 links", "5000 groups deep"),  # a cycle of groups
    "one unit of 10 MB for 300",  # names that clear a terminal
    *("a chunk of more", "an MCAP chunk that is longer than it says"),  # that of ROS 1
    "1100 topics of 1000 fields",  # fields of fields without end
    "a topic of 10 MB",  # a connection whose number has 1 MB
)
"""Each takes a second or more to write or to refuse, or is refused for what another one is. Every
day `test_npy.py`, `test_hdf5.py`, `test_rosbag.py` and `test_compressed.py` have such files that
are small, beyond bounds that are low; and damaged chunks."""

LEFT = (*JUST_WITHIN, *DEAR)

Probe = Callable[[Path, "dict[str, Any] | None"], tuple[str, float, float]]


@pytest.fixture(scope="module")
def probe() -> Iterator[Probe]:
    """Return what lists a log, or reads it by a format: what was said, s of CPU, MiB."""
    with subprocess.Popen(
        [sys.executable, "-W", "error", "-m", "tests.readers.probe"],
        cwd=Path(__file__).parents[2],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:

        def ask(path: Path, given: dict[str, Any] | None) -> tuple[str, float, float]:
            assert process.stdin is not None and process.stdout is not None
            process.stdin.write(json.dumps([str(path), given]) + "\n")
            process.stdin.flush()
            said, seconds, memory = json.loads(process.stdout.readline())
            return said, seconds, memory

        yield ask


@pytest.mark.parametrize("name", few([x for x in ATTACKS if x not in LEFT], LEFT))
def test_it_costs_little_and_ends_in_its_reason(tmp_path: Path, probe: Probe, name: str) -> None:
    attack = ATTACKS[name]
    path = attack.write(tmp_path)
    channels = {key: {"unit": "rad/s"} | source for key, source in attack.channels.items()}
    expected = (
        (None, attack.read if attack.listed is None else attack.listed),
        ({"rate": "100 Hz", "channels": channels}, attack.read),
    )
    for given, pattern in expected:
        said, seconds, memory = probe(path, given)
        assert re.search(pattern, said), said
        assert len(said) < LONGEST_REASON and said.isprintable()
        assert memory < (LIMIT_MB if given is None else attack.most_mb), said
        assert seconds < LIMIT_S, said

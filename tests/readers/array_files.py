"""What the tests of the readers of array formats share."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from imubench_pipeline.readers import LogFile, RecordingError, read
from imubench_pipeline.settings.sensor import LogFormat

FIRST = np.datetime64("2024-05-01T10:00:00.000000001", "ns")
STEP = 10_000_000
Damage = Callable[[bytes], bytes]


def log_format(channels: dict[str, Any], **keys: Any) -> LogFormat:
    """Channels in rad/s; a rate unless there is a time."""
    given: dict[str, Any] = {"rate": None if "time" in keys else "100 Hz"} | keys
    full = {name: {"unit": "rad/s"} | source for name, source in channels.items()}
    return LogFormat.model_validate({"channels": full} | given)


def contents(path: Path, log: LogFormat) -> tuple[dict[str, np.ndarray], Any, LogFile]:
    (file,) = read(path, log)
    batches = list(file.batches())
    joined = {name: np.concatenate([b.columns[name] for b in batches]) for name in file.sources}
    times = [b.time for b in batches if b.time is not None]
    return joined, np.concatenate(times) if times else None, file


def refused(path: Path, log: LogFormat, message: str) -> None:
    """The file is refused with a message that begins with its name."""
    with pytest.raises(RecordingError, match=message) as raised:
        contents(path, log)
    assert str(raised.value).startswith(f"{path.name}: ")


def survives(path: Path, data: bytes, log: LogFormat) -> bool:
    """Whatever the bytes, the file is read or refused; tell whether it is read."""
    path.write_bytes(data)
    try:
        contents(path, log)
    except RecordingError as error:
        assert str(error).startswith(f"{path.name}: ")
        return False
    return True


def cut_everywhere(path: Path, log: LogFormat, places: int = 80) -> int:
    """Return at how many places the file can be cut and is still read as if it were whole."""
    whole = path.read_bytes()
    assert survives(path, whole, log)
    cuts = np.unique(np.linspace(0, len(whole) - 1, places, dtype=int))
    return sum(survives(path.with_name("cut"), whole[:cut], log) for cut in cuts)


def _damage(edits: list[tuple[float, int, bytes]]) -> Damage:
    def damage(whole: bytes) -> bytes:
        data = bytearray(whole)
        for place, removed, put in edits:
            at = int(place * len(data))
            data[at : at + removed] = put
        return bytes(data)

    return damage


_PLACES = st.floats(0, 1, exclude_max=True)
_TAGS = st.sampled_from([b"\xff" * 8, b"\0" * 8, b"\xff\xff\xff\x7f", b"\0\0\0\0\1\0\0\0"])
damages: st.SearchStrategy[Damage] = st.lists(
    st.one_of(
        st.tuples(_PLACES, st.just(1), st.binary(min_size=1, max_size=1)),
        st.tuples(_PLACES.map(lambda place: place / 10), st.just(1), st.binary(max_size=2)),
        st.tuples(_PLACES, st.just(8), _TAGS),
        st.tuples(_PLACES, st.integers(0, 20), st.binary(max_size=20)),
    ),
    min_size=1,
    max_size=4,
).map(_damage)

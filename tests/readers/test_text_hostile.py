"""Files that are no logs, or damaged ones: a reason or findings, in bounded time and memory."""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.readers import RecordingError, read
from tests.readers.damage import examples
from tests.readers.text_logs import PLACED, TWO, columns, log_format, written

HEAD = b"wx,ax\n" + b"1.5,2\n" * 1000
MIB = 1 << 20

FILES: dict[str, Callable[[], bytes]] = {
    "nothing": lambda: b"",
    "one byte": lambda: b"1",
    "header alone": lambda: b"wx,ax\n",
    "one row": lambda: b"wx,ax\n1,2\n",
    "line breaks": lambda: b"\r\n" * (MIB // 2),
    "spaces": lambda: b" \n" * (MIB // 2),
    "delimiters": lambda: HEAD + b"," * 8 * MIB,
    "lines of delimiters": lambda: HEAD + b",\n" * MIB,
    "a cell of 50 MB": lambda: HEAD + b"1" * 50 * MIB + b",2\n1,2\n",
    "a cell of 50 MB at first": lambda: b"1" * 50 * MIB + b",2\n1,2\n",
    "a number of 500 kB": lambda: HEAD + b"1." + b"1" * 500_000 + b",2\n1,2\n",
    "lines of 10 MB": lambda: b"wx,ax\n" + (b"1," * 5 * MIB + b"2\n") * 2,
    "a million columns": lambda: b",".join([b"wx"] * MIB) + b"\n" + b"1," * MIB + b"2\n",
    "100000 columns": lambda: (b"," * 100_000 + b"\n") + (b"1," * 100_000 + b"2\n") * 3,
    "20000 columns": lambda: (
        b"wx,ax" + b",n" * 20_000 + b"\n" + (b"1,2" + b",3" * 20_000 + b"\n") * 3
    ),
    "32769 columns": lambda: (
        b"wx,ax" + b",n" * 32_767 + b"\n" + (b"1,2" + b",3" * 32_767 + b"\n") * 3
    ),
    "names twice": lambda: b"wx,wx,ax,ax\n1,2,3,4\n",
    "bytes of chance": lambda: np.random.default_rng(1).bytes(2 * MIB),
    "bytes of chance later": lambda: HEAD + np.random.default_rng(2).bytes(8 * MIB),
    "zeros": lambda: bytes(50 * MIB),
    "zeros at the end": lambda: HEAD + bytes(8 * MIB),
    "zeros after a cut record": lambda: HEAD + b"1,2" + bytes(8 * MIB),
    "zeros between": lambda: HEAD + bytes(8 * MIB) + HEAD,
    "zero in a cell": lambda: HEAD + b"1\0,2\n" + HEAD,
    "only comments": lambda: b"# a comment\n" * 20_000,
    "comments and a record": lambda: b"# a comment\n" * 20_000 + HEAD,
    "headers": lambda: b"wx,ax\n" * (MIB // 4),
    "short records": lambda: HEAD + b"1\n" * 4 * MIB,
    "quotes": lambda: HEAD + b'"' * 8 * MIB,
    "an open quote": lambda: b'"wx","ax"\n"1","2"\n"3' + b",4\n" * 2 * MIB,
    "half of UTF-16": lambda: "wx,ax\n1,2\n".encode("utf-16") * 1000 + b"\xd8" * MIB,
    "ones": lambda: b"\xff" * 8 * MIB,
    "JSON": lambda: json.dumps([{"wx": n, "ax": 1} for n in range(50_000)]).encode(),
    "HTML": lambda: b"<html><body>404 Not Found</body></html>\n" * 1000,
}
READ = {
    *("one row", "20000 columns", "lines of delimiters", "a number of 500 kB"),
    *("zeros at the end", "zeros after a cut record", "zeros between", "comments and a record"),
    "zero in a cell",
}
PACKED = sorted(FILES)[::8]
"""They are read packed, too, and packed and cut: what unpacks knows nothing of what it hands on."""

LIKE = {
    *("20000 columns", "100000 columns"),  # 32769 columns
    "comments and a record",  # only comments
    *("spaces", "lines of delimiters"),  # line breaks
    "a cell of 50 MB",  # the same at first
    "bytes of chance later",  # bytes of chance
    *("zeros at the end", "zeros after a cut record"),  # zeros between
}
"""Texts that take long, and beside them one that is read every day and much like them."""

LIMIT_MB, LIMIT_S = 500, 12


def main(folder: str) -> None:
    """Read every file of a folder; print what came of it as JSON."""
    results: dict[str, Any] = {}
    for number, path in enumerate(sorted(Path(folder).iterdir())):
        # By position every second one: it is the header alone that is another matter.
        for channels in (TWO,) if "packed" in path.name or number % 2 else (TWO, PLACED):
            begin = time.process_time()
            try:
                (file,) = read(path, log_format(channels, reader="csv"))
                rows = sum(len(batch) for batch in file.batches())
                outcome = [rows, [finding.finding for finding in file.findings]]
            except RecordingError as error:
                outcome = [str(error)]
            results.setdefault(path.name, []).append([outcome, time.process_time() - begin])
    # Not ru_maxrss, which begins with the size of the process that started this one.
    status = Path("/proc/self/status").read_text()
    peak = int(status.partition("VmHWM:")[2].split()[0]) / 1024
    print(json.dumps({"peak": peak, "results": results}))


@pytest.mark.release
def test_hostile_files_cost_little_and_end_in_a_reason(tmp_path: Path) -> None:
    also_packed = FILES.keys() & PACKED
    for name in FILES:
        text = FILES[name]()
        written(tmp_path, text, name)
        if name not in also_packed:
            continue
        packed = gzip.compress(text, 1)
        written(tmp_path, packed, f"{name}, packed")
        written(tmp_path, packed[: len(packed) * 2 // 3], f"{name}, packed and cut")
    # Another process, for its memory is to be that of the reader alone.
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "tests.readers.test_text_hostile", str(tmp_path)],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stderr == ""
    said = json.loads(done.stdout)
    assert said["peak"] < LIMIT_MB
    results = said["results"]
    assert len(results) == len(FILES) + 2 * len(also_packed)
    for name, outcomes in results.items():
        for outcome, seconds in outcomes:
            assert seconds < LIMIT_S, name
            assert len(outcome) == 2 or outcome[0].startswith(name), (name, outcome)
            assert len(str(outcome[0])) < 1500, name
    for name in FILES:
        whole = results[name][0][0]
        assert (len(whole) == 2) == (name in READ), (name, whole)
        if name in also_packed:
            packed = results[f"{name}, packed"][0][0]
            assert [str(said).replace(", packed", "", 1) for said in packed] == list(
                map(str, whole)
            )


TEXT = st.lists(
    st.one_of(
        st.sampled_from(
            [
                "wx",
                "ax",
                ",",
                ";",
                "\t",
                " ",
                "|",
                "\n",
                "\r\n",
                "\r",
                '"',
                "#",
                "//",
                "%",
                "\0",
                "1",
                "-2.5",
                "1,5",
                "nan",
                "-",
                "é",
                "1e9",
                "2021-09-20T09:00:00",
                "wx,ax\n1,2\n",
                "\ufeff",
                "1;2\n",
                "3 4\n",
                "x" * 300,
                "// Update Rate: 100 Hz\n",
                "inf",
            ]
        ),
        st.text(max_size=5),
    ),
    max_size=40,
).map("".join)


@examples(60)
@given(
    TEXT,
    st.sampled_from(["utf-8", "utf-16", "latin-1"]),
    st.sampled_from([TWO, PLACED]),
    st.sampled_from(
        [
            {},
            {"time": {"column": 1, "unit": "s"}},
            {"time": {"column": 3, "unit": "ns"}},
            {"time": {"column": 3, "unit": "samples", "wraps": 16}, "rate": "1 Hz"},
            {"time": {"column": 3, "format": "iso8601"}},
            {"time": {"date": 3, "column": 4, "format": "%H:%M %d.%m.%Y"}},
            {"header": True},
            {"header": False},
            {"delimiter": " "},
            {"delimiter": ";", "decimal": ","},
            {"comment": "w"},
            {"skip_lines": 1},
        ]
    ),
)
def test_nothing_but_a_recording_error_comes_of_any_text(
    tmp_path: Path, text: str, encoding: str, channels: dict[str, Any], keys: dict[str, Any]
) -> None:
    path = written(tmp_path, text.encode(encoding, "replace"))
    with suppress(RecordingError):
        columns(path, log_format(channels, reader="csv", **keys))


@examples(60)
@given(st.binary(max_size=300), st.sampled_from([TWO, PLACED]))
def test_nothing_but_a_recording_error_comes_of_any_bytes(
    tmp_path: Path, content: bytes, channels: dict[str, Any]
) -> None:
    for begin in (b"", b"wx,ax\n1,2\n", b"\xff\xfe", b"\x1f\x8b", b"\x28\xb5\x2f\xfd", b"PK\3\4"):
        path = written(tmp_path, begin + content)
        with suppress(RecordingError):
            columns(path, log_format(channels, reader="csv"))


def test_a_sparse_file_is_passed_over_quickly(tmp_path: Path) -> None:
    path = written(tmp_path, HEAD)
    with path.open("r+b") as file:
        file.truncate(1 << 27)
    begin = time.process_time()
    found, _, _ = columns(path, log_format())
    assert len(found["gyro_x"]) == 1000
    assert time.process_time() - begin < LIMIT_S


if __name__ == "__main__":
    main(sys.argv[1])

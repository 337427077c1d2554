"""Text logs: how they are laid out, and what else stands in them than records."""

from __future__ import annotations

import codecs
import gzip
from itertools import cycle

import numpy as np

from tests.corpus.entry import Entry, Rejected, file, kept
from tests.corpus.signals import PLACED, ROWS, STAMPED, TWO, UNSTAMPED, log, rest, text

MIB = 1 << 20
WHOLE = log()
LINES = WHOLE.splitlines(keepends=True)
MIDDLE = ROWS // 2
BARE = text({name: rest()[name] for name in ("wx", "az")}, header=False)
ALONE = {"rate": "100 Hz", "channels": {"gyro_x": {"column": 1, "unit": "rad/s"}}}
WITH_COMMAS = "".join(f"{x:.7f}\n" for x in rest()["wx"]).replace(".", ",")
HTML = "<!DOCTYPE html>\n<html><head><title>404</title></head>\n<body>Not Found</body></html>\n"


def instead(line: str, at: int = MIDDLE) -> str:
    """Return the log with another line in the place of one."""
    return "".join([*LINES[:at], line, *LINES[at + 1 :]])


def between(*lines: str, at: int = MIDDLE) -> str:
    """Return the log with lines between its own."""
    return "".join([*LINES[:at], *lines, *LINES[at:]])


def cell(value: str) -> str:
    """Return the log with another figure in one cell of the gyro."""
    stamp, _, az = LINES[MIDDLE].split(",")
    return instead(f"{stamp},{value},{az}")


def mixed_ends() -> bytes:
    ends = cycle((b"\n", b"\r\n", b"\n", b"\r\r\n"))
    return b"".join(line.strip().encode() + next(ends) for line in LINES)


LAYOUTS = [
    Entry("csv", file(WHOLE), STAMPED, kept(ROWS)),
    Entry("csv by position", file(BARE), PLACED, kept(ROWS)),
    Entry("csv with semicolons", file(WHOLE.replace(",", ";")), STAMPED, kept(ROWS)),
    Entry("csv with tabs", file(WHOLE.replace(",", "\t"), "log.tsv"), STAMPED, kept(ROWS)),
    Entry("csv with spaces", file(WHOLE.replace(",", "   "), "log.txt"), STAMPED, kept(ROWS)),
    Entry(
        "csv with a decimal comma",
        file(WHOLE.replace(",", ";").replace(".", ",")),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "csv of one column with a decimal comma",
        file(WITH_COMMAS),
        ALONE,
        Rejected(r"log\.csv, line 1: '0,0.* with decimal commas; state 'delimiter: "),
    ),
    Entry(
        "csv of one column with a decimal comma stated",
        file(WITH_COMMAS),
        ALONE | {"decimal": ","},
        kept(ROWS),
    ),
    Entry(
        "csv of one named column with a decimal comma",
        file("wx\n" + WITH_COMMAS),
        ALONE | {"channels": {"gyro_x": TWO["gyro_x"]}},
        kept(ROWS),
    ),
    Entry(
        "csv with commas for columns and decimals",
        file(lambda: "".join(f"{x},{x}\n" for x in WITH_COMMAS.split())),
        PLACED,
        Rejected(r"log\.csv, line 1: '0,0.* with decimal commas; state 'delimiter: "),
    ),
    Entry(
        "csv by position that begins with fewer columns",
        file("1.5\n" * 20 + BARE),
        PLACED,
        kept(ROWS, "incomplete_first_record"),
    ),
    Entry("csv with mixed ends of lines", file(mixed_ends), STAMPED, kept(ROWS)),
    Entry(
        "csv in UTF-8 with a mark",
        file(lambda: codecs.BOM_UTF8 + WHOLE.encode()),
        STAMPED,
        kept(ROWS),
    ),
    Entry("csv in UTF-16", file(WHOLE.encode("utf-16")), STAMPED, kept(ROWS)),
    Entry(
        "csv in UTF-16 without a mark",
        file(WHOLE.encode("utf-16-le")),
        STAMPED,
        Rejected("log.csv, line 1: looks like UTF-16 without a byte order mark"),
    ),
    Entry(
        "csv in Latin-1",
        file(WHOLE.replace("wx", "w (°/s) µ").encode("latin-1")),
        STAMPED | {"channels": {"gyro_x": {"column": "w (°/s) µ", "unit": "rad/s"}}},
        kept(ROWS, "unit_contradicts"),
    ),
    Entry(
        "csv with a name twice",
        file(lambda: instead("t,wx,wx\n", 0)),
        STAMPED,
        Rejected(r"log\.csv: .*no column 'az' for accel_z; found t, wx, wx"),
    ),
    Entry(
        "csv with the name of a channel twice",
        file(WHOLE.replace(",", ",1,").replace("t,1,wx,1,az", "t,wx,wx,az,x")),
        STAMPED,
        Rejected(
            r"log\.csv: column 'wx' for gyro_x occurs twice in the header .*its position instead"
        ),
    ),
    Entry(
        "csv without a column that is named",
        file(lambda: instead("t,wx,ay\n", 0)),
        STAMPED,
        Rejected(r"log\.csv: no column 'az' for accel_z; found t, wx, ay .*correct 'column'"),
    ),
    Entry(
        "csv with a name of 500 kB",
        file(lambda: instead(f"t,wx,{'z' * 500_000}\n", 0)),
        STAMPED,
        Rejected(r"log\.csv: no column 'az' for accel_z; found t, wx, z{40} with"),
    ),
    Entry(
        "csv without the column of time",
        file(lambda: instead("s,wx,az\n", 0)),
        STAMPED,
        Rejected(r"log\.csv: no column 't' for time; found s, wx, az .*correct 'column'"),
    ),
    Entry(
        "csv with a line of units",
        file(lambda: between("s,rad/s,m/s²\n", at=1)),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "csv with garbage under the header",
        file(lambda: between("r-d/$,#q w,zz\n", at=1)),
        STAMPED,
        kept(ROWS, "not_records"),
    ),
    Entry(
        "csv with garbage of binary under the header",
        file(b"t,wx,az\n\xfe\x12\x99\xd0,\x7f\xe9\n" + "".join(LINES[1:]).encode()),
        STAMPED,
        kept(ROWS, "not_records"),
    ),
]

DAMAGED = [
    Entry("csv of nothing", file(""), STAMPED, Rejected(r"log\.csv: the file is empty")),
    Entry("csv of a header", file(LINES[0]), STAMPED, Rejected(r"log\.csv: no record after the h")),
    Entry(
        "csv of one record",
        file(LINES[0] + LINES[1]),
        UNSTAMPED,
        Rejected("no channel can be used: .*gyro x has 1 sample; at least 100 are required"),
    ),
    Entry(
        "csv of one stamped record",
        file(LINES[0] + LINES[1]),
        STAMPED,
        Rejected(r"log\.csv: the time stamps do not advance"),
    ),
    Entry(
        "csv cut in a record",
        file(WHOLE[:-9]),
        STAMPED,
        kept(ROWS - 1, "incomplete_last_record"),
    ),
    Entry(
        "csv of binary data",
        file(np.random.default_rng(3).bytes(200_000)),
        STAMPED,
        Rejected(r"log\.csv, line \d+: holds binary data"),
    ),
    Entry(
        "csv with binary data in it",
        file(WHOLE.encode() + np.random.default_rng(3).bytes(5000) + WHOLE.encode()),
        STAMPED,
        Rejected(rf"log\.csv, line {ROWS + 2}"),
    ),
    Entry(
        "csv with a billion in a cell",
        file(lambda: cell("1e9")),
        STAMPED,
        kept(ROWS, "knocks"),
    ),
    Entry(
        "csv with 1e999 in a cell", file(lambda: cell("1e999")), STAMPED, kept(ROWS, "not_finite")
    ),
    Entry("csv with NaN", file(lambda: cell("NaN")), STAMPED, kept(ROWS, "empty_cells")),
    Entry("csv with an empty cell", file(lambda: cell("")), STAMPED, kept(ROWS, "empty_cells")),
    Entry("csv with an infinity", file(lambda: cell("-inf")), STAMPED, kept(ROWS, "not_finite")),
    Entry(
        "csv with a word in a cell",
        file(lambda: cell("oops")),
        STAMPED,
        Rejected(rf"log\.csv, line {MIDDLE + 1}, column 'wx': found 'oops', expected a number"),
    ),
    Entry(
        "csv with a short record",
        file(lambda: instead("4.99,0.001\n")),
        STAMPED,
        Rejected(rf"log\.csv, line {MIDDLE + 1}: found 2 columns, expected 3: '4\.99,0\.001'"),
    ),
    Entry(
        "csv with two records in one line",
        file(lambda: instead(LINES[MIDDLE].strip() + LINES[MIDDLE + 1])),
        STAMPED,
        Rejected(rf"log\.csv, line {MIDDLE + 1}: found 5 columns, expected 3"),
    ),
    Entry(
        "csv with zeros at the end",
        file(WHOLE.encode() + bytes(100_000)),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "csv with zeros between records",
        file(lambda: between("\0" * 512)),
        STAMPED,
        Rejected(rf"log\.csv, line {MIDDLE + 1}, column 't': found '\\x00\\x00"),
    ),
    Entry(
        "csv with a zero in a cell",
        file(lambda: cell("0.00\x001")),
        STAMPED,
        kept(ROWS - 1, "zero_bytes", "missing_samples"),
    ),
    Entry(
        "csv with the header again",
        file(lambda: between(LINES[0])),
        STAMPED,
        kept(ROWS, "restarted_log"),
    ),
    Entry(
        "csv of a million columns",
        file(lambda: b"wx," + b"c," * MIB + b"az\n" + b"1," * MIB + b"2,3\n"),
        UNSTAMPED,
        Rejected(r"log\.csv: no line break in 1048576 bytes"),
    ),
    Entry(
        "csv of lines of 10 MB",
        file(lambda: b"wx,az\n" + 3 * (b"1," * 5 * MIB + b"2\n")),
        UNSTAMPED,
        Rejected(r"log\.csv: no line break in 1048576 bytes"),
    ),
    Entry(
        "csv that is a page of an error",
        file(HTML),
        STAMPED,
        Rejected(r"log\.csv: is a page of HTML or XML, .*download it again"),
    ),
    Entry(
        "csv that is JSON",
        file('[{"wx": 1, "az": 2}]\n'),
        UNSTAMPED,
        Rejected(r"log\.csv: is JSON, .*export the log as CSV"),
    ),
    Entry(
        "csv of comments",
        file("# wx,az\n" * 1000),
        UNSTAMPED,
        Rejected(r"log\.csv: no record after the comments"),
    ),
    Entry(
        "csv with an open quote",
        file(lambda: cell('"0.001')),
        STAMPED,
        Rejected(rf"log\.csv, line {MIDDLE + 1}"),
    ),
    Entry(
        "gzip with the name of a text",
        file(lambda: gzip.compress(WHOLE.encode())),
        STAMPED,
        kept(ROWS),
    ),
    Entry("text with the name of MATLAB", file(WHOLE, "log.mat"), STAMPED, kept(ROWS)),
]

ENTRIES = [*LAYOUTS, *DAMAGED]

"""Logs of flight controllers, and workbooks."""

from __future__ import annotations

import zipfile
from pathlib import Path

from tests.formats.flight_logs import data, declared, fmt, message, subscribed, ulog_header
from tests.readers.hostile.attack import Attack, file
from tests.readers.test_excel import workbook

NO_MESSAGE = "has no message of numbers"
GYRO = {"gyro_x": {"column": "x"}}


def nested() -> bytes:
    """A topic of 999^12 fields, subscribed to 1500 times."""
    layouts = [declared(f"t{n}", f"t{n + 1}[999] x;") for n in range(12)]
    topics = [subscribed(n, "t0", n % 200) for n in range(1500)]
    return ulog_header() + b"".join([*layouts, declared("t12", "float x;"), *topics])


def wide() -> bytes:
    """Topics of as many fields as may be, each with a message."""
    layouts = [declared(f"t{n}", "uint8_t[1020] a;float x;") for n in range(1100)]
    topics = [subscribed(n, f"t{n}") + data(n, bytes(1024)) for n in range(1100)]
    return ulog_header() + b"".join([*layouts, *topics])


def declarations() -> bytes:
    """Declarations of DataFlash that replace each other, and no message."""
    every = [fmt(129, "IMU", "Bfff" + "f" * n, "I,x,y,z" + ",a,b,c"[: 2 * n], 16 + 4 * n)
             for n in range(4)]  # fmt: skip
    return fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89) + b"".join(every) * 8_000


def corners(folder: Path) -> Path:
    """Two cells at the corners of a sheet, between which 17 billion are reserved."""
    cells = "".join(
        f'<row r="{row}"><c r="{name}{row}"><v>1</v></c></row>'
        for row, name in ((1, "A"), (1_048_576, "XFD"))
    )
    whole = workbook(folder / "whole", {"a": [[1.0]]})
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(folder / "a.xlsx", "w") as target:
        for name in source.namelist():
            text = source.read(name).decode().replace("<row><c><v>1.0</v></c></row>", cells)
            target.writestr(name, text)
    whole.unlink()
    return folder / "a.xlsx"


FLIGHT = {
    "fields of fields without end": Attack(
        file("a.ulg", nested), "found none", NO_MESSAGE, channels=GYRO
    ),
    "1100 topics of 1000 fields": Attack(
        file("a.ulg", wide), "several|expected one kind", "no column of numbers", channels=GYRO
    ),
    "marks of a ULog alone": Attack(
        file("a.ulg", lambda: ulog_header() + message("S", b"") * 3_000_000),
        "found none",
        NO_MESSAGE,
        channels=GYRO,
    ),
    "declarations of DataFlash alone": Attack(
        file("a.bin", declarations), "found none", NO_MESSAGE, channels=GYRO
    ),
    "syncs of DataFlash alone": Attack(
        file("a.bin", lambda: fmt(128, "FMT", "", "", 89) + b"\xa3\x95" * 8_000_000),
        "found none",
        NO_MESSAGE,
        channels=GYRO,
    ),
    "a sheet of 17 billion cells": Attack(corners, "its sheets cannot be read", channels=GYRO),
}

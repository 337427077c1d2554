"""What stands where a log is expected: links, folders, files that cannot be opened."""

from __future__ import annotations

import os
from pathlib import Path

from tests.corpus.entry import Entry, Rejected, Written, file, folder_of, kept
from tests.corpus.signals import AZ, ROWS, STAMPED, TIME, WX, log

TEXT = log()
PER_FILE = {
    "time": TIME,
    "channels": {"gyro_x": WX | {"file": "gyro.csv"}, "accel_z": AZ | {"file": "accel.csv"}},
}


def link_to(target: str) -> Written:
    def write(folder: Path) -> Path:
        (folder / "log.csv").symlink_to(target)
        return folder / "log.csv"

    return write


def good_link(folder: Path) -> Path:
    (folder / ".kept").mkdir()
    (folder / ".kept/real.csv").write_text(TEXT)
    (folder / "log.csv").symlink_to(".kept/real.csv")
    return folder / "log.csv"


def looped_folder(folder: Path) -> Path:
    path = folder_of({"log.csv": TEXT})(folder)
    (path / "again").symlink_to(path, target_is_directory=True)
    return path


def forbidden(folder: Path) -> Path:
    path = file(TEXT)(folder)
    path.chmod(0)
    return path


def pipe(folder: Path) -> Path:
    os.mkfifo(folder / "log.csv")
    return folder / "log.csv"


def pipe_in_folder(folder: Path) -> Path:
    path = folder_of({"log.csv": TEXT})(folder)
    os.mkfifo(path / "pipe")
    return path


def file_that_is_a_folder(folder: Path) -> Path:
    path = folder_of({"gyro.csv": TEXT})(folder)
    (path / "accel.csv").mkdir()
    return path


ENTRIES = [
    Entry("link to a log", good_link, STAMPED, kept(ROWS)),
    Entry(
        "link to itself",
        link_to("log.csv"),
        STAMPED,
        Rejected("log.csv: cannot be read .Too many levels"),
    ),
    Entry(
        "link to nothing",
        link_to("gone.csv"),
        STAMPED,
        Rejected("log.csv: cannot be read .No such file", is_final=False),
    ),
    Entry("folder with a link to itself", looped_folder, STAMPED, kept(ROWS)),
    Entry(
        "link to a device",
        link_to("/dev/zero"),
        STAMPED,
        Rejected("'log.csv' is neither a file nor a folder"),
    ),
    Entry(
        "named pipe",
        pipe,
        STAMPED,
        Rejected("'log.csv' is neither a file nor a folder"),
    ),
    Entry("folder with a named pipe", pipe_in_folder, STAMPED, kept(ROWS)),
    Entry(
        "file that may not be read",
        forbidden,
        STAMPED,
        Rejected("log.csv: cannot be read .Permission denied", is_final=False),
        skip="root may read every file" if os.geteuid() == 0 else None,
    ),
    Entry("folder of one log", folder_of({"log.csv": TEXT}), STAMPED, kept(ROWS)),
    Entry(
        "folder of nothing",
        folder_of({".hidden": TEXT}),
        STAMPED,
        Rejected("the folder 'log' has no files"),
    ),
    Entry(
        "folder of several logs",
        folder_of({"a.csv": TEXT, "b.csv": TEXT}),
        STAMPED,
        Rejected("log: expected one file, the folder has a.csv, b.csv; name the file"),
    ),
    Entry(
        "folder with the name of a log", folder_of({"a.csv": TEXT}, "log.csv"), STAMPED, kept(ROWS)
    ),
    Entry(
        "folder of two files",
        folder_of({"gyro.csv": TEXT, "accel.csv": TEXT}),
        PER_FILE,
        kept(ROWS),
    ),
    Entry(
        "folder without one of two files",
        folder_of({"gyro.csv": TEXT}),
        PER_FILE,
        Rejected("log: no file 'accel.csv' for accel_z; the folder has gyro.csv"),
    ),
    Entry(
        "folder with a folder for a file",
        file_that_is_a_folder,
        PER_FILE,
        Rejected("log: no file 'accel.csv' for accel_z; the folder has gyro.csv"),
    ),
    Entry(
        "folder with an empty file of two",
        folder_of({"gyro.csv": TEXT, "accel.csv": ""}),
        PER_FILE,
        Rejected("accel.csv: the file is empty"),
    ),
    Entry(
        "folder with files of unequal length",
        folder_of({"gyro.csv": TEXT, "accel.csv": log(ROWS // 2)}),
        PER_FILE,
        kept(ROWS),
    ),
    Entry(
        "file where a folder is expected",
        file(TEXT),
        PER_FILE,
        Rejected("log.csv: is a single file, but 'file:' in the sensor file expects"),
    ),
    Entry(
        "file with a name of odd letters",
        file(TEXT, "log\n?.csv"),
        STAMPED,
        Rejected("the file name .* cannot be used; .*rename"),
    ),
]

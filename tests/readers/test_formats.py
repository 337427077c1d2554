"""The registry of the formats of log files: nothing of a format is forgotten."""

from __future__ import annotations

import inspect
import json
import shutil
import subprocess
import sys
from itertools import permutations
from pathlib import Path
from typing import get_args

import pytest

from imubench_pipeline.readers import read
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.readers.content import recognise_content
from imubench_pipeline.readers.contents import list_contents
from imubench_pipeline.readers.file_format import FileFormat
from imubench_pipeline.readers.formats import FILE_FORMATS, TEXT
from imubench_pipeline.settings.sensor import ColumnSource, LogFormat, Reader
from tests.conftest import PROJECT
from tests.corpus import ENTRIES, Kept

PACKAGE = PROJECT / "src/imubench_pipeline"

SAMPLES: dict[Reader, str] = {
    "csv": "axis in coarse steps",
    "vectornav": "vectornav with a counter",
    "ubx": "ubx of ESF-MEAS",
    "novatel": "novatel",
    "ulog": "ulog",
    "dataflash": "dataflash",
    "excel": "excel",
    "rosbag": "ros 1 bag",
    "matlab": "matlab 5",
    "numpy": "npz",
    "arrow": "parquet",
    "hdf5": "hdf5",
}
"""An entry of the corpus in each format, which is read."""


@pytest.fixture(params=get_args(Reader))
def file_format(request: pytest.FixtureRequest) -> FileFormat:
    return FILE_FORMATS[request.param]


@pytest.fixture
def log(file_format: FileFormat, tmp_path: Path) -> Path:
    assert file_format.name in SAMPLES, "SAMPLES lacks a log of the format"
    entry = ENTRIES[SAMPLES[file_format.name]]
    assert isinstance(entry.expected, Kept)
    return entry.write(tmp_path)


def test_a_log_is_told_by_its_content(file_format: FileFormat, log: Path) -> None:
    assert recognise_content(log) == (file_format, "")
    renamed = log.rename(log.with_name("log"))
    assert recognise_content(renamed) == (file_format, "")


LOADED = """
import json
from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.formats import FILE_FORMATS
said = {}
for name, file_format in FILE_FORMATS.items():
    try:
        file_format.load()
    except RecordingError as error:
        said[name] = str(error)
print(json.dumps(said), flush=True)
"""
"""Says of each format what its library lacks."""

WITHOUT = (
    "import sys\nsys.modules |= dict.fromkeys(['rosbags', 'lz4', 'h5py', 'python_calamine'])"
    + LOADED
)


# Every day the same is asked where they are not installed: tests/test_extras.py.
@pytest.mark.release
def test_a_library_that_is_not_installed_is_named() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=True, timeout=60
    )
    said = json.loads(done.stdout)
    extras = {name: form.extra for name, form in FILE_FORMATS.items() if form.extra}
    assert set(said) == set(extras) == {"rosbag", "matlab", "hdf5", "excel"}
    for name, extra in extras.items():
        library = {"ros": "rosbags", "hdf5": "h5py", "excel": "python_calamine"}[extra]
        assert f"{library}" in said[name]
        assert f"is not installed: pip install 'imubench_pipeline[{extra}]'" in said[name]


def test_a_log_is_read(file_format: FileFormat, log: Path) -> None:
    stated = LogFormat.model_validate(ENTRIES[SAMPLES[file_format.name]].log)
    files = read(log, stated.model_copy(update={"reader": file_format.name}))
    assert files
    for file in files:
        assert type(file) is file_format.code().log_file
        assert sum(len(batch) for batch in file.batches()) > 0


def test_what_a_log_holds_is_listed(file_format: FileFormat, log: Path) -> None:
    listed = list_contents(log)
    assert listed.about == file_format.title
    assert listed.tables
    assert all(table.file_format is file_format for table in listed.tables)
    labels = {column.label for table in listed.tables for column in table.columns}
    assert not file_format.time_columns or labels & set(file_format.time_columns)


def test_a_format_is_declared_in_full(file_format: FileFormat) -> None:
    assert file_format.title.strip()
    assert file_format.endings
    assert all(ending.startswith(".") for ending in file_format.endings)
    known = LogFormat.model_fields.keys() | ColumnSource.model_fields.keys()
    assert set(file_format.settings) <= known
    assert ("variable" in file_format.settings) >= (file_format.clock_of == "variable")
    code = file_format.code()
    assert issubclass(code.log_file, LogFile)
    assert not inspect.isabstract(code.log_file)


def test_no_signature_hides_another() -> None:
    for known, other in permutations(FILE_FORMATS.values(), 2):
        begins = known.signature.begins
        hidden = [mark for mark in other.signature.begins if mark.startswith(begins)]
        assert not hidden, f"{other.name} is taken for {known.name}"
    told_by_nothing = [
        known.name
        for known in FILE_FORMATS.values()
        if not known.signature.begins and known.signature.tells is None
    ]
    assert told_by_nothing == [TEXT.name]


IMPORTS = """
import sys
for folder in sys.argv[1:]:
    sys.path.insert(0, folder)
    try:
        import imubench_pipeline.readers
    except Exception as error:
        print(error)
    else:
        print("imported")
    for name in [name for name in sys.modules if name.startswith("imubench_pipeline")]:
        del sys.modules[name]
    del sys.path[0]
"""


def test_a_format_that_is_declared_by_half_stops_the_import(tmp_path: Path) -> None:
    for folder in ("module", "name"):
        shutil.copytree(
            PACKAGE,
            tmp_path / folder / PACKAGE.name,
            ignore=shutil.ignore_patterns("*.nbi", "*.nbc"),
        )
    for folder, (old, new) in {
        "module": ("*_DECLARED", "*_DECLARED[:-1]"),
        "name": ('name="numpy"', 'name="other"'),
    }.items():
        declared = tmp_path / folder / PACKAGE.name / "readers/formats.py"
        text = declared.read_text()
        assert text.count(old) == 1
        declared.write_text(text.replace(old, new))
    folders = [str(tmp_path / folder) for folder in ("module", "name")]
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS, *folders], capture_output=True, text=True, check=True
    )
    for missing, said in zip(("excel", "other"), done.stdout.splitlines(), strict=True):
        assert f"{missing}: a format of log files needs a declaration" in said

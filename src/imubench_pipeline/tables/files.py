"""Reading and writing tables: checked against their schemas, atomically."""

import contextlib
import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv

from imubench_pipeline.model.table import AnyRow, TableRow, TypedColumn
from imubench_pipeline.tables.parquet import SEAL, is_seal_broken, open_parquet, write_sealed
from imubench_pipeline.tables.schemas import PARTS_OF, TABLES
from imubench_pipeline.tables.texts import escape_cells, escape_invisible

_SMALL = 1_000_000  # bytes
_LONGEST_NAME = 240  # bytes of a name to which a temporary one can add; file systems take 255


class TableError(ValueError):
    """A table that does not fit its schema, is damaged, or is missing."""


def get_columns(table: str) -> tuple[TypedColumn, ...]:
    """Return the columns of a table, by its name or by the name of a part, such as ``curve``."""
    return TABLES[PARTS_OF.get(table, table)]


def make_schema(table: str) -> pa.Schema:
    """Return the Arrow schema of a table, with unit and meaning in the field metadata."""
    return pa.schema(
        [
            pa.field(
                column.name,
                column.type,
                nullable=not column.required,
                metadata={"unit": column.unit, "meaning": column.meaning},
            )
            for column in get_columns(table)
        ]
    )


def build(table: str, rows: Iterable[AnyRow]) -> pa.Table:
    """Make an Arrow table of rows and check it against the schema of ``table``.

    Missing values, NaN and infinities become null; invisible characters are escaped. Raises a
    `TableError` for an unknown column, a value outside its category, or a missing required value.
    """
    listed = [row.columns() if isinstance(row, TableRow) else row for row in rows]
    columns = get_columns(table)
    unknown = {name for row in listed for name in row} - {column.name for column in columns}
    if unknown:
        expected = ", ".join(column.name for column in columns)
        raise TableError(f"table {table}: unknown columns {sorted(unknown)}; expected {expected}")
    arrays = []
    for column in columns:
        values = [_plain(row.get(column.name)) for row in listed]
        if column.is_list:
            values = [value or [] for value in values]
        elif column.values and (other := set(values) - {None, *column.values}):
            raise TableError(
                f"table {table}: column {column.name} is {min(map(str, other))!r}; expected one of "
                f"{', '.join(column.values)}"
            )
        array = pa.array(values, type=column.type, from_pandas=True)
        if column.required and array.null_count:
            fault = f"column {column.name} has {array.null_count} nulls"
            raise TableError(f"table {table}: {fault}; expected a value in every row")
        arrays.append(array)
    return pa.Table.from_arrays(arrays, schema=make_schema(table))


def _plain(value: Any) -> Any:
    """Convert a value for Arrow: texts become printable, structs mappings, NaN and inf None."""
    if isinstance(value, str):  # a reason may have several lines
        return "\n".join(map(escape_invisible, value.split("\n")))
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (tuple, list)):
        return [_plain(part) for part in value]
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    return value


def _not_finite(table: pa.Table) -> str:
    for name, column in zip(table.column_names, table.columns, strict=True):
        if pa.types.is_floating(column.type):
            finite = pc.is_finite(column)  # null where there is no value
            if not pc.all(finite, min_count=0).as_py():
                row = pc.index(finite, pa.scalar(False)).as_py()
                return f"{name} of row {row + 1} is {column[row].as_py()}"
    return ""


@contextlib.contextmanager
def replace_file(path: Path) -> Iterator[Path]:
    """Yield a temporary file beside ``path``; rename it to ``path`` if the block succeeds."""
    path.parent.mkdir(parents=True, exist_ok=True)
    # The temporary name is longer, and must not be too long where the name itself is not.
    stem = path.name if len(os.fsencode(path.name)) <= _LONGEST_NAME else path.name[:60]
    handle, name = tempfile.mkstemp(prefix=f".{stem}.", suffix=".part", dir=path.parent)
    temporary = Path(name)
    try:
        os.close(handle)
        yield temporary
        # mkstemp makes private files; results are for everybody, as the umask says.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def make_folder(folder: Path) -> Iterator[Path]:
    """Yield a folder to fill; rename it to ``folder``, missing or empty, if the block succeeds."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".part", dir=folder.parent))
    try:
        inside = scratch / folder.name
        inside.mkdir()  # with the usual permissions: mkdtemp makes a private folder
        yield inside
        inside.rename(folder)
    finally:
        shutil.rmtree(scratch)


def write(table: str, rows: Iterable[AnyRow], path: Path) -> None:
    """Check rows against the schema of their table and write them as Parquet, atomically."""
    write_arrow(build(table, rows), path)


def write_each(tables: Mapping[str, Iterable[AnyRow]], outputs: Iterable[Path]) -> None:
    """Write to each output the rows of the table after which the file is named."""
    built = {name: build(name, rows) for name, rows in tables.items()}
    for output in outputs:
        write_arrow(built[output.stem], output)


def write_arrow(table: pa.Table, path: Path) -> None:
    """Write an Arrow table, atomically: as CSV if ``path`` ends with ``.csv``, else as Parquet.

    Raises a `TableError` for NaN or infinities.
    """
    if fault := _not_finite(table):
        raise TableError(f"{path}: {fault}; expected a finite number or null")
    with replace_file(path) as temporary:
        if path.suffix == ".csv":
            # Arrow ignores that a file which it opened itself cannot be closed.
            with temporary.open("wb") as file:
                write_csv(table, file)
        else:
            # A small file is read in half the time by snappy, and thousands of them are.
            write_sealed(table, temporary, "zstd" if table.nbytes > _SMALL else "snappy")


def link_part(name: str, part: pa.Table, stored: Path, folder: Path) -> None:
    """Add a part of the table ``name`` to a folder, as a hard link to a stored file, or a copy.

    The stored file is written only if it is missing or damaged, or contains other rows.
    """
    try:
        is_same = read_part(name, stored).equals(part)
    except (OSError, TableError):
        is_same = False
    if not is_same:
        write_arrow(part, stored)
    try:
        (folder / stored.name).hardlink_to(stored)
    except OSError:  # a disk without links
        shutil.copy2(stored, folder / stored.name)


def write_csv(table: pa.Table, file: BinaryIO) -> None:
    """Write a table as CSV: formulas are escaped, lists joined by ``;``, structs are JSON."""
    pacsv.write_csv(escape_cells(table), file)


def locate_table(results: Path, table: str) -> Path:
    """Return the path of a joined table of a run: a file, or a folder with parts of the table."""
    return results / "tables" / f"{table}.parquet"


def find_tables_folder(results: Path) -> Path:
    """Return the folder of the tables of a run; ``results`` may be that folder itself."""
    inside = results / "tables"
    return inside if inside.is_dir() else results


def find_tables(results: Path, names: Iterable[str]) -> dict[str, Path]:
    """Return the paths of tables of a run, by name; ``results`` is as in `find_tables_folder`.

    Raises a `TableError` if a table is missing.
    """
    folder = find_tables_folder(results)
    paths = {name: folder / f"{name}.parquet" for name in names}
    if missing := [name for name, path in paths.items() if not path.exists()]:
        raise TableError(
            f"{folder}: no table {', '.join(missing)}; expected the folder of the results of a "
            "finished run, such as results/; `snakemake -c2` makes it"
        )
    return paths


def read(table: str, paths: Sequence[Path]) -> pa.Table:
    """Read and join files of one table, in the order given."""
    return join_tables(table, [read_part(table, path) for path in paths])


def join_tables(table: str, parts: Sequence[pa.Table]) -> pa.Table:
    """Join parts of one table, in the order given."""
    expected = make_schema(table)
    plain = [part.replace_schema_metadata(None) for part in parts] or [expected.empty_table()]
    return pa.concat_tables(plain).cast(expected)


def read_part(table: str, path: Path, *, any_version: bool = False) -> pa.Table:
    """Read a table from one file, with its metadata, or from a folder with parts of it, in order.

    With ``any_version``, missing columns that may be null become null, and unknown ones are left
    out. Raises a `TableError` if the file is damaged, has other columns, or NaN or infinities.
    """
    part, expected = _load_part(path), make_schema(table)
    if any_version:
        for field in expected:
            if field.name not in part.column_names and (
                field.nullable or pa.types.is_list(field.type)
            ):
                part = part.append_column(field, pa.nulls(len(part), field.type))
        part = part.select([name for name in expected.names if name in part.column_names])
    if other := _other_columns(part.schema, expected):
        raise TableError(
            f"{path} was made by another version of imubench_pipeline: {other}; run snakemake -c2 "
            "again, with the same options as for these results, to make it again"
        )
    if fault := _not_finite(part):
        raise TableError(
            f"{path}: {fault}; expected a finite number or null; remove the file, and the next run "
            "makes it again"
        )
    if part.schema.equals(expected):
        return part
    return part.cast(expected).replace_schema_metadata(part.schema.metadata)


def _load_part(path: Path) -> pa.Table:
    if path.is_dir():
        # Not a date that Snakemake leaves, in a file whose name begins with a dot.
        parts = [_load_part(part) for part in sorted(path.glob("[!.]*.parquet"))]
        return pa.concat_tables(parts) if parts else _load_part(path / "empty.parquet")
    try:
        if path.exists() and not path.is_file():  # a pipe never answers
            raise pa.ArrowInvalid("it is not a regular file")
        if is_seal_broken(path):
            raise pa.ArrowInvalid("its metadata were changed")
        with open_parquet(path) as file:
            part = file.read(use_threads=False)
        metadata = {key: text for key, text in (part.schema.metadata or {}).items() if key != SEAL}
        return part.replace_schema_metadata(metadata)
    except FileNotFoundError:
        raise
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise TableError(
            f"{path} is damaged ({error}); remove it, and the next run makes it again"
        ) from error


def _other_columns(actual: pa.Schema, expected: pa.Schema) -> str:
    if actual.names != expected.names:
        missing = [name for name in expected.names if name not in actual.names]
        unknown = [name for name in actual.names if name not in expected.names]
        faults = [f"it has no {', '.join(missing)}"] * bool(missing)
        faults += [f"it has unknown columns {', '.join(unknown)}"] * bool(unknown)
        return " and ".join(faults) or "its columns have another order"
    for name in expected.names:
        here, due_field = actual.field(name), expected.field(name)
        if here.type != due_field.type:
            return f"{name} is {here.type}, expected {due_field.type}"
        due = (due_field.metadata or {})[b"unit"]
        unit = (here.metadata or {}).get(b"unit", due)
        if unit != due:
            return f"{name} is in {unit.decode()!r}, expected {due.decode()!r}"
    return ""


def write_content(content: str | bytes, path: Path) -> None:
    """Write a text, as UTF-8, or bytes to a file, atomically."""
    with replace_file(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


def read_json(path: Path) -> Any:
    """Return the content of a JSON file; ValueError if it is invalid or nested too deeply."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError(f"{path}: lists and mappings are nested too deeply to be read") from None


def write_json(data: object, path: Path) -> None:
    """Write data as JSON, atomically; raise ValueError for NaN or infinities."""
    write_content(json.dumps(data, indent=1, allow_nan=False) + "\n", path)

"""Describe the joined tables of a run for other programs, as a Data Package (datapackage.org)."""

from collections.abc import Container, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa

from imubench_pipeline.model.table import TypedColumn
from imubench_pipeline.tables.files import find_tables_folder, read_json
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, ROWS, TABLES

FILE = "datapackage.json"
_TYPES = {pa.float64(): "number", pa.int64(): "integer", pa.bool_(): "boolean"}
_RECORDING = ["sensor", "recording"]

_CSV = {"format": "csv", "mediatype": "text/csv", "encoding": "utf-8"}
_PARQUET = {"format": "parquet", "mediatype": "application/vnd.apache.parquet"}


def describe_tables(software: object, csv: Container[str] = TABLES) -> Mapping[str, object]:
    """Return the descriptor of the joined tables: name, type, unit and meaning of each column.

    It follows Data Package 2.0. A resource is a CSV file, in which ``;`` joins lists, or a Parquet
    file if the table is not in ``csv``. The keys ``parquet`` (the same table as Parquet), ``unit``
    and ``software`` (see `read_software`) are not part of the standard.
    """
    return {
        "$schema": "https://datapackage.org/profiles/2.0/datapackage.json",
        "name": "imubench-tables",
        "software": software,
        "resources": [
            {
                "name": name,
                "type": "table",
                "path": f"{name}.{'csv' if name in csv else 'parquet'}",
                **(_CSV if name in csv else _PARQUET),
                "parquet": f"{name}.parquet",
                "schema": _describe_schema(name),
            }
            for name in TABLES
            if name not in OF_ONE_RECORDING
        ],
    }


def read_software(results: Path) -> Mapping[str, str]:
    """Return version of the program and digest of the settings of a run; empty if unknown."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        return {**read_json(find_tables_folder(results) / FILE)["software"]}
    return {}


def _describe_schema(name: str) -> dict[str, Any]:
    schema: dict[str, Any] = {"fields": [_describe_column(column) for column in TABLES[name]]}
    if ROWS[name].key:
        schema["primaryKey"] = [*ROWS[name].key]
    required = {column.name for column in TABLES[name] if column.required}
    if name != "recordings" and required.issuperset(_RECORDING):
        reference = {"resource": "recordings", "fields": _RECORDING}
        schema["foreignKeys"] = [{"fields": _RECORDING, "reference": reference}]
    return schema


def _describe_column(column: TypedColumn) -> dict[str, Any]:
    field: dict[str, Any] = {"name": column.name, "type": _TYPES.get(column.type, "string")}
    if column.is_list:
        field |= {"type": "list", "delimiter": ";"}
    field |= {"description": column.meaning, "unit": column.unit}
    field["constraints"] = {"required": column.required and not column.is_list}
    if column.values:
        field["constraints"]["enum"] = [*column.values]
    return field

"""Read, check and write tables; findings, failures, and the digest of the code."""

from imubench_pipeline.tables.files import (
    TableError,
    build,
    columns_of,
    joined,
    making,
    read,
    read_json,
    read_part,
    replacing,
    schema,
    tables_folder,
    tables_of_run,
    write,
    write_arrow,
    write_content,
    write_each,
    write_json,
)
from imubench_pipeline.tables.parquet import checked_parquet, checked_row_group

__all__ = [
    "TableError",
    "build",
    "checked_parquet",
    "checked_row_group",
    "columns_of",
    "joined",
    "making",
    "read",
    "read_json",
    "read_part",
    "replacing",
    "schema",
    "tables_folder",
    "tables_of_run",
    "write",
    "write_arrow",
    "write_content",
    "write_each",
    "write_json",
]

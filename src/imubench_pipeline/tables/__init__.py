"""Read, check and write tables; findings, failures, and the digest of the code."""

from imubench_pipeline.tables.files import (
    TableError,
    build,
    find_tables,
    find_tables_folder,
    join_tables,
    make_folder,
    make_schema,
    read,
    read_json,
    replace_file,
    write,
    write_arrow,
    write_content,
    write_each,
    write_json,
)
from imubench_pipeline.tables.parquet import open_parquet, read_row_group

__all__ = [
    "TableError",
    "build",
    "find_tables",
    "find_tables_folder",
    "join_tables",
    "make_folder",
    "make_schema",
    "open_parquet",
    "read",
    "read_json",
    "read_row_group",
    "replace_file",
    "write",
    "write_arrow",
    "write_content",
    "write_each",
    "write_json",
]

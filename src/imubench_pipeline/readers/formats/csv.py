"""Delimited text: the format of all logs that no other format matches."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.text import csv

    return Code(csv.CsvFile, csv.describe_table)


FORMAT = FileFormat(
    name="csv",
    title="text",
    endings=(".csv", ".txt", ".tsv", ".dat", ".log", ".asc"),
    signature=Signature(),
    streamed=True,
    clock_of="file",
    settings=("delimiter", "header", "skip_lines", "comment", "decimal"),
    code=_code,
)

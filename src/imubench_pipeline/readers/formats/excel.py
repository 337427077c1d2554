"""Workbooks of Excel, such as the exports of phyphox."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.arrays import excel, file

    return Code(excel.ExcelFile, file.list_tables)


FORMAT = FileFormat(
    name="excel",
    title="Excel workbook",
    endings=(".xlsx", ".xls"),
    signature=Signature(begins=(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",), archive_has=".rels"),
    clock_of="variable",
    settings=("variable",),
    code=_code,
    extra="excel",
)

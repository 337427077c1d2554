"""Tables of Parquet, Feather and Arrow."""

import re

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature

_MAGIC = re.compile(rb"(?:PAR1|FEA1|ARROW1)(?:[\0-\x08\x0e-\x1f]|\Z)")
"""The control character excludes texts that begin with these letters."""


def _code() -> Code:
    from imubench_pipeline.readers.arrays import arrow, file

    return Code(arrow.ArrowFile, file.list_tables)


FORMAT = FileFormat(
    name="arrow",
    title="Parquet, Feather or Arrow table",
    endings=(".parquet", ".feather", ".arrow"),
    signature=Signature(tells=lambda begin: _MAGIC.match(begin) is not None),
    code=_code,
)

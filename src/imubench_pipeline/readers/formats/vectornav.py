"""Asynchronous sentences of VectorNav's sensors."""

import re

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature

_SENTENCE = re.compile(rb"\$VN[A-Z]{3},[-+.,\d]{8}")
"""The checksum is not tested here: the reader counts the wrong ones."""


def _code() -> Code:
    from imubench_pipeline.readers import vectornav

    return Code(vectornav.VectorNavFile, vectornav.list_sentences)


FORMAT = FileFormat(
    name="vectornav",
    title="VectorNav ASCII sentences",
    endings=(".txt", ".log"),
    signature=Signature(tells=lambda begin: _SENTENCE.search(begin) is not None),
    streamed=True,
    clock_of="file",
    time_columns=("host_time", "counter"),
    code=_code,
    vendor="VectorNav",
)

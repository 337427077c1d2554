"""Logs of u-blox receivers: their inertial sensors."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers import ubx

    return Code(ubx.UbxFile, ubx.tables)


FORMAT = FileFormat(
    name="ubx",
    title="u-blox UBX messages",
    endings=(".ubx",),
    # The receiver may be in the middle of something else when the log begins.
    signature=Signature(within=(b"\xb5\x62", b"\0")),
    streamed=True,
    clock_of="variable",
    time_columns=("time_tag", "sTtag"),
    settings=("variable",),
    code=_code,
    vendor="u-blox",
)

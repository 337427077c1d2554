"""Known files that are not read: their first bytes, and how to make a log of them."""

from collections.abc import Mapping
from typing import NamedTuple

from imubench_pipeline.settings.sensor import Reader


class OtherFormat(NamedTuple):
    """A known format that cannot be read, and how to convert it."""

    name: str  # with its article
    marks: tuple[bytes, ...]  # one of them is at ``place``
    advice: str
    place: int = 0  # bytes before the mark


_LOG = "take the log itself"
OTHER_FORMATS = tuple(OtherFormat(*row) for row in (
    ("a tar archive", (b"ustar",), "unpack it", 257),
    ("a blackbox log of Betaflight or INAV", (b"H Product:Blackbox",),
     "make CSV with 'blackbox_decode --unit-rotation deg/s --unit-acceleration m/s2'"),
    ("the text form of an ArduPilot log", (b"FMT, 128, 89,",),
     "take the .BIN, which is read, or make CSV with 'mavlogdump.py --format csv'"),
    ("a binary log of Xsens (.mtb)", (b"\xfa\xff",), "export it as text with MT Manager"),
    ("binary output of VectorNav", (b"\xfa\x01", b"\xfa\x04", b"\xfa\x05"),
     "export it as CSV with Control Center, or log ASCII sentences (register 6)"),
    ("binary output of MicroStrain (MIP)", (b"ue\x80",), "export it as CSV with SensorConnect"),
    ("binary output of a NovAtel receiver", (b"\xaa\x44\x12", b"\xaa\x44\x13"),
     "make ASCII with NovAtel Convert: RAWIMUSXA is read"),
    ("a log of a Septentrio receiver (SBF)", (b"$@",),
     "make text of its block ExtSensorMeas with bin2asc or SBF Converter"),
    ("data of R", (b"RDX2\n", b"RDX3\n", b"RDA2\n", b"RDA3\n", b"X\n\0\0\0\2", b"X\n\0\0\0\3"),
     "make CSV in R: write.csv(x, 'log.csv', row.names = FALSE)"),
    ("a pickle of Python", (b"\x80\x03", b"\x80\x04\x95", b"\x80\x05\x95"),
     "save the arrays with numpy.savez, or the table with its to_parquet"),
    ("a TDMS file of LabVIEW", (b"TDSm",), "make CSV with npTDMS: as_dataframe().to_csv(...)"),
    ("an MDF measurement file", (b"MDF     ", b"UnFinMF "), "make CSV with asammdf"),
    ("a classic NetCDF file", (b"CDF\1", b"CDF\2", b"CDF\5"),
     "make HDF5, which is read: 'nccopy -k nc4 in.nc out.h5'"),
    ("an OpenDocument file", (b"mimetypeapplication/vnd.oasis",), "save the sheet as CSV", 30),
    ("a capture of network packets",
     (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\x0a\x0d\x0d\x0a"),
     "extract the IMU data with the software of the device that sent them"),
    ("a video", (b"ftyp",), "extract its telemetry as CSV, as GoPro's tools do", 4),
    ("sound or video", (b"RIFF", b"\x1a\x45\xdf\xa3", b"OggS"), _LOG),
    ("a PDF document", (b"%PDF-",), _LOG),
    ("an image", (b"\x89PNG\r\n", b"\xff\xd8\xff", b"GIF8", b"II*\0", b"MM\0*"), _LOG),
    ("a program", (b"\x7fELF", b"MZ\x90\0", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe"), _LOG),
))  # fmt: skip
"""Neither text nor a format of `imubench_pipeline.readers.formats` begins with these marks."""

EXTENSION_MARKS: Mapping[Reader, tuple[bytes, ...]] = {
    "vectornav": (b"$VN",),
    "ubx": (b"\xb5\x62",),
    "novatel": (b"%RAWIMU", b"#RAWIMU"),
    "ulog": (b"ULog\x01\x12\x35",),
    "dataflash": (b"\xa3\x95\x80\x80",),
    "rosbag": (b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0"),
}
"""The readers of the extension ``formats`` and their files, for the error where it is missing."""


def find_other_format(begin: bytes) -> OtherFormat | None:
    """Return the unsupported format that the first bytes of a file show, or None."""
    return next((each for each in OTHER_FORMATS if begin.startswith(each.marks, each.place)), None)

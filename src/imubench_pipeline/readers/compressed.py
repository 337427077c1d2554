"""Read the bytes of a log that may be compressed or in an archive, recognised by content."""

import bz2
import io
import lzma
import re
import stat
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import IO, Any

from imubench_pipeline.readers import bounds
from imubench_pipeline.readers.holes import FileWithoutHoles, ZeroRuns
from imubench_pipeline.settings.validation import cut
from imubench_pipeline.tables.findings import Finding, RecordingError, find
from imubench_pipeline.words.findings.files import TruncatedFile

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_READ_BLOCK = 1 << 16


class _CompressedParts:
    """The decompressed bytes of consecutive parts; refuses millions of nearly empty ones."""

    def __init__(self, file: FileWithoutHoles, new: Callable[[], Any]) -> None:
        self._file = file
        self._new = new
        self._part = new()
        self._parts = 1
        self._size = 0

    def read1(self, size: int) -> bytes:
        while True:
            begins = self._part.eof
            packed = self._part.unused_data if begins else b""
            if not packed and (begins or self._part.needs_input):
                packed = self._file.read(_READ_BLOCK)
            if begins:
                while packed and not (packed := packed.lstrip(b"\0")):
                    packed = self._file.read(_READ_BLOCK)
                if not packed:
                    return b""
                self._part = self._new()
                if (
                    self._parts >= bounds.MAX_UNCHECKED_PARTS
                    and self._size < bounds.MIN_MEAN_PART * self._parts
                ):
                    raise OSError(
                        f"{self._parts} compressed parts have {self._size} bytes, expected more "
                        f"than {bounds.MIN_MEAN_PART} per part"
                    )
                self._parts += 1
            try:
                block: bytes = self._part.decompress(packed, size)
            except (OSError, EOFError, lzma.LZMAError, zlib.error, zstd.ZstdError) as error:
                why = "the compressed data are followed by other data" if begins else error
                raise OSError(str(why)) from None
            if block:
                self._size += len(block)
                return block
            if not packed and not self._part.eof:
                raise EOFError

    def close(self) -> None:
        self._file.close()


class _GzipDecompressor:
    """Decompressor of one member of gzip, with the interface of bz2 and lzma."""

    def __init__(self) -> None:
        self._inflate = zlib.decompressobj(zlib.MAX_WBITS | 16)

    @property
    def eof(self) -> bool:
        return self._inflate.eof

    @property
    def unused_data(self) -> bytes:
        return self._inflate.unused_data

    @property
    def needs_input(self) -> bool:
        return not self._inflate.unconsumed_tail

    def decompress(self, packed: bytes, most: int) -> bytes:
        return self._inflate.decompress(self._inflate.unconsumed_tail + packed, most)


def unpack_zstd(data: bytes, most: int) -> bytes:
    """Return at most ``most`` unpacked bytes of a zstd frame; `ValueError` if it is corrupt."""
    try:
        return _create_zstd().decompress(data, most)
    except zstd.ZstdError as error:
        raise ValueError(str(error)) from None


def _create_zstd() -> zstd.ZstdDecompressor:
    return zstd.ZstdDecompressor(
        options={zstd.DecompressionParameter.window_log_max: bounds.MAX_WINDOW.bit_length() - 1}
    )


DECOMPRESSORS: Mapping[str, Callable[[], Any]] = {
    "gzip": _GzipDecompressor,
    "zstd": _create_zstd,
    # The memory for the dictionary that a file requests is allocated before the first byte.
    "xz": partial(lzma.LZMADecompressor, memlimit=bounds.MAX_WINDOW),
    "bzip2": bz2.BZ2Decompressor,
}
"""Function that makes the decompressor of one part of a file, by compression."""

_MAGIC = re.compile(
    rb"(?P<gzip>\x1f\x8b\x08[\0-\x1f])|(?P<zstd>\x28\xb5\x2f\xfd)|(?P<xz>\xfd7zXZ\0)"
    rb"|(?P<bzip2>BZh[1-9](?:1AY&SY|\x17rE8P\x90|.{0,5}\Z))",
    re.DOTALL,
)
MAX_MAGIC_LENGTH = 10  # bytes of a signature; shorter ones would match random bytes


def recognise_compression(begin: bytes) -> str:
    """Return the compression (a key of `DECOMPRESSORS`) by the first bytes; empty if none."""
    magic = _MAGIC.match(begin[:MAX_MAGIC_LENGTH])
    return "" if magic is None else magic.lastgroup or ""


_PROBE_BYTES = 1 << 12
_SCAN_BLOCK = 1 << 20
_ZIP_LOCAL = b"PK\x03\x04"
_ZIP_EMPTY = b"PK\x05\x06"
_ZIP_HEADER = struct.Struct("<4sHHHHHIIIHH")
_ZIP_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
_OTHER_METHODS = {9: "deflate64", 12: "bzip2", 14: "LZMA", 93: "zstd", 95: "xz", 98: "PPMd"}
_FLAG_ENCRYPTED, _FLAG_SIZE_FOLLOWS, _FLAG_UTF_8 = 1, 8, 0x800
_MAX_MEMBER_NAME = 512
_MAX_HEADER = _ZIP_HEADER.size + _MAX_MEMBER_NAME
_UNKNOWN_SIZE = 1 << 62


class Bytes:
    """The decompressed bytes of a log.

    ``name``: of the log, for messages. ``size``: number of compressed bytes. ``under``: streams
    that are closed with ``stream``.
    """

    def __init__(self, name: str, stream: Any, size: int, under: tuple[Any, ...] = ()) -> None:
        self.name = name
        self.ended_early = False  # whether the compressed data are truncated
        self._stream = stream
        self._streams = (stream, *under)
        self._left = max(bounds.MIN_CHECKED_EXPANSION, bounds.MAX_EXPANSION_RATIO * size)

    def read(self, size: int) -> bytes:
        """Return the next bytes, at most ``size``; empty at the end. RecordingError if corrupt."""
        try:
            # Not `read`, which discards the data before an early end.
            block: bytes = self._stream.read1(size)
        except EOFError:
            self.ended_early = True
            return b""
        except _CORRUPT_DATA_ERRORS as error:
            raise _make_corrupt_error(self.name, error) from None
        self._left -= len(block)
        if self._left < 0:
            raise RecordingError(
                f"{self.name}: expands to more than {bounds.MAX_EXPANSION_RATIO} times its size, "
                "which no log does; expected compressed text: unpack it and check its content"
            )
        return block

    def filled(self, size: int) -> bytes:
        """Return the next ``size`` bytes; fewer only at the end."""
        blocks: list[bytes] = []
        while size > 0 and (block := self.read(size)):
            blocks.append(block)
            size -= len(block)
        return b"".join(blocks)

    @property
    def omitted(self) -> int:
        """Number of zero bytes in holes of the log that were skipped so far."""
        return self._stream.omitted if isinstance(self._stream, FileWithoutHoles) else 0

    def close(self) -> None:
        """Close the file."""
        for stream in self._streams:
            stream.close()


class _DeflatedMember:
    """A deflated file in an archive; unlike the library, it returns all data of a truncated one."""

    def __init__(self, file: IO[bytes], info: zipfile.ZipInfo) -> None:
        self._file = file
        self._left = info.compress_size
        self._size = info.file_size
        self._expected: int | None = info.CRC
        self._crc = zlib.crc32(b"")
        self._inflate = zlib.decompressobj(-zlib.MAX_WBITS)

    def read1(self, size: int) -> bytes:
        while not self._inflate.eof:
            packed = self._inflate.unconsumed_tail
            if not packed:
                packed = self._file.read(min(_READ_BLOCK, self._left))
                self._left -= len(packed)
            block = self._inflate.decompress(packed, size)
            if block:
                self._crc = zlib.crc32(block, self._crc)
                self._size -= len(block)
                if self._size < 0:
                    raise zipfile.BadZipFile("more data than stated in the directory")
                return block
            if not packed and not self._inflate.eof:
                raise EOFError
        if self._expected not in (None, self._crc):
            raise zipfile.BadZipFile("wrong checksum")
        return b""

    def close(self) -> None:
        self._file.close()


_UNSUPPORTED_COMPRESSIONS: Mapping[bytes, str] = {
    b"7z\xbc\xaf\x27\x1c": "7z",
    b"Rar!\x1a\x07": "rar",
    b"\x04\x22\x4d\x18": "lz4",
    b"\x1f\x9d\x90": "compress",
    _ZIP_LOCAL: "zip with another compression method",
}

_CORRUPT_DATA_ERRORS = (OSError, ValueError, zlib.error, lzma.LZMAError, zipfile.BadZipFile,
                        RuntimeError, struct.error, MemoryError)  # fmt: skip
"""Exceptions of the libraries for data that violate their format."""


def _make_corrupt_error(name: str, error: Exception) -> RecordingError:
    if isinstance(error, RecordingError):
        return error
    return RecordingError(f"{name}: corrupt compressed data ({str(error)[:300]}); copy it again")


def open_bytes(path: Path) -> Bytes:
    """Open a log, perhaps compressed or a member of a zip archive, or raise RecordingError."""
    archive = None if path.is_file() else _find_archive(path)
    try:
        with ExitStack() as stack:  # closes the file if it cannot be read
            if archive is None:
                log = stack.enter_context(closing(FileWithoutHoles(path)))
                begin = log.read(MAX_MAGIC_LENGTH)
                log.rewind()
                for magic, kind in _UNSUPPORTED_COMPRESSIONS.items():
                    if begin.startswith(magic):
                        raise RecordingError(
                            f"{path.name}: is compressed with {kind}; expected gzip, zstd, xz, "
                            "bzip2 or zip: unpack it"
                        )
                if how := recognise_compression(begin):
                    stream = _CompressedParts(log, DECOMPRESSORS[how])
                    opened = Bytes(path.name, stream, path.stat().st_size, (log,))
                else:
                    opened = Bytes(path.name, log, _UNKNOWN_SIZE)
            else:
                file = stack.enter_context(archive.open("rb"))
                opened = _open_member(archive, path.relative_to(archive).as_posix(), file)
            stack.pop_all()
            return opened
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be opened ({error.strerror})") from None


def is_archive(path: Path) -> bool:
    """Return whether a path is a zip archive; named pipes, which may block, are not opened."""
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return file.read(4) in (_ZIP_LOCAL, _ZIP_EMPTY)
    except OSError:
        return False


def is_member(path: Path) -> bool:
    """Return whether a path is a member of an archive: one of its parents is a file."""
    return not path.exists() and _find_archive(path) is not None


def list_members(archive: Path) -> list[Path]:
    """Return the visible files of a zip archive, sorted, as its path followed by their names."""
    return sorted(archive / name for name in _list_directory(archive) if is_visible(Path(name)))


def is_visible(path: Path) -> bool:
    """Return whether no part of a path within a folder is hidden (``.name``, ``__MACOSX``)."""
    return not any(part.startswith((".", "__MACOSX")) for part in path.parts)


def _find_archive(path: Path) -> Path | None:
    return next((parent for parent in path.parents if parent.is_file()), None)


def holds_text(path: Path) -> bool:
    """Return whether a file or a member of an archive begins like text."""
    with closing(open_bytes(path)) as stream:
        begin = stream.read(_PROBE_BYTES)
    return b"\0" not in begin or begin.startswith((b"\xff\xfe", b"\xfe\xff"))


def _list_directory(archive: Path) -> Mapping[str, zipfile.ZipInfo]:
    """Return the members of an archive by name, also of a truncated archive."""
    try:
        state = archive.stat()
    except OSError as error:
        raise RecordingError(f"{archive.name}: cannot be opened ({error.strerror})") from None
    return _read_directory(archive, state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=2)
def _read_directory(archive: Path, _size: int, _written: int) -> Mapping[str, zipfile.ZipInfo]:
    """Return the members of an archive by name; cached by size and time of writing."""
    try:
        try:
            with open_archive(archive) as file:
                members = file.infolist()
        except zipfile.BadZipFile:
            members = _scan_for_members(archive)
    except OSError as error:
        raise RecordingError(f"{archive.name}: cannot be opened ({error.strerror})") from None
    except _CORRUPT_DATA_ERRORS as error:
        raise _make_corrupt_error(archive.name, error) from None
    by_name: dict[str, zipfile.ZipInfo] = {}
    for info in members:
        if not 0 < len(info.filename) <= _MAX_MEMBER_NAME or info.is_dir():
            continue
        # An absolute name would lead out of the archive.
        name = Path(info.filename.lstrip("/")).as_posix()
        other = by_name.setdefault(name, info)
        if other is not info and is_visible(Path(name)):
            raise RecordingError(
                f"{archive.name}: {_describe_member(other)} and {_describe_member(info)} have the "
                "same name; expected each name once: pack it again with unique names"
            )
    return by_name


def _describe_member(info: zipfile.ZipInfo) -> str:
    size = "unknown size" if info.file_size == _UNKNOWN_SIZE else f"{info.file_size} bytes"
    return f"{cut(info.filename, str)} ({size}, at byte {info.header_offset})"


@contextmanager
def open_archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a zip archive; raise `RecordingError` if its directory exceeds `MAX_DIRECTORY`."""
    with _Archive(path) as file, zipfile.ZipFile(file) as archive:
        file.most = None
        yield archive


class _Archive(io.FileIO):
    """An archive file that limits the size of the directory, which the library reads at once."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "rb")
        self._shown = path.name
        self.most: int | None = bounds.MAX_DIRECTORY

    def read(self, size: int | None = -1) -> bytes:
        if self.most is not None and size is not None and size > self.most:
            raise RecordingError(
                f"{self._shown}: the directory of the archive has {size} bytes, for about "
                f"{size // 60} files; expected at most {self.most} bytes: pack only the log"
            )
        return super().read(-1 if size is None else size)


def _scan_for_members(archive: Path) -> list[zipfile.ZipInfo]:
    """Return the members of a truncated archive, whose directory at the end is missing."""
    members: list[zipfile.ZipInfo] = []
    with closing(FileWithoutHoles(archive)) as file:
        data, ended = b"", False
        while not ended:
            block = file.read(_SCAN_BLOCK)
            ended = not block
            data += block
            start = file.tell() - len(data)
            at = data.find(_ZIP_LOCAL)
            while at >= 0 and (ended or at + _MAX_HEADER <= len(data)):
                members += _parse_local_header(data[at : at + _MAX_HEADER], start + at)
                at = data.find(_ZIP_LOCAL, at + 1)
            if len(members) > bounds.MAX_MEMBERS and not ended:
                raise RecordingError(
                    f"{archive.name}: the archive is cut short and has more than "
                    f"{bounds.MAX_MEMBERS} files; expected a complete archive: pack only the log"
                )
            data = data[at if at >= 0 else max(len(data) - 3, 0) :]
    return members


def _parse_local_header(begin: bytes, offset: int) -> list[zipfile.ZipInfo]:
    """Return the member whose local header is at the beginning; empty if there is none."""
    if len(begin) < _ZIP_HEADER.size:
        return []
    _, version, flags, method, _, _, crc, packed, size, name_size, _ = _ZIP_HEADER.unpack(
        begin[: _ZIP_HEADER.size]
    )
    name = begin[_ZIP_HEADER.size :][:name_size].decode(
        "utf-8" if flags & _FLAG_UTF_8 else "cp437", "replace"
    )
    if (
        (version & 0xFF) > 63
        or method not in _ZIP_METHODS
        or not 0 < name_size == len(begin[_ZIP_HEADER.size :][:name_size])
        or not name.isprintable()
    ):
        return []
    info = zipfile.ZipInfo(name)
    info.header_offset, info.compress_type, info.flag_bits = offset, method, flags
    info.orig_filename = name
    if flags & _FLAG_SIZE_FOLLOWS or 0xFFFFFFFF in (packed, size):
        # Deflated data mark their own end.
        info.compress_size = info.file_size = _UNKNOWN_SIZE
        info.CRC = None  # type: ignore[assignment]  # zipfile checks none then; its types know none
    else:
        info.compress_size, info.file_size, info.CRC = packed, size, crc
    return [info]


def _open_member(archive: Path, name: str, file: IO[bytes]) -> Bytes:
    shown = f"{archive.name}/{name}"
    info = _list_directory(archive).get(name)
    if info is None:
        raise RecordingError(f"{shown}: is not in the archive, or cut short; pack it again")
    if info.flag_bits & _FLAG_ENCRYPTED:
        raise RecordingError(f"{shown}: is encrypted; unpack the archive with its password")
    if stat.S_ISLNK(info.external_attr >> 16):
        raise RecordingError(f"{shown}: is a link; expected the log itself: pack it again")
    if info.compress_type not in _ZIP_METHODS:
        method = _OTHER_METHODS.get(info.compress_type, "unknown")
        raise RecordingError(
            f"{shown}: is packed by method {info.compress_type} ({method}); expected deflate or "
            "no compression: unpack the archive"
        )
    try:
        file.seek(info.header_offset)
        header = _ZIP_HEADER.unpack(file.read(_ZIP_HEADER.size))
        if header[0] != _ZIP_LOCAL:
            raise zipfile.BadZipFile("no header at the position that the directory states")
        file.seek(header[9] + header[10], io.SEEK_CUR)
        deflated = info.compress_type == zipfile.ZIP_DEFLATED
        stream = _DeflatedMember(file, info) if deflated else zipfile.ZipExtFile(file, "r", info)
    except _CORRUPT_DATA_ERRORS as error:
        raise _make_corrupt_error(shown, error) from None
    except NotImplementedError as error:
        raise RecordingError(f"{shown}: {error}; unpack the archive") from None
    return Bytes(shown, stream, min(info.compress_size, archive.stat().st_size), (file,))


BLOCK_BYTES = 1 << 20


def blocks(path: Path, findings: list[Finding], least_zeros: int) -> Iterator[bytes]:
    """Yield the bytes of a log, compressed or not, in blocks of about `BLOCK_BYTES`.

    Findings about truncated data, and about runs of ``least_zeros`` or more zero bytes, are added
    to ``findings``. Raises `RecordingError` if the file cannot be opened, or is corrupt.
    """
    zeros = ZeroRuns(least_zeros)
    with closing(open_bytes(path)) as stream:
        while block := stream.filled(BLOCK_BYTES):
            zeros.add(block)
            yield block
            if len(block) < BLOCK_BYTES:
                break
    if stream.ended_early:
        findings.append(make_truncation_finding(path))
    total = zeros.count + stream.omitted
    if (finding := zeros.finding(path.name, f"byte {zeros.first[0]}", total)) is not None:
        findings.append(finding)


def make_truncation_finding(path: Path) -> Finding:
    """Return the finding about a log with truncated compressed data."""
    return find(TruncatedFile(path.name, "compressed"), "warning", 1)

"""The bytes of a text log, decompressed, up to the last complete line."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.findings import Finding
from imubench_pipeline.readers.batch import RecordingError

_GZIP_MAGIC = b"\x1f\x8b"
_OTHER_COMPRESSION = {
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\xfd7zXZ\x00": "xz",
    b"BZh": "bzip2",
    b"PK\x03\x04": "zip",
}
_LONGEST_LINE = 1 << 20


def open_text(path: Path) -> io.BufferedIOBase:
    """Open a text log for reading bytes; gzip is seen by its first bytes, not by its name.

    Raises
    ------
    RecordingError
        If the file cannot be opened, or is compressed in another way.
    """
    try:
        with path.open("rb") as raw:
            begin = raw.read(6)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be opened ({error.strerror})") from None
    for magic, kind in _OTHER_COMPRESSION.items():
        if begin.startswith(magic):
            raise RecordingError(f"{path.name}: is compressed with {kind}; unpack it, or use gzip")
    return gzip.open(path, "rb") if begin.startswith(_GZIP_MAGIC) else path.open("rb")


def first_lines(path: Path) -> Iterator[bytes]:
    """Yield the complete lines of a text log from its beginning, as far as they can be read."""
    with open_text(path) as stream:
        while True:
            try:
                line = stream.readline(_LONGEST_LINE)
            except EOFError:
                return
            except (OSError, zlib.error) as error:
                raise RecordingError(
                    f"{path.name}: corrupt compressed data ({error}); copy it again"
                ) from None
            if not line:
                return
            yield line


class CompleteLines(io.RawIOBase):
    """A stream that ends with the last complete line.

    What follows the last line break was being written when the power was cut: a record
    without its line break may have lost digits, so it is left out and noted. A compressed file
    that ends early is read as far as it goes, and noted.
    """

    def __init__(self, path: Path, stream: io.BufferedIOBase, findings: list[Finding]) -> None:
        super().__init__()
        self._path = path
        self._stream = stream
        self._findings = findings
        self._ready = b""
        self._rest = b""
        self._ended = False
        self.error: RecordingError | None = None

    def readable(self) -> bool:
        """Return True: the stream can be read."""
        return True

    def readinto(self, buffer: object) -> int:
        """Fill a buffer; 0 at the end."""
        view = memoryview(buffer)  # type: ignore[arg-type]  # any writable buffer
        while not self._ready and not self._ended:
            self._fetch(max(len(view), 1 << 16))
        taken = self._ready[: len(view)]
        self._ready = self._ready[len(taken) :]
        view[: len(taken)] = taken
        return len(taken)

    def _fetch(self, size: int) -> None:
        blocks, held = [self._rest], 0
        while held < size:
            block = self._read(size - held)
            if not block:
                self._ended = True
                break
            blocks.append(block)
            held += len(block)
        read = b"".join(blocks)
        cut = read.rfind(b"\n") + 1
        self._ready, self._rest = read[:cut], read[cut:]
        if not self._rest.strip(b"\0"):
            self._rest = b""  # what a power cut leaves of a file that was growing
        elif len(self._rest) > _LONGEST_LINE:
            self._fail(
                f"{self._path.name}: no line break in {_LONGEST_LINE} bytes; this is no text log"
            )
        if self._ended:
            self._end()

    def _read(self, size: int) -> bytes:
        try:
            # read1, for read would throw away what comes before an early end.
            return self._stream.read1(size)
        except EOFError:
            self._findings.append(
                Finding(
                    "truncated_file",
                    "warning",
                    f"{self._path.name}: the compressed file ends early; read as far as it goes",
                    1,
                )
            )
            return b""
        except (OSError, zlib.error) as error:
            self._fail(f"{self._path.name}: corrupt compressed data ({error}); copy it again")
            return b""

    def _end(self) -> None:
        if self._rest.strip(b"\0\r\n\t "):
            shown = self._rest[:60].decode("utf-8", "replace")
            self._findings.append(
                Finding(
                    "incomplete_last_record",
                    "note",
                    f"{self._path.name}: the last record has no line break and may be cut short; "
                    f"left out: {shown!r}",
                    1,
                )
            )

    def _fail(self, reason: str) -> None:
        # Kept as well as raised: a parser between us and the caller may wrap the exception.
        self.error = RecordingError(reason)
        raise self.error

"""Changes of bytes: those of damage, and those that lead deep into a parser."""

from __future__ import annotations

import gzip
import io
import random
import re
import zipfile
import zlib
from collections.abc import Callable, Sequence
from functools import reduce
from itertools import accumulate
from operator import xor

_LONGEST_SLICE = 4096
_LARGEST = 1 << 20
_EXTREMES: tuple[int, ...] = (0, 1, -1, 2, 7, 8, 127, 128, 255, 256, 32767, 32768, 65535, 65536)
_EXTREMES += (2**24, 2**31 - 1, -(2**31), 2**32 - 1, 2**62, 2**63 - 1, -(2**63), 2**64 - 1)
_TOKENS = (
    *(b'"', b'""', b"'", b",", b";", b"\t", b" ", b"|", b"#", b"//", b"%", b"\n", b"\r", b"\r\n"),
    *(
        b"\0",
        b"\0\0\0\0",
        b"\xff",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"\xc2\xb0",
        b"\x1f\x8b",
        b"PK\3\4",
    ),
    *(b"1e999", b"-1e308", b"9" * 400, b"0.0", b"-0", b"+", b"-", b".", b"1,5", b"0x1p9", b"1_0"),
    *(b"nan", b"NaN", b"inf", b"-Infinity", b"null", b"N/A", b"t", b"wx", b"az", b"$VNYMR,", b"*"),
    *(b"2024-02-30T25:61:61.999999999Z", b"1970-01-01", b"0001-01-01T00:00:00", b"23:59:60"),
    *(b"9223372036854775807", b"-9223372036854775808", b"18446744073709551616", b"1700000000000"),
)
_FIGURE = re.compile(rb"[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?")
_SENTENCE = re.compile(rb"\$([^$*\r\n]*)\*[0-9A-Fa-f]{2}")

Change = Callable[[bytearray, random.Random, Sequence[bytes]], None]


def mutated(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    """Return data with some changes, inside of their compression now and then.

    Parameters
    ----------
    data : bytes
    others : sequence of bytes
        Files that slices are taken from.
    rng : Random
    """
    if data.startswith(b"PK\3\4") and rng.random() < 0.6:
        changed = _inside_zip(data, others, rng)
    elif data.startswith(b"\x1f\x8b") and rng.random() < 0.6:
        changed = _inside_gzip(data, others, rng)
    else:
        changed = _changed(data, others, rng)
    return changed[:_LARGEST]


def _changed(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    changed = bytearray(data)
    while True:
        rng.choice(_CHANGES)(changed, rng, others)
        if rng.random() < 0.4:
            break
    if rng.random() < 0.7:
        _mend_checksums(changed)
    return bytes(changed)


def _inside_gzip(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    try:
        inside = zlib.decompressobj(31).decompress(data, _LARGEST)
    except zlib.error:
        return _changed(data, others, rng)
    return gzip.compress(_changed(inside, others, rng), 1)


def _inside_zip(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    held = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive, zipfile.ZipFile(held, "w") as packed:
            infos = [info for info in archive.infolist() if info.file_size <= _LARGEST]
            chosen = rng.choice(infos)
            for info in infos:
                inside = archive.read(info)
                if info is chosen:
                    inside = _changed(inside, others, rng)
                packed.writestr(info.filename, inside, info.compress_type)
    # What an earlier change made of the archive.
    except Exception:
        return _changed(data, others, rng)
    return held.getvalue()


# --------------------------------------------------------------------------------- changes


def _place(data: bytearray, rng: random.Random) -> int:
    # Headers stand at the beginning, and directories at the end.
    near = rng.random()
    if near < 0.2:
        return rng.randrange(min(len(data), 256) + 1)
    if near < 0.3:
        return max(len(data) - rng.randrange(256), 0)
    return rng.randrange(len(data) + 1)


def _slice(data: bytes | bytearray, rng: random.Random) -> slice:
    start = rng.randrange(len(data) + 1)
    return slice(start, start + rng.randint(1, rng.choice((1, 4, 16, 256, _LONGEST_SLICE))))


def _flip(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    if data:
        data[_place(data, rng) % len(data)] ^= 1 << rng.randrange(8)


def _set(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    if data:
        data[_place(data, rng) % len(data)] = rng.randrange(256)


def _delete(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    del data[_slice(data, rng)]


def _repeat(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    taken = bytes(data[_slice(data, rng)])
    place = _place(data, rng)
    data[place:place] = taken * rng.choice((1, 1, 2, 20))


def _splice(data: bytearray, rng: random.Random, others: Sequence[bytes]) -> None:
    other = rng.choice(others)
    place = _place(data, rng)
    if rng.random() < 0.3:
        data[place:] = other[min(place, len(other)) :]
    else:
        data[place:place] = other[_slice(other, rng)]


def _cut(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    del data[_place(data, rng) :]


def _halve(data: bytearray, _rng: random.Random, _: Sequence[bytes]) -> None:
    """Take lines, or bytes, out of the middle: what is short is read sooner."""
    lines = data.split(b"\n")
    if len(lines) > 8:
        data[:] = b"\n".join([*lines[: len(lines) // 4], *lines[-len(lines) // 4 :]])


def _number(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    size = rng.choice((1, 2, 4, 8))
    place = _place(data, rng)
    order = rng.choice(("little", "big"))
    written = (rng.choice(_EXTREMES) % (1 << 8 * size)).to_bytes(size, order)  # type: ignore[arg-type]  # choice forgets which two words they are
    data[place : place + size] = written


def _token(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    place = _place(data, rng)
    token = rng.choice(_TOKENS)
    data[place : place + rng.choice((0, 0, 1, len(token)))] = token


def _figure(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    start = _place(data, rng)
    found = _FIGURE.search(data, start, start + _LONGEST_SLICE)
    if found:
        figure = rng.choice((*_TOKENS, b"%d" % rng.choice(_EXTREMES)))
        data[found.start() : found.end()] = figure


def _line(data: bytearray, rng: random.Random, _: Sequence[bytes]) -> None:
    lines = data.split(b"\n")
    one, other = (rng.randrange(len(lines)) for _ in range(2))
    match rng.randrange(3):
        case 0:
            lines[one], lines[other] = lines[other], lines[one]
        case 1:
            lines.insert(one, lines[other])
        case _:
            del lines[one]
    data[:] = b"\n".join(lines)


_CHANGES: tuple[Change, ...] = (
    *(_flip, _flip, _set, _delete, _repeat, _splice, _cut, _halve),
    *(_number, _number, _token, _token, _figure, _line),
)


# ------------------------------------------------------------------------------- checksums


def _mend_checksums(data: bytearray) -> None:
    """Make the checksums of UBX and VectorNav right again, which pass nothing that is damaged."""
    at = 0
    while (at := data.find(b"\xb5\x62", at)) >= 0:
        end = at + 8 + int.from_bytes(data[at + 4 : at + 6], "little")
        if end <= len(data):
            body = data[at + 2 : end - 2]
            data[end - 2] = sum(body) & 0xFF
            data[end - 1] = sum(accumulate(body)) & 0xFF
            at = end - 2
        at += 2
    if b"$VN" in data:
        data[:] = _SENTENCE.sub(lambda m: b"$%b*%02X" % (m[1], reduce(xor, m[1], 0)), data)

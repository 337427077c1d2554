"""Extract UBX messages from the bytes of a u-blox receiver, and verify their checksums."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

_SYNC_BYTES = b"\xb5\x62"
_OVERHEAD = 8  # bytes of a message without its payload: sync, class and id, length, checksum
_MESSAGE_CLASSES = frozenset(
    b"\x01\x02\x03\x04\x05\x06\x09\x0a\x0b\x0c\x0d\x10\x13\x21\x27\x28\x2a"
)
"""Classes that u-blox uses; any other byte after the sync bytes is no message."""


class Frames:
    """Iterator over UBX messages in blocks of bytes: class and id, and payload.

    After a damaged message the search continues after its sync bytes, since its length may be
    wrong. ``right``, ``wrong``, ``cut``: number by class and id that are valid, have a wrong
    checksum, or extend beyond the end. ``read``: bytes so far.
    """

    def __init__(self, source: Iterator[bytes]) -> None:
        self._source = source
        self.right: Counter[bytes] = Counter()
        self.wrong: Counter[bytes] = Counter()
        self.cut: Counter[bytes] = Counter()
        self.read = 0

    def kinds(self) -> str:
        """Return the class and id of the most frequent messages, with their numbers, as text."""
        most = self.right.most_common(10)
        return ", ".join(f"{key.hex(' ')} ({count})" for key, count in most) or "none"

    def __iter__(self) -> Iterator[tuple[bytes, bytes]]:
        data, ended = b"", False
        while not ended:
            block = next(self._source, b"")
            ended = not block
            self.read += len(block)
            data += block
            # Sums of all bytes before each position, and sums of these, modulo 256. The checksum of
            # a message (8-bit Fletcher) is a difference of them: false sync bytes cost no time.
            sums = np.cumsum(np.frombuffer(data, np.uint8), dtype=np.uint8)
            first = b"\0" + sums.tobytes()
            second = b"\0" + np.cumsum(sums, dtype=np.uint8).tobytes()
            at = 0
            while (sync := data.find(_SYNC_BYTES, at)) >= 0:
                at = sync
                if len(data) > at + 2 and data[at + 2] not in _MESSAGE_CLASSES:
                    at += 2
                    continue
                end = at + _OVERHEAD + int.from_bytes(data[at + 4 : at + 6], "little")
                if end > len(data):
                    if not ended:
                        break
                    self.cut[data[at + 2 : at + 4]] += 1
                    at += 2
                    continue
                body, key = at + 2, data[at + 2 : at + 4]
                right = (first[end - 2] - first[body]) & 0xFF == data[end - 2]
                over = second[end - 2] - second[body] - (end - 2 - body) * first[body]
                if right and over & 0xFF == data[end - 1]:
                    self.right[key] += 1
                    at = end
                    yield key, data[body + 4 : end - 2]
                else:
                    self.wrong[key] += 1
                    at += 2
            else:
                # The last byte may be the first byte of the next message.
                at = max(at, len(data) - 1)
            data = data[at:]

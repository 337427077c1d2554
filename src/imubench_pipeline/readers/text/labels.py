"""Lines of labels and values, ``gx:0.01,gy:0.02``, as the serial plotter of Arduino takes them."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

_NUMBER = r"(?:[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|inf|ovf)"
_PAIR = re.compile(
    rf"[\s,;|]*+([^\W\d][^:=,;|\t]{{0,39}}?)\s*[:=]\s*({_NUMBER})(?=[\s,;|]|$)", re.IGNORECASE
)
_STAMP = re.compile(r"\s*(\d\d:\d\d:\d\d[.,]\d{1,6}) -> ?")  # of the monitor of Arduino
_MIN_SHARE = 0.5  # of the lines
_SEPARATORS = " ,;|\t\r\n"
STAMP_NAME = "time"


@dataclass(frozen=True)
class Labels:
    """The labels before the values of each record, in order."""

    names: tuple[str, ...]
    stamped: bool  # the time of day is before each record

    @property
    def header(self) -> str:
        """Names of the columns as a line of CSV."""
        return ",".join([STAMP_NAME] * self.stamped + list(self.names))

    @cached_property
    def pattern(self) -> re.Pattern[bytes]:
        """Pattern of a record, with a group for each value."""
        pair = rb"%s[ \t]*+[:=][ \t]*+([^,;|\t\r\n :=]*+)"
        pairs = [pair % re.escape(name.encode()) for name in self.names]
        stamp = rb"(\d\d:\d\d:\d\d[.,]\d{1,6}) -> ?" if self.stamped else b""
        joined = rb"[ ,;|\t][ ,;|\t]*+".join(pairs)
        return re.compile(rb"^[ \t]*+" + stamp + rb"[ ,;|\t]*+" + joined + rb"[ ,;|\t]*+\r?$", re.M)

    def remove(self, lines: bytes) -> bytes:
        """Return the lines with each record as CSV, without labels; other lines are unchanged."""
        count = len(self.names) + self.stamped
        return self.pattern.sub(b",".join(rb"\%d" % (n + 1) for n in range(count)), lines)


def find_labels(lines: Sequence[str]) -> Labels | None:
    """Return the labels that most lines have in common; None if most have none, or too many."""
    counts: Counter[Labels] = Counter()
    for line in lines:
        stamp = _STAMP.match(line)
        at = 0 if stamp is None else stamp.end()
        names = []
        while (pair := _PAIR.match(line, at)) is not None:
            names.append(pair[1].strip())
            at = pair.end()
        if names and not line[at:].strip(_SEPARATORS) and len(set(names)) == len(names) < 100:
            counts[Labels(tuple(names), stamp is not None)] += 1
    if not counts:
        return None
    labels, number = counts.most_common(1)[0]
    return labels if number > _MIN_SHARE * len(lines) else None


def find_sentence(lines: Sequence[str]) -> str | None:
    """Return one of the lines if most are sentences for people, such as ``Temp: 21.5 C``; or None.

    Example programs print such lines: one quantity on each, with its unit.
    """
    found = []
    for line in lines:
        stamp = _STAMP.match(line)
        if _PAIR.match(line, 0 if stamp is None else stamp.end()):
            found.append(line)
    present = sum(bool(_STAMP.sub("", line).strip()) for line in lines)
    return found[-1] if len(found) > _MIN_SHARE * present else None

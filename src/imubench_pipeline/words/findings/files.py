"""Findings about files: what was not read, states another unit, or was rejected."""

from typing import Literal

from imubench_pipeline.words.findings import base
from imubench_pipeline.words.numbers import counted, duration_text, join_names, number_text


class Rejected(base.FindingData, affects=base.ALL, doubt="the recording was rejected"):
    """A recording that cannot be used."""

    reason: str

    def text(self, channel: str) -> str:
        return self.reason


class Failed(base.FindingData, affects=base.ALL, doubt="the analysis failed"):
    """A recording that is left out, because a step failed."""

    reason: str

    def text(self, channel: str) -> str:
        return (
            f"{self.reason.rstrip('.')}. The recording is left out, and tried again by the next run"
        )


class WarmUpTrimmed(base.FindingData, affects=base.NONE):
    """A warm-up that is left out."""

    end: float

    def text(self, channel: str) -> str:
        return (
            f"The first {number_text(self.end, 5)} s, a warm-up, are left out "
            "(quality.trim_warm_up)"
        )


class PartAtRest(base.FindingData, affects=base.NONE):
    """Only the longest part at rest is analysed."""

    start: float
    end: float

    def text(self, channel: str) -> str:
        return (
            "The sensor was moved. Only its longest rest is analysed, "
            f"{number_text(self.start, 5)} to {number_text(self.end, 5)} s (quality.at_rest)"
        )


class ShortRecording(base.FindingData, affects=base.SLOW, doubt="the recording is short"):
    """A recording that is too short for slow noise."""

    duration: float

    def text(self, channel: str) -> str:
        return (
            f"The recording lasts {duration_text(self.duration)}. This is enough for white noise, "
            "but bias instability and random walk take hours"
        )


class Knocks(base.FindingData, affects=base.WHITE, doubt="knocks in {channels}"):
    """Short disturbances, which are left out."""

    knocks: int
    sigmas: float  # size of the largest knock, standard deviations of the noise
    times: tuple[float, ...]  # positions of the first knocks, s
    samples: int  # samples that are left out

    def text(self, channel: str) -> str:
        at = ", ".join(number_text(time, 5) for time in self.times)
        more = ", ..." if self.knocks > len(self.times) else ""
        samples = counted(self.samples, "sample", "samples")
        return (
            f"{base.channel_name(channel)} has {counted(self.knocks, 'knock')}, up to "
            f"{number_text(self.sigmas, 3)} standard deviations (at {at}{more} s). {samples} about "
            f"{'it' if self.knocks == 1 else 'them'} {'is' if self.samples == 1 else 'are'} left "
            "out"
        )


class SimulatedByMark(
    base.FindingData,
    affects=base.NONE,
    doubt="the log is marked as simulated, and the notes say that it is not",
):
    """The notes contradict the mark of a simulated log."""

    file: str

    def text(self, channel: str) -> str:
        return (
            f"The notes say 'simulated: false', but {self.file} has the mark of a simulated log, "
            "and is treated as simulated. Remove the key from the notes, or the mark if it is wrong"
        )


class UnusedFiles(base.FindingData, affects=base.NONE):
    """Files of a folder from which no channel is read."""

    files: tuple[str, ...]  # the first of these files
    number: int  # number of all these files
    folder: str

    def text(self, channel: str) -> str:
        more = self.number - len(self.files)
        names = join_names([*self.files, *([f"{more} more"] if more else [])])
        return (
            f"No channel is read from {names}. Name the file of a channel with 'file:' in the "
            f"sensor file. Notes belong beside the folder, as {self.folder}.yaml"
        )


class UnequalLength(base.FindingData, affects=base.NONE, doubt="files may be cut short"):
    """Files without time stamps that have different numbers of samples."""

    files: tuple[str, ...]
    samples: tuple[int, ...]

    def text(self, channel: str) -> str:
        lengths = zip(self.files, self.samples, strict=True)
        listed = join_names(
            [f"{counted(samples, 'sample')} in {file}" for file, samples in lengths]
        )
        return (
            f"Files without time stamps differ in length: {listed}. The shorter ones may "
            "be cut short"
        )


class NotUsed(base.FindingData, affects=base.NONE):
    """Samples outside of the part to use."""

    file: str
    samples: int

    def text(self, channel: str) -> str:
        return (
            f"{self.file}: {counted(self.samples, 'sample lies', 'samples lie')} outside the part "
            "to use"
        )


class UnitContradicts(
    base.FindingData,
    affects=frozenset(base.POWERS_OF_UNIT),
    unfit=True,
    scales=base.POWERS_OF_UNIT,
    doubt="the unit of measurement of {channels} contradicts the file",
):
    """Log and sensor file state different units."""

    file: str
    in_log: str
    where: str  # place of the unit in the log
    in_sensor_file: str
    scale: float  # scale in the sensor file
    factor: float  # unit of the log divided by the unit that is used

    def text(self, channel: str) -> str:
        scaled = "" if self.scale == 1.0 else f", times {number_text(self.scale)}"
        return (
            f"{self.file} states {self.in_log} for {base.channel_name(channel)} ({self.where}). "
            f"The sensor file states {self.in_sensor_file}{scaled} (log.channels.{channel}.unit), "
            "which is used. If the log is right, multiply the values by "
            f"{number_text(self.factor, 5)}. Correct the one that is wrong"
        )


class ZeroBytes(base.FindingData, affects=base.ALL, doubt="the file has zero bytes"):
    """Runs of zero bytes, which are left out."""

    file: str
    zeros: int
    places: int
    first: str  # place of the first run: ``line 3``
    is_at_end: bool  # they are the end of the file
    damaged_lines: int = 0  # lines with zeros between their letters
    is_shifted: bool = False  # later samples are shifted in time, since no stamps are read

    def text(self, channel: str) -> str:
        zeros = f"{self.file}: {counted(self.zeros, 'zero byte')}"
        if self.is_at_end:
            return (
                f"{zeros} from {self.first} to the end of the file; left out. The logger reserved "
                "space, or lost its power"
            )
        where = f"in {self.first}"
        if self.places > 1:
            where = f"in {self.places} places, the first in {self.first}"
        text = f"{zeros} {where}; left out"
        if self.damaged_lines:
            lines = counted(self.damaged_lines, "line that has", "lines that have")
            text += f", with the text of {lines} them"
        if self.is_shifted:
            text += ". State 'time': without it, all later samples are shifted in time"
        return text


class TruncatedFile(base.FindingData, affects=base.NONE, doubt="the end of the file is missing"):
    """A file without its end, or with records in a journal beside it."""

    file: str
    what: Literal["compressed", "bag", "journal"]
    journal: str = ""

    def text(self, channel: str) -> str:
        if self.what == "journal":
            return (
                f"{self.file}: {self.journal} has records that are not yet in the bag and are not "
                "read. Merge them with sqlite3 and 'pragma wal_checkpoint'"
            )
        what = "the compressed file ends early"
        if self.what == "bag":
            what = "the bag was not closed"
        return f"{self.file}: {what}; read as far as possible"


class LateRecords(base.FindingData, affects=base.NONE):
    """Records that were written after records with later stamps, and sorted."""

    file: str
    records: int
    delay: float  # longest delay, s

    def text(self, channel: str) -> str:
        return (
            f"{self.file}: {counted(self.records, 'record is', 'records are')} written after later "
            f"ones, by up to {number_text(self.delay, 3)} s; sorted by time"
        )


class IncompleteLastRecord(base.FindingData, affects=base.NONE):
    """A last record that is cut short, and left out."""

    file: str
    shown: str | None = None  # its first letters, if it has no line break
    has_checksum: bool = False  # its kind has a checksum, which is wrong
    columns: int | None = None  # number of its columns
    expected: int | None = None  # number of columns of a whole record
    messages: int | None = None  # number of messages that are cut short
    message: str = ""  # name of these messages

    def text(self, channel: str) -> str:
        if self.messages is not None:
            number = counted(self.messages, f"{self.message} message")
            verb = "is" if self.messages == 1 else "are"
            return f"{self.file}: {number} {verb} cut short by the end of the log; left out"
        if self.columns is not None:
            return (
                f"{self.file}: the last record has {self.columns} of {self.expected} columns; left "
                "out"
            )
        why = "the last record has no line break and may be cut short"
        if self.has_checksum:
            why = "the last line has no line break and no right checksum"
        return f"{self.file}: {why}; left out: {self.shown!r}"


class IncompleteFirstRecord(base.FindingData, affects=base.NONE):
    """First lines that are only parts of records, and are left out."""

    file: str
    lines: int
    first: int  # number of the first line
    shown: str  # its first letters

    def text(self, channel: str) -> str:
        return (
            f"{self.file}: {counted(self.lines, 'line')} from line {self.first} on "
            f"{'lacks' if self.lines == 1 else 'lack'} a part of the record; left out: "
            f"{self.shown!r}"
        )


class NotRecords(base.FindingData, affects=base.NONE):
    """Lines under the names of columns that are neither units nor records."""

    file: str
    lines: int
    first: int  # number of the first line
    shown: str  # its first letters

    def text(self, channel: str) -> str:
        verb, are = ("follows", "is") if self.lines == 1 else ("follow", "are")
        return (
            f"{self.file}: {counted(self.lines, 'line')} from line {self.first} on {verb} the "
            f"column names and {are} neither units nor records; left out: {self.shown!r}"
        )


class RestartedLog(base.FindingData, affects=base.NONE):
    """Further headers within a log, whose logger was restarted."""

    file: str
    restarts: int
    cut: int  # places where a record before the header is cut short

    def text(self, channel: str) -> str:
        cut = ""
        if self.cut:
            cut = f", after a record that is cut short in {counted(self.cut, 'place')}"
        return (
            f"{self.file}: the header appears {counted(self.restarts, 'more time')}{cut}. The "
            "logger was restarted. These lines are left out"
        )


class DamagedMessage(base.FindingData, affects=base.ALL, doubt="messages are damaged"):
    """Messages of a bag that do not match their type."""

    file: str
    messages: int
    topic: str
    is_left_out: bool  # otherwise they are missing samples

    def text(self, channel: str) -> str:
        verb = "message of {} does" if self.messages == 1 else "messages of {} do"
        return (
            f"{self.file}: {self.messages} {verb.format(self.topic)} not match "
            f"{'its' if self.messages == 1 else 'their'} type; {_fate(self.is_left_out)}"
        )


class DamagedBytes(base.FindingData, affects=base.NONE, doubt="parts of the file are damaged"):
    """Bytes of a binary log that are no message, and are left out."""

    file: str
    bytes: int

    def text(self, channel: str) -> str:
        return (
            f"{self.file}: {counted(self.bytes, 'byte is', 'bytes are')} no part of a message; "
            "left out. The file is damaged there: copy it again"
        )


class NotMeasured(base.FindingData, affects=base.ALL, doubt="messages without a measurement"):
    """Messages that state that a quantity was not measured."""

    file: str
    messages: int
    topic: str
    quantity: str

    def text(self, channel: str) -> str:
        messages = "message of {} states" if self.messages == 1 else "messages of {} state"
        return (
            f"{self.file}: {self.messages} {messages.format(self.topic)} (covariance -1) that "
            f"{self.quantity} was not measured; treated as missing samples"
        )


class WrongChecksum(base.FindingData, affects=base.ALL, doubt="messages have a wrong checksum"):
    """Messages or sentences with a wrong checksum."""

    file: str
    number: int
    name: str
    is_sentence: bool  # a line of text, which may also be cut short
    is_left_out: bool  # otherwise they are missing samples
    is_shifted: bool = False  # later samples are shifted in time, since no stamps are read

    def text(self, channel: str) -> str:
        kind = "sentence" if self.is_sentence else "message"
        number = counted(self.number, f"{self.name} {kind}")
        has = "has" if self.number == 1 else "have"
        if self.is_sentence:
            has = ("is" if self.number == 1 else "are") + f" cut short or {has}"
        text = f"{self.file}: {number} {has} a wrong checksum; {_fate(self.is_left_out)}"
        if self.is_shifted:
            text += (
                ". State 'time' (column time_tag, unit ms): without it, later samples are shifted "
                "in time"
            )
        return text


class UncheckedLogs(base.FindingData, affects=base.NONE, doubt="no checksum is right"):
    """Messages of a file that are read unchecked: at its beginning, no checksum is right."""

    file: str
    number: int
    name: str

    def text(self, channel: str) -> str:
        return (
            f"{self.file}: no checksum at the beginning is right; "
            f"{counted(self.number, f'{self.name} log')} read unchecked. Was the file edited?"
        )


class UnreadableSentence(base.FindingData, affects=base.ALL, doubt="sentences are not readable"):
    """Sentences with other fields than expected."""

    file: str
    sentences: int
    name: str
    expected: int  # numbers of a sentence

    def text(self, channel: str) -> str:
        return (
            f"{self.file}: {counted(self.sentences, f'{self.name} sentence')} "
            f"{'has' if self.sentences == 1 else 'have'} a right checksum, but not the "
            f"{self.expected} numbers expected; treated as missing samples"
        )


class OtherSentences(base.FindingData, affects=base.NONE):
    """Sentences of other kinds, which are not read."""

    file: str
    sentences: int
    names: tuple[str, ...]  # names of the first kinds

    def text(self, channel: str) -> str:
        return (
            f"{self.file}: {counted(self.sentences, 'other sentence')} ({', '.join(self.names)}) "
            "not read"
        )


class NotSentences(base.FindingData, affects=base.NONE):
    """Lines that are no sentence, and not read."""

    file: str
    lines: int

    def text(self, channel: str) -> str:
        lines = counted(self.lines, "line or part of one", "lines or parts of them")
        are = "is no sentence" if self.lines == 1 else "are no sentences"
        return f"{self.file}: {lines} {are}; not read"


def _fate(is_left_out: bool) -> str:
    return "left out" if is_left_out else "treated as missing samples"

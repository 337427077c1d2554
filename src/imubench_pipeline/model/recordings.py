"""Rows about each recording: its state, findings, doubts and failed steps."""

from typing import Annotated

from imubench_pipeline.model import states
from imubench_pipeline.model.table import OfRecordingRow, SensorRow, TableRow, table
from imubench_pipeline.model.verdicts import DoubtMark

_Channel = Annotated[str | None, "the channel concerned; null: the whole recording"]


@table("recordings", key=("sensor", "recording"))
class RecordingRow(SensorRow):
    device: Annotated[str, "specimen of the sensor; by default the recording's name"]
    recording: Annotated[str, "name of the recording"]
    kind: Annotated[str, "static, two_position, rate_table or positions"]
    started: Annotated[str | None, "date and time of the first sample, if known"] = None
    power_cycled: Annotated[bool | None, "whether the power was off before it; null: not known"] = (
        None
    )
    simulated: Annotated[bool, "simulated from known parameters, not measured"]
    status: Annotated[states.RecordingStatus, "failed: a step of its analysis failed"]
    reason: Annotated[str | None, "why a recording is rejected or failed"] = None
    rate: Annotated[float | None, "sampling rate used", "Hz"] = None
    rate_from: Annotated[str | None, "source of the rate: stamps, or stated"] = None
    rate_error: Annotated[
        float | None, "standard deviation of the rate, from the scatter of the stamps", "Hz"
    ] = None
    samples: Annotated[int | None, "number of samples present in the longest channel"] = None
    duration: Annotated[float | None, "duration from the first to the last sample", "s"] = None
    temperature_min: Annotated[float | None, "lowest temperature", "degC"] = None
    temperature_max: Annotated[float | None, "highest temperature", "degC"] = None
    fitness: Annotated[states.Fitness | None, "null: not analysed"] = None
    decides: Annotated[bool | None, "whether it is used in rankings, pools and exports"] = None
    doubts: Annotated[tuple[DoubtMark, ...], "codes and channels of doubts"] = ()


@table("files", key=("file",))
class FileRow(TableRow):
    file: Annotated[str, "path in the drop zone"]
    sensor: Annotated[str | None, "sensor; null: the file is skipped"] = None
    recording: Annotated[str | None, "recording of the file; null: the file is skipped"] = None
    status: Annotated[states.FileStatus, "outcome of the file"]
    reason: Annotated[str | None, "reason why it is not analysed"] = None


@table("doubts")
class DoubtRow(OfRecordingRow):
    channel: _Channel = None
    code: Annotated[str, "a finding; not_explained: the spectrum; doubtful: a parameter's status"]
    fitness: Annotated[states.Fitness, "unfit: the values may not belong to a sensor at rest"]
    parameters: Annotated[tuple[str, ...], "affected; empty: all"] = ()
    factor: Annotated[float | None, "possible change of a value, if known"] = None
    start: Annotated[float | None, "start of the part concerned, from the first sample", "s"] = None
    end: Annotated[float | None, "its end", "s"] = None
    reason: Annotated[str, "in words"]


@table("findings")
class FindingRow(OfRecordingRow):
    channel: _Channel = None
    finding: Annotated[str, "what was found"]
    severity: Annotated[states.Severity, "fatal: not analysed"]
    affects: Annotated[tuple[str, ...], "parameters with doubtful estimates"] = ()
    detail: Annotated[str, "description with advice"]
    value: Annotated[float | None, "its size", "as the finding says"] = None
    data: Annotated[str | None, "its data, JSON"] = None
    start: Annotated[float | None, "start of the part concerned, from the first sample", "s"] = None
    end: Annotated[float | None, "its end", "s"] = None


@table("failures")
class FailureRow(SensorRow):
    recording: Annotated[str | None, "omitted recording; null: a step of the whole sensor"] = None
    step: Annotated[str, "step of the workflow that failed"]
    cause: Annotated[states.FailureCause, "time: it exceeded its time limit"]
    reason: Annotated[str, "reason in one line; see the log of the step"]

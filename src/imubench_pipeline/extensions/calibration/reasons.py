"""Sources of the noise of a turned gyro."""

from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import counted

NO_MODEL = (
    "the noise of this sensor is not known: no static recording is usable, and its datasheet "
    "prints no noise. Add a static log of this sensor"
)


def describe_printed_noise(source: str) -> str:
    return f"typical figures ({source}). No static recording of this sensor determines its noise"


def describe_static_noise(
    recording: str,
    method: str,
    *,
    device: str | None = None,
    simulated: bool = False,
    channels: tuple[str, str] | None = None,
) -> str:
    """Return a note on the static recording that a noise model comes from.

    ``device``: device of the recording, if that is not the calibrated specimen. ``channels``: the
    channel used and the channel wanted, if the wanted one has no estimate.
    """
    words = [f"static recording {recording}"]
    if device is not None:
        words.append("of another specimen" + f", {device}" * (device != recording))
    if simulated:
        words.append("simulated")
    if channels is not None:
        used, asked = map(channel_name, channels)
        words.append(f"of its {used}, as {asked} has no estimate there")
    return f"{', '.join(words)}; method {method}"


def explain_segments(segments: int) -> str:
    """Return the reason why a log of several segments cannot be used as one."""
    return (
        f"the log has {counted(segments, 'segment')}, with gaps of unknown length between them. "
        "State one of them as 'use:' beside the log"
    )

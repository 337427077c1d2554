"""Sources and assumptions of simulated models, and of the noise that results are computed with."""

from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import counted, number_text

ONE_SIDED_DENSITY = "the printed noise density is one-sided (N is this density / √2)"
NO_BIAS_INSTABILITY = "no bias instability, as none is printed"
NO_RANDOM_WALK = "no random walk K, as none is printed"
BIAS_SIGN_DRAWN = "the sign of the bias is random"
DRIFT_SIGN_DRAWN = "drift with temperature is 0 at 25 °C, without lag, and its sign is random"
NO_DRIFT = "no drift with temperature, as no coefficient is printed"
NOT_ROUNDED = "values are not rounded, as no sensitivity is printed"
NO_SATURATION = "no saturation, as no full scale is printed"
GRAVITY_IS_NO_BIAS = "accel: no bias from the log, as the mean of a recording is mostly gravity"
NO_NOISE_MODEL = (
    "the noise of this sensor is not known: no static recording is usable, and its data sheet "
    "prints no noise. Add a static log of this sensor"
)
NOT_PRINTED_BY_SOURCE = "the source does not print it"
ESTIMATE_DOUBTFUL = "the estimate is doubtful"
NOT_SOLD = "this sensor is not sold"
SIMULATED_BESIDE_MEASURED = "it is simulated, and other recordings are measured"
IN_NO_TABLE = "it is in no table of its sensor"


def of_data_sheet(name: str, document: str | None) -> str:
    """Return the source of a model; ``document``: of the data sheet, if it is named."""
    return f"the data sheet of {name}" + (f": {document}" if document else "")


def printed_figure(
    label: str, value: float, unit: str, kind: str, reason: str | None = None
) -> str:
    text = f"{label} {number_text(value)} {unit}: {kind}, data sheet"
    return f"{text} ({reason})" if reason else text


def printed_noise(source: str) -> str:
    return (
        f"typical figures of {source}, not measured. No static recording of this sensor determines "
        "its noise"
    )


def static_noise(
    recording: str,
    method: str,
    *,
    device: str | None = None,
    simulated: bool = False,
    channels: tuple[str, str] | None = None,
) -> str:
    """Return the static recording from which a noise model is.

    ``device``: of the recording if it is another one; ``channels``: the channel that is used, and
    the channel without an estimate, if they differ.
    """
    words = [f"static recording {recording}"]
    if device is not None:
        words.append(f"of another device, {device}")
    if simulated:
        words.append("simulated")
    if channels is not None:
        used, asked = map(channel_name, channels)
        words.append(f"of its {used}, as {asked} has no estimate there")
    return f"{', '.join(words)}; method {method}"


def several_segments(segments: int) -> str:
    return (
        f"the log has {counted(segments, 'segment')}, with gaps of unknown length between them. "
        "State one of them as 'use:' beside the log"
    )


def nothing_to_simulate(reasons: list[str]) -> str:
    return f"no term has a value: {'; '.join(reasons)}"


def no_model_explains(channel: str) -> str:
    return f"no model explains the spectrum of {channel_name(channel)}"

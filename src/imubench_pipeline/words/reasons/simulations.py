"""Sources and assumptions of simulated models."""

from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import number_text

ONE_SIDED_DENSITY = "the printed noise density is one-sided (N is this density / √2)"
NO_BIAS_INSTABILITY = "no bias instability, as none is printed"
NO_RANDOM_WALK = "no random walk K, as none is printed"
BIAS_SIGN_DRAWN = "the sign of the bias is random"
DRIFT_SIGN_DRAWN = "drift with temperature is 0 at 25 °C, without lag, and its sign is random"
NO_DRIFT = "no drift with temperature, as no coefficient is printed"
NOT_ROUNDED = "values are not rounded, as no sensitivity is printed"
NO_SATURATION = "no saturation, as no full scale is printed"
GRAVITY_IS_NO_BIAS = "accel: no bias from the log, as the mean of a recording is mostly gravity"
NOT_PRINTED_BY_SOURCE = "the source does not print it"
ESTIMATE_DOUBTFUL = "the estimate is doubtful"
NOT_SOLD = "this sensor is not sold"
SIMULATED_BESIDE_MEASURED = "it is simulated, and other recordings are measured"
IN_NO_TABLE = "it is in no table of its sensor"


def of_data_sheet(name: str, document: str | None) -> str:
    """Return the source of a model; ``document``: title of the datasheet, or None."""
    return f"the datasheet of {name}" + (f": {document}" if document else "")


def printed_figure(
    label: str, value: float, unit: str, kind: str, reason: str | None = None
) -> str:
    text = f"{label} {number_text(value)} {unit}: {kind}, datasheet"
    return f"{text} ({reason})" if reason else text


def nothing_to_simulate(reasons: list[str]) -> str:
    return f"no term has a value: {'; '.join(reasons)}"


def no_model_explains(channel: str) -> str:
    return f"no model explains the spectrum of {channel_name(channel)}"

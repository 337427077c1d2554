"""Findings of the comparison of a log with the prediction of its own noise model."""

from __future__ import annotations

from imubench_pipeline.words.findings.base import SLOW, FindingData, channel_name
from imubench_pipeline.words.numbers import counted, join_names, number_text


class BacktestContradicts(
    FindingData, affects=SLOW, doubt="more drift of {channels} than its noise model predicts"
):
    """The errors over windows of the log are larger than predicted."""

    error: str  # ``attitude``, ``heading``, ``velocity`` or ``position``
    time: float  # of dead reckoning, s
    window: float | None  # at rest before it, over which the bias is estimated, s
    ratio: float  # measured over predicted error
    ratio_lower: float | None
    ratio_upper: float | None  # limits of the ratio in 95 % of logs, if the model is right
    windows: int | None
    independent: float | None  # equivalent number of independent windows
    removed: tuple[str, ...]
    """Kinds of the deterministic signals that are in the log and not in the noise."""

    def text(self, channel: str) -> str:
        rest = "" if self.window is None else f" (bias from {number_text(self.window)} s at rest)"
        removed = join_names([name.replace("_", " ") for name in self.removed])
        why = (
            f"the log contains {removed}, which is removed from the noise"
            if removed
            else "its slow noise misses an effect, such as drift with temperature"
        )
        return (
            f"{channel_name(channel)} drifts {number_text(self.ratio, 3)} times as much as "
            f"predicted: {self.error} after {number_text(self.time)} s{rest}. "
            f"In 95 % of logs a correct model gives {number_text(self.ratio_lower, 3)} to "
            f"{number_text(self.ratio_upper, 3)} times. "
            f"The log has {counted(self.windows or 0, 'window')}, equivalent to "
            f"{number_text(self.independent, 3)} independent ones. "
            f"Error budgets of this channel are too small: {why}. "
            "Multiply them by this ratio until the cause is found"
        )

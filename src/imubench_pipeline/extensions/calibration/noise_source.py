"""Choose the noise model for the weights of an Earth-rate experiment: the sensor at rest.

The log of a turned gyro does not show its noise. The model is from the longest static recording of
the same sensor, if possible of the same device, else from the typical figures of its datasheet.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from imubench_pipeline.estimators.rows import read_estimates, read_recommended_estimates
from imubench_pipeline.extensions.calibration.reasons import (
    describe_printed_noise,
    describe_static_noise,
)
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.recordings.kept import Quality, find_static_recordings
from imubench_pipeline.settings.sensor import CHANNELS, Sensor, quantity_of
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.simulate.from_datasheet import from_datasheet
from imubench_pipeline.tables.keys import Key

_DRAW_SEED = 20260101  # each recording and channel has an independent stream


@dataclass(frozen=True)
class NoiseSource:
    """A noise model and its source, SI."""

    model: NoiseModel  # the best one for the data of its source
    papers: NoiseModel  # N, B, T_B and K of the same source, for the papers' filter
    words: str  # the source
    drawn: tuple[NoiseModel, ...] = ()  # from the uncertainty of the model, if it is known


def take_static_noise(
    folders: Sequence[Path], own: RecordingRow, channel: str, draws: int = 0
) -> NoiseSource | None:
    """Return the noise of a gyro from the static recordings of its sensor in `folders`, or None.

    `own` is the recording that was turned, `channel` its gyro; another gyro of the sensor is used
    if this one has no estimate. `draws`: number of models to draw from the uncertainty of the
    estimate.
    """

    def far(row: RecordingRow) -> tuple[bool, bool]:
        return row.simulated != own.simulated, row.device != own.device

    for row, folder in find_static_recordings(folders, far):
        parameters = folder / "parameters.parquet"
        best = read_recommended_estimates(parameters, folder / "draws.parquet" if draws else None)
        gyros = [name for name in best if name.startswith("gyro_") and best[name].model.N]
        if gyros:
            name = min(gyros, key=lambda name: (name != channel, name))
            every = {estimate.method: estimate for estimate in read_estimates(parameters)[name]}
            papers = every.get("likelihood_gm", best[name]).model
            source = describe_static_noise(
                row.recording,
                best[name].method,
                device=row.device if row.device != own.device else None,
                simulated=row.simulated,
                channels=(name, channel) if name != channel else None,
            )
            rng = channel_rng(_DRAW_SEED, repr(best[name].model), name)
            drawn = tuple(draw_models(best[name], draws, rng)) if draws else ()
            return NoiseSource(best[name].model, papers, source, drawn)
    return None


@dataclass(frozen=True)
class NoiseAtRest:
    """The noise of a sensor at rest."""

    recording: str
    rate: float  # Hz
    models: dict[str, NoiseModel]  # by channel


def load_noise_at_rest(folders: Sequence[Path]) -> NoiseAtRest | None:
    """Return the noise of a sensor from its static recordings; None if none has an estimate."""
    for row, folder in find_static_recordings(folders, lambda row: (row.simulated,)):
        best = read_recommended_estimates(folder / "parameters.parquet")
        models = {name: estimate.model for name, estimate in best.items() if estimate.model.N}
        if row.rate is not None and any(name.startswith("gyro_") for name in models):
            return NoiseAtRest(row.recording, row.rate, models)
    return None


def lend_axes(channels: Collection[str]) -> dict[str, str]:
    """Return for each axis the channel whose noise model it uses: its own, or one of its quantity.

    Axes of a quantity without channels are left out.
    """
    lent = {}
    for channel in CHANNELS:
        own = [name for name in channels if quantity_of(name) == quantity_of(channel)]
        if own:
            lent[channel] = channel if channel in own else own["xyz".index(channel[-1]) % len(own)]
    return lent


def find_noise_source(
    folder: Path, static: Sequence[Path], key: Key, sensor: Sensor, draws: int = 0
) -> NoiseSource | None:
    """Return the noise of a gyro from a static recording, else from its datasheet, else None.

    `folder`: results of the turned recording; `static`: results of the static recordings of its
    sensor; `draws`: number of models drawn from the uncertainty of a static log.
    """
    own = Quality.read(folder / "quality.json").recording
    return take_static_noise(static, own, key.channel, draws) or take_printed_noise(
        key.sensor, sensor, key.channel
    )


def take_printed_noise(name: str, sensor: Sensor, channel: str) -> NoiseSource | None:
    """Return the printed noise of a gyro; None if the datasheet prints none."""
    try:
        origin = from_datasheet(name, sensor, 0)
    except ConfigError:
        return None
    if channel not in origin.imu.axes or not origin.imu.axes[channel].noise.N:
        return None
    model = origin.imu.axes[channel].noise
    return NoiseSource(model, model, describe_printed_noise(origin.source))

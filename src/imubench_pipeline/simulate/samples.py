"""Simulate samples of noise models; rate and duration may have units."""

from collections.abc import Mapping
from typing import Protocol, overload

import numpy as np

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise import simulate as noise
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_setting


class HasModel(Protocol):
    """An object with a noise model, such as an estimate."""

    @property
    def model(self) -> NoiseModel:
        """The noise model."""


@overload
def simulate(
    model: NoiseModel | HasModel,
    rate: float | str,
    samples: int | None = None,
    rng: np.random.Generator | None = None,
    *,
    duration: float | str | None = None,
    seed: int | None = None,
) -> Array: ...


@overload
def simulate(
    model: Mapping[str, NoiseModel] | Mapping[str, HasModel],
    rate: float | str,
    samples: int | None = None,
    rng: np.random.Generator | None = None,
    *,
    duration: float | str | None = None,
    seed: int | None = None,
) -> dict[str, Array]: ...


def simulate(
    model: NoiseModel | HasModel | Mapping[str, NoiseModel] | Mapping[str, HasModel],
    rate: float | str,
    samples: int | None = None,
    rng: np.random.Generator | None = None,
    *,
    duration: float | str | None = None,
    seed: int | None = None,
) -> Array | dict[str, Array]:
    """Return simulated noise.

    Parameters
    ----------
    model : NoiseModel, an estimate, or a mapping of channels to either
        All channels of a mapping, such as a result of `imubench_pipeline.estimate`, are simulated.
    rate : float or str
        Hz, or with its unit: ``"100 Hz"``.
    samples : int, optional
        Number of samples; either this or ``duration`` is needed.
    rng : numpy.random.Generator, optional
        Random generator, instead of ``seed``. Without both, the samples differ in each call.
    duration : float or str, optional
        Length of the log in s, or with its unit: ``"2 h"``.
    seed : int, optional
        The same seed gives the same samples. The channels of a mapping have independent samples,
        which do not depend on the other channels.

    Returns
    -------
    ndarray, shape (samples,), or dict of str to ndarray
        rad/s or m/s². Stationary processes start in their stationary distribution, the random
        walk and the ramp at 0, lines at a random phase; flicker noise is a bank of Gauss-Markov
        processes up to the length of the log. There is no bias and no gravity.

    Raises
    ------
    ValueError
        If rate or length cannot be used, or length or stream are given twice or not at all;
        `imubench_pipeline.units.UnitError` if a unit is not known, or of another dimension.

    Examples
    --------
    >>> import imubench_pipeline as imu
    >>> gyro = imu.NoiseModel(N=8.7e-5, B=2.4e-5, K=1e-6)  # rad/s/sqrt(Hz), rad/s, rad/s/sqrt(s)
    >>> imu.simulate(gyro, "100 Hz", duration="10 min", seed=1).shape
    (60000,)
    """
    frequency = parse_setting(rate, "frequency", "rate")
    if (samples is None) == (duration is None):
        raise ValueError(
            "expected either samples (such as 60000) or duration (such as '10 min'): "
            + ("neither is given" if samples is None else "both are given")
        )
    if duration is not None:
        samples = round(parse_setting(duration, "time", "duration") * frequency)
    if samples is None or isinstance(samples, bool) or int(samples) != samples or samples < 1:
        raise ValueError(f"samples is {samples}; expected a whole number of 1 or more")
    number = int(samples)
    if rng is not None and seed is not None:
        raise ValueError("rng and seed are both given; expected one of them")
    stream = rng or np.random.default_rng(seed)
    if not isinstance(model, Mapping):
        return noise.simulate(_require_model(model), frequency, number, stream)
    if seed is None:
        streams = stream.spawn(len(model))
    else:
        streams = [noise.channel_rng(seed, name) for name in model]
    return {
        name: noise.simulate(_require_model(each), frequency, number, own)
        for (name, each), own in zip(model.items(), streams, strict=True)
    }


def _require_model(source: object) -> NoiseModel:
    model = source if isinstance(source, NoiseModel) else getattr(source, "model", None)
    if not isinstance(model, NoiseModel):
        raise ValueError(
            f"model is {source!r}, expected a NoiseModel such as NoiseModel(N=1e-4), an estimate, "
            "or a mapping of channels to these"
        )
    return model

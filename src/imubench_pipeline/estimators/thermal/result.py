"""What temperature does to a channel, as it is told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.estimators.thermal.effect import shifted
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class ThermalFit:
    """What temperature does to a channel.

    Attributes
    ----------
    reference : float
        T_0, the mean temperature, °C.
    sensitivity, quadratic : Parameter
        s and q, SI per K and per K²; q has status ``absent`` where it is not in the model.
    lag : Parameter
        L, s.
    bias : Parameter
        Mean of the log, at T_0, SI.
    compensated : bool
        Temperature is taken out of the noise: the interval of s (or q) excludes 0, and BIC
        favours it.
    reason : str
        Why it is, or is not.
    plain, without_temperature : Likelihood
        The noise of the log as it is, and of what temperature leaves of it; the same where
        nothing is taken out.
    effect : ndarray, shape (k,)
        What temperature adds to the log at the knots of the path, SI; zeros where nothing is
        taken out.
    path : TemperaturePath
        Temperature of the log.
    """

    reference: float
    sensitivity: Parameter
    quadratic: Parameter
    lag: Parameter
    bias: Parameter
    compensated: bool
    reason: str
    plain: Likelihood
    without_temperature: Likelihood
    effect: Array
    path: TemperaturePath

    def compensate(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Return the blocks of the log less what temperature adds to it.

        Parameters
        ----------
        blocks : iterable of ndarray
            The log in order from its first sample, SI.

        Returns
        -------
        iterator of ndarray
            SI, in the shape of each block.
        """
        return shifted(blocks, self.path, self.effect, -1.0)

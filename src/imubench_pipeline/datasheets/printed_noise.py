"""The noise of a sensor by its datasheet, and by its class where the datasheet prints nothing.

A density of unknown sidedness counts as N itself. B follows from the printed minimum of the Allan
deviation, as flicker noise.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from imubench_pipeline.datasheets.class_limits import find_limit, read_sigma
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.settings.sensor import Sensor

End = Literal["in_use", "likely", "best"]
"""What counts where a sensor prints nothing: the worst, the median or the best of its class."""

WALK_TIMES: Mapping[End, float] = {"in_use": 500.0, "likely": 2000.0, "best": 9000.0}
"""Time, s, after which an unknown random walk is as large as the bias instability.

It is 529, 1,714 and 8,830 s for the parameters in Table 2 of Maia et al. (MTi-7 accelerometer,
C102-F9R accelerometer, MTi-7 gyro), and 2,067 s for those in section 5.1 of Silva et al.
(SiRRS01-03). No datasheet of the catalogue prints K.
"""

_SOURCES = {"N": "N", "B": "flicker", "K": "K"}


@dataclass(frozen=True)
class PrintedNoise:
    """Noise of a quantity by its datasheet, with class limits for figures that are not printed."""

    models: Mapping[End, NoiseModel]
    assumed: frozenset[str]  # codes of the noise sources that are not printed


def read_printed_noise(sensor: Sensor, quantity: str) -> PrintedNoise:
    """Return the noise models of a quantity that the sensor measures, by its datasheet."""
    values: dict[str, Mapping[End, float]] = {}
    assumed = set()
    for figure in ("N", "B"):
        printed = read_sigma(sensor, quantity, figure)
        if printed is None:
            limit = find_limit(sensor.grade, quantity, figure)
            values[figure] = {"in_use": limit.worst, "likely": limit.median, "best": limit.best}
            assumed.add(_SOURCES[figure])
        else:
            values[figure] = dict.fromkeys(WALK_TIMES, printed)
    walk = read_sigma(sensor, quantity, "K")
    if walk is None:
        assumed.add(_SOURCES["K"])
    models = {
        end: NoiseModel(
            N=values["N"][end],
            B=values["B"][end] / FLOOR,
            K=walk or values["B"][end] * math.sqrt(3.0 / time),
        )
        for end, time in WALK_TIMES.items()
    }
    return PrintedNoise(models, frozenset(assumed))

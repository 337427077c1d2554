"""Types that are shared by all packages."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # it takes a while to import
    from pydantic import JsonValue

Array = NDArray[np.float64]
"""Numbers in double precision, SI."""

JsonObject: TypeAlias = "Mapping[str, JsonValue]"
"""An arbitrary JSON document: a file before its validation, or the schema or dump of a model."""

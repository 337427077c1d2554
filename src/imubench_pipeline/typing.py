"""The types that every room shares."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers in double precision, SI."""

Row = Mapping[str, Any]
"""One row of a table, by column."""

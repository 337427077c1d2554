"""Files that are made to cost a reader far more than they weigh: small, and written by code."""

from tests.readers.hostile.arrays import ARRAYS
from tests.readers.hostile.attack import Attack
from tests.readers.hostile.bags import BAGS
from tests.readers.hostile.flight import FLIGHT
from tests.readers.hostile.hdf5 import HDF5
from tests.readers.hostile.packed import PACKED

ATTACKS: dict[str, Attack] = PACKED | ARRAYS | HDF5 | BAGS | FLIGHT

__all__ = ["ATTACKS", "Attack"]

"""MATLAB files: version 7.3, which is HDF5, and version 5 (-v6, -v7), both streamed.

A column is a number, the column of a matrix as MATLAB shows it, counted from 1; or the name of a
variable that is a vector. ``variable`` names the matrix; what is in a structure is ``imu/gyro``.
Tables, timetables and cells are not arrays: save ``table2array`` of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack

import h5py
import numpy as np

from imubench_pipeline.readers.arrays import hdf5, matlab_5
from imubench_pipeline.readers.arrays.file import ArrayFile
from imubench_pipeline.readers.arrays.table import Table, UnusableError

_LONGEST_CLASS = 64


class MatlabFile(ArrayFile):
    """A MATLAB file, of version 7.3 or 5."""

    def tables(self, stack: ExitStack) -> Iterable[Table]:
        """Describe every variable."""
        if h5py.is_hdf5(self.path):
            return _variables(stack.enter_context(hdf5.opened(self.path)))
        if matlab_5.is_version_5(self.path):
            return matlab_5.variables(self.path)
        raise UnusableError(
            "not a MATLAB file of version 5 or 7.3, or its beginning is damaged; save it with -v7.3"
        )


def _variables(file: h5py.File) -> list[Table]:
    """Return the variables of version 7.3: matrices lie there with time along the second side."""
    found: list[Table] = []
    # What cells, objects and sparse matrices are made of has no meaning alone.
    for data_set in hdf5.data_sets(file, time_axis=1, passed_over="#"):
        if "MATLAB_sparse" in data_set.data.parent.attrs:
            continue
        if data_set.fault is None:
            data_set.fault = _fault(data_set)
        found.append(data_set)
    return found


def _fault(data_set: hdf5.DataSet) -> str | None:
    if data_set.dtype.names is not None:
        return "holds complex numbers; expected numbers: save real() of it"
    attributes = data_set.data.attrs
    if "MATLAB_empty" in attributes:
        return "is empty; expected a vector or a matrix"
    if "MATLAB_class" not in attributes:
        return None
    # Only a plain text is read: the library does not survive every damaged one of another kind.
    kind = attributes.get_id("MATLAB_class")
    if kind.dtype.kind != "S" or kind.shape != () or kind.dtype.itemsize > _LONGEST_CLASS:
        return "has a damaged class; copy the file again"
    if np.bytes_(attributes["MATLAB_class"]) == b"char":
        return "holds text; expected numbers"
    return None

"""Export noise models as input files of public filters and simulators.

Call the package: ``export({"gyro": model, "accel": model}, "kalibr", rate="200 Hz")``; for the
parameters see ``help(of_models.export)``. A program has a pure function of an
`imubench_pipeline.export.imu.Imu`, which describes the convention of the program and cites its
documentation. `targets` lists the programs; `request` makes a file from the tables of a run.
"""

import sys
from inspect import Signature, signature
from types import ModuleType

from imubench_pipeline.export.of_models import export

__all__ = ["export"]


class _CallablePackage(ModuleType):
    """A package that is callable like its function of the same name."""

    __call__ = staticmethod(export)
    __signature__: Signature = signature(export)


sys.modules[__name__].__class__ = _CallablePackage

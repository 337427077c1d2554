"""Simulated noise; call the package: ``simulate(model, "100 Hz", duration="1 h", seed=1)``.

For the parameters see ``help(simulate.simulate)``. The other modules simulate a complete sensor
(noise, drift, low-pass, register and motion of all axes) from settings, a datasheet or estimates.
"""

import sys
from inspect import Signature, signature
from types import ModuleType

from imubench_pipeline.simulate.samples import simulate

__all__ = ["simulate"]


class _CallablePackage(ModuleType):
    """A package that is callable like its function of the same name."""

    __call__ = staticmethod(simulate)
    __signature__: Signature = signature(simulate)


sys.modules[__name__].__class__ = _CallablePackage

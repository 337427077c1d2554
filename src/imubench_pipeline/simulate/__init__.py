"""Simulated noise of a model: call it, as in ``simulate(model, "100 Hz", duration="1 h", seed=1)``.

``help(simulate.simulate)`` says what it takes. The rest of the room is a whole sensor: noise,
drift, low-pass, register and motion of all axes, from settings, a datasheet or estimates.
"""

import sys
from inspect import Signature, signature
from types import ModuleType

from imubench_pipeline.simulate.samples import simulate

__all__ = ["simulate"]


class _Room(ModuleType):
    """A room that is called as its one function is: they have one name."""

    __call__ = staticmethod(simulate)
    __signature__: Signature = signature(simulate)


sys.modules[__name__].__class__ = _Room

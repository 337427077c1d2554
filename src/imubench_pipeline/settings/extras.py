"""The extras of the package: what some uses of it need, and not everybody has to install."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

Extra = Literal["workflow", "ros", "hdf5"]
"""The table `project.optional-dependencies` of ``pyproject.toml`` says what is in each."""


class ExtraError(ImportError):
    """What is asked for needs a package that is not installed; the text says how to install it."""


@contextmanager
def extra(name: Extra, purpose: str) -> Iterator[None]:
    """Say which extra has the package that is imported within, where it is not installed.

    ``purpose`` completes "to ...".

    Raises
    ------
    ExtraError
        If the package is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("imubench_pipeline"):
            raise
        raise ExtraError(
            f"to {purpose}, {error.name} is needed, which is not installed: "
            f"pip install 'imubench_pipeline[{name}]'"
        ) from None

"""Optional dependencies of the package, as extras."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

Extra = Literal["workflow", "ros", "hdf5", "excel"]
"""The table `project.optional-dependencies` of ``pyproject.toml`` says what is in each."""


class ExtraError(ImportError):
    """A missing package; the text says how to install it."""


@contextmanager
def require_extra(name: Extra, purpose: str) -> Iterator[None]:
    """Raise `ExtraError` if an import in the block fails; ``purpose``: such as ``draw``."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("imubench_pipeline"):
            raise
        raise ExtraError(
            f"to {purpose}, {error.name} is needed, which is not installed: "
            f"pip install 'imubench_pipeline[{name}]'"
        ) from None

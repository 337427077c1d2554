import pytest

from tests.verification.finished import Finished, finished


@pytest.fixture(scope="session")
def done(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """A project that is finished: whoever changes it puts it back."""
    return finished(tmp_path_factory.mktemp("finished"))

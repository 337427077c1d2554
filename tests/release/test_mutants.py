"""A certain fault is found, in a kernel that numba has kept compiled, too; no fault is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.release.mutant_runs import PACKAGE, copied, prepare
from tests.release.mutant_tests import KILLED, SURVIVED, TIMED_OUT, judged_as

pytestmark = pytest.mark.release


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    prepare()
    return copied(tmp_path_factory.mktemp("copy"))


@pytest.mark.parametrize(
    ("module", "line", "changed", "outcome"),
    [
        ("units.py", "import math", "import math  # nothing", SURVIVED),
        ("units.py", "import math", "import math\nraise ImportError", KILLED),
        # The kernel is compiled into that of another module, which is kept.
        ("allan/phase.py", "longer = longer_last[i]", "longer = 2.0 * longer_last[i]", KILLED),
        ("allan/phase.py", "            j += 2", "            j += 0", TIMED_OUT),
        ("allan/phase.py", "longer = longer_last[i]", "longer = (longer_last[i])", SURVIVED),
        # Tests that call a kernel, and run no line of the package that is seen.
        (
            "estimators/posterior_kernels.py",
            "value += point[j]",
            "value -= point[j]",
            KILLED,
        ),
    ],
)
def test_what_is_certain_is_found(
    source: Path, module: str, line: str, changed: str, outcome: str
) -> None:
    text = (PACKAGE / module).read_text()
    assert line in text
    place = text[: text.index(line)].count("\n") + 1
    code = text.replace(line, changed)
    assert judged_as(PACKAGE / module, place, code, source, 20.0, further=0)[0] == outcome

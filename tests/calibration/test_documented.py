import contextlib
import io
import re

import numpy as np

from tests.conftest import PROJECT


def test_the_example_of_the_documentation_finds_what_it_simulates():
    text = (PROJECT / "docs/how-to/calibration.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(example, names)
    still, found = names["still"], names["found"]
    assert abs(still.fixed.value[0] - 0.005) < 5 * still.fixed.sigma
    assert abs(found.scale_factor.value[0] - 1.002) < 5 * found.scale_factor.sigma
    angles = names["euler_angles"](names["aligned"].attitude[0])
    assert np.all(np.abs(angles - [0.05, -0.03, 0.7]) < 5 * names["fine"].sigma[-1])

"""What is compiled before estimates are made, in a process that has not compiled anything."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import numpy as np
from numba.core import event

class Compiled(event.Listener):
    names = []
    def on_start(self, ev):
        self.names.append(str(ev.data["dispatcher"]))
    def on_end(self, ev):
        pass

event.register("numba:compile", Compiled())
from imubench_pipeline.estimators.posterior_kernels import compile_kernels
compile_kernels()
print(len(Compiled.names))
Compiled.names.clear()
from imubench_pipeline.estimators.likelihood import fit
rng = np.random.default_rng(1)
samples = rng.standard_normal(1 << 12) + 0.05 * np.cumsum(rng.standard_normal(1 << 12))
fit(samples, 100.0)
print([name for name in Compiled.names if "imubench" in name and "estimators" in name])
"""


@pytest.mark.release  # it compiles all of it again, and says how fast a first use is
def test_an_estimate_leaves_nothing_to_compile(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    said = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, env=environment
    )
    compiled, left = said.stdout.splitlines()
    assert left == "[]"
    # Measured: 24. A word of NumPy in a kernel, such as max or solve, brings ten and more.
    assert int(compiled) <= 30

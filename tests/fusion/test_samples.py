import numpy as np
import pytest

from imubench_pipeline.extensions.fusion.board import Board
from imubench_pipeline.extensions.fusion.samples import at_fused_rate, fuse
from imubench_pipeline.extensions.fusion.weights import equal
from imubench_pipeline.noise import NoiseModel

BOARD = Board([NoiseModel(N=1e-4)] * 2, [100.0, 200.0])


def test_a_faster_sensor_is_brought_to_the_fused_rate_by_means_of_blocks() -> None:
    found = at_fused_rate(BOARD, [np.array([1.0, 2.0]), np.array([1.0, 3.0, 5.0, 9.0, 4.0])])
    assert found.tolist() == [[1.0, 2.0], [2.0, 7.0]]


@pytest.mark.parametrize("logs", [1, 3])
def test_a_wrong_number_of_logs_is_said(logs: int) -> None:
    samples = [np.zeros(8)] * logs
    with pytest.raises(ValueError, match=f"found samples of {logs} sensors, expected 2"):
        at_fused_rate(BOARD, samples)
    with pytest.raises(ValueError, match=f"found samples of {logs} sensors, expected 2"):
        fuse(BOARD, equal(2), samples)

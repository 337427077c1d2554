import numpy as np
import pytest

from imubench_pipeline.allan import cluster_sizes
from imubench_pipeline.allan.phase import count_presence
from tests.test_allan import needed_in_cluster


def expected(
    log: np.ndarray, n: int, begin: np.ndarray, spans: list[tuple[int, int]]
) -> list[bool]:
    """From the definition: both clusters have enough of their samples, in one segment."""
    found = []
    needed = needed_in_cluster(log, n) - 1e-9
    for i in begin:
        parts = (log[i : i + n], log[i + n : i + 2 * n])
        whole = any(start <= i and i + 2 * n <= stop for start, stop in spans)
        found.append(whole and all(np.isfinite(p).sum() >= needed for p in parts))
    return found


@pytest.mark.parametrize("n", [1, 5, 20, 100, 700])
@pytest.mark.parametrize("spans", [[(0, 3000)], [(0, 1111), (1111, 3000)]])
def test_differences_are_there_by_definition(n: int, spans: list[tuple[int, int]]) -> None:
    rng = np.random.default_rng(n)
    log = rng.standard_normal(3000)
    log[rng.random(3000) < 0.05] = np.nan
    log[1800:1950] = np.nan
    blocks = [log[:700], log[700:701], log[701:-1], log[-1:]]
    found = count_presence(blocks, len(log), spans).differences(n)
    assert found is not None
    there, stride = found
    begin = stride * np.arange(len(there))
    assert begin[-1] + 2 * n <= 3000 < begin[-1] + 2 * n + stride
    assert there.tolist() == expected(log, n, begin, spans)


def test_a_long_log_is_counted_at_a_stride() -> None:
    log = np.zeros(300_000)
    log[100_000:160_000] = np.nan
    found = count_presence([log[:77_777], log[77_777:]], len(log))
    assert found.stride == 16
    assert found.coarse[-1] == 240_000 and found.coarse[6_250] == 100_000
    there, stride = found.differences(20_000) or (np.empty(0), 1)
    # Missing wherever a tenth of a cluster lies in the hole.
    gone = stride * np.flatnonzero(~there)
    assert gone[0] == pytest.approx(100_000 - 38_000, abs=2 * stride)
    assert gone[-1] == pytest.approx(160_000 - 2_000, abs=2 * stride)


def test_no_difference_crosses_from_one_segment_to_the_next_in_a_long_log() -> None:
    log, n = np.zeros(300_000), 20_000
    found = count_presence([log], len(log), [(0, 120_000), (120_000, 300_000)])
    there, stride = found.differences(n) or (np.empty(0), 1)
    assert found.stride == 16 and stride > 16
    gone = stride * np.flatnonzero(~there)
    assert gone[0] == pytest.approx(120_000 - 2 * n, abs=2 * stride)
    assert gone[-1] == pytest.approx(120_000, abs=2 * stride)
    assert len(gone) == pytest.approx(2 * n / stride, abs=2)


def test_no_answer_rather_than_one_of_few_clusters() -> None:
    length = 8 << 20
    found = count_presence([np.zeros(1 << 20)] * 8, length)
    told = []
    for n in cluster_sizes(length):
        answer = found.differences(n)
        if answer is not None:
            there, stride = answer
            assert there.all()
            # the whole log, or 32 clusters of its beginning
            reach = (len(there) - 1) * stride + 2 * n
            assert reach > length - 2 * stride or reach >= 32 * n - stride
        told.append(answer is not None)
    assert told[0] and told[-1] and not all(told)

"""Damage to whole files that the tests of the streamed formats share."""

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

Damage = tuple[int, list[tuple[int, int]]]


def examples(number: int) -> settings:
    """So many examples, every day a fourth; a test may write each over the last in its folder."""
    return settings(
        max_examples=number * settings.default.max_examples // 100,
        suppress_health_check=[HealthCheck.function_scoped_fixture],
    )


def damages(size: int, most: int) -> st.SearchStrategy[Damage]:
    """Where a file of some bytes is cut, and which bits of which bytes are flipped."""
    flip = st.tuples(st.integers(0, size - 1), st.integers(1, 255))
    return st.tuples(st.integers(0, size), st.lists(flip, max_size=most))


def damaged(whole: bytes, damage: Damage) -> bytes:
    cut, flips = damage
    data = bytearray(whole)
    for place, bits in flips:
        data[place] ^= bits
    return bytes(data[:cut])

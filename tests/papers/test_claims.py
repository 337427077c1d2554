"""What a line says of printed and found; no line lacks what stands behind it."""

from dataclasses import replace
from pathlib import Path

import pytest

from imubench_pipeline.extensions.papers.claims import Claim, Result, no_result, verdict_of
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.extensions.papers.papers import PAPERS, published_rows
from imubench_pipeline.tables import build
from tests.conftest import PROJECT

CLAIM = Claim(
    place="Table 1", quantity="N", printed="2 rad", value=2.0, unit="rad",
    evaluate=lambda _: Result(value=2.0), basis="computed", check="tests/papers/test_claims.py",
)  # fmt: skip
RUN = Evidence()


@pytest.mark.parametrize(
    ("result", "verdict"),
    [
        (Result(value=2.09), "agrees"),
        (Result(value=2.11), "differs"),
        (Result(value=2.5, lower=1.9, upper=3.1), "agrees"),
        (Result(value=2.5, lower=2.2, upper=3.1), "differs"),
        (Result(words="the sign is minus", verdict="misprint"), "misprint"),
        (no_result("no log"), "not to be had"),
    ],
)
def test_the_verdict_follows_from_the_numbers(result: Result, verdict: str) -> None:
    assert verdict_of(CLAIM, result) == verdict
    negative = replace(CLAIM, value=-2.0)
    assert verdict_of(negative, Result(value=-2.09)) == "agrees"


def test_a_run_without_logs_of_a_paper_says_nothing_of_it() -> None:
    rejected = {"sensor": "mti_7", "recording": "sim_published", "status": "rejected"}
    assert list(published_rows(RUN)) == []
    told = {"device": "a", "kind": "static", "simulated": True}
    tables = {"recordings": build("recordings", [rejected | told])}
    assert list(published_rows(Evidence(tables))) == []


@pytest.mark.parametrize("paper", PAPERS, ids=lambda paper: paper.about.key)
def test_each_line_names_a_test_or_benchmark_that_there_is(paper) -> None:
    for claim in paper.claims(RUN):
        path, _, name = claim.check.partition("::")
        text = Path(PROJECT / path).read_text(encoding="utf-8")
        assert not name or f"def {name}(" in text, claim.check

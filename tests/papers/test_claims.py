"""What a line says of printed and found; no line lacks what stands behind it."""

from pathlib import Path

import pytest

from imubench_pipeline.extensions.papers.papers import judge, make_published_rows
from imubench_pipeline.extensions.papers.printed import Evidence, Result, parse_number, read_papers
from imubench_pipeline.tables.files import build
from tests.conftest import PROJECT

RUN = Evidence()


@pytest.mark.parametrize(
    ("result", "verdict"),
    [
        (Result(value=2.09), "agrees"),
        (Result(value=2.11), "differs"),
        (Result(value=2.5, lower=1.9, upper=3.1), "agrees"),
        (Result(value=2.5, lower=2.2, upper=3.1), "differs"),
        (Result(), "not available"),
    ],
)
def test_the_verdict_follows_from_the_numbers(result: Result, verdict: str) -> None:
    assert judge(2.0, result, 0.05) == verdict
    assert judge(-2.0, Result(value=-2.09), 0.05) == "agrees"
    assert judge(None, result, 0.05) == "not available"


@pytest.mark.parametrize(
    ("text", "number"), [("8,4·10⁻⁵", 8.4e-5), ("6.8314 × 10⁻⁵", 6.8314e-5), ("±3", 3.0)]
)
def test_numbers_are_read_as_printed(text: str, number: float) -> None:
    assert parse_number(text) == number


def test_a_run_without_logs_of_a_paper_says_nothing_of_it() -> None:
    rejected = {"sensor": "mti_7", "recording": "sim_published", "status": "rejected"}
    assert list(make_published_rows(RUN)) == []
    told = {"device": "a", "kind": "static", "simulated": True}
    tables = {"recordings": build("recordings", [rejected | told])}
    assert list(make_published_rows(Evidence(tables))) == []


@pytest.mark.parametrize("paper", read_papers(), ids=lambda paper: paper.key)
def test_each_line_names_a_test_or_benchmark_that_there_is(paper) -> None:
    for line in paper.lines:
        path, _, name = line.check.partition("::")
        text = Path(PROJECT / path).read_text(encoding="utf-8")
        assert not name or f"def {name}(" in text, line.check

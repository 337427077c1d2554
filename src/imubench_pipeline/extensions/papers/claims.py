"""Claims of a paper: the printed value, how this project evaluates it, and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from imubench_pipeline.extensions.papers.about import About, Basis, Verdict
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.extensions.papers.tables import PublishedRow


@dataclass(frozen=True, kw_only=True)
class Result:
    """Result of the evaluation of a claim: a number, or a text."""

    value: float | None = None  # SI
    lower: float | None = None  # of an interval, SI
    upper: float | None = None
    words: str = ""  # with the number, or instead of it
    verdict: Verdict | None = None  # None: it follows from the numbers
    reason: str | None = None  # replaces the reason of the claim


def numeric_result(value: float, words: str = "") -> Callable[[Evidence], Result]:
    """Return an evaluation that gives a number without data of a run."""
    return lambda _: Result(value=value, words=words)


def verbal_result(words: str, verdict: Verdict = "agrees") -> Callable[[Evidence], Result]:
    """Return an evaluation that gives a text without data of a run."""
    return lambda _: Result(words=words, verdict=verdict)


def no_result(reason: str) -> Result:
    """Return the result of a claim that cannot be evaluated."""
    return Result(verdict="not to be had", reason=reason)


DERIVED = "derived:"
"""Prefix of a value that is not printed, but follows from printed values alone."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One line of a paper."""

    place: str  # "Table 3", "Figure 5", "Equation 26" or "Section 6", as numbered there
    quantity: str  # in words
    printed: str  # as printed, with its unit; or `DERIVED` and the derived value
    value: float | None = None  # ``printed`` in SI; None: it is no number
    unit: str = "-"  # SI
    evaluate: Callable[[Evidence], Result]
    basis: Basis
    reason: str = ""  # why the two differ; shown only then
    page: str = ""  # page of the report with the counterpart, and its anchor if any
    check: str  # test or benchmark of the claim: "tests/...::name" or a file
    tolerance: float = 0.05  # relative difference that still agrees
    printed_unit: str = ""  # unit in which the result is shown; empty: the SI unit
    scale: float = 1.0  # SI per printed unit


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A paper with its claims, in the order of the paper."""

    about: About
    claims: Callable[[Evidence], Iterable[Claim]]


def verdict_of(claim: Claim, result: Result) -> Verdict:
    """Return the verdict on a claim from its printed value and the result."""
    if result.verdict is not None:
        return result.verdict
    if result.value is None or claim.value is None:
        return "not to be had"
    inside = (
        result.lower is not None
        and result.upper is not None
        and result.lower <= claim.value <= result.upper
    )
    near = abs(result.value - claim.value) <= claim.tolerance * abs(claim.value)
    return "agrees" if inside or near else "differs"


def rows_of(paper: Paper, evidence: Evidence) -> Iterator[PublishedRow]:
    """Yield the rows of the table ``published`` of a paper."""
    for claim in paper.claims(evidence):
        result = claim.evaluate(evidence)
        verdict = verdict_of(claim, result)
        ratio = result.value / claim.value if result.value is not None and claim.value else None
        yield PublishedRow(
            paper=paper.about.name,
            place=claim.place,
            quantity=claim.quantity,
            printed_as=claim.printed,
            printed=claim.value,
            found=result.value,
            lower=result.lower,
            upper=result.upper,
            found_words=result.words or None,
            ratio=ratio,
            tolerance=claim.tolerance if ratio is not None else None,
            unit=claim.unit,
            printed_unit=claim.printed_unit or claim.unit,
            scale=claim.scale,
            basis=claim.basis,
            verdict=verdict,
            reason=(result.reason or claim.reason or None) if verdict != "agrees" else None,
            page=claim.page or None,
            check=claim.check,
        )

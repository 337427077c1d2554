"""A line of a paper: what is printed there, how ours is found, and what the two say together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from imubench_pipeline.experiments.papers.about import About, Basis, Verdict
from imubench_pipeline.experiments.papers.evidence import Evidence
from imubench_pipeline.model.published import PublishedRow


@dataclass(frozen=True, kw_only=True)
class Found:
    """What is found of a claim: a number, or words where it is none."""

    value: float | None = None  # SI
    lower: float | None = None  # of an interval, SI
    upper: float | None = None
    words: str = ""  # beside the number, or in its place
    verdict: Verdict | None = None  # where it does not follow from the numbers
    reason: str | None = None  # in place of the claim's


def number(value: float, words: str = "") -> Callable[[Evidence], Found]:
    """Return what finds a number that hangs on no run."""
    return lambda _: Found(value=value, words=words)


def said(words: str, verdict: Verdict = "agrees") -> Callable[[Evidence], Found]:
    """Return what finds words that hang on no run."""
    return lambda _: Found(words=words, verdict=verdict)


def nothing(reason: str) -> Found:
    """Return what is found where there is nothing to be had."""
    return Found(verdict="not to be had", reason=reason)


DERIVED = "derived:"
"""Begins what stands in the place of the printed, where that follows from it alone."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One line of a paper."""

    place: str  # "Table 3", "Figure 5", "Equation 26" or "Section 6", as numbered there
    quantity: str  # of what, in words
    printed: str  # as printed, with its unit; or `DERIVED` and what follows from it
    value: float | None = None  # the same in SI; None: it is no number
    unit: str = "-"  # SI
    found: Callable[[Evidence], Found]
    basis: Basis
    reason: str = ""  # why the two differ; shown where they do
    page: str = ""  # of the report: its counterpart, with an anchor where there is one
    check: str  # test or benchmark that stands behind the line: "tests/...::name" or a file
    tolerance: float = 0.05  # relative difference that still agrees
    printed_unit: str = ""  # unit in which ours is shown, where it is not the SI unit
    scale: float = 1.0  # SI per printed unit


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A paper with its claims, in the order of the paper."""

    about: About
    claims: Callable[[Evidence], Iterable[Claim]]


def verdict_of(claim: Claim, found: Found) -> Verdict:
    """Return what printed and found say together."""
    if found.verdict is not None:
        return found.verdict
    if found.value is None or claim.value is None:
        return "not to be had"
    inside = (
        found.lower is not None
        and found.upper is not None
        and found.lower <= claim.value <= found.upper
    )
    near = abs(found.value - claim.value) <= claim.tolerance * abs(claim.value)
    return "agrees" if inside or near else "differs"


def rows_of(paper: Paper, evidence: Evidence) -> Iterator[PublishedRow]:
    """Yield the rows of the table ``published`` of a paper."""
    for claim in paper.claims(evidence):
        found = claim.found(evidence)
        verdict = verdict_of(claim, found)
        ratio = found.value / claim.value if found.value is not None and claim.value else None
        yield PublishedRow(
            paper=paper.about.name,
            place=claim.place,
            quantity=claim.quantity,
            printed_as=claim.printed,
            printed=claim.value,
            found=found.value,
            lower=found.lower,
            upper=found.upper,
            found_words=found.words or None,
            ratio=ratio,
            tolerance=claim.tolerance if ratio is not None else None,
            unit=claim.unit,
            printed_unit=claim.printed_unit or claim.unit,
            scale=claim.scale,
            basis=claim.basis,
            verdict=verdict,
            reason=(found.reason or claim.reason or None) if verdict != "agrees" else None,
            page=claim.page or None,
            check=claim.check,
        )

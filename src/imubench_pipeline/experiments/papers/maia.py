"""What Maia et al. print (MTi-7, C102-F9R): tables 1 to 4, figures 1 to 9, equations 1 to 27."""

from __future__ import annotations

import math

from imubench_pipeline.experiments.papers.about import MAIA
from imubench_pipeline.experiments.papers.claims import Claim, Found, Paper, nothing
from imubench_pipeline.experiments.papers.evidence import Evidence, Log

_NO_LOG = "it takes the simulated log of this sensor"


def _estimate(log: Log, name: str, method: str, evidence: Evidence) -> Found:
    row = evidence.parameter(log, name, method)
    if row is None:
        return nothing(_NO_LOG)
    if row["value"] is None:
        return Found(words=row["status"].replace("_", " "), verdict="differs", reason=row["reason"])
    return Found(value=row["value"], lower=row["lower"], upper=row["upper"])


CLAIMS: tuple[Claim, ...] = (
    Claim(
        place="Equation 13",
        quantity="floor of the bias instability over B",
        printed="0,664",
        value=0.664,
        found=lambda _: Found(value=math.sqrt(2.0 * math.log(2.0) / math.pi)),
        basis="checked",
        page="theory.html#bias-instability",
        check="tests/papers/test_claims.py",
        tolerance=1e-3,
    ),
    Claim(
        place="Table 2",
        quantity="N of the MTi-7 gyro, optimised",
        printed="8,4·10⁻⁵ rad/s^(1/2)",
        value=8.4e-5,
        unit="rad/s/sqrt(Hz)",
        found=lambda run: _estimate(Log("mti_7", "sim_published", "gyro_x"), "N", "paper", run),
        basis="come back",
        page="recordings/mti_7/sim_published.html#gyro_x",
        check="tests/papers/test_claims.py",
    ),
)

PAPER = Paper(about=MAIA, claims=lambda _: CLAIMS)

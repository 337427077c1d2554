import pytest

from imubench_pipeline.estimators.agreement import doubt_contradicted, yield_disagreements
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.words.numbers import number_text

KNOWN = Estimate(
    "likelihood",
    {
        "N": Parameter(1.0, lower=0.98, upper=1.02),
        "B": Parameter(2.0, lower=1.8, upper=2.2),
        "T_B": Parameter(None, "absent", "flicker noise has no correlation time"),
        "K": Parameter(None, "not_identified", "too short a log", 0.0, 5.0),
    },
    curve={"B_curve": Parameter(2.0, lower=1.8, upper=2.2)},
)


def other(method: str = "weighted", **parameters: Parameter) -> Estimate:
    return Estimate(method, parameters)


@pytest.mark.parametrize(
    ("N", "status"),
    [
        (Parameter(1.01, lower=0.97, upper=1.05), "ok"),
        (
            Parameter(1.1, lower=1.05, upper=1.15),
            "doubtful",
        ),  # intervals apart
        (Parameter(1.9, lower=0.98, upper=3.8), "doubtful"),  # nearly twice, however unsure
        (Parameter(1.2), "ok"),  # read off a curve, without limits
        (Parameter(1.4), "doubtful"),
        # At most a quarter beyond the limits, and 1.8 times the value.
        (Parameter(1.27), "ok"),
        (Parameter(1.28), "doubtful"),
        (Parameter(0.79), "ok"),
        (Parameter(0.78), "doubtful"),
        (Parameter(1.79, lower=1.0, upper=3.8), "ok"),
        (Parameter(1.81, lower=1.0, upper=3.8), "doubtful"),
        (Parameter(0.56, lower=0.3, upper=1.1), "ok"),
        (Parameter(0.55, lower=0.3, upper=1.1), "doubtful"),
        (Parameter(0.95, lower=0.9, upper=0.97), "doubtful"),
        (Parameter(1.0, "at_bound", lower=0.9, upper=1.1), "at_bound"),
        (Parameter(None, "not_shown", "short"), "not_shown"),
    ],
)
def test_a_value_that_the_likelihood_rules_out_is_doubtful(N: Parameter, status: str) -> None:
    found = doubt_contradicted(other(N=N), KNOWN).parameters["N"]
    assert (found.status, found.value) == (status, N.value)
    if status == "doubtful":
        assert found.value is not None
        limits = " to ".join(number_text(limit / found.value, 3) for limit in (0.98, 1.02))
        assert f"95 % interval of N is {limits} times this value" in (found.reason or "")


def test_a_value_of_what_the_likelihood_does_not_tell_is_doubtful() -> None:
    found = doubt_contradicted(
        other("curve", T_B=Parameter(30.0), K=Parameter(1.0, lower=0.5, upper=2.0)), KNOWN
    )
    assert {one.status for one in found.parameters.values()} == {"doubtful"}
    assert "flicker" in (found.parameters["T_B"].reason or "")
    assert "too short" in (found.parameters["K"].reason or "")


def test_where_several_terms_make_the_bias_that_of_the_curve_is_compared() -> None:
    terms = {"B": Parameter(1.0, lower=0.9, upper=1.1), "T_B": Parameter(3.0, lower=2.0, upper=4.0)}
    several = Estimate("likelihood", KNOWN.parameters | terms, [terms], curve=KNOWN.curve)
    assert doubt_contradicted(other(B=Parameter(2.1)), several).parameters["B"].status == "ok"


@pytest.mark.parametrize(
    ("symbol", "robust", "ratio"),
    [
        ("N", Parameter(1.2, lower=1.15, upper=1.25), 1.0 / 1.2),
        ("N", Parameter(1.05, lower=1.04, upper=1.06), None),  # apart, but by 5 %
        ("N", Parameter(1.2, "doubtful", lower=1.15, upper=1.25), None),
        ("N", Parameter(1.2, lower=1.0, upper=1.4), None),
        ("K", Parameter(20.0, lower=15.0, upper=25.0), None),  # the likelihood has no K
        ("B_curve", Parameter(1.0, lower=0.9, upper=1.1), 2.0),
    ],
)
def test_second_opinion_outside_the_interval_is_a_finding(
    symbol: str, robust: Parameter, ratio: float | None
) -> None:
    parameters = {"N": KNOWN.parameters["N"], symbol: robust}
    own = Estimate("robust", parameters, curve={symbol: robust})
    found = list(yield_disagreements("gyro_x", {"robust": own, "likelihood": KNOWN}))
    assert [(one.finding, one.value) for one in found] == (
        [] if ratio is None else [("methods_differ", pytest.approx(ratio))]
    )
    assert not list(yield_disagreements("gyro_x", {"robust": own}))

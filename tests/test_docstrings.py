"""Every public function says what its arguments are."""

import ast
import re
from pathlib import Path

import pytest

from tests.conftest import PROJECT

SOURCE = PROJECT / "src/imubench_pipeline"
PUBLIC = ["units",
          "settings/printed", "settings/requirements", "settings/simulated_sensor",
          "extensions/earth_rate/settings",
          "allan/confidence", "allan/variance",
          "noise/growth", "noise/low_pass", "noise/model", "noise/simulate",
          "tables/files", "tables/provenance",
          "readers/__init__", "readers/text_log",
          "recordings/ingest", "recordings/overview",
          "estimators/curve", "estimators/least_squares", "estimators/score",
          "estimators/thermal/fit", "estimators/thermal/path", "estimators/thermal/regression",
          "datasheets/coverage", "datasheets/deltas", "datasheets/suspicion",
          "simulate/discretisation", "simulate/from_datasheet",
          "simulate/from_estimates", "simulate/imu", "simulate/model",
          "simulate/profiles", "simulate/samples",
          "simulate/simulation", "simulate/models", "simulate/writing",
          "navigation/drift", "navigation/error_budget/budget", "navigation/error_budget/in_use",
          "navigation/error_budget/parts",
          "navigation/expected_errors",
          "extensions/fusion/board", "extensions/fusion/equivalence",
          "extensions/fusion/prediction", "extensions/fusion/weights",
          "navigation/ratios", "navigation/repeatability", "navigation/selection",
          "navigation/shortlist", "navigation/suitability",
          "navigation/verdicts/basis",
          "navigation/verdicts/judgement", "navigation/verdicts/next_steps",
          "navigation/verdicts/specimens",
          "navigation/verdicts/standing",
          "extensions/aided/axis_states", "extensions/aided/runs",
          "extensions/aided/trajectories",
          "extensions/earth_rate/choice_of_turns",
          "extensions/earth_rate/published",
          "extensions/calibration/experiment", "extensions/earth_rate/turns",
          "extensions/calibration/kalman", "extensions/earth_rate/known_rate",
          "extensions/earth_rate/pairs",
          "extensions/earth_rate/outlook",
          "extensions/earth_rate/simulation", "extensions/calibration/states",
          "extensions/earth_rate/turning",
          "extensions/exports/choice", "extensions/exports/mapping",
          "extensions/exports/overbound", "extensions/exports/request",
          "extensions/exports/imu",
          "library/comparison", "library/curves", "library/estimates", "library/given",
          "library/logs",
          "report/comparison", "report/datasheets", "extensions/earth_rate/page",
          "extensions/fusion/page",
          "report/meaning", "report/palette", "report/payload",
          "report/practical", "report/publish", "report/site",
          "report/view",
          "extensions/earth_rate/earth_rotation",
          "extensions/exports/exports", "extensions/fusion/fusion",
          "extensions/calibration/noise_source",
          "steps/shortlist",
          "run/resources"]  # fmt: skip


def functions(path: Path) -> list[ast.FunctionDef]:
    """Return the public functions of a module, and the methods of its public classes."""
    body = ast.parse(path.read_text()).body
    classes = [n for n in body if isinstance(n, ast.ClassDef) and not n.name.startswith("_")]
    return [
        node
        for node in [*body, *(node for one in classes for node in one.body)]
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
        if "overload" not in map(ast.unparse, node.decorator_list)  # signatures of the next one
    ]


@pytest.mark.parametrize("module", PUBLIC)
def test_arguments_of_documented_functions_are_documented(module: str) -> None:
    for function in functions(SOURCE / f"{module}.py"):
        text = ast.get_docstring(function) or ""
        assert text, function.name
        if "Parameters\n" not in text:
            continue
        arguments = [*function.args.args, *function.args.kwonlyargs]
        for argument in arguments:
            if argument.arg in ("self", "cls"):
                continue
            listed = [line for line in text.splitlines() if line and not line.startswith(" ")]
            assert any(argument.arg in line.split(" : ")[0] for line in listed if " : " in line), (
                f"{module}.{function.name}: {argument.arg} is not documented"
            )


@pytest.mark.parametrize("module", PUBLIC)
def test_functions_of_arrays_say_their_shapes(module: str) -> None:
    """Or where they are said; sections that repeat annotations are left out."""
    for function in ast.parse((SOURCE / f"{module}.py").read_text()).body:
        if not isinstance(function, ast.FunctionDef) or function.name.startswith("_"):
            continue
        arguments = [*function.args.args, *function.args.kwonlyargs]
        annotations = [ast.unparse(one.annotation) for one in arguments if one.annotation]
        if any(re.match(r"(Array|NDArray|ArrayLike)\b", one) for one in annotations):
            text = ast.get_docstring(function) or ""
            said = re.search(r"shape|: as of `|are as in `|\(see `|ndarray", text)
            assert said, f"{module}.{function.name}"


def test_modules_are_small() -> None:
    for path in SOURCE.rglob("*.py"):
        assert len(path.read_text().splitlines()) <= 700, path

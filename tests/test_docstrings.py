"""Every public function says what its arguments are."""

import ast
from pathlib import Path

import pytest

from tests.conftest import PROJECT

SOURCE = PROJECT / "src/imubench_pipeline"
PUBLIC = ["allan", "confidence", "noise", "simulate", "score", "datasheet", "units",
          "estimators/curve", "estimators/least_squares", "readers/__init__", "ingest",
          "coverage", "suspicion", "conversions", "overbound", "requirements", "selection",
          "repeatability/rows", "shortlist/classes", "shortlist/figures", "shortlist/of_run",
          "shortlist/rows", "export/temperature",
          "expected_errors", "error_budget/budget", "error_budget/growth", "error_budget/in_use",
          "error_budget/largest", "error_budget/parts", "error_budget/printed_errors",
          "suitability/abilities", "suitability/conditions", "export/choice",
          "export/growth", "export/mapping", "export/request", "export/of_run", "overview",
          "drift", "tables", "provenance", "report/practical", "report/words", "report/meaning",
          "report/view", "report/palette", "report/payload", "report/parameters",
          "report/comparison", "report/datasheets", "report/html", "report/site",
          "report/publish", "report/fusion", "resources", "text_log",
          "fusion/block_means", "fusion/board", "fusion/equivalence", "fusion/kalman",
          "fusion/of_run", "fusion/prediction", "fusion/quadrature", "fusion/riccati",
          "fusion/samples", "fusion/weights", "earth_rate/covariance", "earth_rate/experiment",
          "earth_rate/kalman", "earth_rate/known_rate", "earth_rate/pairs",
          "earth_rate/prediction", "earth_rate/simulation", "earth_rate/states",
          "earth_rate/alternation", "earth_rate/choice_of_turns", "earth_rate/found",
          "earth_rate/position", "earth_rate/sight", "earth_rate/transients",
          "earth_rate/turning", "earth_rate/courses", "earth_rate/declaration",
          "earth_rate/needs", "earth_rate/noise_source", "earth_rate/of_recording",
          "earth_rate/of_run", "earth_rate/published", "report/turned", "report/earth_rate",
          "thermal/effect", "thermal/fit", "thermal/lag",
          "thermal/level", "thermal/path", "thermal/path_kernels", "thermal/products",
          "thermal/register", "thermal/regression", "thermal/result", "thermal/uncertainty",
          "sensor_model/discretisation", "sensor_model/flicker_band", "sensor_model/imu",
          "sensor_model/kernel", "sensor_model/low_pass", "sensor_model/model",
          "sensor_model/profile_files", "sensor_model/profiles", "sensor_model/settings",
          "sensor_model/simulation", "sensor_model/sources",
          "sensor_model/from_datasheet", "sensor_model/from_estimates",
          "sensor_model/spectra", "sensor_model/writing",
          "verdicts/basis", "verdicts/evidence", "verdicts/judgement", "verdicts/next_steps",
          "verdicts/sources", "verdicts/specimens", "verdicts/standing",
          "verdicts/unless"]  # fmt: skip


def functions(path: Path) -> list[ast.FunctionDef]:
    """Return the public functions of a module, and the methods of its public classes."""
    body = ast.parse(path.read_text()).body
    classes = [n for n in body if isinstance(n, ast.ClassDef) and not n.name.startswith("_")]
    return [
        node
        for node in [*body, *(node for one in classes for node in one.body)]
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
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


def test_modules_are_small() -> None:
    for path in SOURCE.rglob("*.py"):
        assert len(path.read_text().splitlines()) <= 420, path

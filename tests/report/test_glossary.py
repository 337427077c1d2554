import ast
import math
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache, lru_cache
from html import unescape
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args, get_type_hints

import jinja2
import numpy as np
import pytest
import yaml
from scipy.optimize import minimize_scalar
from scipy.stats import t as student

from imubench_pipeline.allan.confidence import equivalent_degrees
from imubench_pipeline.datasheets import coverage
from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.estimators import estimate, lines
from imubench_pipeline.estimators.intervals import compute_cramer_rao_bounds
from imubench_pipeline.extensions.papers.page import describe_reading
from imubench_pipeline.extensions.papers.tables import AccuracyRow
from imubench_pipeline.model.states import (
    BacktestVerdict,
    DriftVerdict,
    GoodnessVerdict,
    PoolVerdict,
    Verdict,
)
from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.navigation.error_budget.gyrocompass import Gyrocompass
from imubench_pipeline.noise import FLOOR, GaussMarkov, NoiseModel
from imubench_pipeline.report import glossary as module
from imubench_pipeline.report.datasheets import DEPENDS
from imubench_pipeline.report.glossary import UnknownTermError, find_term, read_glossary
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables import findings
from imubench_pipeline.units import convert_from_si, convert_to_si
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.findings import FINDINGS
from imubench_pipeline.words.verdicts import source_text
from tests.conftest import PROJECT
from tests.rows import DATASHEET_VERDICTS
from tests.starts import uncalibrated

SOURCE = PROJECT / "src/imubench_pipeline"
BASE = "{% block title %}{% endblock %}<main>{% block main %}{% endblock %}</main>"
VOID = {"br", "img", "meta", "link", "hr", "input"}


@lru_cache(maxsize=1)
def theory() -> str:
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader(
            [
                jinja2.DictLoader({"base.html.jinja": BASE}),
                jinja2.PackageLoader("imubench_pipeline.report"),
            ]
        ),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("theory.html.jinja")
    return page.render(figures=("figures/theory.svg",), terms=read_glossary(), sections=())


class Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.faults: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> at {self.getpos()}")

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def of(self, *names: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes in self.tags if tag in names]


@lru_cache(maxsize=1)
def page() -> Page:
    parsed = Page()
    parsed.feed(theory())
    parsed.close()
    return parsed


def text() -> str:
    return " ".join("".join(page().texts).split())


# ------------------------------------------------------------------------------- the glossary


def test_every_term_is_a_short_sentence() -> None:
    for one in read_glossary().values():
        assert one.name and one.short, one.key
        assert len(one.short.split()) <= 25, f"{one.key}: {one.short}"
        assert one.short.endswith(".") and one.short[0].isupper(), f"{one.key}: {one.short}"
        assert one.action is None or one.action.endswith("."), one.key


def test_every_section_is_a_place_on_the_theory_page() -> None:
    ids = {attributes.get("id") for _, attributes in page().tags}
    for one in read_glossary().values():
        assert one.section in ids, one.key


def test_no_key_stands_twice() -> None:
    tree: Any = yaml.compose((SOURCE / "report/glossary.yaml").read_text())
    keys = [key.value for _, section in tree.value for key, _ in section.value]
    assert Counter(keys).most_common(1)[0][1] == 1
    assert keys == list(read_glossary())
    sections = [key.value for key, _ in tree.value]
    assert len(sections) == len(set(sections))


def test_a_key_in_two_sections_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "glossary.yaml"
    file.write_text("one:\n  N: {name: N, short: A.}\ntwo:\n  N: {name: N, short: B.}\n")
    monkeypatch.setattr(module, "_FILE", file)
    with pytest.raises(ConfigError, match="'N' is in 'two' and above it; remove one"):
        read_glossary.__wrapped__()


def test_an_unknown_term_is_an_error_that_names_close_ones() -> None:
    with pytest.raises(UnknownTermError, match=r"'alan_deviation' is not .* allan_deviation"):
        read_glossary()["alan_deviation"]
    with pytest.raises(UnknownTermError):
        find_term("splendid", "verdict")
    assert "alan_deviation" not in read_glossary()


def test_what_a_table_holds_is_looked_up_by_its_kind() -> None:
    assert find_term("not comparable (condition)", "verdict").name == "not comparable (condition)"
    assert find_term("band", "line") is not find_term("band")
    assert find_term("not_identified").name == "not determined"
    assert all(
        find_term(status).name == name
        for status, name in STATUS_WORDS.items()
        if status not in ("ok", "does_not_decide")
    )


# --------------------------------------------------------- what the program can say has an entry


def literals(node: ast.expr | None) -> set[str]:
    """Return the texts that an expression can be; empty where it is none that is known."""
    match node:
        case ast.Constant(value=str(value)):
            return {value}
        case ast.IfExp(body=first, orelse=second):
            return literals(first) | literals(second)
    return set()


def bound(target: ast.expr, value: ast.expr | None, name: str) -> set[str]:
    """Return the texts that an assignment gives to a name."""
    match target, value:
        case ast.Name(id=found), _ if found == name:
            return literals(value)
        case ast.Tuple(elts=names), ast.Tuple(elts=values) if len(names) == len(values):
            parts = zip(names, values, strict=True)
            return {text for pair in parts for text in bound(*pair, name)}
    return set()


def values_of(name: str, inside: ast.FunctionDef, tree: ast.Module) -> set[str]:
    """Return the texts that a name in a function can have."""
    found: set[str] = set()
    for node in ast.walk(inside):
        if isinstance(node, ast.Assign):
            found |= {text for target in node.targets for text in bound(target, node.value, name)}
        elif isinstance(node, ast.comprehension) and isinstance(node.iter, ast.Name):
            rows = [
                row
                for other in ast.walk(inside)
                if isinstance(other, ast.Assign | ast.AnnAssign)
                and isinstance(other.value, ast.Tuple | ast.List)
                for row in other.value.elts
            ]
            found |= {text for row in rows for text in bound(node.target, row, name)}
    arguments = [argument.arg for argument in inside.args.args if argument.arg != "self"]
    if name in arguments:
        place = arguments.index(name)
        # Of a method that is called in another module, in that of a subclass.
        for module in [tree] if calls(tree, inside.name) else trees(f"{inside.name}("):
            for caller, call in calls(module, inside.name):
                if len(call.args) > place:  # else a method of another class
                    found |= texts(call.args[place], caller, module)
    return found


def texts(node: ast.expr, inside: ast.FunctionDef, tree: ast.Module) -> set[str]:
    found = values_of(node.id, inside, tree) if isinstance(node, ast.Name) else literals(node)
    assert found, f"{inside.name}, line {node.lineno}: what is {ast.unparse(node)}?"
    return found


@cache
def sources() -> dict[Path, str]:
    return {path: path.read_text() for path in sorted(SOURCE.rglob("*.py"))}


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(sources()[path])


def trees(word: str) -> dict[ast.Module, str]:
    """Return the modules of the source in which a word stands, with their names."""
    return {parsed(path): path.stem for path, text in sources().items() if word in text}


def calls(tree: ast.Module, name: str) -> list[tuple[ast.FunctionDef, ast.Call]]:
    """Return the calls of a function, each with the function that it stands in."""
    return calls_in(tree).get(name, [])


@cache
def calls_in(tree: ast.Module) -> dict[str, list[tuple[ast.FunctionDef, ast.Call]]]:
    found: dict[str, list[tuple[ast.FunctionDef, ast.Call]]] = {}
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            for node in ast.walk(function):
                if isinstance(node, ast.Call):
                    called = getattr(node.func, "attr", getattr(node.func, "id", None))
                    if called is not None:
                        found.setdefault(called, []).append((function, node))
    return found


@lru_cache(maxsize=1)
def emitted() -> dict[str, str]:
    """Return the findings that the source can emit, each with a module that does."""
    found = {code: kind.__module__ for code, kind in FINDINGS.items()}
    for tree, name_of_module in trees("Finding(").items():
        for function, call in calls(tree, "Finding"):
            named = [keyword.value for keyword in call.keywords if keyword.arg == "finding"]
            if not (stated := [*call.args, *named]):
                continue  # of a row of a table, whose finding another module has said
            if ast.unparse(stated[0]) == "data.code":
                continue  # of a declared finding
            for name in texts(stated[0], function, tree):
                found[name] = name_of_module
    return found


@pytest.mark.release
def test_findings_of_all_packages_are_known() -> None:
    assert emitted().keys() >= {
        "knocks",
        "damaged_message",
        "wrong_checksum",
        "incomplete_first_record",
        "not_records",
    }


def test_every_finding_has_an_entry_that_says_what_to_do() -> None:
    known = read_glossary()
    missing = {name: where for name, where in emitted().items() if name not in known}
    assert not missing, f"glossary.yaml lacks {missing}"
    for name in emitted():
        assert known[name].action, name
        assert known[name].name.replace("-", " ") == name.replace("_", " ")
    for one in known.values():
        assert one.action is None or one.key in emitted(), f"nothing emits {one.key}"


def values_in_tables() -> Iterator[tuple[str, str]]:
    for status in get_args(estimate.Status):
        yield status, ""
    for severity in get_args(findings.Severity):
        yield severity, ""
    for verdict in [
        *DATASHEET_VERDICTS,
        *get_args(PoolVerdict),
        *get_args(BacktestVerdict),
    ]:
        yield verdict, "verdict"
    yield DEPENDS, "verdict"
    for verdicts in (Verdict, GoodnessVerdict, DriftVerdict, PoolVerdict, BacktestVerdict):
        for verdict in get_args(verdicts):
            yield verdict, "verdict"
    for published in get_args(coverage.Published):
        yield published, "published"
    for kind in get_args(get_type_hints(lines.Line)["kind"]):
        yield kind, "line"
    for kind in ("typ", "max", "min", "range", "1sigma", "derived", "static", "two_position"):
        yield kind, "kind"
    for side in ("one-sided", "two-sided"):
        yield side, ""
    for axis in ("worst", "median"):
        yield axis, "axis"
    for source in ("stamps", "stated"):
        yield source, "rate_from"
    yield "ok", "recording"
    yield "rejected", ""
    for method in ("likelihood", "likelihood_gm", "curve", "paper", "weighted"):
        yield method, ""
    for symbol in (*estimate.FAMILY, "F", "GM"):
        yield symbol, ""
    for error in ("attitude", "heading", "velocity", "position", "north"):
        yield error, ""


@pytest.mark.parametrize(("value", "kind"), sorted(set(values_in_tables())))
def test_every_status_and_verdict_has_an_entry(value: str, kind: str) -> None:
    assert find_term(value, kind).short


def test_the_verdicts_are_all_found() -> None:
    verdicts = {value for value, kind in values_in_tables() if kind == "verdict"}
    assert verdicts >= set(get_args(Verdict))
    assert verdicts >= {"explained", "not explained", "not sure", "agree", "differ"}
    spoken = {one.key for one in read_glossary().values() if one.key.startswith("verdict_")}
    assert spoken == {find_term(verdict, "verdict").key for verdict in verdicts}


# ---------------------------------------------------------------------------- the theory page


def test_tags_are_balanced_and_anchors_unique() -> None:
    assert page().faults == [] and page().open == []
    ids = [attributes["id"] for _, attributes in page().tags if "id" in attributes]
    assert [name for name, number in Counter(ids).items() if number > 1] == []
    for attributes in page().of("a"):
        assert (attributes["href"] or "").removeprefix("#") in ids


def test_headings_are_in_order() -> None:
    levels = [int(tag[1]) for tag, _ in page().tags if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(later <= earlier + 1 for earlier, later in pairwise(levels))


def test_tables_images_and_formulas_can_be_read_aloud() -> None:
    assert len(page().of("caption")) == len(page().of("table")) > 0
    assert all(attributes.get("scope") in ("col", "row") for attributes in page().of("th"))
    assert all(attributes.get("alt") for attributes in page().of("img"))
    assert all(attributes.get("alttext") for attributes in page().of("math"))
    assert all(attributes.get("title") for attributes in page().of("abbr"))
    for attributes in page().of("div"):
        if attributes.get("class") == "scroll":
            assert attributes.get("aria-label") and attributes.get("role") == "region"


def test_the_page_needs_nothing_from_elsewhere() -> None:
    assert not page().of("script", "style", "link", "iframe")
    for _, attributes in page().tags:
        assert "style" not in attributes
        assert not [name for name in attributes if name.startswith("on")]
        for name in ("src", "href"):
            assert "//" not in (attributes.get(name) or "")
    assert [attributes["src"] for attributes in page().of("img")] == ["figures/theory.svg"]


def test_every_finding_is_in_the_table() -> None:
    ids = {attributes.get("id") for attributes in page().of("tr")}
    assert ids >= {f"finding-{name}" for name in emitted()}


def test_a_page_may_name_another_base() -> None:
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader(
            [
                jinja2.DictLoader({"other": "<p>other</p>{% block main %}{% endblock %}"}),
                jinja2.PackageLoader("imubench_pipeline.report"),
            ]
        )
    )
    made = environment.get_template("theory.html.jinja")
    assert made.render(base="other", figure="f", terms=read_glossary(), sections=()).startswith(
        "<p>other</p>"
    )


# ------------------------------------------------------ its figures are those of the library

GYRO = NoiseModel(
    N=convert_to_si(0.3, "deg/sqrt(h)", "gyro_density"),
    B=convert_to_si(10.0, "deg/h", "angular_rate"),
    K=convert_to_si(10.0, "deg/h/sqrt(h)", "gyro_random_walk"),
)
ACCEL = NoiseModel(
    N=convert_to_si(100.0, "ug/sqrt(Hz)", "accel_density"),
    B=convert_to_si(50.0, "ug", "acceleration"),
)
NOTHING = NoiseModel()
MTI_7_GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
MTI_7_ACCEL = NoiseModel(N=9.6e-4, B=3.4e-4, T_B=38.3, K=1.7e-5)
C102_ACCEL = NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5)
PERFECT = uncalibrated(gyro_bias=0.0, accel_bias=0.0, on_time=0.0)
CAUSES: dict[str, tuple[NoiseModel, Start]] = {
    "A residual bias b, 10 °/h": (
        NOTHING,
        uncalibrated(gyro_bias=GYRO.B, accel_bias=0.0, on_time=0.0),
    ),
    "N": (NoiseModel(N=GYRO.N), PERFECT),
    "B, flicker": (NoiseModel(B=GYRO.B), Start.calibrated(60.0)),
    "K": (NoiseModel(K=GYRO.K), PERFECT),
    "R (example: 10 °/h/h)": (NoiseModel(R=convert_to_si(10.0, "deg/h/h", "gyro_ramp")), PERFECT),
}


def cells(row: str) -> list[str]:
    """Return the cells of a row of a table, without their formulas."""
    found = re.search(rf'<th scope="row">{re.escape(row)}</th>(.*?)</tr>', theory(), re.DOTALL)
    assert found, row
    plain = re.sub(r"<math.*?</math>", "", found[1], flags=re.DOTALL)
    return [unescape(re.sub(r"<[^>]*>", "", cell)) for cell in plain.split("</td>")[:-1]]


def figure(shown: str) -> float:
    return float(shown.split()[0].rstrip("°"))


def minimum(model: NoiseModel) -> float:
    return math.sqrt(float(np.min(model.allan_variance(np.geomspace(1e-1, 1e6, 20_001)))))


@pytest.mark.parametrize("cause", CAUSES)
def test_the_growth_of_errors(cause: str) -> None:
    model, start = CAUSES[cause]
    for shown, quantity in zip(cells(cause), ("heading", "velocity", "position"), strict=True):
        error = budget(quantity, 60.0, gyro=model, accel=NOTHING, start=start).total  # type: ignore[arg-type]  # one of the errors, as text
        error = math.degrees(error) if quantity == "heading" else error
        assert figure(shown) == pytest.approx(error, rel=0.04)


def test_the_growth_of_an_accelerometers_errors() -> None:
    for model, start, shown in (
        (NoiseModel(N=ACCEL.N), PERFECT, "0.0076 m/s and 0.26 m"),
        (NoiseModel(B=ACCEL.B), Start.calibrated(60.0), "0.028 m/s and 0.80 m"),
    ):
        assert shown in text()
        errors = [
            budget(quantity, 60.0, gyro=NOTHING, accel=model, start=start).total
            for quantity in ("velocity", "position")
        ]
        assert [figure(part) for part in shown.split(" and ")] == pytest.approx(errors, rel=0.02)


@pytest.mark.parametrize(
    "model",
    [GYRO, MTI_7_GYRO, NoiseModel(K=1e-6), NoiseModel(N=1e-4, R=1e-9)],
    ids=lambda model: model.name,
)
def test_a_window_as_long_as_the_run_leaves_the_allan_deviation(model: NoiseModel) -> None:
    for time in (1.0, 60.0, 3600.0):
        error = budget(
            "heading", time, gyro=model, accel=NOTHING, start=Start.calibrated(time)
        ).total
        deviation = math.sqrt(float(model.allan_variance(np.array([time]))[0]))
        assert error == pytest.approx(math.sqrt(2.0) * deviation * time, rel=1e-9)
    assert "1.65°" in text() and math.sqrt(2.0) * 7.0 / 6.0 == pytest.approx(1.65, abs=0.005)


def test_the_hump_of_a_gauss_markov_process() -> None:
    process = GaussMarkov(1.0, 1.0)
    found = minimize_scalar(
        lambda tau: -float(process.allan_variance(np.array([tau]))[0]), bounds=(1.0, 3.0)
    )
    assert found.x == pytest.approx(1.89, abs=0.005)
    assert math.sqrt(-found.fun) == pytest.approx(0.664, abs=5e-4)
    assert math.sqrt(-found.fun / process.density) == pytest.approx(0.437, abs=5e-4)
    assert math.sqrt(process.density / 2.0) == pytest.approx(1.08, abs=0.005)
    assert pytest.approx(1.51, abs=0.005) == 1.0 / FLOOR
    late = budget(
        "heading", 1e6, gyro=NoiseModel(B=1.0, T_B=1.0), accel=NOTHING, start=PERFECT
    ).total
    assert late == pytest.approx(1.52e3, rel=2e-3)
    for shown in ("0.664 B", "1.51 times", "1.08 B"):
        assert shown in text()


def test_the_minimum_of_the_curve() -> None:
    assert minimum(GYRO) / (FLOOR * GYRO.B) == pytest.approx(1.04, abs=0.005)
    assert minimum(MTI_7_GYRO) / (FLOOR * MTI_7_GYRO.B) == pytest.approx(2 / 3, abs=0.01)
    assert "4 % in the example" in text() and "two thirds of it" in text()


def test_the_budget_of_the_example() -> None:
    found = budget("heading", 600.0, gyro=GYRO, accel=NOTHING, start=Start.calibrated(60.0))
    shares = {source_text(part.source): math.degrees(part.sigma) for part in found.contributions}
    assert math.degrees(found.total) == pytest.approx(1.9, abs=0.05)
    assert shares["gyro flicker"] == pytest.approx(1.8, abs=0.05)
    assert shares["gyro K"] == pytest.approx(0.41, abs=0.005)
    assert shares["gyro N in the static window"] == pytest.approx(0.39, abs=0.005)
    assert shares["gyro N"] == pytest.approx(0.12, abs=0.005)
    north = Gyrocompass(gyro=NoiseModel(N=GYRO.N), latitude=math.pi / 4).heading(600.0).total
    assert math.degrees(north) == pytest.approx(4.0, abs=0.05)
    for shown in ("of 1.9° after 600 s: 1.8°", "0.41° from K, 0.39°", "0.12°", "give 4.0°"):
        assert shown in text()


@pytest.mark.parametrize(
    ("row", "model", "rate", "hours"),
    [
        ("MTi-7 gyro, T<sub>B</sub> = 89.5 s", MTI_7_GYRO, 100.0, (1.9, 9.6, 72.0)),
        ("MTi-7 accelerometer, T<sub>B</sub> = 38.3 s", MTI_7_ACCEL, 100.0, (1.8, 15.0, 14.0)),
        ("C102-F9R accelerometer, T<sub>B</sub> = 148.9 s", C102_ACCEL, 50.0, (6.2, 28.0, 48.0)),
        ("The example above, with flicker noise", GYRO, 100.0, (1 / 6, None, 164.0)),
    ],
)
def test_the_logs_that_are_needed(
    row: str, model: NoiseModel, rate: float, hours: tuple[float | None, ...]
) -> None:
    shown = [
        figure(cell) / (60.0 if cell.endswith("min") else 1.0)
        for cell in cells(row)[1:]
        if cell != "none"
    ]
    assert shown == pytest.approx([length for length in hours if length])
    for name, length in zip(("B", "T_B", "K"), hours, strict=True):
        if length:
            bound = compute_cramer_rao_bounds(model, rate, length * 3600.0, rate / 2)[name]
            assert bound == pytest.approx(0.1, rel=0.05)
    assert compute_cramer_rao_bounds(model, rate, 15.0, rate / 20)["N"] < 0.1


@pytest.mark.parametrize(
    ("shown", "value", "unit", "other", "dimension", "expected"),
    [
        ("60 °/√h", 1.0, "°/s/√Hz", "°/√h", "gyro_density", 60.0),
        ("1/60 °/√h", 1.0, "°/h/√Hz", "°/√h", "gyro_density", 1 / 60),
        ("2.909·10⁻⁴ rad/s/√Hz", 1.0, "°/√h", "rad/s/√Hz", "gyro_density", 2.909e-4),
        ("206 265 °/h", 1.0, "rad/s", "°/h", "angular_rate", 206265.0),
        ("4.848·10⁻⁶ rad/s", 1.0, "°/h", "rad/s", "angular_rate", 4.848e-6),
        ("9.80665·10⁻⁶ m/s²", 1.0, "µg", "m/s²", "acceleration", 9.80665e-6),
        ("1/60 m/s²/√Hz", 1.0, "m/s/√h", "m/s²/√Hz", "accel_density", 1 / 60),
        ("1700 µg/√Hz", 1.0, "m/s/√h", "µg/√Hz", "accel_density", 1700.0),
        ("8.080·10⁻⁸ rad/s/√s", 1.0, "°/h/√h", "rad/s/√s", "gyro_random_walk", 8.080e-8),
        ("0.34 °/√h", 0.008 / math.sqrt(2.0), "°/s/√Hz", "°/√h", "gyro_density", 0.34),
    ],
)
def test_the_conversions(
    shown: str, value: float, unit: str, other: str, dimension: str, expected: float
) -> None:
    assert shown in text()
    converted = convert_from_si(convert_to_si(value, unit, dimension), other, dimension)
    assert converted == pytest.approx(expected, rel=2e-3)


def _error_at_a_ninth(exponent: int) -> float:
    n = 4000
    return 1.0 / math.sqrt(2.0 * equivalent_degrees(exponent, n, 9 * n - 2 * n + 1))


_FOLDED = math.pi * 0.64 / math.tanh(math.pi * 0.64)
"""Density at 0 Hz of white noise behind 64 Hz, sampled at 100 Hz: the sum of its folds."""


@pytest.mark.parametrize(
    ("shown", "expected", "close"),
    [
        ("standard error of 21 to 27 %", [_error_at_a_ninth(0), _error_at_a_ninth(-2)], 0.006),
        ("half the log, of 71 %", [math.sqrt(0.5)], 0.005),
        ("75 to 170 TB here", [1.9 * 3600 / 89.5, 1.8 * 3600 / 38.3], 0.02),
        ("9.2 times as good", [1 / (0.1 + 0.9 / 100)], 0.005),
        ("t = 12.7), of five it is moderate (2.8)",
         [float(student.ppf(0.975, 1)), float(student.ppf(0.975, 4))], 0.01),
        ("5°/1.96 = 2.55°", [float(student.ppf(0.975, 1e9)), 5 / 1.96], 0.003),
        ("0.0016 °/s, 38 % of the rate",
         [0.0122 / math.sqrt(60), 0.0122 / math.sqrt(60) / math.degrees(EARTH_RATE)], 0.02),
        ("1 % of the Earth's rate stands for 0.57°", [0.01, math.degrees(0.01)], 0.006),
        ("1.44 times the density for 64 Hz at 100 Hz", [math.sqrt(_FOLDED)], 0.003),
        ("frequency 0.37/τ", [1.1656 / math.pi], 0.005),
        ("√10 = 3.2 times better", [math.sqrt(10)], 0.02),
        ("0.1 decades are 26 %", [0.1, 10**0.1 - 1], 0.01),
    ],
)  # fmt: skip
def test_the_other_figures(shown: str, expected: list[float], close: float) -> None:
    assert shown in text()
    numbers = [float(number) for number in re.findall(r"\d+\.?\d*", shown)]
    for value in expected:
        assert any(
            value == pytest.approx(number, rel=close)
            or 100 * value == pytest.approx(number, rel=close)
            for number in numbers
        ), (value, numbers)


def test_where_the_transfer_of_a_tau_is_highest() -> None:
    found = minimize_scalar(lambda x: -(math.sin(x) ** 4) / x**2, bounds=(0.5, 2.0))
    assert found.x == pytest.approx(1.1656, abs=1e-3)


def test_a_flat_earth_overstates_by_up_to_a_tenth() -> None:
    # Schuler feedback: a velocity of a constant error is sin(x)/x of what it would be without.
    x = math.sqrt(9.81 / 6.371e6) * 600.0
    assert 0.05 < 1.0 - math.sin(x) / x < 0.11
    assert "overstates errors by up to a tenth" in text()


def test_what_is_said_of_reading_the_curve_is_of_the_run() -> None:
    assert "Reading the curve is the weakest." in text()
    rows = [
        AccuracyRow(method="curve", parameter=name, logs=100, given=given, rmse=0.3, bias=-0.29,
                    bound=0.04)
        for name, given in (("N", 100), ("B", 17), ("T_B", 17), ("K", 0))
    ]  # fmt: skip
    assert describe_reading(rows) == (
        "In 100 simulated logs of 10 h it finds B in 17, 29 % too small, and K in none: "
    )
    assert describe_reading([]) == ""


def test_the_glossarys_own_figures() -> None:
    known: dict[str, Any] = read_glossary()
    assert "0.9 m in a minute" in known["microg"].short
    assert 0.5 * ACCEL.B * 60.0**2 == pytest.approx(0.9, abs=0.05)
    assert "0.05 is 12 %" in known["score_rms_log10"].short
    assert pytest.approx(1.12, abs=0.005) == 10**0.05
    assert "1.26" in known["decade"].short and pytest.approx(1.26, abs=0.005) == 10**0.1

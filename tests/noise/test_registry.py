"""The registry refuses a term that lacks something; whoever lists terms lists all of them."""

import importlib
import inspect
import pkgutil
from dataclasses import dataclass
from typing import Any, get_args

import pytest
import yaml

from imubench_pipeline.estimators.estimate import FAMILY, SI_UNITS
from imubench_pipeline.estimators.model_choice import CANDIDATE_MODELS
from imubench_pipeline.extensions.figures.style import SYMBOLS
from imubench_pipeline.model.states import NoiseSource
from imubench_pipeline.navigation.verdicts.judgement import PARAMETERS_OF_SOURCE
from imubench_pipeline.noise import (
    PARAMETERS,
    TERMS,
    GaussMarkov,
    NoiseModel,
    RandomWalk,
    Role,
    Sinusoid,
    Term,
    TermParameter,
    WhiteNoise,
    terms,
)
from imubench_pipeline.noise.terms.base import register_terms
from imubench_pipeline.report.palette import TERM_LOOKS, TERM_NAMES
from imubench_pipeline.report.practical import choose_page_unit
from imubench_pipeline.settings.simulated_sensor import AxisSettings
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.words.findings import FINDINGS
from tests.conftest import PROJECT
from tests.noise.examples import example, model_of

GLOSSARY = yaml.safe_load(
    (PROJECT / "src/imubench_pipeline/report/glossary.yaml").read_text(encoding="utf-8")
)


def changed(kind: type[Term], **values: Any) -> type[Term]:
    """Return a kind of term that is like another one, but for some of its class variables."""
    return type(f"Other{kind.__name__}", (kind,), values)


def test_a_term_without_a_part_cannot_be_made_nor_registered() -> None:
    @dataclass(frozen=True)
    class Forgetful(Term):
        G: float

        def allan_variance(self, tau: Any) -> Any:
            return self.G**2 + 0.0 * tau

    with pytest.raises(TypeError, match="abstract"):
        Forgetful(1.0)  # type: ignore[abstract]  # wrong on purpose
    with pytest.raises(TypeError, match=r"Forgetful lacks block_covariance, .*state_space"):
        register_terms(WhiteNoise, Forgetful)


@pytest.mark.parametrize(
    ("kinds", "what"),
    [
        ((WhiteNoise, WhiteNoise), "symbol 'N' belongs to two noise terms"),
        ((WhiteNoise, changed(RandomWalk, word="N")), "word 'N' belongs to two noise terms"),
        (
            (changed(WhiteNoise, parameters=(TermParameter("K", "", 1.0, 0.5),)),),
            r"has parameters \['K'\], but fields \['N'\]",
        ),
        (
            (changed(GaussMarkov, parameters=(
                PARAMETERS["B"], TermParameter("T_B", "", 0.0, 1.0))),),
            "T_B of OtherGaussMarkov is a time without a range",
        ),
        (
            (GaussMarkov, changed(Sinusoid, __annotations__={}, parameters=(
                PARAMETERS["amplitude"], TermParameter("frequency", "", 0.0, 1.0)))),
            "is a time without",
        ),
        ((changed(WhiteNoise, role=Role.GAUSS_MARKOV),), "OtherWhiteNoise has the role"),
        (
            (WhiteNoise, changed(WhiteNoise, symbol="M", word="M", parameters=(
                TermParameter("N", "", 1.0, -0.5),))),
            "N of OtherWhiteNoise is not N of another term",
        ),
    ],
)  # fmt: skip
def test_a_term_that_says_it_wrong_is_refused(kinds: tuple[type[Term], ...], what: str) -> None:
    with pytest.raises(TypeError, match=what):
        register_terms(*kinds)


@pytest.mark.parametrize("name", ["symbol", "label", "standard_name", "word", "role"])
def test_a_term_that_says_nothing_is_refused(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(WhiteNoise, name)
    with pytest.raises(TypeError, match=f"WhiteNoise lacks the class variable {name}"):
        register_terms(WhiteNoise)


def test_every_kind_is_registered() -> None:
    for module in pkgutil.iter_modules(terms.__path__, f"{terms.__name__}."):
        importlib.import_module(module.name)
    known, kinds = {Term}, [Term]
    while kinds:
        more = kinds.pop().__subclasses__()
        kinds += more
        known.update(kind for kind in more if kind.__module__.startswith(terms.__name__))
    lacks = {kind for kind in known if not inspect.isabstract(kind)} - set(TERMS)
    assert not lacks, f"TERMS of noise/terms/__init__.py lacks {lacks}"


@pytest.mark.parametrize("kind", TERMS)
def test_a_model_holds_it_once(kind: type[Term]) -> None:
    term = example(kind)
    assert list(model_of(term).terms) == [term]
    assert model_of(term).name == kind.symbol
    if term.gauss_markov is None and (kind.role is not Role.SLOW or kind.symbol in "FR"):
        with pytest.raises(ValueError, match="cannot be in 'further'"):
            NoiseModel(further=[term])
        with pytest.raises(ValueError, match="cannot be in 'further'"):
            SensorModel(noise=NoiseModel(further=[term]))


@pytest.mark.parametrize("kind", TERMS)
def test_pages_know_it(kind: type[Term]) -> None:
    assert kind.symbol in TERM_LOOKS, f"TERM_LOOKS of report/palette.py lacks {kind}"
    for quantity in ("gyro", "accel"):
        assert "{" not in TERM_NAMES[quantity][kind.symbol]
    symbols = [one.symbol for one in kind.parameters]
    assert kind.word in get_args(NoiseSource)
    assert set(symbols) <= PARAMETERS_OF_SOURCE[kind.word]
    for symbol in symbols:
        assert symbol in SYMBOLS
        for quantity in ("gyro", "accel"):
            assert SI_UNITS[quantity][symbol]
            if kind.role is not Role.NO_NOISE:
                assert choose_page_unit(quantity, symbol, "si").per_si == pytest.approx(1.0)


def test_the_family_of_the_likelihood_is_registered() -> None:
    symbols = {kind.symbol for kind in TERMS}
    glossary = {name for section in GLOSSARY.values() for name in section}
    assert set(FAMILY) <= set(PARAMETERS) & glossary
    assert set(FAMILY) <= set(AxisSettings.model_fields)
    for candidate in CANDIDATE_MODELS:
        assert set(candidate.name.split("+")) <= symbols


def test_what_mends_samples_or_times_mends_parameters_by_their_dimension() -> None:
    for name in FAMILY:
        stated = PARAMETERS[name]
        assert FINDINGS["suspicious_unit"].scales.get(name, 0.0) == stated.signal, name
        assert FINDINGS["rate_implausible"].scales.get(name, 0.0) == stated.seconds, name

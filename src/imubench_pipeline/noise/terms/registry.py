"""Check that the kinds of terms are complete when they are registered."""

from __future__ import annotations

import inspect
from dataclasses import fields

from imubench_pipeline.noise.terms.base import Term
from imubench_pipeline.noise.terms.traits import Role, TermParameter

_REQUIRED_VARIABLES = ("symbol", "label", "standard_name", "word", "role", "parameters", "states")
"""Class variables that every kind must define."""


def register_terms(*kinds: type[Term]) -> tuple[type[Term], ...]:
    """Return the kinds of terms, after checking that each is complete.

    Raises TypeError if a kind lacks a method, a class variable or a search range of a time
    constant, its parameters are not its fields, or two kinds share a symbol or a word, or a symbol
    of different parameters.
    """
    for kind in kinds:
        name = kind.__name__
        if inspect.isabstract(kind):
            missing = ", ".join(sorted(kind.__abstractmethods__))
            raise TypeError(f"the noise term {name} lacks {missing}")
        lacking = [variable for variable in _REQUIRED_VARIABLES if not hasattr(kind, variable)]
        if lacking:
            raise TypeError(f"the noise term {name} lacks the class variable {', '.join(lacking)}")
        symbols = [parameter.symbol for parameter in kind.parameters]
        own = [field.name for field in fields(kind)]
        if symbols != own:
            raise TypeError(f"the noise term {name} states the parameters {symbols}, and has {own}")
        for parameter in kind.parameters:
            if (parameter.signal, parameter.seconds) == (0.0, 1.0) and parameter.search is None:
                raise TypeError(
                    f"{parameter.symbol} of {name} is a time, without the range of a search"
                )
        if (kind.role is Role.GAUSS_MARKOV) != (kind.gauss_markov is not Term.gauss_markov):
            raise TypeError(f"the role of {name} and its process (`gauss_markov`) are not the same")
    for name in ("symbol", "word"):
        stated = [getattr(kind, name) for kind in kinds]
        for value in stated:
            if stated.count(value) > 1:
                raise TypeError(f"{name} {value!r} is that of two noise terms")
    parameters: dict[str, TermParameter] = {}
    for kind in kinds:
        for parameter in kind.parameters:
            if parameters.setdefault(parameter.symbol, parameter) != parameter:
                raise TypeError(f"{parameter.symbol} is another parameter in {kind.__name__}")
    return kinds

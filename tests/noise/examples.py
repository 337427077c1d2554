"""Terms of every kind in the registry, made from what each states of its parameters."""

from imubench_pipeline.noise import (
    TERMS,
    Deterministic,
    Flicker,
    NoiseModel,
    Sinusoid,
    Term,
    TermParameter,
)


def value(parameter: TermParameter, time: float, size: float = 0.3) -> float:
    """Return a value: of a time constant, of a frequency, or of what goes with the signal."""
    if parameter.signal == 0.0:
        return time**parameter.seconds
    return -size if parameter.signed else size


def example(kind: type[Term], time: float = 1.7, size: float = 0.3) -> Term:
    return kind(**{one.symbol: value(one, time, size) for one in kind.parameters})


def times_of(kind: type[Term]) -> tuple[float, ...]:
    """Return times of an example: a short and a long one where the kind has a time of its own."""
    return (1.7, 230.0) if any(one.signal == 0.0 for one in kind.parameters) else (1.7,)


EXAMPLES = tuple(example(kind, time) for kind in TERMS for time in times_of(kind))

NOISES = tuple(term for term in EXAMPLES if not isinstance(term, Deterministic))


def named(term: Term) -> str:
    return repr(term)


def model_of(*terms: Term) -> NoiseModel:
    """Return a noise model of terms, each in its place."""
    own = {"Q", "N", "K", "R"}
    values = {term.symbol: term.values[term.symbol] for term in terms if term.symbol in own}
    flicker = [term.B for term in terms if isinstance(term, Flicker)]
    return NoiseModel(
        **values,
        B=sum(flicker),
        further=[term for term in terms if not isinstance(term, Flicker | Sinusoid)
                 and term.symbol not in own],
        sinusoids=[term for term in terms if isinstance(term, Sinusoid)],
    )  # fmt: skip

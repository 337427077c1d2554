"""Rows of the table ``ranking`` from rows of the others, as its step makes them."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from imubench_pipeline.navigation.selection import ranked
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import judgements
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.typing import Row


def ranking_rows(
    errors: Iterable[Row],
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Mapping[str, Any]],
    recordings: Iterable[Row] = (),
    doubts: Iterable[Row] = (),
    parameters: Iterable[Row] = (),
    backtests: Iterable[Row] = (),
) -> Iterator[Row]:
    basis = Basis.of(recordings, doubts, parameters, backtests)
    return ranked(list(judgements(errors, requirements, sensors, basis)), basis)

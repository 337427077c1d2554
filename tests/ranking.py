"""Rows of the table ``ranking`` from rows of the others, as its step makes them."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from imubench_pipeline.model.comparisons import ErrorBudgetRow, RankingRow
from imubench_pipeline.model.estimates import BacktestRow, ParameterRow
from imubench_pipeline.model.recordings import DoubtRow, RecordingRow
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.navigation.selection import rank_sensors
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import judge_sensors
from imubench_pipeline.settings.requirements import Requirement
from tests.rows import typed


def ranking_rows(
    errors: Iterable[TableRow],
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Mapping[str, Any]],
    recordings: Iterable[TableRow] = (),
    doubts: Iterable[TableRow] = (),
    parameters: Iterable[TableRow] = (),
    backtests: Iterable[TableRow] = (),
) -> Iterator[RankingRow]:
    basis = Basis.of(
        typed(RecordingRow, recordings),
        typed(DoubtRow, doubts),
        typed(ParameterRow, parameters),
        typed(BacktestRow, backtests),
    )
    judged = judge_sensors(typed(ErrorBudgetRow, errors), requirements, sensors, basis)
    return rank_sensors(list(judged), basis)

"""Curves and estimates as rows of the tables, and estimates back from them."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators.estimate import (
    CURVE,
    FAMILY,
    SI_UNITS,
    Estimate,
    JointDraws,
    Parameter,
)
from imubench_pipeline.model.estimates import AllanRow, DrawRow, ParameterRow
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.files import read
from imubench_pipeline.tables.keys import Key, split_table

R = TypeVar("R")


def make_allan_rows(key: Key, curve: AllanCurve) -> Iterator[AllanRow]:
    """Yield the rows of the table ``allan``."""
    names = ("cluster_size", "averaged", "exponent", "share")
    return make_curve_rows(AllanRow, key, curve, **{name: getattr(curve, name) for name in names})


def make_curve_rows(
    kind: Callable[..., R], key: Key, curve: AllanCurve, **more: NDArray[Any]
) -> Iterator[R]:
    """Yield rows of a measured curve with 95 % limits, and with more columns, shape (m,)."""
    columns = {"tau": curve.tau, "adev": curve.deviation, "edf": curve.edf, **more}
    columns["edf_upper"] = curve.edf_upper
    columns["lower"], columns["upper"] = curve.limits(0.95)
    numbers = zip(*(column.tolist() for column in columns.values()), strict=True)
    for row, source in zip(numbers, curve.edf_source, strict=True):
        yield kind(**asdict(key), **dict(zip(columns, row, strict=True)), edf_source=source)


def make_parameter_rows(
    key: Key, estimate: Estimate, *, recommended: bool
) -> Iterator[ParameterRow]:
    """Yield the rows of the table ``parameters``."""
    units = SI_UNITS[quantity_of(key.channel)]
    for component, name, parameter in estimate.components():
        yield ParameterRow(
            **asdict(key),
            method=estimate.method,
            recommended=recommended,
            model=estimate.model.name,
            component=component,
            parameter=name,
            unit=units[name],
            **asdict(parameter),
        )


def make_draw_rows(key: Key, estimate: Estimate) -> Iterator[DrawRow]:
    """Yield the rows of the table ``draws``; none for an estimate without joint draws."""
    if estimate.draws is None:
        return
    for number, (first, further) in enumerate(
        zip(estimate.draws.first.tolist(), estimate.draws.further.tolist(), strict=True)
    ):
        draw = partial(DrawRow, **asdict(key), method=estimate.method, draw=number)
        nonzero = {name: value for name, value in zip(FAMILY, first, strict=True) if value}
        yield draw(component=1, **nonzero)
        for component, (B, T_B) in enumerate(further, start=2):
            if B:
                yield draw(component=component, B=B, T_B=T_B)


def read_draws(path: Path) -> dict[tuple[str, str], JointDraws]:
    """Read the table ``draws`` of a recording: joint draws by channel and method."""
    joint_draws = {}
    for (channel, method), table in split_table(read("draws", [path]), "channel", "method").items():
        columns = {name: table[name].to_numpy().astype(np.float64) for name in FAMILY}
        draw, component = table["draw"].to_numpy(), table["component"].to_numpy()
        count = int(draw.max()) + 1
        first = np.zeros((count, len(FAMILY)))
        further = np.tile([0.0, np.nan], (count, int(component.max()) - 1, 1))
        for place, name in enumerate(FAMILY):
            own = component == 1
            values = columns[name][own]
            first[draw[own], place] = values if name == "T_B" else np.nan_to_num(values)
        for number in range(further.shape[1]):
            own = component == number + 2
            further[draw[own], number] = np.column_stack((columns["B"][own], columns["T_B"][own]))
        joint_draws[str(channel), str(method)] = JointDraws(first, further)
    return joint_draws


def read_recommended_estimates(path: Path, joint: Path | None = None) -> dict[str, Estimate]:
    """Read the recommended estimate of each channel (see `read_estimates`)."""
    every = read_estimates(path, joint, recommended=True)
    return {channel: by_method[0] for channel, by_method in every.items()}


def read_estimates(
    path: Path, joint: Path | None = None, *, recommended: bool = False
) -> dict[str, list[Estimate]]:
    """Read the estimates of a recording by channel, with joint draws if their path is given."""
    table = read("parameters", [path])
    table = table.filter(table["recommended"]) if recommended else table
    drawn = read_draws(joint) if joint is not None else {}
    estimates_of_channels: dict[str, list[Estimate]] = {}
    for (channel, method), rows in split_table(table, "channel", "method").items():
        estimate = make_estimate(method, ParameterRow.rows_of(rows))
        estimate = replace(estimate, draws=drawn.get((channel, method)))
        estimates_of_channels.setdefault(channel, []).append(estimate)
    return estimates_of_channels


def make_estimate(method: str, rows: Iterable[ParameterRow]) -> Estimate:
    """Return the estimate of a method from its rows of the table ``parameters``."""
    components: dict[int, dict[str, Parameter]] = {}
    lines: dict[int, dict[str, Parameter]] = {}
    of_curve: dict[str, Parameter] = {}
    for row in rows:
        name = row.parameter
        group = lines if name in ("amplitude", "frequency") else components
        place = of_curve if name in CURVE else group.setdefault(row.component, {})
        place[name] = Parameter(
            **{field.name: getattr(row, field.name) for field in fields(Parameter)}
        )
    first = components.pop(1, {})
    return Estimate(method, first, list(components.values()), list(lines.values()), of_curve)

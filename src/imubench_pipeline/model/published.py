"""Figures printed in papers, and how often intervals of simulated logs hold the truth."""

from __future__ import annotations

from typing import Annotated

from imubench_pipeline.model.table import (
    ChannelRow,
    Column,
    LowerLimit,
    SensorRow,
    TableRow,
    UpperLimit,
    table,
)


@table("coverage")
class CoverageRow(SensorRow):
    """A row of the table ``coverage``."""

    vendor: Annotated[str, Column("of the sensor")]
    model: Annotated[str, Column("of the sensor")]
    quantity: Annotated[str, Column("gyro or accel")]
    figure: Annotated[str, Column("N, B, K, T_B, temperature_coefficient or offset")]
    published: Annotated[str, Column("yes, no, other convention, not looked up")]
    as_printed: Annotated[str | None, Column("every figure of it")] = None
    document: Annotated[str | None, Column("with its revision")] = None
    source: Annotated[str | None, Column("primary or secondary")] = None


@table("coverage_by_vendor")
class VendorCoverageRow(TableRow):
    """A row of the table ``coverage_by_vendor``."""

    vendor: Annotated[str, Column("of the sensors")]
    quantity: Annotated[str, Column("gyro or accel")]
    figure: Annotated[str, Column("N, B, K, T_B, temperature_coefficient or offset")]
    sensors: Annotated[int, Column("of the vendor in the catalogue")]
    yes: Annotated[int, Column("that have it published")]
    other_convention: Annotated[int, Column("that have something akin")]
    no: Annotated[int, Column("that do not")]
    not_looked_up: Annotated[int, Column("that nobody looked it up for")]


@table("published")
class PublishedRow(TableRow):
    """A row of the table ``published``."""

    paper: Annotated[str, Column("its authors")]
    place: Annotated[str, Column("table, figure, equation or section, with its number there")]
    quantity: Annotated[str, Column("of what, in words")]
    printed_as: Annotated[
        str,
        Column("as printed, with its unit; derived: what follows from it alone"),
    ]
    printed: Annotated[float | None, Column("the same; null: it is no number", "as in unit")] = None
    found: Annotated[float | None, Column("what is found here", "as in unit")] = None
    lower: Annotated[
        float | None,
        Column("lower limit of it, 95 % where no other is said", "as in unit"),
    ] = None
    upper: Annotated[float | None, Column("upper limit of it", "as in unit")] = None
    found_words: Annotated[str | None, Column("beside the number, or in its place")] = None
    ratio: Annotated[float | None, Column("found over printed")] = None
    tolerance: Annotated[
        float | None,
        Column("how far from 1 a ratio still agrees; null: there is no ratio"),
    ] = None
    unit: Annotated[str, Column("SI unit of the numbers")]
    printed_unit: Annotated[str, Column("unit in which the paper prints it")]
    scale: Annotated[float, Column("one printed unit", "as in unit")]
    basis: Annotated[
        str,
        Column("come back, simulated, computed or checked: what is found rests on that"),
    ]
    verdict: Annotated[
        str,
        Column("agrees, differs, possible, refuted, misprint, done here or not to be had"),
    ]
    reason: Annotated[str | None, Column("why they differ")] = None
    page: Annotated[str | None, Column("of the report, where its counterpart is")] = None
    check: Annotated[str, Column("test or benchmark that stands behind the line")]


@table("accuracy")
class AccuracyRow(TableRow):
    """A row of the table ``accuracy``."""

    method: Annotated[str, Column("estimation method; likelihood_gm with the papers' model alone")]
    parameter: Annotated[str, Column("N, B, T_B or K")]
    logs: Annotated[int, Column("simulated")]
    given: Annotated[int, Column("of them that the method gives a value for")]
    rmse: Annotated[
        float | None,
        Column("root mean square error of these values over the truth"),
    ] = None
    bias: Annotated[float | None, Column("their mean error over the truth")] = None
    bound: Annotated[float, Column("Cramér-Rao bound of the standard deviation over the truth")]
    ratio: Annotated[float | None, Column("rmse over bound")] = None
    ratio_lower: Annotated[float | None, Column("lower 95 % limit of it, as logs are few")] = None
    ratio_upper: Annotated[float | None, Column("upper 95 % limit of it")] = None


@table("published_figures")
class PublishedFigureRow(ChannelRow):
    """A row of the table ``published_figures``."""

    place: Annotated[str, Column("table of the source")]
    figure: Annotated[str, Column("its name there")]
    printed: Annotated[str, Column("as printed, with its unit")]
    of: Annotated[str, Column("log or datasheet: the subject of the figure")]
    parameter: Annotated[str, Column("N, B, bias or sensitivity")]
    means: Annotated[float, Column("value as that parameter", "as in unit")]
    unit: Annotated[str, Column("SI unit of the numbers")]
    truth: Annotated[float | None, Column("of the simulation", "as in unit")] = None
    curve: Annotated[
        float | None,
        Column("read from the curve of the simulated log; mean of the log", "as in unit"),
    ] = None
    value: Annotated[
        float | None,
        Column("as the recommended method estimates it of that log", "as in unit"),
    ] = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    datasheet: Annotated[
        float | None,
        Column("of the sensor file, in the convention of N and B", "as in unit"),
    ] = None
    datasheet_upper: Annotated[
        float | None,
        Column("the largest of several, or of two readings", "as in unit"),
    ] = None
    reason: Annotated[str | None, Column("why the printed figure differs")] = None

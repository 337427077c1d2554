"""Rows of the printed values of papers, with the computed values."""

from typing import Annotated

from imubench_pipeline.model.table import Column, TableRow, table


@table("published")
class PublishedRow(TableRow):
    """A row of the table ``published``."""

    paper: Annotated[str, Column("its authors")]
    place: Annotated[str, Column("table, figure, equation or section, with its number there")]
    quantity: Annotated[str, Column("quantity, in words")]
    printed_as: Annotated[str, Column("as printed, with unit; derived: follows from it alone")]
    printed: Annotated[
        float | None, Column("the same as a number; null: not a number", "as in unit")
    ] = None
    found: Annotated[float | None, Column("result of this project", "as in unit")] = None
    lower: Annotated[float | None, Column("lower limit, 95 % by default", "as in unit")] = None
    upper: Annotated[float | None, Column("upper limit", "as in unit")] = None
    found_words: Annotated[
        str | None, Column("result in words, in addition to the number or instead of it")
    ] = None
    ratio: Annotated[float | None, Column("found over printed")] = None
    tolerance: Annotated[float | None, Column("of the ratio from 1; null: no ratio")] = None
    unit: Annotated[str, Column("SI unit of the numbers")]
    printed_unit: Annotated[str, Column("unit in which the paper prints it")]
    scale: Annotated[float, Column("one printed unit", "as in unit")]
    basis: Annotated[str, Column("basis of the result: come back, simulated, computed or checked")]
    verdict: Annotated[
        str, Column("agrees, differs, possible, refuted, misprint, new result or not available")
    ]
    reason: Annotated[str | None, Column("why they differ")] = None
    page: Annotated[str | None, Column("page of the report with its counterpart")] = None
    check: Annotated[str, Column("test or benchmark of the line")]


@table("accuracy")
class AccuracyRow(TableRow):
    """A row of the table ``accuracy``."""

    method: Annotated[str, Column("estimation method; likelihood_gm with the papers' model alone")]
    parameter: Annotated[str, Column("N, B, T_B or K")]
    logs: Annotated[int, Column("simulated")]
    given: Annotated[int, Column("number of logs for which the method gives a value")]
    rmse: Annotated[float | None, Column("root mean square error over the truth")] = None
    bias: Annotated[float | None, Column("mean error of these values over the truth")] = None
    bound: Annotated[float, Column("Cramér-Rao bound of the standard deviation over the truth")]
    ratio: Annotated[float | None, Column("rmse over bound")] = None
    ratio_lower: Annotated[float | None, Column("lower 95 % limit for this number of logs")] = None
    ratio_upper: Annotated[float | None, Column("upper 95 % limit for this number of logs")] = None

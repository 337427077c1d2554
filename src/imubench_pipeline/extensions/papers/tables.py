"""Rows of the printed values of papers, with the computed values."""

from typing import Annotated

from imubench_pipeline.model.table import TableRow, table


@table("published")
class PublishedRow(TableRow):
    paper: Annotated[str, "its authors"]
    place: Annotated[str, "table, figure, equation or section, with its number there"]
    quantity: Annotated[str, "quantity, in words"]
    printed_as: Annotated[str, "as printed, with unit; derived: follows from it alone"]
    printed: Annotated[float | None, "the same as a number; null: not a number", "as in unit"] = (
        None
    )
    found: Annotated[float | None, "result of this project", "as in unit"] = None
    lower: Annotated[float | None, "lower limit, 95 % by default", "as in unit"] = None
    upper: Annotated[float | None, "upper limit", "as in unit"] = None
    found_words: Annotated[
        str | None, "result in words, in addition to the number or instead of it"
    ] = None
    ratio: Annotated[float | None, "found over printed"] = None
    tolerance: Annotated[float | None, "of the ratio from 1; null: no ratio"] = None
    unit: Annotated[str, "SI unit of the numbers"]
    printed_unit: Annotated[str, "unit in which the paper prints it"]
    scale: Annotated[float, "one printed unit", "as in unit"]
    basis: Annotated[str, "basis of the result: round trip, simulated, computed or checked"]
    verdict: Annotated[
        str, "agrees, differs, possible, refuted, misprint, new result or not available"
    ]
    reason: Annotated[str | None, "why they differ"] = None
    page: Annotated[str | None, "page of the report with its counterpart"] = None
    check: Annotated[str, "test or benchmark of the line"]


@table("accuracy")
class AccuracyRow(TableRow):
    method: Annotated[str, "estimation method; likelihood_gm with the papers' model alone"]
    parameter: Annotated[str, "N, B, T_B or K"]
    logs: Annotated[int, "simulated"]
    given: Annotated[int, "number of logs for which the method gives a value"]
    rmse: Annotated[float | None, "root mean square error over the truth"] = None
    bias: Annotated[float | None, "mean error of these values over the truth"] = None
    bound: Annotated[float, "Cramér-Rao bound of the standard deviation over the truth"]
    ratio: Annotated[float | None, "rmse over bound"] = None
    ratio_lower: Annotated[float | None, "lower 95 % limit for this number of logs"] = None
    ratio_upper: Annotated[float | None, "upper 95 % limit for this number of logs"] = None

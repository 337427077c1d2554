"""Several sensors together, and what a source prints of those on a board."""

from __future__ import annotations

from typing import Annotated

from imubench_pipeline.model.table import ChannelRow, Column, LowerLimit, UpperLimit, table


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

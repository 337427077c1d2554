"""The tables of what the papers print, line by line, and of how far their methods reach."""

from __future__ import annotations

from imubench_pipeline.tables.columns import count, number, text

PUBLISHED = (
    text("paper", "its authors"),
    text("place", "table, figure, equation or section, with its number there"),
    text("quantity", "of what, in words"),
    text("printed_as", "as printed, with its unit; derived: what follows from it alone"),
    number("printed", "as in unit", "the same; null: it is no number"),
    number("found", "as in unit", "what is found here"),
    number("lower", "as in unit", "lower limit of it, 95 % where no other is said"),
    number("upper", "as in unit", "upper limit of it"),
    text("found_words", "beside the number, or in its place", required=False),
    number("ratio", "-", "found over printed"),
    number("tolerance", "-", "how far from 1 a ratio still agrees; null: there is no ratio"),
    text("unit", "SI unit of the numbers"),
    text("printed_unit", "unit in which the paper prints it"),
    number("scale", "as in unit", "one printed unit", required=True),
    text("basis", "come back, simulated, computed or checked: what is found rests on that"),
    text("verdict", "agrees, differs, possible, refuted, misprint, done here or not to be had"),
    text("reason", "why they differ", required=False),
    text("page", "of the report, where its counterpart is", required=False),
    text("check", "test or benchmark that stands behind the line"),
)
"""Every number is SI."""

ACCURACY = (
    text("method", "estimation method; likelihood_gm with the papers' model alone"),
    text("parameter", "N, B, T_B or K"),
    count("logs", "simulated", required=True),
    count("given", "of them that the method gives a value for", required=True),
    number("rmse", "-", "root mean square error of these values over the truth"),
    number("bias", "-", "their mean error over the truth"),
    number("bound", "-", "Cramér-Rao bound of the standard deviation over the truth", True),
    number("ratio", "-", "rmse over bound"),
    number("ratio_lower", "-", "lower 95 % limit of it, as logs are few"),
    number("ratio_upper", "-", "upper 95 % limit of it"),
)
"""How far the methods are from the bound, on simulated logs of one channel."""

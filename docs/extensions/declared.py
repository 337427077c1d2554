"""The reference of tables, findings, statuses, formats, targets and noise terms."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from extensions.markdown import cell, code, table
from imubench_pipeline.extensions.exports.targets import TARGETS, list_targets
from imubench_pipeline.model.table import TypedColumn
from imubench_pipeline.noise.terms import TERMS
from imubench_pipeline.readers.formats import FILE_FORMATS
from imubench_pipeline.report.glossary import Term, read_glossary
from imubench_pipeline.run.formats_command import Line, list_log_formats
from imubench_pipeline.tables.schemas import TABLES
from imubench_pipeline.words.verdicts import VERDICT_MEANINGS, VERDICT_WORDS


def substitutions() -> dict[str, int | str]:
    """Return the counts of programs, sensors and formats, and the words of verdicts, for pages."""
    sensors = Path(__file__).parents[2] / "config/sensors"
    return {
        "programs": len(TARGETS),
        "sensors": sum("sold: false" not in file.read_text() for file in sensors.glob("*.yaml")),
        "formats": len(FILE_FORMATS),
        **dict(VERDICT_WORDS.items()),
    }


def verdicts() -> str:
    """Return the verdicts on a sensor with their words and probabilities."""
    words = {**VERDICT_WORDS, "meets_if": f"{VERDICT_WORDS['meets_if']} if …"}
    rows = ((code(v), cell(words[v]), cell(VERDICT_MEANINGS[v])) for v in VERDICT_WORDS)
    return table(("`verdict`", "the page says", "meaning"), rows)


def tables() -> str:
    """Return the columns of every table."""
    return "\n".join(
        f"(table-{name})=\n## {name}\n\n"
        + table(
            ("column", "type", "unit", "meaning"),
            (
                (
                    code(column.name),
                    _describe_type(column),
                    cell(column.unit),
                    cell(column.meaning),
                )
                for column in columns
            ),
        )
        for name, columns in TABLES.items()
    )


def _describe_type(column: TypedColumn) -> str:
    kind = f"one of {', '.join(column.values)}" if column.values else str(column.type)
    return cell(f"{kind}{'' if column.required else ' or null'}")


def findings() -> str:
    """Return what is found in logs, and what to do about it."""
    rows = (
        (code(term.key), cell(term.short), cell(term.action))
        for term in read_glossary().values()
        if term.action
    )
    return table(("finding", "what it says", "what to do"), rows)


_STATUSES = ("ok", "doubtful", "not_shown", "at_bound", "not_identified", "absent")


def statuses() -> str:
    """Return what the status of an estimated figure says."""
    terms = read_glossary()
    return table(("status", "what it says"), ((code(s), cell(terms[s].short)) for s in _STATUSES))


def terms_of_the_report() -> str:
    """Return every word of the report, by the section that it stands in."""
    sections: dict[str, list[Term]] = {}
    for term in read_glossary().values():
        if not term.action:
            sections.setdefault(term.section, []).append(term)
    return "\n".join(
        f"## {section.replace('-', ' ').capitalize()}\n\n"
        + table(("term", "meaning"), ((cell(term.name), cell(term.short)) for term in found))
        for section, found in sections.items()
    )


def formats() -> str:
    """Return the logs that are read."""
    return _of_lines(list_log_formats()[1])


def targets() -> str:
    """Return the programs that files are written for."""
    return _of_lines(list_targets()[1])


def which_numbers() -> str:
    """Return a section for each program, with the numbers of its file."""
    heads = ("number in the file", "of", "value", "unit", "convention")
    sections = []
    for target in TARGETS.values():
        if not target.entries:
            continue
        rows = (
            (
                code(entry.name),
                {"both": "gyro and accel"}.get(entry.quantity, entry.quantity),
                code(entry.form.formula),
                code(entry.unit),
                cell(entry.form.convention),
            )
            for entry in target.entries
        )
        about = (
            f"`imubench export --target {target.name}` writes `{target.file_name}`, with terms "
            f"{target.family}. [Source]({target.source})"
        )
        sections.append(f"## {target.title}\n\n{about}\n\n{table(heads, rows)}")
    return "\n".join(sections)


def _of_lines(lines: Iterable[Line]) -> str:
    heads, *rows = lines
    return table(heads, ((code(first), *map(cell, rest)) for first, *rest in rows))


def noise_terms() -> str:
    """Return every kind of noise term with its parameters."""
    rows = (
        (
            code(kind.symbol),
            cell((kind.__doc__ or "").split("\n")[0]),
            ", ".join(code(parameter.symbol) for parameter in kind.parameters),
        )
        for kind in TERMS
    )
    return table(("in the name of a model", "what", "parameters"), rows)

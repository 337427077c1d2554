"""The reference of the command line, from the parsers of its commands."""

from __future__ import annotations

import argparse

from extensions.markdown import cell, code, table
from imubench_pipeline.run.cli import COMMANDS, make_parser


def commands() -> str:
    """Return a section for every command."""
    parser = make_parser()
    (choice,) = (
        action for action in parser._actions if isinstance(action, argparse._SubParsersAction)
    )
    helps = {action.dest: action.help or "" for action in choice._choices_actions}
    return "\n".join(
        _section(name, helps[name], command) for name, command in choice.choices.items()
    )


def exit_statuses() -> str:
    """Return what the exit statuses of every command mean."""
    rows = (
        (f"[{code(name)}](#command-{name})", *map(cell, (*command.statuses, "", "")[:3]))
        for name, command in COMMANDS.items()
    )
    return table(("command", "0", "1", "2"), rows)


def _section(name: str, summary: str, parser: argparse.ArgumentParser) -> str:
    usage = " ".join(parser.format_usage().removeprefix("usage: ").split())
    rows = [
        (_spelled(action), cell(_explained(parser, action)))
        for action in parser._actions
        if not isinstance(action, argparse._HelpAction)
    ]
    options = table(("argument", "meaning"), rows) if rows else ""
    said = " ".join(filter(None, (parser.description, parser.epilog)))
    about = f"{cell(said)}\n\n" if said else ""
    first = summary[:1].upper() + summary[1:]
    return (
        f"(command-{name})=\n## imubench {name}\n\n{cell(first)}.\n\n"
        f"```text\n{usage}\n```\n\n{about}{options}"
    )


def _spelled(action: argparse.Action) -> str:
    value = action.metavar or (action.dest.upper() if action.option_strings else action.dest)
    if action.choices:
        value = " | ".join(map(str, action.choices))
    if not action.option_strings:
        return code(value)
    takes = "" if action.nargs == 0 else f" {value}"
    return ", ".join(code(f"{option}{takes}") for option in action.option_strings)


def _explained(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    formatter = parser._get_formatter()
    return formatter._expand_help(action) if action.help else ""

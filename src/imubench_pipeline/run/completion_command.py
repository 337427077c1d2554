"""`imubench completion`: what a shell needs to complete the commands and their options."""

from __future__ import annotations

import argparse

import shtab

from imubench_pipeline.settings.command_line import named_path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command is given."""
    parser.description = (
        'Print a script for the shell. Now: eval "$(imubench completion bash)"; always: put that '
        "line into ~/.bashrc, for zsh the script as _imubench into a folder of $fpath."
    )
    parser.add_argument("shell", choices=shtab.SUPPORTED_SHELLS, help="which shell")


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Return the script for a shell; where a path is asked for, files are what it completes."""
    of_commands = next(
        action for action in parser._actions if isinstance(action, argparse._SubParsersAction)
    )
    for command in of_commands.choices.values():
        for action in command._actions:
            if action.type is named_path:
                action.complete = shtab.FILE
    return shtab.complete(parser, shell)

"""Steps of the workflow in this process, for one recording, as its rules have them.

Snakemake takes a second to begin, which for thousands of short logs is more than what they cost.
So input, output and parameters of a rule are read from ``workflow/rules``, where they are the
arguments of a call, and its script runs with them.
"""

from __future__ import annotations

import re
import runpy
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from imubench_pipeline import registry
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.tables import schemas

PROJECT = Path(__file__).parents[1]

_FILES = ("common", "recordings", "sensors")
_RULE = re.compile(r"^rule (\w+):\n((?:[ ].*\n|\n)*)", re.MULTILINE)
_SECTION = re.compile(r"^    (input|output|params):\n((?:        .*\n|\n)*)", re.MULTILINE)
_UNUSED = re.compile(r"^\w+:\n(?:    .*\n)*|\A[\s\S]*?(?=^RESULTS)", re.MULTILINE)


class Named(SimpleNamespace):
    """What a script sees as its input, output and so on: by name, or by place."""

    def __init__(self, *unnamed: Any, **named: Any) -> None:
        super().__init__(**named)
        self._unnamed = unnamed

    def items(self) -> Iterable[tuple[str, Any]]:
        """Return names and values."""
        return [(name, value) for name, value in vars(self).items() if name != "_unnamed"]

    def keys(self) -> list[str]:
        """Return the names."""
        return [name for name, _ in self.items()]

    def __iter__(self) -> Iterator[Any]:
        yield from self._unnamed
        yield from (value for _, value in self.items())

    def __getitem__(self, place: int | str) -> Any:
        return getattr(self, place) if isinstance(place, str) else list(self)[place]


class OneRecording:
    """The only recording of a run.

    Parameters
    ----------
    plan : Plan
        Of the run.
    """

    def __init__(self, plan: Plan) -> None:
        ((self.sensor, self.recording),) = plan.recordings
        self.folder = plan.run.results / "recordings" / self.sensor / self.recording
        self.folder.mkdir(parents=True, exist_ok=True)
        self._of = {"sensor": self.sensor, "recording": self.recording}
        self._names: dict[str, Any] = (
            vars(registry)
            | vars(schemas)
            | {
                "plan": _Uncoded(plan),
                "rules": _Rules(self),
            }
        )
        for code in _between_rules():
            exec(code, self._names)

    def run(self, rule: str, **instead: Any) -> Named:
        """Run the script of a rule.

        Parameters
        ----------
        rule : str
        **instead : Named
            ``output`` and so on, where they are to be others than those of the rule.

        Returns
        -------
        Named
            The output.
        """
        given = {
            section: instead.get(section) or self.called(rule, section) for section in _SECTIONS
        }
        snakemake = SimpleNamespace(**given, wildcards=Named(**self._of))
        script = PROJECT / "workflow/scripts" / f"{rule}.py"
        runpy.run_path(str(script), init_globals={"snakemake": snakemake}, run_name="__main__")
        return given["output"]

    def input(self, rule: str) -> Named:
        """Return the input of a rule, those files of it that are there."""
        wanted = self.called(rule, "input")
        there = {name: files for name, files in wanted.items() if Path(files[0]).exists()}
        return Named(**there)

    def called(self, rule: str, section: str) -> Named:
        """Return the input, output or params of a rule."""
        arguments = _rules()[rule].get(section, "")
        found: Named = eval(f"_Named(\n{arguments})", {**self._names, "_Named": Named})
        return Named(**{name: self._filled(value) for name, value in found.items()})

    def _filled(self, value: Any) -> Any:
        """Return what stands in a rule, for this recording."""
        if callable(value):
            return self._filled(value(_Wildcards(self._of)))
        if isinstance(value, list):
            return [self._filled(one) for one in value]
        return value.format(**self._of) if isinstance(value, str) and "{sensor}" in value else value


class _Wildcards(dict[str, str]):
    def __getattr__(self, name: str) -> str:
        return self[name]


class _Rules:
    """The rules as other rules see them."""

    def __init__(self, recording: OneRecording) -> None:
        self._recording = recording

    def __getattr__(self, rule: str) -> Any:
        return SimpleNamespace(output=self._recording.called(rule, "output"))


class _Uncoded:
    """A plan without the digests of the code, which matter to a second run alone."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def code(self, step: str) -> str:
        return ""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plan, name)


_SECTIONS = ("input", "output", "params")


def _texts() -> Iterator[str]:
    for name in _FILES:
        yield (PROJECT / f"workflow/rules/{name}.smk").read_text(encoding="utf-8")


@cache
def _rules() -> dict[str, dict[str, str]]:
    """Return the arguments of input, output and params of each rule, as text."""
    return {
        rule: dict(_SECTION.findall(body))
        for text in _texts()
        for rule, body in _RULE.findall(text)
    }


@cache
def _between_rules() -> list[Any]:
    """Return the code between the rules: the names that these use."""
    return [compile(_UNUSED.sub("", _RULE.sub("", text)), "rules", "exec") for text in _texts()]

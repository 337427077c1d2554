"""Steps of the workflow in this process, for one recording, as the Snakefile has them.

Snakemake takes a second to begin, which for thousands of short logs is more than what they cost.
So input, output and parameters of a rule are read from the Snakefile, where they are the arguments
of a call, and its script runs with them.
"""

from __future__ import annotations

import re
import runpy
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from imubench_pipeline.run.plan import Plan
from imubench_pipeline.tables import schemas

PROJECT = Path(__file__).parents[1]

_RULE = re.compile(r"^rule (\w+):\n((?:[ ].*\n|\n)*)", re.MULTILINE)
_SECTION = re.compile(r"^    (input|output|params):\n((?:        .*\n|\n)*)", re.MULTILINE)
_TUPLE = re.compile(r"^([A-Z_]+) = (\(\n(?:    .*\n)*\))", re.MULTILINE)


class Named(SimpleNamespace):
    """What a script sees as its input, output and so on: by name, or by place."""

    def __init__(self, *unnamed: Any, **named: Any) -> None:
        super().__init__(**named)
        self._unnamed = unnamed

    def items(self) -> Iterable[tuple[str, Any]]:
        """Return names and values."""
        return [(name, value) for name, value in vars(self).items() if name != "_unnamed"]

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
        self._names: dict[str, Any] = vars(schemas) | {
            "FOLDER": str(self.folder),
            "RESULTS": str(plan.run.results),
            "plan": _Uncoded(plan),
            "of_sensor": lambda file: [f"{self.folder}/{file}"],
        }
        for name, text in _tuples():
            self._names[name] = eval(text, self._names)

    def run(self, rule: str, **instead: Any) -> Named:
        """Run the script of a rule.

        Parameters
        ----------
        rule : str
        **instead : Named
            ``output`` and so on, where they are to be others than those in the Snakefile.

        Returns
        -------
        Named
            The output.
        """
        given = {
            section: instead.get(section) or self._called(text)
            for section, text in _rules()[rule].items()
        }
        about = Named(sensor=self.sensor, recording=self.recording)
        snakemake = SimpleNamespace(**{"input": Named()} | given | {"wildcards": about})
        script = PROJECT / "workflow/scripts" / f"{rule}.py"
        runpy.run_path(str(script), init_globals={"snakemake": snakemake}, run_name="__main__")
        return given["output"]

    def input(self, rule: str) -> Named:
        """Return the input of a rule, those files of it that are there."""
        wanted = self._called(_rules()[rule]["input"])
        there = {name: files for name, files in wanted.items() if Path(files[0]).exists()}
        return Named(**there)

    def _called(self, arguments: str) -> Named:
        about = SimpleNamespace(sensor=self.sensor, recording=self.recording)
        found: Named = eval(f"_Named(\n{arguments})", {**self._names, "_Named": Named})
        values = {name: value(about) if callable(value) else value for name, value in found.items()}
        return Named(*(v(about) if callable(v) else v for v in found._unnamed), **values)


class _Uncoded:
    """A plan without the digests of the code, which matter to a second run alone."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def code(self, step: str) -> str:
        return ""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plan, name)


@cache
def _rules() -> dict[str, dict[str, str]]:
    """Return the arguments of input, output and params of each rule, as text."""
    text = (PROJECT / "Snakefile").read_text(encoding="utf-8")
    return {rule: dict(_SECTION.findall(body)) for rule, body in _RULE.findall(text)}


@cache
def _tuples() -> list[tuple[str, str]]:
    """Return name and text of the tuples of tables at the top of the Snakefile."""
    text = (PROJECT / "Snakefile").read_text(encoding="utf-8")
    return _TUPLE.findall(text[: text.index("\nrule ")])

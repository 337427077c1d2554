"""The rules of the workflow, as Snakemake has them and as they are written."""

import re
from functools import cache
from pathlib import Path
from typing import Any

from imubench_pipeline.registry import files_of
from imubench_pipeline.run.resources import Cost
from tests.conftest import PROJECT

FILES = [*sorted((PROJECT / "workflow/rules").glob("*.smk")), *files_of("rules")]

_RULE = re.compile(r"^rule (\w+):\n((?:    .*\n|\n)*)", re.MULTILINE)
_COST = re.compile(r"\*\*cost\((.*?)\),\n    \w", re.DOTALL)


def rules(place: Path) -> list[Any]:
    """The rules of the demonstration but `all`, as Snakemake reads them in a folder."""
    # A worker without these tests need not load it.
    from snakemake.api import SnakemakeApi
    from snakemake.settings.types import (
        ConfigSettings,
        OutputSettings,
        Quietness,
        ResourceSettings,
    )

    for name in ("Snakefile", "config", "workflow"):
        (place / name).symlink_to(PROJECT / name)
    with SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api:
        workflow = api.workflow(
            resource_settings=ResourceSettings(cores=1),
            config_settings=ConfigSettings(configfiles=[place / "config/config.yaml"]),
            snakefile=place / "Snakefile",
            workdir=place,
        )
        return [rule for rule in workflow._workflow.rules if rule.name != "all"]


@cache
def costs() -> dict[str, Cost]:
    """What each rule says that it takes."""
    text = "".join(path.read_text() for path in FILES)
    written = {rule: _COST.search(body) for rule, body in _RULE.findall(text)}
    return {
        rule: eval(found[1].strip(), {"Cost": Cost}) for rule, found in written.items() if found
    }

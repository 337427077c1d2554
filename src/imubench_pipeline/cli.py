"""The command `imubench`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from pydantic import BaseModel

from imubench_pipeline.config import Run, Simulated
from imubench_pipeline.sensor import RecordingNotes, Sensor
from imubench_pipeline.tables import write_json

SCHEMAS: dict[str, type[BaseModel]] = {
    "run": Run,
    "sensor": Sensor,
    "recording": RecordingNotes,
    "simulated": Simulated,
}
"""The configuration files: config.yaml, a sensor's, the notes beside a log, simulated.yaml."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = argparse.ArgumentParser(prog="imubench", description="Inertial sensor benchmark.")
    commands = parser.add_subparsers(dest="command", required=True)
    schema = commands.add_parser(
        "schema", help="write the JSON Schema of a configuration file, for editors"
    )
    schema.add_argument("file", choices=sorted(SCHEMAS), help="which configuration file")
    schema.add_argument("--output", type=Path, help="where to write it; default: the terminal")
    given = parser.parse_args(arguments)
    found = SCHEMAS[given.file].model_json_schema()
    found["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    if given.output:
        write_json(found, given.output)
    else:
        json.dump(found, sys.stdout, indent=1)
        sys.stdout.write("\n")
    return 0

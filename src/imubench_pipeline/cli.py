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
from imubench_pipeline.validation import ConfigError, read_yaml

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
    checking = commands.add_parser(
        "check",
        help="say what is wrong with logs, without analysing them",
        description="Exit status: 0 all good, 1 warnings or rejected logs, 2 wrong settings.",
    )
    checking.add_argument("logs", type=Path, help="folder that holds <sensor>/<recording>")
    checking.add_argument("--sensors", type=Path, help="folder of the sensor files")
    checking.add_argument(
        "--config", type=Path, default=Path("config/config.yaml"), help="settings of the findings"
    )
    given = parser.parse_args(arguments)
    return _schema(given) if given.command == "schema" else _check(given)


def _schema(given: argparse.Namespace) -> int:
    found = SCHEMAS[given.file].model_json_schema()
    found["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    if given.output:
        write_json(found, given.output)
    else:
        json.dump(found, sys.stdout, indent=1)
        sys.stdout.write("\n")
    return 0


def _check(given: argparse.Namespace) -> int:
    # Numerics are loaded for this command only: the others answer at once.
    from imubench_pipeline.checking import check
    from imubench_pipeline.plan import Plan

    try:
        config = read_yaml(given.config) if given.config.is_file() else None
        over: dict[str, object] = {"logs": str(given.logs), "simulated": None}
        if given.sensors:
            over["sensors"] = str(given.sensors)
        plan = Plan({**(config if isinstance(config, dict) else {}), **over})
        if not plan.recordings:
            raise ConfigError(f"{given.logs}: no log found; expected <sensor>/<recording> in it")
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    worst = 0
    for sensor, recording, quality in check(plan):
        serious = [f for f in quality.findings if f["severity"] != "note"]
        worst = max(worst, int(bool(serious)))
        status = quality.recording["status"]
        print(f"{sensor}/{recording}: {status if status != 'ok' or not serious else 'warnings'}")
        for finding in quality.findings:
            print(f"  {finding['severity']:8} {finding['finding']}: {finding['detail']}")
        sys.stdout.flush()
    return worst

"""Write the estimates of a log as input files of filters and simulators."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from imubench_pipeline.extensions.exports.of_models import find_target, write_file
from imubench_pipeline.extensions.exports.request import Request, build_imu
from imubench_pipeline.recordings.fitness import judge_recordings
from imubench_pipeline.tables.files import build

if TYPE_CHECKING:
    from imubench_pipeline.library.estimates import Estimates


def export_estimates(
    estimates: "Estimates", target: str, path: str | Path | None, options: Mapping[str, Any]
) -> str | bytes:
    """Return the input file of a program for the estimates of a log; also write it to a path."""
    program = find_target(target)
    request = Request(
        sensor=estimates.log.sensor, target=target, method=estimates.method, **options
    )
    about = judge_recordings([estimates.log.quality.recording], estimates.doubts, ())
    rows = estimates.rows
    tables = {
        "recordings": build("recordings", about),
        "parameters": build("parameters", rows.parameters),
        "allan": build("allan", rows.allan),
        "temperature": build("temperature", rows.temperature),
    }
    return write_file(program, build_imu(tables, request), path)

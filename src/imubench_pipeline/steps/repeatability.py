"""Compare how the fixed bias of each device changes between turn-ons with its datasheet."""

from pathlib import Path

from imubench_pipeline.model.estimates import FixedBiasRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.repeatability import repeatability_rows
from imubench_pipeline.settings.config import DatasheetSettings
from imubench_pipeline.settings.sensor import sensors_of
from imubench_pipeline.tables.files import read, write_each


def write_repeatability(
    biases: Path, recordings: Path, settings: str, catalogue: str, outputs: list[Path]
) -> None:
    """Write the table ``repeatability``, as Parquet and CSV."""
    how = DatasheetSettings.model_validate_json(settings)
    fixed = FixedBiasRow.rows_of(read("fixed_bias", [biases]))
    about = RecordingRow.rows_of(read("recordings", [recordings]))
    rows = repeatability_rows(fixed, about, sensors_of(catalogue), how.tolerance)
    write_each({"repeatability": rows}, outputs)

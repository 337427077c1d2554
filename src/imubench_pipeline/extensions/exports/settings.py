"""Settings of the files for filters and simulators that a run writes."""

from typing import Literal

from pydantic import Field

from imubench_pipeline.settings.requirements import Time
from imubench_pipeline.settings.validation import Strict, Text


class ExportSettings(Strict):
    """Files for filters and simulators that a run writes for every sensor."""

    targets: tuple[Text, ...] = Field(
        ("kalibr", "json"), description="programs; `imubench export` knows their names"
    )
    axis: Text = Field("worst", description="worst or median axis, a device or a recording")
    horizon: Time = Field(
        "60 s", description="time of coasting, for the replacement of unsupported terms"
    )
    inflation: float = Field(1.0, ge=1, description="multiplies every deviation")
    because: Text | None = Field(
        None,
        description="reason of the inflation, or of the use of unfit recordings, for the files",
    )
    mode: Literal["bench", "bounded", "in-use"] | None = Field(
        None,
        description="noise at rest (bench), an upper bound of it (bounded), or what the authors of "
        "a program recommend in use; null: in-use for programs that fly, else bench",
    )
    most_excess: float = Field(
        3.0,
        gt=1,
        description="largest permitted ratio of the Allan deviation of an overbound to its limit",
    )

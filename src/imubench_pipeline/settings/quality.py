"""Thresholds of the findings about recordings."""

from pydantic import Field

from imubench_pipeline.settings.validation import Strict


class QualitySettings(Strict):
    """Thresholds of the findings about a recording."""

    opening: float = Field(
        10.0,
        gt=0,
        description="s, and 1 s for each 5 MB, until the first records of a log are read; one "
        "that takes longer is rejected",
    )
    shortest: int = Field(100, ge=10, description="samples; a shorter recording is rejected")
    short: float = Field(
        900.0,
        ge=0,
        description="s; a shorter recording gets a note that it shows white noise alone",
    )
    longest_hole: float = Field(
        3600.0, gt=0, description="s; a longer gap begins a new segment instead of a hole"
    )
    jitter: float = Field(
        0.01, gt=0, lt=1, description="fraction of stamps off the grid above which no grid is used"
    )
    rate_tolerance: float = Field(
        0.01, gt=0, description="relative difference of stated rate and stamps that is a finding"
    )
    rate_drift: float = Field(
        5e-4, gt=0, description="relative change of the sampling interval that is a finding"
    )
    knock: float = Field(
        10.0, ge=5, description="standard deviations from which a sample is an outlier"
    )
    longest_knock: float = Field(0.5, gt=0, description="s; a longer vibration is motion")
    motion: float = Field(
        4.0, gt=1, description="times its usual spread from which a sensor is in motion"
    )
    step: float = Field(
        12.0, ge=5, description="standard deviations of its changes that are a step of the mean"
    )
    warm_up: float = Field(
        8.0, gt=1, description="times the usual drift from which the beginning is a warm-up"
    )
    trim_warm_up: bool = Field(False, description="leave the warm-up out of the analysis")
    at_rest: bool = Field(
        False, description="analyse the longest part at rest of a log in which the sensor was moved"
    )
    variance_ratio: float = Field(
        1.5,
        gt=1,
        description="ratio of the spread to the calmest part above which a log is not stationary",
    )
    saturated: float = Field(
        1e-3, gt=0, lt=1, description="share of the samples at an extreme value"
    )
    longest_stuck: float = Field(1.0, gt=0, description="s at one value")
    repeated: float = Field(
        0.1, gt=0, lt=1, description="share of repeated samples beyond what rounding explains"
    )
    step_over_noise: float = Field(
        0.05, gt=0, description="quantisation step over the noise from which it is noted"
    )

"""Gyros that were turned, or whose rates are known."""


rule earth_rotation:
    input:
        quality=KEPT + "/quality.json",
        static_quality=at_rest("quality.json"),
        static_parameters=at_rest("parameters.parquet"),
        static_draws=at_rest("draws.parquet"),
    output:
        earth_rate=KEPT + "/earth_rate.parquet",
        earth_rate_series=KEPT + "/earth_rate_series.parquet",
        turning=KEPT + "/turning.parquet",
        earth_rate_prediction=KEPT + "/earth_rate_prediction.parquet",
        earth_rate_published=KEPT + "/earth_rate_published.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/earth_rotation.log",
    resources:
        **cost(OfRecording(memory=450, memory_of_samples=60, time=15, time_of_values=3)),
    params:
        settings=lambda w: plan.experiment_settings(w.sensor, w.recording),
        code=plan.code("earth_rotation", "extensions.earth_rate"),
        attempt=tried("earth_rotation"),
    script:
        "../scripts/earth_rotation.py"


rule calibration:
    input:
        quality=KEPT + "/quality.json",
        static_quality=at_rest("quality.json"),
        static_parameters=at_rest("parameters.parquet"),
    output:
        calibration=KEPT + "/calibration.parquet",
        calibration_points=KEPT + "/calibration_points.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/calibration.log",
    resources:
        **cost(OfRecording(memory=450, memory_of_samples=60, time=5, time_of_values=1)),
    params:
        settings=lambda w: plan.experiment_settings(w.sensor, w.recording),
        code=plan.code("calibration", "extensions.calibration"),
        attempt=tried("calibration"),
    script:
        "../scripts/calibration.py"


TURNED = tables_of(rules.earth_rotation)
CALIBRATED = tables_of(rules.calibration)

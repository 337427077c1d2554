"""Gyros whose rates are known, and triads in several positions."""

CALIBRATED = plan.of_experiment("rate_table", "positions", "pointing")


rule calibration:
    input:
        **SAMPLES_INPUT,
        quality=KEPT + "/quality.json",
        static_quality=at_rest("quality.json"),
        static_parameters=at_rest("parameters.parquet"),
    output:
        calibration=KEPT + "/calibration.parquet",
        calibration_points=KEPT + "/calibration_points.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/calibration.log",
    resources:
        **cost(Cost(memory=450, memory_of_samples=60, time=5, time_of_values=1)),
    params:
        settings=lambda w: plan.experiment_settings(w.sensor, w.recording),
        code=plan.code("calibration", "extensions.calibration"),
        attempt=tried("calibration"),
    script:
        "scripts/calibration.py"


JOBS["calibration"] = jobs_of_each(CALIBRATED)
ADDED_TABLES |= {
    name: of_each(CALIBRATED, name) for name in tables_of(rules.calibration)
}

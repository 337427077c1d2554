"""Tables of gyros turned between north and south, and of predictions for sensors at rest."""

from imubench_pipeline.extensions.earth_rate.plan import select_outlook_settings

TURNED = plan.of_experiment("two_position")


rule earth_rotation:
    input:
        **SAMPLES_INPUT,
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
        **cost(Cost(memory=450, memory_of_samples=60, time=15, time_of_values=3)),
    params:
        settings=lambda w: plan.experiment_settings(w.sensor, w.recording, "earth_rate"),
        code=plan.code("earth_rotation", "extensions.earth_rate"),
        attempt=tried("earth_rotation"),
    script:
        "scripts/earth_rotation.py"


rule outlook:
    input:
        quality=at_rest("quality.json"),
        parameters=at_rest("parameters.parquet"),
    output:
        alignment=JOINED + "/alignment.parquet",
        earth_rate_prediction=JOINED + "/earth_rate_prediction.parquet",
    log:
        LOGS + "/sensors/{sensor}/outlook.log",
    group:
        "comparison"
    resources:
        **cost(
            Cost(
                memory=350,
                memory_of_each=0.1,
                time=3,
                time_of_each=0.005,
                many_jobs=True,
            )
        ),
    params:
        settings=lambda w: select_outlook_settings(plan, w.sensor),
        code=plan.code("outlook", "extensions.earth_rate"),
        attempt=tried("outlook"),
    script:
        "scripts/outlook.py"


JOBS["earth_rotation"] = jobs_of_each(TURNED)
ADDED_TABLES |= {
    name: of_each(TURNED, name) for name in tables_of(rules.earth_rotation)
}
ADDED_TABLES |= {
    name: ADDED_TABLES.get(name, []) + of_each_sensor(name)
    for name in tables_of(rules.outlook)
}

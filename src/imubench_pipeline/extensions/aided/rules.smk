"""Filters on simulated drives, tuned with each source of noise figures."""

from imubench_pipeline.extensions.aided.plan import (
    dump_navigate_settings,
    list_navigated_sensors,
)


rule navigate:
    input:
        **SAMPLES_AT_REST,
        quality=at_rest("quality.json"),
        parameters=at_rest("parameters.parquet"),
        draws=at_rest("draws.parquet"),
        allan=at_rest("allan.parquet"),
        low_pass=at_rest("low_pass.parquet"),
    output:
        navigation=JOINED + "/navigation.parquet",
    log:
        LOGS + "/sensors/{sensor}/navigate.log",
    group:
        "comparison"
    resources:
        **cost(
            Cost(
                memory=500,
                memory_of_each=0.2,
                time=60,
                time_of_each=0.005,
                many_jobs=True,
            )
        ),
    params:
        settings=lambda w: dump_navigate_settings(plan, w.sensor),
        code=plan.code("navigate", "extensions.aided"),
        attempt=tried("navigate"),
    script:
        "scripts/navigate.py"


SAMPLED.update(list_navigated_sensors(plan))
JOBS["navigate"] = [{"sensor": sensor} for sensor in list_navigated_sensors(plan)]
ADDED_TABLES |= {
    name: of_each_sensor(name, list_navigated_sensors(plan))
    for name in tables_of(rules.navigate)
}

"""What all recordings of a sensor tell."""


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
            OfMany(
                memory=350,
                memory_of_each=0.1,
                time=3,
                time_of_each=0.005,
                many_jobs=True,
            )
        ),
    params:
        settings=lambda w: plan.outlook_settings(w.sensor),
        code=plan.code("outlook", "extensions.earth_rate"),
        attempt=tried("outlook"),
    script:
        "../scripts/outlook.py"


OUTLOOK = tables_of(rules.outlook)


# Of the sensors that the setting `navigate` asks for.
rule navigate:
    input:
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
            OfMany(
                memory=500,
                memory_of_each=0.2,
                time=60,
                time_of_each=0.005,
                many_jobs=True,
            )
        ),
    params:
        settings=lambda w: plan.navigate_settings(w.sensor),
        code=plan.code("navigate", "extensions.aided"),
        attempt=tried("navigate"),
    script:
        "../scripts/navigate.py"


NAVIGATED = tables_of(rules.navigate)
# `estimate_findings` becomes a part of `findings`.
OF_SENSOR = sorted(
    {*PARTS} - {"estimate_findings"}
    | {"recordings", "findings", "doubts", "failures", "drift", "pooled"}
    | {"simulated_truth", "published_figures"}
)


rule sensor_tables:
    input:
        **{name: of_sensor(f"{name}.parquet") for name in PARTS},
        quality=of_sensor("quality.json"),
    output:
        **{name: f"{JOINED}/{name}.parquet" for name in OF_SENSOR},
    log:
        LOGS + "/sensors/{sensor}/sensor_tables.log",
    group:
        "comparison"
    resources:
        **cost(
            OfMany(
                memory=300, memory_of_each=2, time=1, time_of_each=0.03, many_jobs=True
            )
        ),
    params:
        truths=lambda w: plan.truths(w.sensor),
        sensor=lambda w: plan.sensor_file(w.sensor, "price_class", "sold"),
        usual=plan.usual,
        decide=plan.settings("decide"),
        code=plan.code("sensor_tables"),
        attempt=tried("sensor_tables"),
    script:
        "../scripts/sensor_tables.py"

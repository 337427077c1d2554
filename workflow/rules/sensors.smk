"""Steps of one sensor: joined tables of its recordings."""

# `estimate_findings` becomes a part of `findings`.
OF_SENSOR = sorted(
    {*PARTS} - {"estimate_findings"}
    | {"recordings", "findings", "doubts", "failures", "drift", "pooled"}
    | {"simulated_truth", *references("sensor_tables")}
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
            Cost(
                memory=300, memory_of_each=2, time=1, time_of_each=0.03, many_jobs=True
            )
        ),
    params:
        recordings=lambda w: [folder.rsplit("/", 1)[1] for folder in FOLDERS[w.sensor]],
        truths=lambda w: plan.truths(w.sensor),
        sensor=lambda w: plan.catalogue("price_class", "sold", sensor=w.sensor),
        usual=plan.usual,
        decide=plan.settings("decide"),
        code=plan.code("sensor_tables"),
        attempt=tried("sensor_tables"),
    script:
        "../scripts/sensor_tables.py"

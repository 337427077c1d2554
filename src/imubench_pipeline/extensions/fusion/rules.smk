"""Several sensors together, and sensors on boards."""


rule fusion:
    input:
        recordings=table("recordings"),
        parameters=table("parameters"),
        allan_compensated=table("allan_compensated"),
        temperature=table("temperature"),
        draws=every("draws.parquet"),
    output:
        **as_files("fusion", "grades"),
    log:
        LOGS + "/fusion.log",
    group:
        "comparison"
    resources:
        **cost(Cost(memory=300, memory_of_each=0.2, time=6, time_of_each=0.01)),
    params:
        csv=plan.run.tables.csv,
        settings=plan.settings("fusion"),
        catalogue=plan.catalogue("price_class", "sold"),
        code=plan.code("fusion", "extensions.fusion"),
    script:
        "scripts/fusion.py"


# Only for recordings of boards: their paper compares samples by eye.
rule samples_of_models:
    input:
        **SAMPLES_INPUT,
        quality=KEPT + "/quality.json",
        parameters=KEPT + "/parameters.parquet",
        low_pass=KEPT + "/low_pass.parquet",
        temperature=KEPT + "/temperature.parquet",
        fixed_bias=KEPT + "/fixed_bias.parquet",
    output:
        samples_of_models=KEPT + "/samples_of_models.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/samples_of_models.log",
    group:
        "recording"
    resources:
        **cost(Cost(memory=400, memory_of_samples=20, time=4, time_of_values=0.1)),
    params:
        settings=plan.settings("reconstruction"),
        code=plan.code("samples_of_models", "extensions.fusion"),
        attempt=tried("samples_of_models"),
    script:
        "scripts/samples_of_models.py"


JOBS["samples_of_models"] = jobs_of_each(plan.on_boards)

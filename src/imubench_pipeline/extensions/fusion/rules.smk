"""Several sensors together."""


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

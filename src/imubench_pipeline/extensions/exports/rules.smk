"""Files that filters and simulators load, for every sensor."""


rule exports:
    input:
        recordings=table("recordings"),
        parameters=table("parameters"),
        allan=table("allan"),
        temperature=table("temperature"),
        draws=every("draws.parquet"),
    output:
        folder=directory(RESULTS + "/exports"),
    log:
        LOGS + "/exports.log",
    resources:
        **cost(Cost(memory=300, memory_of_each=0.5, time=1, time_of_each=0.05)),
    params:
        settings=plan.settings("exports"),
        code=plan.code("exports", "extensions.exports"),
    script:
        "scripts/exports.py"


ADDED_OUTPUTS.append(rules.exports.output.folder)

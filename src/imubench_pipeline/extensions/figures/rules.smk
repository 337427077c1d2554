"""Figures of all sensors for print."""


rule figures:
    input:
        recordings=table("recordings"),
        allan=table("allan"),
        parameters=table("parameters"),
        simulated_truth=table("simulated_truth"),
    output:
        folder=directory(RESULTS + "/report/figures"),
    log:
        LOGS + "/figures.log",
    resources:
        **cost(Cost(memory=350, memory_of_each=3, time=12, time_of_each=0.06)),
    params:
        units=plan.run.report.units,
        code=plan.code("figures", "extensions.figures"),
    script:
        "scripts/figures.py"


ADDED_OUTPUTS.append(rules.figures.output.folder)

"""Published figures of the papers, compared with results of this run."""


rule papers:
    input:
        **{
            name: table(name)
            for name in (
                "recordings",
                "allan",
                "allan_compensated",
                "parameters",
                "models",
                "reconstruction",
                "scores",
                "datasheet",
                "error_budget",
                "temperature",
                "published_figures",
                "simulated_truth",
                "earth_rate",
                "earth_rate_published",
                "alignment",
                "calibration",
                "grades",
                "fusion",
            )
        },
        of_models=of_each(plan.on_boards, "samples_of_models"),
    output:
        **as_files("published", "accuracy"),
    log:
        LOGS + "/papers.log",
    group:
        "comparison"
    resources:
        **cost(Cost(memory=350, memory_of_each=0.3, time=10, time_of_each=0.01)),
    params:
        csv=plan.run.tables.csv,
        code=plan.code("papers", "extensions.papers"),
    script:
        "scripts/papers.py"

"""The pages of the report."""


rule report:
    input:
        tables=[table(name) for name in TABLES if name not in OF_ONE_RECORDING],
        quality=every("quality.json"),
        samples=[file for name in SAMPLES for file in every(f"{name}.parquet")],
        metadata=every("samples.json") if bucket else [],
        of_models=of_each(plan.on_boards, "samples_of_models"),
        compared=[
            file
            for name in ("error_growth", "drawn_deviations")
            for file in every(f"{name}.parquet")
        ],
    output:
        page=report(RESULTS + "/report/index.html", category="Comparison"),
    log:
        LOGS + "/report.log",
    group:
        "comparison"
    threads: 4
    resources:
        **cost(Cost(memory=350, memory_of_each=3, time=2, time_of_each=0.12)),
    params:
        settings=plan.report_settings(),
        code=plan.code("report"),
        pages_attempt=count_attempt(plan.run.results / "report"),
        one_file=bucket is not None,  # no rule declares each page
    script:
        "../scripts/report.py"

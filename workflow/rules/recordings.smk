"""Steps of one recording: samples, Allan variance, noise parameters, and errors that follow."""


rule simulate:
    output:
        log=directory(RESULTS + "/simulated/{sensor}/{recording}"),
    log:
        LOGS + "/recordings/{sensor}/{recording}/simulate.log",
    group:
        "recording"
    resources:
        **cost(Cost(memory=300, time=1, time_of_values=0.2)),
    params:
        settings=lambda w: plan.simulated_settings(w.sensor, w.recording),
        code=plan.code("simulate"),
    script:
        "../scripts/simulate.py"


rule ingest:
    input:
        log=lambda w: log_of(w.sensor, w.recording),
    output:
        **SAMPLES_OUTPUT,
        quality=KEPT + "/quality.json",
        envelope=KEPT + "/envelope.parquet",
        histogram=KEPT + "/histogram.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/ingest.log",
    group:
        "recording"
    resources:
        **cost(Cost(memory=400, time=1, time_of_values=0.15)),
    params:
        source=lambda w: source_of(w.sensor, w.recording),
        settings=lambda w: plan.ingest_settings(w.sensor, w.recording),
        code=plan.code("ingest"),
        attempt=tried("ingest"),
    script:
        "../scripts/ingest.py"


# The limits of this curve are for an identified power law. The limits in the table `allan`, which the
# next step writes, are for the fitted spectrum.
rule allan:
    input:
        **SAMPLES_INPUT,
        quality=KEPT + "/quality.json",
    output:
        curve=KEPT + "/curve.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/allan.log",
    group:
        "recording"
    resources:
        **cost(Cost(memory=400, memory_of_samples=20, time=10, time_of_values=0.2)),
    params:
        settings=plan.settings("allan"),
        code=plan.code("allan"),
        attempt=tried("allan"),
    script:
        "../scripts/allan.py"


rule estimate:
    input:
        **SAMPLES_INPUT,
        quality=KEPT + "/quality.json",
        curve=KEPT + "/curve.parquet",
    output:
        allan=KEPT + "/allan.parquet",
        parameters=KEPT + "/parameters.parquet",
        models=KEPT + "/models.parquet",
        draws=KEPT + "/draws.parquet",
        lines=KEPT + "/lines.parquet",
        spectrum=KEPT + "/spectrum.parquet",
        fixed_bias=KEPT + "/fixed_bias.parquet",
        temperature=KEPT + "/temperature.parquet",
        allan_compensated=KEPT + "/allan_compensated.parquet",
        low_pass=KEPT + "/low_pass.parquet",
        deterministic=KEPT + "/deterministic.parquet",
        estimate_findings=KEPT + "/estimate_findings.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/estimate.log",
    group:
        "recording"
    resources:
        **cost(
            Cost(
                memory=400,
                memory_of_samples=5,
                time=10,
                time_of_channels=0.7,
                time_of_values=0.1,
            )
        ),
    params:
        settings=lambda w: plan.estimate_settings(w.sensor, w.recording),
        code=plan.code("estimate"),
        attempt=tried("estimate"),
    script:
        "../scripts/estimate.py"


rule reconstruct:
    input:
        quality=KEPT + "/quality.json",
        allan=KEPT + "/allan.parquet",
        parameters=KEPT + "/parameters.parquet",
        compensated=KEPT + "/allan_compensated.parquet",
    output:
        reconstruction=KEPT + "/reconstruction.parquet",
        scores=KEPT + "/scores.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/reconstruct.log",
    group:
        "recording"
    resources:
        **cost(
            Cost(
                memory=350,
                memory_of_samples=15,
                time=1,
                time_of_channels=1.3,
                time_of_values=0.6,
            )
        ),
    params:
        settings=plan.settings("reconstruction"),
        code=plan.code("reconstruct"),
        attempt=tried("reconstruct"),
    script:
        "../scripts/reconstruct.py"


rule datasheet:
    input:
        quality=KEPT + "/quality.json",
        allan=KEPT + "/allan.parquet",
        parameters=KEPT + "/parameters.parquet",
        fixed_bias=KEPT + "/fixed_bias.parquet",
        temperature=KEPT + "/temperature.parquet",
    output:
        datasheet=KEPT + "/datasheet.parquet",
        datasheet_curve=KEPT + "/datasheet_curve.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/datasheet.log",
    group:
        "recording"
    resources:
        **cost(Cost(memory=300, time=1)),
    params:
        settings=lambda w: plan.datasheet_settings(w.sensor),
        code=plan.code("datasheet"),
        attempt=tried("datasheet"),
    script:
        "../scripts/datasheet.py"


rule error_budget:
    input:
        **SAMPLES_INPUT,
        quality=KEPT + "/quality.json",
        parameters=KEPT + "/parameters.parquet",
        draws=KEPT + "/draws.parquet",
        temperature=KEPT + "/temperature.parquet",
        deterministic=KEPT + "/deterministic.parquet",
    output:
        error_budget=KEPT + "/error_budget.parquet",
        backtest=KEPT + "/backtest.parquet",
        error_growth=KEPT + "/error_growth.parquet",
        drawn_deviations=KEPT + "/drawn_deviations.parquet",
    log:
        LOGS + "/recordings/{sensor}/{recording}/error_budget.log",
    group:
        "recording"
    resources:
        **cost(Cost(memory=350, time=3, time_of_channels=0.5, time_of_values=0.05)),
    params:
        settings=lambda w: plan.error_budget_settings(w.sensor),
        code=plan.code("error_budget"),
        attempt=tried("error_budget"),
    script:
        "../scripts/error_budget.py"


JOBS["simulate"] = jobs_of_each(plan.simulated)

# Outputs of every recording, and the tables among them that are joined to tables of its sensor.
OF_RECORDING = (
    rules.ingest,
    rules.estimate,
    rules.reconstruct,
    rules.datasheet,
    rules.error_budget,
)
PARTS = [name for name in tables_of(*OF_RECORDING[1:]) if name not in OF_ONE_RECORDING]

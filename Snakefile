"""From static logs of inertial sensors to a cross-IMU report: `snakemake -c2`."""

import atexit
import gc
import os
from itertools import chain

from imubench_pipeline.run.bounded_steps import BoundedSteps
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.processes import Steps
from imubench_pipeline.run.resources import asked, time_limits
from imubench_pipeline.run.step_modules import STEPS
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables.schemas import (
    CALIBRATED,
    COMPARED,
    OF_ONE_RECORDING,
    OUTLOOK,
    SAMPLES,
    TABLES,
    TURNED,
)


configfile: "config/config.yaml"


# The graph of a thousand recordings is millions of objects, which live as long as the run: to look
# for garbage among them as often as Python does, and at the end, takes a fourth of the time.
gc.set_threshold(100_000, 20, 100)
atexit.register(gc.freeze)

try:
    plan = Plan(config)
except ConfigError as error:
    raise WorkflowError(str(error)) from None

scripts = Steps(Path(workflow.basedir) / "workflow/scripts")
steps = BoundedSteps(scripts, plan, time_limits(plan))
ASKED = asked(plan)  # memory and time on a cluster
RESULTS = str(plan.run.results)
FOLDER = RESULTS + "/recordings/{sensor}/{recording}"
JOINED = sorted(set(TABLES) - set(OF_ONE_RECORDING))
RANKED = {
    "ranking",
    "next_steps",
    "shortlist",
    "repeatability",
    "fusion",
    "coverage",
    "coverage_by_vendor",
    *TURNED,
    *CALIBRATED,
    *OUTLOOK,
}
ESTIMATED = (
    "allan",
    "parameters",
    "models",
    "lines",
    "spectrum",
    "fixed_bias",
    "temperature",
    "allan_compensated",
    "low_pass",
    "deterministic",
    "estimate_findings",
)
ANALYSED = [table for table in JOINED if table not in RANKED]
PARTS = (
    *ESTIMATED,
    "reconstruction",
    "scores",
    "datasheet",
    "datasheet_curve",
    "error_budget",
    "backtest",
)
OF_RECORDING = ["quality.json", *(f"{t}.parquet" for t in (*OF_ONE_RECORDING, *PARTS))]
FOLDERS = {}
for sensor, recording in plan.recordings:
    FOLDERS.setdefault(sensor, []).append(
        FOLDER.format(sensor=sensor, recording=recording)
    )


def of_sensor(file):
    return lambda w: [f"{folder}/{file}" for folder in FOLDERS[w.sensor]]


def every(file):
    return [f"{folder}/{file}" for folders in FOLDERS.values() for folder in folders]


def as_files(*tables):
    return [
        f"{RESULTS}/tables/{t}.{kind}" for t in tables for kind in ("parquet", "csv")
    ]


def of_experiments(recordings, *tables):
    return [
        f"{FOLDER.format(sensor=sensor, recording=recording)}/{table}.parquet"
        for sensor, recording in recordings
        for table in tables
    ]


def of_outlooks(*tables):
    return [
        f"{RESULTS}/sensors/{sensor}/{table}.parquet"
        for sensor in FOLDERS
        for table in tables
    ]


def at_rest(file):
    return lambda w: [
        f"{FOLDER.format(sensor=w.sensor, recording=recording)}/{file}"
        for recording in plan.static_of(w.sensor)
    ]


def missing():
    made = [
        *as_files(*JOINED),
        *(f"{RESULTS}/sensors/{s}/{t}.parquet" for s in FOLDERS for t in ANALYSED),
        *(
            f"{FOLDER.format(sensor=s, recording=r)}/{file}"
            for (s, r), found in plan.recordings.items()
            for file in OF_RECORDING
            if not found.held_back
        ),
        *of_outlooks(*OUTLOOK),
        *of_experiments(plan.turned, *TURNED),
        *of_experiments(plan.calibrated, *CALIBRATED),
        *(str(found.path) for found in plan.recordings.values() if found.simulated),
    ]
    return [file for file in made if not os.path.exists(file)]


wildcard_constraints:
    sensor="[^/]+",
    recording="[^/]+",


localrules:
    all,


# What is missing is asked for by name: Snakemake takes away what a failed step left, and else makes
# a file again only for a step that is run again itself.
rule all:
    input:
        RESULTS + "/report/index.html",
        RESULTS + "/report/figures",
        RESULTS + "/exports",
        missing(),


rule simulate:
    output:
        directory(RESULTS + "/simulated/{sensor}/{recording}"),
    group:
        "recording"
    resources:
        **ASKED,
    params:
        settings=lambda w: plan.simulated_settings(w.sensor, w.recording),
        code=plan.code("simulate"),
    run:
        steps.run("simulate", input, output, params, wildcards)


rule ingest:
    input:
        lambda w: plan.recordings[w.sensor, w.recording].inputs,
    output:
        quality=FOLDER + "/quality.json",
        envelope=FOLDER + "/envelope.parquet",
        histogram=FOLDER + "/histogram.parquet",
    group:
        "recording"
    resources:
        **ASKED,
    params:
        source=lambda w: str(plan.recordings[w.sensor, w.recording].path),
        settings=lambda w: plan.ingest_settings(w.sensor, w.recording),
        code=plan.code("ingest"),
        attempt=lambda w: plan.attempt("ingest", w.sensor, w.recording),
    run:
        steps.run("ingest", input, output, params, wildcards)


# The limits of this curve go by an identified power law; those of the table `allan`, which the next
# step writes, by the spectrum that it fits.
rule allan:
    input:
        quality=FOLDER + "/quality.json",
    output:
        FOLDER + "/curve.parquet",
    group:
        "recording"
    resources:
        **ASKED,
    params:
        settings=plan.settings("allan"),
        code=plan.code("allan"),
        attempt=lambda w: plan.attempt("allan", w.sensor, w.recording),
    run:
        steps.run("allan", input, output, params, wildcards)


rule estimate:
    input:
        quality=FOLDER + "/quality.json",
        curve=FOLDER + "/curve.parquet",
    output:
        **{table: f"{FOLDER}/{table}.parquet" for table in (*ESTIMATED, "draws")},
    group:
        "recording"
    resources:
        **ASKED,
    params:
        settings=lambda w: plan.estimate_settings(w.sensor, w.recording),
        code=plan.code("estimate"),
        attempt=lambda w: plan.attempt("estimate", w.sensor, w.recording),
    run:
        steps.run("estimate", input, output, params, wildcards)


rule reconstruct:
    input:
        quality=FOLDER + "/quality.json",
        allan=FOLDER + "/allan.parquet",
        parameters=FOLDER + "/parameters.parquet",
        compensated=FOLDER + "/allan_compensated.parquet",
    output:
        reconstruction=FOLDER + "/reconstruction.parquet",
        scores=FOLDER + "/scores.parquet",
    group:
        "recording"
    resources:
        **ASKED,
    params:
        settings=plan.settings("reconstruction"),
        code=plan.code("reconstruct"),
        attempt=lambda w: plan.attempt("reconstruct", w.sensor, w.recording),
    run:
        steps.run("reconstruct", input, output, params, wildcards)


rule datasheet:
    input:
        quality=FOLDER + "/quality.json",
        allan=FOLDER + "/allan.parquet",
        parameters=FOLDER + "/parameters.parquet",
        fixed_bias=FOLDER + "/fixed_bias.parquet",
        temperature=FOLDER + "/temperature.parquet",
    output:
        datasheet=FOLDER + "/datasheet.parquet",
        datasheet_curve=FOLDER + "/datasheet_curve.parquet",
    group:
        "recording"
    resources:
        **ASKED,
    params:
        settings=lambda w: plan.datasheet_settings(w.sensor),
        code=plan.code("datasheet"),
        attempt=lambda w: plan.attempt("datasheet", w.sensor, w.recording),
    run:
        steps.run("datasheet", input, output, params, wildcards)


rule error_budget:
    input:
        quality=FOLDER + "/quality.json",
        parameters=FOLDER + "/parameters.parquet",
        draws=FOLDER + "/draws.parquet",
        temperature=FOLDER + "/temperature.parquet",
        deterministic=FOLDER + "/deterministic.parquet",
    output:
        error_budget=FOLDER + "/error_budget.parquet",
        backtest=FOLDER + "/backtest.parquet",
    group:
        "recording"
    resources:
        **ASKED,
    params:
        settings=lambda w: plan.error_budget_settings(w.sensor),
        code=plan.code("error_budget"),
        attempt=lambda w: plan.attempt("error_budget", w.sensor, w.recording),
    run:
        steps.run("error_budget", input, output, params, wildcards)


rule earth_rotation:
    input:
        quality=FOLDER + "/quality.json",
        static_quality=at_rest("quality.json"),
        static_parameters=at_rest("parameters.parquet"),
        static_draws=at_rest("draws.parquet"),
    output:
        **{table: f"{FOLDER}/{table}.parquet" for table in TURNED},
    resources:
        **ASKED,
    params:
        settings=lambda w: plan.experiment_settings(w.sensor, w.recording),
        code=plan.code("earth_rotation"),
        attempt=lambda w: plan.attempt("earth_rotation", w.sensor, w.recording),
    run:
        steps.run("earth_rotation", input, output, params, wildcards)


rule calibration:
    input:
        quality=FOLDER + "/quality.json",
        static_quality=at_rest("quality.json"),
        static_parameters=at_rest("parameters.parquet"),
    output:
        **{table: f"{FOLDER}/{table}.parquet" for table in CALIBRATED},
    resources:
        **ASKED,
    params:
        settings=lambda w: plan.experiment_settings(w.sensor, w.recording),
        code=plan.code("calibration"),
        attempt=lambda w: plan.attempt("calibration", w.sensor, w.recording),
    run:
        steps.run("calibration", input, output, params, wildcards)


rule outlook:
    input:
        quality=at_rest("quality.json"),
        parameters=at_rest("parameters.parquet"),
    output:
        **{table: f"{RESULTS}/sensors/{{sensor}}/{table}.parquet" for table in OUTLOOK},
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        settings=lambda w: plan.outlook_settings(w.sensor),
        code=plan.code("outlook"),
        attempt=lambda w: plan.attempt("outlook", w.sensor),
    run:
        steps.run("outlook", input, output, params, wildcards)


rule sensor_tables:
    input:
        **{table: of_sensor(f"{table}.parquet") for table in PARTS},
        quality=of_sensor("quality.json"),
    output:
        [f"{RESULTS}/sensors/{{sensor}}/{table}.parquet" for table in ANALYSED],
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        truths=lambda w: plan.truths(w.sensor),
        catalogue=plan.catalogue("price_class"),
        decide=plan.settings("decide"),
        code=plan.code("sensor_tables"),
        attempt=lambda w: plan.attempt("sensor_tables", w.sensor),
    run:
        steps.run("sensor_tables", input, output, params, wildcards)


rule tables:
    input:
        **{
            table: [
                f"{RESULTS}/sensors/{sensor}/{table}.parquet" for sensor in FOLDERS
            ]
            for table in ANALYSED
        },
        **{
            table: of_experiments(plan.turned if table in TURNED else [], table)
            + (of_outlooks(table) if table in OUTLOOK else [])
            for table in (*TURNED, "alignment")
        },
        **{table: of_experiments(plan.calibrated, table) for table in CALIBRATED},
    output:
        as_files(*ANALYSED, *TURNED, *CALIBRATED, "alignment"),
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        code=plan.code("tables"),
    run:
        steps.run("tables", input, output, params, wildcards)


rule ranking:
    input:
        **{
            table: f"{RESULTS}/tables/{table}.parquet"
            for table in (
                "error_budget",
                "backtest",
                "recordings",
                "doubts",
                "parameters",
            )
        },
    output:
        as_files("ranking", "next_steps"),
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        settings=plan.ranking_settings(),
        code=plan.code("ranking"),
    run:
        steps.run("ranking", input, output, params, wildcards)


rule shortlist:
    input:
        **{
            table: f"{RESULTS}/tables/{table}.parquet"
            for table in ("recordings", "parameters", "ranking")
        },
    output:
        as_files("shortlist"),
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        settings=plan.ranking_settings(),
        catalogue=plan.catalogue(
            "price_class", "temperature_range", "rate", "mass", "power"
        ),
        code=plan.code("shortlist"),
    run:
        steps.run("shortlist", input, output, params, wildcards)


rule repeatability:
    input:
        biases=RESULTS + "/tables/fixed_bias.parquet",
        recordings=RESULTS + "/tables/recordings.parquet",
    output:
        as_files("repeatability"),
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        settings=plan.settings("datasheet"),
        catalogue=plan.catalogue(),
        code=plan.code("repeatability"),
    run:
        steps.run("repeatability", input, output, params, wildcards)


rule fusion:
    input:
        **{
            table: f"{RESULTS}/tables/{table}.parquet"
            for table in (
                "recordings",
                "parameters",
                "allan_compensated",
                "temperature",
            )
        },
        draws=every("draws.parquet"),
    output:
        as_files("fusion"),
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        settings=plan.settings("fusion"),
        code=plan.code("fusion"),
    run:
        steps.run("fusion", input, output, params, wildcards)


rule coverage:
    output:
        as_files("coverage", "coverage_by_vendor"),
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        catalogue=plan.catalogue(),
        code=plan.code("coverage"),
    run:
        steps.run("coverage", input, output, params, wildcards)


rule exports:
    input:
        [
            RESULTS + f"/tables/{t}.parquet"
            for t in ("recordings", "parameters", "allan", "temperature")
        ],
        draws=every("draws.parquet"),
    output:
        directory(RESULTS + "/exports"),
    resources:
        **ASKED,
    params:
        settings=plan.settings("exports"),
        code=plan.code("exports"),
    run:
        steps.run("exports", input, output, params, wildcards)


rule figures:
    input:
        [f"{RESULTS}/tables/{table}.parquet" for table in COMPARED],
    output:
        directory(RESULTS + "/report/figures"),
    resources:
        **ASKED,
    params:
        settings=plan.figures_settings(),
        code=plan.code("figures"),
    run:
        steps.run("figures", input, output, params, wildcards)


rule report:
    input:
        [
            f"{folder}/{table}.parquet"
            for folder in chain.from_iterable(FOLDERS.values())
            for table in SAMPLES
        ],
        tables=[f"{RESULTS}/tables/{table}.parquet" for table in JOINED],
    output:
        report(RESULTS + "/report/index.html", category="Comparison"),
    group:
        "comparison"
    resources:
        **ASKED,
    params:
        settings=plan.report_settings(),
        code=plan.code("report"),
    run:
        steps.run("report", input, output, params, wildcards)


if workflow.remote_exec:
    # For each `run:` of a group, Snakemake on a node starts one more Snakemake, with a server of
    # its own: six times 5 s a recording. It runs scripts in its threads, and these are such.
    for step in STEPS:
        workflow.get_rule(step).script = f"workflow/scripts/{step}.py"


onstart:
    from imubench_pipeline.run.progress import follow

    follow()


# Tables are read at the end of a run alone: a run should begin at once.
onsuccess:
    from imubench_pipeline.report.run_summary import summary

    print(summary(plan.run.results))
    if left_out := plan.faults.left_out():
        raise WorkflowError(left_out)


onerror:
    import sys
    from imubench_pipeline.report.run_summary import failure

    print(failure(log, plan.run.results), file=sys.stderr)

"""From static logs of inertial sensors to a cross-IMU report: `snakemake -c2`."""


include: "workflow/rules/common.smk"  # the plan of the run, and functions of the rules
include: "workflow/rules/recordings.smk"  # one log: samples, curve, estimates, scores, errors
include: "workflow/rules/sensors.smk"  # the recordings of a sensor


for file in files_of("rules"):  # of extensions

    include: file


include: "workflow/rules/comparison.smk"  # all sensors: tables, ranking, shortlist, fusion
include: "workflow/rules/report.smk"  # pages


# Missing and changed outputs are requested by name: Snakemake removes the outputs of a failed step,
# and otherwise makes a file again only if its own step is run again.
rule all:
    input:
        rules.report.output,
        ADDED_OUTPUTS,
        made_again,
    localrule: True


onstart:
    from imubench_pipeline.run.progress import follow

    take_lock()
    follow(
        jobs_of_recordings(workflow.dag),
        partial(describe_outcome, plan.run.results),
    )
    remove_temporary(plan.run.results, BEGUN)
    plan.remove_unused_csv()


# Tables are read only at the end of a run: a run should begin at once.
onsuccess:
    from imubench_pipeline.report.run_summary import (
        SUMMARISED_TABLES,
        summarise_run,
        list_failed_pages,
    )
    from imubench_pipeline.run.progress import OURS

    remove_temporary(plan.run.results, BEGUN + STILL_WRITTEN)
    remove_samples()
    if bucket:
        read = [f"tables/{name}.parquet" for name in (*SUMMARISED_TABLES, "files")]
        bucket.fetch("report/index.html", *read)
    logger.info(summarise_run(plan.run.results), extra=OURS)
    incomplete = [plan.faults.left_out(), list_failed_pages(plan.run.results)]
    if any(incomplete):
        raise WorkflowError("\n".join(filter(None, incomplete)))


onerror:
    from imubench_pipeline.report.run_summary import describe_failure

    remove_temporary(plan.run.results, BEGUN + STILL_WRITTEN)
    logger.error(describe_failure(log, plan.run.results))

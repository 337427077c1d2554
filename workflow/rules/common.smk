"""The plan of the run, how scripts are run, and the files that rules share."""

import atexit
import gc
import sys
import time
from functools import partial

from snakemake.io import IOFile
from snakemake.iocontainers import Wildcards
from snakemake.sourcecache import infer_source_file
from snakemake.utils import update_config

from imubench_pipeline.recordings.kept import describe_outcome, remove_old_samples
from imubench_pipeline.registry import files_of, references
from imubench_pipeline.report.folder import count_attempt
from imubench_pipeline.report.run_summary import describe_drop_zone
from imubench_pipeline.run.lock import Lock, TakenError, locate_lock
from imubench_pipeline.run.recovery import STILL_WRITTEN, remove_temporary
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.resources import (
    Cost,
    make_resource_functions,
    make_step_limits,
)
from imubench_pipeline.run.scripts import Scripts
from imubench_pipeline.run.sealing import (
    digest_settings,
    find_unsound_jobs,
    limit_wildcards,
)
from imubench_pipeline.settings.config import read_config, read_run
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables.files import locate_table
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, SAMPLES, TABLES
from imubench_pipeline.tables.seals import name_place


include: "bucket.smk"  # logs and results in an object store


# The graph of a thousand recordings is millions of objects, which live as long as the run: to look
# for garbage among them as often as Python does, and at the end, takes a fourth of the time.
gc.set_threshold(100_000, 20, 100)
atexit.register(gc.freeze)

# What is not complete was left by a killed run: at the beginning if it is older than a command of
# somebody takes, at the end if nothing was done to it since the beginning.
BEGUN = time.time()

HERE = workflow.current_basedir
CONFIG = Path("config/config.yaml")

path_modifier = workflow.modifier.path_modifier
if path_modifier.modifies_prefixes or path_modifier.replace_prefix("x") != "x":
    raise WorkflowError(
        "module: found prefix or replace_prefix; expected the folder of the results in its "
        "config, as results: <folder>"
    )

given = workflow.config_settings
replaced = given.replace_workflow_config and given.overwrite_config

try:
    # Not by `configfile:`, which reads YAML 1.1, where 0017 is 15, and names no line of an error.
    if not workflow.modifier.skip_configfile:
        if CONFIG.exists() and not replaced:  # every setting has a default
            update_config(config, read_config(CONFIG))
        for file in given.configfiles:
            update_config(config, read_config(file))
        update_config(config, given.config)
    provider = workflow.storage_registry.default_storage_provider
    bucket = None
    places = {}
    if provider is not None:
        prefix = workflow.storage_settings.default_storage_prefix
        bucket = Bucket(provider, prefix, read_run(config))
        bucket.list_logs()
        places = {"logs": str(bucket.logs), "results": str(bucket.results)}
    plan = Plan({**config, **places}, stored=bucket is not None)
except ConfigError as error:
    raise WorkflowError(str(error)) from None

for reason in plan.unusable.values():
    logger.warning(str(reason))

# What a rule does is named by its `script:`, and Snakemake calls the function of this name for it.
# This one forks a process that has the imports. On a cluster what fails is tried again by Snakemake;
# records of failures and seals of files need results on a disk.
script = Scripts(
    plan.faults,
    None if workflow.remote_exec or bucket else make_step_limits(plan),
    sealed=not bucket,
)
cost = make_resource_functions(plan)

run_lock = Lock(locate_lock(plan.run.results))


def take_lock():
    """Take the lock on the results, as a run begins that has something to do."""
    try:
        run_lock.acquire_unless_inherited()
    except TakenError as error:
        raise WorkflowError(str(error)) from None


def say_if_idle():
    """Say what became of the files in the drop zone where nothing was to be done."""
    is_run = (
        workflow.is_main_process and workflow.executor_plugin and not workflow.dryrun
    )
    if is_run and not len(workflow.dag):
        remove_samples()
        for line in describe_drop_zone(plan.run.results):
            print(line, file=sys.stderr)


if not {
    "--cleanup-metadata",
    "--delete-all-output",
    "--delete-temp-output",
}.isdisjoint(sys.argv):
    take_lock()

atexit.register(run_lock.release)
atexit.register(say_if_idle)

RESULTS = str(bucket.find_places([plan.run.results])[0] if bucket else plan.run.results)
KEPT = RESULTS + "/recordings/{sensor}/{recording}"
JOINED = RESULTS + "/sensors/{sensor}"
LOGS = RESULTS + "/logs"

FOLDERS = {}
for sensor, recording in plan.recordings:
    FOLDERS.setdefault(sensor, []).append(
        KEPT.format(sensor=sensor, recording=recording)
    )


wildcard_constraints:
    sensor="[^/]+",
    recording="[^/]+",


def tables_of(*made):
    """The tables that rules write into the folder of a recording."""
    return tuple(name for rule in made for name in rule.output.keys())


def of_sensor(file):
    """A file of every recording of a sensor."""
    return lambda w: [f"{folder}/{file}" for folder in FOLDERS[w.sensor]]


def at_rest(file):
    """A file of every static recording of a sensor."""
    return lambda w: [
        f"{KEPT.format(sensor=w.sensor, recording=recording)}/{file}"
        for recording in plan.static_of(w.sensor)
    ]


def every(file):
    """A file of every recording."""
    return [f"{folder}/{file}" for folders in FOLDERS.values() for folder in folders]


def of_each(recordings, table):
    """A table of some recordings."""
    return [
        f"{KEPT.format(sensor=s, recording=r)}/{table}.parquet" for s, r in recordings
    ]


def of_each_sensor(table, sensors=FOLDERS):
    """A table of every sensor, or of some."""
    return [f"{JOINED.format(sensor=sensor)}/{table}.parquet" for sensor in sensors]


def table(name):
    """A table of all sensors."""
    return str(locate_table(plan.run.results, name))


def as_files(*tables):
    """Tables of all sensors as they are written, by name."""
    return {
        name: [directory(table(name)) if plan.has_parts(name) else table(name)]
        + [f"{RESULTS}/tables/{name}.csv"] * plan.writes_csv(name)
        for name in tables
    }


def tried(step):
    """How often a step was tried. One that has this fails for its recording or sensor alone."""
    return lambda w: (0 if bucket else plan.attempt(step, w.sensor, w.get("recording")))


def log_of(sensor, recording):
    """The files of a log that decide by their dates whether it is read again."""
    found = plan.recordings[sensor, recording]
    return bucket.find_places(found.files) if bucket else found.inputs


def source_of(sensor, recording):
    """The file or folder of a log, or its copy."""
    path = plan.recordings[sensor, recording].path
    return str(bucket.find_copy(bucket.find_places([path])[0]) if bucket else path)


# On a disk the samples lie beside `quality.json`, and no rule declares them: only the log tells which
# files there are. An object store has a folder of them.
SAMPLES_OUTPUT = {}
if bucket:
    SAMPLES_OUTPUT = {
        "metadata": KEPT + "/samples.json",
        "samples": directory(KEPT + "/samples"),
    }
SAMPLES_INPUT = {"samples": KEPT + "/samples"} if bucket else {}
SAMPLES_AT_REST = {"samples": at_rest("samples")} if bucket else {}


ADDED_TABLES = {}
"""The tables of all sensors that extensions add, with the files that they are joined from."""

ADDED_OUTPUTS = []
"""Outputs of extensions that a run makes, and no other rule reads."""

SAMPLED = set()
"""Sensors whose samples stay, because a step reads all of them."""

JOBS = {}
"""The wildcards of the jobs of a step that is not of every sensor or recording."""


def own_rules():
    """The rules of this workflow by their names here; one that uses them may name them otherwise."""
    folders = [HERE] + [
        infer_source_file(str(file.parent)) for file in files_of("rules")
    ]
    known = {name: proxy.rule for name, proxy in rules._rules.items()}
    return {name: rule for name, rule in known.items() if rule.basedir in folders}


def jobs():
    """The wildcards and the settings of every job of this run, by the place of its seal."""
    found = {}
    for step, rule in own_rules().items():
        digests = {}
        for of in jobs_of(step, rule):
            wildcards = Wildcards(fromdict=of)
            params = {
                name: value(wildcards) if callable(value) else value
                for name, value in rule.params.items()
                if name != "attempt"
            }
            key = tuple(map(str, params.values()))
            digests[key] = digests.get(key) or digest_settings(params)
            found[name_place(step, *of.values())] = of, digests[key]
    return found


def jobs_of(step, rule):
    """The sensor and recording of each job of a step, by its rule."""
    if step in JOBS:
        return JOBS[step]
    if "recording" not in rule.wildcard_names:
        return [{"sensor": name} for name in FOLDERS] if rule.wildcard_names else [{}]
    return jobs_of_each(plan.recordings)


def jobs_of_each(recordings):
    """The sensor and recording of the jobs of some recordings."""
    return [{"sensor": sensor, "recording": name} for sensor, name in recordings]


def jobs_of_recordings(dag):
    """The recording of each job of this run that is of one."""
    for job in dag.needrun_jobs():
        if "recording" in job.wildcards.keys():
            yield job.wildcards.sensor, job.wildcards.recording


def made_again(wildcards):
    """The files of this run that are not as they were left; Snakemake is to make them anew.

    It does so by itself for what is missing and needed by a step that runs, and not for what is
    another file, or is damaged.
    """
    if bucket:
        return []
    every, own = jobs(), own_rules()
    held_back = {
        name_place("ingest", *key)
        for key, log in plan.recordings.items()
        if log.held_back
    }
    settings = {place: digest for place, (_, digest) in every.items()}
    unsound = {
        place: every[place][0]
        for place in find_unsound_jobs(plan.run.results, settings)
        if place not in held_back
    }
    pending = [*unsound.values(), *plan.repeated_jobs()]
    unsound |= plan.list_ingests_without_samples(pending)
    files = [
        str(own[place.split("/")[-1]].output[0].apply_wildcards(of))
        for place, of in unsound.items()
    ]
    workflow.dag.forcefiles.update(files)
    leave_out_sound(pending)
    return files


def remove_samples():
    """Remove the samples that the settings do not keep, where no job is left to do."""
    keep = plan.run.samples.keep
    if keep == "all" or bucket:
        return
    take_lock()
    every = jobs()
    settings = {place: digest for place, (_, digest) in every.items()}
    needed = {
        tuple(every[place][0].values())
        for place in find_unsound_jobs(plan.run.results, settings)
    }
    needed |= {(failure.sensor, failure.recording) for failure, _ in plan.faults.now()}
    number, size = remove_old_samples(
        (
            Path(KEPT.format(sensor=sensor, recording=name))
            for sensor, name in plan.recordings
            if {(sensor, name), (sensor,)}.isdisjoint(needed) and sensor not in SAMPLED
        ),
        keep,
    )
    if number:
        print(
            f"samples of {number} recordings were removed ({size / 1e6:.3g} MB)",
            file=sys.stderr,
        )


def leave_out_sound(pending):
    """Hide the jobs of sensors and recordings without a pending one from Snakemake.

    Their files are inputs as any others: the graph of all jobs takes most of the time of a plan.
    """
    asked = workflow.dag_settings
    # Groups are of clusters; a dry run would take a third of its time to check them.
    if workflow.dryrun:
        for made in own_rules().values():
            made.group = None
    if (
        workflow.executor_plugin is None
        or workflow.touch
        or any(
            (asked.forceall, asked.forcerun, asked.until, asked.omit_from, asked.batch)
        )
    ):
        return
    for made in own_rules().values():
        for place, file in enumerate(made.output):
            left = IOFile(limit_wildcards(str(file), pending), rule=made)
            left.clone_flags(file)
            made.output[place] = left

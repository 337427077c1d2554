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


# The graph of a thousand recordings has millions of objects, which live as long as the run. With
# Python's defaults, garbage collection among them takes a quarter of the time.
gc.set_threshold(100_000, 20, 100)
atexit.register(gc.freeze)

# Incomplete files are left by killed runs. At the beginning of a run these are the files that are too
# old to be of another command; at the end, the files that were not written since the beginning.
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

# Snakemake calls the function `script` for the `script:` of a rule. This one forks a process that has
# the imports. On a cluster, Snakemake repeats failed jobs itself. Records of failures and seals of
# files need results on a disk.
script = Scripts(
    plan.faults,
    None if workflow.remote_exec or bucket else make_step_limits(plan),
    sealed=not bucket,
)
cost = make_resource_functions(plan)

run_lock = Lock(locate_lock(plan.run.results))


def take_lock():
    """Take the lock on the results, at the beginning of a run with something to do."""
    try:
        run_lock.acquire_unless_inherited()
    except TakenError as error:
        raise WorkflowError(str(error)) from None


def say_if_idle():
    """Print the state of the files in the drop zone, if the run has nothing to do."""
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
    """Return the names of the tables that rules write into the folder of a recording."""
    return tuple(name for rule in made for name in rule.output.keys())


def of_sensor(file):
    """Return a function for the paths of a file of every recording of a sensor."""
    return lambda w: [f"{folder}/{file}" for folder in FOLDERS[w.sensor]]


def at_rest(file):
    """Return a function for the paths of a file of every static recording of a sensor."""
    return lambda w: [
        f"{KEPT.format(sensor=w.sensor, recording=recording)}/{file}"
        for recording in plan.static_of(w.sensor)
    ]


def every(file):
    """Return the paths of a file of every recording."""
    return [f"{folder}/{file}" for folders in FOLDERS.values() for folder in folders]


def of_each(recordings, table):
    """Return the paths of a table of these recordings."""
    return [
        f"{KEPT.format(sensor=s, recording=r)}/{table}.parquet" for s, r in recordings
    ]


def of_each_sensor(table, sensors=FOLDERS):
    """Return the paths of a table of every sensor, or of these."""
    return [f"{JOINED.format(sensor=sensor)}/{table}.parquet" for sensor in sensors]


def table(name):
    """Return the path of a table of all sensors."""
    return str(locate_table(plan.run.results, name))


def as_files(*tables):
    """Return the files of tables of all sensors (Parquet, and CSV if it is written), by name."""
    return {
        name: [directory(table(name)) if plan.has_parts(name) else table(name)]
        + [f"{RESULTS}/tables/{name}.csv"] * plan.writes_csv(name)
        for name in tables
    }


def tried(step):
    """Return a function for the number of attempts of a step.

    A failed step with this parameter leaves out its recording or sensor, and does not end the run.
    """
    return lambda w: (0 if bucket else plan.attempt(step, w.sensor, w.get("recording")))


def log_of(sensor, recording):
    """Return the files of a log whose dates decide whether it is read again."""
    found = plan.recordings[sensor, recording]
    return bucket.find_places(found.files) if bucket else found.inputs


def source_of(sensor, recording):
    """Return the file or folder of a log, or its copy."""
    path = plan.recordings[sensor, recording].path
    return str(bucket.find_copy(bucket.find_places([path])[0]) if bucket else path)


# On a disk, the samples are next to `quality.json`. No rule declares them, because their files depend
# on the log. In an object store they have a folder.
SAMPLES_OUTPUT = {}
if bucket:
    SAMPLES_OUTPUT = {
        "metadata": KEPT + "/samples.json",
        "samples": directory(KEPT + "/samples"),
    }
SAMPLES_INPUT = {"samples": KEPT + "/samples"} if bucket else {}
SAMPLES_AT_REST = {"samples": at_rest("samples")} if bucket else {}


ADDED_TABLES = {}
"""Tables of all sensors that extensions add, with the files that are joined to them."""

ADDED_OUTPUTS = []
"""Outputs of extensions that are results of a run, and no inputs of other rules."""

SAMPLED = set()
"""Sensors whose samples are never removed, because a step reads all of them."""

JOBS = {}
"""The wildcards of the jobs of a step, if it does not run for every sensor or recording."""


def own_rules():
    """Return the rules of this workflow by name; a workflow that imports them may rename them."""
    folders = [HERE] + [
        infer_source_file(str(file.parent)) for file in files_of("rules")
    ]
    known = {name: proxy.rule for name, proxy in rules._rules.items()}
    return {name: rule for name, rule in known.items() if rule.basedir in folders}


def jobs():
    """Return wildcards and digest of the settings of every job, by the place of its seal."""
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
    """Return the wildcards of each job of a step and its rule."""
    if step in JOBS:
        return JOBS[step]
    if "recording" not in rule.wildcard_names:
        return [{"sensor": name} for name in FOLDERS] if rule.wildcard_names else [{}]
    return jobs_of_each(plan.recordings)


def jobs_of_each(recordings):
    """Return the wildcards of the jobs of these recordings."""
    return [{"sensor": sensor, "recording": name} for sensor, name in recordings]


def jobs_of_recordings(dag):
    """Yield sensor and recording of the jobs of this run that have a recording."""
    for job in dag.needrun_jobs():
        if "recording" in job.wildcards.keys():
            yield job.wildcards.sensor, job.wildcards.recording


def made_again(wildcards):
    """Return the files that are not as a run wrote them, so that Snakemake makes them again.

    Snakemake itself finds only missing files that a pending step needs, and no files that were
    replaced or damaged.
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
    """Remove the samples that the settings do not keep, if their recording has no pending job."""
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
    """Hide from Snakemake the jobs of sensors and recordings without a pending job.

    Their outputs become plain input files: the graph of all jobs takes most of the time of a plan.
    """
    asked = workflow.dag_settings
    # Only clusters use groups; checking them takes a third of the time of a dry run.
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

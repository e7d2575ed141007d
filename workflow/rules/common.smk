# Shared by all rules: the checked configuration, and the Python that runs the verbs.
import base64
import json
import os
import re
import shlex
import sys

import pandas

from repose import strategies
from repose.apparatus import names
from repose.chain import answer as answers
from repose.config import cost, loader, results_folder, stands_on
from repose.config.study import Study
from repose.core import places
from repose.core.errors import BAD_INPUT, InputError, print_fault
from repose.core.lock import take_folder
from repose.core.published import beside, published_count
from repose.core.seeds import pour_seeds
from repose.core.provenance import SIMULATING
from repose.core.sources import engine_hash, stage_hash
from repose.dem.cache import source_hash
from repose.strategies.refined import rounds
from repose.studies import snapshot

# The verbs run under the Python that runs snakemake, whether its environment is activated or not.
shell.prefix(f"export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH; ")


def refuse(fault):
    """Print a fault of the input as the verbs do, and end with their status before any work."""
    print_fault(fault)
    sys.exit(BAD_INPUT)


def or_one_message(function, *arguments):
    """Result of a function, or one message and no work."""
    try:
        return function(*arguments)
    except (InputError, OSError) as error:
        refuse(error)


def refuse_what_jobs_refused(workflow):
    """End as the verbs do if each failed job had a fault of its input, which is the last line of its log."""
    failed = [
        single
        for job in workflow.scheduler.failed
        for single in (job.jobs if job.is_group() else [job])
    ]
    lines = {last_line(path) for job in failed for path in job.log}
    if lines and all(line.startswith("repose: error: ") for line in lines):
        refuse(
            "\n".join(line.removeprefix("repose: error: ") for line in sorted(lines))
        )


def last_line(path):
    """The last line of a log; empty where there is none."""
    if not os.path.isfile(path):
        return ""
    with open(path, errors="replace") as log:
        return ([""] + log.read().splitlines())[-1]


for place in map(str, (workflow.main_snakefile, places.root())):
    if set("{}") & set(place):  # snakemake takes them for wildcards
        refuse(f"the program lies in {place}; allowed: a folder without braces")


def checked_study(workflow):
    """The study after every check, or one message and no work.

    A job of a cluster starts a snakemake of its own, after the first one has checked the inputs.
    """
    files = [as_typed(path) for path in workflow.overwrite_configfiles]
    values = workflow.config_settings.config
    inputs = workflow.is_main_process
    return or_one_message(lambda: Study.load(*files, overrides=values, inputs=inputs))


def as_typed(path):
    """A path as one would type it: relative where it lies below the working directory."""
    here = os.getcwd()
    return (
        os.path.relpath(path, here)
        if os.path.commonpath([path, here]) == here
        else str(path)
    )


def log_plan(workflow):
    """Log the plan for the display of `repose run`: the stage of each rule, named by its file, and of
    each job its runs of a bench test and its expected time.
    """
    stages = {
        rule_.name: os.path.splitext(os.path.basename(rule_.snakefile))[0]
        for rule_ in workflow.rules
    }
    jobs = {}
    for job in workflow.dag.needrun_jobs():
        if not job.output:
            continue  # a target makes nothing
        test = (
            "drum"
            if job.rule.name == "drum_run"
            else job.params.get("apparatus", "funnel")
        )
        seeds = job.params.get("seeds", 0)
        runs = (
            1 if job.rule.name == "drum_run" else seeds if isinstance(seeds, int) else 0
        )
        jobs.setdefault(job.rule.name, {})[job.jobid] = (
            runs,
            cost.job_s(config, test, runs),
        )
    runs = sum(number for known in jobs.values() for number, _ in known.values())
    logger.info(f"{runs} runs of bench tests to make", extra={"plan": (stages, jobs)})


def published(table):
    """Path of a published table in the folder of the published solutions, if there is one."""
    return str(beside(config["validation"]["published"], table) or "") or []


def sections(*names):
    """Sections of the configuration, or single keys with a dot, whose change reruns a rule; as params."""
    return stands_on.sections(config, *names)


def recorded(path):
    """Whether snakemake has a record of having made a file."""
    name = base64.urlsafe_b64encode(path.encode()).decode()
    return os.path.exists(os.path.join(".snakemake", "metadata", name))


def is_result(path):
    """Whether a rule writes a file of this name, though none did yet."""
    made = (output for rule in workflow.rules for output in rule.output)
    return any(output.match(path) for output in made) and not recorded(path)


def refuse_outdated(paths):
    """Refuse results whose own records name other settings, if snakemake's own records of them are lost.

    With --forceall all is made again; runs that are kept and still the same are taken as they are.
    """
    unknown = [
        path for path in map(str, paths) if os.path.exists(path) and not recorded(path)
    ]
    outdated = stands_on.outdated(config, unknown)
    if outdated and not {"--forceall", "-F"} & set(sys.argv):
        refuse(
            f"{outdated[0]} and {len(outdated) - 1} more results were made with other settings or by another"
            " engine, and the records of snakemake are lost: add --forceall"
        )


def growing(amount):
    """Memory in MB or time in minutes, once more with each attempt that failed: `--retries 2` tries again with more.

    Memory is the measured use with config/config.yaml and a fifth more; a test compares it with the benchmarks of a
    run of config/quick.yaml.
    """
    return lambda wildcards, attempt: amount * attempt


# Folder of each bench test's runs. Wildcard `runs`: one of these.
RUN_FOLDERS = {name: results_folder.run_folder(name) for name in names()}
APPARATUS_OF = {runs: name for name, runs in RUN_FOLDERS.items()}


def folders_of_targets():
    """Folders of the runs that the study is calibrated by: one for each bench test of the targets."""
    return [RUN_FOLDERS[name] for name in STUDY.targets.apparatus]


def apparatus(wildcards):
    """Name of the bench test whose runs a rule makes."""
    return APPARATUS_OF[wildcards.get("runs", "heaps")]


def pouring_settings(name="funnel"):
    """Settings of a run of a bench test, without its measurement; the caller adds the number of seeds.

    An edit of the engine's source is a reason to run again.
    """
    return stands_on.pouring(config, name) | {"engine": engine_hash()}


def pouring(wildcards):
    """Settings of a run of the bench test whose runs a rule makes."""
    return pouring_settings(apparatus(wildcards))


def measuring(wildcards):
    """Settings of the measurement of a run."""
    return stands_on.measuring(config, apparatus(wildcards))


def folder(wildcards, output):
    """Folder of a rule's first output."""
    return os.path.dirname(output[0])


def folders_of_jobs(wildcards, input):
    """Folders of a table's jobs: thousands of files would be more than a command line takes."""
    return list(dict.fromkeys(map(os.path.dirname, input.jobs)))


def validation_seeds(wildcards):
    """Pours of a solution; the representative gets more."""
    is_representative = wildcards.sample == OWN_SOLUTIONS[0]
    return config["validation"][
        "representative_seeds" if is_representative else "seeds"
    ]


def solution_to_pour(wildcards):
    """The table of a solution."""
    origin = (
        rules.solutions
        if wildcards.sample in OWN_SOLUTIONS
        else rules.published_solutions
    )
    return origin.output.solutions

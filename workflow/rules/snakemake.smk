# All that this workflow takes of Snakemake's insides, because no interface of its offers it. Each is held to the
# installed version by tests/workflow/test_insides.py.
import base64
import contextlib
import math
import os
import re

import pandas
import psutil
import snakemake.benchmark
from snakemake.io import regex_from_filepattern
from snakemake.logging import logger
from snakemake_interface_logger_plugins.common import LogEvent

# Configurations of the command line, one by one, so that a message names the file that is at fault.
CONFIGURATIONS = workflow.overwrite_configfiles
VALUES = workflow.config_settings.config
MAIN_SNAKEFILE = workflow.main_snakefile
IS_MAIN = workflow.is_main_process  # a job of a cluster starts a snakemake of its own
FAILED_LOGS = set()  # of the jobs that failed


def note_failed(record):
    """Filter of the logger: keeps the logs of failed jobs, and lets every record pass."""
    if getattr(record, "event", None) == LogEvent.JOB_ERROR:
        FAILED_LOGS.update(map(str, record.log))
    elif getattr(record, "event", None) == LogEvent.GROUP_ERROR:
        for job in record.job_error_info:
            FAILED_LOGS.update(map(str, job["log"]))
    return True


logger.addFilter(note_failed)


LOOKED_AT = snakemake.benchmark.benchmarked


@contextlib.contextmanager
def benchmarked_to_its_end(pid=None, *words):
    """Snakemake's benchmark of a shell command, with all its processor time.

    Snakemake's own is that of its last look at the job, a half minute before the end of a long one. It is none on a
    system that does not keep the times of an ended process until they are asked for.
    """
    with LOOKED_AT(pid, *words) as record:
        used_s = used_at_its_end_s(pid) if pid else None
        yield record
    if pid:
        record.cpu_time = used_s


def used_at_its_end_s(pid):
    """Wait until a child ends; its processor time and that of its children [s], NaN where it cannot be known."""
    try:
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
        return sum(psutil.Process(pid).cpu_times()[:4])
    except (AttributeError, OSError, psutil.Error):
        return math.nan


snakemake.benchmark.benchmarked = benchmarked_to_its_end


def used_elsewhere_s():
    """Processor time [s] of the jobs of this run that were no children of this process, as a cluster's."""
    jobs = (job for job in workflow.dag.finished_jobs if job.benchmark)
    paths = {job.benchmark for job in jobs if not workflow.is_local(job.rule)}
    return sum(pandas.read_csv(path, sep="\t").cpu_time.sum() for path in paths)


def recorded(path):
    """Whether snakemake has a record of having made a file; it is asked for before snakemake reads its records."""
    name = base64.urlsafe_b64encode(path.encode()).decode()
    return os.path.exists(os.path.join(".snakemake", "metadata", name))


def planned_rules():
    """Names of the rules of all jobs of this run; none where files are only touched."""
    return set() if workflow.touch else {job.rule.name for job in workflow.dag.jobs}


def start_jobs_at_once():
    """Lift the limit of jobs a second.

    With one (100 by default, and no option is none) the scheduler looks at all jobs once more a second later, for ever,
    after each job that ends: after 300 jobs 300 times a second.
    """
    workflow.scheduler.job_rate_limiter = None


def register_handlers(onstart, onsuccess, onerror):
    """Make them the handlers of a workflow that is a module, as snakedeploy brings it: snakemake leaves those out."""
    if not workflow.modifier.is_main_snakefile():
        workflow._onstart = lambda log: onstart()
        workflow._onsuccess = lambda log: onsuccess()
        workflow._onerror = lambda log: onerror()


def complete_rules():
    """Give each rule a benchmark beside its log, and the hash of the code of its stage.

    An edit of a module that a stage stands on is a reason to run it again. What waits for the compiled engine simulates,
    and has the engine's hash in its settings instead. Rules that have theirs already are left as they are.
    """
    for rule_ in workflow.rules:
        stages = re.findall(
            r"python -m repose (?:stage )?(\w+)(?= )", rule_.shellcmd or ""
        )
        if rule_.log and not rule_.benchmark:
            log = (
                str(rule_.log[0]).removeprefix(f"{RESULTS}/logs/").removesuffix(".log")
            )
            rule_.benchmark_modifier = rule_.log_modifier
            rule_.benchmark = f"{RESULTS}/benchmarks/{log}.tsv"
        if stages and not {"ready", "code"} & {
            *rule_.input.keys(),
            *rule_.params.keys(),
        }:
            rule_.set_params(code=[stage_hash(name) for name in stages])


def is_output(path):
    """Whether a rule writes a file of this name."""
    return any(output.match(path) for rule in workflow.rules for output in rule.output)


def has_name_of_ours(name):
    """Whether the rules write a file or folder of this name in the folder of results."""
    paths = (path for rule in workflow.rules for path in (*rule.output, *rule.log))
    below = (str(path).removeprefix(f"{RESULTS}/") for path in paths)
    parts = {"benchmarks", *(path.partition("/")[0] for path in below)}
    return any(re.fullmatch(regex_from_filepattern(part), name) for part in parts)

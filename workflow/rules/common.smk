# Shared by all rules: the study, which is made of snakemake's `config`, and what rules have in common.
import collections
import functools
import gc
import json
import math
import os
import shlex
import sys
from pathlib import Path

# What Snakemake has loaded so far stays in use to the end. Excluded from garbage
# collection, it no longer costs a quarter of the time in which the rules are read.
gc.freeze()

# Before numpy is loaded, as in a subcommand: the matrices are small.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from repose.calibrate import strategies
from repose.bench import names
from repose.config import cost, results_folder, dependencies
from repose.config.workflow_run import (
    check_folder,
    check_kept_results_when_planned,
    handle_sigterm_in_thread,
    has_pour_jobs,
    prepare_run,
)
from repose.common import places
from repose.common.errors import BAD_INPUT, InputError, exit_on_fault
from repose.common.provenance import engine_hash, hash_content
from repose.common.reading import read_yaml
from repose.common.source_code import code_hash
from repose.stages.published import (
    FIRST_PUBLISHED,
    find_response_columns,
    find_sibling_table,
    list_sets_to_simulate,
    list_tables,
    read_column_names,
)
from repose.stages.settings import N_PLAUSIBLE_SETS, N_SEEDS_OF_PLAUSIBLE_SET
from repose.calibrate.seeds import PURPOSE_STREAMS, draw_run_seeds
from repose.calibrate.targets import OWN_BENCH
from repose.dem.sources import source_hash
from repose.report import figures
from repose.calibrate.surrogates import find_surrogate_class

# The subcommands run under the Python that runs snakemake, whether its environment is activated or not.
shell.prefix(f"export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH; ")


# Where nothing is given: the folder's own study, or the goji berry. A study of --configfile, --config or a module's
# config lies over the defaults that it needs; a crop inherits nothing of another one.
if not config:
    DEFAULT_CONFIG = places.list_default_configs()[-1]
    # Snakemake names neither the file nor the line of a fault.
    with exit_on_fault():
        read_yaml(DEFAULT_CONFIG)

    configfile: str(DEFAULT_CONFIG)


# A fault ends here with one message, before any work.
with exit_on_fault():
    for place in (str(places.find_program_folder()), f"{workflow.basedir}/Snakefile"):
        if set("{}") & set(place):  # snakemake takes them for wildcards
            allowed = "a folder without braces"
            raise InputError("installation", "folder", place, allowed)
    RUN = prepare_run(
        config,
        configfiles=workflow.overwrite_configfiles,
        has_command_line=bool(workflow.config_settings.config),
        check_inputs=workflow.is_main_process,
    )
STUDY = RUN.study
config = STUDY.config
RESULTS = config["results_dir"]
CONFIG = f"{RESULTS}/config.json"
# Rules that make the products of the study's strategy: those of the article's method, and of a strategy with several batches.
AFTER_THE_ARTICLE = strategies.strategy(config["strategy"]).begins_with_design
# The strategy whose answer is that of the study. `refined` starts from the answer of `published`.
STRATEGY = "published" if AFTER_THE_ARTICLE else config["strategy"]
PRODUCTS = [
    *(["calibration", "figures"] if AFTER_THE_ARTICLE else []),
    *([config["strategy"]] if config["strategy"] != "published" else []),
]
# What a stage reads of the configuration, with the content of files; as it stands there. Their change reruns a rule.
select_stage_settings = functools.partial(dependencies.select_stage_settings, config)
select_sections = functools.partial(dependencies.select_sections, config)
# Whether a program of the user's own makes the runs.
IS_EXTERNAL = STUDY.simulator is not None
# Ten times the estimate of the longest job, for slower cores and busy ones.
MINUTES_OF_RUNS = 10
if not IS_EXTERNAL:
    MINUTES_OF_RUNS += round(10 * cost.estimate_longest_job_s(config) / 60)
# Folder of each bench test's runs. Wildcard `runs`: one of these.
RUN_FOLDERS = {
    name: results_folder.name_run_folder(name) for name in (*names(), OWN_BENCH)
}
APPARATUS_OF = {runs: name for name, runs in RUN_FOLDERS.items()}
# Bench tests whose responses are targets, and the folders of their runs.
BENCH_TESTS = STUDY.targets.apparatus
FOLDERS = [RUN_FOLDERS[name] for name in BENCH_TESTS]
SAMPLES = [f"{number:03d}" for number in range(1, config["design"]["samples"] + 1)]


wildcard_constraints:
    sample=r"\d{3,5}",
    runs="|".join(APPARATUS_OF),


def find_published_table(table):
    """Find a table beside that of the published solutions; an empty list if there is none."""
    return str(find_sibling_table(config["validation"]["published"], table) or "") or []


def find_output_folder(wildcards, output):
    """Find the folder of a rule's first output."""
    return os.path.dirname(output[0])


def resources_for_attempt(mem_mb, minutes=10):
    """Return the memory and the time of a rule, which grow with each attempt: `--retries 2` tries again with more.

    The memory is what the rule needed with config/config.yaml, and at least a fifth more. A test compares it with the benchmarks
    of a run of config/quick.yaml.
    """
    return {
        "mem_mb": grow_with_attempts(mem_mb),
        "runtime": grow_with_attempts(minutes),
    }


def grow_with_attempts(amount):
    """Return a function that multiplies memory in MB or time in minutes by the number of the attempt."""
    return lambda wildcards, attempt: amount * attempt


def find_bench_test(wildcards):
    """Find the bench test whose runs a rule makes."""
    return APPARATUS_OF[wildcards.get("runs", "heaps")]


def list_job_folders(wildcards, input):
    """List the folders of a table's jobs. The paths of thousands of files would be too long for a command line."""
    return list(dict.fromkeys(map(os.path.dirname, input.jobs)))


def list_sample_paths(samples, path):
    """List a path for each sample. The other wildcards of the path stay."""
    return expand(path, sample=samples, allow_missing=True)


def find_runs_to_measure(wildcards, input, output):
    """Find what the subcommand measures: the runs of all samples in a folder, or those of one job."""
    if "samples" not in input.keys():
        return input.pours
    return [find_output_folder(wildcards, output), "--samples", input.samples]


# Its change draws every figure again.
RESOLUTION = {"figures.dpi": STUDY.settings.figures.dpi}
# The figures of this study, of those that `repose.report.figures.catalogue` lists.
FIGURES = {name: one for name, one in figures.FIGURES.items() if one.when(STUDY)}


def list_figure_names(folder):
    """List the figures of a folder: `figures`, or the folder of a study or strategy."""
    return [name for name, one in FIGURES.items() if one.folder == folder]


# The end of a strategy, for the answer, the material card and the report: its last rule, and its files.
Answer = collections.namedtuple(
    "Answer", "rule feasible summary table4 representative dataset"
)
ANSWERS = {}  # by strategy


def find_answer():
    """Find the answer of the study."""
    return ANSWERS[STRATEGY]


def find_card_folder(strategy):
    """Find the folder of the card and the report of a strategy. Those of the study's answer lie in the folder of results."""
    return RESULTS if strategy in (STRATEGY, "published") else f"{RESULTS}/{strategy}"


def find_figure_paths(*names):
    """Find the paths of those figures that this study has."""
    return {
        name: f"{RESULTS}/{FIGURES[name].folder}/{name}.png"
        for name in names
        if name in FIGURES
    }


def drop_missing(paths):
    """Drop the entries whose path is empty or false, because this study does not have them."""
    return {name: path for name, path in paths.items() if path}


def find_input_paths(inputs, places):
    """Find the paths of a figure's inputs: in the folder of results, or in the place that the path names in braces."""
    return drop_missing(
        {
            name: place.format(**places) if "{" in place else f"{RESULTS}/{place}"
            for name, place in inputs.items()
        }
    )


def list_other_formats(png):
    """List the files of a figure in the other formats of the configuration."""
    kinds = [kind for kind in STUDY.settings.figures.format if kind != "png"]
    return [f"{png.removesuffix('png')}{kind}" for kind in kinds]


def list_figure_files(*names):
    """List the files of figures in all formats."""
    pictures = find_figure_paths(*names).values()
    return [*pictures, *(path for png in pictures for path in list_other_formats(png))]


def list_answer_jobs(strategy, wildcards):
    """List the measured runs of a strategy's answer."""
    if strategy != "published":
        return check_jobs(strategy)
    first = rules.measure_validation_runs.output.result[0]
    return expand(first, runs=FOLDERS)

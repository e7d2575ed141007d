# Shared by all rules: the checked configuration, what rules have in common, and the Python that runs the verbs.
import collections
import json
import os
import resource
import shlex
import sys
import time

# Before numpy is loaded, as in a verb: the matrices are small.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pandas
import psutil

from repose import strategies
from repose.apparatus import names, reach
from repose.chain import answer as answers
from repose.chain import validate as checks
from repose.config import cost, loader, results_folder, stands_on
from repose.config.study import Study
from repose.core import places
from repose.core.errors import BAD_INPUT, InputError, print_fault
from repose.core.files import read_table, write_table
from repose.core.lock import take_folder
from repose.core.provenance import machine
from repose.core.published import beside, read_stored, tables, to_simulate
from repose.core.seeds import PURPOSES, pour_seeds
from repose.core.sources import engine_hash, stage_hash
from repose.dem.cache import source_hash
from repose.pictures import figures
from repose.studies import next_measurement
from repose.surrogate import kind_of

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


def refuse_what_jobs_refused():
    """End as the verbs do if each failed job had a fault of its input, which is the last line of its log."""
    lines = {last_line(path) for path in FAILED_LOGS}
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


for place in map(str, (MAIN_SNAKEFILE, places.root())):
    if set("{}") & set(place):  # snakemake takes them for wildcards
        refuse(f"the program lies in {place}; allowed: a folder without braces")


def as_typed(path):
    """A path as one would type it: relative where it lies below the working directory."""
    here = os.getcwd()
    return (
        os.path.relpath(path, here)
        if os.path.commonpath([path, here]) == here
        else str(path)
    )


# The default, the folder's own, --configfile and --config, each over the one before, checked; a bad value ends here
# with one message. A job of a cluster, or that which draws the workflow, starts a snakemake of its own, after the first
# one has checked the inputs.
CHECKS_INPUTS = IS_MAIN and "--rulegraph" not in sys.argv
STUDY = or_one_message(
    lambda: Study.load(
        *map(as_typed, CONFIGURATIONS), overrides=VALUES, inputs=CHECKS_INPUTS
    )
)
config = STUDY.config
RESULTS = config["results_dir"]
CONFIG = f"{RESULTS}/config.json"
# Rules that make the products of the study's strategy: those of the article's method, and of a strategy with several batches.
AFTER_THE_ARTICLE = strategies.strategy(config["strategy"]).begins_with_design
PRODUCTS = [
    *(["calibration", "figures"] if AFTER_THE_ARTICLE else []),
    *([config["strategy"]] if config["strategy"] != "published" else []),
]


def say_the_reach():
    """Print whether piles of the grains can have angle and Height of the targets, as `repose check` does."""
    if IS_MAIN:
        for line in reach.said(config, STUDY.particle, stands_on.own_dataset(config)):
            print(line, file=sys.stderr, flush=True)


def say_the_time():
    """Print the times of this call of snakemake, and add them to the table of all calls in the folder of results."""
    path = f"{RESULTS}/benchmarks/calls.csv"
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    began_s = psutil.Process().create_time()
    cpu_s = sum(sum(resource.getrusage(one)[:2]) for one in who) + used_elsewhere_s()
    call = {
        "began": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(began_s)),
        "wall_s": round(time.time() - began_s, 1),
        "cpu_s": round(cpu_s, 1),
        "processor": machine()["processor"],
    }
    earlier = [read_table(path, call)] if os.path.exists(path) else []
    calls = pandas.concat([*earlier, pandas.DataFrame([call])])
    last, whole = (
        f"{table.wall_s.sum() / 60:.1f} min by the clock, {table.cpu_s.sum() / 60:.1f} min of processor time"
        for table in (calls[-1:], calls)
    )
    more = f"; all {len(calls)} calls: {whole}" if earlier else ""
    print(f"time: {last} on {call['processor']}{more} ({path})", file=sys.stderr)
    write_table(path, calls)


def is_result(path):
    """Whether a rule writes a file of this name, though none did yet."""
    return is_output(path) and not recorded(path)


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


def published(table):
    """Path of a published table in the folder of the published solutions, if there is one."""
    return str(beside(config["validation"]["published"], table) or "") or []


def sections(*names):
    """Sections of the configuration, or single keys with a dot, whose change reruns a rule; as params."""
    return stands_on.sections(config, *names)


def folder(wildcards, output):
    """Folder of a rule's first output."""
    return os.path.dirname(output[0])


def of_stage(name, folder=folder):
    """Params for a stage: the configuration, the folder that it writes, the settings that it reads."""
    depends = stands_on.settings_of(config, name)
    return {"config": CONFIG, "folder": folder, "depends": depends}


def needs(mem_mb, minutes=10):
    """Resources of a rule, once more with each attempt that failed: `--retries 2` tries again with more.

    Memory is the measured use with config/config.yaml and at least a fifth more; a test compares it with the benchmarks of a
    run of config/quick.yaml.
    """
    return {"mem_mb": growing(mem_mb), "runtime": growing(minutes)}


def growing(amount):
    """Memory in MB or time in minutes, in proportion to the number of attempts."""
    return lambda wildcards, attempt: amount * attempt


# Ten times the estimate of the longest job, for slower cores and busy ones.
MINUTES_OF_RUNS = 10 + round(10 * cost.longest_job_s(config) / 60)
# Folder of each bench test's runs. Wildcard `runs`: one of these.
RUN_FOLDERS = {name: results_folder.run_folder(name) for name in names()}
APPARATUS_OF = {runs: name for name, runs in RUN_FOLDERS.items()}
# Bench tests whose responses are targets.
BENCH_TESTS = STUDY.targets.apparatus


def folders_of_targets():
    """Folders of the runs that the study is calibrated by: one for each bench test of the targets."""
    return [RUN_FOLDERS[name] for name in BENCH_TESTS]


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


def folders_of_jobs(wildcards, input):
    """Folders of a table's jobs: thousands of files would be more than a command line takes."""
    return list(dict.fromkeys(map(os.path.dirname, input.jobs)))


def for_each(samples, path):
    """Paths of all samples; further wildcards stay."""
    return expand(path, sample=samples, allow_missing=True)


def jobs_to_measure(wildcards, input, output):
    """Words for the verb that measures: the folder of a table's jobs, or the one job."""
    if "samples" not in input.keys():
        return input.pours
    return [folder(wildcards, output), "--samples", input.samples]


# Its change draws every figure again.
RESOLUTION = {"figures.dpi": STUDY.settings.figures.dpi}
# The figures of this study, as `@figure` says beside the function of each.
FIGURES = {name: one for name, one in figures.FIGURES.items() if one.when(STUDY)}


def figures_in(folder):
    """Names of the figures in a folder: `figures`, or that of a study or strategy."""
    return [name for name, one in FIGURES.items() if one.folder == folder]


# The end of a strategy, for the answer, the material card and the report: its last rule, and its files.
Answer = collections.namedtuple(
    "Answer", "rule feasible summary table4 representative dataset"
)
ANSWERS = {}  # by strategy


def answer():
    """The answer of the study's strategy; `refined` goes on from the published one."""
    return ANSWERS["published" if AFTER_THE_ARTICLE else config["strategy"]]


def of_the_chain():
    """Whether the method's own chain gives the answer."""
    return answer() is ANSWERS["published"]


def drawn(*names):
    """Paths of this study's figures among the names."""
    return {
        name: f"{RESULTS}/{FIGURES[name].folder}/{name}.png"
        for name in names
        if name in FIGURES
    }


def present(paths):
    """The entries whose path is neither empty nor false: what this study has."""
    return {name: path for name, path in paths.items() if path}


def placed(inputs, places):
    """Paths of a figure's inputs by name: files below the folder of results, or of `places` by their names in braces."""
    return present(
        {
            name: place.format(**places) if "{" in place else f"{RESULTS}/{place}"
            for name, place in inputs.items()
        }
    )


def further(png):
    """Files of a figure beside its PNG: the other formats of the configuration."""
    kinds = [kind for kind in STUDY.settings.figures.format if kind != "png"]
    return [f"{png.removesuffix('png')}{kind}" for kind in kinds]


def all_files(*names):
    """All files of figures by their names."""
    pictures = drawn(*names).values()
    return [*pictures, *(path for png in pictures for path in further(png))]


def answer_jobs(wildcards):
    """Measured runs of the answer."""
    if not of_the_chain():
        return check_jobs(config["strategy"])
    first = rules.measure_validation_runs.output.result[0]
    return expand(first, runs=folders_of_targets())

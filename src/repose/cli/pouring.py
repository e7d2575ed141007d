"""Verbs that simulate: heaps through the funnel, beds in the drum."""

import json

from repose.cli.berries import BERRY_AND_PARTICLE, berry_and_particle
from repose.cli.options import JSON
from repose.cli.parameter_sets import PARAMETER_SET, SEED, STUDY_SEEDS, parameters, pour_seeds, run_seeds
from repose.cli.registry import Family, Option
from repose.config import loader
from repose.core.errors import InputError

SIMULATION = (*PARAMETER_SET, SEED, *BERRY_AND_PARTICLE)
POUR = (
    *SIMULATION,
    *STUDY_SEEDS,
    Option("--trajectory", type=float, metavar="S", help="also write positions every S seconds"),
)
# Runs in words.
POURED = (
    "angle of repose {aor_deg:.2f} deg, Height {height_mm:.1f} mm, "
    "{berries_on_plate} berries on the plate, {wall_s:.1f} s"
)
TURNED = (
    "first slip after {before_time_s:.1f} s, {before_turned_deg:.1f} deg; "
    "surface {before_surface_deg:.1f} deg before, {after_surface_deg:.1f} deg after it, {wall_s:.0f} s"
)

family = Family()


@family.verb(
    "pour berries through the funnel, measure the pile; one parameter set, one seed or several",
    example="--set e_gg=0.203 --set mus_gg=0.642 --seed 1 --out results/try --json",
    out="results/try",
    options=[*POUR, JSON.but(help="print the result as JSON")],
)
def heap(args):
    from repose.apparatus.heap import run_job

    result = run_job(*_pour_arguments(args))
    if args.json:
        print(json.dumps(_flat(result) if len(result["runs"]) == 1 else result, indent=1))
    else:
        for run in result["runs"]:
            print(told(run, POURED))


@family.verb(
    "pour as the verb heap does and write where the berries lie, to be measured by measure_heap",
    example="--set mus_gg=0.642 --seed 1 --out results/try",
    out="results/try",
    options=POUR,
)
def pour(args):
    from repose.apparatus.heap import pour_job

    print(pour_job(*_pour_arguments(args)))


def _pour_arguments(args):
    """The arguments of `heap.pour_job` and `heap.run_job`."""
    config = loader.load(args.config)
    values = parameters(args.set, args.samples, args.sample, config["parameters"])
    seeds = pour_seeds(args, config["design"]["seed"])
    step, end = config["simulation"]["time_step_s"], config["funnel"]["duration_s"]
    if args.trajectory is not None and not step <= args.trajectory <= end:
        raise InputError("command line", "--trajectory", args.trajectory, f"from {step:g} to {end:g} s")
    berry_of, particle = berry_and_particle(config, args.config, args.berry, args.particle)

    from repose.dem.io.progress import display

    def progress(seed):
        return display(0.0, end, step, label=f"seed {seed}")

    name = f"{args.sample:03d}" if args.sample is not None else "heap"
    return config, name, values, seeds, particle, berry_of, args.out, args.trajectory, progress


def _flat(result):
    """Result of a job with one seed as one record."""
    shared = {key: result[key] for key in ("parameters", "time_step_s")}
    return shared | result["runs"][0]


@family.verb(
    "measure the piles of saved pours, without pouring again",
    example="results/try/heap.pours.json --out results/try",
    options=[
        Option("pours", nargs="+", help="NAME.pours.json files of pour or heap, NAME.npz beside them"),
        Option("--out", help="folder for NAME.json (that of the pours)"),
        *BERRY_AND_PARTICLE,
    ],
)
def measure_heap(args):
    config = loader.load(args.config)
    berry_of, particle = berry_and_particle(config, args.config, args.berry, args.particle)

    from repose.measure.saved_pours import measure_job

    for path in args.pours:
        for run in measure_job(config, path, particle, berry_of, args.out)["runs"]:
            print(f"{path}: {told(run, POURED)}")


@family.verb(
    "let berries rest in a drum and turn it until its bed slips; one parameter set, one seed or several",
    example="--set mus_gg=0.642 --set mus_gp=0.483 --seed 1 --out results/try",
    out="results/try",
    options=[
        *SIMULATION,
        Option("--trajectory", action="store_true", help="also write every frame of the record"),
        JSON.but(help="print the results as JSON"),
    ],
)
def drum(args):
    config = loader.load(args.config)
    values = parameters(args.set, args.samples, args.sample, config["parameters"])
    seeds = run_seeds(args.seed)
    berry_of, particle = berry_and_particle(config, args.config, args.berry, args.particle)

    from repose.apparatus.drum import run_job

    results = run_job(config, values, seeds, particle, berry_of, args.out, args.trajectory)
    if args.json:
        print(json.dumps(results, indent=1))
    else:
        for result in results:
            print(told(result["run"], TURNED))


@family.verb(
    "runs of the drum to tables: angles, first slip, slipping layer, with standard errors",
    example="results/drum/turn_*.json --out results/drum",
    out="results/drum",
    config=False,
    options=[Option("runs", nargs="+", help="JSON files that the verb drum wrote")],
)
def drum_tables(args):
    from repose.apparatus import drum_tables

    drum_tables.run(args.runs, args.out)


def told(run, words):
    """One run in words, a template of its values; or why there are none."""
    if run["status"] != "ok":
        return f"seed {run['seed']}: {run['status']}: {run['reason']}"
    return f"seed {run['seed']}: {words.format(**run)}"

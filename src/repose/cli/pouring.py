"""Verbs that simulate: berries in any bench test, and the tables of the drum."""

import argparse
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from repose.cli.berries import BERRY_AND_PARTICLE, berry_and_particle
from repose.cli.options import JSON, SAMPLES
from repose.cli.parameter_sets import PARAMETER_SET, SEED, STUDY_SEEDS, parameters, pour_seeds, run_seeds
from repose.cli.registry import Option, verb
from repose.cli.stages import recorded
from repose.config.keys import section
from repose.core import provenance
from repose.core.errors import InputError
from repose.core.files import json_text
from repose.core.parameter_sets import job_files

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from repose.apparatus.bench_test import BenchTest, Scene
    from repose.apparatus.job import Progress
    from repose.config.study import Study

SIMULATION = (*PARAMETER_SET, SEED, *BERRY_AND_PARTICLE)
APPARATUS = Option("--apparatus", default="funnel", metavar="NAME", help="bench test (funnel)")
POUR = (
    *SIMULATION,
    *STUDY_SEEDS,
    Option("--trajectory", type=float, metavar="S", help="also write positions every S seconds"),
)
KEEP = Option(
    "--keep-runs",
    action="store_true",
    help="keep each run in OUT/runs; a kept run with the same settings is not run again",
)
MEASURE = Option(
    "--measure", action="store_true", help="also measure the runs, and keep that for measure_runs --keep-runs"
)


class _Job(NamedTuple):
    """A job from the command line: the arguments of `repose.apparatus.job.pour_job`."""

    test: "BenchTest[Any]"
    scene: "Scene"
    name: str
    seeds: list[int]
    out_dir: str
    interval_s: float | None
    progress: "Progress | None"


@verb(
    "compile the engine for a study's particle, so that runs that start together do not each compile it",
    example="--config config/quick.yaml",
    options=[*BERRY_AND_PARTICLE, Option("--cores", type=int, default=1, help="compile on one core or on two (1)")],
)
def warm_up(args: argparse.Namespace, study: "Study") -> None:
    from repose.apparatus import Scene, warm_up
    from repose.dem.cache import folder

    berry_of, particle = berry_and_particle(study, args.berry, args.particle)
    values = parameters([], None, None, study.config["parameters"])
    took_s = warm_up.warm_up(Scene.of(study.config, values, berry_of, particle), args.cores)
    print(f"the engine was ready after {took_s:.1f} s; its compiled code is in {folder()}")


@verb(
    "run a bench test with one parameter set and one or more seeds; save the runs for measure_runs",
    example="--apparatus funnel --set mus_gg=0.5 --seed 1 --out results/try",
    out="results/try",
    options=[APPARATUS, *POUR, KEEP, MEASURE],
    runs="made",
)
def pour(args: argparse.Namespace, study: "Study") -> None:
    from repose.apparatus import kept_runs
    from repose.apparatus.job import measured, pour_job

    job = _job(args, study, args.apparatus)
    pours = pour_job(**job._asdict(), keeps_runs=args.keep_runs)
    print(pours)
    if args.measure:
        as_measured = argparse.Namespace(**(vars(args) | {"verb": "measure_runs", "pours": [str(pours)]}))
        with recorded(as_measured, "measured"):
            provenance.note_config(study.config)
            if kept_runs.read_measurement(pours) is None:
                kept_runs.write_measurement(pours, measured(job.scene, pours))


@verb(
    "pour grains through the funnel and measure the pile: pour and measure_runs in one verb",
    example="--set e_gg=0.3 --set mus_gg=0.5 --seed 1 --out results/try --json",
    out="results/try",
    options=[*POUR, JSON.but(help="print the result as JSON")],
    runs="made",
)
def heap(args: argparse.Namespace, study: "Study") -> None:
    from repose.apparatus.job import measure_job, pour_job

    job = _job(args, study, "funnel")
    result = measure_job(job.scene, pour_job(**job._asdict()))
    if args.json:
        print(json_text(_flat(result) if len(result["runs"]) == 1 else result))
    else:
        for run in result["runs"]:
            print(describe(run, job.test.summary))


def _job(args: argparse.Namespace, study: "Study", apparatus: str) -> _Job:
    """Make the job of the options."""
    from repose.apparatus import Scene, bench
    from repose.apparatus.settings import SceneSettings, SimulationSettings
    from repose.dem.io.progress import display

    test = bench(apparatus, "command line")
    section(study.config, apparatus)
    values = parameters(args.set, args.samples, args.sample, study.config["parameters"])
    seeds = pour_seeds(args, study.config["design"]["seed"], apparatus)
    step, end = SimulationSettings.of(study.config).time_step_s, test.duration_s(SceneSettings(study.config))
    if args.trajectory is not None and not step <= args.trajectory <= end:
        raise InputError("command line", "--trajectory", args.trajectory, f"from {step:g} to {end:g} s")
    berry_of, particle = berry_and_particle(study, args.berry, args.particle)

    def progress(seed: int) -> "AbstractContextManager[Callable[[float], object]]":
        return display(0.0, end, step, label=f"seed {seed}")

    name = f"{args.sample:03d}" if args.sample is not None else ("heap" if apparatus == "funnel" else apparatus)
    scene = Scene.of(study.config, values, berry_of, particle)
    return _Job(test, scene, name, seeds, args.out, args.trajectory, progress)


def _flat(result: Mapping[str, Any]) -> dict[str, Any]:
    """Make one record of the result of a job with one seed."""
    shared = {key: result[key] for key in ("parameters", "time_step_s")}
    return shared | result["runs"][0]


@verb(
    "measure the saved runs of any bench test, without running it again",
    example="results/try/heap.pours.json --out results/try",
    options=[
        Option(
            "pours",
            nargs="+",
            help="NAME.pours.json files of pour or heap, NAME.npz beside them; or a folder, of all --samples",
        ),
        SAMPLES.but(help="the samples of a folder"),
        Option("--out", help="folder for NAME.json (the folder of the pours)", recorded=False),
        *BERRY_AND_PARTICLE,
        KEEP.but(help="keep each measurement beside its runs, and take a kept one that is the same"),
    ],
    runs="measured",
)
def measure_runs(args: argparse.Namespace, study: "Study") -> None:
    from repose.apparatus import Scene, bench_of
    from repose.apparatus.job import measure_job
    from repose.measure.saved_pours import POURS

    berry_of, particle = berry_and_particle(study, args.berry, args.particle)
    scene = Scene.of(study.config, {}, berry_of, particle)
    for path in job_files(args.pours, args.samples, POURS):
        result = measure_job(scene, path, args.out, args.keep_runs)
        template = bench_of(result).summary
        for run in result["runs"]:
            print(f"{path}: {describe(run, template)}")


@verb(
    "fill a drum and turn it until the bed slips; save the runs for drum_tables, print the measurement",
    example="--set mus_gg=0.5 --set mus_gp=0.6 --seed 1 --out results/try",
    out="results/try",
    options=[*SIMULATION, JSON.but(help="print the measured runs as JSON")],
    runs="made",
)
def drum(args: argparse.Namespace, study: "Study") -> None:
    from repose.apparatus import Scene, bench, drum_tables

    section(study.config, "drum")
    values = parameters(args.set, args.samples, args.sample, study.config["parameters"])
    seeds = run_seeds(args.seed)
    berry_of, particle = berry_and_particle(study, args.berry, args.particle)
    scene = Scene.of(study.config, values, berry_of, particle)
    results = drum_tables.run_job(scene, seeds, args.out)
    if args.json:
        print(json_text(results))
    else:
        for result in results:
            print(describe(result["run"], bench("drum").summary))


@verb(
    "measure the drum's runs and make tables: angles, first slip, slipping layer, with standard errors",
    example="results/drum/drum_*.json --out results/drum",
    out="results/drum",
    options=[Option("runs", nargs="+", help="JSON files that the verb drum wrote"), *BERRY_AND_PARTICLE],
)
def drum_tables(args: argparse.Namespace, study: "Study") -> None:
    from repose.apparatus import drum_tables

    section(study.config, "drum")
    _, particle = berry_and_particle(study, args.berry, args.particle)
    drum_tables.run(args.runs, study.config, particle, args.out)


def describe(run: Mapping[str, Any], template: str) -> str:
    """Describe a measured run by the bench test's `template`, a failed run by its reason."""
    if run["status"] != "ok":
        return f"seed {run['seed']}: {run['status']}: {run['reason']}"
    try:
        return f"seed {run['seed']}: {template.format(**run)}"
    except (KeyError, TypeError):  # a response that is no target and could not be measured
        return f"seed {run['seed']}: ok"

"""Verbs that simulate: grains in any bench test, and the tables of the drum."""

import argparse
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

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
from repose.core.runs import describe

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

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


@verb(
    "compile the engine for a study's particle, so that runs that start together do not each compile it",
    example="--config config/quick.yaml",
    options=[*BERRY_AND_PARTICLE, Option("--cores", type=int, default=1, help="compile on one core or on two (1)")],
)
def warm_up(args: argparse.Namespace, study: "Study") -> None:
    from repose.apparatus import Scene, warm_up
    from repose.dem.cache import folder

    values = parameters([], None, None, study)
    scene = Scene.of(study.config, values, *berry_and_particle(study, args.berry, args.particle))
    took_s = warm_up.warm_up(scene, args.cores)
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
    pours = pour_job(**job, keeps_runs=args.keep_runs)
    print(pours)
    if args.measure:
        as_measured = argparse.Namespace(**(vars(args) | {"verb": "measure_runs", "pours": [str(pours)]}))
        with recorded(as_measured, "measured"):
            provenance.note_config(study.config)
            if kept_runs.read_measurement(pours) is None:
                kept_runs.write_measurement(pours, measured(job["scene"], pours))


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
    result = measure_job(job["scene"], pour_job(**job))
    if args.json and len(result["runs"]) == 1:
        print(json_text({key: result[key] for key in ("parameters", "time_step_s")} | result["runs"][0]))
    else:
        _print(result["runs"], job["test"].summary, result if args.json else None)


def _print(runs: Iterable[Mapping[str, Any]], template: str, content: Any, before: str = "") -> None:
    """Print measured runs as text, or `content` as JSON."""
    lines = [f"{before}{describe(run, template)}" for run in runs]
    print("\n".join(lines) if content is None else json_text(content))


def _job(args: argparse.Namespace, study: "Study", apparatus: str) -> dict[str, Any]:
    """Make the arguments of `repose.apparatus.job.pour_job` from the options."""
    from repose.apparatus import Scene, bench
    from repose.apparatus.settings import SceneSettings
    from repose.dem.io.progress import display

    test = bench(apparatus, "command line")
    section(study.config, apparatus)
    values = parameters(args.set, args.samples, args.sample, study)
    seeds = pour_seeds(args, study.settings.design.seed, apparatus)
    step, end = study.settings.simulation.time_step_s, test.duration_s(SceneSettings(study.config))
    if args.trajectory is not None and not step <= args.trajectory <= end:
        raise InputError("command line", "--trajectory", args.trajectory, f"from {step:g} to {end:g} s")
    name = f"{args.sample:03d}" if args.sample is not None else ("heap" if apparatus == "funnel" else apparatus)
    scene = Scene.of(study.config, values, *berry_and_particle(study, args.berry, args.particle))

    def progress(seed: int) -> "AbstractContextManager[Callable[[float], object]]":
        return display(0.0, end, step, label=f"seed {seed}")

    job = {"test": test, "scene": scene, "name": name, "seeds": seeds, "out_dir": args.out}
    return job | {"interval_s": args.trajectory, "progress": progress}


@verb(
    "measure the saved runs of any bench test, without running it again",
    example="results/try/heap.pours.json --out results/try",
    options=[
        Option(
            "pours",
            nargs="+",
            help="NAME.pours.json files of pour or heap, with NAME.npz in their folder; or a folder, of all --samples",
        ),
        SAMPLES.but(help="the samples of a folder"),
        Option("--out", help="folder for NAME.json (the folder of the pours)", recorded=False),
        *BERRY_AND_PARTICLE,
        KEEP.but(help="keep each measurement with its runs, and take a kept one that is the same"),
    ],
    runs="measured",
)
def measure_runs(args: argparse.Namespace, study: "Study") -> None:
    from repose.apparatus import Scene, bench_of
    from repose.apparatus.job import measure_job
    from repose.measure.saved_pours import POURS

    scene = Scene.of(study.config, {}, *berry_and_particle(study, args.berry, args.particle))
    for path in job_files(args.pours, args.samples, POURS):
        result = measure_job(scene, path, args.out, args.keep_runs)
        _print(result["runs"], bench_of(result).summary, None, f"{path}: ")


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
    values = parameters(args.set, args.samples, args.sample, study)
    scene = Scene.of(study.config, values, *berry_and_particle(study, args.berry, args.particle))
    results = drum_tables.run_job(scene, run_seeds(args.seed), args.out)
    _print([result["run"] for result in results], bench("drum").summary, results if args.json else None)


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

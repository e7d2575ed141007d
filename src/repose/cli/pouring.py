"""Subcommands that simulate: grains in any bench test, and the tables of the drum."""

import argparse
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.calibrate.runs import describe_run
from repose.cli.berries import BERRY_AND_PARTICLE, load_grain_and_particle
from repose.cli.options import JSON, SAMPLES
from repose.cli.parameter_sets import (
    PARAMETER_SET,
    SEED,
    STUDY_SEEDS,
    choose_seeds,
    read_parameters,
    read_seeds,
)
from repose.cli.registry import Option, subcommand
from repose.cli.stages import record_subcommand
from repose.common import provenance
from repose.common.errors import InputError
from repose.common.files import format_json
from repose.common.keys import require_section
from repose.config.pipeline import PipelineConfig
from repose.stages.parameter_sets import list_job_files

if TYPE_CHECKING:
    from repose.bench import Scene


SIMULATION_OPTIONS = (*PARAMETER_SET, SEED, *BERRY_AND_PARTICLE)
APPARATUS = Option(
    "--apparatus", default="funnel", metavar="NAME", help="bench test (funnel)"
)
TRAJECTORY = Option(
    "--trajectory", type=float, metavar="S", help="also write positions every S seconds"
)
POUR_OPTIONS = (*SIMULATION_OPTIONS, *STUDY_SEEDS, TRAJECTORY)
KEEP_RUNS = Option(
    "--keep-runs",
    action="store_true",
    help="keep each run in OUT/runs; a run that was kept with the same settings is not "
    "repeated",
)
MEASURE = Option(
    "--measure",
    action="store_true",
    help="also measure the runs, and store the result for measure_runs --keep-runs",
)


@subcommand(
    *BERRY_AND_PARTICLE,
    Option("--cores", type=int, default=1, help="compile on one core or on two (1)"),
)
def warm_up(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Compile the engine for a study's particle.

    Runs that start together then need not each compile it.

    Examples
    --------
    $ repose stage warm_up --configfile config/quick.yaml
    """
    from repose.dem.cache import cache_folder
    from repose.stages import warm_up

    scene = _make_scene(args, study, study.parameters.centre)
    elapsed_s = warm_up.warm_up(scene, args.cores)
    print(
        f"the engine was ready after {elapsed_s:.1f} s; its compiled code is in "
        f"{cache_folder()}"
    )


@subcommand(
    APPARATUS, *POUR_OPTIONS, KEEP_RUNS, MEASURE, out="results/try", runs="made"
)
def pour(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Run a bench test with one parameter set and one or more seeds.

    The runs are saved for measure_runs.

    Examples
    --------
    $ repose stage pour --apparatus funnel --set mus_gg=0.5 --seed 1 --out results/try
    """
    from repose.stages.job import run_job

    job = _make_job_arguments(args, study, args.apparatus)
    pours_json = run_job(**job, keep_runs=args.keep_runs)
    print(pours_json)
    if args.measure:
        _measure_and_store(args, study, scene=job["scene"], pours_json=pours_json)


def _measure_and_store(
    args: argparse.Namespace, study: PipelineConfig, scene: "Scene", pours_json: Path
) -> None:
    """Measure saved runs and store the result, unless it has already been stored.

    The subcommand measure_runs can then use the result, but only if its record of
    provenance names measure_runs and not pour.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `pour`.
    study : PipelineConfig
        The study.
    scene : Scene
        The scene of the runs.
    pours_json : Path
        The file NAME.pours.json that describes the saved runs.
    """
    # This function is not the subcommand `measure_runs` of this module.
    from repose.stages import job as saved_job
    from repose.stages import kept_runs

    # Record the result as if the subcommand measure_runs had been called with this
    # file: replace its name in the options, and add its positional argument `pours`.
    options = vars(args) | {"subcommand": "measure_runs", "pours": [str(pours_json)]}
    with record_subcommand(argparse.Namespace(**options), "measured"):
        # The record states the settings of this configuration.
        provenance.note_config(study.config)
        if kept_runs.read_measurement(pours_json) is None:
            result = saved_job.measure_runs(scene, pours_json)
            kept_runs.write_measurement(pours_json, result)


@subcommand(
    *POUR_OPTIONS,
    JSON.with_changes(help="print the result as JSON"),
    out="results/try",
    runs="made",
)
def heap(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Pour grains through the funnel and measure the pile.

    This does the work of pour and measure_runs in one subcommand.

    Examples
    --------
    $ repose heap --set e_gg=0.3 --set mus_gg=0.5 --seed 1 --out results/try --json
    """
    from repose.stages.job import measure_job, run_job

    job = _make_job_arguments(args, study, "funnel")
    pours_json = run_job(**job)
    result = measure_job(job["scene"], pours_json)
    runs = result["runs"]
    if not args.json:
        # `summary` of a bench test is the text with which it describes a run.
        _print_runs(runs, job["test"].summary)
        return
    # If there is one run, print its numbers without the other entries of the job.
    if len(runs) == 1:
        settings_of_job = {key: result[key] for key in ("parameters", "time_step_s")}
        print(format_json(settings_of_job | runs[0]))
    else:
        print(format_json(result))


def _print_runs(runs: Iterable[Mapping[str, Any]], template: str) -> None:
    """Print a line for each measured run.

    Parameters
    ----------
    runs : iterable of mapping
        The runs.
    template : str
        The summary of the bench test: text with placeholders for the numbers of a run.
    """
    for run in runs:
        print(describe_run(run, template))


def _make_scene(
    args: argparse.Namespace, study: PipelineConfig, values: Mapping[str, float]
) -> "Scene":
    """Make the scene of a parameter set.

    Parameters
    ----------
    args : argparse.Namespace
        The options. `berry` and `particle` may be files that replace the grain of the
        study.
    study : PipelineConfig
        The study.
    values : mapping of str to float
        The contact parameters. They may be empty if the scene is only measured.
    """
    from repose.bench import Scene

    grain, particle = load_grain_and_particle(study, args.berry, args.particle)
    return Scene.of(study.config, values, grain=grain, particle=particle)


def _make_job_arguments(
    args: argparse.Namespace, study: PipelineConfig, apparatus: str
) -> dict[str, Any]:
    """Turn the options of a subcommand into the arguments of `repose.stages.job.run_job`.

    The keys of the result must be the names of the parameters of `run_job`.

    Parameters
    ----------
    args : argparse.Namespace
        The options.
    study : PipelineConfig
        The study.
    apparatus : str
        Name of the bench test.

    Returns
    -------
    dict
        The arguments of `run_job` by name.

    Raises
    ------
    InputError
        If there is no such bench test, or an option is not allowed.
    """
    from repose.bench import bench
    from repose.bench.settings import SceneSettings
    from repose.dem.io.progress import show_progress

    # The bench test, its settings in the configuration, the parameters and the seeds.
    test = bench(apparatus, "command line")
    require_section(study.config, apparatus)
    values = read_parameters(args.set, args.samples, sample=args.sample, study=study)
    seeds = choose_seeds(args, study.settings.design.seed, apparatus)

    # The time between the frames of a trajectory must fit the duration of the run.
    step_s = study.settings.simulation.time_step_s
    duration_s = test.duration_s(SceneSettings(study.config))
    _check_interval(args.trajectory, step_s, duration_s)

    def make_display(seed: int) -> Any:
        """Make the display of the progress of the run with a seed."""
        return show_progress(0.0, duration_s, step_s, label=f"seed {seed}")

    return {
        "test": test,
        "scene": _make_scene(args, study, values),
        "name": _choose_file_name(args.sample, apparatus),
        "seeds": seeds,
        "out_dir": args.out,
        "interval_s": args.trajectory,
        "progress": make_display,
    }


def _check_interval(interval_s: float | None, step_s: float, duration_s: float) -> None:
    """Raise an InputError if the time between two frames of a trajectory is not possible.

    Parameters
    ----------
    interval_s : float or None
        The time [s] that --trajectory gives; None if no trajectory is written.
    step_s, duration_s : float
        Time step and duration of the run, which are the limits [s].
    """
    if interval_s is not None and not step_s <= interval_s <= duration_s:
        raise InputError(
            "command line",
            key="--trajectory",
            value=interval_s,
            allowed=f"from {step_s:g} to {duration_s:g} s",
        )


def _choose_file_name(sample: int | None, apparatus: str) -> str:
    """Choose the name of the files of a job, without its ending.

    Parameters
    ----------
    sample : int or None
        The number of the sample, which becomes the name. If it is None, because the
        parameters do not come from a table, the bench test gives the name.
    apparatus : str
        Name of the bench test.
    """
    if sample is not None:
        return f"{sample:03d}"
    return "heap" if apparatus == "funnel" else apparatus


def _list_pours_files(args: argparse.Namespace) -> list[Path]:
    """List the files of saved runs; a folder stands for the files of all its samples."""
    from repose.measure.saved_pours import POURS_ENDING

    return list_job_files(args.pours, args.samples, POURS_ENDING)


@subcommand(
    Option(
        "pours",
        nargs="+",
        find_files=_list_pours_files,
        help="files NAME.pours.json, which `repose heap` or `repose stage pour` wrote, "
        "with NAME.npz next to each; or a folder that has these files for all --samples",
    ),
    SAMPLES.with_changes(help="table of samples, whose runs are read from a folder"),
    Option(
        "--out", help="folder for NAME.json (the folder of the runs)", recorded=False
    ),
    *BERRY_AND_PARTICLE,
    KEEP_RUNS.with_changes(
        help="store each measurement with its runs; a measurement that was stored with "
        "the same settings is not repeated"
    ),
    runs="measured",
)
def measure_runs(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Measure saved runs of any bench test, without running the bench test again.

    Examples
    --------
    $ repose stage measure_runs results/try/heap.pours.json --out results/try
    """
    from repose.bench import bench_of
    from repose.stages.job import measure_job

    # Measuring needs the grain and the walls, but no contact parameters.
    scene = _make_scene(args, study, {})
    for path in _list_pours_files(args):
        result = measure_job(scene, path, out_dir=args.out, keep_runs=args.keep_runs)
        template = bench_of(result).summary
        for run in result["runs"]:
            print(f"{path}: {describe_run(run, template)}")


@subcommand(
    *SIMULATION_OPTIONS,
    JSON.with_changes(help="print the measured runs as JSON"),
    out="results/try",
    runs="made",
)
def drum(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Fill a drum and turn it until the bed slips.

    The runs are saved for the stage drum_tables, and the measured runs are printed.

    Examples
    --------
    $ repose stage drum --set mus_gg=0.5 --set mus_gp=0.6 --seed 1 --out results/try
    """
    from repose.bench import bench
    from repose.stages import drum_tables

    require_section(study.config, "drum")
    values = read_parameters(args.set, args.samples, sample=args.sample, study=study)
    scene = _make_scene(args, study, values)
    results = drum_tables.run_job(scene, read_seeds(args.seed), args.out)
    if args.json:
        print(format_json(results))
    else:
        _print_runs([result["run"] for result in results], bench("drum").summary)


@subcommand(
    Option("runs", nargs="+", help="JSON files that the subcommand drum wrote"),
    *BERRY_AND_PARTICLE,
    out="results/drum",
)
def drum_tables(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Measure the drum's runs, and make tables of them.

    The tables have the angles, the first slip and the slipping layer, with standard
    errors.

    Examples
    --------
    $ repose stage drum_tables results/drum/drum_*.json --out results/drum
    """
    from repose.stages import drum_tables

    require_section(study.config, "drum")
    _, particle = load_grain_and_particle(study, args.berry, args.particle)
    drum_tables.write_tables(args.runs, study.config, particle, args.out)

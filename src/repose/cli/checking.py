"""Subcommands that check a configuration, and plan the cost of its run."""

import argparse
import contextlib
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.registry import (
    CONFIG,
    DEFAULT_CONFIG_FILE,
    Option,
    list_config_files,
    load_study,
    subcommand,
)
from repose.common.errors import InputError, InputErrors
from repose.common.numbers import format_significant
from repose.config.pipeline import PipelineConfig

if TYPE_CHECKING:
    from repose.calibrate.strategies.plan import Plan
    from repose.config.cost import PlannedRuns
    from repose.stages.settings import SimulatorSettings

UPDATE_INTERVAL_S = 1.0
CONFIG_FILES = CONFIG.with_changes(
    nargs="+",
    default=[DEFAULT_CONFIG_FILE],
    help=f"{CONFIG.keywords['help']}, or several",
)


def _load_with_scene_advice(args: argparse.Namespace) -> PipelineConfig:
    """Load the study of --configfile, and check the files that it names.

    If the only fault of the study is that it has too many grains, the function
    describes a smaller scene for the same pile before it raises the InputError again.
    """
    try:
        return load_study(args, check_inputs=True)
    except InputError as error:
        n_grains = _find_refused_number_of_grains(error)
        if n_grains is not None:
            _print_smaller_scene(list_config_files(args), n_grains)
        raise


def _find_refused_number_of_grains(error: InputError) -> int | None:
    """Find the number of grains, if it is the only error of a study.

    Parameters
    ----------
    error : InputError
        The error of the check of the study.

    Returns
    -------
    int or None
        The number that was refused; None if there is another fault.
    """
    has_several_faults = isinstance(error, InputErrors)
    if has_several_faults or error.key != "funnel.berries":
        return None
    # A value that is not a number is another mistake, for which no scene can be
    # proposed.
    return error.value if isinstance(error.value, int) else None


def _print_smaller_scene(files: list[str], n_grains: int) -> None:
    """Print how to scale down a scene of `n_grains` grains."""
    from repose.config.check import propose_smaller_scene

    _print_lines(propose_smaller_scene(files, n_grains))


@subcommand(
    Option("--cores", type=int, default=2, help="cores of the run (2)"),
    Option(
        "--try",
        dest="makes_run",
        action="store_true",
        help="make one run and print its responses; only for a study whose section "
        "`simulator` names another program",
    ),
    config=CONFIG_FILES,
    study=_load_with_scene_advice,
)
def check(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Check a configuration; print its limits and the cost of its run.

    The limits are the longest time step and the softest grain.

    Examples
    --------
    $ repose check --configfile config/paper.yaml
    """
    from repose.config import check as check_lines

    if args.cores < 1:
        raise InputError(
            "command line", key="--cores", value=args.cores, allowed="at least 1"
        )
    settings = study.settings
    print(
        f"{', '.join(args.config)}: {settings.label}, good; "
        f"results go to {settings.results_dir}"
    )
    if study.simulator is not None:
        _print_external_study(args, study, study.simulator)
        return
    if args.makes_run:
        raise InputError(
            "command line",
            key="--try",
            value="given",
            allowed="a study with a section simulator; without it `check` makes trial runs itself",
        )

    # Describe the study, and make trial runs.
    _print_computed_settings(args.config, study)
    _print_lines(check_lines.describe_study(study))
    _print_lines(check_lines.warn_about_few_measurements(study))
    grain_step_s = _measure_grain_step_s(study)
    _print_lines(check_lines.run_trials(study, grain_step_s, show_elapsed_seconds))
    _print_cost(study, grain_step_s, args.cores)


def _print_cost(study: PipelineConfig, grain_step_s: float, n_cores: int) -> None:
    """Print the number of runs of a study by its strategy, and their time.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    grain_step_s : float
        Time for one step of one grain [s].
    n_cores : int
        The number of cores of the run.
    """
    from repose.config import cost

    runs = cost.list_strategy_runs(study.settings, study.settings.strategy)
    work = cost.estimate_work(study.config, grain_step_s, runs)
    _print_table_of_runs(work.runs)
    minutes = work.total_s / n_cores / 60
    print(
        f"about {format_significant(work.funnel_run_s, 2)} s per pour, and "
        f"{format_significant(minutes, 2)} min on {n_cores} cores for the study, at the "
        "present speed of this machine"
    )


def _print_external_study(
    args: argparse.Namespace, study: PipelineConfig, simulator: "SimulatorSettings"
) -> None:
    """Print the checks and the cost of a study that another program simulates.

    With the option --try, one run is also made and its responses are printed.

    Parameters
    ----------
    args : argparse.Namespace
        The options. `cores` is the number of cores of the study. If `makes_run` is set,
        one run is made.
    study : PipelineConfig
        The study.
    simulator : SimulatorSettings
        The section `simulator` of the study.
    """
    from repose.config import check, cost, external_check

    _print_lines(external_check.describe_program(study, simulator))
    _print_lines(external_check.describe_strategy(study, args.config))
    _print_lines(check.warn_about_few_measurements(study))
    runs = external_check.list_runs(study.settings)
    _print_table_of_runs(runs)

    # The time of a run is unknown, but it has a limit. The number of runs at the same
    # time is the number of all cores over that of a run.
    n_runs = cost.count_runs(runs)
    hours = n_runs * simulator.time_limit_s * simulator.cores / args.cores / 3600
    print(
        f"{n_runs} runs, at most {format_significant(hours, 3)} h on {args.cores} cores by their "
        "time limit"
    )
    if args.makes_run:
        _print_lines(external_check.make_trial_run(study, simulator, args.cores))


def _print_computed_settings(files: list[str], study: PipelineConfig) -> None:
    """Print the settings that were computed, because they are `auto` or missing.

    Parameters
    ----------
    files : list of str
        The files of the study.
    study : PipelineConfig
        The study, in which these settings have their computed values.
    """
    from repose.common.keys import get_value
    from repose.config import computed, loader

    config_of_files = loader.merge_with_defaults(files).config
    texts = []
    for setting in computed.find_settings_to_compute(config_of_files):
        value = get_value(study.config, setting.key)
        text = format_significant(value) if isinstance(value, float) else str(value)
        texts.append(f"{setting.key} {text}")
    if texts:
        print(f"computed, because they are auto or missing: {', '.join(texts)}")


def _print_lines(lines: Iterable[str]) -> None:
    """Print each line as soon as it is made, because some lines take long."""
    for line in lines:
        print(line)


def _print_table_of_runs(runs: "PlannedRuns") -> None:
    """Print a table of the runs of a study.

    Parameters
    ----------
    runs : sequence of (str, int, int)
        Purpose, number of parameter sets, and number of seeds of each set.
    """
    print(f"{'stage':>15} {'parameter sets':>15} {'runs each':>10} {'runs':>6}")
    for purpose, n_sets, n_seeds in runs:
        print(f"{purpose:>15} {n_sets:>15} {n_seeds:>10} {n_sets * n_seeds:>6}")


@subcommand(
    Option(
        "--runs",
        help="runs.csv of earlier pours, whose scatter is measured (default: the runs of "
        "the study, if there are any)",
        recorded=False,  # they may be of another study
    ),
    config=CONFIG_FILES,
    study=_load_with_scene_advice,
)
def plan(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Plan a study before any pour: how many pours it needs.

    The subcommand prints the pours that the noise requires, and the probability of
    success for each budget.

    Examples
    --------
    $ repose plan --configfile config/fast.yaml
    """
    from repose.calibrate.strategies import plan as planning
    from repose.config import check, external_check

    # Read earlier runs, which show how much the responses scatter from run to run. If
    # there are none, this noise is assumed.
    runs_csv = args.runs or _find_own_runs(study)
    runs = None
    if runs_csv is not None:
        runs = planning.read_runs(runs_csv, study.targets)

    # Describe the study, and plan its runs.
    if study.simulator is None:
        _print_lines(check.describe_study(study))
    else:
        _print_lines(external_check.describe_strategy(study, args.config))
    result = planning.make_plan(
        study.parameters,
        study.targets,
        study.settings.strategy,
        runs=runs,
        source=runs_csv,
    )
    _print_noise(study, result, runs_csv)
    _print_probabilities(result)

    # The time of a run of another program is unknown.
    if study.simulator is not None:
        _print_table_of_runs(external_check.list_runs(study.settings))
        print(
            "time: `repose check --try` makes one run, and estimates the time of all runs"
        )
        return

    # Show these lines now, because the costs below need a pour that takes some time.
    sys.stdout.flush()
    grain_step_s = _measure_grain_step_s(study)
    budgets = _choose_budgets(study, result)
    _print_lines(check.tabulate_costs(study, budgets, grain_step_s))


def _choose_budgets(study: PipelineConfig, result: "Plan") -> tuple[int, ...]:
    """Choose the numbers of runs of the sequential strategy that the table shows.

    Where the success of several budgets is unknown, their rows would say nothing. The
    table then shows only the budget of the configuration.
    """
    if result.success is None:
        return (study.settings.sequential.most_pours,)
    return result.budgets


def _find_own_runs(study: PipelineConfig) -> Path | None:
    """Find the table of the runs that a study has made; None if it has none."""
    for name in ("sequential/runs.csv", "runs.csv"):
        path = study.folder / name
        if path.is_file():
            return path
    return None


def _print_noise(
    study: PipelineConfig, result: "Plan", runs_csv: str | Path | None
) -> None:
    """Print the noise, and how many runs give a precise mean in spite of it.

    The noise is the scatter of single runs with the same parameters.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    result : Plan
        The plan. `noise_percent` has the noise of each target, and `needed` the number
        of runs for each tolerance of the mean.
    runs_csv : path or None
        The table in which the noise was measured; None if there is none.
    """
    from repose.calibrate.strategies.plan import CERTAINTY

    source = "assumed, because there are no runs yet"
    if result.measured:
        source = f"measured in {runs_csv}"
    for name, percent in zip(study.targets.names, result.noise_percent, strict=True):
        print(
            f"noise: the {name} of single runs has a scatter of "
            f"{format_significant(percent, 2)} % of the target, {source}"
        )
    for tolerance, n_runs in result.needed.items():
        print(
            f"noise: {n_runs} runs of one parameter set give its means within "
            f"{tolerance:g} % with probability {CERTAINTY:g}"
        )


def _print_probabilities(result: "Plan") -> None:
    """Print the probability of success for each number of runs that a study may make.

    The probabilities come from many simulated calibrations with known answers, in which
    the successes were counted.

    Parameters
    ----------
    result : Plan
        The plan. `success` is a table with a row for each number of runs. It is None if
        the study differs too much from those simulated calibrations, which `campaigns`
        describes.
    """
    from repose.calibrate.strategies.plan import TOLERANCES

    if result.success is None:
        differences = ", ".join(result.differences)
        print(
            f"success: its probability is known for {result.campaigns}; this study is "
            f"different ({differences}), so the table of costs does not say how good an "
            "answer becomes"
        )
        return
    titles = [f"{percent:g} %" for percent in TOLERANCES]
    print(
        f"success: probability that the answer lies within {' and '.join(titles)} of all "
        f"targets, for {result.campaigns}:"
    )
    # The table has two columns for each tolerance: the probability and its standard
    # error. `Plan` gives them the names below.
    print(f"{'runs':>7}", *(f"{title:>12}" for title in titles))
    for row in result.success.to_dict("records"):
        cells = []
        for percent in TOLERANCES:
            column = f"within_{percent:g}_percent"
            cells.append(f"{row[column]:.2f} ± {row[f'{column}_se']:.2f}")
        print(f"{row['pours']:>7}", *(f"{cell:>12}" for cell in cells))
    print(
        "These successes were counted in simulated calibrations with known answers; see "
        "`repose docs sequential`"
    )


def _measure_grain_step_s(study: PipelineConfig) -> float:
    """Measure the time for one step of one grain on this machine [s].

    The first call takes a minute or two, during which a message is shown.
    """
    from repose.config import cost

    sentence = (
        "timing a small pour; the first with such a grain compiles the engine, a minute "
        "or two of a core"
    )
    with show_elapsed_seconds(sentence):
        return cost.measure_grain_step_s(study.config, study.grain, study.particle)


@contextlib.contextmanager
def show_elapsed_seconds(sentence: str) -> Iterator[None]:
    """Show a sentence on stderr while a block of code runs.

    On a terminal, a thread appends the elapsed seconds and keeps them up to date.
    Elsewhere, as in a log, the sentence is printed once.

    Parameters
    ----------
    sentence : str
        A description of what the block does.
    """
    if not sys.stderr.isatty():
        print(sentence, file=sys.stderr, flush=True)
        yield
        return

    is_finished = threading.Event()

    def update_seconds() -> None:
        """Write the line again after each tick, until the block has ended."""
        start_s = time.monotonic()
        while not is_finished.wait(UPDATE_INTERVAL_S):
            elapsed_s = time.monotonic() - start_s
            line = f"\r{sentence}; {elapsed_s:.0f} s"
            print(line, end="", file=sys.stderr, flush=True)

    print(sentence, end="", file=sys.stderr, flush=True)
    clock = threading.Thread(target=update_seconds, daemon=True)
    clock.start()
    try:
        yield
    finally:
        is_finished.set()
        clock.join()
        print(file=sys.stderr, flush=True)

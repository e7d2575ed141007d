"""The verbs that check a configuration, and plan the cost of its run."""

import argparse
import contextlib
import sys
import threading
import time
from collections.abc import Iterator

from repose.cli.options import require_option
from repose.cli.registry import CONFIG, Option, configs_of, load, verb
from repose.common.errors import InputError, InputErrors
from repose.config.pipeline import PipelineConfig

TICK_S = 1.0
FILES = CONFIG.with_changes(
    nargs="+",
    default=[CONFIG.keywords["default"]],
    help=f"{CONFIG.keywords['help']}, or several",
)


def _load_or_propose(args: argparse.Namespace) -> PipelineConfig:
    """Load the study of --config; with too many grains for any study print a smaller scene before the error."""
    try:
        return load(args, inputs=True)
    except InputError as error:
        grains = error.value
        if (
            error.key == "funnel.berries"
            and isinstance(grains, int)
            and not isinstance(error, InputErrors)
        ):
            from repose.config.check import smaller_scene

            sys.stdout.writelines(
                f"{line}\n" for line in smaller_scene(configs_of(args), grains)
            )
        raise


@verb(
    Option("--cores", type=int, default=2, help="cores of the run (2)"),
    config=FILES,
    study=_load_or_propose,
)
def check(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Check a configuration; print the longest time step, the softest grain and the cost of a run.

    example: --config config/paper.yaml
    """
    require_option(args.cores >= 1, "--cores", args.cores, "at least 1")
    from repose.common.keys import get
    from repose.config import check, computed, cost, loader

    config, settings = study.config, study.settings
    print(
        f"{', '.join(args.config)}: {settings.label}, good; results go to {settings.results_dir}"
    )
    written, _ = loader.read_layers(args.config)
    numbers = [
        f"{setting.key} {get(config, setting.key)}"
        for setting in computed.to_compute(written)
    ]
    if numbers:
        print(f"computed, since they are auto or not given: {', '.join(numbers)}")
    print(*check.about(study), *check.of_targets(study), sep="\n")
    measured = _grain_step_s(study)
    print(*check.trials(study, measured, elapsed_seconds_shown), sep="\n")
    pours = cost.strategy_pours(settings, settings.strategy)
    work = cost.work(config, measured, pours)
    for purpose, sets, seeds in work["pours"]:
        print(
            f"{purpose:>14}: {sets} parameter sets x {seeds} seeds = {sets * seeds} pours"
        )
    minutes = work["total_s"] / args.cores / 60
    as_now = f"as measured now: {1e9 * measured:.2g} ns for a time step of a grain on this machine"
    print(
        f"about {work['pour_s']:.2g} s per pour, {minutes:.0f} min on {args.cores} cores, {as_now}"
    )


@verb(
    Option(
        "--runs",
        help="runs.csv of earlier pours, for the noise (default: the runs of the study, if any)",
    ),
    config=FILES,
    study=_load_or_propose,
)
def plan(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Before any pour: the pours that the noise requires, and the probability of success by budget.

    example: --config config/fast.yaml
    """
    from repose.calibrate.strategies import plan
    from repose.config import check

    targets, folder = study.targets, study.folder
    own = [
        path
        for path in (folder / "sequential/runs.csv", folder / "runs.csv")
        if path.is_file()
    ]
    path = args.runs or next(iter(own), None)
    runs = None if path is None else plan.read_runs(path, targets)
    print(*check.about(study), sep="\n")
    result = plan.plan(study.parameters, targets, runs, path)
    for name, percent in zip(targets.names, result.noise_percent, strict=True):
        source = (
            f"measured in {path}"
            if result.measured
            else "assumed, as there are no runs yet"
        )
        print(
            f"noise: a pour's {name} scatters by {percent:.2g} % of the target, {source}"
        )
    for tolerance, needed in result.needed.items():
        known = f"to know its means within {tolerance:g} % with probability {plan.CERTAINTY:g}"
        print(f"the noise alone: {needed} pours at one parameter set, {known}")
    print(
        "probability that the answer of strategy: sequential lies within 1 % and 2 % of all targets:"
    )
    print(f"{'pours':>7} {'1 %':>12} {'2 %':>12}")
    for row in result.budgets.to_dict("records"):
        shares = (f"within_{percent:g}_percent" for percent in plan.TOLERANCES)
        chances = " ".join(
            f"{row[name]:>5.2f} ± {row[f'{name}_se']:.2f}" for name in shares
        )
        print(f"{row['pours']:>7} {chances}")
    print(
        "by simulated calibrations with known answers and six free parameters: `repose docs sequential`",
        flush=True,
    )
    print(*check.costs(study, result.budgets["pours"], _grain_step_s(study)), sep="\n")


def _grain_step_s(study: PipelineConfig) -> float:
    """Time a step of a grain on this machine, with a message about the minute or two of the first time."""
    from repose.config import cost

    sentence = "timing a small pour; the first with such a grain compiles the engine, a minute or two of a core"
    with elapsed_seconds_shown(sentence):
        return cost.measured_berry_step_s(study.config, study.grain, study.particle)


@contextlib.contextmanager
def elapsed_seconds_shown(sentence: str) -> Iterator[None]:
    """Print a sentence on stderr, and on a terminal the seconds as they pass."""
    terminal = sys.stderr.isatty()
    done = threading.Event()

    def tick() -> None:
        began = time.monotonic()
        while not done.wait(TICK_S):
            print(
                f"\r{sentence}; {time.monotonic() - began:.0f} s",
                end="",
                file=sys.stderr,
                flush=True,
            )

    print(sentence, end="" if terminal else "\n", file=sys.stderr, flush=True)
    ticker = threading.Thread(target=tick, daemon=True)
    if terminal:
        ticker.start()
    try:
        yield
    finally:
        done.set()
        if terminal:
            ticker.join()
            print(file=sys.stderr, flush=True)

"""The verbs that check a configuration, and plan the cost of its run."""

import argparse
import contextlib
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from repose.cli.registry import Option, load, verb
from repose.core.errors import InputError, InputErrors

if TYPE_CHECKING:
    from repose.config.study import Study
    from repose.dem.time_steps import Limit

# A smaller difference between the volumes of particle and mesh does not matter to a pile.
LARGEST_VOLUME_CHANGE = 0.05
FEWEST_PILES = 3  # a standard deviation of fewer is a guess
TICK_S = 1.0
LONGEST_TRIAL_S = 60.0  # of a trial run, as estimated
# Restitution and friction of the trial runs, as shares of the ranges.
TRIALS = {
    "most bounce, least friction": (1.0, 0.0),
    "centre of the ranges": (0.5, 0.5),
    "least bounce, most friction": (0.0, 1.0),
}
FAR = 1.5  # a time step that could be longer by this factor is worth a hint


def _load_or_propose(args: argparse.Namespace) -> "Study":
    """Load the study of --config; with too many grains for any study print a smaller scene before the error."""
    try:
        return load(args, inputs=True)
    except InputError as error:
        grains = error.value
        if error.key == "funnel.berries" and isinstance(grains, int) and not isinstance(error, InputErrors):
            _propose(args.config, grains)
        raise


def _propose(path: str, grains: int) -> None:
    """Print a smaller scene for more grains than a study may have, if nothing else is wrong with it."""
    from repose.apparatus import scene_size
    from repose.config import advice, computed
    from repose.config.study import Study
    from repose.core.section import MOST_BERRIES

    if grains <= MOST_BERRIES:
        return
    most = {"berries": MOST_BERRIES, **dict.fromkeys(scene_size.COMPUTED, "auto")}
    with contextlib.suppress(InputError):
        study = Study.load(path, overrides={"funnel": most}, inputs=True)
        height_mm = 1e3 * advice.height_m(study.config, study.grain)
        print(*scene_size.advice(study.config, computed.diameter_mm(study.grain), height_mm, grains), sep="\n")


@verb(
    "check a configuration; print the longest time step, the softest grain and the cost of a run",
    example="--config config/paper.yaml",
    study=_load_or_propose,
    options=[Option("--cores", type=int, default=2, help="cores of the run (2)")],
)
def check(args: argparse.Namespace, study: "Study") -> None:
    if args.cores < 1:
        raise InputError("command line", "--cores", args.cores, "at least 1")
    from repose.config import computed, cost, loader
    from repose.config.keys import get
    from repose.strategies import cost as strategies

    config = study.config
    print(f"{args.config}: {config['label']}, good; results go to {config['results_dir']}")
    written, _ = loader.read_layers([args.config])
    numbers = [f"{setting.key} {get(config, setting.key)}" for setting in computed.to_compute(written)]
    if numbers:
        print(f"computed, since they are auto or not given: {', '.join(numbers)}")
    print(*_about(study), *_about_the_targets(config), sep="\n")
    measured = _berry_step_s(study)
    print(*_trials(study, measured), sep="\n")
    work = cost.work(config, measured, strategies.pours(config))
    for purpose, sets, seeds in work["pours"]:
        print(f"{purpose:>14}: {sets} parameter sets x {seeds} seeds = {sets * seeds} pours")
    minutes = work["total_s"] / args.cores / 60
    print(
        f"about {work['pour_s']:.2g} s per pour, {minutes:.0f} min on {args.cores} cores, as measured now: "
        f"{1e9 * measured:.2g} ns for a time step of a grain on this machine"
    )


def _about(study: "Study") -> Iterator[str]:
    """Say whether piles can have the targets, then time step and particle, and hints of the bench tests."""
    from repose.apparatus import reach
    from repose.apparatus.settings import SimulationSettings
    from repose.config import advice, computed, stands_on

    config, berry, particle = study.config, study.grain, study.particle
    yield from reach.said(config, particle, stands_on.own_dataset(config))

    def longest(berry: Mapping[str, Any]) -> "Limit":
        return computed.longest_step(config, particle, berry)

    yield about_step(SimulationSettings.of(config).time_step_s, longest(berry))
    yield from advice.of_funnel(config, berry, particle, lambda other: longest(other).time_step_s)
    section = config["berry"]
    if particle.mesh_volume_m3:
        change = particle.volume_m3 / particle.mesh_volume_m3 - 1
        if abs(change) > LARGEST_VOLUME_CHANGE:
            yield (
                f"particle: WARNING: the volume of the {section['particle']} is {100 * change:+.0f} % off the mesh's; "
                "another berry.particle or berry.surface, or more berry.spheres, comes nearer"
            )
    if section["stl"] is not None and section["mass_g"] is not None:
        mass_g = 1e3 * particle.mass_kg
        yield f"mass: WARNING: berry.mass_g is not used beside berry.stl, whose grain has {mass_g:.3g} g"
    if section["compression"] is not None and None not in (section["shear_modulus_pa"], section["poisson_ratio"]):
        yield "moduli: WARNING: berry.compression is not used beside berry.shear_modulus_pa and berry.poisson_ratio"


def _trials(study: "Study", berry_step_s: float) -> Iterator[str]:
    """Run each bench test of the targets in three places of the ranges; name the targets beyond all of the runs."""
    import numpy as np

    from repose.apparatus import bench
    from repose.apparatus.job import run_once
    from repose.cli.pouring import describe
    from repose.config import cost

    config, space = study.config, study.parameters
    bounces = np.array([name.startswith("e_") for name in space.free])
    unit = np.array([np.where(bounces, bounce, friction) for bounce, friction in TRIALS.values()])
    sets = [dict(zip(space.names, values, strict=True)) for values in space.values(unit).tolist()]
    for test in map(bench, study.targets.apparatus):
        expected_s = cost.run_s(config, test.name, berry_step_s)
        if expected_s > LONGEST_TRIAL_S:
            yield f"{test.name}: no trial runs, as one takes about {expected_s:.0f} s"
            continue
        with elapsed_seconds_shown(f"three trial runs of {test.name}, about {3 * expected_s:.0f} s"):
            found = [run_once(test, study.scene(values, 1))[0] for values in sets]
        for place, run in zip(TRIALS, found, strict=True):
            yield f"{test.name}: {place}: {describe(run, test.summary).removeprefix('seed 1: ')}"
        good = [run for run in found if run["status"] == "ok"]
        if not good:
            yield f"{test.name}: WARNING: no trial run can be measured: change the section {test.name}, or the ranges"
            continue
        own = test.target_responses(config)
        for target in (target for target in study.targets if target.response in own):
            low, high = (end(run[target.name] for run in good) for end in (min, max))
            if not low <= target.value <= high:
                yield (
                    f"{target.name}: WARNING: the target {target.value:g} is outside the single runs, {low:.4g} to "
                    f"{high:.4g}: other ranges or another scene may be needed"
                )


def about_step(step_s: float, limit: "Limit") -> str:
    """Describe the longest time step, with the time saved if it is longer than `step_s`."""
    from repose.config import computed

    advised = computed.advised_step_s(limit.time_step_s)
    saved = f"; with {advised:g} a run takes {step_s / advised:.2g} of the time" if advised > FAR * step_s else ""
    return f"time step: simulation.time_step_s is {step_s:g} s, {limit.allowed}{saved}"


def _about_the_targets(config: Mapping[str, Any]) -> Iterator[str]:
    """Warn of measurements whose scatter is unknown."""
    for target in config["targets"]:
        name, piles = target["response"], target["repetitions"]
        if piles < FEWEST_PILES:
            yield (
                f"{name}: WARNING: repetitions is {piles}; fewer than {FEWEST_PILES} hardly show the scatter, "
                "on which all intervals depend: measure more piles"
            )
        if target["sd"] == 0:
            yield (
                f"{name}: WARNING: sd is 0, as if every pile were the same; the intervals are too narrow: give the "
                "standard deviation of the measured piles"
            )


@verb(
    "before any pour: the pours that the noise requires, and the probability of success by budget",
    example="--config config/fast.yaml",
    study=_load_or_propose,
    options=[
        Option("--runs", help="runs.csv of earlier pours, for the noise (default: the runs of the study, if any)")
    ],
)
def plan(args: argparse.Namespace, study: "Study") -> None:
    from repose.strategies import plan

    targets, folder = study.targets, study.folder
    own = [path for path in (folder / "sequential/runs.csv", folder / "runs.csv") if path.is_file()]
    path = args.runs or next(iter(own), None)
    runs = None if path is None else plan.read_runs(path, targets)
    print(*_about(study), sep="\n")
    result = plan.plan(study, runs, path)
    for name, percent in zip(targets.names, result.noise_percent, strict=True):
        source = f"measured in {path}" if result.measured else "assumed, as there are no runs yet"
        print(f"noise: a pour's {name} scatters by {percent:.2g} % of the target, {source}")
    for tolerance, needed in result.needed.items():
        print(
            f"the noise alone: {needed} pours at one parameter set, to know its means within {tolerance:g} % with "
            f"probability {plan.CERTAINTY:g}"
        )
    print("probability that the answer of strategy: sequential lies within 1 % and 2 % of all targets:")
    print(f"{'pours':>7} {'1 %':>12} {'2 %':>12}")
    for row in result.budgets.to_dict("records"):
        shares = (f"within_{percent:g}_percent" for percent in plan.TOLERANCES)
        chances = " ".join(f"{row[name]:>5.2f} ± {row[f'{name}_se']:.2f}" for name in shares)
        print(f"{row['pours']:>7} {chances}")
    print("by simulated calibrations with known answers and six free parameters: `repose docs sequential`", flush=True)
    measured = _berry_step_s(study)
    print(*_costs(study, result.budgets["pours"], measured), sep="\n")


def _costs(study: "Study", budgets: Iterable[int], berry_step_s: float) -> Iterator[str]:
    """Tabulate the cost of each strategy, the configured one marked."""
    from repose.config import cost
    from repose.strategies import cost as strategies
    from repose.strategies import plan

    config, section = study.config, study.config["sequential"]
    seeds, check = section["seeds"], ("check", 1, section["checks"])
    misfits = {name: strategies.misfit({**config, "strategy": name}) for name in strategies.others()}
    rows: list[tuple[str, cost.Pours | None]] = []
    if not misfits["sequential"]:
        rows += [("sequential", (("batches", -(-pours // seeds), seeds), check)) for pours in budgets]
    if not misfits["response_surface"]:
        rows.append(("response_surface", strategies.pours({**config, "strategy": "response_surface"})))
    rows.append(("published", None))
    yield f"{'strategy':>18} {'pours':>12} {'core-minutes':>13} {'disk':>8}"
    for name, steps in rows:
        work = cost.work(config, berry_step_s, steps)
        counts = [sets * seeds for _, sets, seeds in work["pours"]]
        # the probabilities are for the pours before the plus
        pours = f"{counts[0]} + {counts[1]}" if name == "sequential" else f"{sum(counts)}"
        mark = "*" if name == config["strategy"] else ""
        disk_mb = plan.disk_mb(study, sum(counts))
        yield f"{mark + name:>18} {pours:>12} {work['total_s'] / 60:>13.1f} {disk_mb:>5.1f} MB"
    yield from (f"{name}: {why}" for name, why in misfits.items() if why)
    yield "* as configured; + the check of the answer; response_surface: at most; minutes: as measured now"


def _berry_step_s(study: "Study") -> float:
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
            print(f"\r{sentence}; {time.monotonic() - began:.0f} s", end="", file=sys.stderr, flush=True)

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

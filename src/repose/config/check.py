"""What `repose check` and `repose plan` say of a study before its first pour."""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.bench import bench, reach, scene_size
from repose.calibrate.runs import describe
from repose.calibrate.strategies import cost as strategies
from repose.common.errors import InputError
from repose.common.section import MOST_BERRIES
from repose.config import advice, computed, cost, dependencies, loader
from repose.config.pipeline import PipelineConfig
from repose.stages.job import run_once

if TYPE_CHECKING:
    from repose.dem.time_steps import Limit

# A smaller difference between the volumes of particle and mesh does not matter to a pile.
LARGEST_VOLUME_CHANGE = 0.05
FEWEST_PILES = 3  # a standard deviation of fewer is a guess
LONGEST_TRIAL_S = 60.0  # of a trial run, as estimated
# Restitution and friction of the trial runs, as shares of the ranges.
TRIALS = {
    "most bounce, least friction": (1.0, 0.0),
    "centre of the ranges": (0.5, 0.5),
    "least bounce, most friction": (0.0, 1.0),
}
FAR = 1.5  # a time step that could be longer by this factor is worth a hint


def smaller_scene(files: Iterable[str], grains: int) -> Iterator[str]:
    """Propose a smaller scene for more grains than a study may have, if nothing else is wrong with it."""
    if grains <= MOST_BERRIES:
        return
    most = {"berries": MOST_BERRIES, **dict.fromkeys(scene_size.COMPUTED, "auto")}
    with contextlib.suppress(InputError):
        study = PipelineConfig.load(*files, overrides={"funnel": most}, inputs=True)
        height_mm = 1e3 * advice.height_m(study.config, study.grain)
        yield from scene_size.advice(
            study.config, computed.diameter_mm(study.grain), height_mm, grains
        )


def about(study: PipelineConfig) -> Iterator[str]:
    """Say whether piles can have the targets, then time step and particle, and hints of the bench tests."""
    config, grain, particle = study.config, study.grain, study.particle
    yield from reach.said(config, particle, dependencies.own_dataset(config))

    def longest(grain: Mapping[str, Any]) -> "Limit":
        return computed.longest_step(config, particle, grain)

    yield about_step(study.settings.simulation.time_step_s, longest(grain))
    yield from advice.of_funnel(
        config, grain, particle, lambda other: longest(other).time_step_s
    )
    section = study.settings.berry
    if particle.mesh_volume_m3:
        change = particle.volume_m3 / particle.mesh_volume_m3 - 1
        if abs(change) > LARGEST_VOLUME_CHANGE:
            nearer = "another berry.particle or berry.surface, or more berry.spheres, comes nearer"
            off = f"the volume of the {section.particle} is {100 * change:+.0f} % off the mesh's"
            yield f"particle: WARNING: {off}; {nearer}"
    if section.stl is not None and section.mass_g is not None:
        mass_g = 1e3 * particle.mass_kg
        yield f"mass: WARNING: berry.stl gives the mass, {mass_g:.3g} g; berry.mass_g is not used"
    if section.compression is not None and None not in (
        section.shear_modulus_pa,
        section.poisson_ratio,
    ):
        yield "moduli: WARNING: berry.shear_modulus_pa and berry.poisson_ratio are given; berry.compression is not used"


def about_step(step_s: float, limit: "Limit") -> str:
    """Describe the longest time step, with the time saved if it is longer than `step_s`."""
    advised = computed.advised_step_s(limit.time_step_s)
    saved = (
        f"; with {advised:g} a run takes {step_s / advised:.2g} of the time"
        if advised > FAR * step_s
        else ""
    )
    return f"time step: simulation.time_step_s is {step_s:g} s, {limit.allowed}{saved}"


def of_targets(study: PipelineConfig) -> Iterator[str]:
    """Warn of measurements whose scatter is unknown."""
    for target in study.settings.targets:
        name, piles = target.response, target.repetitions
        if piles < FEWEST_PILES:
            few = f"fewer than {FEWEST_PILES} hardly show the scatter, on which all intervals depend"
            yield f"{name}: WARNING: repetitions is {piles}; {few}: measure more piles"
        if target.sd == 0:
            narrow = "the intervals are too narrow: give the standard deviation of the measured piles"
            yield f"{name}: WARNING: sd is 0, as if every pile were the same; {narrow}"


def trials(
    study: PipelineConfig,
    grain_step_s: float,
    waiting: Callable[[str], AbstractContextManager[None]],
) -> Iterator[str]:
    """Run each bench test of the targets in three places of the ranges; name the targets beyond all of the runs."""
    config, space = study.config, study.parameters
    bounces = np.array([name.startswith("e_") for name in space.free])
    unit = np.array(
        [np.where(bounces, bounce, friction) for bounce, friction in TRIALS.values()]
    )
    sets = [
        dict(zip(space.names, values, strict=True))
        for values in space.values(unit).tolist()
    ]
    for test in map(bench, study.targets.apparatus):
        expected_s = cost.run_s(config, test.name, grain_step_s)
        if expected_s > LONGEST_TRIAL_S:
            yield f"{test.name}: no trial runs, as one takes about {expected_s:.0f} s"
            continue
        with waiting(f"three trial runs of {test.name}, about {3 * expected_s:.0f} s"):
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
                outside = f"the target {target.value:g} is outside the single runs, {low:.4g} to {high:.4g}"
                yield f"{target.name}: WARNING: {outside}: other ranges or another scene may be needed"


def costs(
    study: PipelineConfig, budgets: Iterable[int], grain_step_s: float
) -> Iterator[str]:
    """Tabulate the cost of each strategy, the configured one marked."""
    settings = study.settings
    section = settings.sequential
    misfits = {
        name: cost.strategy_misfit(settings, name) for name in strategies.others()
    }
    rows: list[tuple[str, cost.Pours | None]] = []
    if not misfits["sequential"]:
        check, seeds = ("check", 1, section.checks), section.seeds
        rows += [
            ("sequential", (("batches", -(-pours // seeds), seeds), check))
            for pours in budgets
        ]
    if not misfits["response_surface"]:
        rows.append(
            ("response_surface", cost.strategy_pours(settings, "response_surface"))
        )
    rows.append(("published", None))
    yield f"{'strategy':>18} {'pours':>12} {'core-minutes':>13} {'disk':>8}"
    for name, steps in rows:
        work = cost.work(study.config, grain_step_s, steps)
        counts = [sets * seeds for _, sets, seeds in work["pours"]]
        # the probabilities are for the pours before the plus
        pours = (
            f"{counts[0]} + {counts[1]}" if name == "sequential" else f"{sum(counts)}"
        )
        mark = "*" if name == settings.strategy else ""
        disk_mb = cost.disk_mb(settings, sum(counts))
        yield f"{mark + name:>18} {pours:>12} {work['total_s'] / 60:>13.1f} {disk_mb:>5.1f} MB"
    yield from (f"{name}: {why}" for name, why in misfits.items() if why)
    yield "* as configured; + the check of the answer; response_surface: at most; minutes: as measured now"


def catalogue(files: list[str]) -> str:
    """List the studies, each with a sentence and its cost in the configurations, over the default."""
    config, _ = loader.read_layers(files)  # an unreadable file is reported
    try:
        study = PipelineConfig.load(*files)
        config, of_each = study.config, cost.costs(study.config)
        of_each |= {name: _cost_of(study, name) for name in strategies.others()}
    except InputError:
        unknown = f"cost: once {', '.join(files) or 'config.yaml'} is complete; `repose check` lists the missing keys"
        of_each = dict.fromkeys(cost.SENTENCES, unknown)
    lines = [
        f"  {target:24} {cost.SENTENCES[target]}\n{'':27}{of_each[target]}"
        for target in cost.SENTENCES
    ]
    return "\n".join(
        [
            f"repose run TARGET; without one, all of calibration. Studies of {config.get('label')}:",
            *lines,
        ]
    )


def _cost_of(study: PipelineConfig, strategy: str) -> str:
    """Say what a strategy costs, or why the configuration cannot take it."""
    why = cost.strategy_misfit(study.settings, strategy)
    if why:
        return why
    pours = cost.strategy_pours(study.settings, strategy)
    minutes = cost.work(study.config, pours=pours)["total_s"] / 60
    number = sum(sets * seeds for _, sets, seeds in pours or ())
    return f"at most {number} pours, about {minutes:.0f} min on one core, by itself"

"""Write the lines that `repose check`, `repose plan` and `repose run --list` print."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.bench import BenchTest, bench, reach, scene_size
from repose.calibrate.parameter_types import describe_wide_ranges
from repose.calibrate.runs import describe_run
from repose.calibrate.strategies import cost as strategies
from repose.calibrate.strategies.base import CheckRuns
from repose.common.errors import InputError
from repose.common.numbers import format_significant
from repose.common.section import MOST_BERRIES
from repose.config import advice, computed, cost, dependencies, hits, loader
from repose.config.pipeline import PipelineConfig
from repose.stages.job import run_once

if TYPE_CHECKING:
    import pandas as pd

    from repose.dem.time_steps import Limit
    from repose.grain.particle import Particle
    from repose.grain.settings import GrainSettings
    from repose.grain.size_checks import SizeGroups

# A smaller relative difference between the volumes of particle and mesh hardly changes
# a pile.
LARGEST_VOLUME_CHANGE = 0.05
# A smaller relative spread of the sizes, or a smaller distance between two groups of
# sizes, hardly changes a pile.
LARGEST_SPREAD = 0.1
# Largest fraction by which the volume from mass and density may exceed the largest
# possible volume. Mass and density are each measured to about one percent.
LARGEST_EXCESS = 0.02
# A standard deviation of fewer piles is very uncertain.
MIN_PILES = 3
# Trial runs are skipped if one would take longer than this.
LONGEST_TRIAL_S = 60.0
# For each trial run, the positions in their ranges, as fractions, of the restitutions
# and of all other parameters.
TRIAL_FRACTIONS = {
    "most bounce, least friction": (1.0, 0.0),
    "centre of the ranges": (0.5, 0.5),
    "least bounce, most friction": (0.0, 1.0),
}
# All trial runs begin with the same random numbers.
TRIAL_SEED = 1
# A target gets a warning if it lies further outside the results of the trial runs than
# this fraction of their span, because so few runs seldom include the extremes. In
# config/paper.yaml the trial runs span 11.8 degrees and end at 30.5 degrees, and 2.5 %
# of all runs there are steeper by at least 0.4 spans.
MAX_DISTANCE_IN_SPANS = 0.5
# A hint is given if the advised time step is longer than the study's by this factor.
WORTHWHILE_RATIO = 1.5
# Widths of the columns in the table of costs.
COST_COLUMNS = {
    "strategy": 18,
    "runs to learn": 15,
    "to check": 9,
    "core-minutes": 13,
    "disk": 8,
}

# First line of `repose run --list`, with the name of the configuration.
STUDY_LIST_HEADING = (
    "repose run TARGET; without one, all of calibration. Studies of {}:"
)

# Width of the names in this list.
STUDY_NAME_WIDTH = 24

ShowMessage = Callable[[str], AbstractContextManager[None]]


def propose_smaller_scene(files: Iterable[str], n_grains: int) -> Iterator[str]:
    """Describe how to scale down a scene that has too many grains.

    A scene is a bench test with its grains. The function yields nothing if the number
    of grains is allowed, or if the configuration is also invalid for another reason.

    Parameters
    ----------
    files : iterable of str
        The files of the configuration.
    n_grains : int
        The configured number of grains.

    Yields
    ------
    str
        A line of text.
    """
    if n_grains <= MOST_BERRIES:
        return

    # Only a valid study has a grain. To make the study valid, replace the number of
    # grains by the largest allowed number, and let the program compute the keys that
    # depend on it, which is what `auto` asks for.
    largest_funnel: dict[str, Any] = {"berries": MOST_BERRIES}
    for name in scene_size.COMPUTED_KEYS:
        largest_funnel[name] = computed.AUTO
    try:
        study = PipelineConfig.load(
            *files, overrides={"funnel": largest_funnel}, check_inputs=True
        )
    except InputError:
        # The caller reports all errors of the configuration.
        return

    # Give advice for the configured number of grains.
    height_mm = 1e3 * advice.estimate_pile_height_m(study.config, study.grain)
    diameter_mm = computed.compute_diameter_mm(study.grain)
    yield from scene_size.advise(
        study.config, diameter_mm, height_mm=height_mm, poured=n_grains
    )


def describe_study(study: PipelineConfig) -> Iterator[str]:
    """Describe the targets, time step, scene and grain of a study line by line.

    The first lines say whether a pile can meet the targets at all. Each line has the
    form "SUBJECT: TEXT". A text that begins with ok needs no action. A text with
    WARNING says what may help.

    Parameters
    ----------
    study : PipelineConfig
        The study. Reading `study.grain` makes its mean grain, which may take seconds.

    Yields
    ------
    str
        A line of text.
    """
    config = study.config
    grain = study.grain
    particle = study.particle

    # Describe targets and ranges. If the study already has results, they show which
    # angles its piles can have.
    dataset_csv = dependencies.find_own_dataset(config)
    for assessment in reach.assess_targets(config, particle, dataset_csv).values():
        yield describe_reach(assessment)
    for sentence in describe_wide_ranges(study.settings.parameters.entries):
        yield f"ranges: WARNING: {sentence}"

    # Describe the time step. If restitutions are low, also describe which restitutions
    # a simulated impact really has with this time step. The other parameters hardly
    # matter for an impact, so use the middle of their ranges.
    limit = computed.find_longest_step(config, particle, grain)
    yield describe_time_step(study.settings.simulation.time_step_s, limit)
    ranges = computed.find_ranges(config)
    lowest_values = {name: low for name, (low, _high) in ranges.items()}
    scene = study.scene(study.parameters.centre)
    yield from hits.describe_low_restitutions(scene, lowest_values)

    def find_longest_step_s(other_grain: Mapping[str, Any]) -> float:
        """Find the longest stable time step of the study with another mean grain."""
        return computed.find_longest_step(config, particle, other_grain).time_step_s

    # Describe the scene and the grain.
    yield from advice.give_funnel_advice(
        config, grain, particle=particle, longest_step_s=find_longest_step_s
    )
    yield from _describe_grain(study)
    yield from _describe_sizes(study)


def describe_reach(assessment: reach.Reach) -> str:
    """Describe in a line whether piles can have the angle of a target.

    If they can, the line is short. Otherwise it has the whole warning.
    """
    if not assessment.possible:
        return f"reach: WARNING: {assessment.sentence}"
    band = assessment.band
    return (
        f"reach: ok, {assessment.target.value:.1f} deg; piles of this mass reach an "
        f"estimated {band.mean:.1f} +- {band.sd:.1f} deg, at most about {band.largest:.1f}"
    )


def is_coarse(particle: "Particle") -> bool:
    """Tell whether the volume of a particle differs much from that of its mesh."""
    return abs(_compute_volume_change(particle)) > LARGEST_VOLUME_CHANGE


def _compute_volume_change(particle: "Particle") -> float:
    """Compute the relative difference of the volumes of a particle and its mesh.

    It is 0 for a particle without a mesh.
    """
    if not particle.mesh_volume_m3:
        return 0.0
    return float(particle.volume_m3 / particle.mesh_volume_m3 - 1)


def _describe_grain(study: PipelineConfig) -> Iterator[str]:
    """Describe a simulated body that is coarse, and grain settings that are not used.

    The body that is simulated is called the particle of a grain. A coarse one has
    another volume than the scan of the grain.

    Yields
    ------
    str
        A line of text, most often a warning. Nothing is yielded for a usual grain.
    """
    # The section of the grain has the name `berry`.
    particle = study.particle
    section = study.settings.berry
    if is_coarse(particle):
        percent = 100 * _compute_volume_change(particle)
        yield _describe_volume_change(section, percent)

    # The volume of a scan and the density already give the mass.
    if section.stl is not None and section.mass_g is not None:
        mass_g = 1e3 * particle.mass_kg
        yield (
            f"mass: WARNING: the mass of berry.stl is used, {format_significant(mass_g, 3)} g; "
            "berry.mass_g is not used"
        )

    # Measured forces are used only if the configuration gives no moduli.
    has_moduli = (
        section.shear_modulus_pa is not None and section.poisson_ratio is not None
    )
    if section.compression is not None and has_moduli:
        yield (
            "moduli: WARNING: berry.shear_modulus_pa and berry.poisson_ratio are used; "
            "berry.compression is not used"
        )


def _describe_volume_change(section: "GrainSettings", percent: float) -> str:
    """Describe a particle whose volume differs by `percent` from that of its mesh.

    If the user has chosen the number of spheres, the line is not a warning.
    """
    differs = f"its volume differs by {percent:+.0f} % from that of the mesh"
    if section.particle == "multisphere" and isinstance(section.spheres, int):
        return f"particle: multisphere of {section.spheres} spheres; {differs}"
    return (
        f"particle: WARNING: {section.particle}; {differs}; try another berry.particle "
        "or berry.surface, or more berry.spheres"
    )


def _describe_sizes(study: PipelineConfig) -> Iterator[str]:
    """Yield warnings if the mean grain does not represent the measured grains well.

    The reason may be two kinds of grains, widely different sizes, or a mass that is too
    large for the sizes.

    Yields
    ------
    str
        A line of text.
    """
    from repose.grain import size_checks
    from repose.grain.berry_files import SIZE_COLUMNS, read_sizes

    # The volume of each measured grain is proportional to the product of its axes.
    section = study.settings.berry
    axes_mm = read_sizes(section.sizes)[list(SIZE_COLUMNS)]
    products_mm3 = axes_mm.prod(axis="columns")

    # The table may contain two kinds of grains.
    diameters_mm = np.cbrt(products_mm3)
    groups = size_checks.find_size_groups(diameters_mm)
    if groups is not None and groups.ratio > 1 + LARGEST_SPREAD:
        yield _describe_groups(groups, section.size_distribution)

    # The sizes may differ widely. A grain with the mean axes then has less volume than
    # the measured grains have on average: the product of the mean axes is smaller than
    # the mean of the products, if grains that are longer are also wider.
    relative_sd = study.grain["scale_sd"]
    if relative_sd > LARGEST_SPREAD:
        lost_fraction = 1 - axes_mm.mean().prod() / products_mm3.mean()
        yield _describe_spread(
            section, relative_sd=relative_sd, lost_fraction=lost_fraction
        )

    # The mass may be too large for the sizes. With a scan, which gives the volume
    # directly, the mass in the configuration is not used.
    if section.mass_g is not None and section.stl is None:
        yield from _warn_about_large_mass(section, section.mass_g, axes_mm)


def _warn_about_large_mass(
    section: "GrainSettings", mass_g: float, axes_mm: "pd.DataFrame"
) -> Iterator[str]:
    """Yield a warning if the mass needs more volume than a grain of this size can have.

    The needed volume is the mass divided by the density. A grain with the mean axes
    can have at most the volume of the largest body with these axes.

    Parameters
    ----------
    section : GrainSettings
        The section of the grain.
    mass_g : float
        The key `mass_g` of this section.
    axes_mm : DataFrame
        The axes of each measured grain.
    """
    from repose.grain import berry, size_checks

    # Compare both volumes. The plain means of the axes are needed here, so do not
    # change them to keep the mean volume.
    mean_axes = berry.compute_mean_axes(axes_mm, keeps_volume=False)
    largest_mm3 = size_checks.compute_largest_volume(list(mean_axes.values()))
    # One g over one kg/m3 is 1e-3 m3, which is 1e6 mm3.
    needed_mm3 = 1e6 * mass_g / section.density_kg_m3
    excess = needed_mm3 / largest_mm3 - 1
    if excess > LARGEST_EXCESS:
        excess_percent = format_significant(100 * excess, 2)
        yield (
            f"mass: WARNING: berry.mass_g {format_significant(mass_g)} makes the body "
            f"{excess_percent} % fuller than its mean axes allow; a body with these axes has "
            f"at most {format_significant(largest_mm3)} mm3, and if they are equal, it is a "
            "sphere; check mass, density and sizes, or leave out berry.mass_g"
        )


def _describe_groups(groups: "SizeGroups", distribution: str) -> str:
    """Describe two groups of sizes, and the grains that are poured instead.

    Parameters
    ----------
    groups : SizeGroups
        The number of grains and the mean diameter of each group.
    distribution : str
        The key `berry.size_distribution`, which says whether all grains are equal.
    """
    n_grains = sum(groups.counts)
    parts = [
        f"{format_significant(100 * count / n_grains, 2)} % of the grains have about "
        f"{format_significant(diameter, 3)} mm"
        for count, diameter in zip(groups.counts, groups.diameters_mm, strict=True)
    ]
    poured = "equal grains of the mean volume are poured"
    if distribution == "measured":
        poured = "sizes of one normal distribution are poured"
    return (
        f"sizes: WARNING: the grains form two groups: {', '.join(parts)}; {poured}; "
        "calibrate each group separately"
    )


def _describe_spread(
    section: "GrainSettings", *, relative_sd: float, lost_fraction: float
) -> str:
    """Describe a wide spread of sizes, how it is simulated, and the lost volume.

    For example: "sizes: WARNING: the equivalent diameter scatters by 12 %, and is drawn
    from a normal distribution".

    Parameters
    ----------
    section : GrainSettings
        The section of the grain.
    relative_sd : float
        Standard deviation of the equivalent diameter, divided by its mean.
    lost_fraction : float
        Fraction of the mean volume that a grain with the mean axes lacks.

    Returns
    -------
    str
        A line of text.
    """
    percent = format_significant(100 * relative_sd, 2)
    text = f"sizes: WARNING: the equivalent diameter scatters by {percent} %"

    # Either each poured grain gets a size of its own, or all have the same size.
    if section.size_distribution == "measured":
        text += ", and is drawn from a normal distribution"
    else:
        text += (
            "; all poured grains have the same size; set berry.size_distribution to "
            "measured to pour different sizes"
        )

    # The volume of a scanned grain does not follow from the axes.
    if section.stl is not None:
        return text

    # A given mass determines the volume, and `keeps_volume` changes the axes so that
    # the grain has the mean volume. Only without both of them is volume lost.
    lost_percent = format_significant(100 * lost_fraction, 2)
    less_volume = (
        f"{lost_percent} % less volume than the measured grains have on average"
    )
    if section.mass_g is not None:
        text += (
            f"; a grain with the mean axes has {less_volume}, and berry.mass_g makes its "
            "body fuller to compensate"
        )
    elif not section.keeps_volume:
        text += f"; with berry.mean_size: axes the grain has {less_volume}"
    return text


def describe_time_step(step_s: float, limit: "Limit") -> str:
    """State the time step and its maximum, and what a longer time step would gain.

    The line always says ok, because a study with a longer time step than the maximum is
    rejected earlier (`validation.find_time_step_problems`).

    Parameters
    ----------
    step_s : float
        The time step of the study [s].
    limit : Limit
        The longest stable time step, and what limits it.

    Returns
    -------
    str
        A line of text.
    """
    maximum_s = computed.round_down(limit.time_step_s, digits=3)
    text = f"time step: ok, {format_significant(step_s)} s; maximum {format_significant(maximum_s, 3)} s"
    advised_s = computed.advise_time_step_s(limit.time_step_s)
    if advised_s > WORTHWHILE_RATIO * step_s:
        percent = 100 * step_s / advised_s
        text += (
            f": {limit.reason}; with {advised_s:g} s a run takes "
            f"{format_significant(percent, 2)} % of the time"
        )
    return text


def warn_about_few_measurements(study: PipelineConfig) -> Iterator[str]:
    """Yield a warning for each target whose scatter is unknown or very uncertain."""
    for target in study.settings.targets:
        if target.repetitions < MIN_PILES:
            yield (
                f"{target.response}: WARNING: repetitions is {target.repetitions}; "
                f"measure at least {MIN_PILES} piles, since all intervals depend on "
                "their scatter"
            )
        if target.sd == 0:
            yield (
                f"{target.response}: WARNING: sd is 0, so the intervals are too narrow; "
                "give the standard deviation of the measured piles"
            )


def run_trials(
    study: PipelineConfig, grain_step_s: float, show_message: ShowMessage
) -> Iterator[str]:
    """Simulate each bench test of the targets with a few extreme parameter sets.

    `TRIAL_FRACTIONS` lists the parameter sets. The function yields a line about each
    run, and a warning about each target that lies far outside the results. The runs are
    made while the lines are requested.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    grain_step_s : float
        Time that one time step takes for each grain [s]. It serves to estimate the time
        of a run. Bench tests with longer runs than `LONGEST_TRIAL_S` are skipped.
    show_message : callable
        Function that returns a context manager, which shows a sentence during the runs.

    Yields
    ------
    str
        A line of text.
    """
    parameter_sets = _choose_trial_sets(study)
    n_runs = len(parameter_sets)
    for name in study.targets.apparatus:
        # Skip a bench test that would keep the user waiting for minutes.
        expected_s = cost.estimate_run_s(study.config, name, grain_step_s)
        if expected_s > LONGEST_TRIAL_S:
            yield f"{name}: no trial runs, because one takes about {expected_s:.0f} s"
            continue

        # Run and measure each set once, with the same seed.
        test = bench(name)
        runs = []
        total_s = n_runs * expected_s
        with show_message(f"{n_runs} trial runs of {name}, about {total_s:.0f} s"):
            for parameters in parameter_sets:
                run, _ = run_once(test, study.scene(parameters, seed=TRIAL_SEED))
                runs.append(run)

        yield from _describe_trials(test, runs)
        yield from _warn_about_trials(study, test, runs)


def _describe_trials(
    test: BenchTest[Any], runs: Iterable[Mapping[str, Any]]
) -> Iterator[str]:
    """Yield a line about each trial run; the runs have the order of `TRIAL_FRACTIONS`."""
    for point, run in zip(TRIAL_FRACTIONS, runs, strict=True):
        # All trial runs have the same seed, so do not repeat it in each line.
        sentence = describe_run(run, test.summary).removeprefix(f"seed {TRIAL_SEED}: ")
        yield f"{test.name}: {point}: {sentence}"


def _choose_trial_sets(study: PipelineConfig) -> list[dict[str, float]]:
    """Return the parameters of the trial runs, in the order of `TRIAL_FRACTIONS`.

    `TRIAL_FRACTIONS` states where in its range each free parameter lies. It has one
    fraction for the restitutions and one for all other parameters, such as friction.
    """
    space = study.parameters
    is_restitution = np.array([name.startswith("e_") for name in space.free])
    # Rows are the trial runs, columns the free parameters.
    fractions = np.array(
        [
            np.where(is_restitution, restitution, friction)
            for restitution, friction in TRIAL_FRACTIONS.values()
        ]
    )
    return [
        dict(zip(space.names, values, strict=True))
        for values in space.values(fractions).tolist()
    ]


def _warn_about_trials(
    study: PipelineConfig, test: BenchTest[Any], runs: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    """Yield warnings if trial runs fail, or if a target lies far outside their results.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    test : BenchTest
        The bench test of the runs.
    runs : sequence of mapping
        The measured runs: ``status`` is ``ok`` or the reason of a failure, and each
        response has its name as key.

    Yields
    ------
    str
        A line of text.
    """
    good_runs = [run for run in runs if run["status"] == "ok"]
    if not good_runs:
        yield (
            f"{test.name}: WARNING: no trial run can be measured; change the settings in "
            f"the section {test.name}, or the ranges of the parameters"
        )
        return

    # Compare each target of this bench test with the results of the runs. Extend the
    # span of the results by a margin, because so few runs seldom include the extremes.
    responses = test.target_responses(study.config)
    for target in study.targets:
        if target.response not in responses:
            continue
        values = [run[target.name] for run in good_runs]
        low = min(values)
        high = max(values)
        margin = MAX_DISTANCE_IN_SPANS * (high - low)
        if target.value < low - margin or target.value > high + margin:
            results_text = f"{format_significant(low)} to {format_significant(high)}"
            yield (
                f"{target.name}: WARNING: the target {format_significant(target.value)} is far "
                f"outside the single runs, {results_text}; other ranges or another scene may "
                "be needed"
            )


def tabulate_costs(
    study: PipelineConfig, budgets: Iterable[int], grain_step_s: float
) -> Iterator[str]:
    """Tabulate the cost of the strategies, with a star at the configured one.

    The table has three strategies. Lines after the table say why a strategy cannot run
    with this configuration.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    budgets : iterable of int
        Numbers of runs of the sequential strategy. Each gets its own row.
    grain_step_s : float
        Time for one step of one grain [s].

    Yields
    ------
    str
        A line of text.
    """
    # Find the strategies that cannot run with this configuration. The strategy
    # `published` is not among them, because it has no section and always can.
    settings = study.settings
    reasons_against: dict[str, str] = {}
    for name in strategies.list_strategies_with_section():
        reason = cost.explain_why_unusable(settings, name)
        if reason is not None:
            reasons_against[name] = reason

    # In the header each cell is the name of its column.
    yield _align_costs({column: column for column in COST_COLUMNS})

    # Below it there is a row for each budget, and one for each other strategy.
    if "sequential" not in reasons_against:
        for budget in budgets:
            runs = _list_runs_of_budget(study, budget)
            yield _format_cost_row(study, "sequential", runs, grain_step_s)
    if "response_surface" not in reasons_against:
        max_runs = cost.list_strategy_runs(settings, "response_surface")
        yield _format_cost_row(study, "response_surface", max_runs, grain_step_s)
    yield _format_cost_row(study, "published", None, grain_step_s)

    # Explain the missing rows and the table.
    for name, reason in reasons_against.items():
        yield f"{name}: {reason}"
    yield (
        "*: the configured strategy; response_surface: the largest number of runs; "
        "minutes: at the present speed of this machine"
    )


def _list_runs_of_budget(study: PipelineConfig, budget: int) -> cost.PlannedRuns:
    """List the runs of the sequential strategy with a budget of runs.

    The strategy learns from batches of runs, each with all seeds. The runs of the final
    check are not part of the budget.
    """
    section = study.settings.sequential
    n_batches = math.ceil(budget / section.seeds)
    return (
        ("batches", n_batches, section.seeds),
        CheckRuns("check", 1, section.checks),
    )


def _format_cost_row(
    study: PipelineConfig,
    name: str,
    runs: cost.PlannedRuns | None,
    grain_step_s: float,
) -> str:
    """Write the row of a strategy in the table of costs.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    name : str
        The strategy.
    runs : sequence of (str, int, int), or None
        The runs of the strategy: purpose, number of parameter sets, seeds of each set.
        An entry of the type `CheckRuns` checks the answer. None stands for the
        article's method, the strategy `published`, whose runs `cost.estimate_work`
        lists.
    grain_step_s : float
        Time for one step of one grain [s].

    Returns
    -------
    str
        The row. A star marks the strategy that the study uses.
    """
    work = cost.estimate_work(study.config, grain_step_s, runs)
    n_runs = cost.count_runs(work.runs)
    check_runs = [entry for entry in work.runs if isinstance(entry, CheckRuns)]
    n_check_runs = cost.count_runs(check_runs)
    minutes = work.total_s / 60
    disk_mb = cost.estimate_disk_mb(study.settings, n_runs)
    return _align_costs(
        {
            "strategy": f"*{name}" if name == study.settings.strategy else name,
            "runs to learn": str(n_runs - n_check_runs),
            "to check": str(n_check_runs),
            "core-minutes": format_significant(minutes, 3),
            "disk": f"{format_significant(disk_mb, 3)} MB",
        }
    )


def _align_costs(cells: Mapping[str, str]) -> str:
    """Align the cells of a row with the columns of the table of costs."""
    return " ".join(f"{cells[name]:>{width}}" for name, width in COST_COLUMNS.items())


def list_studies(files: list[str]) -> str:
    """List the studies that a configuration can run, each with its cost.

    Parameters
    ----------
    files : list of str
        The files of the configuration; none for the default one.

    Returns
    -------
    str
        Several lines. They have no costs if the configuration is incomplete or invalid,
        or if another program makes the runs.

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    # Merging fails only if a file cannot be read. It does not check the values, so it
    # gives the name of the study even if these are invalid.
    label = loader.merge_with_defaults(files).config.get("label")
    try:
        study = PipelineConfig.load(*files)
        if study.simulator is not None:
            return _list_studies_of_program(study)
        label = study.config.get("label")
        cost_texts = _describe_all_costs(study)
    except InputError:
        # An invalid configuration has no costs, but its studies can still be listed.
        # Without files, the default one is meant.
        file_names = ", ".join(files) or "config.yaml"
        unknown_cost = f"cost: once {file_names} is complete; `repose check` lists the missing keys"
        cost_texts = dict.fromkeys(cost.STUDY_SUMMARIES, unknown_cost)

    # The cost of a study stands below its summary.
    lines = [STUDY_LIST_HEADING.format(label)]
    for name, summary in cost.STUDY_SUMMARIES.items():
        lines.append(f"  {name:{STUDY_NAME_WIDTH}} {summary}")
        lines.append(f"  {'':{STUDY_NAME_WIDTH}} {cost_texts[name]}")
    return "\n".join(lines)


def _describe_all_costs(study: PipelineConfig) -> dict[str, str]:
    """Describe the cost of each study of `repose run` and of each strategy, by name."""
    cost_texts = cost.describe_costs(study.config)
    for name in strategies.list_strategies_with_section():
        cost_texts[name] = _describe_strategy_cost(study, name)
    return cost_texts


def _list_studies_of_program(study: PipelineConfig) -> str:
    """List the studies of a configuration whose runs are made by another program."""
    lines = [STUDY_LIST_HEADING.format(study)]
    for name in (
        "calibration",
        "uncertainty",
        *strategies.list_strategies_with_section(),
    ):
        summary = cost.STUDY_SUMMARIES.get(name, "Another way to calibrate.")
        lines.append(f"  {name:{STUDY_NAME_WIDTH}} {summary}")
    return "\n".join(lines)


def _describe_strategy_cost(study: PipelineConfig, strategy: str) -> str:
    """Describe the cost of a strategy, or why it cannot run with this configuration."""
    reason_against = cost.explain_why_unusable(study.settings, strategy)
    if reason_against is not None:
        return reason_against

    runs = cost.list_strategy_runs(study.settings, strategy)
    work = cost.estimate_work(study.config, runs=runs)
    n_runs = cost.count_runs(work.runs)
    minutes = format_significant(work.total_s / 60, 2)
    return (
        f"at most {n_runs} runs in each bench test, about {minutes} min on one core, "
        "instead of the calibration"
    )

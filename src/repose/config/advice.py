"""Advise on the funnel scene of a study before any grains are poured.

The advice concerns the stiffness, the volume and the number of the grains.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from repose.bench import scene_size
from repose.bench.funnel import NAME, PACKING, FunnelSettings
from repose.bench.settings import SceneSettings
from repose.common.keys import Config
from repose.common.numbers import format_significant
from repose.common.statuses import describe_status
from repose.config.computed import Grain, compute_diameter_mm
from repose.dem.laws import ROLLING_LAWS
from repose.grain.particle import Particle
from repose.measure import definitions

# A pile sinks under its own weight, because its grains press into each other. Fraction
# of its height by which a pile of soft grains may sink. This is far less than the
# scatter of piles.
MAX_SINKING = 0.005
# Piles of real grains sink by a smaller fraction of their height. The softest pile that
# we know, of fresh goji berries, sinks by 0.023.
SUSPICIOUS_SINKING = 0.05
# Smallest and largest slope of poured grains. If a cone of all grains that is as high
# as the target has a slope outside these limits, the number of grains is wrong.
SLOPES_DEG = (15.0, 45.0)
# Largest ratio between the volumes of a pile and its cone, whichever is larger. A real
# pile differs from a cone because it has a rounded top and a tail at the foot.
VOLUME_FACTOR = 1.5
# A line along a part of the side is steeper than one along the whole side, so the cone
# of its angle is smaller than the pile: for goji berries, whose sides have 26 degrees
# as a whole and 33 degrees in part, by this factor.
PART_OF_SIDE_FACTOR = 1.7
# By Hertz's law, the sinking is proportional to the modulus to the power of -2/3, so
# the modulus is proportional to the sinking to the power of -3/2.
MODULUS_EXPONENT = 1.5


class PileTargets(NamedTuple):
    """The targets for the shape of a pile; each is None if the study lacks the target."""

    height_mm: float | None
    angle_deg: float | None


class Softening(NamedTuple):
    """How much a pile sinks under its own weight, and how soft its grains may be.

    Attributes
    ----------
    sinking : float
        Fraction of its height by which the pile sinks.
    softest_modulus_pa : float
        Lowest acceptable shear modulus [Pa]. With it, the pile sinks by `MAX_SINKING`.
    """

    sinking: float
    softest_modulus_pa: float


class Filling(NamedTuple):
    """Comparison of the volume of the poured grains with that of the target pile.

    Attributes
    ----------
    sentence : str
        Description of both volumes, with a WARNING if no pile of these grains can meet
        the targets.
    fits : bool
        Whether the number of grains is right for the targets.
    """

    sentence: str
    fits: bool


def give_funnel_advice(
    config: Config,
    grain: Grain,
    particle: Particle,
    longest_step_s: Callable[[Grain], float],
) -> Iterator[str]:
    """Give advice on the pour through the funnel, line by line.

    The advice concerns the rolling law, the stiffness of the grains, their volume, the
    height of the outlet, and the number of grains, in this order.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain : mapping
        The mean grain, as in berry.json.
    particle : Particle
        The body of the mean grain.
    longest_step_s : callable
        Function that returns the longest time step [s] for a given mean grain.

    Yields
    ------
    str
        A line of text.
    """
    yield from _warn_about_creep(config)
    yield f"stiffness: {_describe_stiffness(config, grain, longest_step_s)}"
    # If the volume does not fit, the sentence itself begins with WARNING.
    filling = compare_volumes(config, particle.volume_m3)
    prefix = "ok, " if filling.fits else ""
    yield f"volume: {prefix}{filling.sentence}"
    height_mm = 1e3 * estimate_pile_height_m(config, grain)
    yield from _warn_about_blocked_outlet(config, height_mm)

    # Describe the number of grains. If it is wrong for the targets, name the right
    # number.
    n_grains = _read_funnel_settings(config).berries
    beginning = "ok, the pile is"
    if not filling.fits:
        n_needed = count_needed_grains(config, particle.volume_m3)
        beginning = f"{n_needed} would fill the target pile, which is"
        n_grains = max(n_grains, n_needed)
    grain_mm = compute_diameter_mm(grain)
    # `measure_of` takes the mean grain. The name of the calibrated angle does not
    # depend on the grain, so give an empty one.
    angle_name = SceneSettings(config).measure_of({}).response
    yield _describe_number_of_grains(
        n_grains,
        height_in_grains=height_mm / grain_mm,
        angle_name=angle_name,
        beginning=beginning,
    )

    # Describe a smaller scene for this number of grains. The first line of
    # `scene_size.advise` says the same as the line above, so leave it out.
    _, *smaller_scene = scene_size.advise(
        config, grain_mm, height_mm=height_mm, poured=n_grains
    )
    yield from smaller_scene


def _warn_about_creep(config: Config) -> Iterator[str]:
    """Yield a warning if grains creep with the rolling law of the study."""
    rolling_law = SceneSettings(config).simulation.rolling_law
    if ROLLING_LAWS.entry(rolling_law).creeps:
        yield (
            f"rolling law: WARNING: with {rolling_law} grains creep under a torque, so "
            f"runs may fail because {describe_status('not_at_rest')}"
        )


def _warn_about_blocked_outlet(config: Config, height_mm: float) -> Iterator[str]:
    """Yield a warning if a pile of this height would reach the outlet of the funnel."""
    outlet_mm = _read_funnel_settings(config).outlet_height_mm
    if height_mm > outlet_mm:
        yield (
            f"funnel: WARNING: a pile of {format_significant(height_mm, 3)} mm reaches the outlet at "
            f"{format_significant(outlet_mm)} mm and stops the flow"
        )


def _describe_number_of_grains(
    n_grains: int, height_in_grains: float, angle_name: str, beginning: str
) -> str:
    """Describe how the angle of a pile depends on the number of its grains.

    Parameters
    ----------
    n_grains : int
        Number of grains of the pile.
    height_in_grains : float
        Height of the pile in diameters of a grain.
    angle_name : str
        Which angle of the pile is calibrated, as in the key `measure.response`.
    beginning : str
        Beginning of the sentence, such as "ok, the pile is". The height follows it.

    Returns
    -------
    str
        A line of text.
    """
    # The effect of the number is known from a table of simulated piles. For more grains
    # than in its largest pile, describe this pile instead. The table has only some
    # angles, so use the most similar one for an angle that is not in it.
    n_tabulated = min(n_grains, max(scene_size.list_tabulated_numbers()))
    tabulated_angle = scene_size.TABULATED.get(angle_name, angle_name)

    # State how half as many grains would change the angle. A negative change means a
    # smaller angle.
    change_deg = scene_size.interpolate_change(
        n_tabulated, n_tabulated / 2, tabulated_angle
    ).angle_deg
    direction = "lower" if change_deg < 0 else "raise"
    text = (
        f"grains: {beginning} {format_significant(height_in_grains, 2)} grains high; {n_tabulated // 2} "
        f"instead of {n_tabulated} would {direction} the {tabulated_angle} angle by "
        f"{abs(change_deg):.1f} deg"
    )

    # Also state the smallest number of grains that changes the angle very little.
    n_enough = scene_size.find_fewest_grains(n_tabulated, tabulated_angle)
    if n_enough is not None:
        text += (
            f", and {n_enough} would change it by at most "
            f"{scene_size.ANGLE_TOLERANCE_DEG:g} deg"
        )
    return text


def _describe_stiffness(
    config: Config, grain: Grain, longest_step_s: Callable[[Grain], float]
) -> str:
    """Describe how far a pile sinks, and how much time softer grains would save.

    The pile sinks under its own weight, because its grains press into each other.
    Softer grains press in further, but allow a longer time step.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain : mapping
        The mean grain, as in berry.json.
    longest_step_s : callable
        Returns the longest time step [s] for a given mean grain.

    Returns
    -------
    str
        One or two sentences. They begin with WARNING if the pile sinks more than real
        piles do, and with ok if the grains should not be softer. Otherwise they have
        neither word, and propose softer grains.
    """
    modulus_pa = grain["shear_modulus_pa"]
    modulus_text = format_significant(modulus_pa, 3)
    softening = compute_softening(config, grain)
    percent = format_significant(100 * softening.sinking, 2)
    sentence = f"the pile sinks by {percent} % of its Height under its own weight"

    if softening.sinking > SUSPICIOUS_SINKING:
        return (
            f"WARNING: {sentence}, more than piles of real grains do. Check the modulus "
            f"of {modulus_text} Pa, and the unit of the forces from which it was computed"
        )
    if softening.softest_modulus_pa >= modulus_pa:
        return f"ok, {sentence}; a lower berry.shear_modulus_pa would make it sink more"

    # Softer grains allow a longer time step, and so a faster run.
    softest_grain = {**grain, "shear_modulus_pa": softening.softest_modulus_pa}
    softest_text = format_significant(softening.softest_modulus_pa, 3)
    step_s = SceneSettings(config).simulation.time_step_s
    longest_s = longest_step_s(softest_grain)
    percent_of_time = format_significant(100 * step_s / longest_s, 2)
    return (
        f"{sentence}. With a berry.shear_modulus_pa of {softest_text} instead of "
        f"{modulus_text} it sinks by {100 * MAX_SINKING:.2g} %; then "
        f"simulation.time_step_s may be {longest_s:.2g} s, and a run takes "
        f"{percent_of_time} % of the time"
    )


def compute_softening(config: Config, grain: Grain) -> Softening:
    """Compute how far a pile sinks under its own weight, and how soft grains may be.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain : mapping
        The mean grain, as in berry.json.

    Returns
    -------
    Softening
        The sinking as a fraction of the height, and the lowest acceptable modulus [Pa].

    Notes
    -----
    A grain of diameter d at depth z carries the weight above its own area,
    F = p rho g z d^2, where p is the packing fraction. By Hertz's law two such grains
    approach each other by (3 F / (4 E* sqrt(d/4)))^(2/3). E* is the effective modulus
    of two equal grains, G / (1 - nu), with the shear modulus G and Poisson's ratio nu.

    F grows in proportion to z, and z^(2/3) has a mean of 3/5 of its value at the
    bottom. So the mean approach over the depth is 3/5 of the approach at the bottom.
    Divided by d, it is the fraction of the height by which the pile sinks.

    This fraction is proportional to the modulus to the power of -2/3. To reach another
    fraction, the modulus must be multiplied by the ratio of the present fraction to
    the other one, to the power of 3/2.
    """
    diameter_m = 1e-3 * compute_diameter_mm(grain)
    gravity = SceneSettings(config).simulation.gravity_m_s2

    # Compute the pressure at the bottom of the pile, and by Hertz's law how much it
    # pushes two grains there into each other.
    pressure_pa = (
        PACKING
        * grain["density_kg_m3"]
        * gravity
        * estimate_pile_height_m(config, grain)
    )
    effective_modulus_pa = grain["shear_modulus_pa"] / (1 - grain["poisson_ratio"])
    approach_m = (
        3
        * pressure_pa
        * diameter_m**2
        / (4 * effective_modulus_pa * math.sqrt(diameter_m / 4))
    ) ** (2 / 3)

    # The mean over the depth of the pile is 3/5 of the value at its bottom.
    sinking = 3 / 5 * approach_m / diameter_m

    # Find the modulus with which the pile sinks by the largest acceptable fraction.
    sinking_ratio = sinking / MAX_SINKING
    softest_modulus_pa = grain["shear_modulus_pa"] * sinking_ratio**MODULUS_EXPONENT
    return Softening(sinking, softest_modulus_pa)


def estimate_pile_height_m(config: Config, grain: Grain) -> float:
    """Estimate the height of the pile from the targets [m].

    If the study has a target for the height, the result is this target. If it has only
    a target for the angle, the result is the height of a cone of all grains with this
    angle. Without either target, the result is half the height of the funnel's outlet,
    a rough guess between no pile and a pile that reaches the outlet.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain : mapping
        The mean grain, as in berry.json.

    Returns
    -------
    float
        The height [m].
    """
    funnel = _read_funnel_settings(config)
    targets = _find_pile_targets(config)
    if targets.height_mm is not None:
        return 1e-3 * targets.height_mm
    if targets.angle_deg is not None:
        # All grains together, with the gaps between them, form a cone. A sphere of the
        # equivalent diameter stands for a grain, which is exact enough for an estimate.
        grain_volume_m3 = math.pi / 6 * (1e-3 * compute_diameter_mm(grain)) ** 3
        volume_m3 = funnel.berries * grain_volume_m3 / PACKING
        return _compute_cone_height_m(volume_m3, targets.angle_deg)
    return 0.5e-3 * funnel.outlet_height_mm


def compare_volumes(config: Config, grain_volume_m3: float) -> Filling:
    """Compare the volume of the poured grains with the volume of the target pile.

    With targets for height and angle, the target pile is a cone of this height and
    slope. With a target for the height alone, the slope of a cone of all grains is
    compared with slopes of real piles. With a target for the angle alone, or with none,
    every volume fits.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain_volume_m3 : float
        Volume of a grain [m3].

    Returns
    -------
    Filling
        A description of both volumes, and whether they are compatible.
    """
    n_grains = _read_funnel_settings(config).berries
    height_mm, angle_deg = _find_pile_targets(config)
    # The volume includes the gaps between the grains.
    volume_m3 = n_grains * grain_volume_m3 / PACKING
    poured_text = f"{n_grains} poured grains fill {_format_volume(volume_m3)}"

    # The comparison depends on which of the two targets the study has.
    if height_mm is not None and angle_deg is not None:
        # A pile may have more volume than a cone. This is even more so if the angle is
        # measured along a part of the side only, because this part is steeper.
        largest_ratio = VOLUME_FACTOR
        if not definitions.PROPERTIES[config["measure"]["response"]].follows_whole_side:
            largest_ratio *= PART_OF_SIDE_FACTOR
        return _compare_with_cone(
            volume_m3,
            poured_text,
            height_mm=height_mm,
            angle_deg=angle_deg,
            largest_ratio=largest_ratio,
        )
    if height_mm is not None:
        return _compare_slope(volume_m3, poured_text, height_mm)

    # Without a target for the height, a cone of any size fits.
    sentence = poured_text
    if angle_deg is not None:
        cone_mm = format_significant(
            1e3 * _compute_cone_height_m(volume_m3, angle_deg), 3
        )
        sentence += (
            f": a cone of {format_significant(angle_deg)} deg and {cone_mm} mm Height"
        )
    return Filling(sentence, fits=True)


def _compare_with_cone(
    volume_m3: float,
    poured_text: str,
    *,
    height_mm: float,
    angle_deg: float,
    largest_ratio: float,
) -> Filling:
    """Compare the volume of the poured grains with the cone of both targets.

    Only the volumes are compared. `repose.bench.reach` compares the angle with the
    height.

    Parameters
    ----------
    volume_m3 : float
        Volume of the poured grains, with the gaps between them.
    poured_text : str
        Description of this volume.
    height_mm, angle_deg : float
        Target for the height [mm], and target for the angle [deg].
    largest_ratio : float
        Largest acceptable ratio of the volume of the grains to the volume of the cone.

    Returns
    -------
    Filling
        A description of both volumes, and whether they are compatible.
    """
    cone_m3 = _compute_cone_volume_m3(height_mm, angle_deg)
    sentence = (
        f"{poured_text}; the cone of {format_significant(angle_deg)} deg and "
        f"{format_significant(height_mm)} mm Height holds {_format_volume(cone_m3)}"
    )
    if 1 / VOLUME_FACTOR <= volume_m3 / cone_m3 <= largest_ratio:
        return Filling(sentence, fits=True)
    return Filling(
        f"WARNING: {sentence}, {format_significant(cone_m3 / volume_m3, 2)} times as much; count the "
        "grains, and check the scale of the photographs",
        fits=False,
    )


def _compare_slope(volume_m3: float, poured_text: str, height_mm: float) -> Filling:
    """Check whether the poured grains form a cone of this height with a possible slope.

    Parameters
    ----------
    volume_m3 : float
        Volume of the poured grains, with the gaps between them.
    poured_text : str
        Description of this volume.
    height_mm : float
        The target for the height. The study has no target for the angle.
    """
    slope_deg = _compute_cone_slope_deg(volume_m3, height_mm)
    cone_text = (
        f"a cone of {format_significant(height_mm)} mm Height with a slope of "
        f"{format_significant(slope_deg, 3)} deg"
    )
    flattest_deg, steepest_deg = SLOPES_DEG
    if flattest_deg <= slope_deg <= steepest_deg:
        return Filling(f"{poured_text}: {cone_text}", fits=True)
    return Filling(
        f"WARNING: {poured_text}: {cone_text}; slopes of poured grains are "
        f"{flattest_deg:g} to {steepest_deg:g} deg",
        fits=False,
    )


def count_needed_grains(config: Config, grain_volume_m3: float) -> int:
    """Count the grains that fill the target pile.

    Without a target for the height, a pile of any size is right, so the result is the
    configured number. Without a target for the angle, the pile may have any slope of
    `SLOPES_DEG`, so a range of numbers is possible. If the configured number lies
    outside this range, the result is the nearer end of the range.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain_volume_m3 : float
        Volume of a grain [m3].

    Returns
    -------
    int
        The number of grains.
    """
    n_grains = _read_funnel_settings(config).berries
    height_mm, angle_deg = _find_pile_targets(config)
    if height_mm is None:
        return n_grains

    # A target for the angle leaves only one possible slope.
    flattest_deg, steepest_deg = SLOPES_DEG
    if angle_deg is not None:
        flattest_deg = angle_deg
        steepest_deg = angle_deg
    # Among cones of the same height, the steepest has the smallest volume.
    min_grains = _count_grains_of_cone(height_mm, steepest_deg, grain_volume_m3)
    max_grains = _count_grains_of_cone(height_mm, flattest_deg, grain_volume_m3)
    return min(max(n_grains, min_grains), max_grains)


def _compute_cone_height_m(volume_m3: float, angle_deg: float) -> float:
    """Compute the height of a cone from its volume and its slope [m]."""
    return (3 * volume_m3 * math.tan(math.radians(angle_deg)) ** 2 / math.pi) ** (1 / 3)


def _compute_cone_slope_deg(volume_m3: float, height_mm: float) -> float:
    """Compute the slope of a cone from its volume and its height [deg]."""
    tangent = math.sqrt(math.pi * (1e-3 * height_mm) ** 3 / (3 * volume_m3))
    return math.degrees(math.atan(tangent))


def _compute_cone_volume_m3(height_mm: float, angle_deg: float) -> float:
    """Compute the volume of a cone from its height and its slope [m3]."""
    tangent = math.tan(math.radians(angle_deg))
    return math.pi * (1e-3 * height_mm) ** 3 / (3 * tangent**2)


def _count_grains_of_cone(
    height_mm: float, angle_deg: float, grain_volume_m3: float
) -> int:
    """Count the grains that fill a cone, with the gaps between them."""
    cone_m3 = _compute_cone_volume_m3(height_mm, angle_deg)
    return math.ceil(PACKING * cone_m3 / grain_volume_m3)


def _read_funnel_settings(config: Config) -> FunnelSettings:
    """Return the settings of the funnel."""
    return SceneSettings(config).section(NAME, FunnelSettings)


def _find_pile_targets(config: Config) -> PileTargets:
    """Return the targets for the pile below the funnel."""
    values = {}
    for target in SceneSettings(config).targets_of(NAME):
        values[target["response"]] = target["value"]
    return PileTargets(values.get("height_mm"), values.get("aor_deg"))


def _format_volume(volume_m3: float) -> str:
    """Format a volume in litres, or a small one in millilitres."""
    if volume_m3 >= 1e-3:
        return f"{format_significant(1e3 * volume_m3, 3)} l"
    return f"{format_significant(1e6 * volume_m3, 3)} ml"

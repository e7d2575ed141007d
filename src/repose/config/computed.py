"""Compute the settings for which the configuration has `auto` in place of a number.

Only files of a user have `auto`. Files that a study writes have the number.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from repose.bench.funnel import PACKING
from repose.bench.grain_scale import GrainScale, round_to_digits
from repose.bench.parameters import ALLOWED, LAW_PARAMETERS, PARAMETERS
from repose.calibrate.parameter_space import find_range
from repose.calibrate.study_file import choose_split
from repose.common.keys import Config
from repose.common.section import AUTO
from repose.config.models import select_valid_sections
from repose.measure.settings import COARSEST_MM_PER_PIXEL, FINEST_MM_PER_PIXEL
from repose.stages.published import read_parameter_sets

if TYPE_CHECKING:
    from repose.dem.time_steps import Limit
    from repose.grain.particle import Particle

# Pixels of a simulated pile's picture over the grain's equivalent diameter.
PIXELS_A_GRAIN = 32
# Fraction of the longest time step that is used. The longest one is only an estimate.
STEP_FRACTION = 0.8

# Times, and limits below which a pile is at rest, in the units of a grain
# (`repose.bench.grain_scale`). For the goji berry, these values give the numbers of its
# study to two digits.
REST_ENERGY = 5.8e-6  # mean kinetic energy of a grain
REST_MOTION = 1 / 14  # distance that a grain moves within a rest window
REST_WINDOW = 5.3  # duration of a rest window
# Time from the arrival of the last grain until the pile is at rest. With the lowest
# friction of the crops it took 13 to 27 units, for grains of 2 to 75 mm.
REST_TIME = 40

# Beverloo's law for the discharge of grains from an opening.
BEVERLOO_FACTOR = 0.58
# No grains flow near the edge of the opening. In Beverloo's law, this many grain
# diameters are subtracted from the diameter of the opening.
BEVERLOO_EDGE_DIAMETERS = 1.4

# The phrase with which `repose.dem.time_steps` describes the limit of a body between
# two others or two walls. Its groups are the material, the restitution and the number
# of spheres.
ENGINE_PHRASE = re.compile(
    r"the stable step of a body between two of (\S+) "
    r"\(restitution ([^,)]+)(?:, ([0-9.]+) spheres at one place)?\)"
)
GRAIN_MATERIAL = "berry"  # of all grains in a scene

Grain = Mapping[str, Any]  # the mean grain, as in berry.json


class ComputedSetting(NamedTuple):
    """A key that may be `auto`, because the program can compute its value.

    Attributes
    ----------
    section, name : str
        The key.
    reads : tuple of str
        The sections, and keys outside sections, on which the number depends.
    compute : callable
        Function that computes the number from the configuration, the mean grain and its
        particle. The last two may be None if `needs_grain` is false.
    """

    section: str
    name: str
    reads: tuple[str, ...]
    compute: Callable[[Config, Any, Any], Any]

    @property
    def key(self) -> str:
        """The dotted key."""
        return f"{self.section}.{self.name}"

    @property
    def needs_grain(self) -> bool:
        """Whether the number depends on the grain."""
        return "berry" in self.reads


def find_settings_to_compute(config: Config) -> list[ComputedSetting]:
    """Find the settings that are `auto` or missing and can be computed.

    Parameters
    ----------
    config : mapping
        The configuration, which need not be valid. Settings of missing sections are
        left out.

    Returns
    -------
    list of ComputedSetting
        The settings, in the order in which they are computed.
    """
    settings = []
    for setting in COMPUTED_SETTINGS:
        section = config.get(setting.section)
        if not isinstance(section, Mapping):
            continue
        if section.get(setting.name, AUTO) == AUTO:
            settings.append(setting)
    return settings


def replace_setting(
    config: Config, setting: ComputedSetting, value: Any
) -> dict[str, Any]:
    """Return a copy of a configuration in which one setting has another value."""
    section = {**config[setting.section], setting.name: value}
    return {**config, setting.section: section}


def find_longest_step(
    config: Config, particle: "Particle", mean_grain: Grain
) -> "Limit":
    """Find the longest time step that is stable for every parameter set of a study.

    Parameters
    ----------
    config : mapping
        The configuration.
    particle : Particle
        The body of the mean grain.
    mean_grain : mapping
        The mean grain, as in berry.json.

    Returns
    -------
    Limit
        The time step [s], and what limits it.

    Notes
    -----
    For each parameter, the value is used that needs the shortest time step. A new
    contact law may need another choice.
    """
    from repose.bench import Scene
    from repose.bench.scene import longest_time_step

    settings = select_valid_sections(config)
    ranges = find_ranges(config)

    # Make the parameter set that needs the shortest step. A low restitution means
    # strong damping, which requires a short step. Therefore use the lowest value of
    # each parameter in the ranges and in the published sets, which are also simulated.
    published_sets = read_parameter_sets(settings.validation.published)
    critical_set = {}
    for name in PARAMETERS:
        lowest_in_range, _ = ranges[name]
        published_values = [values[name] for values in published_sets]
        critical_set[name] = min([lowest_in_range, *published_values])

    # Additional parameters of contact laws, such as cohesion, make contacts stiffer,
    # which also requires a short step. Therefore use their highest values.
    for name in LAW_PARAMETERS:
        if name in ranges:
            _, highest_in_range = ranges[name]
            critical_set[name] = highest_in_range
    scene = Scene.of(config, critical_set, grain=mean_grain, particle=particle)
    limit = longest_time_step(scene)
    return limit._replace(reason=rephrase_limit(limit.reason))


def rephrase_limit(reason: str) -> str:
    """Write what limits the time step in the terms of an engineer.

    The hash of the engine names all simulated piles, and the engine's own phrase is
    part of its code. So the phrase is replaced here, and the piles remain valid.

    Parameters
    ----------
    reason : str
        The `reason` of `repose.dem.time_steps.Limit`.

    Returns
    -------
    str
        The new phrase. A reason that is not about a pressed body is returned unchanged.
    """

    def rephrase(match: re.Match[str]) -> str:
        """Write the new phrase."""
        material, restitution, spheres = match.groups()
        others = "others" if material == GRAIN_MATERIAL else f"walls of {material}"
        phrase = (
            f"the largest stable time step of a grain between two {others}, at a "
            f"restitution of {restitution}"
        )
        if spheres:
            phrase += f" and with {spheres} spheres of a clump in one contact"
        return phrase

    return ENGINE_PHRASE.sub(rephrase, reason)


def find_ranges(config: Config) -> dict[str, tuple[float, float]]:
    """Return the lowest and the highest value of each parameter of a study.

    For a fixed parameter both are equal to its value.
    """
    entries = select_valid_sections(config).parameters.entries
    return {name: find_range(name, entry, ALLOWED) for name, entry in entries.items()}


def round_down(value: float, digits: int) -> float:
    """Round a positive number down to a number of significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - (digits - 1))
    return float(f"{math.floor(value / unit) * unit:.{digits}g}")


def advise_time_step_s(longest_s: float) -> float:
    """Advise a time step [s]: `STEP_FRACTION` of the longest, rounded down to two digits."""
    return round_down(STEP_FRACTION * longest_s, digits=2)


def list_axes_mm(grain: Grain) -> Sequence[float]:
    """Return the three axes of the mean grain, the longest first [mm]."""
    return [grain[name] for name in ("long_mm", "major_mm", "minor_mm")]


def compute_diameter_mm(grain: Grain) -> float:
    """Compute the equivalent diameter of the mean grain [mm].

    It is the geometric mean of the axes (Eq. 1).
    """
    return math.prod(list_axes_mm(grain)) ** (1 / 3)


def _choose_split(config: Config, _grain: Grain, _particle: "Particle") -> Any:
    """Choose the fractions of training, validation and test samples for the surrogate."""
    return choose_split(select_valid_sections(config).surrogate)


def _choose_mm_per_pixel(_config: Config, grain: Grain, _particle: "Particle") -> float:
    """Choose a size of the pixels that is small compared with a grain [mm]."""
    size = float(f"{compute_diameter_mm(grain) / PIXELS_A_GRAIN:.2g}")
    return min(max(size, FINEST_MM_PER_PIXEL), COARSEST_MM_PER_PIXEL)


def _choose_factory_height_mm(
    _config: Config, grain: Grain, _particle: "Particle"
) -> float:
    """Choose the height above the inlet at which grains appear: one diameter [mm]."""
    return float(f"{compute_diameter_mm(grain):.2g}")


def _choose_factory_diameter_mm(
    config: Config, grain: Grain, _particle: "Particle"
) -> float:
    """Choose the diameter of the disc in which grains appear [mm].

    The disc leaves a margin of half a grain on each side of the inlet, but has at least
    half the diameter of the inlet.
    """
    inlet_mm = select_valid_sections(config).funnel.inlet_diameter_mm
    longest_axis_mm = max(list_axes_mm(grain))
    disc_mm = max(inlet_mm - longest_axis_mm, 0.5 * inlet_mm)
    return float(f"{disc_mm:.3g}")


def _estimate_duration_s(config: Config, grain: Grain, particle: "Particle") -> float:
    """Estimate how long all grains take to run out, fall and come to rest [s].

    The flow is the rate at which grains are poured into the funnel, or the discharge of
    its outlet by Beverloo's law, whichever is smaller. If the outlet is too narrow for
    this law, only the rate of pouring counts.

    Parameters
    ----------
    config : mapping
        The configuration.
    grain : mapping
        The mean grain, as in berry.json.
    particle : Particle
        The body of the mean grain.

    Returns
    -------
    float
        The duration, rounded up to a tenth of a second.
    """
    settings = select_valid_sections(config)
    funnel = settings.funnel
    gravity_m_s2 = settings.simulation.gravity_m_s2

    # Compute the time until the last grain has run out.
    discharge_per_s = _compute_discharge_per_s(config, grain, particle)
    flow_per_s = funnel.rate_per_s
    if discharge_per_s > 0.0:
        flow_per_s = min(flow_per_s, discharge_per_s)
    pour_s = funnel.berries / flow_per_s

    # Compute the time of its fall from the inlet of the funnel. Another rule reports a
    # negative height, so treat it as 0 here.
    inlet_height_m = funnel.funnel.inlet_height_m
    fall_m = max(inlet_height_m, 0.0)
    fall_s = math.sqrt(2 * fall_m / gravity_m_s2)

    # Compute the time until the pile rests. It is a multiple of the time unit of the
    # grain, in which the grain falls by half its diameter.
    time_unit_s = _make_grain_scale(config, particle).time_s
    rest_s = round_to_digits(REST_TIME * time_unit_s, digits=2)

    duration_s = pour_s + fall_s + rest_s
    return math.ceil(10 * duration_s) / 10


def _compute_discharge_per_s(
    config: Config, grain: Grain, particle: "Particle"
) -> float:
    """Compute how many grains run out of the funnel in a second, by Beverloo's law.

    The law gives the mass per second, C rho sqrt(g) (D - k d)^(5/2), with the bulk
    density rho and the diameters D of the opening and d of a grain. The result is 0 for
    an opening too narrow for it.
    """
    settings = select_valid_sections(config)
    gravity_m_s2 = settings.simulation.gravity_m_s2
    empty_edge_mm = BEVERLOO_EDGE_DIAMETERS * compute_diameter_mm(grain)
    opening_m = 1e-3 * (settings.funnel.outlet_diameter_mm - empty_edge_mm)
    bulk_density_kg_m3 = PACKING * grain["density_kg_m3"]
    return (
        BEVERLOO_FACTOR
        * bulk_density_kg_m3
        * math.sqrt(gravity_m_s2)
        * max(opening_m, 0.0) ** 2.5
        / particle.mass_kg
    )


def _make_grain_scale(config: Config, particle: "Particle") -> GrainScale:
    """Make the units of length, time and energy that belong to the grain."""
    return GrainScale.of(
        particle, select_valid_sections(config).simulation.gravity_m_s2
    )


def _choose_rest_energy_j(config: Config, _grain: Grain, particle: "Particle") -> float:
    """Choose a small fraction of the energy that lifts a grain by its diameter [J]."""
    return round_to_digits(
        REST_ENERGY * _make_grain_scale(config, particle).energy_j, digits=2
    )


def _choose_rest_motion_mm(
    config: Config, _grain: Grain, particle: "Particle"
) -> float:
    """Choose a fraction of the diameter of a grain [mm]."""
    diameter_m = _make_grain_scale(config, particle).diameter_m
    return round_to_digits(REST_MOTION * 1e3 * diameter_m, digits=2)


def _choose_rest_window_s(config: Config, _grain: Grain, particle: "Particle") -> float:
    """Choose a multiple of the time in which a grain falls by half its diameter [s]."""
    return round_to_digits(
        REST_WINDOW * _make_grain_scale(config, particle).time_s, digits=2
    )


def _choose_time_step_s(config: Config, grain: Grain, particle: "Particle") -> float:
    """Choose the longest time step that the engine allows, with a margin [s]."""
    return advise_time_step_s(find_longest_step(config, particle, grain).time_step_s)


COMPUTED_SETTINGS = (
    ComputedSetting("network", "split", reads=("surrogate",), compute=_choose_split),
    ComputedSetting(
        "measure", "mm_per_pixel", reads=("berry",), compute=_choose_mm_per_pixel
    ),
    ComputedSetting(
        "funnel",
        "factory_height_mm",
        reads=("berry",),
        compute=_choose_factory_height_mm,
    ),
    ComputedSetting(
        "funnel",
        "factory_diameter_mm",
        reads=("berry", "funnel"),
        compute=_choose_factory_diameter_mm,
    ),
    ComputedSetting(
        "funnel",
        "rest_motion_mm",
        reads=("berry", "simulation"),
        compute=_choose_rest_motion_mm,
    ),
    ComputedSetting(
        "funnel",
        "rest_window_s",
        reads=("berry", "simulation"),
        compute=_choose_rest_window_s,
    ),
    ComputedSetting(
        "simulation",
        "rest_energy_j",
        reads=("berry", "simulation"),
        compute=_choose_rest_energy_j,
    ),
    ComputedSetting(
        "funnel",
        "duration_s",
        reads=("berry", "funnel", "simulation"),
        compute=_estimate_duration_s,
    ),
    ComputedSetting(
        "simulation",
        "time_step_s",
        reads=("berry", "wall", "parameters", "validation", "simulation"),
        compute=_choose_time_step_s,
    ),
)

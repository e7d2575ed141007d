"""Numbers that follow from other keys: an `auto` is replaced by its number when the configuration is resolved.

Only files that a user writes hold `auto`; files that a study writes hold the number.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from repose.bench.funnel import PACKING
from repose.bench.parameters import ALLOWED, PARAMETERS, named
from repose.calibrate.parameter_space import range_of
from repose.calibrate.study_file import split_of
from repose.common.keys import Config
from repose.common.section import AUTO
from repose.config.models import valid_sections
from repose.stages.published import published_sets

if TYPE_CHECKING:
    from repose.dem.time_steps import Limit
    from repose.grain.particle import Particle

PIXELS_A_GRAIN = (
    32  # of a simulated pile's pictures, over the grain's equivalent diameter
)
PIXELS_MM = (0.02, 5.0)  # allowed range of measure.mm_per_pixel
STEP_SHARE = 0.8  # of the longest time step, for the sake of what the limits leave out
REST_S = 1.5  # from the last grain on the pile until the pile rests

Grain = Mapping[str, Any]  # result of the verb `berry`


class Computed(NamedTuple):
    """A key that may be `auto`."""

    section: str
    name: str
    reads: tuple[
        str, ...
    ]  # sections that the number follows from, and keys outside sections
    of: Callable[
        [Config, Any, Any], Any
    ]  # (config, berry, particle), the last two None unless `needs_grain`

    @property
    def key(self) -> str:
        """The dotted key."""
        return f"{self.section}.{self.name}"

    @property
    def needs_grain(self) -> bool:
        """Whether the number follows from the grain."""
        return "berry" in self.reads


def to_compute(config: Config) -> list[Computed]:
    """List settings that are `auto` or missing, in the order of computation; the configuration may have faults."""
    given = [(setting, config.get(setting.section)) for setting in COMPUTED]
    return [
        one
        for one, section in given
        if isinstance(section, Mapping) and section.get(one.name, AUTO) == AUTO
    ]


def filled(config: Config, setting: Computed, value: Any) -> dict[str, Any]:
    """Copy a configuration, with a number in place of its `auto`."""
    return {**config, setting.section: {**config[setting.section], setting.name: value}}


def longest_step(config: Config, particle: "Particle", mean: Grain) -> "Limit":
    """Find the longest time step that the engine takes for all parameter sets of a study; `mean` is the mean grain."""
    from repose.bench import Scene
    from repose.bench.scene import longest_time_step

    settings = valid_sections(config)
    ranges = {
        name: range_of(name, entry, ALLOWED)
        for name, entry in settings.parameters.given.items()
    }
    sets = [{name: ranges[name][0] for name in PARAMETERS}]
    sets += published_sets(settings.validation.published)
    lowest = {name: min(values[name] for values in sets) for name in PARAMETERS}
    # cohesion makes contacts stiffer, restitution alone less damped
    strongest = {name: ranges[name][1] for name in named(ranges)[len(PARAMETERS) :]}
    return longest_time_step(Scene.of(config, lowest | strongest, mean, particle))


def advised_step_s(longest_s: float) -> float:
    """Recommend a time step: `STEP_SHARE` of the longest one, two digits, rounded down."""
    unit = 10.0 ** (math.floor(math.log10(STEP_SHARE * longest_s)) - 1)
    return float(f"{math.floor(STEP_SHARE * longest_s / unit) * unit:.2g}")


def axes_mm(grain: Grain) -> Sequence[float]:
    """Return the axes of the mean grain, the longest first, from the result of the verb `berry`."""
    return [grain[name] for name in ("long_mm", "major_mm", "minor_mm")]


def diameter_mm(grain: Grain) -> float:
    """Compute the equivalent diameter of the mean grain, the geometric mean of its axes (Eq. 1)."""
    return math.prod(axes_mm(grain)) ** (1 / 3)


def _mm_per_pixel(_config: Config, grain: Grain, _particle: "Particle") -> float:
    """Choose pixels so small that a grain is round in the picture."""
    low, high = PIXELS_MM
    return min(max(float(f"{diameter_mm(grain) / PIXELS_A_GRAIN:.2g}"), low), high)


def _factory_diameter_mm(config: Config, grain: Grain, _particle: "Particle") -> float:
    """Choose the inlet's disc less half a grain all around."""
    inlet = valid_sections(config).funnel.inlet_diameter_mm
    return float(f"{max(inlet - max(axes_mm(grain)), 0.5 * inlet):.3g}")


def _duration_s(config: Config, grain: Grain, particle: "Particle") -> float:
    """Estimate the time until all grains are poured, have run out, have fallen and rest.

    Grains run out of an opening D at 0.58 rho_b sqrt(g) (D - 1.4 d)^2.5 in mass (Beverloo). A pour that is faster than
    this lasts as long as the discharge. Where the opening is too narrow for this law the rate of pouring counts.
    """
    settings = valid_sections(config)
    funnel, gravity = settings.funnel, settings.simulation.gravity_m_s2
    opening = 1e-3 * (funnel.outlet_diameter_mm - 1.4 * diameter_mm(grain))
    bulk = PACKING * grain["density_kg_m3"]
    running = (
        0.58 * bulk * math.sqrt(gravity) * max(opening, 0.0) ** 2.5 / particle.mass_kg
    )
    rate = min(funnel.rate_per_s, running or math.inf)
    height = max(
        funnel.funnel.inlet_height_m, 0.0
    )  # a rule refuses an inlet below the outlet
    return (
        math.ceil(
            10 * (funnel.berries / rate + math.sqrt(2 * height / gravity) + REST_S)
        )
        / 10
    )


def _time_step_s(config: Config, grain: Grain, particle: "Particle") -> float:
    """Return the longest time step that the engine takes, less a margin."""
    return advised_step_s(longest_step(config, particle, grain).time_step_s)


COMPUTED = (
    Computed(
        "network",
        "split",
        ("surrogate",),
        lambda config, *_: split_of(valid_sections(config).surrogate),
    ),
    Computed("measure", "mm_per_pixel", ("berry",), _mm_per_pixel),
    Computed(
        "funnel",
        "factory_height_mm",
        ("berry",),
        lambda _, grain, __: float(f"{diameter_mm(grain):.2g}"),
    ),
    Computed(
        "funnel", "factory_diameter_mm", ("berry", "funnel"), _factory_diameter_mm
    ),
    Computed("funnel", "duration_s", ("berry", "funnel", "simulation"), _duration_s),
    Computed(
        "simulation",
        "time_step_s",
        ("berry", "wall", "parameters", "validation", "simulation"),
        _time_step_s,
    ),
)

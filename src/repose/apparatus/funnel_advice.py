"""Advice before a study pours: how soft the grains may be, and whether they fill the pile of the targets."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from repose.apparatus.funnel_pour import NAME
from repose.apparatus.settings import SimulationSettings

if TYPE_CHECKING:
    from repose.particle.particle import Particle

Config = Mapping[str, Any]

# Share of a pile's volume that grains fill, as poured.
PACKING = 0.6
# A softer grain shortens the pile; this share of the Height is far below the scatter of piles.
LARGEST_SINKING = 0.005
# Slopes that poured grains take; a cone that needs another one has too few grains, or too many.
SLOPES_DEG = (15.0, 45.0)
# A volume within this factor of the cone's: real piles have a rounded top and a tail at the foot.
VOLUME_FACTOR = 1.5


def sentences(
    config: Config,
    berry: Mapping[str, Any],
    particle: "Particle",
    longest_step_s: Callable[[Mapping[str, Any]], float],
) -> Iterator[str]:
    """What to know of stiffness and volume of the grains before they are poured.

    Parameters
    ----------
    config, berry, particle, longest_step_s
        As in `repose.apparatus.bench_test.BenchTest.advice`.

    Yields
    ------
    str
    """
    yield f"stiffness: {_softer(config, berry, longest_step_s)}"
    sentence, fits = filling(config, particle.volume_m3)
    yield f"volume: {'' if fits else 'WARNING: '}{sentence}"


def _softer(config, berry, longest_step_s):
    """How far the shear modulus may be lowered, what it costs and what it brings."""
    step, given = SimulationSettings.of(config).time_step_s, berry["shear_modulus_pa"]
    sinking, softest = softening(config, berry)
    now = f"the pile sinks by {100 * sinking:.2g} % of its Height under its own weight"
    if softest >= given:
        return f"{now}; berry.shear_modulus_pa, {given:.3g}, should not be lower"
    longest = longest_step_s({**berry, "shear_modulus_pa": softest})
    return (
        f"{now}; with berry.shear_modulus_pa {softest:.2g} instead of {given:.3g} it sinks by "
        f"{100 * LARGEST_SINKING:.2g} %, simulation.time_step_s may be {longest:.2g} s, and a run takes "
        f"{step / longest:.2g} of the time"
    )


class Softening(NamedTuple):
    """What the stiffness of the grains costs.

    Attributes
    ----------
    sinking : float
        Share of its Height that a pile loses under its own weight.
    softest_pa : float
        Shear modulus at which it loses `LARGEST_SINKING`.
    """

    sinking: float
    softest_pa: float


def softening(config: Config, berry: Mapping[str, Any]) -> Softening:
    """How much a pile gives way under its own weight, and the softest grain whose pile hardly does.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    berry : mapping
        What the verb ``berry`` writes.

    Returns
    -------
    Softening

    Notes
    -----
    A grain of diameter d at depth z carries the weight above its own area, F = p rho g z d^2, with p the packing. By
    Hertz two such grains approach each other by (3 F / (4 E* sqrt(d/4)))^(2/3). The mean of this over the depth is 3/5
    of that at the bottom. Over d it is the share of the Height that is lost, and goes as the modulus to -2/3.
    """
    diameter_m = 1e-3 * math.prod(berry[key] for key in ("long_mm", "major_mm", "minor_mm")) ** (1 / 3)
    gravity = SimulationSettings.of(config).gravity_m_s2
    pressure = PACKING * berry["density_kg_m3"] * gravity * height_m(config)
    young = berry["shear_modulus_pa"] / (1 - berry["poisson_ratio"])
    approach = (3 * pressure * diameter_m**2 / (4 * young * math.sqrt(diameter_m / 4))) ** (2 / 3)
    sinking = 0.6 * approach / diameter_m
    return Softening(sinking, berry["shear_modulus_pa"] * (sinking / LARGEST_SINKING) ** 1.5)


def poured_volume_m3(config: Config, grain_m3: float) -> float:
    """Volume of the grains of a pour, the gaps between them included.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    grain_m3 : float
        Volume of a grain.

    Returns
    -------
    float
    """
    return config[NAME]["berries"] * grain_m3 / PACKING


def height_m(config: Config) -> float:
    """Height of the pile: the target, or half the outlet's height where it is none.

    Parameters
    ----------
    config : mapping
        The whole configuration.

    Returns
    -------
    float
        In metres.
    """
    found = _target(config, "height_mm")
    return 1e-3 * (0.5 * config[NAME]["outlet_height_mm"] if found is None else found)


def filling(config: Config, grain_m3: float) -> tuple[str, bool]:
    """Whether the grains of a pour fill the pile of the targets.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    grain_m3 : float
        Volume of a grain.

    Returns
    -------
    sentence : str
    fits : bool
    """
    poured, height, angle = (
        poured_volume_m3(config, grain_m3),
        _target(config, "height_mm"),
        _target(config, "aor_deg"),
    )
    holds = f"{config['funnel']['berries']} grains hold {_litres(poured)} as poured"
    if height is None and angle is None:
        return holds, True
    if height is None:
        slope = math.tan(math.radians(angle))
        reached = (3 * poured * slope**2 / math.pi) ** (1 / 3)
        return f"{holds}: a cone of {angle:g} deg and {1e3 * reached:.3g} mm Height", True
    if angle is None:
        needed = math.degrees(math.atan(math.sqrt(math.pi * (1e-3 * height) ** 3 / (3 * poured))))
        low, high = SLOPES_DEG
        sentence = f"{holds}: a cone of {height:g} mm Height with a slope of {needed:.3g} deg"
        if low <= needed <= high:
            return sentence, True
        wanted = [
            math.pi * (1e-3 * height) ** 3 / (3 * math.tan(math.radians(one)) ** 2) for one in (high, low)
        ]
        return (
            f"{sentence}; poured grains take {low:g} to {high:g} deg: {_needed(config, grain_m3, wanted)}",
            False,
        )
    cone = math.pi * (1e-3 * height) ** 3 / (3 * math.tan(math.radians(angle)) ** 2)
    sentence = f"{holds}; the cone of {angle:g} deg and {height:g} mm Height holds {_litres(cone)}"
    if 1 / VOLUME_FACTOR <= poured / cone <= VOLUME_FACTOR:
        return sentence, True
    return f"{sentence}: {_needed(config, grain_m3, [cone])}", False


def _needed(config, grain_m3, volumes_m3):
    """The key to change, for volumes of a pile."""
    numbers = [math.ceil(PACKING * volume / grain_m3) for volume in volumes_m3]
    wanted = " to ".join(f"{number}" for number in numbers)
    return f"funnel.berries would have to be {wanted}, or the targets are those of another pour"


def _target(config, response):
    """Value of a target of the funnel, None where it is none."""
    return next((one["value"] for one in config["targets"] if one["response"] == response), None)


def _litres(volume_m3):
    """A volume in words."""
    return f"{1e3 * volume_m3:.3g} l" if volume_m3 >= 1e-3 else f"{1e6 * volume_m3:.3g} ml"

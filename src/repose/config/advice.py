"""Hints on the scene of the funnel before a study pours: stiffness, volume and number of its grains."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from repose.bench import scene_size
from repose.bench.funnel import NAME, PACKING, FunnelSettings
from repose.bench.settings import CREEPING_LAWS, SceneSettings
from repose.common.keys import Config
from repose.config.computed import Grain, diameter_mm
from repose.grain.particle import Particle

# A softer grain shortens the pile; this share of the Height is far below the scatter of piles.
LARGEST_SINKING = 0.005
# Slopes that poured grains take; a cone that needs another one has too few grains, or too many.
SLOPES_DEG = (15.0, 45.0)
# A volume within this factor of the cone's fills it: real piles have a rounded top and a tail at the foot.
VOLUME_FACTOR = 1.5


def of_funnel(
    config: Config,
    grain: Grain,
    particle: Particle,
    longest_s: Callable[[Grain], float],
) -> Iterator[str]:
    """Yield hints on stiffness, volume and number of the grains before they are poured.

    `longest_s(grain)` is the longest time step [s] for such grains.
    """
    if (law := SceneSettings(config).simulation.rolling_law) in CREEPING_LAWS:
        yield f"rolling law: WARNING: {law} lets grains creep where a torque acts, so runs may end not_at_rest"
    yield f"stiffness: {_softer(config, grain, longest_s)}"
    sentence, fits = filling(config, particle.volume_m3)
    yield f"volume: {sentence}"
    height_mm, (funnel, _, _) = 1e3 * height_m(config, grain), _wanted(config)
    outlet_mm = funnel.outlet_height_mm
    if height_mm > outlet_mm:
        yield f"funnel: WARNING: a pile of {height_mm:.3g} mm reaches the outlet at {outlet_mm:g} mm and stops the flow"
    grains = max(
        funnel.berries, 0 if fits else needed_grains(config, particle.volume_m3)
    )
    yield from scene_size.advice(config, diameter_mm(grain), height_mm, grains)


def _softer(config: Config, grain: Grain, longest_s: Callable[[Grain], float]) -> str:
    """Describe the allowed reduction of the shear modulus, with its effect on the pile and on the time step."""
    step, modulus = (
        SceneSettings(config).simulation.time_step_s,
        grain["shear_modulus_pa"],
    )
    sinking, softest = softening(config, grain)
    now = f"the pile sinks by {100 * sinking:.2g} % of its Height under its own weight"
    if softest >= modulus:
        return f"{now}; berry.shear_modulus_pa, {modulus:.3g}, should not be lower"
    longest = longest_s({**grain, "shear_modulus_pa": softest})
    softer = f"berry.shear_modulus_pa {softest:.3g} instead of {modulus:.3g} it sinks by {100 * LARGEST_SINKING:.2g} %"
    saved = f"simulation.time_step_s may be {longest:.2g} s, and a run takes {step / longest:.2g} of the time"
    return f"{now}; with {softer}, {saved}"


class Softening(NamedTuple):
    """Effect of the stiffness of the grains."""

    sinking: float  # share of its Height that a pile loses under its own weight
    softest_pa: float  # shear modulus at which it loses `LARGEST_SINKING`


def softening(config: Config, grain: Grain) -> Softening:
    """Compute how far a pile sinks under its own weight, and the softest grain whose pile hardly sinks.

    A grain of diameter d at depth z carries the weight above its own area, F = p rho g z d^2, with p the packing.
    By Hertz two such grains approach each other by (3 F / (4 E* sqrt(d/4)))^(2/3). The mean of this over the depth
    is 3/5 of that at the bottom. Over d it is the share of the Height that is lost, and goes as the modulus to
    -2/3.
    """
    diameter_m = 1e-3 * diameter_mm(grain)
    gravity = SceneSettings(config).simulation.gravity_m_s2
    pressure = PACKING * grain["density_kg_m3"] * gravity * height_m(config, grain)
    young = grain["shear_modulus_pa"] / (1 - grain["poisson_ratio"])
    approach = (
        3 * pressure * diameter_m**2 / (4 * young * math.sqrt(diameter_m / 4))
    ) ** (2 / 3)
    sinking = 0.6 * approach / diameter_m
    return Softening(
        sinking, grain["shear_modulus_pa"] * (sinking / LARGEST_SINKING) ** 1.5
    )


def height_m(config: Config, grain: Grain) -> float:
    """Return the expected pile height: the target, else from the angle, else half the outlet's height."""
    funnel, height_mm, angle_deg = _wanted(config)
    if height_mm is not None:
        return 1e-3 * height_mm
    if angle_deg is not None:
        grain_m3 = math.pi / 6 * (1e-3 * diameter_mm(grain)) ** 3
        return _cone_height_m(funnel.berries * grain_m3 / PACKING, angle_deg)
    return 0.5e-3 * funnel.outlet_height_mm


def _cone_height_m(volume_m3: float, angle_deg: float) -> float:
    """Return the height of a cone with a volume and a slope."""
    return (3 * volume_m3 * math.tan(math.radians(angle_deg)) ** 2 / math.pi) ** (1 / 3)


def filling(config: Config, grain_m3: float) -> tuple[str, bool]:
    """Say in a sentence whether the grains of a pour fill the pile of the targets, and return whether they do."""
    funnel, height, angle = _wanted(config)
    poured = funnel.berries * grain_m3 / PACKING  # with the gaps between the grains
    holds = f"{funnel.berries} grains hold {_litres(poured)} as poured"
    if height is None:
        if angle is None:
            return holds, True
        return (
            f"{holds}: a cone of {angle:g} deg and {1e3 * _cone_height_m(poured, angle):.3g} mm Height",
            True,
        )
    if angle is None:
        slope = math.degrees(
            math.atan(math.sqrt(math.pi * (1e-3 * height) ** 3 / (3 * poured)))
        )
        low, high = SLOPES_DEG
        sentence = (
            f"{holds}: a cone of {height:g} mm Height with a slope of {slope:.3g} deg"
        )
        if low <= slope <= high:
            return sentence, True
        return f"WARNING: {sentence}; poured grains take {low:g} to {high:g} deg", False
    cone = math.pi * (1e-3 * height) ** 3 / (3 * math.tan(math.radians(angle)) ** 2)
    fits = (
        1 / VOLUME_FACTOR <= poured / cone <= VOLUME_FACTOR
    )  # `repose.bench.reach` judges the pair itself
    return (
        f"{holds}; the cone of {angle:g} deg and {height:g} mm Height holds {_litres(cone)}",
        fits,
    )


def needed_grains(config: Config, grain_m3: float) -> int:
    """Count the grains implied by the targets, clipped towards the configured count, which holds without a Height."""
    funnel, height, angle = _wanted(config)
    if height is None:
        return funnel.berries
    low, high = SLOPES_DEG if angle is None else (angle, angle)
    fewest, most = (
        math.ceil(
            PACKING
            * math.pi
            * (1e-3 * height) ** 3
            / (3 * math.tan(math.radians(slope)) ** 2)
            / grain_m3
        )
        for slope in (high, low)
    )
    return min(max(funnel.berries, fewest), most)


def _wanted(config: Config) -> tuple[FunnelSettings, float | None, float | None]:
    """Return the section of the funnel, and the targets' Height [mm] and angle [deg], each None if it is no target."""
    settings = SceneSettings(config)
    values = {
        target["response"]: target["value"] for target in settings.targets_of(NAME)
    }
    return (
        settings.section(NAME, FunnelSettings),
        values.get("height_mm"),
        values.get("aor_deg"),
    )


def _litres(volume_m3: float) -> str:
    """Write a volume as text."""
    return (
        f"{1e3 * volume_m3:.3g} l" if volume_m3 >= 1e-3 else f"{1e6 * volume_m3:.3g} ml"
    )

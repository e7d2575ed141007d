"""The data of an export: a sphere or a clump, materials, contacts and the pour, independent of any program."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from repose import dem
from repose.bench import Scene
from repose.bench.funnel import Funnel, FunnelSettings
from repose.bench.parameters import FURTHER
from repose.bench.scene import longest_time_step, materials_of
from repose.bench.settings import SceneSettings, SimulationSettings
from repose.common.errors import require
from repose.dem.laws import hertz_mindlin
from repose.dem.materials import effective_moduli
from repose.dem.rotations import sphere_directions

if TYPE_CHECKING:
    from repose.grain.particle import Particle

# Other programs damp each contact of a clump by itself, and a hit by the velocity of half a step before: with our whole
# step e is 0.474 for 0.5 in LAMMPS and 0.478 in Yade, with half of it 0.488 and 0.501.
SHARE = 0.5
RAYLEIGH_SHARE = 0.2
# Overlap over effective radius at which a contact is as stiff as the spring of constant stiffness that replaces it.
TYPICAL_OVERLAP = 0.01


@dataclass(frozen=True)
class Pair:
    """Contact of two materials, with the calibrated coefficients."""

    restitution: float
    static_friction: float
    rolling_friction: float
    damping_ratio: (
        float  # beta of this restitution: `dem.laws.hertz_mindlin.damping_ratio`
    )
    effective_young_pa: float  # E*
    effective_shear_pa: float  # G*
    effective_radius_m: (
        float  # R* of two spheres of the mean radius, or of one on a wall
    )
    constants: Mapping[str, float]  # further ones of the contact law: `dem.constants`

    @property
    def tangential_stiffness_n_m(self) -> float:
        """8 G* sqrt(R* delta) at an overlap of 1 % of R* [N/m]."""
        return (
            8.0
            * self.effective_shear_pa
            * math.sqrt(TYPICAL_OVERLAP)
            * self.effective_radius_m
        )


@dataclass(frozen=True)
class Job:
    """The grain and its bench test; vectors in the body's principal axes, the centre of mass at the origin."""

    label: str  # of the study
    particle: "Particle"  # of spheres
    mean_radius_m: float  # of the spheres, weighted by free surface
    lever_m: float  # mean distance of the surface from the centre, by area: lever of the rolling resistance
    grain: dem.Material
    wall: dem.Material
    grains: Pair  # grain with grain
    on_wall: Pair  # grain with wall
    simulation: SimulationSettings
    funnel: FunnelSettings
    time_step_s: float  # advised, see `make`
    rayleigh_s: float  # Rayleigh time of the smallest sphere
    seed: int
    notes: tuple[str, ...]  # features of the study that the deck cannot represent

    @property
    def is_sphere(self) -> bool:
        """Whether the grain is one sphere and not a clump."""
        return len(self.particle.spheres_m) == 1

    @property
    def pairs(self) -> dict[str, Pair]:
        """The pairs by the end of their parameters' names."""
        return {"gg": self.grains, "gp": self.on_wall}

    @property
    def surfaces(self) -> Funnel:
        """The inner surfaces of the funnel."""
        return self.funnel.funnel

    @property
    def plate_radius_m(self) -> float:
        """Radius of the plate [m]."""
        return 0.5e-3 * self.funnel.plate_diameter_mm

    @property
    def factory_height_m(self) -> float:
        """Height at which the grains' centres appear [m]."""
        return self.surfaces.inlet_height_m + 1e-3 * self.funnel.factory_height_mm

    def steps(self, seconds: float) -> int:
        """Return the number of time steps of a duration."""
        return round(seconds / self.time_step_s)


def make(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    particle: "Particle",
    grain: Mapping[str, Any],
    seed: int = 1,
    one_sphere: bool = False,
) -> Job:
    """Make the export of a study: `config` is whole, `grain` is the file of the stage ``berry``.

    `particle` is a multisphere or a sphere; with `one_sphere` any other becomes the sphere of its volume. The advised
    time step is at most half of the longest step that this engine allows the grain, half of the study's own,
    and a fifth of the Rayleigh time of the smallest sphere.
    """
    scene = Scene.of(config, parameters, grain, particle)
    simulation, funnel = (
        scene.settings.simulation,
        scene.settings.section("funnel", FunnelSettings),
    )
    notes = list(_notes(scene.settings, funnel))
    if one_sphere or is_sphere(particle):
        own, particle = particle, sphere_of_volume(particle)
        scene = replace(scene, particle=particle)
        if not is_sphere(own):
            notes.append(
                f"every grain is the sphere of its volume, radius {1e3 * particle.bounding_radius_m:.4g} mm"
            )
        elif not np.allclose(own.inertia_kg_m2, particle.inertia_kg_m2, rtol=0.01):
            notes.append(
                "the moment of inertia is 2/5 m R^2 of a sphere; the study's grain has that of its mesh"
            )
    require(
        particle.is_clump,
        "particle",
        "kind",
        particle.kind,
        "multisphere: other programs take spheres",
    )
    materials = materials_of(scene)
    mean_radius, lever = surface_means(particle.spheres_m)
    rayleigh = rayleigh_time_s(
        materials["berry"],
        particle.density_kg_m3,
        float(particle.spheres_m[:, 3].min()),
    )
    step = min(
        SHARE * min(longest_time_step(scene).time_step_s, simulation.time_step_s),
        RAYLEIGH_SHARE * rayleigh,
    )

    def pair(suffix: str, other: str, effective_radius: float) -> Pair:
        restitution = parameters[f"e_{suffix}"]
        further = {
            name: of
            for name, of in FURTHER.items()
            if of.pair == suffix and name in parameters
        }
        return Pair(
            restitution,
            parameters[f"mus_{suffix}"],
            parameters[f"mur_{suffix}"],
            hertz_mindlin.damping_ratio(restitution, simulation.tension),
            *effective_moduli(materials["berry"], materials[other]),
            effective_radius,
            {of.constant.name: parameters[name] for name, of in further.items()},
        )

    pairs = pair("gg", "berry", 0.5 * mean_radius), pair("gp", "wall", mean_radius)
    of_grain = (
        config["label"],
        particle,
        mean_radius,
        lever,
        materials["berry"],
        materials["wall"],
        *pairs,
    )
    return Job(
        *of_grain,
        simulation,
        funnel,
        float(f"{step:.2g}"),
        rayleigh,
        seed,
        tuple(notes),
    )


def is_sphere(particle: "Particle") -> bool:
    """Tell whether a particle is one sphere: a clump of one, or an ellipsoid whose axes differ by less than 0.1 %."""
    if particle.is_clump:
        return len(particle.spheres_m) == 1
    axes = particle.semi_axes_m
    return len(axes) == 1 and bool(np.ptp(axes) <= 1e-3 * axes.mean())


def sphere_of_volume(particle: "Particle") -> "Particle":
    """Make the sphere with volume and mass of a particle, a clump of one; a clump of one keeps its radius."""
    mass, volume = particle.mass_kg, particle.mass_kg / particle.density_kg_m3
    radius = (0.75 * volume / math.pi) ** (1.0 / 3.0)
    if len(particle.spheres_m) == 1:
        radius = float(particle.spheres_m[0, 3])
        volume = 4.0 / 3.0 * math.pi * radius**3
    return replace(
        particle,
        kind="multisphere",
        semi_axes_m=np.zeros((0, 3)),
        spheres_m=np.array([[0.0, 0.0, 0.0, radius]]),
        volume_m3=volume,
        density_kg_m3=mass / volume,
        inertia_kg_m2=np.full(3, 0.4 * mass * radius**2),
        bounding_radius_m=radius,
    )


def _notes(settings: SceneSettings, funnel: FunnelSettings) -> Iterator[str]:
    """Name the features of the study that no deck can represent."""
    if settings.size_distribution != "none":
        yield "the study's grains differ in size; here all are the mean grain"
    if funnel.orientation != "random":
        yield f"the study's grains appear {funnel.orientation}; here their orientation is random"
    yield "the plate here is endless; the study's ends at its edge"


def rayleigh_time_s(
    material: dem.Material, density_kg_m3: float, radius_m: float
) -> float:
    """Compute the Rayleigh time of a sphere, pi R sqrt(rho / G) / (0.1631 nu + 0.8766).

    Thornton and Randall, in: Micromechanics of Granular Materials, Elsevier (1988) 133.
    """
    root = math.sqrt(density_kg_m3 / material.shear_modulus_pa)
    return math.pi * radius_m * root / (0.1631 * material.poisson_ratio + 0.8766)


def surface_means(spheres_m: np.ndarray, points: int = 2000) -> tuple[float, float]:
    """Average the radius and the distance from the centre [m] over the free surface of a clump, by area."""
    directions = sphere_directions(points)
    areas = radii = distances = 0.0
    for x, y, z, radius in spheres_m:
        at = np.array([x, y, z]) + radius * directions
        away = np.linalg.norm(at[:, None] - spheres_m[None, :, :3], axis=2)
        free = at[np.all(away >= spheres_m[:, 3] * (1.0 - 1e-9), axis=1)]
        areas += radius**2 * len(free)
        radii += radius**3 * len(free)
        distances += radius**2 * np.linalg.norm(free, axis=1).sum()
    return radii / areas, float(distances / areas)

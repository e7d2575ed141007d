"""Collect the data of an export: grain, materials, contacts and pour, in SI units."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose import dem
from repose.bench import Scene
from repose.bench.funnel import Funnel, FunnelSettings
from repose.bench.parameters import LAW_PARAMETERS
from repose.bench.scene import longest_time_step, materials_of
from repose.bench.settings import SceneSettings, SimulationSettings
from repose.common.errors import InputError
from repose.dem.laws import hertz_mindlin
from repose.dem.materials import effective_moduli
from repose.dem.rotations import sphere_directions

if TYPE_CHECKING:
    from repose.grain.particle import Particle

# Advised time step of other programs over that of this engine. These programs damp each
# contact of a clump separately, and compute the damping from the velocity half a step
# earlier. With the whole step, the restitution of 0.5 became 0.474 in LAMMPS and 0.478
# in Yade. With half the step, it became 0.488 and 0.501.
TIME_STEP_FRACTION = 0.5
# Largest advised time step as a fraction of the Rayleigh time.
RAYLEIGH_FRACTION = 0.2
# Some contacts are replaced by a spring of constant stiffness. This stiffness is that
# of the contact at this ratio of overlap to effective radius.
TYPICAL_OVERLAP = 0.01
# Relative differences between axes, and between moments of inertia, that are ignored.
AXES_TOLERANCE = 1e-3
INERTIA_TOLERANCE = 0.01
# Relative distance below the surface of a sphere that is ignored as a rounding error.
ROUNDING_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Pair:
    """The contact of two materials, with the calibrated coefficients.

    Attributes
    ----------
    restitution, static_friction, rolling_friction : float
        The coefficients.
    damping_ratio : float
        Damping ratio beta of this restitution, see
        `repose.dem.laws.hertz_mindlin.damping_ratio`.
    effective_young_pa, effective_shear_pa : float
        Effective elastic modulus E* and effective shear modulus G*.
    effective_radius_m : float
        R* of two spheres of the mean radius, or of one such sphere on a wall.
    constants : mapping
        Further constants of the contact law, see `repose.dem.constants`.
    """

    restitution: float
    static_friction: float
    rolling_friction: float
    damping_ratio: float
    effective_young_pa: float
    effective_shear_pa: float
    effective_radius_m: float
    constants: Mapping[str, float]

    @property
    def tangential_stiffness_n_m(self) -> float:
        """Tangential stiffness 8 G* sqrt(R* delta) at the `TYPICAL_OVERLAP` [N/m]."""
        return (
            8.0
            * self.effective_shear_pa
            * math.sqrt(TYPICAL_OVERLAP)
            * self.effective_radius_m
        )


@dataclass(frozen=True)
class Job:
    """The grain and its pour through the funnel.

    Vectors are given in the principal axes of the body. The origin is its centre of
    mass.

    Attributes
    ----------
    label : str
        Label of the study.
    parameters : mapping
        Contact parameters by name.
    particle : Particle
        The grain, a clump of spheres or one sphere.
    mean_radius_m : float
        Mean radius of the spheres of the grain, weighted by their free surface.
    lever_m : float
        Lever arm of the rolling resistance: the mean distance of the surface from the
        centre of mass, weighted by area.
    grain, wall : Material
        The materials.
    grains, on_wall : Pair
        Contacts of grain with grain, and of grain with wall.
    simulation : SimulationSettings
        Gravity and force laws.
    funnel : FunnelSettings
        The pour.
    time_step_s : float
        The advised time step, see `_advise_time_step_s`.
    rayleigh_s : float
        Rayleigh time of the smallest sphere.
    seed : int
        Seed of the positions of the grains.
    notes : tuple of str
        Features of the study that no other program can represent.
    """

    label: str
    parameters: Mapping[str, float]
    particle: "Particle"
    mean_radius_m: float
    lever_m: float
    grain: dem.Material
    wall: dem.Material
    grains: Pair
    on_wall: Pair
    simulation: SimulationSettings
    funnel: FunnelSettings
    time_step_s: float
    rayleigh_s: float
    seed: int
    notes: tuple[str, ...]

    @property
    def is_sphere(self) -> bool:
        """Whether the grain is one sphere and not a clump."""
        return len(self.particle.spheres_m) == 1

    @property
    def pairs(self) -> dict[str, Pair]:
        """The pairs, by the last two letters of the names of their parameters."""
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

    @property
    def factory_radius_m(self) -> float:
        """Radius of the disc in which the grains' centres appear [m]."""
        return (
            0.5e-3 * self.funnel.factory_diameter_mm - self.particle.bounding_radius_m
        )

    def count_steps(self, seconds: float) -> int:
        """Convert a duration to the nearest whole number of time steps."""
        return round(seconds / self.time_step_s)


def make_job(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    particle: "Particle",
    grain: Mapping[str, Any],
    seed: int = 1,
    one_sphere: bool = False,
) -> Job:
    """Collect the data of an export from a study into a `Job`.

    Other programs simulate only spheres. The grain must therefore be a clump of
    spheres, or is replaced by a single sphere.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    parameters : mapping
        Contact parameters by name.
    particle : Particle
        The simulated grain, that is, its shape and mass: a clump of spheres or a
        sphere. With `one_sphere`, it may have any shape.
    grain : mapping
        The measured grain, that is, its sizes and moduli, as in berry.json.
    seed : int, optional
        Seed of the positions of the grains.
    one_sphere : bool, optional
        Whether to replace the grain by a sphere of the same volume.

    Returns
    -------
    Job
        The data of the export.

    Raises
    ------
    InputError
        If the particle is neither a clump of spheres nor replaced by one sphere.
    """
    scene = Scene.of(config, parameters, grain=grain, particle=particle)
    funnel = scene.settings.section("funnel", FunnelSettings)
    notes = list(_list_missing_features(scene.settings, funnel))

    exported = particle
    if one_sphere or is_sphere(particle):
        exported = make_equal_sphere(particle)
        notes += _list_losses_of_sphere(particle, exported)
        # The time step that is computed from the scene below depends on the grain.
        scene = replace(scene, particle=exported)
    if not exported.is_clump:
        raise InputError(
            "particle",
            key="kind",
            value=exported.kind,
            allowed="multisphere: other programs take spheres",
        )

    # The lever arm of the rolling resistance is the mean distance of the surface from
    # the centre of mass. A scene calls the material of its grains "berry".
    materials = materials_of(scene)
    surface = average_over_surface(exported.spheres_m)
    rayleigh_s = compute_rayleigh_time_s(
        materials["berry"],
        exported.density_kg_m3,
        radius_m=float(exported.spheres_m[:, 3].min()),
    )
    return Job(
        label=config["label"],
        parameters=parameters,
        particle=exported,
        mean_radius_m=surface.radius_m,
        lever_m=surface.distance_m,
        grain=materials["berry"],
        wall=materials["wall"],
        # The effective radius R* of two equal spheres is half of their radius. That of
        # a sphere on a plane wall is its radius.
        grains=_make_pair(
            scene, "gg", other="berry", effective_radius_m=0.5 * surface.radius_m
        ),
        on_wall=_make_pair(
            scene, "gp", other="wall", effective_radius_m=surface.radius_m
        ),
        simulation=scene.settings.simulation,
        funnel=funnel,
        time_step_s=_advise_time_step_s(scene, rayleigh_s),
        rayleigh_s=rayleigh_s,
        seed=seed,
        notes=tuple(notes),
    )


def _advise_time_step_s(scene: Scene, rayleigh_s: float) -> float:
    """Choose the advised time step for other programs, with two digits [s].

    It is `TIME_STEP_FRACTION` of the study's time step, or of the longest step of this
    engine if that is shorter, but at most `RAYLEIGH_FRACTION` of the Rayleigh time of
    the smallest sphere.
    """
    study_step_s = scene.settings.simulation.time_step_s
    longest_s = min(longest_time_step(scene).time_step_s, study_step_s)
    advised_s = min(TIME_STEP_FRACTION * longest_s, RAYLEIGH_FRACTION * rayleigh_s)
    return float(f"{advised_s:.2g}")


def _make_pair(scene: Scene, pair: str, other: str, effective_radius_m: float) -> Pair:
    """Make the contact of the grain with another material.

    Parameters
    ----------
    scene : Scene
        The study's scene, with the calibrated parameters by name.
    pair : str
        The last two letters of the names of its parameters: ``gg`` for two grains,
        ``gp`` for grain and wall.
    other : str
        The other material, ``berry`` or ``wall``.
    effective_radius_m : float
        Effective radius R* of a contact of the mean sphere.

    Returns
    -------
    Pair
        The contact.
    """
    parameters = scene.parameters
    materials = materials_of(scene)
    young_pa, shear_pa = effective_moduli(materials["berry"], materials[other])
    restitution = parameters[f"e_{pair}"]
    # A contact law may need further constants, such as a surface energy.
    constants = {
        parameter.constant.name: parameters[name]
        for name, parameter in LAW_PARAMETERS.items()
        if parameter.pair == pair and name in parameters
    }
    return Pair(
        restitution=restitution,
        static_friction=parameters[f"mus_{pair}"],
        rolling_friction=parameters[f"mur_{pair}"],
        damping_ratio=hertz_mindlin.damping_ratio(
            restitution, scene.simulation.tension
        ),
        effective_young_pa=young_pa,
        effective_shear_pa=shear_pa,
        effective_radius_m=effective_radius_m,
        constants=constants,
    )


def is_sphere(particle: "Particle") -> bool:
    """Tell whether a particle is one sphere.

    It is if it is a clump of one sphere, or an ellipsoid whose axes differ by no more
    than the fraction `AXES_TOLERANCE`.
    """
    if particle.is_clump:
        return len(particle.spheres_m) == 1
    axes = particle.semi_axes_m
    return len(axes) == 1 and bool(np.ptp(axes) <= AXES_TOLERANCE * axes.mean())


def make_equal_sphere(particle: "Particle") -> "Particle":
    """Make a clump of one sphere with the volume and the mass of a particle.

    If the particle is already a clump of one sphere, the sphere keeps its radius, and
    the volume is computed from this radius.
    """
    mass_kg = particle.mass_kg
    # A solid sphere has the moment of inertia 2/5 m r^2. The copy keeps the particle's
    # distance from the measured mesh, because no input file states it.
    if len(particle.spheres_m) == 1:
        radius_m = float(particle.spheres_m[0, 3])
        volume_m3 = 4.0 / 3.0 * math.pi * radius_m**3
    else:
        volume_m3 = mass_kg / particle.density_kg_m3
        radius_m = (0.75 * volume_m3 / math.pi) ** (1.0 / 3.0)
    return replace(
        particle,
        kind="multisphere",
        semi_axes_m=np.zeros((0, 3)),
        spheres_m=np.array([[0.0, 0.0, 0.0, radius_m]]),
        volume_m3=volume_m3,
        density_kg_m3=mass_kg / volume_m3,
        inertia_kg_m2=np.full(3, 0.4 * mass_kg * radius_m**2),
        bounding_radius_m=radius_m,
    )


def _list_missing_features(
    settings: SceneSettings, funnel: FunnelSettings
) -> Iterator[str]:
    """Yield a sentence for each feature of the study that no program can represent."""
    if settings.size_distribution != "none":
        yield "the study's grains differ in size; here all are the mean grain"
    if funnel.orientation != "random":
        yield (
            f"the study's grains appear {funnel.orientation}; here their orientation is "
            "random"
        )
    yield "the plate here is endless; the study's ends at its edge"


def _list_losses_of_sphere(particle: "Particle", sphere: "Particle") -> Iterator[str]:
    """Yield a sentence if the sphere that replaces the grain differs from the grain."""
    if not is_sphere(particle):
        radius_mm = 1e3 * sphere.bounding_radius_m
        yield f"every grain is the sphere of its volume, radius {radius_mm:.4g} mm"
    elif not np.allclose(
        particle.inertia_kg_m2, sphere.inertia_kg_m2, rtol=INERTIA_TOLERANCE
    ):
        yield (
            "the moment of inertia is 2/5 m R^2 of a sphere; the study's grain has that "
            "of its mesh"
        )


def compute_rayleigh_time_s(
    material: dem.Material, density_kg_m3: float, radius_m: float
) -> float:
    """Compute the Rayleigh time of a sphere [s].

    It is pi R sqrt(rho / G) / (0.1631 nu + 0.8766), according to Thornton and Randall,
    in: Micromechanics of Granular Materials, Elsevier (1988) 133.
    """
    root = math.sqrt(density_kg_m3 / material.shear_modulus_pa)
    return math.pi * radius_m * root / (0.1631 * material.poisson_ratio + 0.8766)


class SurfaceMeans(NamedTuple):
    """Means over the free surface of a clump, weighted by area.

    Attributes
    ----------
    radius_m : float
        Mean radius of the sphere to which a point of the surface belongs.
    distance_m : float
        Mean distance of a point of the surface from the centre of mass.
    """

    radius_m: float
    distance_m: float


def average_over_surface(spheres_m: np.ndarray, n_points: int = 2000) -> SurfaceMeans:
    """Average the radius and the distance from the centre over a clump's surface.

    Only the free surface counts, that is, the parts of the spheres' surfaces that do
    not lie inside another sphere.

    Parameters
    ----------
    spheres_m : ndarray, (M, 4)
        Centre and radius of each sphere [m]; the centre of mass is the origin.
    n_points : int
        Number of sample points on the surface of each sphere.

    Returns
    -------
    SurfaceMeans
        Both means.

    Notes
    -----
    Each sample point represents an area proportional to the squared radius of its
    sphere.
    """
    centres = spheres_m[:, :3]
    # A point is free if it is at least this far from each centre. The factor prevents
    # rounding errors from placing a point inside its own sphere. At least one point of
    # the outermost sphere is free, so the sums below are positive.
    smallest_distances = spheres_m[:, 3] * (1.0 - ROUNDING_TOLERANCE)
    directions = sphere_directions(n_points)

    # Add up radius and distance over all free points. The weight of a point is
    # radius**2, to which its area is proportional. The weighted radius is radius**3.
    area_sum = 0.0
    radius_sum = 0.0
    distance_sum = 0.0
    for x, y, z, radius in spheres_m:
        points = np.array([x, y, z]) + radius * directions
        # Distance of each point (rows) from each centre (columns).
        to_centres = np.linalg.norm(points[:, None] - centres[None], axis=2)
        is_free = np.all(to_centres >= smallest_distances, axis=1)
        free_points = points[is_free]
        area_sum += radius**2 * len(free_points)
        radius_sum += radius**3 * len(free_points)
        distance_sum += radius**2 * np.linalg.norm(free_points, axis=1).sum()
    return SurfaceMeans(radius_sum / area_sum, float(distance_sum / area_sum))

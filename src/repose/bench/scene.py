"""Describe what a run of a bench test depends on, and make its empty simulation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from repose import dem
from repose.bench.grain_scale import GrainScale
from repose.bench.parameters import LAW_PARAMETERS
from repose.bench.settings import SceneSettings, SimulationSettings
from repose.common.errors import InputError
from repose.dem.constants import TWISTING

if TYPE_CHECKING:
    from repose.dem import time_steps
    from repose.grain.particle import Particle
    from repose.measure.settings import MeasureSettings


@dataclass(frozen=True)
class Scene:
    """Everything that a run of a bench test depends on.

    Attributes
    ----------
    settings : SceneSettings
        Sections of the configuration.
    parameters : mapping
        Contact parameters by name.
    grain : mapping
        Measurements of the mean grain, as in berry.json.
    particle : Particle
        Body that represents the mean grain.
    seed : int
        Seed of the run's random numbers.
    """

    settings: SceneSettings
    parameters: Mapping[str, float]
    grain: Mapping[str, Any]
    particle: "Particle"
    seed: int = 0

    @classmethod
    def of(
        cls,
        config: Mapping[str, Any],
        parameters: Mapping[str, float],
        grain: Mapping[str, Any],
        particle: "Particle",
        seed: int = 0,
    ) -> Self:
        """Make the scene of a configuration.

        Parameters
        ----------
        config : mapping
            The configuration, with numbers in place of every ``auto``.
        parameters, grain, particle, seed
            See the attributes of the class.
        """
        return cls(SceneSettings(config), parameters, grain, particle, seed)

    def with_seed(self, seed: int) -> Self:
        """Return the same scene with another seed."""
        return replace(self, seed=seed)

    @property
    def simulation(self) -> SimulationSettings:
        """The section `simulation`; the simulation itself is `Trial.simulation`."""
        return self.settings.simulation

    @property
    def scale(self) -> GrainScale:
        """Units of length, time and energy of the mean grain."""
        return GrainScale.of(self.particle, self.simulation.gravity_m_s2)

    @property
    def measure(self) -> "MeasureSettings":
        """Settings of the measurement of a pile."""
        return self.settings.measure_of(self.grain)


def grain_simulation(scene: Scene, capacity: int, **arguments: Any) -> "dem.Simulation":
    """Make an empty simulation, to which grains of the material ``berry`` can be added.

    Parameters
    ----------
    scene : Scene
        Materials, contacts, time step, gravity and laws.
    capacity : int
        Largest number of grains.
    **arguments
        Walls, box and other arguments of `repose.dem.Simulation`.

    Raises
    ------
    InputError
        If the time step is longer than the grains allow.
    """
    settings = scene.simulation
    limit = longest_time_step(scene)
    if settings.time_step_s > limit.time_step_s:
        raise InputError(
            "configuration",
            "simulation.time_step_s",
            settings.time_step_s,
            limit.allowed,
        )
    # The values of this dict may be shapes or clumps. The annotation of the parameter
    # cannot express this for a dict.
    shapes: Any = {"berry": scene.particle.dem_shape("berry")}
    return dem.Simulation(
        shapes,
        materials_of(scene),
        contacts_of(scene.parameters),
        settings.time_step_s,
        **arguments,
        **settings.laws,
        capacity=capacity,
        gravity_m_s2=(0.0, 0.0, -settings.gravity_m_s2),
    )


def longest_time_step(scene: Scene) -> "time_steps.Limit":
    """Compute the longest time step that is stable for the smallest grain of a run.

    The limit comes from the stiffest contact of two grains, or of a grain and the wall.

    Parameters
    ----------
    scene : Scene
        The grain, its contact parameters and the settings of the simulation.

    Returns
    -------
    time_steps.Limit
        The time step [s], with a description of what limits it.
    """
    from repose.dem import time_steps
    from repose.dem.contact_table import index_contacts
    from repose.dem.laws import CONTACT_LAWS
    from repose.grain import size_distribution

    # The limit depends on all materials and contacts of the simulation.
    # `time_steps.Scene` collects them for the engine; it is another class than `Scene`
    # here. The names "berry" and "wall" are those of `materials_of`.
    materials = materials_of(scene)
    contact_scene = time_steps.Scene(
        law=CONTACT_LAWS[scene.simulation.contact_law],
        tension=scene.simulation.tension,
        materials=materials,
        contacts=index_contacts(contacts_of(scene.parameters), materials),
        shapes={"berry": scene.particle.dem_shape("berry")},
        walls=frozenset({"wall"}),
    )
    smallest_scale = size_distribution.compute_smallest_scale(
        scene.settings.size_distribution, scene.grain
    )
    return time_steps.compute_longest(contact_scene, smallest_scale=smallest_scale)


def materials_of(scene: Scene) -> "dict[str, dem.Material]":
    """Make the materials ``berry`` and ``wall`` of a scene."""
    grain = scene.grain
    wall = scene.settings.wall
    return {
        "berry": dem.Material(grain["shear_modulus_pa"], grain["poisson_ratio"]),
        "wall": dem.Material(wall.shear_modulus_pa, wall.poisson_ratio),
    }


def contacts_of(
    parameters: Mapping[str, float],
) -> "dict[tuple[str, str], dem.Contact]":
    """Make the contacts of two grains and of grain and wall, by names of materials."""
    return {
        ("berry", "berry"): _make_contact(parameters, "gg"),
        ("berry", "wall"): _make_contact(parameters, "gp"),
    }


def _make_contact(parameters: Mapping[str, float], pair: str) -> "dem.Contact":
    """Make the contact of a pair of materials.

    Parameters
    ----------
    parameters : mapping
        Contact parameters by name. The names of this pair's parameters end with `pair`.
    pair : str
        ``gg`` for two grains, or ``gp`` for a grain and a wall.
    """
    # Collect the constants of force laws that are parameters of this study.
    constants = {
        parameter.constant.name: parameters[name]
        for name, parameter in LAW_PARAMETERS.items()
        if parameter.pair == pair and name in parameters
    }
    # The friction that resists twisting has an argument of its own.
    twisting_friction = constants.pop(TWISTING.name, None)
    return dem.Contact(
        parameters[f"e_{pair}"],
        parameters[f"mus_{pair}"],
        parameters[f"mur_{pair}"],
        twisting_friction,
        constants=constants,
    )

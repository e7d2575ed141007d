"""A simulation of berries among walls of one material, frames of it on the way, and its largest cluster."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from repose import dem
from repose.apparatus.bounds import Bounded
from repose.apparatus.settings import SimulationSettings
from repose.core.errors import InputError

if TYPE_CHECKING:
    from repose.dem import time_steps
    from repose.particle.particle import Particle


def berry_simulation(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    particle: "Particle",
    berry: Mapping[str, Any],
    capacity: int,
    **scene: Any,
) -> "dem.Simulation":
    """An empty simulation of berries among walls of the material ``wall``.

    Parameters
    ----------
    config : mapping
        The whole configuration. Time step, gravity and the contact's choices are those of its section ``simulation``.
    parameters : mapping
        The six contact parameters by name.
    particle : Particle
        The berry's body.
    berry : mapping
        With ``shear_modulus_pa`` and ``poisson_ratio``.
    capacity : int
        Most berries.
    **scene
        Walls, lower, upper and the other arguments of `repose.dem.Simulation`.

    Returns
    -------
    repose.dem.Simulation
        Without a berry.

    Raises
    ------
    InputError
        If the time step is too long for the particle.
    ValueError
        If the engine refuses another value.
    """
    settings = SimulationSettings.of(config)
    limit = longest_time_step(config, parameters, particle, berry)
    if settings.time_step_s > limit.time_step_s:
        raise InputError("configuration", "simulation.time_step_s", settings.time_step_s, limit.allowed)
    shapes: Any = {"berry": particle.dem_shape("berry")}
    return dem.Simulation(
        shapes,
        materials_of(config, berry),
        _contacts(parameters),
        settings.time_step_s,
        capacity=capacity,
        gravity_m_s2=(0.0, 0.0, -settings.gravity_m_s2),
        **settings.laws,
        **scene,
    )


def longest_time_step(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    particle: "Particle",
    berry: Mapping[str, Any],
) -> "time_steps.Limit":
    """The longest time step for the berries of every bench test, the smallest ones included.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    parameters : mapping
        The six contact parameters by name; the lower a restitution, the shorter the step.
    particle : Particle
        The berry's body.
    berry : mapping
        With ``shear_modulus_pa`` and ``poisson_ratio``, and the spread of sizes where the berries have one.

    Returns
    -------
    repose.dem.time_steps.Limit
        What the engine allows, for berries of the smallest scale.
    """
    from repose.dem import time_steps
    from repose.dem.contact_table import pairs_of
    from repose.dem.laws import CONTACT_LAWS
    from repose.particle import size_distribution

    settings = SimulationSettings.of(config)
    materials = materials_of(config, berry)
    scene = time_steps.Scene(
        CONTACT_LAWS[settings.contact_law],
        settings.tension,
        materials,
        pairs_of(_contacts(parameters), materials),
        {"berry": particle.dem_shape("berry")},
        frozenset({"wall"}),
    )
    smallest = size_distribution.smallest(config["berry"]["size_distribution"], berry)
    return time_steps.longest(scene, smallest_scale=smallest)


def materials_of(config: Mapping[str, Any], berry: Mapping[str, Any]) -> "dict[str, dem.Material]":
    """The two materials.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    berry : mapping
        With ``shear_modulus_pa`` and ``poisson_ratio``.

    Returns
    -------
    dict of repose.dem.Material
        ``berry`` and ``wall``.
    """
    wall = config["wall"]
    return {
        "berry": dem.Material(berry["shear_modulus_pa"], berry["poisson_ratio"]),
        "wall": dem.Material(wall["shear_modulus_pa"], wall["poisson_ratio"]),
    }


def _contacts(parameters):
    """Their contacts by pairs of names."""
    return {
        ("berry", "berry"): dem.Contact(parameters["e_gg"], parameters["mus_gg"], parameters["mur_gg"]),
        ("berry", "wall"): dem.Contact(parameters["e_gp"], parameters["mus_gp"], parameters["mur_gp"]),
    }


class Filmed:
    """Advances a simulation to given time steps, within bounds, and records frames on the way.

    Parameters
    ----------
    bounded : Bounded
        The simulation.
    interval_s : float or None
        Simulated time between two frames [s]; None records none.
    progress : callable, optional
        Called with the simulated time.
    """

    def __init__(
        self,
        bounded: Bounded,
        interval_s: float | None = None,
        progress: Callable[[float], object] | None = None,
    ):
        simulation = bounded.simulation
        self.bounded, self.simulation, self.progress = bounded, simulation, progress
        self.every = None if interval_s is None else max(1, round(interval_s / simulation.time_step_s))
        self.recorder = None if interval_s is None else dem.Recorder()

    def run_to(self, step: int) -> None:
        """Advance to a time step.

        Parameters
        ----------
        step : int
            Nothing happens where it has passed.

        Raises
        ------
        Unstable
            If a bound is broken.
        """
        now = self.simulation.steps
        while now < step:
            stop = step if self.every is None else min(step, (now // self.every + 1) * self.every)
            self.bounded.run_to(stop)
            now = stop
            if self.recorder is not None and self.every is not None and now % self.every == 0:
                self.recorder(self.simulation)
        if self.progress is not None:
            self.progress(self.simulation.time_s)

    def frames(self) -> dict[str, np.ndarray] | None:
        """What was recorded, None where nothing was to be.

        Returns
        -------
        dict or None
            ``scale`` (N,), ``time_s`` (T,), ``position`` (T, N, 3) [m] and ``quaternion`` (T, N, 4) of all N bodies
            that there is room for; NaN where a body is not there.
        """
        if self.recorder is None:
            return None
        kept, room = self.recorder.frames(), self.simulation.capacity
        missing = room - len(kept["scale"])
        absent = ((0, 0), (0, missing), (0, 0))
        return {
            "scale": np.pad(kept["scale"], (0, missing), constant_values=1.0),
            "time_s": kept["time_s"],
            "position": np.pad(kept["position"], absent, constant_values=np.nan),
            "quaternion": np.pad(kept["quaternion"], absent, constant_values=np.nan),
        }


def largest_cluster(contacts: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Mask of the largest set of allowed bodies that contacts connect.

    Parameters
    ----------
    contacts : numpy.ndarray
        Indices of touching bodies (M, 2).
    allowed : numpy.ndarray
        Which bodies count (N,), bool.

    Returns
    -------
    numpy.ndarray
        Mask (N,); of equally large sets the one with the lowest index.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(allowed)
    if not n or not allowed.any():
        return np.zeros(n, bool)
    kept = contacts[allowed[contacts[:, 0]] & allowed[contacts[:, 1]]] if len(contacts) else contacts
    graph = coo_array((np.ones(len(kept)), (kept[:, 0], kept[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    sizes = np.bincount(label[allowed])
    return allowed & (label == sizes.argmax())

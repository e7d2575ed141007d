"""Scenes built from the engine: the funnel and its pile."""

import math
import time
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from repose.dem import Cone, Contact, Material, Plane, RingEdge, Simulation
from repose.particle.size_distribution import of_pour

# A berry is dropped at a free place; so many places are tried before the factory waits a step.
PLACES_TRIED = 200


@dataclass(frozen=True)
class Funnel:
    """Inner surfaces of a funnel whose axis is z; lengths in m, angle from the horizontal in degrees.

    The outlet's narrowest circle lies `outlet_height_m` above the plate. A tube of length `tube_length_m` may follow
    the cone. All edges are rounded with `rim_radius_m`.
    """

    inlet_diameter_m: float
    outlet_diameter_m: float
    cone_angle_deg: float
    tube_length_m: float
    rim_radius_m: float
    outlet_height_m: float

    @property
    def inlet_height_m(self):
        """Height of the inlet's circle above the plate."""
        return self._cone()[4] * math.sin(math.radians(self.cone_angle_deg)) + self._foot()[1]

    def _foot(self):
        """Point (r, z) of the cone's line from which s is measured: the foot of the normal from the axis origin."""
        slope = math.radians(self.cone_angle_deg)
        k = self._offset()
        return k * math.sin(slope), -k * math.cos(slope)

    def _edge_height(self):
        return self.outlet_height_m + self.tube_length_m

    def _offset(self):
        """Offset k of the cone: m.(r, z) = k, tangent to the rounded edge below it."""
        slope = math.radians(self.cone_angle_deg)
        core = 0.5 * self.outlet_diameter_m + self.rim_radius_m
        return math.sin(slope) * core - math.cos(slope) * self._edge_height() - self.rim_radius_m

    def _cone(self):
        slope = math.radians(self.cone_angle_deg)
        core = 0.5 * self.outlet_diameter_m + self.rim_radius_m
        along = math.cos(slope) * core + math.sin(slope) * self._edge_height()
        foot_r, foot_z = self._foot()
        top = (0.5 * self.inlet_diameter_m - foot_r) / math.cos(slope)
        top += math.cos(slope) * foot_r + math.sin(slope) * foot_z
        return (
            math.sin(slope),
            -math.cos(slope),
            self._offset(),
            along,
            top,
            math.cos(slope),
            math.sin(slope),
        )

    def walls(self, material):
        """The funnel's walls by name, of a material."""
        slope = math.radians(self.cone_angle_deg)
        radius = 0.5 * self.outlet_diameter_m
        core = radius + self.rim_radius_m
        up = (math.cos(slope), math.sin(slope))
        walls = {"cone": Cone(self._cone(), material)}
        edge = self.rim_radius_m
        if self.tube_length_m == 0.0:
            walls["outlet"] = RingEdge(core, edge, material, (up, (0.0, 0.0)), self.outlet_height_m)
        else:
            top = self._edge_height()
            walls["tube"] = Cone((1.0, 0.0, radius, self.outlet_height_m, top, 0.0, 1.0), material)
            walls["neck"] = RingEdge(core, edge, material, (up, (0.0, -1.0)), top)
            walls["outlet"] = RingEdge(core, edge, material, ((0.0, 1.0), (0.0, 0.0)), self.outlet_height_m)
        return walls


def random_quaternion(rng):
    """A uniformly random orientation (w, x, y, z)."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


@dataclass(frozen=True)
class Disc:
    """Where berries appear: a horizontal disc about the z axis; lengths in m."""

    radius_m: float
    height_m: float

    def draw(self, rng):
        """A uniformly random point of it."""
        r = self.radius_m * math.sqrt(rng.random())
        angle = 2.0 * math.pi * rng.random()
        return np.array([r * math.cos(angle), r * math.sin(angle), self.height_m])


@dataclass(frozen=True)
class Strip:
    """Where berries appear: a horizontal rectangle about the z axis; lengths in m."""

    half_x_m: float
    half_y_m: float
    height_m: float

    def draw(self, rng):
        """A uniformly random point of it."""
        x, y = rng.uniform(-1.0, 1.0, 2)
        return np.array([self.half_x_m * x, self.half_y_m * y, self.height_m])


def free_place(rng, simulation, factory):
    """A random point of a `Disc` or `Strip` where a new berry cannot touch another, or None when none was found."""
    others = simulation.positions[simulation.present]
    reach = 2.0 * simulation.radius
    others = others[others[:, 2] > factory.height_m - reach]
    for _ in range(PLACES_TRIED):
        place = factory.draw(rng)
        if not len(others) or np.min(np.sum((others - place) ** 2, axis=1)) > reach * reach:
            return place
    return None


def turned_as(orientation, rng):
    """A quaternion (w, x, y, z) of a new berry: "random", "lying" (long axis level) or "upright"; the rest random."""
    if orientation == "random":
        return random_quaternion(rng)
    axis, about = rng.uniform(0.0, 2.0 * math.pi, 2)
    # about the long axis x, then for "upright" up, then about the vertical
    q = np.array([math.cos(about / 2), math.sin(about / 2), 0.0, 0.0])
    if orientation == "upright":
        half = math.sqrt(0.5)
        q = half * np.array([q[0], q[1], -q[0], q[1]])
    c, s = math.cos(axis / 2), math.sin(axis / 2)
    w, x, y, z = q
    return np.array([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w])


def fill(simulation, rng, factory, berries, rate_per_s, last_step, run_to, scales=None, orientation="random"):
    """Add berries one by one at a rate, at rest, at free random places of the factory, oriented as `turned_as` says.

    A place where a new berry would touch another is not used; when there is none the factory waits a step. None is
    added from `last_step` on. run_to: advances the simulation to a step; scales (N,): of the berries, by default 1.
    """
    for k in range(berries):
        due = round(k / rate_per_s / simulation.physics.dt)
        if due >= last_step:
            return
        run_to(due)
        place = free_place(rng, simulation, factory)
        while place is None and simulation.steps < last_step:
            run_to(simulation.steps + 1)
            place = free_place(rng, simulation, factory)
        if place is None:
            return
        simulation.add(
            "berry", place, turned_as(orientation, rng), scale=1.0 if scales is None else scales[k]
        )


def berry_simulation(config, parameters, particle, berry, capacity, **scene):
    """An empty simulation of berries among walls of the configured material "wall".

    config: the whole configuration; parameters: the six contact parameters by name; particle: `shape.Particle`;
    berry: mapping with shear_modulus_pa and poisson_ratio; capacity: most berries; scene: walls, lower, upper and
    the other arguments of `Simulation`. Time step, gravity and tension are those of the section `simulation`.
    """
    wall, shared = config["wall"], config["simulation"]
    return Simulation(
        {"berry": particle.dem_shape("berry")},
        {
            "berry": Material(berry["shear_modulus_pa"], berry["poisson_ratio"]),
            "wall": Material(wall["shear_modulus_pa"], wall["poisson_ratio"]),
        },
        {
            ("berry", "berry"): Contact(parameters["e_gg"], parameters["mus_gg"], parameters["mur_gg"]),
            ("berry", "wall"): Contact(parameters["e_gp"], parameters["mus_gp"], parameters["mur_gp"]),
        },
        shared["time_step_s"],
        capacity=capacity,
        gravity_m_s2=(0.0, 0.0, -shared["gravity_m_s2"]),
        tension=shared["tension"],
        **scene,
    )


@dataclass(frozen=True)
class Pour:
    """What is left of a pour: arrays over the N berries generated, and the numbers that judge it."""

    centres_m: np.ndarray
    quaternions: np.ndarray
    scales: np.ndarray
    on_plate: np.ndarray
    in_pile: np.ndarray
    in_funnel: int
    off_plate: int
    kinetic_energy_j: float
    largest_motion_m: float
    discharge_s: float
    wall_s: float
    us_per_step: float
    frames: dict | None


def heap_simulation(config, parameters, particle, berry, largest_scale=1.0):
    """The funnel, the plate and an empty simulation.

    config: the whole configuration; parameters: the six contact parameters by name; particle: `shape.Particle`;
    berry: mapping with shear_modulus_pa and poisson_ratio; largest_scale: of a berry. Returns the simulation and the
    funnel.
    """
    heap = config["funnel"]
    funnel = Funnel(
        inlet_diameter_m=1e-3 * heap["inlet_diameter_mm"],
        outlet_diameter_m=1e-3 * heap["outlet_diameter_mm"],
        cone_angle_deg=heap["cone_angle_deg"],
        tube_length_m=1e-3 * heap["tube_length_mm"],
        rim_radius_m=1e-3 * heap["rim_radius_mm"],
        outlet_height_m=1e-3 * heap["outlet_height_mm"],
    )
    plate_radius = 0.5e-3 * heap["plate_diameter_mm"]
    plate = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", plate_radius)
    reach = largest_scale * particle.bounding_radius_m
    half = max(plate_radius, 0.5 * funnel.inlet_diameter_m) + 2.0 * reach
    simulation = berry_simulation(
        config,
        parameters,
        particle,
        berry,
        heap["berries"],
        walls={"plate": plate, **funnel.walls("wall")},
        lower=(-half, -half, 0.0),
        upper=(half, half, funnel.inlet_height_m + 4.0 * reach),
        largest_scale=largest_scale,
        exit_height_m=funnel.outlet_height_m,
        curved_walls_above_m=funnel.outlet_height_m - funnel.rim_radius_m,
        floor_height_m=-0.05,
    )
    return simulation, funnel


class Recorder:
    """Runs a simulation to given steps and keeps frames on the way."""

    def __init__(self, simulation, berries, interval_s, progress):
        self.simulation = simulation
        self.berries = berries
        self.every = None if interval_s is None else max(1, round(interval_s / simulation.physics.dt))
        self.progress = progress
        self.times, self.centres, self.quaternions = [], [], []

    def run_to(self, step):
        """Advance to a step count, stopping for frames."""
        now = self.simulation.steps
        while now < step:
            stop = step if self.every is None else min(step, (now // self.every + 1) * self.every)
            self.simulation.run_steps(stop - now)
            now = stop
            if self.every is not None and now % self.every == 0:
                self._keep()
        if self.progress is not None:
            self.progress(self.simulation.time_s)

    def _keep(self):
        n = self.simulation.n_bodies
        centres = np.full((self.berries, 3), np.nan, np.float32)
        quaternions = np.full((self.berries, 4), np.nan, np.float32)
        centres[:n] = self.simulation.positions
        quaternions[:n] = self.simulation.quaternions
        self.times.append(self.simulation.time_s)
        self.centres.append(centres)
        self.quaternions.append(quaternions)

    def frames(self):
        """Recorded frames as arrays time_s (T,), position (T, N, 3) [m], quaternion (T, N, 4), scale (N,), or None."""
        if self.every is None:
            return None
        scales = np.ones(self.berries)
        scales[: self.simulation.n_bodies] = self.simulation.scales
        return {
            "scale": scales,
            "time_s": np.array(self.times),
            "position": np.array(self.centres),
            "quaternion": np.array(self.quaternions),
        }


def pour(config, parameters, seed, particle, berry, trajectory_interval_s=None, progress=None):
    """Pour the berries through the funnel and let them rest (paper, section 3.1).

    Berries appear one by one at `rate_per_s` above the inlet (see `fill`), drawn from `seed`.
    trajectory_interval_s: keep a frame at this interval; progress: called with the simulated time.
    Returns a `Pour`.
    """
    heap = config["funnel"]
    began = time.perf_counter()
    scales, largest = of_pour(config["berry"]["size_distribution"], berry, seed, heap["berries"])
    simulation, funnel = heap_simulation(config, parameters, particle, berry, largest)
    rng = np.random.default_rng(seed)
    height = funnel.inlet_height_m + 1e-3 * heap["factory_height_mm"]
    factory = Disc(0.5e-3 * heap["factory_diameter_mm"] - largest * particle.bounding_radius_m, height)
    dt = config["simulation"]["time_step_s"]
    last_step = round(heap["duration_s"] / dt)
    rest_step = last_step - round(heap["rest_window_s"] / dt)
    timed_step = max(0, min(rest_step, last_step - round(1.0 / dt)))
    recorder = Recorder(simulation, heap["berries"], trajectory_interval_s, progress)
    fill(
        simulation,
        rng,
        factory,
        heap["berries"],
        heap["rate_per_s"],
        rest_step,
        recorder.run_to,
        scales,
        heap["orientation"],
    )
    timed_step = max(timed_step, simulation.steps)
    recorder.run_to(timed_step)
    clock = time.perf_counter()
    recorder.run_to(rest_step)
    before = simulation.positions.copy()
    recorder.run_to(last_step)
    us_per_step = 1e6 * (time.perf_counter() - clock) / max(1, last_step - timed_step)
    return _judge(simulation, funnel, before, recorder.frames(), time.perf_counter() - began, us_per_step)


def _judge(simulation, funnel, before, frames, wall_s, us_per_step):
    """Sort the berries into pile, plate, funnel and lost, and measure their motion."""
    centres = simulation.positions.copy()
    present = simulation.present
    # a berry hanging in the outlet has its centre a little below the rim
    in_funnel = present & (centres[:, 2] > funnel.outlet_height_m - simulation.radius)
    on_plate = present & (centres[:, 2] > 0.0) & ~in_funnel
    in_pile = largest_cluster(simulation.contacts(), on_plate)
    exits = simulation.exit_times_s
    exits = exits[np.isfinite(exits)]
    pile_energy = simulation.kinetic_energies()[in_pile]
    motion = np.linalg.norm(centres - before, axis=1)[on_plate]
    return Pour(
        centres_m=centres,
        quaternions=simulation.quaternions.copy(),
        scales=simulation.scales.copy(),
        on_plate=on_plate,
        in_pile=in_pile,
        in_funnel=int(in_funnel.sum()),
        off_plate=int(len(centres) - in_funnel.sum() - on_plate.sum()),
        kinetic_energy_j=float(pile_energy.sum()),
        largest_motion_m=float(motion.max(initial=0.0)),
        discharge_s=float(exits.max() - exits.min()) if len(exits) else math.nan,
        wall_s=wall_s,
        us_per_step=us_per_step,
        frames=frames,
    )


def largest_cluster(contacts, allowed):
    """Mask of the largest set of allowed bodies connected by contacts.

    contacts (M, 2) indices of touching bodies; allowed (N,) bool. Of equal sets the one with the lowest index.
    """
    n = len(allowed)
    if not n or not allowed.any():
        return np.zeros(n, bool)
    kept = contacts[allowed[contacts[:, 0]] & allowed[contacts[:, 1]]] if len(contacts) else contacts
    graph = coo_array((np.ones(len(kept)), (kept[:, 0], kept[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    sizes = np.bincount(label[allowed])
    return allowed & (label == sizes.argmax())

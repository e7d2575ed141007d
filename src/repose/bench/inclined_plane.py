"""Bench test of the inclined plane: it tilts until a sled slides and a grain rolls."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from repose import dem
from repose.bench.bench_test import (
    OK,
    Arrays,
    BenchTest,
    Outcome,
    Run,
    Verdict,
    register,
)
from repose.bench.factory import add_above
from repose.bench.grain_scale import GrainScale
from repose.bench.scene import Scene
from repose.bench.settings import SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.responses import Response
from repose.calibrate.runs import Recorded
from repose.common.section import Contradictions, Section, Seeds
from repose.dem.laws import ROLLING_LAWS

if TYPE_CHECKING:
    from repose.grain.particle import Particle

NAME = "inclined_plane"
# What lies on the plane: first the sled, then the grain that can roll.
SLED = "sled"
GRAIN = "berry"
# Time between two looks at a body, in units of `GrainScale.time_s`: while it is laid
# down, and while the plane tilts.
LAY_TIMES = 0.27
TILT_TIMES = 0.135
# Fewest looks in a tilting.
FEWEST_CHECKS = 100
# A body has moved when it is this share of its shortest axis away.
MOVED_SHARE = 0.25
# The line goes through speeds above this share of the last speed, in the root.
FROM_SHARE = 0.3
# Fewest speeds for a line.
FEWEST_SPEEDS = 3
# A grain slides, and does not roll, if its lowest point is faster than this share of
# its speed.
SLIDING_SHARE = 0.5
# Distance of the grains of a glued layer, over that at which they touch.
LAYER_SPACING = 1.0001
# Radius of a glued layer in bounding radii of a grain.
LAYER_RADIUS = 3.5

# --- responses ------------------------------------------------------------------------

SURFACE_KEYS = ("inclined_plane.surface",)
SLIP = Response(
    name="slip_deg",
    unit="deg",
    label="angle of slip",
    symbol="slip",
    apparatus=NAME,
    low=0.0,
    high=89.0,
    definition=SURFACE_KEYS,
)
ROLL = Response(
    name="roll_deg",
    unit="deg",
    label="angle of rolling",
    symbol="roll",
    apparatus=NAME,
    low=0.0,
    high=89.0,
    definition=SURFACE_KEYS,
)

# --- section of the configuration -----------------------------------------------------


class InclinedPlaneSettings(Section):
    """The section `inclined_plane` of the configuration; see config/README.md."""

    surface: Literal["wall", "berry", "glued"] = Field(
        description="`wall`; `berry`, a flat plate of the grains' material; `glued`, a "
        "layer of grains that are held",
    )
    tilting_deg_s: float = Field(
        ge=0.01,
        le=20,
        description="rate of tilting",
    )
    steepest_deg: float = Field(
        ge=1,
        le=89,
        description="the tilting ends at this slope",
    )
    settle_s: float = Field(
        ge=0.01,
        le=100,
        description="the grain that was laid down has at most this time to come to "
        "rest",
    )
    seeds: Seeds = Field(
        description="runs of each sample",
    )


# --- the glued layer ------------------------------------------------------------------


class Layer(NamedTuple):
    """A layer of grains on the plane, all in one orientation."""

    centres_m: np.ndarray  # (N, 3), at the height 0
    quaternion: np.ndarray  # (4,)
    depth_m: float  # of the plane below the centres


NO_LAYER = Layer(np.empty((0, 3)), np.array([1.0, 0.0, 0.0, 0.0]), 0.0)


def layer(particle: "Particle", azimuth: float = 0.0) -> Layer:
    """Lay grains flat and close together around a pocket between them on the z axis.

    The layer is the closest one of spheres, stretched along x and y as the grain is.
    Grains that are no ellipsoids lie farther apart, as far as they need.

    Parameters
    ----------
    particle : Particle
        Body of the grains.
    azimuth : float, optional
        Angle [rad] by which the layer is turned about z.

    Returns
    -------
    Layer
        Centres and orientation of the grains, and half of their thickness.
    """
    from scipy.spatial.transform import Rotation

    half_extents = particle.dem_shape("berry").half_extents_m
    # Turn the body's longest axis along x, and its shortest up.
    order = np.argsort(half_extents)[::-1]
    long_half, middle_half, short_half = half_extents[order]
    body_axes = np.eye(3)[order]
    # A rotation has the determinant +1; a reflection becomes one by an axis reversed.
    body_axes[2] *= np.linalg.det(body_axes)

    # Stretch a layer of unit spheres, and cut a round piece out of it.
    stretch = np.array([long_half, middle_half, 0.0])
    spacing = _layer_spacing(particle, body_axes, stretch)
    centres = spacing * _sphere_layer() * stretch
    distances = np.hypot(*centres[:, :2].T)
    layer_centres = centres[distances < LAYER_RADIUS * particle.bounding_radius_m]

    turn = Rotation.from_euler("z", azimuth)
    orientation = turn * Rotation.from_matrix(body_axes)
    return Layer(
        centres_m=turn.apply(layer_centres),
        quaternion=orientation.as_quat(scalar_first=True),
        depth_m=float(short_half),
    )


def _sphere_layer() -> np.ndarray:
    """Place spheres of radius 1 in a close layer (N, 3) about a pocket at the origin."""
    n = math.ceil(LAYER_RADIUS)
    numbers = np.arange(-2 * n, 2 * n + 1)
    place, row = (grid.ravel() for grid in np.meshgrid(numbers, numbers))
    # In each row the spheres are shifted by a radius. The pocket lies between three.
    x = 2.0 * place + row - 1.0
    y = math.sqrt(3.0) * row - 1.0 / math.sqrt(3.0)
    return np.column_stack([x, y, 0.0 * place])


def _layer_spacing(
    particle: "Particle", body_axes: np.ndarray, stretch: np.ndarray
) -> float:
    """Compute the factor that keeps the grains of a stretched layer apart.

    Two ellipsoids of a stretched layer just touch. Other shapes may be wider in the
    direction in which they would touch, and need as much more room.
    """
    # Three neighbours of a unit sphere; the other three lie opposite.
    neighbours = np.array(
        [[2.0, 0.0, 0.0], [1.0, math.sqrt(3.0), 0.0], [1.0, -math.sqrt(3.0), 0.0]]
    )
    # Normals of the planes in which the stretched spheres touch
    normals = np.column_stack([neighbours[:, :2] / stretch[:2], np.zeros(3)])
    body_normals = normals @ body_axes
    widths = particle.support(body_normals) + particle.support(-body_normals)
    distances = (neighbours * stretch * normals).sum(axis=1)
    return LAYER_SPACING * max(1.0, float((widths / distances).max()))


# --- run ------------------------------------------------------------------------------


class _Motion(NamedTuple):
    """The motion of the body at an angle of the plane."""

    angle_deg: float
    speed_m_s: float  # of its centre
    slide_m_s: float  # of its lowest point


COLUMNS = _Motion._fields


@dataclass(frozen=True)
class Tilting(Outcome):
    """Both tiltings of the plane."""

    restless: str = ""  # the sled or the grain, if it did not rest before its tilting


def sled_parameters(parameters: Mapping[str, float], surface: str) -> dict[str, float]:
    """Make the parameters of a sled, whose rolling friction is so high that it slides.

    It would only roll at twice the slope at which it slides.
    """
    pair = "gp" if surface == "wall" else "gg"
    rolling = max(parameters[f"mur_{pair}"], 2.0 * parameters[f"mus_{pair}"])
    return {**parameters, f"mur_{pair}": rolling}


def azimuth_of(seed: int) -> float:
    """Draw the azimuth of a glued layer [rad]."""
    return float(np.random.default_rng([seed, 1]).uniform(0.0, 2.0 * math.pi))


def _lay_down(trial: Trial, section: InclinedPlaneSettings) -> None:
    """Lay a grain on the level plane and wait until it rests.

    Its long axis is level and points in a random direction.

    Parameters
    ----------
    trial : Trial
        The plane, or the plane with its glued layer; it is advanced.
    section : InclinedPlaneSettings
        The section `inclined_plane` of the configuration.
    """
    settings = trial.scene.simulation
    # A glued layer is as high above its centres as a grain is thick.
    height_m = 0.0
    if section.surface == "glued":
        half_extents = trial.scene.particle.dem_shape("berry").half_extents_m
        height_m = float(min(half_extents))
    add_above(trial, "lying", height_m)
    # Let the grain begin to move before its rest is checked.
    check_interval = max(1, settings.steps(trial.scene.scale.interval_s(LAY_TIMES)))
    trial.run_to(check_interval)
    last_step = settings.steps(section.settle_s)
    trial.wait(partial(_is_at_rest, trial), last_step, check_interval)


def _is_at_rest(trial: Trial) -> bool:
    """Return whether the free grain, the last body, rests."""
    energy_j = trial.simulation.kinetic_energies()[-1]
    return not energy_j > trial.scene.simulation.rest_energy_j


def _tilt(trial: Trial, section: InclinedPlaneSettings) -> list[_Motion]:
    """Tilt the plane until the grain has moved or the plane is at its steepest.

    The plane stays level, and gravity is turned instead.

    Parameters
    ----------
    trial : Trial
        The plane with a grain that rests on it; it is advanced.
    section : InclinedPlaneSettings
        The section `inclined_plane` of the configuration.

    Returns
    -------
    list of _Motion
        The motion of the grain at each look; empty if the grain does not rest at the
        beginning.
    """
    if not _is_at_rest(trial):
        return []
    simulation = trial.simulation
    settings = trial.scene.simulation
    gravity = settings.gravity_m_s2
    interval = max(1, settings.steps(trial.scene.scale.interval_s(TILT_TIMES)))
    first_step = simulation.steps
    first_position = simulation.positions[-1].copy()
    # The distance that counts as a motion
    half_axis_m = float(min(simulation.shapes["berry"].half_extents_m))
    limit_m = MOVED_SHARE * 2.0 * half_axis_m * simulation.scales[-1]
    motions = []
    while True:
        n_steps = simulation.steps - first_step
        angle_deg = section.tilting_deg_s * n_steps * settings.time_step_s
        motions.append(_read_motion(simulation, angle_deg, section.surface))
        displacement = simulation.positions[-1] - first_position
        has_moved = np.hypot(*displacement[:2]) > limit_m
        if has_moved or angle_deg >= section.steepest_deg:
            return motions
        angle = math.radians(angle_deg)
        simulation.physics.gravity[:] = (
            gravity * math.sin(angle),
            0.0,
            -gravity * math.cos(angle),
        )
        trial.run_to(simulation.steps + interval)


def _read_motion(
    simulation: "dem.Simulation", angle_deg: float, surface: str
) -> _Motion:
    """Read the motion of the free grain, the last body of the simulation.

    It slides at the speed of its lowest point on the plane. On a glued layer there is
    no such point, and the speed is 0.

    Parameters
    ----------
    simulation : repose.dem.Simulation
        The simulation.
    angle_deg : float
        Present angle of the plane.
    surface : str
        Kind of the surface; ``glued`` stands for a layer of grains.
    """
    velocity = simulation.velocities[-1]
    slide_m_s = 0.0
    if surface != "glued":
        height = simulation.positions[-1][2]
        spin = simulation.angular_velocities[-1]
        # The lowest point lies below the centre, which moves and turns.
        lowest_velocity = velocity + np.cross(spin, (0.0, 0.0, -height))
        slide_m_s = float(np.hypot(*lowest_velocity[:2]))
    return _Motion(angle_deg, float(np.linalg.norm(velocity)), slide_m_s)


def tilted_frames(
    frames: Mapping[str, np.ndarray], section: InclinedPlaneSettings, last_deg: float
) -> dict[str, np.ndarray]:
    """Turn the frames of a film so that the plane tilts and gravity points down.

    Parameters
    ----------
    frames : mapping
        Frames of T times in the frame of the plane, the last at the angle `last_deg`.
    section : InclinedPlaneSettings
        The rate of the tilting.
    last_deg : float
        The last angle of the plane.

    Returns
    -------
    dict
        The frames, with the angles ``tilt_deg`` (T,).
    """
    times = np.asarray(frames["time_s"])
    # The plane tilts at a constant rate up to the last frame; before, it is level.
    tilt_deg = last_deg + section.tilting_deg_s * (times - times.max(initial=0.0))
    tilt_deg = np.maximum(tilt_deg, 0.0)
    angle = np.radians(tilt_deg)

    # A row of a plane holds a point and the normal that points into the wall.
    planes = np.array(frames["planes"], float)
    normal = np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    height = planes[:, :1, 2]
    planes[:, 0, :3] = height * normal
    planes[:, 0, 3:6] = -normal
    return {
        **frames,
        "position": _rotate_positions(np.asarray(frames["position"], float), angle),
        "quaternion": _rotate_bodies(np.asarray(frames["quaternion"], float), angle),
        "planes": planes,
        "tilt_deg": tilt_deg,
    }


# --- measure --------------------------------------------------------------------------


def _rotate_positions(position: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotate positions (T, N, 3) by angles (T,) [rad] about +y, which lowers +x."""
    cos = np.cos(angle)[:, None]
    sin = np.sin(angle)[:, None]
    x, y, z = np.moveaxis(position, -1, 0)
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


def _rotate_bodies(quaternion: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotate orientations (T, N, 4) by angles (T,) [rad] about +y.

    The rotation is the quaternion (cos a/2, 0, sin a/2, 0), multiplied from the left.
    """
    c = np.cos(angle / 2.0)[:, None]
    s = np.sin(angle / 2.0)[:, None]
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    return np.stack(
        [c * w - s * y, c * x + s * z, c * y + s * w, c * z - s * x], axis=-1
    )


def beginning_deg(angle_deg: np.ndarray, speed_m_s: np.ndarray) -> float | None:
    """Find the angle at which a motion began.

    The root of the speed grows in proportion to the angle since the beginning. So a
    line is fitted to the roots over the angles, and the angle where it meets zero is
    returned.

    Parameters
    ----------
    angle_deg, speed_m_s : array
        Angles of the plane (T,) and speeds of the body (T,).

    Returns
    -------
    float or None
        The angle [degrees]; None if the speed does not grow steadily at the end.
    """
    speed_roots = np.sqrt(speed_m_s)
    # The line goes through all roots after the last small one.
    slow = np.flatnonzero(speed_roots < FROM_SHARE * speed_roots[-1])
    if slow.size == 0 or len(speed_roots) - slow[-1] < FEWEST_SPEEDS:
        return None
    first = slow[-1] + 1
    slope, offset = np.polyfit(angle_deg[first:], speed_roots[first:], 1)
    return float(-offset / slope) if slope > 0.0 else None


def _judge_motion(
    arrays: Arrays, body: str, steepest_deg: float
) -> tuple[float | None, str]:
    """Find the angle at which a body began to move as it should, and describe it.

    Parameters
    ----------
    arrays : mapping
        The arrays of the run.
    body : str
        `SLED` or `GRAIN`.
    steepest_deg : float
        Angle at which the tilting ends.

    Returns
    -------
    angle_deg : float or None
        The angle; None if the body stays or stops, or if the grain slides.
    text : str
        The motion in words.
    """
    angle_deg, speed, slide = (
        np.asarray(arrays[f"{body}_{column}"], float) for column in COLUMNS
    )
    last_deg = angle_deg[-1]
    if last_deg >= steepest_deg:
        return None, f"the {body} stays up to {steepest_deg:g} degrees"
    if body == GRAIN and slide[-1] > SLIDING_SHARE * speed[-1]:
        text = f"the grain slides at {last_deg:.1f} degrees and does not roll"
        return None, text
    first_deg = beginning_deg(angle_deg, speed)
    if first_deg is None:
        text = (
            f"the {body} moves and stops, with no steady motion up to "
            f"{last_deg:.1f} degrees"
        )
        return None, text
    return first_deg, f"the {body} begins to move at {first_deg:.2f} degrees"


@register(NAME)
class InclinedPlaneTest(BenchTest[InclinedPlaneSettings]):
    """A plane that tilts until a sled slides, and until a single grain rolls."""

    settings = InclinedPlaneSettings
    responses = (SLIP, ROLL)
    numbers = ("motion",)
    missing_status: ClassVar = {SLIP.name: "no_slip", ROLL.name: "no_roll"}
    recorded = Recorded(means=(SLIP.name, ROLL.name), single=(SLIP.name, ROLL.name))
    statuses = ("ok", "unstable", "not_at_rest", "no_slip", "no_roll")
    required_arrays = tuple(
        f"{body}_{column}" for body in (SLED, GRAIN) for column in COLUMNS
    )
    summary = "{motion}"
    example: ClassVar = {
        "inclined_plane": {
            "surface": "wall",
            "tilting_deg_s": 2.0,
            "steepest_deg": 45.0,
            "settle_s": 2.0,
            "seeds": 2,
        },
        "targets": [
            {"response": "slip_deg", "value": 31.0, "sd": 1.0, "repetitions": 10}
        ],
    }

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe the level plane; grains glued on it have their centres at height 0."""
        surface = self.section(scene.settings).surface
        material = "berry" if surface == "berry" else "wall"
        glued = self.glued_layer(scene)
        origin = (0.0, 0.0, -glued.depth_m)
        # Pictures draw the plane as far as the box reaches, also when it is tilted.
        half = 4.0 * largest_radius_m
        return {
            "capacity": len(glued.centres_m) + 1,
            "walls": {"plane": dem.Plane(origin, (0.0, 0.0, 1.0), material)},
            "lower": (-half, -half, -half),
            "upper": (half, half, half),
        }

    def glued_layer(self, scene: Scene, azimuth: float = 0.0) -> Layer:
        """Make the `layer` on the plane; it has no grain where nothing is glued."""
        if self.section(scene.settings).surface == "glued":
            return layer(scene.particle, azimuth)
        return NO_LAYER

    def build(
        self, scene: Scene, largest_scale: float = 1.0, azimuth: float = 0.0
    ) -> "dem.Simulation":
        """Make the level plane without a free grain; `azimuth` [rad] turns its layer."""
        simulation = super().build(scene, largest_scale)
        glued = self.glued_layer(scene, azimuth)
        for centre in glued.centres_m:
            simulation.glue(simulation.add("berry", centre, glued.quaternion))
        return simulation

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Lay down a sled and tilt the plane; then do so with a grain that can roll.

        Parameters
        ----------
        scene : Scene
            What the run depends on.
        interval_s : float, optional
            Simulated time between the frames of a film, of the grain that can roll and
            with gravity down; without it none are recorded.
        progress : function, optional
            Called with the simulated time [s] after every advance.

        Returns
        -------
        Run
            The arrays are, for each body, ``BODY_angle_deg`` (T,), ``BODY_speed_m_s``
            (T,) and ``BODY_slide_m_s`` (T,), the speed of its lowest point.
        """
        section = self.section(scene.settings)
        sled = replace(
            scene, parameters=sled_parameters(scene.parameters, section.surface)
        )
        outcome = Tilting()
        arrays: dict[str, np.ndarray] = {}
        for body, body_scene, film_s in (
            (SLED, sled, None),
            (GRAIN, scene, interval_s),
        ):
            build = partial(self.build, azimuth=azimuth_of(scene.seed))
            trial = Trial(build, body_scene, 1, film_s, progress)
            motions: list[_Motion] = []
            with trial.bound(4.0 * trial.largest_radius_m).guard():
                _lay_down(trial, section)
                motions = _tilt(trial, section)
            # One outcome stands for both bodies; the last fault counts.
            if trial.broken:
                outcome = Tilting(restless=body, unstable=f"{body}: {trial.broken}")
            elif not motions:
                outcome = Tilting(restless=body)
            overlap_share = max(outcome.overlap_share, trial.overlap_share)
            outcome = replace(outcome, overlap_share=overlap_share)
            columns = np.array(motions).reshape(-1, len(COLUMNS)).T
            for name, column in zip(COLUMNS, columns, strict=True):
                arrays[f"{body}_{name}"] = column

        # The last trial is that of the grain, which is filmed.
        frames = trial.frames(walls=True)
        if frames is not None:
            last_deg = float(arrays[f"{GRAIN}_angle_deg"].max(initial=0.0))
            frames = tilted_frames(frames, section, last_deg)
        return self.make_run(scene, outcome, arrays, frames)

    def judge(self, outcome: Tilting, settings: SceneSettings) -> Verdict:
        """Judge a stable run before it is measured."""
        if outcome.restless:
            settle_s = self.section(settings).settle_s
            return Verdict(
                "not_at_rest",
                f"the {outcome.restless} still moves {settle_s:g} s after it was laid "
                "down; give the grain more time by inclined_plane.settle_s",
            )
        return OK

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the angles at which the sled slips and the grain rolls.

        Parameters
        ----------
        arrays : mapping
            Arrays of the run by name, as from `run`.
        scene : Scene
            What the run depends on.

        Returns
        -------
        dict
            The angles, and ``motion``, the motion of both in words. An angle is None if
            the body stays or stops, or if the grain slides.
        """
        steepest_deg = self.section(scene.settings).steepest_deg
        measured: dict[str, Any] = {SLIP.name: None, ROLL.name: None, "motion": None}
        descriptions = {}
        for response, body in ((SLIP, SLED), (ROLL, GRAIN)):
            angle_deg, text = _judge_motion(arrays, body, steepest_deg)
            measured[response.name] = angle_deg
            descriptions[response.name] = text
        measured["motion"] = "; ".join(descriptions.values())
        targets = self.check_targets(measured, scene.settings, descriptions)
        return {**targets, **measured}

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of both tiltings [s]."""
        section = self.section(settings)
        return 2.0 * (section.settle_s + section.steepest_deg / section.tilting_deg_s)

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield a law under which a sled creeps."""
        law = settings.simulation.rolling_law
        if ROLLING_LAWS.entry(law).creeps:
            yield (
                "simulation.rolling_law",
                f"a law that can hold a sled, for inclined_plane: {law} lets it creep",
            )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield a rate of tilting that is too fast to see with such a grain."""
        section = self.section(settings)
        scale = GrainScale.of_axes(axes_mm, settings.simulation.gravity_m_s2)
        look_s = scale.interval_s(TILT_TIMES)
        fastest_deg_s = section.steepest_deg / (FEWEST_CHECKS * look_s)
        if section.tilting_deg_s > fastest_deg_s:
            yield (
                "inclined_plane.tilting_deg_s",
                f"at most {fastest_deg_s:g}, or the angle has too few steps",
            )

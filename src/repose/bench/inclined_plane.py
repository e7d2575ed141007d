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
# The bodies that lie on the plane: first the sled, then the grain that can roll.
SLED = "sled"
GRAIN = "berry"
# Their names in messages. The names above are part of the names of saved arrays.
BODY_NAMES = {SLED: "sled", GRAIN: "grain"}
# Time between two checks of a body, in units of `GrainScale.time_s`: while it comes to
# rest on the level plane, and while the plane tilts.
REST_CHECK_TIMES = 0.27
TILT_CHECK_TIMES = 0.135
# Fewest checks of a mean grain while the plane tilts.
FEWEST_CHECKS = 100
# A body has moved when its centre is displaced by this fraction of its shortest axis.
MOVED_SHARE = 0.25
# `fit_onset_angle_deg` fits its line to square roots of speeds. A root is too small for
# the line if it is below this fraction of the last root.
SMALLEST_ROOT_SHARE = 0.3
# Fewest speeds from the last one whose root is too small (included) to the end.
FEWEST_SPEEDS = 3
# A grain slides instead of rolling if its lowest point is faster than this fraction of
# its speed.
SLIDING_SHARE = 0.5
# Ratio of the distance between grains of a glued layer to the distance at which they
# touch. It is a little above 1, since grains that just touch could overlap by rounding
# errors.
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
    """A layer of grains on the plane, all in the same orientation."""

    centres_m: np.ndarray  # (N, 3), at the height 0
    quaternion: np.ndarray  # (4,)
    depth_m: float  # depth of the plane below the centres


NO_LAYER = Layer(np.empty((0, 3)), np.array([1.0, 0.0, 0.0, 0.0]), 0.0)


def make_layer(particle: "Particle", azimuth: float = 0.0) -> Layer:
    """Make a layer of grains that lie flat and close together on a plane.

    The layer is the densest layer of spheres, stretched along x and y by the half
    extents of the grain. The z axis goes through the gap between three neighbouring
    grains. Grains that are not ellipsoids lie farther apart where their shape requires
    it.

    Parameters
    ----------
    particle : Particle
        Body that represents each grain.
    azimuth : float, optional
        Angle [rad] by which the layer is rotated about z.

    Returns
    -------
    Layer
        Centres and orientation of the grains, and the depth of the plane below the
        centres: half of the thickness of a grain.
    """
    from scipy.spatial.transform import Rotation

    # Rotate the body so that its longest axis points along x and its shortest axis up.
    # The rows of this rotation matrix are the axes of the body.
    half_extents = particle.dem_shape("berry").half_extents_m
    longest_first = np.argsort(half_extents)[::-1]
    half_x, half_y, half_z = half_extents[longest_first]
    body_axes = np.eye(3)[longest_first]
    # The determinant of a rotation is +1. If the order of the axes gives a reflection,
    # whose determinant is -1, reverse one axis.
    body_axes[2] *= np.linalg.det(body_axes)

    # Stretch a layer of unit spheres, and cut a disc out of it, whose radius is
    # `LAYER_RADIUS` times that of a grain. All centres stay at the height 0.
    stretch = np.array([half_x, half_y, 0.0])
    spacing = _compute_layer_spacing(particle, body_axes, stretch)
    centres = spacing * _make_sphere_layer() * stretch
    axis_distances = np.hypot(*centres[:, :2].T)
    disc_centres = centres[axis_distances < LAYER_RADIUS * particle.bounding_radius_m]

    # Rotate the whole layer about z.
    layer_rotation = Rotation.from_euler("z", azimuth)
    orientation = layer_rotation * Rotation.from_matrix(body_axes)
    return Layer(
        centres_m=layer_rotation.apply(disc_centres),
        quaternion=orientation.as_quat(scalar_first=True),
        depth_m=float(half_z),
    )


def _make_sphere_layer() -> np.ndarray:
    """Place spheres of radius 1 in the densest layer, in which each touches six others.

    The layer lies at z = 0, and the gap between three of the spheres at the origin.

    Returns
    -------
    array
        Centres (N, 3) of the spheres.
    """
    # The caller stretches this layer and then cuts it at `LAYER_RADIUS` times the
    # radius of a grain. Each row is shifted sideways, and the layer may shrink along
    # one axis. So make many more spheres than lie within this radius.
    half_count = math.ceil(LAYER_RADIUS)
    indices = np.arange(-2 * half_count, 2 * half_count + 1)
    column_grid, row_grid = np.meshgrid(indices, indices)
    column = column_grid.ravel()
    row = row_grid.ravel()
    # Each row is shifted by one radius relative to the row before. The constants move
    # the gap between three spheres to the origin.
    x = 2.0 * column + row - 1.0
    y = math.sqrt(3.0) * row - 1.0 / math.sqrt(3.0)
    return np.column_stack([x, y, 0.0 * column])


def _compute_layer_spacing(
    particle: "Particle", body_axes: np.ndarray, stretch: np.ndarray
) -> float:
    """Compute the factor that spreads a stretched layer so that no grains overlap.

    Neighbouring ellipsoids of a stretched layer just touch. Other bodies may be wider
    than ellipsoids in the direction of the contact. The factor makes up for this.

    Parameters
    ----------
    particle : Particle
        Body of the grains.
    body_axes : array
        Rotation matrix (3, 3) from the frame of the body to that of the layer.
    stretch : array
        Factors (3,) by which a layer of unit spheres is stretched. The factor along z
        has no effect.

    Returns
    -------
    float
        The factor, at least `LAYER_SPACING`.
    """
    # Centres of three of the six neighbours of a unit sphere at the origin. The other
    # three lie opposite to them.
    neighbours = np.array(
        [[2.0, 0.0, 0.0], [1.0, math.sqrt(3.0), 0.0], [1.0, -math.sqrt(3.0), 0.0]]
    )
    # Normals, not of unit length, of the planes in which the stretched spheres touch
    normals = np.column_stack([neighbours[:, :2] / stretch[:2], np.zeros(3)])
    # Bodies do not overlap if their width along each normal is at most the distance
    # between neighbours along this normal.
    distances = (neighbours * stretch * normals).sum(axis=1)
    body_normals = normals @ body_axes
    widths = particle.support(body_normals) + particle.support(-body_normals)
    return LAYER_SPACING * max(1.0, float((widths / distances).max()))


# --- run ------------------------------------------------------------------------------


class _Motion(NamedTuple):
    """The motion of a body at an angle of the plane."""

    angle_deg: float
    speed_m_s: float  # speed of its centre
    slide_m_s: float  # speed of its lowest point


MOTION_COLUMNS = _Motion._fields


@dataclass(frozen=True)
class Tilting(Outcome):
    """The outcome of tilting the plane under the sled and under the grain."""

    # The sled or the grain if it was not at rest when the plane began to tilt, or empty
    restless_body: str = ""


def make_sled_parameters(
    parameters: Mapping[str, float], surface: str
) -> dict[str, float]:
    """Make the contact parameters of a sled: a grain that slides before it can roll.

    Its coefficient of rolling friction is at least twice that of sliding friction.
    Therefore the sled already slides on slopes on which it does not yet roll.

    Parameters
    ----------
    parameters : mapping
        Contact parameters of the grain by name.
    surface : str
        Kind of the surface. It decides whether the contact is that of a grain with the
        wall (``gp``) or with another grain (``gg``).

    Returns
    -------
    dict
        A copy of the parameters with the rolling friction of the sled.
    """
    pair = "gp" if surface == "wall" else "gg"
    sliding_friction = parameters[f"mus_{pair}"]
    rolling_friction = max(parameters[f"mur_{pair}"], 2.0 * sliding_friction)
    return {**parameters, f"mur_{pair}": rolling_friction}


def draw_azimuth(seed: int) -> float:
    """Draw the azimuth [rad] of the glued layer in the run with a seed."""
    # The random numbers of the free grain come from the seed alone. With the 1, those
    # of the layer are different.
    rng = np.random.default_rng([seed, 1])
    return float(rng.uniform(0.0, 2.0 * math.pi))


def _lay_down(trial: Trial, section: InclinedPlaneSettings) -> None:
    """Lay a grain on the level plane and wait until it rests.

    The long axis of the grain is level and points in a random direction, which the seed
    of the run determines.

    Parameters
    ----------
    trial : Trial
        The plane, with its glued layer if it has one. It is advanced in place.
    section : InclinedPlaneSettings
        The section `inclined_plane` of the configuration.
    """
    simulation_settings = trial.scene.simulation
    # The centres of a glued layer lie at the height 0. The grains of the layer lie
    # flat, so the layer reaches up to half of the thickness of a grain. "berry" is the
    # name of the material of the grains.
    height_m = 0.0
    if section.surface == "glued":
        half_extents = trial.scene.particle.dem_shape("berry").half_extents_m
        height_m = float(min(half_extents))
    # "lying" stands for a level long axis.
    add_above(trial, "lying", height_m)
    # Let the grain begin to move before the first check, so that it does not count as
    # at rest.
    check_interval = max(
        1, simulation_settings.steps(trial.scene.scale.interval_s(REST_CHECK_TIMES))
    )
    trial.run_to(check_interval)
    last_step = simulation_settings.steps(section.settle_s)
    trial.wait(partial(_is_at_rest, trial), last_step, check_interval)


def _is_at_rest(trial: Trial) -> bool:
    """Return whether the free grain rests.

    A grain whose energy is NaN counts as at rest, so that a wait for rest ends.
    """
    # The free grain is added last, after the glued ones.
    energy_j = trial.simulation.kinetic_energies()[-1]
    return not energy_j > trial.scene.simulation.rest_energy_j


def _tilt(trial: Trial, section: InclinedPlaneSettings) -> list[_Motion]:
    """Tilt the plane until the grain has moved or the steepest angle is reached.

    The plane of the simulation stays level. The direction of gravity is rotated
    instead, at the rate `tilting_deg_s`.

    Parameters
    ----------
    trial : Trial
        The plane with a grain that rests on it. It is advanced in place.
    section : InclinedPlaneSettings
        The section `inclined_plane` of the configuration.

    Returns
    -------
    list of _Motion
        The motion of the grain at each check. The list is empty if the grain is not at
        rest before the plane tilts.
    """
    if not _is_at_rest(trial):
        return []
    simulation = trial.simulation
    simulation_settings = trial.scene.simulation
    check_interval = max(
        1, simulation_settings.steps(trial.scene.scale.interval_s(TILT_CHECK_TIMES))
    )
    first_step = simulation.steps
    # The grain is the last body. Any others are the glued ones.
    initial_position = simulation.positions[-1].copy()
    motion_threshold_m = _compute_motion_threshold_m(simulation)
    motions = []
    while True:
        # Record the motion at the present angle first, and then tilt further.
        tilting_steps = simulation.steps - first_step
        angle_deg = (
            section.tilting_deg_s * tilting_steps * simulation_settings.time_step_s
        )
        motions.append(_read_motion(simulation, angle_deg, section.surface))
        displacement = simulation.positions[-1] - initial_position
        # Only the motion along the plane counts.
        has_moved = np.hypot(*displacement[:2]) > motion_threshold_m
        if has_moved or angle_deg >= section.steepest_deg:
            return motions
        _tilt_gravity(
            simulation, simulation_settings.gravity_m_s2, math.radians(angle_deg)
        )
        trial.run_to(simulation.steps + check_interval)


def _compute_motion_threshold_m(simulation: "dem.Simulation") -> float:
    """Compute the distance beyond which the free grain counts as moved [m]."""
    shortest_half_axis_m = float(min(simulation.shapes["berry"].half_extents_m))
    scale = simulation.scales[-1]
    return MOVED_SHARE * 2.0 * shortest_half_axis_m * scale


def _tilt_gravity(
    simulation: "dem.Simulation", gravity_m_s2: float, angle: float
) -> None:
    """Set gravity in place: rotate it by an angle [rad] from -z towards +x."""
    simulation.physics.gravity[:] = (
        gravity_m_s2 * math.sin(angle),
        0.0,
        -gravity_m_s2 * math.cos(angle),
    )


def _read_motion(
    simulation: "dem.Simulation", angle_deg: float, surface: str
) -> _Motion:
    """Read the speed of the free grain, and the speed at which it slides.

    The free grain is the last body of the simulation.

    Parameters
    ----------
    simulation : repose.dem.Simulation
        The simulation.
    angle_deg : float
        Present angle of the plane, which is stored with the motion.
    surface : str
        Kind of the surface; ``glued`` stands for a layer of grains.

    Returns
    -------
    _Motion
        The motion. The speed of sliding is that of the lowest point of the grain, which
        touches the plane. On a glued layer there is no such point, and the speed of
        sliding is 0.
    """
    velocity = simulation.velocities[-1]
    speed = float(np.linalg.norm(velocity))
    if surface == "glued":
        return _Motion(angle_deg, speed_m_s=speed, slide_m_s=0.0)
    # The lowest point is assumed to lie on the plane z = 0, straight below the centre.
    # Its velocity is that of the centre plus that of the rotation about the centre.
    height = simulation.positions[-1][2]
    angular_velocity = simulation.angular_velocities[-1]
    offset_from_centre = (0.0, 0.0, -height)
    lowest_velocity = velocity + np.cross(angular_velocity, offset_from_centre)
    slide_speed = float(np.hypot(*lowest_velocity[:2]))
    return _Motion(angle_deg, speed_m_s=speed, slide_m_s=slide_speed)


def make_tilted_frames(
    frames: Mapping[str, np.ndarray], section: InclinedPlaneSettings, last_deg: float
) -> dict[str, np.ndarray]:
    """Turn the frames of a film so that the plane tilts and gravity points down.

    Parameters
    ----------
    frames : mapping
        Frames at T times, with positions relative to the plane: ``time_s``,
        ``position``, ``quaternion`` and ``planes`` (`Trial.frames`). They are not
        changed.
    section : InclinedPlaneSettings
        The section `inclined_plane`, with the rate at which the plane tilts.
    last_deg : float
        Angle of the plane in the last frame.

    Returns
    -------
    dict
        The rotated frames, with the angles ``tilt_deg`` (T,) of the plane.
    """
    time_s = np.asarray(frames["time_s"])
    # The plane is level at first. Then it tilts at a constant rate up to the last
    # frame. Count the time back from that frame, at which it is 0. The argument
    # `initial` is needed if there are no frames.
    time_from_end_s = time_s - time_s.max(initial=0.0)
    tilt_deg = last_deg + section.tilting_deg_s * time_from_end_s
    tilt_deg = np.maximum(tilt_deg, 0.0)
    # The functions below take the angle in radians.
    angle = np.radians(tilt_deg)
    position = np.asarray(frames["position"], float)
    quaternion = np.asarray(frames["quaternion"], float)
    return {
        **frames,
        "position": _rotate_positions(position, angle),
        "quaternion": _rotate_quaternions(quaternion, angle),
        "planes": _rotate_plane(np.array(frames["planes"], float), angle),
        "tilt_deg": tilt_deg,
    }


def _rotate_plane(planes: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotate a level plane by angles (T,) [rad] about +y, which lowers +x.

    Parameters
    ----------
    planes : array
        The plane at T times (T, 1, 6 or more): a point, the normal that points into the
        wall, and other columns, which stay as they are. The array is changed in place.
    angle : array
        The angles.

    Returns
    -------
    array
        The same array, with the rotated plane.
    """
    up = np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    height = planes[:, :1, 2]
    planes[:, 0, :3] = height * up
    planes[:, 0, 3:6] = -up
    return planes


def _rotate_positions(position: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotate positions (T, N, 3) by angles (T,) [rad] about +y, which lowers +x."""
    # The new axis applies the angle of a time to all N grains.
    cos = np.cos(angle)[:, np.newaxis]
    sin = np.sin(angle)[:, np.newaxis]
    x, y, z = np.moveaxis(position, -1, 0)
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


def _rotate_quaternions(quaternion: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotate orientations (T, N, 4) by angles (T,) [rad] about +y.

    The rotation is the quaternion (cos a/2, 0, sin a/2, 0), multiplied from the left.
    """
    # The new axis applies the angle of a time to all N grains.
    cos = np.cos(angle / 2.0)[:, np.newaxis]
    sin = np.sin(angle / 2.0)[:, np.newaxis]
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    return np.stack(
        [cos * w - sin * y, cos * x + sin * z, cos * y + sin * w, cos * z - sin * x],
        axis=-1,
    )


# --- measure --------------------------------------------------------------------------


def fit_onset_angle_deg(angle_deg: np.ndarray, speed_m_s: np.ndarray) -> float | None:
    """Find the angle at which a body began to move, from its speeds.

    After the beginning, the square root of the speed grows in proportion to the angle
    by which the plane has tilted further. A line is fitted to these roots as a function
    of the angle. The body began to move at the angle where the line is zero.

    Parameters
    ----------
    angle_deg, speed_m_s : array
        Angles of the plane (T,) and speeds of the body (T,).

    Returns
    -------
    float or None
        The angle [degrees]. None if the speed does not grow at the end, or if there are
        too few speeds for a line.
    """
    speed_roots = np.sqrt(speed_m_s)
    # The first speeds are noise of a body at rest. The line is fitted to all roots
    # after the last small one. If no root is small, the speeds do not include the
    # beginning of the motion.
    small_roots = np.flatnonzero(speed_roots < SMALLEST_ROOT_SHARE * speed_roots[-1])
    if small_roots.size == 0:
        return None
    last_small_index = small_roots[-1]
    if len(speed_roots) - last_small_index < FEWEST_SPEEDS:
        return None
    first_index = last_small_index + 1
    slope, offset = np.polyfit(angle_deg[first_index:], speed_roots[first_index:], 1)
    # This condition also rejects a slope that is NaN.
    if not slope > 0.0:
        return None
    return float(-offset / slope)


def _find_and_describe_onset(
    arrays: Arrays, body: str, steepest_deg: float
) -> tuple[float | None, str]:
    """Find the angle at which a body began to slide or roll, and describe its motion.

    The description tells the user why an angle is missing.

    Parameters
    ----------
    arrays : mapping
        The arrays of the run, as `InclinedPlaneTest.run` returns them.
    body : str
        `SLED`, which should slide, or `GRAIN`, which should roll.
    steepest_deg : float
        Angle at which the tilting ends.

    Returns
    -------
    angle_deg : float or None
        The angle [degrees]. None if the body stays in place or stops again, or if the
        grain slides instead of rolling.
    text : str
        The motion in words, such as "the sled begins to move at 30.00 degrees".
    """
    angle_deg, speed_m_s, slide_m_s = (
        np.asarray(arrays[f"{body}_{column}"], float) for column in MOTION_COLUMNS
    )
    body_name = BODY_NAMES[body]
    last_deg = angle_deg[-1]
    # The tilting ends as soon as the body has moved (`_tilt`). So a body stayed in
    # place if the tilting went on to the steepest angle.
    if last_deg >= steepest_deg:
        return None, f"the {body_name} stays up to {steepest_deg:g} degrees"
    # The lowest point of a grain that rolls is nearly at rest, because it touches the
    # plane.
    if body == GRAIN and slide_m_s[-1] > SLIDING_SHARE * speed_m_s[-1]:
        text = f"the grain slides at {last_deg:.1f} degrees and does not roll"
        return None, text
    onset_deg = fit_onset_angle_deg(angle_deg, speed_m_s)
    if onset_deg is None:
        text = (
            f"the {body_name} moves and stops, without steady motion up to "
            f"{last_deg:.1f} degrees"
        )
        return None, text
    return onset_deg, f"the {body_name} begins to move at {onset_deg:.2f} degrees"


def _lay_down_and_tilt(trial: Trial, section: InclinedPlaneSettings) -> list[_Motion]:
    """Lay a body on the plane, tilt it, and return the motion of the body.

    Parameters
    ----------
    trial : Trial
        The plane without a free grain. It is advanced in place. The advance ends early
        if a limit is exceeded.
    section : InclinedPlaneSettings
        The section `inclined_plane` of the configuration.

    Returns
    -------
    list of _Motion
        The motions that `_tilt` returns. The list is also empty if a limit is exceeded.
    """
    motions: list[_Motion] = []
    with trial.bound(4.0 * trial.largest_radius_m).guard():
        _lay_down(trial, section)
        motions = _tilt(trial, section)
    return motions


def _add_to_outcome(
    outcome: Tilting, body: str, trial: Trial, motions: Sequence[_Motion]
) -> Tilting:
    """Combine the outcome of a run with the simulation of another body.

    Parameters
    ----------
    outcome : Tilting
        The outcome of the bodies before this one. It is not changed.
    body : str
        `SLED` or `GRAIN`.
    trial : Trial
        The simulation of the body.
    motions : sequence of _Motion
        The motion of the body. The sequence is empty if the body was not at rest when
        the plane began to tilt.

    Returns
    -------
    Tilting
        If this body was unstable or not at rest, the outcome of this body alone.
        Otherwise the given outcome, with the larger of both overlaps.
    """
    if trial.broken:
        return Tilting(
            restless_body=body,
            unstable=f"{BODY_NAMES[body]}: {trial.broken}",
            overlap_share=trial.overlap_share,
        )
    if not motions:
        return Tilting(restless_body=body, overlap_share=trial.overlap_share)
    overlap_share = max(outcome.overlap_share, trial.overlap_share)
    return replace(outcome, overlap_share=overlap_share)


def _make_motion_arrays(body: str, motions: Sequence[_Motion]) -> dict[str, np.ndarray]:
    """Make the arrays (T,) of a body's motion by name, such as ``sled_angle_deg``."""
    # Thanks to the new shape, each column is an empty array if there is no motion.
    columns = np.array(motions).reshape(-1, len(MOTION_COLUMNS)).T
    return {
        f"{body}_{name}": column
        for name, column in zip(MOTION_COLUMNS, columns, strict=True)
    }


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
        f"{body}_{column}" for body in (SLED, GRAIN) for column in MOTION_COLUMNS
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
        """Describe the level plane as arguments of `repose.dem.Simulation`.

        The keys are the names of the arguments.

        Parameters
        ----------
        scene : Scene
            The settings of the plane.
        largest_radius_m : float
            Bounding radius of the largest grain.
        """
        surface = self.section(scene.settings).surface
        material = "berry" if surface == "berry" else "wall"
        glued = self.make_glued_layer(scene)
        # The centres of glued grains lie at the height 0, so the plane lies below it.
        origin = (0.0, 0.0, -glued.depth_m)
        # The box bounds the part of the plane that pictures show.
        half_side = 4.0 * largest_radius_m
        return {
            "capacity": len(glued.centres_m) + 1,
            "walls": {"plane": dem.Plane(origin, (0.0, 0.0, 1.0), material)},
            "lower": (-half_side, -half_side, -half_side),
            "upper": (half_side, half_side, half_side),
        }

    def make_glued_layer(self, scene: Scene, azimuth: float = 0.0) -> Layer:
        """Make the layer that is glued on the plane; it may have no grains."""
        if self.section(scene.settings).surface == "glued":
            return make_layer(scene.particle, azimuth)
        return NO_LAYER

    def build(
        self, scene: Scene, largest_scale: float = 1.0, azimuth: float = 0.0
    ) -> "dem.Simulation":
        """Make the level plane with its glued layer, without a free grain.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        largest_scale : float, optional
            Size of the largest grain as a multiple of the particle.
        azimuth : float, optional
            Angle [rad] by which the glued layer is rotated about z.
        """
        simulation = super().build(scene, largest_scale)
        glued = self.make_glued_layer(scene, azimuth)
        for centre in glued.centres_m:
            simulation.glue(simulation.add("berry", centre, glued.quaternion))
        return simulation

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Tilt the plane under a sled, and then under a grain that can roll.

        These are two separate simulations. The sled is a grain with so much rolling
        friction that it slides before it rolls.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        interval_s : float, optional
            Simulated time between the frames of a film of the grain that can roll.
            Without it none are recorded.
        progress : function, optional
            Called with the simulated time [s] whenever the simulation has advanced.

        Returns
        -------
        Run
            The arrays of a body have its name, `SLED` or `GRAIN`, in place of BODY.
            They are ``BODY_angle_deg`` (T,), the angle of the plane; ``BODY_speed_m_s``
            (T,), the speed of its centre; and ``BODY_slide_m_s`` (T,), the speed of its
            lowest point.
        """
        section = self.section(scene.settings)
        # Both simulations have the same glued layer, if the plane has one.
        build = partial(self.build, azimuth=draw_azimuth(scene.seed))
        sled_scene = replace(
            scene, parameters=make_sled_parameters(scene.parameters, section.surface)
        )
        sled_trial = Trial(build, sled_scene, 1, progress=progress)
        sled_motions = _lay_down_and_tilt(sled_trial, section)
        # Only the simulation of the grain is filmed.
        grain_trial = Trial(build, scene, 1, interval_s, progress)
        grain_motions = _lay_down_and_tilt(grain_trial, section)

        # One outcome covers both bodies. The grain is added last, so that the outcome
        # is that of the grain if both bodies have a problem.
        outcome = Tilting()
        outcome = _add_to_outcome(outcome, SLED, sled_trial, sled_motions)
        outcome = _add_to_outcome(outcome, GRAIN, grain_trial, grain_motions)
        arrays = {
            **_make_motion_arrays(SLED, sled_motions),
            **_make_motion_arrays(GRAIN, grain_motions),
        }
        frames = grain_trial.frames(walls=True)
        if frames is not None:
            last_deg = float(arrays[f"{GRAIN}_angle_deg"].max(initial=0.0))
            frames = make_tilted_frames(frames, section, last_deg)
        return self.make_run(scene, outcome, arrays, frames)

    def judge(self, outcome: Tilting, settings: SceneSettings) -> Verdict:
        """Check that both bodies were at rest before the plane tilted."""
        if outcome.restless_body:
            body_name = BODY_NAMES[outcome.restless_body]
            settle_s = self.section(settings).settle_s
            return Verdict(
                "not_at_rest",
                f"the {body_name} still moves {settle_s:g} s after it was laid "
                "down; give the grain more time by inclined_plane.settle_s",
            )
        return OK

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the angles at which the sled slips and the grain rolls.

        Parameters
        ----------
        arrays : mapping
            Arrays of the run by name, as `run` returns them.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        dict
            The angles, and ``motion``, which describes the motion of both bodies. An
            angle is None if the body stays in place or stops again, or if the grain
            slides. If such an angle is a target, there are also ``status`` and
            ``reason``.
        """
        steepest_deg = self.section(scene.settings).steepest_deg
        slip_deg, sled_text = _find_and_describe_onset(arrays, SLED, steepest_deg)
        roll_deg, grain_text = _find_and_describe_onset(arrays, GRAIN, steepest_deg)
        measured = {
            SLIP.name: slip_deg,
            ROLL.name: roll_deg,
            "motion": f"{sled_text}; {grain_text}",
        }
        # If the angle of a target is None, `check_targets` returns a new status, with
        # the motion of the body as the reason. Otherwise it returns an empty dict.
        reasons = {SLIP.name: sled_text, ROLL.name: grain_text}
        fault = self.check_targets(measured, scene.settings, reasons)
        return {**fault, **measured}

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of both tiltings [s]."""
        section = self.section(settings)
        return 2.0 * (section.settle_s + section.steepest_deg / section.tilting_deg_s)

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield the rolling law if it lets a sled creep down the plane."""
        law = settings.simulation.rolling_law
        if ROLLING_LAWS.entry(law).creeps:
            yield (
                "simulation.rolling_law",
                f"a law that can hold a sled, for inclined_plane: {law} lets it creep",
            )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield the rate of tilting if it allows too few checks of the mean grain.

        `axes_mm` are the full axes of the mean grain.
        """
        section = self.section(settings)
        scale = GrainScale.of_axes(axes_mm, settings.simulation.gravity_m_s2)
        interval_s = scale.interval_s(TILT_CHECK_TIMES)
        fastest_deg_s = section.steepest_deg / (FEWEST_CHECKS * interval_s)
        if section.tilting_deg_s > fastest_deg_s:
            yield (
                "inclined_plane.tilting_deg_s",
                f"at most {fastest_deg_s:g}, or the angle has too few steps",
            )

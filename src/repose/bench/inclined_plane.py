"""The inclined plane: a plane tilts slowly until a sled slides, and until a single grain rolls.

A sled, grains glued side by side, cannot roll: it slides where the slope is the coefficient of friction, at
atan(mu_s). Here it is one grain whose rolling friction is so high that it cannot roll, for Coulomb's limit is the same
for any load. A sphere rolls where the slope exceeds its coefficient of rolling friction, unless it slides before. A
grain of another shape tips over, or rolls about the axis on which it happens to lie.

Gravity turns and the plane stays. In the frame of the plane this is exact but for the forces of a turning frame: at 1
degree per second and 100 mm from the axis they are 3e-6 of the weight. So nothing turns against space, and every law of
rolling resistance, relative to space or to the other body, resists the rotation on the plane. A plane that turns would
need `rolling_frame_rad_s`.

The grain begins to move with an acceleration that grows evenly with the angle, so its speed goes with the square of the
angle beyond the limit. The angle of the beginning is where the line of the root of the speed over the angle meets zero.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from repose import dem
from repose.bench.bench_test import (
    Arrays,
    BenchTest,
    Contradictions,
    Ending,
    Faults,
    Progress,
    Run,
    Scene,
    register,
    stated,
)
from repose.bench.factory import add_above
from repose.bench.scene import Trial
from repose.bench.settings import CREEPING_LAWS, SceneSettings
from repose.calibrate.responses import Response
from repose.calibrate.runs import Recorded
from repose.common.section import Section, Seeds

if TYPE_CHECKING:
    from repose.grain.particle import Particle

NAME = "inclined_plane"
SLED, SINGLE = "sled", "berry"  # what lies on the plane
LOOK_S = 0.005  # simulated time between two looks at the grain
FAR = 0.25  # the grain has moved when it is this share of its shortest axis away
FROM_SHARE = 0.3  # the line goes through speeds above this share of the last one
APART = 1.0001  # of the grains of a glued layer, over their touching
REACHES = 3.5  # radius of a glued layer in bounding radii
COLUMNS = ("angle_deg", "speed_m_s", "slide_m_s")
SLIDING = 0.5  # of the speed: a grain whose lowest point is faster than this slides, and does not roll

# --- responses ------------------------------------------------------------------------------------

SURFACE = (f"{NAME}.surface",)
LACKING = {
    "slip_deg": "no_slip",
    "roll_deg": "no_roll",
}  # status of a run that lacks a target

# --- section of the configuration -----------------------------------------------------------------


class InclinedPlaneSettings(Section):
    """The section `inclined_plane` of the configuration; config/README.md explains its keys."""

    surface: Literal["wall", "berry", "glued"]
    tilting_deg_s: float = Field(ge=0.01, le=20)
    steepest_deg: float = Field(ge=1, le=89)
    settle_s: float = Field(ge=0.01, le=100)
    seeds: Seeds


# --- build and run --------------------------------------------------------------------------------


def layer(
    particle: "Particle", azimuth: float = 0.0
) -> tuple[np.ndarray, np.ndarray, float]:
    """Lay grains flat in a close layer: centres (N, 3) about a pocket, their orientation, half their height.

    It is the close layer of spheres, stretched as the grain is, and as far apart as a shape needs that is no ellipsoid.
    """
    from scipy.spatial.transform import Rotation

    half = particle.dem_shape("berry").half_extents_m
    axes = np.argsort(half)[::-1]  # of the body: the longest along x, the shortest up
    rows = np.eye(3)[axes]
    rows[2] *= np.linalg.det(rows)
    n = math.ceil(REACHES)
    i, j = (part.ravel() for part in np.meshgrid(*2 * [np.arange(-2 * n, 2 * n + 1)]))
    unit = np.column_stack(
        [2.0 * i + j - 1.0, math.sqrt(3.0) * j - 1.0 / math.sqrt(3.0), 0.0 * i]
    )
    stretched = np.array([*half[axes][:2], 0.0])
    # planes between a grain and its neighbours, by which ellipsoids touch
    ways = np.array(
        [[2.0, 0.0, 0.0], [1.0, math.sqrt(3.0), 0.0], [1.0, -math.sqrt(3.0), 0.0]]
    )
    normals = np.column_stack([ways[:, :2] / stretched[:2], np.zeros(3)])
    width = particle.support(normals @ rows) + particle.support(-normals @ rows)
    places = (
        APART
        * max(1.0, float((width / (ways * stretched * normals).sum(axis=1)).max()))
        * unit
        * stretched
    )
    near = np.hypot(*places[:, :2].T) < REACHES * particle.bounding_radius_m
    turn = Rotation.from_euler("z", azimuth)
    quaternion = (turn * Rotation.from_matrix(rows)).as_quat(scalar_first=True)
    return turn.apply(places[near]), quaternion, float(half[axes][2])


def held(parameters: Mapping[str, float], surface: str) -> dict[str, float]:
    """Make the parameters of a sled: it would roll at twice the slope at which it slides."""
    pair = "gp" if surface == "wall" else "gg"
    return {
        **parameters,
        f"mur_{pair}": max(parameters[f"mur_{pair}"], 2.0 * parameters[f"mus_{pair}"]),
    }


def _lay_down(trial: Trial, section: InclinedPlaneSettings) -> None:
    """Lay a grain on the level plane, its long axis level in a random direction, and let it rest."""
    settings, particle = trial.scene.simulation, trial.scene.particle
    height = (
        float(min(particle.dem_shape("berry").half_extents_m))
        if section.surface == "glued"
        else 0.0
    )
    add_above(trial, "lying", height)
    every = settings.steps(0.01)
    trial.run_to(every)
    trial.wait(partial(_rests, trial), settings.steps(section.settle_s), every)


def _rests(trial: Trial) -> bool:
    """Whether the free grain, the last one, rests."""
    return (
        not trial.simulation.kinetic_energies()[-1]
        > trial.scene.simulation.rest_energy_j
    )


def azimuth_of(seed: int) -> float:
    """Draw the azimuth of a glued layer [rad]."""
    return float(np.random.default_rng([seed, 1]).uniform(0.0, 2.0 * math.pi))


def _tilt(
    trial: Trial, section: InclinedPlaneSettings
) -> list[tuple[float, float, float]]:
    """Turn gravity until the grain has moved or the plane is steepest; rows of `COLUMNS`, none if it does not rest."""
    simulation, settings = trial.simulation, trial.scene.simulation
    if not _rests(trial):
        return []
    rows, began = [], simulation.positions[-1].copy()
    far = (
        FAR
        * 2.0
        * float(min(simulation.shapes["berry"].half_extents_m))
        * simulation.scales[-1]
    )
    every, start = max(1, settings.steps(LOOK_S)), simulation.steps
    while True:
        angle_deg = (
            section.tilting_deg_s * (simulation.steps - start) * settings.time_step_s
        )
        angle = math.radians(angle_deg)
        place, speed = simulation.positions[-1], simulation.velocities[-1]
        lowest = speed + np.cross(
            simulation.angular_velocities[-1], (0.0, 0.0, -place[2])
        )
        slide = 0.0 if section.surface == "glued" else float(np.hypot(*lowest[:2]))
        rows.append((angle_deg, float(np.linalg.norm(speed)), slide))
        if np.hypot(*(place - began)[:2]) > far or angle_deg >= section.steepest_deg:
            return rows
        g = settings.gravity_m_s2
        simulation.physics.gravity[:] = g * math.sin(angle), 0.0, -g * math.cos(angle)
        trial.run_to(simulation.steps + every)


def tilted(
    frames: Mapping[str, np.ndarray], section: InclinedPlaneSettings, last_deg: float
) -> dict[str, np.ndarray]:
    """Turn frames into the laboratory's, where the plane tilts; add ``tilt_deg`` (T,)."""
    times = np.asarray(frames["time_s"])
    tilt = last_deg + section.tilting_deg_s * (times - times.max(initial=0.0))
    tilt = np.maximum(tilt, 0.0)
    half, angle = np.radians(tilt) / 2.0, np.radians(tilt)
    x, y, z = np.moveaxis(np.asarray(frames["position"], float), -1, 0)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    position = np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)
    # a rotation by the angle about +y, which lowers +x
    c, s = np.cos(half)[:, None], np.sin(half)[:, None]
    qw, qx, qy, qz = np.moveaxis(np.asarray(frames["quaternion"], float), -1, 0)
    quaternion = np.stack(
        [c * qw - s * qy, c * qx + s * qz, c * qy + s * qw, c * qz - s * qx], axis=-1
    )
    planes = np.array(frames["planes"], float)
    normal = np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    planes[:, 0, :3], planes[:, 0, 3:6] = planes[:, :1, 2] * normal, -normal
    return {
        **frames,
        "position": position,
        "quaternion": quaternion,
        "planes": planes,
        "tilt_deg": tilt,
    }


# --- measure --------------------------------------------------------------------------------------


def beginning_deg(angle_deg: np.ndarray, speed_m_s: np.ndarray) -> float | None:
    """Find the angle at which a motion began, by the line of the root of its speed; None if it stops growing."""
    root = np.sqrt(speed_m_s)
    slower = np.flatnonzero(root < FROM_SHARE * root[-1])
    if slower.size == 0 or len(root) - slower[-1] < 3:
        return None
    slope, shift = np.polyfit(angle_deg[slower[-1] + 1 :], root[slower[-1] + 1 :], 1)
    return float(-shift / slope) if slope > 0.0 else None


@dataclass(frozen=True)
class Tilted(Ending):
    """Both tiltings."""

    moving: str = ""  # sled or grain, if it did not rest before


@register(NAME)
class InclinedPlaneTest(BenchTest[InclinedPlaneSettings]):
    """A plane that tilts until a sled slides, and until a single grain rolls."""

    settings = InclinedPlaneSettings
    responses = (
        Response("slip_deg", "deg", "angle of slip", "slip", NAME, 0.0, 89.0, SURFACE),
        Response(
            "roll_deg", "deg", "angle of rolling", "roll", NAME, 0.0, 89.0, SURFACE
        ),
    )
    numbers = ("motion",)
    lacking = LACKING
    recorded = Recorded(means=tuple(LACKING), single=tuple(LACKING))
    statuses = ("ok", "unstable", "not_at_rest", "no_slip", "no_roll")
    required_arrays = tuple(
        f"{what}_{column}" for what in (SLED, SINGLE) for column in COLUMNS
    )
    summary = "{motion}"

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe the level plane; a glued layer of grains on it has its centres at height 0."""
        section, half = self.section(scene.settings), 4.0 * reach_m
        places, _, depth = self.glued(scene)
        material = "berry" if section.surface == "berry" else "wall"
        return {
            "capacity": len(places) + 1,
            "walls": {
                "plane": dem.Plane((0.0, 0.0, -depth), (0.0, 0.0, 1.0), material)
            },
            # pictures draw the plane as far as the box reaches, also when it is tilted
            "lower": (-half, -half, -half),
            "upper": (half, half, half),
        }

    def glued(
        self, scene: Scene, azimuth: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the `layer` on the plane; no grain where nothing is glued."""
        if self.section(scene.settings).surface == "glued":
            return layer(scene.particle, azimuth)
        return np.empty((0, 3)), np.array([1.0, 0.0, 0.0, 0.0]), 0.0

    def build(
        self, scene: Scene, largest_scale: float = 1.0, azimuth: float = 0.0
    ) -> "dem.Simulation":
        """Make the plane without a free grain, level; `azimuth` [rad] turns its layer."""
        simulation = super().build(scene, largest_scale)
        places, turn, _ = self.glued(scene, azimuth)
        for place in places:
            simulation.glue(simulation.add("berry", place, turn))
        return simulation

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Lay down a sled and tilt the plane until it slides, then do the same with a grain that can roll.

        The arrays are, for each of them, ``WHAT_angle_deg`` (T,), ``WHAT_speed_m_s`` (T,) and ``WHAT_slide_m_s`` (T,),
        the speed of the lowest point. Frames are of the grain that can roll, with gravity down.
        """
        section, ending = self.section(scene.settings), Tilted()
        arrays: dict[str, np.ndarray] = {}
        frames = None
        turned = partial(self.build, azimuth=azimuth_of(scene.seed))
        for what in (SLED, SINGLE):
            values = (
                held(scene.parameters, section.surface)
                if what == SLED
                else scene.parameters
            )
            film_s = interval_s if what == SINGLE else None
            trial = Trial(
                turned, replace(scene, parameters=values), 1, film_s, progress
            )
            rows: list[tuple[float, float, float]] = []
            with trial.bound(4.0 * trial.reach_m).guard():
                _lay_down(trial, section)
                rows = _tilt(trial, section)
            if trial.broken or not rows:
                ending = Tilted(
                    what, unstable=trial.broken and f"{what}: {trial.broken}"
                )
            columns = np.array(rows).reshape(-1, 3).T
            arrays |= {
                f"{what}_{name}": column
                for name, column in zip(COLUMNS, columns, strict=True)
            }
            frames = trial.frames(walls=True)
        if frames is not None:
            frames = tilted(
                frames, section, float(arrays[f"{SINGLE}_angle_deg"].max(initial=0.0))
            )
        return self.ended(scene, ending, arrays, frames)

    def faults(self, ending: Tilted, settings: SceneSettings) -> Faults:
        """Judge a run before it is measured."""
        settle_s = self.section(settings).settle_s
        moves = f"the {ending.moving} still moves {settle_s:g} s after it was laid down"
        return stated((ending.moving, "not_at_rest", moves))

    def values(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure both angles; None where sled or grain stays or stops, or the grain slides."""
        measured: dict[str, Any] = dict.fromkeys((*LACKING, *self.numbers))
        steepest = self.section(scene.settings).steepest_deg
        why = {}
        for name, what in zip(LACKING, (SLED, SINGLE), strict=True):
            angle, speed, slide = (
                np.asarray(arrays[f"{what}_{column}"], float) for column in COLUMNS
            )
            if angle[-1] >= steepest:
                why[name] = f"the {what} stays up to {steepest:g} degrees"
            elif what == SINGLE and slide[-1] > SLIDING * speed[-1]:
                why[name] = (
                    f"the grain slides at {angle[-1]:.1f} degrees and does not roll"
                )
            else:
                measured[name] = beginning_deg(angle, speed)
                why[name] = (
                    f"the {what} moves and stops, with no steady motion up to {angle[-1]:.1f} degrees"
                )
                if measured[name] is not None:
                    why[name] = (
                        f"the {what} begins to move at {measured[name]:.2f} degrees"
                    )
        measured["motion"] = "; ".join(why.values())
        return {**self.assess(measured, scene.settings, why), **measured}

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of both tiltings [s]."""
        section = self.section(settings)
        return 2.0 * (section.settle_s + section.steepest_deg / section.tilting_deg_s)

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Refuse a law under which a sled creeps, and a tilting with fewer than 100 looks at the grain."""
        section, law = self.section(settings), settings.simulation.rolling_law
        holding = f"a law that can hold a sled, for inclined_plane: {law} lets it creep"
        fastest, key = section.steepest_deg / (100 * LOOK_S), f"{NAME}.tilting_deg_s"
        return stated(
            (law in CREEPING_LAWS, "simulation.rolling_law", holding),
            (
                section.tilting_deg_s > fastest,
                key,
                f"at most {fastest:g}, or the angle has too few steps",
            ),
        )

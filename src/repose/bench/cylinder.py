"""The measuring cylinder: bulk density of the grains that fill it to the rim.

Vessel and pouring follow the small container of ISO 17828: 5 litres, 167 mm wide and
228 mm high; the grains are poured from 200 to 300 mm above the rim and struck off
level. The wall continues above the rim as a collar, so that no grain misses the
cylinder. When the grains rest, those above the rim are struck off. Then the cylinder
may be tapped: it falls from a height, and its grains leave the floor with the speed of
that fall.

A grain belongs to the cylinder if its centre lies below the rim. On average, the volume
that protrudes above the rim replaces the volume that is missing below it. So the
density does not depend on the shape of the grains.

The core keeps a distance of `core_margin_mm` from wall, floor and rim, because grains
pack more loosely near them than in the middle. Near a boundary, grains also lie in
layers. If whole grains were counted, a layer whose centres lie just inside the core
would count too much. Therefore each grain counts by the fraction of its volume that
lies in the core.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

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
    not_at_rest,
    register,
)
from repose.bench.factory import Disc, Factory, fill, last_berry_s
from repose.bench.scene import Scene
from repose.bench.settings import Poured, SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.responses import Response
from repose.common.numbers import format_significant
from repose.common.section import Contradictions

if TYPE_CHECKING:
    from repose.grain.particle import Particle

NAME = "cylinder"
# Default height of the fall in a tap.
TAP_MM = 3.0
# Time after a tap in which the grains come to rest, in units of `GrainScale.time_s`.
# The second constant is this time for a grain of 14 mm. It is used to estimate the cost
# of a run before the grain is known.
TAP_REST_TIMES = 10.8
TYPICAL_TAP_REST_S = 0.4
# Largest number of points in a body that estimate the fraction of a grain in the core.
MOST_POINTS = 1000
# Number of directions in which the extent of a convex body is compared with a point.
N_DIRECTIONS = 1000
# The positive root of x^4 = x + 1. Its powers make an even Kronecker sequence in three
# dimensions (M. Roberts 2018, The unreasonable effectiveness of quasirandom sequences).
KRONECKER_ROOT = 1.2207440846057596

# --- responses ------------------------------------------------------------------------

VESSEL_KEYS = ("cylinder.diameter_mm", "cylinder.height_mm")


def _make_density_response(
    kind: str, label: str, symbol: str, keys: tuple[str, ...]
) -> Response:
    """Make the response of a density.

    `keys` are the keys of the configuration that define it, in addition to the
    `VESSEL_KEYS`.
    """
    return Response(
        name=f"{kind}_density_kg_m3",
        unit="kg/m3",
        label=label,
        symbol=symbol,
        apparatus=NAME,
        low=0.0,
        high=25000.0,
        definition=(*VESSEL_KEYS, *keys),
    )


BULK = _make_density_response("bulk", "bulk density", "bulk density", ())
CORE = _make_density_response(
    "core", "bulk density of the core", "core density", ("cylinder.core_margin_mm",)
)
TAPPED = _make_density_response(
    "tapped", "tapped density", "tapped density", ("cylinder.taps", "cylinder.tap_mm")
)

# --- section of the configuration -----------------------------------------------------


class CylinderSettings(Poured):
    """The section `cylinder` of the configuration; see config/README.md."""

    duration_s: float = Field(
        ge=0.1,
        le=600,
        description="simulated time; the last grain comes before its end",
    )
    diameter_mm: float = Field(
        ge=1,
        le=5000,
        description="inner diameter of the cylinder",
        json_schema_extra={"source": "ISO 17828: 167"},
    )
    height_mm: float = Field(
        ge=1,
        le=5000,
        description="inner height of the cylinder",
        json_schema_extra={"source": "ISO 17828: 228"},
    )
    collar_mm: float = Field(
        ge=1,
        le=5000,
        description="the wall goes on above the rim by this length; grains appear at "
        "its upper end",
        json_schema_extra={"source": "ISO 17828: poured from 200 to 300 above the rim"},
    )
    speed_m_s: float = Field(
        ge=0,
        le=10,
        description="speed of a grain where it appears, down; that after a fall of 50 "
        "mm",
    )
    core_margin_mm: float = Field(
        ge=0,
        le=1000,
        description="the core lies this far from wall, floor and rim",
    )
    taps: int = Field(
        default=0,
        ge=0,
        le=1000,
        description="falls of the cylinder after the pour",
    )
    tap_mm: float = Field(
        default=TAP_MM,
        ge=0.1,
        le=100,
        description="height of each fall",
        json_schema_extra={"source": "ISO 787-11: 3"},
    )


# --- the vessel -----------------------------------------------------------------------


@dataclass(frozen=True)
class Vessel:
    """The inside of a cylinder about the z axis, its floor at z = 0, with a collar."""

    radius_m: float
    height_m: float
    collar_m: float  # height of the collar above the rim

    @classmethod
    def of(cls, section: CylinderSettings) -> "Vessel":
        """Make the vessel of a section of the configuration."""
        return cls(
            radius_m=1e-3 * (0.5 * section.diameter_mm),
            height_m=1e-3 * section.height_mm,
            collar_m=1e-3 * section.collar_mm,
        )

    @property
    def top_m(self) -> float:
        """Upper end of the collar, where grains appear [m]."""
        return self.height_m + self.collar_m

    def compute_density_kg_m3(
        self,
        masses_kg: np.ndarray,
        shares: np.ndarray | Sequence[float],
        margin_m: float = 0.0,
    ) -> float:
        """Compute the bulk density of the cylinder or of its core [kg/m3].

        Parameters
        ----------
        masses_kg : array
            Masses (N,) of the grains.
        shares : array
            The fraction (N,) of each grain that counts, from 0 to 1.
        margin_m : float, optional
            Distance of the core from wall, floor and rim; 0 for the whole cylinder.
        """
        radius = self.radius_m - margin_m
        # The core keeps the margin from the floor and from the rim.
        height = self.height_m - 2.0 * margin_m
        mass = float(np.asarray(masses_kg) @ np.asarray(shares, float))
        return mass / (math.pi * radius**2 * height)

    def contains(self, points_m: np.ndarray, margin_m: float = 0.0) -> np.ndarray:
        """Mark the points (N, 3) in the cylinder, or in its core if there is a margin.

        The core keeps the distance `margin_m` from wall, floor and rim.
        """
        x, y, z = np.asarray(points_m, float).T
        is_between_ends = (z > margin_m) & (z < self.height_m - margin_m)
        return is_between_ends & (np.hypot(x, y) < self.radius_m - margin_m)

    def compute_core_shares(
        self, arrays: Mapping[str, np.ndarray], particle: "Particle", margin_m: float
    ) -> np.ndarray:
        """Estimate the fraction of each grain's volume that lies in the core.

        It is the fraction of points in the grain (`spread_points`) that lie in the
        core. With `MOST_POINTS` points, its root mean square error is 0.003 for a grain
        that the boundary of the core cuts. The relative error of the core's density is
        then below 1e-3.

        Parameters
        ----------
        arrays : mapping
            Arrays of a run: ``position`` (N, 3) [m], ``quaternion`` (N, 4) and
            ``scale`` (N,).
        particle : Particle
            Body that represents each grain.
        margin_m : float
            Distance of the core from wall, floor and rim.

        Returns
        -------
        array
            The fractions (N,), from 0 to 1.
        """
        centres = np.asarray(arrays["position"], float)
        quaternions = np.asarray(arrays["quaternion"], float)
        scales = arrays["scale"]
        body_points = spread_points(particle)
        shares = np.empty(len(centres))
        for grain, (centre, quaternion, scale) in enumerate(
            zip(centres, quaternions, scales, strict=True)
        ):
            # Transform the points from the frame of the body to that of the cylinder.
            rotation = dem.rotation_matrix(quaternion)
            points = centre + scale * body_points @ rotation.T
            shares[grain] = self.contains(points, margin_m).mean()
        return shares


def spread_points(particle: "Particle") -> np.ndarray:
    """Make points that lie evenly in the volume of a body.

    A Kronecker sequence, whose points lie more evenly than random ones, fills the
    bounding box of the body. Up to `MOST_POINTS` of its points lie in the body and are
    returned. The sequence is always the same.

    Parameters
    ----------
    particle : Particle
        The body. Its `axes_m` are its full extents along x, y and z.

    Returns
    -------
    array
        Points (P, 3) [m] in the frame of the body, with P up to `MOST_POINTS`.
    """
    # A Kronecker sequence takes equal steps along each axis. Its fractional parts fill
    # the unit cube evenly if the steps are the powers -1, -2 and -3 of
    # `KRONECKER_ROOT`.
    steps = KRONECKER_ROOT ** -np.arange(1.0, 4.0)
    # Make nearly four times as many points as needed, so that a body which fills only a
    # quarter of its box still gets enough of them.
    point_numbers = np.arange(1.0, 4 * MOST_POINTS)
    unit_cube_points = np.outer(point_numbers, steps) % 1.0

    # Stretch the unit cube to the bounding box of the body. The box reaches as far
    # along -x, -y and -z as the body does.
    lower_corner = -particle.support(-np.eye(3))
    points = lower_corner + particle.axes_m * unit_cube_points
    if particle.is_clump:
        is_inside = _mark_points_in_spheres(points, particle.spheres_m)
    else:
        is_inside = _mark_points_in_convex_body(points, particle)
    return points[is_inside][:MOST_POINTS]


def _mark_points_in_spheres(points: np.ndarray, spheres_m: np.ndarray) -> np.ndarray:
    """Mark the points (N, 3) that lie in at least one sphere.

    Each row of `spheres_m` (M, 4) holds the centre and the radius of a sphere.
    """
    centres = spheres_m[:, :3]
    radii = spheres_m[:, 3]
    distances = np.linalg.norm(points[:, None] - centres, axis=2)
    return (distances < radii).any(axis=1)


def _mark_points_in_convex_body(points: np.ndarray, particle: "Particle") -> np.ndarray:
    """Mark the points (N, 3) that lie in a convex body.

    A point counts as inside if its distance from the origin along each of
    `N_DIRECTIONS` directions is below the extent of the body in that direction.
    """
    # The directions lie on a spiral over the unit sphere, which covers it evenly. The
    # azimuth grows by the golden angle from each direction to the next.
    azimuth = np.arange(float(N_DIRECTIONS)) * math.pi * (3.0 - math.sqrt(5.0))
    height = np.linspace(-0.999, 0.999, N_DIRECTIONS)
    ring_radius = np.sqrt(1.0 - height**2)
    x = ring_radius * np.cos(azimuth)
    y = ring_radius * np.sin(azimuth)
    directions = np.column_stack([x, y, height])
    return (points @ directions.T < particle.support(directions)).all(axis=1)


# --- build and run --------------------------------------------------------------------


def tap(trial: Trial, height_m: float) -> None:
    """Let the cylinder fall once onto a hard floor, and wait until its grains rest.

    In the frame of the cylinder, the stop at the end of the fall throws the grains up
    to the height of the fall. To simulate this, gravity is changed for a single time
    step, in which it gives all grains the upward speed of the fall. The trial is
    advanced in place.

    Parameters
    ----------
    trial : Trial
        The filled cylinder. Afterwards its gravity is the same as before.
    height_m : float
        Height of the fall [m].
    """
    simulation = trial.simulation
    simulation_settings = trial.scene.simulation

    # The engine reads this array at each time step, so changing it in place changes
    # gravity. Gravity points along -z. The changed one points up. If `run_to` raises an
    # error because a limit is exceeded, gravity stays changed, but then the run ends.
    gravity = simulation.physics.gravity
    usual_gravity = gravity.copy()
    fall_speed = _compute_fall_speed(simulation_settings.gravity_m_s2, height_m)
    gravity[2] += fall_speed / simulation_settings.time_step_s
    trial.run_to(simulation.steps + 1)
    gravity[:] = usual_gravity

    # Wait until the grains have fallen back and rest. The time for the rest is a
    # multiple of the time in which a grain falls by half of its diameter.
    flight_s = _compute_flight_s(simulation_settings.gravity_m_s2, height_m)
    rest_s = trial.scene.scale.interval_s(TAP_REST_TIMES)
    trial.run_to(simulation.steps + simulation_settings.steps(flight_s + rest_s))


def _compute_fall_speed(gravity_m_s2: float, height_m: float) -> float:
    """Compute the speed at the end of a fall from a height [m/s]."""
    return math.sqrt(2.0 * gravity_m_s2 * height_m)


def _compute_flight_s(gravity_m_s2: float, height_m: float) -> float:
    """Compute the time of a flight up to a height and back down [s]."""
    return 2.0 * _compute_fall_speed(gravity_m_s2, height_m) / gravity_m_s2


@dataclass(frozen=True)
class Filling(Outcome):
    """The grains in a filled cylinder, by which its run is accepted or rejected."""

    centres_m: np.ndarray  # (N, 3)
    energy_j: float  # mean kinetic energy of a grain
    length_m: float  # longest axis of a grain with the relative size 1
    is_tapped: bool = False  # whether the cylinder was tapped


def _describe_filling(trial: Trial) -> Filling:
    """Copy the state of the grains by which a run is accepted or rejected."""
    return Filling(
        centres_m=trial.simulation.positions.copy(),
        energy_j=trial.energy_j(),
        length_m=float(trial.scene.particle.axes_m.max()),
        unstable=trial.broken,
        overlap_share=trial.overlap_share,
    )


def _judge_fullness(filling: Filling, section: CylinderSettings) -> Verdict | None:
    """Check whether the cylinder is full.

    It is full if enough grains lie above the rim for a layer that is as high as a grain
    is long. The heap in the collar is nearly level, so this many grains cover the rim
    everywhere.

    Parameters
    ----------
    filling : Filling
        The grains in the cylinder. Its `length_m` is the length of a grain.
    section : CylinderSettings
        The section `cylinder` of the configuration. Its `berries` is the number of
        grains.

    Returns
    -------
    Verdict or None
        The status ``not_full`` with its reason; None if the cylinder is full.
    """
    height_m = Vessel.of(section).height_m
    n_poured = len(filling.centres_m)
    n_below_rim = int(np.count_nonzero(filling.centres_m[:, 2] < height_m))
    n_above_rim = n_poured - n_below_rim
    # Estimate the number of grains in the layer: it is as dense as the filling below
    # the rim.
    n_in_layer = math.ceil(n_below_rim * filling.length_m / height_m)
    if n_above_rim < n_in_layer:
        return Verdict(
            "not_full",
            f"{n_poured} of {section.berries} grains poured, {n_below_rim} of them "
            f"below the rim; a full cylinder has at least {n_in_layer} grains above it",
        )
    return None


def _tap_filling(trial: Trial, section: CylinderSettings) -> Filling:
    """Tap a filled cylinder as often as configured, and measure the result.

    The trial is advanced in place. The taps end early if a limit is exceeded.
    """
    with trial.bounds.guard():
        for _ in range(section.taps):
            tap(trial, 1e-3 * section.tap_mm)
    return replace(_describe_filling(trial), is_tapped=True)


@register(NAME)
class CylinderTest(BenchTest[CylinderSettings]):
    """A measuring cylinder that is filled, struck off at the rim, and may be tapped."""

    settings = CylinderSettings
    responses = (BULK, CORE, TAPPED)
    numbers = ("berries_in_cylinder",)
    statuses = ("ok", "unstable", "lost", "not_at_rest", "not_full")
    measured_by = ("core_margin_mm",)
    required_arrays = ("position", "quaternion", "scale")
    summary = (
        "bulk density {bulk_density_kg_m3:.0f} kg/m3, "
        "in the core {core_density_kg_m3:.0f}, "
        "{berries_in_cylinder} grains in the cylinder"
    )
    example: ClassVar = {
        "cylinder": {
            "berries": 120,
            "rate_per_s": 300.0,
            "duration_s": 1.5,
            "seeds": 2,
            "diameter_mm": 50.0,
            "height_mm": 30.0,
            "collar_mm": 60.0,
            "speed_m_s": 1.0,
            "core_margin_mm": 5.0,
        },
        "targets": [
            {
                "response": "bulk_density_kg_m3",
                "value": 480.0,
                "sd": 10.0,
                "repetitions": 5,
            }
        ],
    }

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe the cylinder as arguments of `repose.dem.Simulation`.

        The keys are the names of the arguments. The wall continues above the rim as a
        collar. The material of all walls is called "wall". All lengths are in m.

        Parameters
        ----------
        scene : Scene
            The settings of the cylinder.
        largest_radius_m : float
            Radius of a ball that contains the largest grain. Grains appear at the top
            of the collar, so the wall is higher by the diameter of this ball.

        Returns
        -------
        dict
            ``capacity``, the largest number of grains; ``walls`` by name; and ``lower``
            and ``upper`` corner of the box.
        """
        section = self.section(scene.settings)
        vessel = Vessel.of(section)
        radius = vessel.radius_m
        wall_height = vessel.top_m + 2.0 * largest_radius_m
        floor = (0.0, 0.0, 0.0)
        up = (0.0, 0.0, 1.0)
        return {
            "capacity": section.berries,
            "walls": {
                "floor": dem.Plane(floor, up, "wall"),
                "shell": dem.Cylinder(floor, up, wall_height, radius, "wall"),
            },
            "lower": (-radius, -radius, 0.0),
            "upper": (radius, radius, wall_height),
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the cylinder, let the grains rest, and tap the cylinder if configured.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        interval_s : float, optional
            Simulated time between the frames of a film; without it none are recorded.
        progress : function, optional
            Called with the simulated time [s] whenever the simulation has advanced.

        Returns
        -------
        Run
            The arrays are ``position`` (N, 3) [m], ``quaternion`` (N, 4) and ``scale``
            (N,) before the taps; with taps also ``tapped`` (N, 3) [m], the positions
            after them.
        """
        section = self.section(scene.settings)
        trial = self._fill_cylinder(scene, interval_s, progress)
        filling = _describe_filling(trial)
        # These are copies of the state before the taps, which change `trial`.
        arrays = trial.grains()
        # Numbers for the record: how many grains were poured, and how much they still
        # move.
        numbers = {
            "berries_poured": len(filling.centres_m),
            "kinetic_energy_J": filling.energy_j,
        }
        # The cylinder is tapped only if its filling has the status ``ok``. The state
        # after the taps is then checked in place of the filling.
        outcome = filling
        if section.taps and self.status_of(filling, scene.settings).status == "ok":
            outcome = _tap_filling(trial, section)
            arrays["tapped"] = outcome.centres_m.astype(np.float32)
        return self.make_run(scene, outcome, arrays, trial.frames(), **numbers)

    def _fill_cylinder(
        self, scene: Scene, interval_s: float | None, progress: Progress | None
    ) -> Trial:
        """Make a cylinder, and pour grains into it for `cylinder.duration_s`.

        Parameters
        ----------
        scene : Scene
            Settings, parameters, grain and seed of the run.
        interval_s : float or None
            Simulated time between the frames of a film; with None none are recorded.
        progress : function or None
            Called with the simulated time [s] whenever the simulation has advanced.

        Returns
        -------
        Trial
            The simulation of the cylinder with its grains. It ends early if a limit is
            exceeded.
        """
        section = self.section(scene.settings)
        vessel = Vessel.of(section)
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        # New grains appear in a disc at the upper end of the collar, the part of the
        # wall above the rim. The disc is narrower than the collar, so that no new grain
        # touches the wall.
        area = Disc(vessel.radius_m - trial.largest_radius_m, vessel.top_m)
        factory = Factory(
            area, section.berries, section.rate_per_s, speed_m_s=section.speed_m_s
        )
        last_step = scene.simulation.steps(section.duration_s)
        # `guard` ends this block without an error as soon as the run exceeds a limit.
        # `trial.broken` then holds the reason.
        with trial.bound(vessel.top_m, section.speed_m_s).guard():
            fill(trial, factory, last_step)
            trial.run_to(last_step)
        return trial

    def judge(self, outcome: Filling, settings: SceneSettings) -> Verdict:
        """Check a stable run before it is measured, and return its status.

        Parameters
        ----------
        outcome : Filling
            The grains after the filling, or after the taps.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict
            `OK`, or the status of the first check that fails: a grain outside the
            cylinder (``lost``), grains in motion (``not_at_rest``), or a cylinder that
            is not full (``not_full``).
        """
        section = self.section(settings)
        vessel = Vessel.of(section)
        x, y, z = outcome.centres_m.T
        is_outside = (np.hypot(x, y) >= vessel.radius_m) | (z <= 0.0)
        if is_outside.any():
            return Verdict("lost", "a grain lies outside the cylinder")

        advice = "give the grains more time by cylinder.duration_s"
        if outcome.is_tapped:
            advice = "tap from a lower height by cylinder.tap_mm"
        # None if the grains are at rest
        motion_verdict = not_at_rest(outcome.energy_j, settings, advice=advice)
        if motion_verdict is not None:
            return motion_verdict

        fullness_verdict = _judge_fullness(outcome, section)
        return OK if fullness_verdict is None else fullness_verdict

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the bulk density in the cylinder, in its core, and after the taps.

        For the cylinder, a grain counts if its centre lies inside. For the core, which
        is small, a grain counts by the fraction of its volume that lies inside.

        Parameters
        ----------
        arrays : mapping
            Arrays of the run by name, as `run` returns them.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        dict
            The densities [kg/m3], and the number of grains in the cylinder
            (``berries_in_cylinder``). The tapped density is None without taps.
        """
        section = self.section(scene.settings)
        vessel = Vessel.of(section)
        margin_m = 1e-3 * section.core_margin_mm
        # Mass is proportional to the cube of the relative size.
        masses = scene.particle.mass_kg * np.asarray(arrays["scale"], float) ** 3
        # Each density weights the mass of a grain by a number from 0 to 1. For the
        # whole cylinder, this is whether its centre lies inside. No margin is given
        # then.
        is_inside = vessel.contains(np.asarray(arrays["position"], float))
        core_shares = vessel.compute_core_shares(arrays, scene.particle, margin_m)
        tapped_density = None
        if "tapped" in arrays:
            is_inside_tapped = vessel.contains(arrays["tapped"])
            tapped_density = vessel.compute_density_kg_m3(masses, is_inside_tapped)
        return {
            BULK.name: vessel.compute_density_kg_m3(masses, is_inside),
            CORE.name: vessel.compute_density_kg_m3(masses, core_shares, margin_m),
            "berries_in_cylinder": int(is_inside.sum()),
            TAPPED.name: tapped_density,
        }

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        gravity_m_s2 = settings.simulation.gravity_m_s2
        flight_s = _compute_flight_s(gravity_m_s2, 1e-3 * section.tap_mm)
        return section.duration_s + section.taps * (flight_s + TYPICAL_TAP_REST_S)

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield settings with which the cylinder cannot be filled or measured.

        The pour must outlast the last grain, the core must have a volume, and a target
        of the tapped density needs taps.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.

        Yields
        ------
        tuple of str
            A key of the configuration, and the values that are allowed for it.
        """
        section = self.section(settings)
        last_grain_s = last_berry_s(section)
        if last_grain_s >= section.duration_s:
            yield (
                "cylinder.duration_s",
                f"above {last_grain_s:g}: the last grain appears at {last_grain_s:g} s",
            )
        # The core keeps this margin from wall, floor and rim.
        largest_margin_mm = min(section.diameter_mm, section.height_mm) / 2
        if section.core_margin_mm >= largest_margin_mm:
            yield (
                "cylinder.core_margin_mm",
                f"below {largest_margin_mm:g}, or there is no core",
            )
        target_names = [target.get("response") for target in settings.targets_of(NAME)]
        if TAPPED.name in target_names and not section.taps:
            yield "cylinder.taps", "1 or more, since tapped_density_kg_m3 is a target"

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield the diameter if a mean grain does not fit in every orientation.

        `axes_mm` are the full axes of the mean grain.
        """
        longest_mm = max(axes_mm)
        if self.section(settings).diameter_mm <= longest_mm:
            yield (
                "cylinder.diameter_mm",
                f"above {format_significant(longest_mm)}, the length of a mean grain",
            )

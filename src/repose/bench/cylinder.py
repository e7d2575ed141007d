"""The measuring cylinder: bulk density of the grains that fill it to the rim.

Vessel and pouring follow the small container of ISO 17828 (5 litres: 167 mm wide, 228 mm
high; poured from 200 to 300 mm above the rim, struck off level). The wall goes on above
the rim as a collar, so that no grain falls beside the cylinder; what lies above the rim
is struck off when the grains rest. Then the cylinder may be tapped: it falls from a
height, so that its grains leave the floor with the speed of that fall.

A grain belongs to the cylinder if its centre lies below the rim. What protrudes above
the rim then replaces, on average, what is missing below it, so the density depends on no
shape. The core lies `core_margin_mm` away from wall, floor and rim, where grains pack
more loosely than in the middle. Near them grains lie in layers, and a layer whose centres
lie just inside the core would count too much. So the core has the share of each grain's
volume that lies in it.
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
from repose.common.section import Contradictions

if TYPE_CHECKING:
    from repose.grain.particle import Particle

NAME = "cylinder"
# Height of a tap by default.
TAP_MM = 3.0
# Time after a tap until the grains rest, in units of `GrainScale.time_s`; and that of a
# grain of 14 mm, for the cost of a run, which is estimated without a grain.
TAP_REST_TIMES = 10.8
TYPICAL_TAP_REST_S = 0.4
# Points of a grain over which its share in the core is counted.
POINTS = 1000
# Directions in which the surface of a smooth body is looked at.
N_RAYS = 1000

# --- responses ------------------------------------------------------------------------

VESSEL_KEYS = ("cylinder.diameter_mm", "cylinder.height_mm")


def _make_density(
    kind: str, label: str, symbol: str, keys: tuple[str, ...]
) -> Response:
    """Make the response of a density; keys: of the configuration, besides the vessel's."""
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


BULK = _make_density("bulk", "bulk density", "bulk density", ())
CORE = _make_density(
    "core", "bulk density of the core", "core density", ("cylinder.core_margin_mm",)
)
TAPPED = _make_density(
    "tapped", "tapped density", "tapped density", ("cylinder.taps", "cylinder.tap_mm")
)

# --- section of the configuration -----------------------------------------------------


class CylinderSettings(Poured):
    """The section `cylinder` of the configuration; config/README.md explains its keys."""

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

    def density_kg_m3(
        self,
        masses_kg: np.ndarray,
        shares: np.ndarray | Sequence[float],
        margin_m: float = 0.0,
    ) -> float:
        """Compute the density of the grains in the cylinder or in its core.

        Parameters
        ----------
        masses_kg : array
            Masses (N,) of the grains.
        shares : array
            Share (N,) of each grain that lies inside, from 0 to 1.
        margin_m : float, optional
            Distance of the core from wall, floor and rim.
        """
        radius = self.radius_m - margin_m
        height = self.height_m - 2.0 * margin_m
        mass = float(np.asarray(masses_kg) @ np.asarray(shares, float))
        return mass / (math.pi * radius**2 * height)

    def inside(self, points_m: np.ndarray, margin_m: float = 0.0) -> np.ndarray:
        """Mark points (N, 3) in the cylinder, a margin away from wall, floor and rim."""
        x, y, z = np.asarray(points_m, float).T
        is_between_ends = (z > margin_m) & (z < self.height_m - margin_m)
        return is_between_ends & (np.hypot(x, y) < self.radius_m - margin_m)

    def shares_inside(
        self, arrays: Mapping[str, np.ndarray], particle: "Particle", margin_m: float
    ) -> np.ndarray:
        """Compute the share of each grain's volume that lies in the core.

        The share is estimated from `POINTS` points of the body. For a grain that the
        boundary of the core cuts, it has a root mean square error of 0.003. The density
        of the core has a relative error below 1e-3.

        Parameters
        ----------
        arrays : mapping
            ``position`` (N, 3), ``quaternion`` (N, 4) and ``scale`` (N,) of a run.
        particle : Particle
            Body of the grains.
        margin_m : float
            Distance of the core from wall, floor and rim.

        Returns
        -------
        array
            Shares (N,).
        """
        centres = np.asarray(arrays["position"], float)
        quaternions = np.asarray(arrays["quaternion"], float)
        scales = arrays["scale"]
        body_points = points_of(particle)
        shares = np.empty(len(centres))
        for grain, (centre, quaternion, scale) in enumerate(
            zip(centres, quaternions, scales, strict=True)
        ):
            # Bring the points from the body's frame to that of the cylinder.
            rotation = dem.rotation_matrix(quaternion)
            points = centre + scale * body_points @ rotation.T
            shares[grain] = self.inside(points, margin_m).mean()
        return shares


def points_of(particle: "Particle") -> np.ndarray:
    """Spread points evenly over a body.

    The points are those of a Kronecker sequence in the body's box that lie in the body,
    up to `POINTS` of them. The sequence is always the same, and more even than random
    points.

    Parameters
    ----------
    particle : Particle
        The body.

    Returns
    -------
    array
        Points (POINTS, 3) [m] in the body's own frame.
    """
    # A Kronecker sequence takes equal steps along each axis, and its fractional parts
    # fill the unit cube. These steps are powers of the root of x^4 = x + 1.
    steps = 1.2207440846057596 ** -np.arange(1.0, 4.0)
    # Make four times as many points as needed, so that a body that fills only a quarter
    # of its box still gets enough.
    point_numbers = np.arange(1.0, 4 * POINTS)
    unit_cube_points = np.outer(point_numbers, steps) % 1.0

    # Stretch the unit cube to the body's box.
    lower_corner = -particle.support(-np.eye(3))
    points = lower_corner + particle.axes_m * unit_cube_points
    if particle.is_clump:
        is_inside = _in_spheres(points, particle.spheres_m)
    else:
        is_inside = _in_convex_body(points, particle)
    return points[is_inside][:POINTS]


def _in_spheres(points: np.ndarray, spheres_m: np.ndarray) -> np.ndarray:
    """Mark the points (N, 3) that lie in one of the spheres (M, 4): x, y, z, radius."""
    centres = spheres_m[:, :3]
    radii = spheres_m[:, 3]
    distances = np.linalg.norm(points[:, None] - centres, axis=2)
    return (distances < radii).any(axis=1)


def _in_convex_body(points: np.ndarray, particle: "Particle") -> np.ndarray:
    """Mark the points (N, 3) that lie in a convex body.

    A point lies inside if its distance along each of `N_RAYS` directions is below the
    extent of the body along it.
    """
    # Directions on a spiral over the unit sphere, turned by the golden angle each time
    azimuth = np.arange(float(N_RAYS)) * math.pi * (3.0 - math.sqrt(5.0))
    height = np.linspace(-0.999, 0.999, N_RAYS)
    ring_radius = np.sqrt(1.0 - height**2)
    x = ring_radius * np.cos(azimuth)
    y = ring_radius * np.sin(azimuth)
    directions = np.column_stack([x, y, height])
    return (points @ directions.T < particle.support(directions)).all(axis=1)


# --- build and run --------------------------------------------------------------------


def tap(trial: Trial, height_m: float) -> None:
    """Simulate a tap: the cylinder falls from a height, and the grains come to rest.

    In the frame of the cylinder, the stop at the end of the fall throws the grains up to
    that height. So gravity is changed for one time step, in which it gives all grains the
    speed of the fall upwards. The trial is advanced in place.

    Parameters
    ----------
    trial : Trial
        The filled cylinder. Afterwards its gravity is as before.
    height_m : float
        Height of the fall [m].
    """
    simulation = trial.simulation
    settings = trial.scene.simulation

    # The engine reads this array at each time step.
    gravity = simulation.physics.gravity
    usual_gravity = gravity.copy()
    fall_speed = _fall_speed(settings.gravity_m_s2, height_m)
    gravity[2] += fall_speed / settings.time_step_s
    trial.run_to(simulation.steps + 1)
    gravity[:] = usual_gravity

    # Wait until the grains have come down and rest.
    flight_s = _flight_s(settings.gravity_m_s2, height_m)
    rest_s = trial.scene.scale.interval_s(TAP_REST_TIMES)
    trial.run_to(simulation.steps + settings.steps(flight_s + rest_s))


def _fall_speed(gravity_m_s2: float, height_m: float) -> float:
    """Compute the speed of a fall from a height [m/s]."""
    return math.sqrt(2.0 * gravity_m_s2 * height_m)


def _flight_s(gravity_m_s2: float, height_m: float) -> float:
    """Compute the time of a jump to a height and back [s]."""
    return 2.0 * _fall_speed(gravity_m_s2, height_m) / gravity_m_s2


@dataclass(frozen=True)
class Filling(Outcome):
    """The grains in a filled cylinder, by which its run is judged."""

    centres_m: np.ndarray  # (N, 3)
    energy_j: float  # mean kinetic energy of a grain
    length_m: float  # longest axis of a grain of the scale 1
    is_tapped: bool = False


def _describe_filling(trial: Trial) -> Filling:
    """Copy the present state of the grains, by which a run is judged."""
    return Filling(
        centres_m=trial.simulation.positions.copy(),
        energy_j=trial.energy_j(),
        length_m=float(trial.scene.particle.axes_m.max()),
        unstable=trial.broken,
        overlap_share=trial.overlap_share,
    )


def _judge_level(filling: Filling, section: CylinderSettings) -> Verdict | None:
    """Judge whether the cylinder is full.

    It is full if the grains above the rim would make a layer that is as high as a grain
    is long. The heap in the collar is nearly level, so such a layer covers the rim
    everywhere.

    Parameters
    ----------
    filling : Filling
        The filled cylinder.
    section : CylinderSettings
        The section `cylinder` of the configuration.

    Returns
    -------
    Verdict or None
        The fault; None if the cylinder is full.
    """
    height_m = Vessel.of(section).height_m
    n_poured = len(filling.centres_m)
    n_below_rim = int(np.count_nonzero(filling.centres_m[:, 2] < height_m))
    n_above_rim = n_poured - n_below_rim
    # The layer is as dense as the filling below the rim.
    n_layer = math.ceil(n_below_rim * filling.length_m / height_m)
    if n_above_rim < n_layer:
        return Verdict(
            "not_full",
            f"{n_poured} of {section.berries} grains poured, {n_below_rim} of them "
            f"below the rim; a full cylinder has at least {n_layer} above it",
        )
    return None


def _tap_filling(trial: Trial, section: CylinderSettings) -> Filling:
    """Tap a filled cylinder as often as configured, and describe the filling."""
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
        """Describe the cylinder with its collar, as `repose.dem.Simulation` takes it.

        The collar is the part of the wall above the rim. All lengths are in m.

        Parameters
        ----------
        scene : Scene
            The settings of the cylinder.
        largest_radius_m : float
            Bounding radius of the largest grain, which must fit below the end of the
            collar.

        Returns
        -------
        dict
            Capacity in grains, walls by name, and lower and upper corner of the box.
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
        """Fill the cylinder, let the grains rest, and tap it.

        Parameters
        ----------
        scene : Scene
            What the run depends on.
        interval_s : float, optional
            Simulated time between the frames of a film; without it none are recorded.
        progress : function, optional
            Called with the simulated time [s] after every advance.

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
        arrays = trial.grains()
        numbers = {
            "berries_poured": len(filling.centres_m),
            "kinetic_energy_J": filling.energy_j,
        }
        # Only a filling that can be measured is tapped. The last state is judged.
        outcome = filling
        if section.taps and self.status_of(filling, scene.settings).status == "ok":
            outcome = _tap_filling(trial, section)
            arrays["tapped"] = outcome.centres_m.astype(np.float32)
        return self.make_run(scene, outcome, arrays, trial.frames(), **numbers)

    def _fill_cylinder(
        self, scene: Scene, interval_s: float | None, progress: Progress | None
    ) -> Trial:
        """Pour grains into the cylinder for the time `cylinder.duration_s`.

        Parameters
        ----------
        scene, interval_s, progress
            As of `run`.

        Returns
        -------
        Trial
            The cylinder with its grains. It has ended early if a bound is broken.
        """
        section = self.section(scene.settings)
        vessel = Vessel.of(section)
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        # Grains appear at the end of the collar, where none touches the wall.
        area = Disc(vessel.radius_m - trial.largest_radius_m, vessel.top_m)
        factory = Factory(
            area, section.berries, section.rate_per_s, speed_m_s=section.speed_m_s
        )
        last_step = scene.simulation.steps(section.duration_s)
        with trial.bound(vessel.top_m, section.speed_m_s).guard():
            fill(trial, factory, last_step)
            trial.run_to(last_step)
        return trial

    def judge(self, outcome: Filling, settings: SceneSettings) -> Verdict:
        """Judge a stable filling.

        Parameters
        ----------
        outcome : Filling
            The grains after the filling or the taps.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict
            `OK`, or the first fault: a lost grain, motion, a cylinder that is not full.
        """
        section = self.section(settings)
        vessel = Vessel.of(section)
        x, y, z = outcome.centres_m.T
        is_outside = (np.hypot(x, y) >= vessel.radius_m) | (z <= 0.0)
        if is_outside.any():
            return Verdict("lost", "a grain lies outside the cylinder")

        advice = "give the grains more time by cylinder.duration_s"
        if outcome.is_tapped:
            advice = "tap the grains less by cylinder.tap_mm"
        motion_verdict = not_at_rest(outcome.energy_j, settings, advice=advice)
        if motion_verdict is not None:
            return motion_verdict

        level_verdict = _judge_level(outcome, section)
        return OK if level_verdict is None else level_verdict

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the bulk density in the cylinder, in its core, and after the taps.

        A grain counts for the cylinder if its centre lies in it. For the core, which is
        small, a grain counts by the share of its volume that lies in the core.

        Parameters
        ----------
        arrays : mapping
            Arrays of the run by name, as from `run`.
        scene : Scene
            What the run depends on.

        Returns
        -------
        dict
            The densities and the number of grains in the cylinder. The tapped density
            is None without taps.
        """
        section = self.section(scene.settings)
        vessel = Vessel.of(section)
        margin_m = 1e-3 * section.core_margin_mm
        # Mass goes with the cube of the relative size.
        masses = scene.particle.mass_kg * np.asarray(arrays["scale"], float) ** 3
        is_inside = vessel.inside(np.asarray(arrays["position"], float))
        core_shares = vessel.shares_inside(arrays, scene.particle, margin_m)
        tapped_density = None
        if "tapped" in arrays:
            is_inside_tapped = vessel.inside(arrays["tapped"])
            tapped_density = vessel.density_kg_m3(masses, is_inside_tapped)
        return {
            BULK.name: vessel.density_kg_m3(masses, is_inside),
            CORE.name: vessel.density_kg_m3(masses, core_shares, margin_m),
            "berries_in_cylinder": int(is_inside.sum()),
            TAPPED.name: tapped_density,
        }

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        gravity_m_s2 = settings.simulation.gravity_m_s2
        flight_s = _flight_s(gravity_m_s2, 1e-3 * section.tap_mm)
        return section.duration_s + section.taps * (flight_s + TYPICAL_TAP_REST_S)

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield keys of a cylinder that cannot be filled or tapped, or has no core.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.

        Yields
        ------
        tuple of str
            A key of the configuration, and what is allowed.
        """
        section = self.section(settings)
        last_grain_s = last_berry_s(section)
        if last_grain_s >= section.duration_s:
            yield (
                "cylinder.duration_s",
                f"above {last_grain_s:g}: the last grain appears at {last_grain_s:g} s",
            )
        largest_margin_mm = min(section.diameter_mm, section.height_mm) / 2
        if section.core_margin_mm >= largest_margin_mm:
            yield (
                "cylinder.core_margin_mm",
                f"below {largest_margin_mm:g}, or there is no core",
            )
        target_names = [target.get("response") for target in settings.targets_of(NAME)]
        if TAPPED.name in target_names and not section.taps:
            yield "cylinder.taps", "1 or more, for tapped_density_kg_m3 is a target"

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield the diameter if a mean grain does not fall in with any orientation."""
        longest_mm = max(axes_mm)
        if self.section(settings).diameter_mm <= longest_mm:
            yield (
                "cylinder.diameter_mm",
                f"above {longest_mm:.4g}, the length of a mean grain",
            )

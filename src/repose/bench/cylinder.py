"""The measuring cylinder: its bulk density is the mass of the grains struck off at the rim over its volume.

Vessel and pouring follow the small container of ISO 17828 (5 litres: 167 mm wide, 228 mm high; poured from 200 to 300
mm above the rim, struck off level). The wall goes on above the rim as a collar, so that no grain falls beside the
cylinder; what lies above the rim is struck off when the grains rest. Then the cylinder may be tapped: it falls from a
height, so that its grains leave the floor with the speed of that fall.

A grain belongs to the cylinder when its centre lies below the rim. What protrudes above the rim then makes up, on
average, for what is missing below it, and the density depends on no shape. The core lies `core_margin_mm` away from
wall, floor and rim, where grains pack more loosely than in the middle. Near them grains lie in layers, so where a
layer's centres lie just inside the core their count is too high: the core has the share of each grain's volume that
lies in it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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
from repose.bench.factory import Disc, fill, last_berry_s
from repose.bench.scene import Trial
from repose.bench.settings import Poured, SceneSettings, SimulationSettings
from repose.calibrate.responses import Response

if TYPE_CHECKING:
    from repose.grain.particle import Particle

NAME = "cylinder"
TAP_MM, TAP_RESTS_S = 3.0, 0.4  # height of a tap, and time after it
POINTS = 1000  # of a grain, over which its share in the core is counted

# --- responses ------------------------------------------------------------------------------------

VESSEL = ("cylinder.diameter_mm", "cylinder.height_mm")
CORE = (*VESSEL, "cylinder.core_margin_mm")
TAPPED = (*VESSEL, "cylinder.taps", "cylinder.tap_mm")

# --- section of the configuration -----------------------------------------------------------------


class CylinderSettings(Poured):
    """The section `cylinder` of the configuration; config/README.md explains its keys."""

    duration_s: float = Field(ge=0.1, le=600)
    diameter_mm: float = Field(ge=1, le=5000)
    height_mm: float = Field(ge=1, le=5000)
    collar_mm: float = Field(ge=1, le=5000)
    speed_m_s: float = Field(ge=0, le=10)
    core_margin_mm: float = Field(ge=0, le=1000)
    taps: int = Field(default=0, ge=0, le=1000)
    tap_mm: float = Field(default=TAP_MM, ge=0.1, le=100)


# --- build and run --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Vessel:
    """The inside of the cylinder about the z axis, its floor at z = 0, and the collar above its rim."""

    radius_m: float
    height_m: float
    collar_m: float

    @classmethod
    def of(cls, section: CylinderSettings) -> "Vessel":
        """Make the vessel of a section of the configuration."""
        lengths = 0.5 * section.diameter_mm, section.height_mm, section.collar_mm
        return cls(*(1e-3 * length for length in lengths))

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
        """Mass of the shares (N,) of grains in the cylinder, `margin_m` off wall, floor and rim, over its volume."""
        radius, height = self.radius_m - margin_m, self.height_m - 2.0 * margin_m
        return float(np.asarray(masses_kg) @ np.asarray(shares, float)) / (
            math.pi * radius**2 * height
        )

    def inside(self, centres_m: np.ndarray, margin_m: float = 0.0) -> np.ndarray:
        """Mask of the centres that lie in the cylinder, at least `margin_m` away from wall, floor and rim."""
        x, y, z = np.asarray(centres_m, float).T
        between = (z > margin_m) & (z < self.height_m - margin_m)
        return between & (np.hypot(x, y) < self.radius_m - margin_m)

    def shares_inside(
        self, arrays: Mapping[str, np.ndarray], particle: "Particle", margin_m: float
    ) -> np.ndarray:
        """Share of each grain's volume that lies in the cylinder, `margin_m` away from wall, floor and rim.

        Counted over `POINTS` points of the body: the share of a grain that is cut is off by 0.003 (rms), the
        density of a core by less than 1e-3 of itself. `arrays` holds ``position``, ``quaternion`` and ``scale`` of
        a run.
        """
        places, quaternions = (
            np.asarray(arrays[name], float) for name in ("position", "quaternion")
        )
        points = points_of(particle)
        shares = np.empty(len(places))
        for k, (place, scale) in enumerate(zip(places, arrays["scale"], strict=True)):
            around = place + scale * points @ dem.rotation_matrix(quaternions[k]).T
            shares[k] = self.inside(around, margin_m).mean()
        return shares


def points_of(particle: "Particle") -> np.ndarray:
    """Points (POINTS, 3) [m] spread evenly over the volume of a body, in its own frame."""
    low, extent = -particle.support(-np.eye(3)), particle.axes_m
    ratios = 1.2207440846057596 ** -np.arange(
        1.0, 4.0
    )  # a Kronecker sequence: powers of the root of x^4 = x + 1
    points = low + extent * (np.outer(np.arange(1.0, 4 * POINTS), ratios) % 1.0)
    if particle.is_clump:
        centres, radii = particle.spheres_m[:, :3], particle.spheres_m[:, 3]
        inside = (np.linalg.norm(points[:, None] - centres, axis=2) < radii).any(axis=1)
    else:
        turn, height = (
            np.arange(1000.0) * math.pi * (3.0 - math.sqrt(5.0)),
            np.linspace(-0.999, 0.999, 1000),
        )
        ring = np.sqrt(1.0 - height**2)
        rays = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
        inside = (points @ rays.T < particle.support(rays)).all(axis=1)
    return points[inside][:POINTS]


def tap(
    simulation: "dem.Simulation",
    settings: SimulationSettings,
    height_m: float,
    run_to: Callable[[int], object],
) -> None:
    """Let the cylinder fall from a height, and its grains rest: seen from it they jump up by that height."""
    gravity, kept = simulation.physics.gravity, simulation.physics.gravity.copy()
    speed, lasts_s = _of_a_tap(settings.gravity_m_s2, height_m)
    gravity[2] += (
        speed / settings.time_step_s
    )  # in one step the speed of the fall, to all at once
    run_to(simulation.steps + 1)
    gravity[:] = kept
    run_to(simulation.steps + settings.steps(lasts_s))


def _of_a_tap(gravity_m_s2: float, height_m: float) -> tuple[float, float]:
    """Speed of the fall [m/s], and the time until the grains rest [s]."""
    speed = math.sqrt(2.0 * gravity_m_s2 * height_m)
    return speed, 2.0 * speed / gravity_m_s2 + TAP_RESTS_S


@dataclass(frozen=True)
class Filling(Ending):
    """A filled cylinder."""

    centres_m: np.ndarray  # (N, 3)
    energy_j: float  # mean of a grain
    length_m: float  # of a grain


@register(NAME)
class CylinderTest(BenchTest[CylinderSettings]):
    """A measuring cylinder that is filled, struck off at the rim, and may be tapped."""

    settings = CylinderSettings
    responses = (
        Response(
            "bulk_density_kg_m3",
            "kg/m3",
            "bulk density",
            "bulk density",
            NAME,
            0.0,
            25000.0,
            VESSEL,
        ),
        Response(
            "core_density_kg_m3",
            "kg/m3",
            "bulk density of the core",
            "core density",
            NAME,
            0.0,
            25000.0,
            CORE,
        ),
        Response(
            "tapped_density_kg_m3",
            "kg/m3",
            "tapped density",
            "tapped density",
            NAME,
            0.0,
            25000.0,
            TAPPED,
        ),
    )
    numbers = ("berries_in_cylinder",)
    statuses = ("ok", "unstable", "lost", "not_at_rest", "not_full")
    measured_by = ("core_margin_mm",)
    required_arrays = ("position", "quaternion", "scale")
    summary = (
        "bulk density {bulk_density_kg_m3:.0f} kg/m3, in the core {core_density_kg_m3:.0f}, "
        "{berries_in_cylinder} grains in the cylinder"
    )

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe the cylinder with its collar."""
        section = self.section(scene.settings)
        vessel, floor, up = Vessel.of(section), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
        wall_m, shell_m = vessel.top_m + 2.0 * reach_m, vessel.radius_m
        shell = dem.Cylinder(floor, up, wall_m, shell_m, "wall")
        return {
            "capacity": section.berries,
            "walls": {"floor": dem.Plane(floor, up, "wall"), "shell": shell},
            "lower": (-shell_m, -shell_m, 0.0),
            "upper": (shell_m, shell_m, wall_m),
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the cylinder, let the grains rest, and tap it.

        The arrays are ``position``, ``quaternion`` and ``scale``, and with taps the positions after them, ``tapped``.
        """
        section, settings = self.section(scene.settings), scene.simulation
        vessel, last_step = Vessel.of(section), settings.steps(section.duration_s)
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        length_m = float(scene.particle.axes_m.max())

        def filling() -> Filling:
            return Filling(
                trial.simulation.positions.copy(),
                trial.energy_j(),
                length_m,
                unstable=trial.broken,
            )

        with trial.bound(vessel.top_m, section.speed_m_s).guard():
            fill(
                trial,
                Disc(vessel.radius_m - trial.reach_m, vessel.top_m),
                section,
                last_step,
            )
            trial.run_to(last_step)
        filled = ending = filling()
        arrays = trial.grains()
        if section.taps and self.status_of(filled, scene.settings)[0] == "ok":
            with trial.bounded.guard():
                for _ in range(section.taps):
                    tap(trial.simulation, settings, 1e-3 * section.tap_mm, trial.run_to)
            ending = filling()
            arrays["tapped"] = ending.centres_m.astype(np.float32)
        numbers = {
            "berries_poured": len(filled.centres_m),
            "kinetic_energy_J": filled.energy_j,
        }
        return self.ended(scene, ending, arrays, trial.frames(), **numbers)

    def faults(self, ending: Filling, settings: SceneSettings) -> Faults:
        """Judge a filling.

        The cylinder is full when the grains above the rim would make a layer of a grain's length there: the heap in
        the collar is nearly level, so the rim is covered everywhere.
        """
        section, centres = self.section(settings), ending.centres_m
        vessel = Vessel.of(section)
        below = int(np.count_nonzero(centres[:, 2] < vessel.height_m))
        layer = math.ceil(below * ending.length_m / vessel.height_m)
        poured = f"{len(centres)} of {section.berries} grains poured, {below} of them below the rim"
        outside = np.any(np.hypot(*centres.T[:2]) >= vessel.radius_m) or np.any(
            centres[:, 2] <= 0.0
        )
        return stated(
            (outside, "lost", "a grain lies outside the cylinder"),
            settings.simulation.not_at_rest(ending.energy_j),
            (
                len(centres) - below < layer,
                "not_full",
                f"{poured}; a full cylinder has at least {layer} above it",
            ),
        )

    def values(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the densities."""
        section, centres = (
            self.section(scene.settings),
            np.asarray(arrays["position"], float),
        )
        vessel, margin = Vessel.of(section), 1e-3 * section.core_margin_mm
        masses = scene.particle.mass_kg * np.asarray(arrays["scale"], float) ** 3
        shares, inside = (
            vessel.shares_inside(arrays, scene.particle, margin),
            vessel.inside(centres),
        )
        tapped = (
            vessel.density_kg_m3(masses, vessel.inside(arrays["tapped"]))
            if "tapped" in arrays
            else None
        )
        return {
            "bulk_density_kg_m3": vessel.density_kg_m3(masses, inside),
            "core_density_kg_m3": vessel.density_kg_m3(masses, shares, margin),
            "berries_in_cylinder": int(inside.sum()),
            "tapped_density_kg_m3": tapped,
        }

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        tap_s = _of_a_tap(settings.simulation.gravity_m_s2, 1e-3 * section.tap_mm)[1]
        return section.duration_s + section.taps * tap_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield keys of a cylinder that cannot be filled or has no core, with what is allowed."""
        section, last = self.section(settings), last_berry_s(self.section(settings))
        half = min(section.diameter_mm, section.height_mm) / 2
        is_tapped = any(
            one.get("response") == "tapped_density_kg_m3"
            for one in settings.targets_of(NAME)
        )
        missing = is_tapped and not section.taps
        return stated(
            (
                last >= section.duration_s,
                f"{NAME}.duration_s",
                f"above {last:g}: the last grain appears at {last:g} s",
            ),
            (
                section.core_margin_mm >= half,
                f"{NAME}.core_margin_mm",
                f"below {half:g}, or there is no core",
            ),
            (
                missing,
                f"{NAME}.taps",
                "1 or more, for tapped_density_kg_m3 is a target",
            ),
        )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Refuse a cylinder into which the mean grain does not fall in any orientation."""
        longest = max(axes_mm)
        narrow = self.section(settings).diameter_mm <= longest
        return stated(
            (
                narrow,
                f"{NAME}.diameter_mm",
                f"above {longest:.4g}, the length of a mean grain",
            )
        )

"""The funnel: grains are poured onto a plate and come to rest as a pile (paper, section 3.1).

A pour that gives no pile to measure has a status and a reason instead of numbers.
"""

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

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
from repose.bench.scene import Trial, kept_grains, largest_cluster
from repose.bench.settings import Hopper, SceneSettings
from repose.calibrate.responses import Response
from repose.calibrate.runs import Recorded
from repose.common.section import OF_OTHERS, OrAuto, Section
from repose.measure.angles import MEAN_KEYS, VIEW_KEYS

if TYPE_CHECKING:
    from repose.dem import Cone, RingEdge

NAME = "funnel"
# A pile that has lost more than this share of its grains over the edge of the plate is not the pile poured.
LARGEST_LOSS = 0.1
# Of the grains on the plate, those that touch each other; in 2810 pours of the article's study and ours at least 86 %.
SMALLEST_PILE = 0.5
FEWEST_IN_PILE = 10
# Share of a pile's volume that grains fill, as poured.
PACKING = 0.6
# Below this height a grain has left the plate and is gone.
FLOOR_M = -0.05
# A pour ends before its time when its pile rests. That is looked at so often in a `rest_window_s`.
LOOKS = 4
# At its speed a grain at rest would move by this share of `rest_motion_mm` in a window.
STANDSTILL = 0.01

# --- responses ------------------------------------------------------------------------------------

# The keys of `measure` that define the silhouette of a pile, and the line along its flank.
SEEN = ("measure.views", "measure.mm_per_pixel", "measure.largest_pile_only")
BERRY = "measure.berry_height_mm"
LINE = ("measure.flank", "measure.fit_from", "measure.fit_to", BERRY)
WINDOW = ("measure.smallest_window",)
# Of the angle of repose, whichever definition is calibrated.
CALIBRATED = (*LINE, *WINDOW, "measure.response")
PLATE = ("funnel.plate_diameter_mm",)


def _angle(definition: str, label: str, keys: tuple[str, ...]) -> Response:
    """Make the response of the angle by one definition, whichever is the angle of repose."""
    return Response(
        f"aor_{definition}_deg",
        "deg",
        label,
        definition,
        NAME,
        0.0,
        89.0,
        (*SEEN, *keys),
    )


RESPONSES = (
    Response(
        "aor_deg",
        "deg",
        "angle of repose",
        "AoR",
        NAME,
        1.0,
        89.0,
        (*SEEN, *CALIBRATED),
    ),
    Response("height_mm", "mm", "Height", "Height", NAME, 1.0, 2000.0, SEEN),
    _angle("flank", "angle, flank", LINE),
    _angle("secant", "angle, secant", (BERRY,)),
    _angle("steepest", "angle, steepest", LINE),
    _angle("whole", "angle, whole side", ()),
    _angle("straightest", "angle, straightest window", WINDOW),
    Response(
        "base_radius_mm",
        "mm",
        "base radius",
        "base radius",
        NAME,
        0.0,
        1e4,
        (*SEEN, BERRY),
    ),
    Response(
        "lower_deg",
        "deg",
        "lower flank",
        "lower flank",
        NAME,
        0.0,
        89.0,
        (*SEEN, BERRY),
    ),
    Response(
        "upper_deg",
        "deg",
        "upper flank",
        "upper flank",
        NAME,
        0.0,
        89.0,
        (*SEEN, BERRY),
    ),
    Response(
        "packing_percent", "%", "packing", "packing", NAME, 0.0, 100.0, (*SEEN, BERRY)
    ),
    Response(
        "radius_90_mm",
        "mm",
        "radius of 90 % of the grains",
        "radius of 90 %",
        NAME,
        0.0,
        1e4,
        PLATE,
    ),
    Response("loose_percent", "%", "loose grains", "loose", NAME, 0.0, 100.0, PLATE),
    Response("discharge_s", "s", "discharge time", "discharge", NAME, 0.0, 1e4),
)
# Measured on every pile beside the angle of repose and the Height; the other responses where they are targets.
BESIDE = ("height_view_mm", *MEAN_KEYS.values(), *VIEW_KEYS.values())
ALWAYS = ("aor_deg", "height_mm", *BESIDE)
COUNTED = ("berries_on_plate", "berries_in_pile", "kinetic_energy_J")
RECORDED = Recorded(
    means=("aor_deg", "height_mm", "discharge_s", *BESIDE),
    without_error=("discharge_s",),
    single=("aor_deg", "height_mm", "discharge_s", *COUNTED, *BESIDE),
)


# --- its inner surfaces -------------------------------------------------------------------------


class ConeLine(NamedTuple):
    """The line of a cone in the half plane (r, z), as `repose.dem.Cone` takes it; lengths in m.

    The unit normal points from the inside into the wall; normal . (r, z) = offset. first and last are places along
    the line, (up_r, up_z) is the unit vector up along it.
    """

    normal_r: float
    normal_z: float
    offset: float
    first: float
    last: float
    up_r: float
    up_z: float


@dataclass(frozen=True)
class Funnel:
    """Inner surfaces of a funnel whose axis is z, all edges rounded; a tube may follow the cone."""

    inlet_diameter_m: float  # of the upper circle
    outlet_diameter_m: float  # of the narrowest circle
    cone_angle_deg: float  # slope from the horizontal
    tube_length_m: float  # below the cone; 0 without a tube
    rim_radius_m: float  # of all rounded edges
    outlet_height_m: float  # of the narrowest circle above the plate

    @classmethod
    def of(cls, hopper: Hopper, outlet_height_mm: float) -> "Funnel":
        """Make the funnel of a section, its outlet at a height above the plate."""
        inlet, outlet = (
            1e-3 * hopper.inlet_diameter_mm,
            1e-3 * hopper.outlet_diameter_mm,
        )
        tube, rim = 1e-3 * hopper.tube_length_mm, 1e-3 * hopper.rim_radius_mm
        return cls(
            inlet, outlet, hopper.cone_angle_deg, tube, rim, 1e-3 * outlet_height_mm
        )

    @property
    def inlet_height_m(self) -> float:
        """Height of the inlet's circle above the plate [m]."""
        return self.cone_line().last * math.sin(self._slope) + self._foot[1]

    @property
    def neck_height_m(self) -> float:
        """Height at which the cone ends [m]: at the outlet, or at the tube's upper end."""
        return self.outlet_height_m + self.tube_length_m

    @property
    def _slope(self) -> float:
        """Slope of the cone [rad]."""
        return math.radians(self.cone_angle_deg)

    @property
    def _core_m(self) -> float:
        """Radius of the circle about which the cone's lower edge is rounded [m]."""
        return 0.5 * self.outlet_diameter_m + self.rim_radius_m

    @property
    def _offset(self) -> float:
        """Offset of the cone's line [m]: it is tangent to the rounded edge below it."""
        return (
            math.sin(self._slope) * self._core_m
            - math.cos(self._slope) * self.neck_height_m
            - self.rim_radius_m
        )

    @property
    def _foot(self) -> tuple[float, float]:
        """Point (r, z) [m] of the cone's line from which places along it are measured, the nearest to the origin."""
        return self._offset * math.sin(self._slope), -self._offset * math.cos(
            self._slope
        )

    def cone_line(self) -> ConeLine:
        """Compute the cone's line, from the rounded edge up to the inlet."""
        sin, cos = math.sin(self._slope), math.cos(self._slope)
        foot_r, foot_z = self._foot
        last = (0.5 * self.inlet_diameter_m - foot_r) / cos
        last += cos * foot_r + sin * foot_z
        first = cos * self._core_m + sin * self.neck_height_m
        return ConeLine(sin, -cos, self._offset, first, last, cos, sin)

    def walls(self, material: str) -> "dict[str, Cone | RingEdge]":
        """Cone and outlet, and with a tube also tube and neck, by name."""
        up, edge = (math.cos(self._slope), math.sin(self._slope)), self.rim_radius_m
        walls: dict[str, Cone | RingEdge] = {
            "cone": dem.Cone(self.cone_line(), material)
        }
        if self.tube_length_m == 0.0:
            walls["outlet"] = dem.RingEdge(
                self._core_m, edge, material, (up, (0.0, 0.0)), self.outlet_height_m
            )
            return walls
        radius, top = 0.5 * self.outlet_diameter_m, self.neck_height_m
        walls["tube"] = dem.Cone(
            ConeLine(1.0, 0.0, radius, self.outlet_height_m, top, 0.0, 1.0), material
        )
        walls["neck"] = dem.RingEdge(
            self._core_m, edge, material, (up, (0.0, -1.0)), top
        )
        walls["outlet"] = dem.RingEdge(
            self._core_m, edge, material, ((0.0, 1.0), (0.0, 0.0)), self.outlet_height_m
        )
        return walls


# --- section of the configuration -----------------------------------------------------------------


class FunnelSettings(Hopper):
    """The section `funnel` of the configuration; config/README.md explains its keys."""

    duration_s: OrAuto[Annotated[float, Field(ge=0.1, le=600)]] = OF_OTHERS
    outlet_height_mm: float = Field(ge=1, le=2000)
    plate_diameter_mm: float = Field(ge=10, le=20000)
    factory_height_mm: OrAuto[Annotated[float, Field(ge=0, le=1000)]] = OF_OTHERS
    factory_diameter_mm: OrAuto[Annotated[float, Field(ge=1, le=5000)]] = OF_OTHERS
    orientation: Literal["random", "lying", "upright"]
    rest_motion_mm: float = Field(gt=0, le=100)
    rest_window_s: float = Field(ge=0.001, le=100)

    @property
    def funnel(self) -> Funnel:
        """Its inner surfaces."""
        return Funnel.of(self, self.outlet_height_mm)


def narrow_openings(
    section: Section, name: str, sizes_mm: Mapping[str, float]
) -> Contradictions:
    """Yield keys of openings that are at most as wide as a mean grain, whose size is given for each key."""
    for key, size in sizes_mm.items():
        if getattr(section, key) <= size:
            yield f"{name}.{key}", f"above {size:.4g}, the size of a mean grain"


def impossible_surfaces(hopper: Hopper, name: str) -> Contradictions:
    """Yield keys of a funnel that cannot be built, with the allowed values."""
    inlet, outlet = hopper.inlet_diameter_mm, hopper.outlet_diameter_mm
    wall = (inlet - outlet) / 4
    thick = f"at most {wall:g}, or no cone is left between inlet and outlet"
    return stated(
        (
            outlet >= inlet,
            f"{name}.outlet_diameter_mm",
            f"below {name}.inlet_diameter_mm, {inlet:g}",
        ),
        (hopper.rim_radius_mm > wall, f"{name}.rim_radius_mm", thick),
    )


# --- run ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pour(Ending):
    """The final state of a pour of N grains, and the numbers by which it is judged."""

    centres_m: np.ndarray  # (N, 3)
    quaternions: np.ndarray  # (N, 4)
    scales: np.ndarray  # (N,)
    on_plate: np.ndarray  # (N,), which grains lie there
    in_pile: np.ndarray  # (N,), which of them lie in the largest cluster
    in_funnel: int  # grains that are still there
    off_plate: int  # grains that have left the plate
    kinetic_energy_j: float  # of the pile
    largest_motion_m: (
        float  # farthest way of a grain on the plate in the last `rest_window_s`
    )
    discharge_s: float  # from the first to the last grain that left the outlet; NaN where none did
    wall_s: float  # wall time of the pour
    us_per_step: float  # wall time of a time step in the last second of `duration_s`, or since the last grain
    frames: dict[str, np.ndarray] | None  # see `repose.bench.scene.Trial.frames`


def _rests(
    simulation: "dem.Simulation",
    section: FunnelSettings,
    funnel: Funnel,
    seen: Sequence[np.ndarray],
) -> bool:
    """Whether all grains lie outside the funnel, have hardly moved in the last window and nearly stand still."""
    there = simulation.present
    if len(seen) <= LOOKS or simulation.n_bodies < section.berries or not there.any():
        return False
    motion_m = 1e-3 * section.rest_motion_mm
    turning = np.linalg.norm(simulation.angular_velocities, axis=1) * simulation.radius
    speed = (np.linalg.norm(simulation.velocities, axis=1) + turning)[there].max()
    return bool(
        speed * section.rest_window_s <= STANDSTILL * motion_m
        and np.linalg.norm(seen[-1] - seen[0], axis=1)[there].max() <= motion_m
        and (seen[-1][there, 2] <= funnel.outlet_height_m - simulation.radius).all()
    )


def _judge(
    simulation: "dem.Simulation",
    funnel: Funnel,
    before: np.ndarray | None,
    **known: Any,
) -> Pour:
    """Sort the grains into pile, plate, funnel and lost, and measure their motion; `known` are the other numbers."""
    centres = simulation.positions.copy()
    present = simulation.present
    # a grain hanging in the outlet has its centre a little below the rim
    in_funnel = present & (centres[:, 2] > funnel.outlet_height_m - simulation.radius)
    on_plate = present & (centres[:, 2] > 0.0) & ~in_funnel
    in_pile = largest_cluster(simulation.contacts(), on_plate)
    exits = simulation.exit_times_s
    exits = exits[np.isfinite(exits)]
    pile_energy = simulation.kinetic_energies()[in_pile]
    motion = np.linalg.norm(centres - (centres if before is None else before), axis=1)[
        on_plate
    ]
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
        **known,
    )


@register(NAME)
class FunnelTest(BenchTest[FunnelSettings]):
    """A pile that is poured through a funnel."""

    settings = FunnelSettings
    responses = RESPONSES
    recorded = RECORDED
    statuses = ("ok", "jammed", "not_at_rest", "no_flank", "left_plate", "unstable")
    required_arrays = ("position", "quaternion", "in_pile")
    photographed: ClassVar = {"aor_deg": "aor_deg", "height_mm": "height_mm"}
    summary = "angle of repose {aor_deg:.2f} deg, Height {height_mm:.1f} mm, {berries_on_plate} grains on the plate"

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe funnel and plate."""
        section = self.section(scene.settings)
        funnel, plate_radius = section.funnel, 0.5e-3 * section.plate_diameter_mm
        half = max(plate_radius, 0.5 * funnel.inlet_diameter_m) + 2.0 * reach_m
        plate = dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", plate_radius)
        return {
            "capacity": section.berries,
            "walls": {"plate": plate, **funnel.walls("wall")},
            "lower": (-half, -half, 0.0),
            "upper": (half, half, funnel.inlet_height_m + 4.0 * reach_m),
            "exit_height_m": funnel.outlet_height_m,
            "curved_walls_above_m": funnel.outlet_height_m - funnel.rim_radius_m,
            "floor_height_m": FLOOR_M,
        }

    def pour(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
        until_rest: bool = True,
    ) -> Pour:
        """Pour the grains until they rest, for `duration_s` at most (section 3.1 of the paper), or for all of it."""
        section, settings = self.section(scene.settings), scene.simulation
        began = time.perf_counter()
        trial, funnel = (
            Trial(self.build, scene, section.berries, interval_s, progress),
            section.funnel,
        )
        simulation, height = (
            trial.simulation,
            funnel.inlet_height_m + 1e-3 * section.factory_height_mm,
        )
        factory = Disc(0.5e-3 * section.factory_diameter_mm - trial.reach_m, height)
        last_step = settings.steps(section.duration_s)
        window = settings.steps(section.rest_window_s)
        clock, timed = began, 0
        seen: deque[np.ndarray] = deque(maxlen=LOOKS + 1)
        with trial.bound(height).guard():
            fill(trial, factory, section, last_step - window)
            clock, timed = time.perf_counter(), simulation.steps
            every = max(1, window // LOOKS)
            for step in range(
                last_step - (last_step - timed) // every * every, last_step + 1, every
            ):
                trial.run_to(step)
                if step <= last_step - settings.steps(1.0):
                    clock, timed = time.perf_counter(), step
                seen.append(simulation.positions.copy())
                if until_rest and _rests(simulation, section, funnel, seen):
                    break
        known = {
            "us_per_step": 1e6
            * (time.perf_counter() - clock)
            / max(1, simulation.steps - timed)
        }
        known["wall_s"] = time.perf_counter() - began
        before = seen[0] if seen else None
        return _judge(
            simulation,
            funnel,
            before,
            unstable=trial.broken,
            frames=trial.frames(),
            **known,
        )

    def faults(self, ending: Pour, settings: SceneSettings) -> Faults:
        """Judge a pour before it is measured."""
        section = self.section(settings)
        n, off, waiting = (
            section.berries,
            ending.off_plate,
            section.berries - len(ending.centres_m),
        )
        hanging = f"{ending.in_funnel} grains in the funnel and {waiting} not yet poured at the end"
        in_pile, there = int(ending.in_pile.sum()), int(ending.on_plate.sum())
        energy, most_mm = (
            ending.kinetic_energy_j / max(1, in_pile),
            section.rest_motion_mm,
        )
        moved_mm, window = (
            1e3 * ending.largest_motion_m,
            f"the last {section.rest_window_s:g} s",
        )
        least = f"a pile has at least {FEWEST_IN_PILE} and {100 * SMALLEST_PILE:g} % of them"
        apart = (
            f"{in_pile} of {there} grains touch each other in the largest pile; {least}"
        )
        moved = f"a grain moved {moved_mm:.2f} mm in {window}, more than {most_mm:g}"
        return stated(
            (ending.in_funnel or waiting > 0, "jammed", hanging),
            (
                off > LARGEST_LOSS * n,
                "left_plate",
                f"{off} of {n} grains left the plate",
            ),
            settings.simulation.not_at_rest(energy),
            (moved_mm > most_mm, "not_at_rest", moved),
            (in_pile < max(FEWEST_IN_PILE, SMALLEST_PILE * there), "no_flank", apart),
        )

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Pour once and judge the pour; status ``no_flank`` comes with the measurement."""
        poured = self.pour(scene, interval_s, progress)
        on_plate, in_pile = int(poured.on_plate.sum()), int(poured.in_pile.sum())
        numbers = {
            "discharge_s": poured.discharge_s,
            "berries_on_plate": on_plate,
            "berries_in_pile": in_pile,
        }
        numbers |= {
            "berries_off_plate": poured.off_plate,
            "kinetic_energy_J": poured.kinetic_energy_j,
        }
        arrays = kept_grains(
            poured.centres_m, poured.quaternions, poured.scales, in_pile=poured.in_pile
        )
        return self.ended(scene, poured, arrays, poured.frames, **numbers)

    def measure(
        self, record: Mapping[str, Any], arrays: Arrays, scene: Scene
    ) -> dict[str, Any]:
        """Return the record of a pour with `ALWAYS` and the other responses that are targets."""
        from repose.measure.saved_piles import pile_responses

        targets = [
            response.name for response in self.target_responses(scene.settings.config)
        ]
        more = [name for name in targets if name not in ALWAYS and name not in record]
        judged = {key: record[key] for key in ("seed", "status", "reason")}
        measured = dict.fromkeys((*ALWAYS, *more))
        if record["status"] == "ok":
            plate_mm = self.section(scene.settings).plate_diameter_mm
            responses, reasons = pile_responses(
                arrays, scene.particle, scene.measure, plate_mm, more
            )
            measured |= responses
            judged |= self.assess({**record, **measured}, scene.settings, reasons)
        return (
            judged
            | measured
            | {key: value for key, value in record.items() if key not in judged}
        )

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a pour [s]."""
        return self.section(settings).duration_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield keys of a funnel that cannot be built, or of a pour that cannot end, with the allowed values."""
        section = self.section(settings)
        inlet, outlet = section.inlet_diameter_mm, section.outlet_diameter_mm
        duration, window, last = (
            section.duration_s,
            section.rest_window_s,
            last_berry_s(section),
        )
        coarse, end = (
            settings.simulation.time_step_s > window / 2,
            f"above {last + window:g}",
        )
        wide, small = (
            section.factory_diameter_mm > inlet,
            section.plate_diameter_mm < outlet,
        )
        step = f"at most half of funnel.rest_window_s, {window:g}"
        yield from stated((coarse, "simulation.time_step_s", step))
        yield from impossible_surfaces(section, NAME)
        yield from stated(
            (
                wide,
                "funnel.factory_diameter_mm",
                f"at most funnel.inlet_diameter_mm, {inlet:g}",
            ),
            (
                small,
                "funnel.plate_diameter_mm",
                f"at least funnel.outlet_diameter_mm, {outlet:g}",
            ),
            (
                window >= duration,
                "funnel.rest_window_s",
                f"below funnel.duration_s, {duration:g}",
            ),
            (
                last >= duration - window,
                "funnel.duration_s",
                f"{end}: the last grain appears at {last:g} s",
            ),
        )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield keys of openings that are too narrow for the mean grain, with the allowed values."""
        sizes = {"outlet_diameter_mm": axes_mm[2], "factory_diameter_mm": axes_mm[0]}
        return narrow_openings(self.section(settings), NAME, sizes)

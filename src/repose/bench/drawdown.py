"""The drawdown box: a chamber with a slot in its floor is filled and drained into the chamber below.

One filling gives two angles. Above, the grains that stay lean against both walls and fall off towards the slot: the
angle at which a bed drains. Below, those that fell lie as a pile of the box's depth: the angle at which a poured heap
comes to rest, flatter for the fall. Mass and rate of what drains come with them.

The two wedges above, put back to back, have the shape of a pile. So both angles are measured by the code and the
definition (`measure.response`) of every pile, in the view along the slot. The gate is taken away downwards, faster than
the grains fall, so that it drags none of them along.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

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
from repose.bench.discharge import LID_M_S, rate_kg_s
from repose.bench.factory import Strip, fill_and_rest, too_early
from repose.bench.funnel import CALIBRATED, narrow_openings
from repose.bench.scene import Trial, largest_cluster
from repose.bench.settings import Poured, SceneSettings
from repose.calibrate.responses import Response
from repose.common.errors import NoFlankError

NAME = "drawdown"
LOOK_S = 0.05  # simulated time between two looks whether the grains rest
HALVES = ("width", "depth", "slot", "lower_width")  # keys whose halves a `Box` has
FACES = (
    (0, 1, 3, 2),
    (4, 6, 7, 5),
    (0, 4, 5, 1),
    (2, 3, 7, 6),
    (0, 2, 6, 4),
    (1, 5, 7, 3),
)  # of a block

# --- responses ------------------------------------------------------------------------------------

BOX = tuple(
    f"{NAME}.{key}"
    for key in (
        "berries",
        "width_mm",
        "depth_mm",
        "slot_mm",
        "lower_width_mm",
        "drop_mm",
    )
)
SEEN = (*BOX, "measure.mm_per_pixel", *CALIBRATED)

# --- section of the configuration -----------------------------------------------------------------


class DrawdownSettings(Poured):
    """The section `drawdown` of the configuration; config/README.md explains its keys."""

    open_from_s: float = Field(ge=0.1, le=600)
    longest_s: float = Field(ge=0.1, le=600)
    width_mm: float = Field(ge=10, le=5000)
    depth_mm: float = Field(ge=1, le=5000)
    height_mm: float = Field(ge=1, le=5000)
    slot_mm: float = Field(ge=1, le=5000)
    floor_mm: float = Field(ge=0.5, le=100)
    edge_radius_mm: float = Field(ge=0.05, le=20)
    lower_width_mm: float = Field(ge=10, le=20000)
    drop_mm: float = Field(ge=1, le=5000)


# --- build and run --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Box:
    """The box: x across the slot, y along it, z up from the lower floor; all lengths in m."""

    half_width: float
    half_depth: float
    half_slot: float
    half_lower: float
    floor: float  # height of the upper floor's upper side
    thickness: float  # of upper floor, its walls and the gate
    top: float  # of the upper chamber

    @classmethod
    def of(cls, section: DrawdownSettings) -> "Box":
        """Make the box of a section of the configuration."""
        width, depth, slot, lower = (
            0.5e-3 * getattr(section, f"{key}_mm") for key in HALVES
        )
        drop, thickness = 1e-3 * section.drop_mm, 1e-3 * section.floor_mm
        return cls(
            width, depth, slot, lower, drop, thickness, drop + 1e-3 * section.height_mm
        )

    @property
    def gate(self) -> float:
        """Height of the gate's upper side, the lower side of the floor."""
        return self.floor - self.thickness

    def walls(
        self, edge_radius_m: float, room_m: float
    ) -> "dict[str, dem.Plane | dem.Mesh]":
        """All walls by name; the upper ones are `room_m` higher than the chamber."""
        y, t = self.half_depth + 2.0 * self.thickness, self.thickness
        walls: dict[str, dem.Plane | dem.Mesh] = {
            "lower_floor": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall"),
            "front": dem.Plane((0.0, -self.half_depth, 0.0), (0.0, 1.0, 0.0), "wall"),
            "back": dem.Plane((0.0, self.half_depth, 0.0), (0.0, -1.0, 0.0), "wall"),
        }
        for name, side in (("left", -1.0), ("right", 1.0)):
            walls[f"lower_{name}"] = dem.Plane(
                (side * self.half_lower, 0.0, 0.0), (-side, 0.0, 0.0), "wall"
            )
            floor = side * self.half_slot, side * (self.half_width + t)
            wall = side * self.half_width, side * (self.half_width + t)
            walls[f"{name}_floor"] = _block(
                floor, (-y, y), (self.gate, self.floor), edge_radius_m
            )
            walls[f"{name}_wall"] = _block(
                wall, (-y, y), (self.gate, self.top + room_m), edge_radius_m
            )
        across = (-self.half_slot - t, self.half_slot + t)
        walls["gate"] = _block(
            across, (-y, y), (self.gate - t, self.gate), edge_radius_m
        )
        return walls

    def holds(self, centres_m: np.ndarray) -> np.ndarray:
        """Mask (N,) of the grains whose centres lie inside the box."""
        x, y, z = centres_m.T
        return (np.abs(x) < self.half_lower) & (np.abs(y) < self.half_depth) & (z > 0.0)


def _block(
    x: Sequence[float], y: Sequence[float], z: Sequence[float], edge_radius_m: float
) -> "dem.Mesh":
    """Make a rectangular block as a wall of triangles, between two places along each axis."""
    corners = np.array(
        [(a, b, c) for a in sorted(x) for b in sorted(y) for c in sorted(z)]
    )
    faces = [triangle for a, b, c, d in FACES for triangle in ((a, b, c), (a, c, d))]
    return dem.Mesh(corners, np.array(faces), "wall", edge_radius_m)


@dataclass(frozen=True)
class Drained(Ending):
    """A box that was drained."""

    filled: int  # grains that found room in the upper chamber
    early: int  # grains that were below the gate before it was opened
    held: bool  # whether all grains are inside the box
    over_slot: int  # grains that rest above the middle of the slot
    energy_j: float  # mean of a grain at the end


def back_to_back(centres_m: np.ndarray, box: Box) -> np.ndarray:
    """Move the grains of both wedges, their outer walls at x = 0 and the floor at z = 0: the shape of a pile."""
    moved = centres_m - (0.0, 0.0, box.floor)
    moved[:, 0] -= np.sign(moved[:, 0]) * box.half_width
    return moved


@register(NAME)
class DrawdownTest(BenchTest[DrawdownSettings]):
    """A box that is filled and drained through a slot."""

    settings = DrawdownSettings
    responses = (
        Response(
            "drawdown_above_deg",
            "deg",
            "drawdown, angle above",
            "above",
            NAME,
            1.0,
            89.0,
            SEEN,
        ),
        Response(
            "drawdown_below_deg",
            "deg",
            "drawdown, angle below",
            "below",
            NAME,
            1.0,
            89.0,
            SEEN,
        ),
        Response(
            "drawdown_mass_g",
            "g",
            "drawdown, mass below",
            "mass below",
            NAME,
            0.0,
            1e7,
            BOX,
        ),
        Response(
            "drawdown_flow_g_s", "g/s", "drawdown, rate", "rate", NAME, 0.0, 1e6, BOX
        ),
    )
    numbers = ("berries_below",)
    statuses = (
        "ok",
        "unstable",
        "not_filled",
        "lost",
        "not_at_rest",
        "jammed",
        "no_flank",
    )
    required_arrays = ("position", "quaternion", "scale", "exit_s", "in_pile")
    summary = (
        "{drawdown_above_deg:.1f} deg above, {drawdown_below_deg:.1f} deg below, "
        "{drawdown_mass_g:.0f} g at {drawdown_flow_g_s:.0f} g/s"
    )

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe the box, its gate closed."""
        section = self.section(scene.settings)
        box = Box.of(section)
        return {
            "capacity": section.berries,
            "walls": box.walls(1e-3 * section.edge_radius_mm, 4.0 * reach_m),
            "lower": (-box.half_lower, -box.half_depth, 0.0),
            "upper": (box.half_lower, box.half_depth, box.top + 4.0 * reach_m),
            "exit_height_m": box.gate,
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the upper chamber, let the grains rest, open the gate, and let what stays and what fell rest.

        The arrays are ``position`` (N, 3), ``quaternion`` (N, 4) and ``scale`` (N,) at the end, ``exit_s`` (N,), when
        each grain left the slot after the opening [s], NaN where it stayed, and ``in_pile`` (N,), the largest cluster
        below.
        """
        section, settings = self.section(scene.settings), scene.simulation
        box, every = Box.of(section), max(1, settings.steps(LOOK_S))
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        simulation, reach = trial.simulation, trial.reach_m
        factory = Strip(box.half_width - reach, box.half_depth - reach, box.top + reach)
        filled, early, opened_s = 0, 0, np.nan
        with trial.bound(factory.height_m, LID_M_S).guard():
            fill_and_rest(trial, factory, section, section.open_from_s, every)
            filled, opened_s = simulation.n_bodies, simulation.time_s
            early = int(np.isfinite(simulation.exit_times_s).sum())
            simulation.set_motion("gate", dem.Motion(velocity_m_s=(0.0, 0.0, -LID_M_S)))
            # until it lies below the lower floor
            trial.run_to(simulation.steps + settings.steps(box.floor / LID_M_S))
            simulation.set_motion("gate", dem.Motion())
            trial.run_to(simulation.steps + every)
            trial.wait(
                trial.rests, simulation.steps + settings.steps(section.longest_s), every
            )
        centres, exits = simulation.positions, simulation.exit_times_s
        over = int(
            np.sum(
                (centres[:, 2] > box.gate)
                & (np.abs(centres[:, 0]) < 0.5 * box.half_slot)
            )
        )
        held, energy = (
            bool(simulation.present.all() and box.holds(centres).all()),
            trial.energy_j(),
        )
        drained = Drained(
            filled=filled,
            early=early,
            held=held,
            over_slot=over,
            energy_j=energy,
            unstable=trial.broken,
        )
        in_pile = largest_cluster(simulation.contacts(), np.isfinite(exits))
        arrays = trial.grains() | {"exit_s": exits - opened_s, "in_pile": in_pile}
        return self.ended(scene, drained, arrays, trial.frames(walls=True))

    def faults(self, ending: Drained, settings: SceneSettings) -> Faults:
        """Judge a run before it is measured."""
        section = self.section(settings)
        few = (
            f"only {ending.filled} of {section.berries} grains find room above the gate"
        )
        out = "a grain lies outside the box, or left the closed chamber"
        return stated(
            (ending.filled < section.berries, "not_filled", few),
            (ending.early or not ending.held, "lost", out),
            settings.simulation.not_at_rest(
                ending.energy_j, f" {section.longest_s:g} s after the opening"
            ),
            (
                ending.over_slot,
                "jammed",
                f"{ending.over_slot} grains rest above the middle of the slot",
            ),
        )

    def values(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure angles, mass and rate."""
        from repose.measure.pile import measure_pile
        from repose.measure.silhouette import Grains

        box, particle = Box.of(self.section(scene.settings)), scene.particle
        settings = replace(scene.measure, views=1)
        centres, scales = (
            np.asarray(arrays[key], float) for key in ("position", "scale")
        )
        exits, masses = (
            np.asarray(arrays["exit_s"], float),
            particle.mass_kg * scales**3,
        )
        left = np.isfinite(exits)
        rate = rate_kg_s(exits[left], masses[left]) if left.any() else np.nan
        measured: dict[str, Any] = dict.fromkeys(
            (*self.response_names, *self.numbers)
        ) | {
            "berries_below": int(left.sum()),
            "drawdown_mass_g": 1e3 * float(masses[left].sum()),
            "drawdown_flow_g_s": 1e3 * rate if np.isfinite(rate) else None,
        }
        pile = (
            np.asarray(arrays["in_pile"], bool) if settings.largest_pile_only else left
        )
        # both wedges, though they need not touch
        apart = replace(settings, largest_pile_only=False)
        parts = {
            "drawdown_above_deg": (~left, back_to_back(centres, box), apart),
            "drawdown_below_deg": (pile, centres, settings),
        }
        reasons = {}
        for name, (these, places, how) in parts.items():
            grains = Grains(places, arrays["quaternion"], particle, scales)[these]
            try:
                measured[name] = measure_pile(grains, how).record()["aor_deg"]
            except NoFlankError as error:
                reasons[name] = error.reason
        return {**self.assess(measured, scene.settings, reasons), **measured}

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        return 2.0 * section.open_from_s + section.longest_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield keys of a box that cannot be built or filled, with what is allowed."""
        section = self.section(settings)
        width, floor, edge = section.width_mm, section.floor_mm, section.edge_radius_mm
        wide, drop, lower = width + 2 * floor, section.drop_mm, section.lower_width_mm
        yield from too_early(section, NAME, "open_from_s")
        yield from stated(
            (
                section.slot_mm >= width,
                f"{NAME}.slot_mm",
                f"below {NAME}.width_mm, {width:g}",
            ),
            (
                4 * edge > floor,
                f"{NAME}.edge_radius_mm",
                f"at most a quarter of {NAME}.floor_mm, {floor / 4:g}",
            ),
            (drop <= floor, f"{NAME}.drop_mm", f"above {NAME}.floor_mm, {floor:g}"),
            (
                lower < wide,
                f"{NAME}.lower_width_mm",
                f"at least {wide:g}, the upper chamber with its walls",
            ),
        )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield keys of a box that is too narrow for the mean grain, with what is allowed."""
        sizes = dict.fromkeys(("depth_mm", "width_mm", "height_mm"), axes_mm[0])
        return narrow_openings(
            self.section(settings), NAME, {"slot_mm": axes_mm[2]} | sizes
        )

"""Bench test of the drawdown box: its upper chamber drains through a slot."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

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
from repose.bench.discharge import LID_SPEED_M_S, compute_mass_flow_kg_s
from repose.bench.factory import Factory, Strip, fill_and_rest, too_early
from repose.bench.funnel import ANGLE_KEYS
from repose.bench.hopper import find_narrow_openings
from repose.bench.scene import Scene
from repose.bench.settings import Poured, SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.responses import Response
from repose.common.errors import NoFlankError
from repose.common.section import Contradictions
from repose.measure.clusters import largest_cluster

if TYPE_CHECKING:
    from repose.grain.particle import Particle
    from repose.measure.settings import MeasureSettings
    from repose.measure.silhouette import Grains

NAME = "drawdown"
# Indices of the four corners of each face of a block, counter-clockwise from outside.
# `_make_block` defines the order of the corners.
FACES = (
    (0, 1, 3, 2),
    (4, 6, 7, 5),
    (0, 4, 5, 1),
    (2, 3, 7, 6),
    (0, 2, 6, 4),
    (1, 5, 7, 3),
)

# --- responses ------------------------------------------------------------------------

BOX_KEYS = (
    "drawdown.berries",
    "drawdown.width_mm",
    "drawdown.depth_mm",
    "drawdown.slot_mm",
    "drawdown.lower_width_mm",
    "drawdown.drop_mm",
)
SLOPE_KEYS = (*BOX_KEYS, "measure.mm_per_pixel", *ANGLE_KEYS)
ABOVE = Response(
    name="drawdown_above_deg",
    unit="deg",
    label="drawdown, angle above",
    symbol="above",
    apparatus=NAME,
    low=1.0,
    high=89.0,
    definition=SLOPE_KEYS,
)
BELOW = Response(
    name="drawdown_below_deg",
    unit="deg",
    label="drawdown, angle below",
    symbol="below",
    apparatus=NAME,
    low=1.0,
    high=89.0,
    definition=SLOPE_KEYS,
)
MASS = Response(
    name="drawdown_mass_g",
    unit="g",
    label="drawdown, mass below",
    symbol="mass below",
    apparatus=NAME,
    low=0.0,
    high=1e7,
    definition=BOX_KEYS,
)
FLOW = Response(
    name="drawdown_flow_g_s",
    unit="g/s",
    label="drawdown, rate",
    symbol="rate",
    apparatus=NAME,
    low=0.0,
    high=1e6,
    definition=BOX_KEYS,
)

# --- section of the configuration -----------------------------------------------------


class DrawdownSettings(Poured):
    """The section `drawdown` of the configuration; see config/README.md."""

    open_from_s: float = Field(
        ge=0.1,
        le=600,
        description="the gate is opened at this time, or later if the grains move",
    )
    longest_s: float = Field(
        ge=0.1,
        le=600,
        description="all grains are at rest this long after the opening",
    )
    width_mm: float = Field(
        ge=10,
        le=5000,
        description="width of the upper chamber, across the slot",
    )
    depth_mm: float = Field(
        ge=1,
        le=5000,
        description="depth of both chambers, along the slot",
    )
    height_mm: float = Field(
        ge=1,
        le=5000,
        description="height of the upper chamber",
    )
    slot_mm: float = Field(
        ge=1,
        le=5000,
        description="width of the slot in the middle of the floor",
    )
    floor_mm: float = Field(
        ge=0.5,
        le=100,
        description="thickness of floor, walls and gate",
    )
    edge_radius_mm: float = Field(
        ge=0.05,
        le=20,
        description="radius of the edges of floor, walls and gate",
    )
    lower_width_mm: float = Field(
        ge=10,
        le=20000,
        description="width of the lower chamber",
    )
    drop_mm: float = Field(
        ge=1,
        le=5000,
        description="from the lower floor to the upper side of the upper floor",
    )


# --- the box --------------------------------------------------------------------------


@dataclass(frozen=True)
class Box:
    """Sizes of the box: x across the slot, y along it, z up from the lower floor.

    All lengths are in m.
    """

    half_width: float  # half of the width of the upper chamber
    half_depth: float  # half of the depth of both chambers
    half_slot: float  # half of the width of the slot
    half_lower_width: float  # half of the width of the lower chamber
    floor_height: float  # height of the upper side of the upper floor
    thickness: float  # thickness of the upper floor, its walls and the gate
    top_height: float  # height of the upper end of the upper chamber

    @classmethod
    def of(cls, section: DrawdownSettings) -> "Box":
        """Make the box of a section of the configuration."""
        return cls(
            half_width=0.5e-3 * section.width_mm,
            half_depth=0.5e-3 * section.depth_mm,
            half_slot=0.5e-3 * section.slot_mm,
            half_lower_width=0.5e-3 * section.lower_width_mm,
            floor_height=1e-3 * section.drop_mm,
            thickness=1e-3 * section.floor_mm,
            top_height=1e-3 * section.drop_mm + 1e-3 * section.height_mm,
        )

    @property
    def gate_height(self) -> float:
        """Height of the upper side of the gate and of the lower side of the floor."""
        return self.floor_height - self.thickness

    def walls(
        self, edge_radius_m: float, room_m: float
    ) -> "dict[str, dem.Plane | dem.Mesh]":
        """Make all walls of the box by name, with the gate closed.

        The floor, the front, the back and both sides of the lower chamber are planes.
        The upper chamber has the same front and back. Its side walls, the two halves of
        its floor beside the slot, and the gate are blocks with rounded edges.

        Parameters
        ----------
        edge_radius_m : float
            Radius of the edges of the blocks.
        room_m : float
            Height by which the side walls are higher than the upper chamber. Grains
            that appear above the chamber need this room.

        Returns
        -------
        dict
            Planes and meshes by name. The order of the walls must stay: the engine
            visits them in this order, on which the last bits of the results depend.
        """
        # A plane takes a point, the normal that points to the grains, and the material
        # "wall".
        walls: dict[str, dem.Plane | dem.Mesh] = {
            "lower_floor": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall"),
            "front": dem.Plane((0.0, -self.half_depth, 0.0), (0.0, 1.0, 0.0), "wall"),
            "back": dem.Plane((0.0, self.half_depth, 0.0), (0.0, -1.0, 0.0), "wall"),
        }
        # The blocks extend beyond front and back, so that no grain touches their ends.
        half_length = self.half_depth + 2.0 * self.thickness
        block_y = (-half_length, half_length)
        outer_side = self.half_width + self.thickness
        # The two sides are mirror images of each other. The sign is that of their x.
        for side, sign in (("left", -1.0), ("right", 1.0)):
            lower_side = (sign * self.half_lower_width, 0.0, 0.0)
            inwards = (-sign, 0.0, 0.0)
            walls[f"lower_{side}"] = dem.Plane(lower_side, inwards, "wall")
            walls[f"{side}_floor"] = _make_block(
                x=(sign * self.half_slot, sign * outer_side),
                y=block_y,
                z=(self.gate_height, self.floor_height),
                edge_radius_m=edge_radius_m,
            )
            walls[f"{side}_wall"] = _make_block(
                x=(sign * self.half_width, sign * outer_side),
                y=block_y,
                z=(self.gate_height, self.top_height + room_m),
                edge_radius_m=edge_radius_m,
            )
        # The gate closes the slot from below and is wider than the slot.
        walls["gate"] = _make_block(
            x=(-self.half_slot - self.thickness, self.half_slot + self.thickness),
            y=block_y,
            z=(self.gate_height - self.thickness, self.gate_height),
            edge_radius_m=edge_radius_m,
        )
        return walls

    def contains(self, centres_m: np.ndarray) -> np.ndarray:
        """Mark the grains (N,) whose centres (N, 3) lie inside the box."""
        x, y, z = centres_m.T
        return (
            (np.abs(x) < self.half_lower_width)
            & (np.abs(y) < self.half_depth)
            & (z > 0.0)
        )


def _make_block(
    x: Sequence[float], y: Sequence[float], z: Sequence[float], edge_radius_m: float
) -> "dem.Mesh":
    """Make a rectangular block as a mesh.

    Parameters
    ----------
    x, y, z : sequence of float
        The two ends of the block along each axis [m], in any order.
    edge_radius_m : float
        Radius of its rounded edges.
    """
    # `FACES` holds indices of the eight corners in this order.
    corners = list(itertools.product(sorted(x), sorted(y), sorted(z)))
    triangles = []
    for first, second, third, fourth in FACES:
        triangles.append((first, second, third))
        triangles.append((first, third, fourth))
    return dem.Mesh(np.array(corners), np.array(triangles), "wall", edge_radius_m)


def move_wedges_back_to_back(centres_m: np.ndarray, box: Box) -> np.ndarray:
    """Move the grains of both wedges so that the wedges together look like a pile.

    The wedges are highest at the side walls. Each wedge is moved so that its side wall
    comes to x = 0. The floor comes to z = 0.

    Parameters
    ----------
    centres_m : array
        Centres (N, 3) of the grains in the upper chamber.
    box : Box
        Sizes of the box.

    Returns
    -------
    array
        The moved centres (N, 3).
    """
    moved_m = centres_m - (0.0, 0.0, box.floor_height)
    # The left wedge moves to the right, the right one to the left.
    moved_m[:, 0] -= np.sign(moved_m[:, 0]) * box.half_width
    return moved_m


# --- run ------------------------------------------------------------------------------


@dataclass(frozen=True)
class DrainedBox(Outcome):
    """The outcome of a run in which a box was filled and drained."""

    n_filled: int  # grains that found room in the upper chamber
    n_early: int  # grains that were below the gate before it was opened
    all_inside: bool  # whether all grains are inside the box
    n_over_slot: int  # grains that rest above the middle of the slot
    energy_j: float  # mean kinetic energy of a grain at the end


class _Opening(NamedTuple):
    """The upper chamber at the moment at which its gate is opened."""

    time_s: float  # since the beginning of the run
    n_filled: int  # grains in the box
    n_early: int  # grains that were below the gate already

    @classmethod
    def from_simulation(cls, simulation: "dem.Simulation") -> Self:
        """Describe the present state of the box."""
        return cls(
            time_s=simulation.time_s,
            n_filled=simulation.n_bodies,
            n_early=int(np.isfinite(simulation.exit_times_s).sum()),
        )


# The opening of a run that exceeded a limit before its gate was opened.
_NEVER_OPENED = _Opening(time_s=np.nan, n_filled=0, n_early=0)


def _make_factory(
    section: DrawdownSettings, box: Box, grain_radius_m: float
) -> Factory:
    """Make the source of grains above the upper chamber.

    A new grain with the bounding radius `grain_radius_m` does not touch a wall.
    """
    area = Strip(
        half_x_m=box.half_width - grain_radius_m,
        half_y_m=box.half_depth - grain_radius_m,
        height_m=box.top_height + grain_radius_m,
    )
    return Factory(area, section.berries, section.rate_per_s)


def _open_gate(trial: Trial, box: Box) -> None:
    """Move the gate down until it lies below the lower floor, and stop it there.

    The trial is advanced in place.
    """
    simulation = trial.simulation
    simulation.set_motion("gate", dem.Motion(velocity_m_s=(0.0, 0.0, -LID_SPEED_M_S)))
    opening_steps = trial.scene.simulation.steps(box.floor_height / LID_SPEED_M_S)
    trial.run_to(simulation.steps + opening_steps)
    simulation.set_motion("gate", dem.Motion())


def _describe_final_state(trial: Trial, box: Box, opening: _Opening) -> DrainedBox:
    """Measure the end of a run: the numbers by which it is accepted or rejected.

    Parameters
    ----------
    trial : Trial
        The simulation of the run at its end.
    box : Box
        Sizes of the box.
    opening : _Opening
        The state of the box when its gate was opened.
    """
    simulation = trial.simulation
    centres = simulation.positions
    is_above = centres[:, 2] > box.gate_height
    # The middle of the slot is the half of its width that surrounds the plane x = 0.
    is_over_slot = is_above & (np.abs(centres[:, 0]) < 0.5 * box.half_slot)
    all_inside = simulation.present.all() and box.contains(centres).all()
    return DrainedBox(
        n_filled=opening.n_filled,
        n_early=opening.n_early,
        all_inside=bool(all_inside),
        n_over_slot=int(np.sum(is_over_slot)),
        energy_j=trial.energy_j(),
        unstable=trial.broken,
        overlap_share=trial.overlap_share,
    )


@register(NAME)
class DrawdownTest(BenchTest[DrawdownSettings]):
    """A box that is filled and drained through a slot."""

    settings = DrawdownSettings
    responses = (ABOVE, BELOW, MASS, FLOW)
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
    example: ClassVar = {
        "drawdown": {
            "berries": 150,
            "rate_per_s": 300.0,
            "open_from_s": 1.0,
            "longest_s": 3.0,
            "seeds": 2,
            "width_mm": 120.0,
            "depth_mm": 40.0,
            "height_mm": 80.0,
            "slot_mm": 50.0,
            "floor_mm": 4.0,
            "edge_radius_mm": 0.5,
            "lower_width_mm": 240.0,
            "drop_mm": 90.0,
        },
        "measure": {"response": "flank"},
        "targets": [
            {
                "response": "drawdown_above_deg",
                "value": 38.0,
                "sd": 3.0,
                "repetitions": 10,
            },
            {
                "response": "drawdown_mass_g",
                "value": 50.0,
                "sd": 5.0,
                "repetitions": 10,
            },
        ],
    }

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe the box with a closed gate as arguments of `repose.dem.Simulation`.

        The keys are the names of the arguments. All lengths are in m.

        Parameters
        ----------
        scene : Scene
            The settings of the box.
        largest_radius_m : float
            Bounding radius of the largest grain. New grains must fit below the upper
            end of the walls.
        """
        section = self.section(scene.settings)
        box = Box.of(section)
        room_m = 4.0 * largest_radius_m
        return {
            "capacity": section.berries,
            "walls": box.walls(1e-3 * section.edge_radius_mm, room_m),
            "lower": (-box.half_lower_width, -box.half_depth, 0.0),
            "upper": (box.half_lower_width, box.half_depth, box.top_height + room_m),
            "exit_height_m": box.gate_height,
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the upper chamber, let the grains rest, and drain it through the slot.

        The run ends when the grains rest again, or after `drawdown.longest_s`.

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
            (N,) at the end; ``exit_s`` (N,), the time [s] from the opening until each
            grain left the slot, which is NaN for a grain that stayed above; and
            ``in_pile`` (N,), the mask of the largest cluster in the lower chamber.
        """
        section = self.section(scene.settings)
        simulation_settings = scene.simulation
        box = Box.of(section)
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        simulation = trial.simulation
        factory = _make_factory(section, box, trial.largest_radius_m)

        # Number of time steps between two checks of the grains
        check_interval = max(1, simulation_settings.steps(scene.scale.interval_s()))
        # `guard` ends the block below without an error as soon as the run exceeds a
        # limit. If that happens before the opening, this value remains.
        opening = _NEVER_OPENED
        with trial.bound(factory.area.height_m, LID_SPEED_M_S).guard():
            fill_and_rest(trial, factory, section.open_from_s, check_interval)
            opening = _Opening.from_simulation(simulation)
            _open_gate(trial, box)
            # Let the grains begin to fall before checking whether they are at rest.
            trial.run_to(simulation.steps + check_interval)
            last_step = simulation.steps + simulation_settings.steps(section.longest_s)
            trial.wait(trial.is_at_rest, last_step, check_interval)

        arrays = trial.grains()
        exit_times_s = simulation.exit_times_s
        # The time of the opening is NaN if the gate was never opened.
        arrays["exit_s"] = exit_times_s - opening.time_s
        arrays["in_pile"] = largest_cluster(
            simulation.contacts(), np.isfinite(exit_times_s)
        )
        outcome = _describe_final_state(trial, box, opening)
        return self.make_run(scene, outcome, arrays, trial.frames(walls=True))

    def judge(self, outcome: DrainedBox, settings: SceneSettings) -> Verdict:
        """Check a stable run before it is measured, and return its status.

        Parameters
        ----------
        outcome : DrainedBox
            The grains at the end of the run.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict
            `OK`, or the status of the first check that fails. In order, these are fewer
            grains than configured (``not_filled``), lost grains (``lost``), motion
            (``not_at_rest``), and grains that rest above the slot (``jammed``).
        """
        section = self.section(settings)
        # `berries` is the configured number of grains. Grains without room were never
        # added.
        if outcome.n_filled < section.berries:
            return Verdict(
                "not_filled",
                f"only {outcome.n_filled} of {section.berries} grains found room above "
                "the gate",
            )
        # `n_early` counts grains that had left the upper chamber before the gate
        # opened.
        if outcome.n_early or not outcome.all_inside:
            return Verdict(
                "lost", "a grain lies outside the box or left the closed chamber"
            )
        # None if the grains are at rest
        motion_verdict = not_at_rest(
            outcome.energy_j,
            settings,
            advice="give the grains more time by drawdown.longest_s",
            when=f" {section.longest_s:g} s after the opening",
        )
        if motion_verdict is not None:
            return motion_verdict
        if outcome.n_over_slot:
            return Verdict(
                "jammed",
                f"{outcome.n_over_slot} grains rest above the middle of the slot",
            )
        return OK

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the angles in both chambers, and mass and flow of the drained grains.

        A grain that has an exit time has passed the slot and lies in the lower chamber.
        The other grains have stayed in the upper chamber, as two wedges beside the
        slot.

        Parameters
        ----------
        arrays : mapping
            Arrays of the run by name, as `run` returns them. Exit times are in
            ``exit_s``.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        dict
            The responses and numbers. An angle that cannot be measured is None. If such
            an angle is a target, there are also ``status`` and ``reason``.
        """
        box = Box.of(self.section(scene.settings))
        # Both angles are measured in one view, along the slot. The two wedges are put
        # back to back and measured as one pile. They may not touch each other, so the
        # measurement must not leave out all but the largest cluster.
        pile_settings = scene.measure.model_copy(update={"views": 1})
        wedge_settings = pile_settings.model_copy(update={"largest_pile_only": False})
        wedges = _select_wedges(arrays, scene.particle, box)
        pile = _select_pile(arrays, scene.particle, pile_settings)

        measured: dict[str, Any] = {ABOVE.name: None, BELOW.name: None}
        reasons = {}
        for name, grains, settings in (
            (ABOVE.name, wedges, wedge_settings),
            (BELOW.name, pile, pile_settings),
        ):
            try:
                measured[name] = _measure_angle_of_repose(grains, settings)
            except NoFlankError as error:
                reasons[name] = error.reason
        measured |= _measure_flow(arrays, scene.particle)
        # If the number of a target is missing, `fault` has a new status and a reason;
        # otherwise it is empty. It has no key of `measured`.
        fault = self.check_targets(measured, scene.settings, reasons)
        return {**fault, **measured}

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        section = self.section(settings)
        return 2.0 * section.open_from_s + section.longest_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield settings with which the box cannot be built or filled.

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
        # The gate must open after the last grain has appeared.
        yield from too_early(section, NAME, "open_from_s")
        if section.slot_mm >= section.width_mm:
            yield "drawdown.slot_mm", f"below drawdown.width_mm, {section.width_mm:g}"
        # All blocks are as thick as the floor. The rounded edges at both sides of a
        # block must leave half of its thickness flat.
        thickness_mm = section.floor_mm
        if 4 * section.edge_radius_mm > thickness_mm:
            yield (
                "drawdown.edge_radius_mm",
                f"at most a quarter of drawdown.floor_mm, {thickness_mm / 4:g}",
            )
        # The gate lies below the upper floor, whose upper side is `drop_mm` high.
        if section.drop_mm <= thickness_mm:
            yield "drawdown.drop_mm", f"above drawdown.floor_mm, {thickness_mm:g}"
        outer_width_mm = section.width_mm + 2 * thickness_mm
        if section.lower_width_mm < outer_width_mm:
            yield (
                "drawdown.lower_width_mm",
                f"at least {outer_width_mm:g}, the upper chamber with its walls",
            )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield settings of a box that is too narrow for the mean grain.

        `axes_mm` are the full lengths of the mean grain along its three axes, the
        longest first. A grain can pass the slot end on, so only its shortest axis
        counts there.
        """
        sizes_mm = {
            "slot_mm": axes_mm[2],
            "depth_mm": axes_mm[0],
            "width_mm": axes_mm[0],
            "height_mm": axes_mm[0],
        }
        return find_narrow_openings(self.section(settings), NAME, sizes_mm)


def _select_wedges(arrays: Arrays, particle: "Particle", box: Box) -> "Grains":
    """Select the grains that stayed in the upper chamber, as wedges back to back.

    Parameters
    ----------
    arrays : mapping
        Arrays of the run by name, as `DrawdownTest.run` returns them. A grain without a
        finite exit time has stayed in the upper chamber.
    particle : Particle
        Body that represents each grain.
    box : Box
        Sizes of the box.
    """
    from repose.measure.silhouette import Grains

    is_above = ~np.isfinite(arrays["exit_s"])
    centres = np.asarray(arrays["position"], float)
    scales = np.asarray(arrays["scale"], float)
    wedge_centres = move_wedges_back_to_back(centres, box)
    return Grains(wedge_centres, arrays["quaternion"], particle, scales)[is_above]


def _select_pile(
    arrays: Arrays, particle: "Particle", settings: "MeasureSettings"
) -> "Grains":
    """Select the grains of the pile in the lower chamber.

    A grain with a finite exit time has left the upper chamber.

    Parameters
    ----------
    arrays : mapping
        Arrays of the run by name, as `DrawdownTest.run` returns them.
    particle : Particle
        Body that represents each grain.
    settings : MeasureSettings
        Settings of the measurement. If `largest_pile_only` is set, the pile is the
        largest cluster of touching grains. Otherwise it consists of all grains in the
        lower chamber.

    Returns
    -------
    Grains
        The selected grains.
    """
    from repose.measure.silhouette import Grains

    if settings.largest_pile_only:
        is_in_pile = np.asarray(arrays["in_pile"], bool)
    else:
        is_in_pile = np.isfinite(arrays["exit_s"])
    centres = np.asarray(arrays["position"], float)
    scales = np.asarray(arrays["scale"], float)
    return Grains(centres, arrays["quaternion"], particle, scales)[is_in_pile]


def _measure_flow(arrays: Arrays, particle: "Particle") -> dict[str, Any]:
    """Measure mass, flow and number of the grains that drained through the slot.

    Parameters
    ----------
    arrays : mapping
        Arrays of the run: ``scale`` (N,) and ``exit_s`` (N,), which is not finite for a
        grain that stayed above.
    particle : Particle
        Body that represents each grain.

    Returns
    -------
    dict
        The mass [g], the mass flow [g/s] and the number of these grains
        (``berries_below``), by name. The flow is None if no grain drained, or if all
        grains in the middle of the flow drained at the same time.
    """
    scales = np.asarray(arrays["scale"], float)
    exit_s = np.asarray(arrays["exit_s"], float)
    # Mass is proportional to the cube of the relative size.
    masses = particle.mass_kg * scales**3
    is_below = np.isfinite(exit_s)
    # The flow stays unknown if no grain drained. NaN stands for an unknown flow, as in
    # `compute_mass_flow_kg_s`.
    rate = np.nan
    if is_below.any():
        rate = compute_mass_flow_kg_s(exit_s[is_below], masses[is_below])
    # Convert kg to g. A flow that is NaN becomes None.
    return {
        MASS.name: 1e3 * float(masses[is_below].sum()),
        FLOW.name: 1e3 * rate if np.isfinite(rate) else None,
        "berries_below": int(is_below.sum()),
    }


def _measure_angle_of_repose(
    grains: "Grains", settings: "MeasureSettings"
) -> float | None:
    """Measure the angle of repose of a pile [degrees].

    Raises NoFlankError if the pile has no angle.
    """
    from repose.measure.pile import measure_pile

    return measure_pile(grains, settings).record()["aor_deg"]

"""Bench test of the lifted cylinder: a tube is filled and lifted, and leaves a pile."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
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
from repose.bench.factory import (
    LIKELY_PACKING,
    Disc,
    Factory,
    bed_level_m,
    fill_and_rest,
    fill_to_level_and_rest,
    too_early,
)
from repose.bench.funnel import (
    ANGLE_KEYS,
    GRAIN_HEIGHT_KEY,
    LARGEST_LOSS,
    SILHOUETTE_KEYS,
    SMALLEST_PILE,
)
from repose.bench.hopper import find_narrow_openings
from repose.bench.scene import Scene
from repose.bench.settings import Poured, SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.responses import Response
from repose.calibrate.runs import Recorded
from repose.common.numbers import format_significant
from repose.common.section import ABSENT, MOST_BERRIES, Berries, Contradictions
from repose.measure.clusters import largest_cluster

if TYPE_CHECKING:
    from repose.grain.particle import Particle

NAME = "lifted_cylinder"
# Names of the walls that are lifted.
TUBE_WALLS = ("tube", "rim")
# A grain below this height has left the plate and is removed from the simulation.
FLOOR_M = -0.05

# --- responses ------------------------------------------------------------------------

LIFTING_KEYS = (
    "lifted_cylinder.berries",
    "lifted_cylinder.filling_height_mm",
    "lifted_cylinder.diameter_mm",
    "lifted_cylinder.lifting_mm_s",
)
ANGLE = Response(
    name="lifted_aor_deg",
    unit="deg",
    label="angle of repose, lifted cylinder",
    symbol="AoR, lifted",
    apparatus=NAME,
    low=1.0,
    high=89.0,
    definition=(*LIFTING_KEYS, *SILHOUETTE_KEYS, *ANGLE_KEYS),
)
HEIGHT = Response(
    name="lifted_height_mm",
    unit="mm",
    label="Height, lifted cylinder",
    symbol="Height, lifted",
    apparatus=NAME,
    low=1.0,
    high=2000.0,
    definition=(*LIFTING_KEYS, *SILHOUETTE_KEYS),
)
FOOT = Response(
    name="lifted_foot_mm",
    unit="mm",
    label="foot radius, lifted cylinder",
    symbol="foot, lifted",
    apparatus=NAME,
    low=0.0,
    high=1e4,
    definition=(*LIFTING_KEYS, *SILHOUETTE_KEYS, GRAIN_HEIGHT_KEY),
)
LOOSE = Response(
    name="lifted_loose_percent",
    unit="%",
    label="loose grains, lifted cylinder",
    symbol="loose, lifted",
    apparatus=NAME,
    low=0.0,
    high=1e2,
    definition=(*LIFTING_KEYS, "lifted_cylinder.plate_diameter_mm"),
)
# The name that each response has in the measurement of a pile.
PILE_NAMES = {
    ANGLE.name: "aor_deg",
    HEIGHT.name: "height_mm",
    FOOT.name: "base_radius_mm",
    LOOSE.name: "loose_percent",
}

# --- section of the configuration -----------------------------------------------------


class LiftedCylinderSettings(Poured):
    """The section `lifted_cylinder` of the configuration; see config/README.md."""

    berries: Berries = Field(
        default=ABSENT,
        description="number of grains",
    )
    filling_height_mm: float = Field(
        default=ABSENT,
        ge=1,
        le=5000,
        description="in place of `berries`: level of the bed before the lifting; "
        "`length_mm` is longer by a grain or more",
    )
    lift_from_s: float = Field(
        ge=0.1,
        le=600,
        description="the lifting begins at this time, or later if the grains move",
    )
    lifting_mm_s: float = Field(
        ge=0.1,
        le=5000,
        description="speed of lifting",
    )
    settle_s: float = Field(
        ge=0.1,
        le=600,
        description="when the tube is empty, the pile has at most this time to come to "
        "rest",
    )
    diameter_mm: float = Field(
        ge=1,
        le=5000,
        description="inner diameter of the tube",
    )
    length_mm: float = Field(
        ge=1,
        le=5000,
        description="length of the tube; it is lifted by at most its length",
    )
    rim_radius_mm: float = Field(
        ge=0.05,
        le=20,
        description="radius of its rounded lower edge",
    )
    plate_diameter_mm: float = Field(
        ge=10,
        le=20000,
        description="diameter of the plate below",
    )

    def contradictions(self) -> Contradictions:
        """Yield the key of the level unless exactly one key of the filling is given."""
        has_number = self.berries is not ABSENT
        has_level = self.filling_height_mm is not ABSENT
        if not has_number and not has_level:
            yield (
                "filling_height_mm",
                f"1 to 5000, or berries, 1 to {MOST_BERRIES}, in its place",
            )
        if has_number and has_level:
            yield "filling_height_mm", "nothing: berries gives the level already"

    def compute_gapless_count(self, grain_m3: float) -> float:
        """Compute how many grains without gaps fill the tube to the filling height.

        `grain_m3` is the volume of a grain. The number is not rounded.
        """
        radius = 0.5e-3 * self.diameter_mm
        height = 1e-3 * self.filling_height_mm
        return math.pi * radius**2 * height / grain_m3

    def capacity(self, particle: "Particle") -> int:
        """Return the largest number of grains that a run may add.

        It is `berries` if that is given. Otherwise it is the number of grains that
        would reach the filling height without gaps, which is more than are needed.
        """
        return self.berries or math.ceil(self.compute_gapless_count(particle.volume_m3))


# --- run ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Lifting(Outcome):
    """The outcome of a run in which a tube was filled and lifted."""

    n_filled: int  # grains that found room in the tube
    filling_height_mm: float  # level of the bed before the lifting
    n_in_tube: int  # grains above the lower edge of the tube at the end
    n_off_plate: int  # grains that have left the plate
    n_in_pile: int  # grains in the largest cluster on the plate
    energy_j: float  # mean kinetic energy of a grain on the plate at the end
    grain_mm: float  # length of a mean grain


class _Tube:
    """Fills, lifts and stops the tube of a trial.

    The methods advance the trial in place.

    Attributes
    ----------
    lifted_m : float
        Height [m] of the lower edge of the tube above the plate.
    n_filled : int
        Number of grains in the filled tube; 0 before.
    filling_height_mm : float
        Level [mm] of the bed in the filled tube; NaN before.
    """

    def __init__(self, trial: Trial, section: LiftedCylinderSettings) -> None:
        """Begin with the empty tube of `trial`, which stands on the plate."""
        self.trial = trial
        self.simulation = trial.simulation
        self.simulation_settings = trial.scene.simulation
        self.section = section
        # Number of time steps between two checks of the grains
        self.check_interval = max(
            1, self.simulation_settings.steps(trial.scene.scale.interval_s())
        )
        self.lifted_m = 0.0
        self.n_filled = 0
        # The level is unknown until the tube has been filled.
        self.filling_height_mm = math.nan

    def fill(self, factory: Factory) -> None:
        """Fill the tube with grains, and let them rest.

        The configuration gives either the number of grains or the level of the bed.
        """
        if self.section.filling_height_mm is ABSENT:
            fill_and_rest(
                self.trial,
                factory,
                self.section.lift_from_s,
                self.check_interval,
                self.is_at_rest,
            )
        else:
            fill_to_level_and_rest(
                self.trial,
                factory,
                level_mm=self.section.filling_height_mm,
                until_s=self.section.lift_from_s,
                check_interval=self.check_interval,
                is_at_rest=self.is_at_rest,
            )
        self.n_filled = self.simulation.n_bodies
        self.filling_height_mm = 1e3 * bed_level_m(self.simulation)

    def lift(self) -> None:
        """Lift the tube until it is empty, but at most by its length, and stop it.

        `lifted_m` is updated at each check. It is needed to find out which grains are
        still inside.
        """
        simulation = self.simulation
        start_s = simulation.time_s
        # The tube rises at a constant speed.
        lifting_m_s = 1e-3 * self.section.lifting_mm_s
        length_m = 1e-3 * self.section.length_mm
        last_step = simulation.steps + self.simulation_settings.steps(
            length_m / lifting_m_s
        )
        _move_tube(simulation, lifting_m_s)
        while self.mark_grains_inside().any() and simulation.steps < last_step:
            next_check = simulation.steps + self.check_interval
            self.trial.run_to(min(last_step, next_check))
            self.lifted_m = lifting_m_s * (simulation.time_s - start_s)
        _move_tube(simulation, 0.0)

    def wait_for_rest(self) -> None:
        """Wait until the pile rests, at most for `lifted_cylinder.settle_s`."""
        settle_steps = self.simulation_settings.steps(self.section.settle_s)
        last_step = self.simulation.steps + settle_steps
        self.trial.wait(self.is_at_rest, last_step, self.check_interval)

    def mark_grains_inside(self) -> np.ndarray:
        """Mark the grains (N,) in the tube: those with centres above its lower edge."""
        heights = self.simulation.positions[:, 2]
        return self.simulation.present & (heights > self.lifted_m)

    def is_at_rest(self) -> bool:
        """Return whether the grains rest on average, on the plate and in the tube."""
        energies = self.simulation.kinetic_energies()[self.simulation.present]
        return bool(energies.mean() <= self.simulation_settings.rest_energy_j)


def _move_tube(simulation: "dem.Simulation", speed_m_s: float) -> None:
    """Set the speed at which the tube rises; at 0 the tube stands still."""
    for wall in TUBE_WALLS:
        simulation.set_motion(wall, dem.Motion(velocity_m_s=(0.0, 0.0, speed_m_s)))


def _judge_filling(outcome: Lifting, section: LiftedCylinderSettings) -> Verdict | None:
    """Check the filling of the tube: the number of its grains, or the level of the bed.

    The configuration gives one of the two. The other is `ABSENT` (None).

    Parameters
    ----------
    outcome : Lifting
        The measurements of the run.
    section : LiftedCylinderSettings
        The section `lifted_cylinder` of the configuration. It gives either the number
        (`berries`) or the level (`filling_height_mm`).

    Returns
    -------
    Verdict or None
        The status ``not_filled`` with its reason; None if the filling is as configured.
    """
    # If the tube is too full, the factory adds fewer grains than configured.
    if section.berries is not ABSENT and outcome.n_filled < section.berries:
        return Verdict(
            "not_filled",
            f"only {outcome.n_filled} of {section.berries} grains found room in the tube",
        )
    # If no level is configured, the measured level counts as the wanted one. The level
    # may be wrong by the length of a grain, because the bed cannot be more even than
    # that. A level of NaN, which means that the filling was never finished, fails this
    # check because every comparison with NaN is false.
    level_mm = outcome.filling_height_mm
    wanted_mm = section.filling_height_mm or level_mm
    if not abs(level_mm - wanted_mm) <= outcome.grain_mm:
        return Verdict(
            "not_filled",
            f"the bed rests at {format_significant(level_mm)} mm, not at {wanted_mm:g} mm",
        )
    return None


def _describe_final_state(trial: Trial, tube: _Tube) -> tuple[Lifting, np.ndarray]:
    """Measure the end of a run: where the grains are, and whether they still move.

    Grains lie in the tube, on the plate or off the plate. The pile is the largest group
    of grains on the plate that touch each other.

    Parameters
    ----------
    trial : Trial
        The simulation of the run at its end.
    tube : _Tube
        The tube of this simulation. Its position and filling are read.

    Returns
    -------
    outcome : Lifting
        The measurements by which the run is accepted or rejected.
    is_in_pile : array
        Mask (N,) of the grains in the pile.
    """
    simulation = trial.simulation
    is_in_tube = tube.mark_grains_inside()
    is_above_plate = simulation.present & (simulation.positions[:, 2] > 0.0)
    # Grains in a tube that was lifted are above the plate, too.
    is_on_plate = is_above_plate & ~is_in_tube
    is_in_pile = largest_cluster(simulation.contacts(), is_on_plate)
    n_in_tube = int(is_in_tube.sum())
    n_on_plate = int(is_on_plate.sum())

    # The outcome keeps the mean energy of a grain on the plate. It is unknown if there
    # is none.
    mean_energy_j = math.nan
    if n_on_plate:
        mean_energy_j = float(simulation.kinetic_energies()[is_on_plate].mean())
    outcome = Lifting(
        n_filled=tube.n_filled,
        filling_height_mm=tube.filling_height_mm,
        n_in_tube=n_in_tube,
        n_off_plate=len(is_on_plate) - n_in_tube - n_on_plate,
        n_in_pile=int(is_in_pile.sum()),
        energy_j=mean_energy_j,
        grain_mm=1e3 * float(trial.scene.particle.axes_m.max()),
        unstable=trial.broken,
        overlap_share=trial.overlap_share,
    )
    return outcome, is_in_pile


@register(NAME)
class LiftedCylinderTest(BenchTest[LiftedCylinderSettings]):
    """A pile of the grains that flow out of a tube while it is lifted."""

    settings = LiftedCylinderSettings
    responses = (ANGLE, HEIGHT, FOOT, LOOSE)
    recorded = Recorded(
        means=tuple(PILE_NAMES),
        single=(
            *PILE_NAMES,
            "berries",
            "filling_height_mm",
            "lifted_mm",
            "berries_in_pile",
        ),
    )
    statuses = (
        "ok",
        "unstable",
        "not_filled",
        "jammed",
        "left_plate",
        "not_at_rest",
        "no_flank",
    )
    required_arrays = ("position", "quaternion", "in_pile")
    photographed: ClassVar = {"aor_deg": ANGLE.name, "height_mm": HEIGHT.name}
    summary = (
        "angle of repose {lifted_aor_deg:.2f} deg, Height {lifted_height_mm:.1f} mm, "
        "foot radius {lifted_foot_mm:.1f} mm, {lifted_loose_percent:.1f} % loose"
    )
    example: ClassVar = {
        "lifted_cylinder": {
            "berries": 150,
            "rate_per_s": 300.0,
            "lift_from_s": 1.0,
            "lifting_mm_s": 50.0,
            "settle_s": 2.0,
            "seeds": 2,
            "diameter_mm": 60.0,
            "length_mm": 120.0,
            "rim_radius_mm": 0.5,
            "plate_diameter_mm": 400.0,
        },
        "targets": [
            {"response": "lifted_aor_deg", "value": 27.0, "sd": 1.5, "repetitions": 10}
        ],
    }

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe the tube on its plate as arguments of `repose.dem.Simulation`.

        The keys are the names of the arguments. All lengths are in m.

        Parameters
        ----------
        scene : Scene
            The settings of the tube, and the particle.
        largest_radius_m : float
            Radius of a ball that contains the largest grain in any orientation.

        Returns
        -------
        dict
            Largest number of grains (``capacity``), ``walls`` by name, ``lower`` and
            ``upper`` corner of the box, and ``floor_height_m``, the height below which
            a grain is removed.
        """
        section = self.section(scene.settings)
        radius = 1e-3 * (0.5 * section.diameter_mm)
        length = 1e-3 * section.length_mm
        rim_radius = 1e-3 * section.rim_radius_mm
        plate_radius = 1e-3 * (0.5 * section.plate_diameter_mm)
        up = (0.0, 0.0, 1.0)
        plate = dem.Plane((0.0, 0.0, 0.0), up, "wall", plate_radius)
        # The wall of the tube begins above its rim. It is longer than configured by the
        # diameter of a grain, so that grains that appear at the upper end of the tube
        # stay inside.
        wall_foot = (0.0, 0.0, rim_radius)
        wall_height = length + 2.0 * largest_radius_m
        tube = dem.Cylinder(wall_foot, up, wall_height, radius, "wall")
        # The rim is a rounded ring that touches the plate. The circle in its middle has
        # the radius of the tube plus that of the rounding, and lies at the height of
        # the rounding. In the half plane (r, z), the wall of the tube continues above
        # the rim, and there is no wall below it, which a zero vector stands for.
        wall_above = (0.0, 1.0)
        no_wall = (0.0, 0.0)
        rim = dem.RingEdge(
            radius + rim_radius, rim_radius, "wall", (wall_above, no_wall), rim_radius
        )
        # The box leaves room for grains at the edge of the plate and at the top.
        half_side = plate_radius + 2.0 * largest_radius_m
        return {
            "capacity": section.capacity(scene.particle),
            "walls": {"plate": plate, "tube": tube, "rim": rim},
            "lower": (-half_side, -half_side, 0.0),
            "upper": (half_side, half_side, length + 4.0 * largest_radius_m),
            "floor_height_m": FLOOR_M,
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the tube, let the grains rest, lift the tube, and let the pile rest.

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
            The arrays are ``position`` (N, 3) [m], ``quaternion`` (N, 4), ``scale``
            (N,) and ``in_pile`` (N,), the mask of the grains in the pile.
        """
        section = self.section(scene.settings)
        capacity = section.capacity(scene.particle)
        trial = Trial(self.build, scene, capacity, interval_s, progress)
        tube = _Tube(trial, section)
        length_m = 1e-3 * section.length_mm
        # New grains appear in a disc (radius, height) at the upper end of the tube. It
        # is narrower than the tube, so that no new grain touches the wall.
        area = Disc(
            0.5e-3 * section.diameter_mm - trial.largest_radius_m,
            length_m + trial.largest_radius_m,
        )
        # The factory adds the grains, up to the capacity of the simulation.
        factory = Factory(area, capacity, section.rate_per_s)

        # A grain that is stuck in the tube is lifted with it, at most by the length of
        # the tube. `guard` ends the block without an error as soon as the run exceeds a
        # limit. `trial.broken` then holds the reason, and the code below describes the
        # state at that moment.
        highest_m = area.height_m + length_m
        with trial.bound(highest_m, 1e-3 * section.lifting_mm_s).guard():
            tube.fill(factory)
            tube.lift()
            tube.wait_for_rest()

        outcome, in_pile = _describe_final_state(trial, tube)
        return self.make_run(
            scene,
            outcome,
            trial.grains(in_pile=in_pile),
            trial.frames(walls=True),
            berries=tube.n_filled,
            filling_height_mm=tube.filling_height_mm,
            lifted_mm=1e3 * tube.lifted_m,
            berries_in_pile=outcome.n_in_pile,
            berries_off_plate=outcome.n_off_plate,
        )

    def judge(self, outcome: Lifting, settings: SceneSettings) -> Verdict:
        """Check a stable run before it is measured, and return its status.

        Parameters
        ----------
        outcome : Lifting
            The grains at the end of the run.
        settings : SceneSettings
            Sections of the configuration.

        Returns
        -------
        Verdict
            `OK`, or the status of the first check that fails: a wrong filling, grains
            in the tube, too many grains off the plate, grains in motion, or no pile.
        """
        section = self.section(settings)
        # `_judge_filling` and `not_at_rest` return None if the run passes their check.
        filling_verdict = _judge_filling(outcome, section)
        if filling_verdict is not None:
            return filling_verdict
        n_grains = outcome.n_filled
        if outcome.n_in_tube:
            return Verdict(
                "jammed",
                f"{outcome.n_in_tube} grains are still in the tube after it was lifted by "
                "its own length",
            )
        # `LARGEST_LOSS` and `SMALLEST_PILE` are fractions of the grains.
        if outcome.n_off_plate > LARGEST_LOSS * n_grains:
            return Verdict(
                "left_plate",
                f"{outcome.n_off_plate} of {n_grains} grains left the plate",
            )
        motion_verdict = not_at_rest(
            outcome.energy_j,
            settings,
            advice="give the grains more time by lifted_cylinder.settle_s",
            when=f" {section.settle_s:g} s after the lifting",
        )
        if motion_verdict is not None:
            return motion_verdict
        n_on_plate = n_grains - outcome.n_off_plate
        if outcome.n_in_pile < SMALLEST_PILE * n_on_plate:
            return Verdict(
                "no_flank",
                f"only {outcome.n_in_pile} of {n_on_plate} grains touch each other in "
                "the largest pile",
            )
        return OK

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the pile, and name each number as a response of this bench test.

        Parameters
        ----------
        arrays : mapping
            Arrays of the run by name, as `run` returns them.
        scene : Scene
            Settings, parameters, grain and seed of the run.

        Returns
        -------
        dict
            The responses. A response that cannot be measured is None. If such a
            response is a target, there are also ``status`` and ``reason``, which
            replace those of the run.
        """
        from repose.measure.saved_piles import pile_responses

        plate_mm = self.section(scene.settings).plate_diameter_mm
        # `pile_responses` measures the foot and the loose grains only if they are
        # named.
        extra_names = (PILE_NAMES[FOOT.name], PILE_NAMES[LOOSE.name])
        pile_numbers, pile_reasons = pile_responses(
            arrays, scene.particle, scene.measure, plate_mm, extra_names
        )
        responses = {}
        reasons = {}
        # `PILE_NAMES` has the name in the measurement of a pile for each response.
        for name, pile_name in PILE_NAMES.items():
            responses[name] = pile_numbers.get(pile_name)
            if pile_name in pile_reasons:
                reasons[name] = pile_reasons[pile_name]
        # The dict is empty unless a target cannot be measured.
        fault = self.check_targets(responses, scene.settings, reasons)
        return {**fault, **responses}

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]: filling, lifting and rest."""
        section = self.section(settings)
        lifting_s = section.length_mm / section.lifting_mm_s
        return 2.0 * section.lift_from_s + lifting_s + section.settle_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield settings of a tube that is lifted too early or is too wide."""
        section = self.section(settings)
        if section.berries is not None:
            yield from too_early(section, NAME, "lift_from_s")
        # On each side, the rounded rim makes the tube wider by twice the radius of the
        # rim.
        outer_mm = section.diameter_mm + 4 * section.rim_radius_mm
        if section.plate_diameter_mm <= outer_mm:
            yield (
                "lifted_cylinder.plate_diameter_mm",
                f"above {outer_mm:g}, the tube's outer diameter",
            )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Yield settings of a tube that is too small for the grains, or needs too many.

        Parameters
        ----------
        settings : SceneSettings
            Sections of the configuration.
        axes_mm : sequence of float
            Full lengths of the mean grain along its three axes, the longest first.

        Yields
        ------
        tuple of str
            A key of the configuration, and the values that are allowed for it.
        """
        section = self.section(settings)
        grain_length_mm = axes_mm[0]
        sizes_mm = {"diameter_mm": grain_length_mm, "length_mm": grain_length_mm}
        yield from find_narrow_openings(section, NAME, sizes_mm)
        level_mm = section.filling_height_mm
        if level_mm is ABSENT:
            # The number of grains is configured, so the level of the bed does not
            # matter.
            return

        # A grain must still fit above the bed.
        shortest_mm = level_mm + grain_length_mm
        if section.length_mm < shortest_mm:
            yield (
                "lifted_cylinder.length_mm",
                f"at least {format_significant(shortest_mm)}, the filling height plus the length of a "
                "mean grain",
            )

        # A configured level must not need too many grains or too much time. The number
        # of grains is only estimated: they likely fill the fraction `LIKELY_PACKING` of
        # a bed, and a grain is taken for the ellipsoid of its axes. If there are too
        # many grains, the time is not checked, because the level has to change anyway.
        grain_m3 = math.pi / 6 * 1e-9 * math.prod(axes_mm)
        n_likely = LIKELY_PACKING * section.compute_gapless_count(grain_m3)
        last_grain_s = n_likely / section.rate_per_s
        if n_likely > MOST_BERRIES:
            # The number of grains is proportional to the level.
            highest_mm = level_mm * MOST_BERRIES / n_likely
            yield (
                "lifted_cylinder.filling_height_mm",
                f"below {format_significant(highest_mm)}, which needs some {MOST_BERRIES} grains",
            )
        elif last_grain_s >= section.lift_from_s:
            yield (
                "lifted_cylinder.lift_from_s",
                f"above {format_significant(last_grain_s)}, when the last of some {n_likely:.0f} "
                "grains appears",
            )

"""The lifted cylinder: an open tube stands on a plate, is filled, and is lifted; the grains flow out and form a pile.

The commonest test of the field's papers. Fast lifting takes the support away at once and the grains run wide, so the
angle falls with the speed: one simulated set of wheat gave 18.4, 12.3 and 10.4 degrees at 10, 25 and 50 mm/s (the
project JoshuaMayo-vectr/DEM-calibration). The pile is measured as the funnel's, by the same code.

How much is filled in is a number of grains or, as the papers state it, the filling height: the level of the bed in the
tube, twice the height of its centre of mass. Grains are poured in steps, each as many as the packing of those that
rest says, until the nearest whole number is in.

The tube's wall has no thickness but for its rounded lower edge, which grains also touch from outside. The rising wall
drags grains along by friction. Nothing turns, so rolling is resisted against space.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

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
from repose.bench.factory import LIKELY_PACKING, Disc, fill_and_rest, level_m, too_early
from repose.bench.funnel import (
    BERRY,
    CALIBRATED,
    LARGEST_LOSS,
    SEEN,
    SMALLEST_PILE,
    narrow_openings,
)
from repose.bench.scene import Trial, largest_cluster
from repose.bench.settings import Poured, SceneSettings
from repose.calibrate.responses import Response
from repose.calibrate.runs import Recorded
from repose.common.section import ABSENT, MOST_BERRIES, Berries

if TYPE_CHECKING:
    from repose.grain.particle import Particle

NAME = "lifted_cylinder"
TUBE = ("tube", "rim")  # the walls that are lifted
FLOOR_M = -0.05  # a grain below this height has left the plate and is gone
LOOK_S = 0.05  # simulated time between two looks whether the grains rest, or have left the tube

# --- responses ------------------------------------------------------------------------------------

LIFT = tuple(
    f"{NAME}.{key}"
    for key in ("berries", "filling_height_mm", "diameter_mm", "lifting_mm_s")
)
OUTLINE, LOOSE = (*LIFT, *SEEN), (*LIFT, f"{NAME}.plate_diameter_mm")
ANGLE, FOOT = (*OUTLINE, *CALIBRATED), (*OUTLINE, BERRY)
# Names of the same numbers in the measurement of a pile.
OF_PILE = {"lifted_aor_deg": "aor_deg", "lifted_height_mm": "height_mm"}
OF_PILE |= {"lifted_foot_mm": "base_radius_mm", "lifted_loose_percent": "loose_percent"}

# --- section of the configuration -----------------------------------------------------------------


class LiftedCylinderSettings(Poured):
    """The section `lifted_cylinder` of the configuration; config/README.md explains its keys."""

    berries: Berries = ABSENT
    filling_height_mm: float = Field(default=ABSENT, ge=1, le=5000)
    lift_from_s: float = Field(ge=0.1, le=600)
    lifting_mm_s: float = Field(ge=0.1, le=5000)
    settle_s: float = Field(ge=0.1, le=600)
    diameter_mm: float = Field(ge=1, le=5000)
    length_mm: float = Field(ge=1, le=5000)
    rim_radius_mm: float = Field(ge=0.05, le=20)
    plate_diameter_mm: float = Field(ge=10, le=20000)

    def contradictions(self) -> Contradictions:
        """Neither or both of the two keys that say how much is filled in."""
        if self.berries is self.filling_height_mm is ABSENT:
            yield (
                "filling_height_mm",
                f"1 to 5000, or berries, 1 to {MOST_BERRIES}, in its place",
            )
        elif ABSENT not in (self.berries, self.filling_height_mm):
            yield "filling_height_mm", "nothing: berries gives the level already"


# --- build and run --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Lifting(Ending):
    """A pile below a tube that was lifted."""

    filled: int  # grains that found room in the tube
    filling_height_mm: float  # level of the bed before the lifting
    in_tube: int  # grains above the tube's lower edge at the end
    off_plate: int
    in_pile: int
    energy_j: float  # mean of a grain on the plate at the end
    grain_mm: float  # length of a mean grain


def _move(simulation: "dem.Simulation", speed_m_s: float) -> None:
    """Let the tube rise at a speed."""
    for wall in TUBE:
        simulation.set_motion(wall, dem.Motion(velocity_m_s=(0.0, 0.0, speed_m_s)))


def _without_gaps(section: LiftedCylinderSettings, berry_m3: float) -> float:
    """Return how many grains would fill the tube up to the filling height without gaps between them."""
    radius, height = 0.5e-3 * section.diameter_mm, 1e-3 * section.filling_height_mm
    return math.pi * radius**2 * height / berry_m3


def room_for(section: LiftedCylinderSettings, particle: "Particle") -> int:
    """Return the number of grains, or more than the tube takes up to the filling height."""
    return section.berries or math.ceil(_without_gaps(section, particle.volume_m3))


@register(NAME)
class LiftedCylinderTest(BenchTest[LiftedCylinderSettings]):
    """A pile of what flows out of a tube that is lifted."""

    settings = LiftedCylinderSettings
    responses = (
        Response(
            "lifted_aor_deg",
            "deg",
            "angle of repose, lifted cylinder",
            "AoR, lifted",
            NAME,
            1.0,
            89.0,
            ANGLE,
        ),
        Response(
            "lifted_height_mm",
            "mm",
            "Height, lifted cylinder",
            "Height, lifted",
            NAME,
            1.0,
            2000.0,
            OUTLINE,
        ),
        Response(
            "lifted_foot_mm",
            "mm",
            "foot radius, lifted cylinder",
            "foot, lifted",
            NAME,
            0.0,
            1e4,
            FOOT,
        ),
        Response(
            "lifted_loose_percent",
            "%",
            "loose grains, lifted cylinder",
            "loose, lifted",
            NAME,
            0.0,
            1e2,
            LOOSE,
        ),
    )
    recorded = Recorded(
        tuple(OF_PILE),
        single=(
            *OF_PILE,
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
    photographed: ClassVar = {
        "aor_deg": "lifted_aor_deg",
        "height_mm": "lifted_height_mm",
    }
    summary = (
        "angle of repose {lifted_aor_deg:.2f} deg, Height {lifted_height_mm:.1f} mm, "
        "foot radius {lifted_foot_mm:.1f} mm, {lifted_loose_percent:.1f} % loose"
    )

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe the tube on its plate."""
        section = self.section(scene.settings)
        radius, length = 1e-3 * (0.5 * section.diameter_mm), 1e-3 * section.length_mm
        edge, plate = (
            1e-3 * section.rim_radius_mm,
            1e-3 * (0.5 * section.plate_diameter_mm),
        )
        half, up = plate + 2.0 * reach_m, (0.0, 0.0, 1.0)
        return {
            "capacity": room_for(section, scene.particle),
            "walls": {
                "plate": dem.Plane((0.0, 0.0, 0.0), up, "wall", plate),
                "tube": dem.Cylinder(
                    (0.0, 0.0, edge), up, length + 2.0 * reach_m, radius, "wall"
                ),
                # its lowest point touches the plate; what is outside the tube's wall is the wall's
                "rim": dem.RingEdge(
                    radius + edge, edge, "wall", ((0.0, 1.0), (0.0, 0.0)), edge
                ),
            },
            "lower": (-half, -half, 0.0),
            "upper": (half, half, length + 4.0 * reach_m),
            "floor_height_m": FLOOR_M,
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Fill the tube, let the grains rest, lift it until none is left in it, and let the pile rest.

        The arrays are ``position``, ``quaternion``, ``in_pile`` and ``scale``, as of a pour of the funnel. The tube is
        lifted by at most its own length.
        """
        section, settings = self.section(scene.settings), scene.simulation
        trial = Trial(
            self.build, scene, room_for(section, scene.particle), interval_s, progress
        )
        simulation, every = trial.simulation, max(1, settings.steps(LOOK_S))
        length, speed = 1e-3 * section.length_mm, 1e-3 * section.lifting_mm_s
        factory = Disc(
            0.5e-3 * section.diameter_mm - trial.reach_m, length + trial.reach_m
        )
        filled, filling_mm, lifted_m = 0, math.nan, 0.0

        def in_tube() -> np.ndarray:
            return simulation.present & (simulation.positions[:, 2] > lifted_m)

        def rests() -> bool:
            return bool(
                simulation.kinetic_energies()[simulation.present].mean()
                <= settings.rest_energy_j
            )

        # grains that hang in the tube are lifted with it
        with trial.bound(factory.height_m + length, speed).guard():
            fill_and_rest(trial, factory, section, section.lift_from_s, every, rests)
            filled, filling_mm = simulation.n_bodies, 1e3 * level_m(simulation)
            began_s = simulation.time_s
            _move(simulation, speed)
            last = simulation.steps + settings.steps(length / speed)
            while in_tube().any() and simulation.steps < last:
                trial.run_to(min(last, simulation.steps + every))
                lifted_m = speed * (simulation.time_s - began_s)
            _move(simulation, 0.0)
            trial.wait(
                rests, simulation.steps + settings.steps(section.settle_s), every
            )
        hanging = in_tube()
        on_plate = simulation.present & (simulation.positions[:, 2] > 0.0) & ~hanging
        in_pile = largest_cluster(simulation.contacts(), on_plate)
        energies = simulation.kinetic_energies()[on_plate]
        lifting = Lifting(
            filled=filled,
            filling_height_mm=filling_mm,
            in_tube=int(hanging.sum()),
            off_plate=int(len(on_plate) - hanging.sum() - on_plate.sum()),
            in_pile=int(in_pile.sum()),
            energy_j=float(energies.mean()) if len(energies) else math.nan,
            grain_mm=1e3 * float(scene.particle.axes_m.max()),
            unstable=trial.broken,
        )
        numbers = {
            "berries": filled,
            "filling_height_mm": filling_mm,
            "lifted_mm": 1e3 * lifted_m,
        }
        numbers |= {
            "berries_in_pile": lifting.in_pile,
            "berries_off_plate": lifting.off_plate,
        }
        return self.ended(
            scene,
            lifting,
            trial.grains(in_pile=in_pile),
            trial.frames(walls=True),
            **numbers,
        )

    def faults(self, ending: Lifting, settings: SceneSettings) -> Faults:
        """Judge a run before it is measured."""
        section = self.section(settings)
        grains, level, in_pile = (
            section.berries or ending.filled,
            ending.filling_height_mm,
            ending.in_pile,
        )
        asked = section.filling_height_mm or level
        there, hanging, lost = (
            grains - ending.off_plate,
            ending.in_tube,
            ending.off_plate,
        )
        off = not abs(level - asked) <= ending.grain_mm
        few = in_pile < SMALLEST_PILE * there
        return stated(
            (
                ending.filled < grains,
                "not_filled",
                f"only {ending.filled} of {grains} grains find room in the tube",
            ),
            (
                off,
                "not_filled",
                f"the bed rests at {level:.4g} mm, not at {asked:g} mm",
            ),
            (
                hanging,
                "jammed",
                f"{hanging} grains hang in the tube, which was lifted by its own length",
            ),
            (
                lost > LARGEST_LOSS * grains,
                "left_plate",
                f"{lost} of {grains} grains left the plate",
            ),
            settings.simulation.not_at_rest(
                ending.energy_j, f" {section.settle_s:g} s after the lifting"
            ),
            (
                few,
                "no_flank",
                f"only {in_pile} of {there} grains touch each other in the largest pile",
            ),
        )

    def values(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the pile."""
        from repose.measure.saved_piles import pile_responses

        plate_mm, more = (
            self.section(scene.settings).plate_diameter_mm,
            ("base_radius_mm", "loose_percent"),
        )
        of_pile, reasons = pile_responses(
            arrays, scene.particle, scene.measure, plate_mm, more
        )
        measured = {name: of_pile.get(other) for name, other in OF_PILE.items()}
        reasons = {
            name: reasons[other] for name, other in OF_PILE.items() if other in reasons
        }
        return {**self.assess(measured, scene.settings, reasons), **measured}

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time: filling, lifting by the tube's length, and rest."""
        section = self.section(settings)
        return (
            2.0 * section.lift_from_s
            + section.length_mm / section.lifting_mm_s
            + section.settle_s
        )

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Refuse a tube that cannot be filled before it is lifted, or is as wide as the plate."""
        section = self.section(settings)
        if section.berries is not None:
            yield from too_early(section, NAME, "lift_from_s")
        wide = section.diameter_mm + 4 * section.rim_radius_mm
        if section.plate_diameter_mm <= wide:
            yield (
                f"{NAME}.plate_diameter_mm",
                f"above {wide:g}, the tube's outer diameter",
            )

    def misfits(
        self, settings: SceneSettings, axes_mm: Sequence[float]
    ) -> Contradictions:
        """Refuse a tube that is too narrow for the mean grain, or takes too many of them."""
        section = self.section(settings)
        yield from narrow_openings(
            section, NAME, {"diameter_mm": axes_mm[0], "length_mm": axes_mm[0]}
        )
        level = section.filling_height_mm
        if level is None:
            return
        if section.length_mm < (needed := level + axes_mm[0]):
            yield (
                f"{NAME}.length_mm",
                f"at least {needed:.4g}, the filling height and the length of a mean grain",
            )
        berry_m3 = math.pi / 6 * 1e-9 * math.prod(axes_mm)
        likely = LIKELY_PACKING * _without_gaps(section, berry_m3)
        if likely > MOST_BERRIES:
            highest = level * MOST_BERRIES / likely
            yield (
                f"{NAME}.filling_height_mm",
                f"below {highest:.4g}, which takes some {MOST_BERRIES} grains",
            )
        elif (last := likely / section.rate_per_s) >= section.lift_from_s:
            yield (
                f"{NAME}.lift_from_s",
                f"above {last:.4g}, when the last of some {likely:.0f} grains appears",
            )

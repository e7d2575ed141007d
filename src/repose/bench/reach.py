"""Whether piles of a study's grains can have the angle and the Height of its targets at once, before any pour.

Grains keep their volume V, so an angle goes with each Height: a cone of Height H has tan a = sqrt(pi H^3 / (3 V)). How
far the angle by a line is from the cone's was measured: the table beside this module has the ratio of the two tangents
for the samples of the goji berry's design (`python -m research.measurement line_slopes`).
"""

import contextlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose.bench import funnel, scene_size
from repose.bench.settings import SceneSettings
from repose.calibrate.targets import Target, Targets
from repose.common.errors import InputError
from repose.common.files import read_table
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import MeasureSettings, line_of

if TYPE_CHECKING:
    import pandas as pd

    from repose.grain.particle import Particle

TABLE = Path(__file__).with_name("line_slopes.csv")
GRAIN_MM, GRAINS = (21.14, 11.37, 9.88), 500  # of the table's piles
# Largest share of a pile that its grains fill: the densest lattice of equal balls. Shaken ellipsoids reach .735 (Donev
# et al. 2004, Science 303, 990), poured grains less; and a tenth of them lies loose beside the pile.
DENSEST = 0.74
SIGMAS = 2.0  # so many standard deviations from the mean of real piles a target is out of their reach
FEWEST_SAMPLES = 20  # of the study itself, in place of the table
ALIKE = 0.05  # relative difference of the proportions of grains that count as the same
# Standard deviation [deg] between grains: the mean angles of four crops differ from the table's by up to 1 (whole
# side), 2 (secant) and 4.6 degrees (flank).
OTHER_GRAIN_DEG = 3.0
READ = {
    "flank": ("flank", "fit_from", "fit_to"),
    "whole": (),
    "secant": (),
}  # keys of a line
READ |= {"steepest": READ["flank"], "straightest": ("smallest_window",)}


class Band(NamedTuple):
    """Angles of real piles at one Height [deg]."""

    mean: float
    sd: float
    largest: float
    source: str  # the piles, in words


class Reach(NamedTuple):
    """Whether piles of the grains can have a target's angle at the targeted Height."""

    line: str
    bound_deg: (
        float | None
    )  # the steepest by mass alone; None for a line that may leave out the toe
    band: Band
    possible: bool
    sentence: str

    def record(self) -> dict[str, Any]:
        """As the material card has it."""
        numbers = [round(number, 2) for number in self.band[:3]]
        bound = None if self.bound_deg is None else round(self.bound_deg, 2)
        own = {"line": self.line, "bound_deg": bound, "band_deg": numbers}
        return own | {"possible": self.possible, "sentence": self.sentence}


def of(
    config: Mapping[str, Any],
    particle: "Particle",
    dataset_csv: str | PathLike | None = None,
) -> dict[str, Reach]:
    """Assess each target that is an angle of the funnel's pile; return nothing without a target of its Height.

    `dataset_csv` are samples of the study itself, by the same settings.
    """
    settings = SceneSettings(config)
    targets = {
        target.name: target for target in Targets.of(settings.targets_of(funnel.NAME))
    }
    if "height_mm" not in targets:
        return {}
    measure = settings.measure_of({})
    grain_mm = measure.berry_height_mm or 1e3 * float(np.prod(particle.axes_m)) ** (
        1 / 3
    )
    grains = settings.section(funnel.NAME, funnel.FunnelSettings).berries
    piles = _Piles(
        grains,
        particle,
        replace(measure, berry_height_mm=grain_mm),
        targets["height_mm"].value,
    )
    angles = {"aor_deg": measure.response} | {
        name: definition for definition, name in MEAN_KEYS.items()
    }
    return {
        name: piles.reach(targets[name], line, dataset_csv)
        for name, line in angles.items()
        if name in targets
    }


def said(
    config: Mapping[str, Any], particle: "Particle", dataset_csv: str | PathLike | None
) -> Iterator[str]:
    """Yield a line of text for each `Reach`, as the verbs and the workflow print it before the first pour."""
    for reach in of(config, particle, dataset_csv).values():
        yield f"reach: {'' if reach.possible else 'WARNING: '}{reach.sentence}"


def cone_tan(height_mm: float, volume_m3: float) -> float:
    """Compute the slope of a cone of a Height and a volume."""
    return math.sqrt(math.pi * (1e-3 * height_mm) ** 3 / (3 * volume_m3))


def steepest_deg(definition: str, height_mm: float, grains_m3: float) -> float | None:
    """Compute the steepest angle of a pile of a Height and a volume of grains [deg]; None where mass sets no bound.

    A side that falls ever less steeply outwards has, over equal steps of distance, no steeper regression line from foot
    to crest than the cone of its Height and volume. A line that sees less of the toe may be steeper.
    """
    return (
        None
        if definition != "whole"
        else math.degrees(math.atan(cone_tan(height_mm, grains_m3 / DENSEST)))
    )


def carried(
    angle_deg: "pd.Series", height_mm: "pd.Series", to_mm: float
) -> "pd.Series":
    """Carry angles of piles [deg] to the Height that the same volume would have: tan(angle) ~ Height^1.5."""
    return np.degrees(
        np.arctan(np.tan(np.radians(angle_deg)) * (to_mm / height_mm) ** 1.5)
    )


@dataclass(frozen=True)
class _Piles:
    """The poured piles of a study, as high as their target."""

    grains: int
    particle: "Particle"
    measure: MeasureSettings  # with the height of a grain
    height_mm: float

    def reach(
        self, target: Target, definition: str, dataset_csv: str | PathLike | None
    ) -> Reach:
        """Assess one target."""
        grain_m3, line = self.particle.volume_m3, line_of(self.measure, definition)
        bound = steepest_deg(definition, self.height_mm, self.grains * grain_m3)
        own = (
            None
            if dataset_csv is None
            else _own_band(dataset_csv, target.name, self.height_mm)
        )
        band = own or self.known_band(definition)
        forbidden = (
            bound is not None and target.value - SIGMAS * target.standard_error > bound
        )
        away = (target.value - band.mean) / math.hypot(band.sd, target.standard_error)
        possible = not forbidden and abs(away) <= SIGMAS
        made = f"a pile of {self.height_mm:.1f} mm with {target.value:.1f} deg by the line '{line}'"
        known = f"{band.mean:.1f} +- {band.sd:.1f} deg (largest {band.largest:.1f}; {band.source})"
        piles = f"piles of this mass and Height have {known}"
        sentence = f"{made} is possible: {piles}"
        if not possible:
            can, most = (
                ("cannot", f"by mass alone at most {bound:.1f} deg; ")
                if forbidden
                else ("can hardly", "")
            )
            grains = f"{self.grains} grains of {1e9 * grain_m3:.4g} mm3"
            sentence = f"{grains} {can} make {made}: {most}{piles}. Are line, grain and targets of the same piles?"
        return Reach(line, bound, band, possible, sentence)

    def known_band(self, definition: str) -> Band:
        """Look the band up in the table, changed to the study's number of grains as `scene_size` knows it."""
        assert self.measure.berry_height_mm is not None
        row, exact = nearest_row(
            self.measure, definition, self.measure.berry_height_mm / self.height_mm
        )
        cone = cone_tan(
            self.height_mm, self.grains * self.particle.volume_m3 / funnel.PACKING
        )
        change = scene_size.change(
            GRAINS, self.grains, scene_size.TABULATED.get(definition, definition)
        )

        def angle(ratio: float) -> float:
            before = math.degrees(math.atan(ratio * cone)) + change.angle_deg
            return math.degrees(
                math.atan(math.tan(math.radians(before)) / change.height**1.5)
            )

        ends = [angle(row["mean"] + sign * row["sd"]) for sign in (-1, 1)]
        axes = sorted(self.particle.axes_m, reverse=True)
        alike = np.allclose(
            np.divide(axes, axes[0]), np.divide(GRAIN_MM, GRAIN_MM[0]), rtol=ALIKE
        )
        source = f"{row['samples']} samples of the goji berry{'' if alike else ', not of this grain'}"
        source += (
            ""
            if self.grains == GRAINS
            else f", {GRAINS} grains each, changed to {self.grains}"
        )
        source += (
            ""
            if exact
            else f", by the nearest line measured, '{line_of(row.to_dict(), definition)}'"
        )
        sd = math.hypot((ends[1] - ends[0]) / 2, 0.0 if alike else OTHER_GRAIN_DEG)
        return Band(angle(row["mean"]), sd, angle(row["largest"]), source)


def _own_band(dataset_csv: str | PathLike, angle: str, height_mm: float) -> Band | None:
    """Carry the study's own samples to the Height, each at its volume; return their band, None if they are too few."""
    with contextlib.suppress(
        InputError
    ):  # the stage that reads a damaged table says so
        table = read_table(dataset_csv, ("status", angle, "height_mm"))
        table = table[table["status"] == "ok"]
        if len(table) >= FEWEST_SAMPLES:
            angles = carried(table[angle], table["height_mm"], height_mm)
            source = f"{len(table)} samples of this study"
            return Band(
                float(angles.mean()), float(angles.std()), float(angles.max()), source
            )
    return None


def nearest_row(
    measure: MeasureSettings, definition: str, grain: float
) -> tuple["pd.Series", bool]:
    """Find the row of the table that is nearest to a line, and whether it is of this very line.

    `grain` is the height of a grain as a share of the Height.
    """
    given = {key: getattr(measure, key) for key in READ[definition]}
    wanted = {key: grain if value == "berry" else value for key, value in given.items()}
    table = read_table(
        TABLE, ("definition", "samples", "mean", "sd", "largest", *wanted)
    )
    table = table[table["definition"] == definition].reset_index(drop=True)
    away = np.zeros(len(table))
    for key, value in wanted.items():
        away += table[key] != value if key == "flank" else (table[key] - value).abs()
    nearest = int(np.argmin(away))
    return table.iloc[nearest], bool(away[nearest] < 0.005)

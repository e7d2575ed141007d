"""Assess whether piles of a study can have the angle and Height of its targets."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
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
# Axes and number of the grains in the piles of the table.
GRAIN_MM = (21.14, 11.37, 9.88)
GRAINS = 500
# Largest share of a pile that its grains fill: the densest lattice of equal balls. Shaken
# ellipsoids reach .735 (Donev et al. 2004, Science 303, 990), poured grains less; and a
# tenth of them lies loose beside the pile.
DENSEST_PACKING = 0.74
# Standard deviations from the mean of real piles at which a target is out of reach.
LARGEST_DEVIATION = 2.0
# Fewest samples of the study itself that replace the table.
FEWEST_SAMPLES = 20
# Relative difference of the proportions of grains that count as the same.
SHAPE_TOLERANCE = 0.05
# Standard deviation [deg] between grains: the mean angles of four crops differ from the
# table's by up to 1 (whole side), 2 (secant) and 4.6 degrees (flank).
OTHER_GRAIN_DEG = 3.0
# Distance up to which a row of the table is of a line itself, see `nearest_row`.
LINE_TOLERANCE = 0.005
# Keys of the section `measure` that define the line of each angle.
LINE_KEYS: dict[str, tuple[str, ...]] = {
    "flank": ("flank", "fit_from", "fit_to"),
    "whole": (),
    "secant": (),
    "steepest": ("flank", "fit_from", "fit_to"),
    "straightest": ("smallest_window",),
}


class Band(NamedTuple):
    """Angles of real piles at one Height [deg]."""

    mean: float
    sd: float
    largest: float
    source: str  # the piles, in words


@dataclass(frozen=True)
class Reach:
    """Whether piles of the grains can have a target's angle at the targeted Height.

    Attributes
    ----------
    target : Target
        The target of the angle.
    pile : Pile
        The piles of the grains.
    line : str
        The line by which the angle is measured, in words.
    bound_deg : float or None
        The steepest angle by mass alone; None for a line that may leave out the toe.
    band : Band
        Angles of real piles.
    """

    target: Target
    pile: "Pile"
    line: str
    bound_deg: float | None
    band: Band

    @property
    def exceeds_bound(self) -> bool:
        """Whether the target is steeper than the mass allows."""
        if self.bound_deg is None:
            return False
        lowest_deg = self.target.value - LARGEST_DEVIATION * self.target.standard_error
        return lowest_deg > self.bound_deg

    @property
    def possible(self) -> bool:
        """Whether the target is neither beyond the bound nor far from real piles."""
        sd = math.hypot(self.band.sd, self.target.standard_error)
        deviation = (self.target.value - self.band.mean) / sd
        return not self.exceeds_bound and abs(deviation) <= LARGEST_DEVIATION

    @property
    def sentence(self) -> str:
        """The result in words: a sentence, and up to two more if it is out of reach."""
        band = self.band
        state = "attainable" if self.possible else "out of reach"
        text = (
            f"Target {state}: {self.target.value:.1f} deg at {self.pile.height_mm:.1f} "
            f"mm by the line '{self.line}'; piles of this mass reach {band.mean:.1f} "
            f"+- {band.sd:.1f} deg, at most {band.largest:.1f} ({band.source})."
        )
        if self.exceeds_bound:
            grain_mm3 = 1e9 * self.pile.particle.volume_m3
            text += (
                f" The mass of {self.pile.n_grains} grains of {grain_mm3:.4g} mm3 allows "
                f"at most {self.bound_deg:.1f} deg."
            )
        if not self.possible:
            text += (
                " Check the line, the number and mass of the grains, and that both "
                "targets are of the same piles."
            )
        return text

    def record(self) -> dict[str, Any]:
        """Return the entry of the material card."""
        bound_deg = None if self.bound_deg is None else round(self.bound_deg, 2)
        band = (self.band.mean, self.band.sd, self.band.largest)
        return {
            "line": self.line,
            "bound_deg": bound_deg,
            "band_deg": [round(number, 2) for number in band],
            "possible": self.possible,
            "sentence": self.sentence,
        }


@dataclass(frozen=True)
class Pile:
    """A poured pile of a study, as high as the target."""

    n_grains: int
    particle: "Particle"
    measure: MeasureSettings  # with the height of a grain
    height_mm: float

    @property
    def grains_m3(self) -> float:
        """Volume of all grains, without the gaps between them."""
        return self.n_grains * self.particle.volume_m3


def assess_targets(
    config: Mapping[str, Any],
    particle: "Particle",
    dataset_csv: str | PathLike | None = None,
) -> dict[str, Reach]:
    """Assess each target that is an angle of the funnel's pile.

    Parameters
    ----------
    config : mapping
        The configuration.
    particle : Particle
        The mean grain.
    dataset_csv : path, optional
        Samples of the study itself, by the same settings.

    Returns
    -------
    dict
        Assessments by the name of the response; none without a target of the Height.
    """
    settings = SceneSettings(config)
    targets = {
        target.name: target for target in Targets.of(settings.targets_of(funnel.NAME))
    }
    if "height_mm" not in targets:
        return {}
    pile = _make_pile(settings, particle, height_mm=targets["height_mm"].value)

    # Responses that are angles, with the definition of each
    definitions = {"aor_deg": pile.measure.response}
    for definition, name in MEAN_KEYS.items():
        definitions[name] = definition
    assessments = {}
    for name, definition in definitions.items():
        if name in targets:
            assessments[name] = assess(targets[name], definition, pile, dataset_csv)
    return assessments


def _make_pile(settings: SceneSettings, particle: "Particle", height_mm: float) -> Pile:
    """Make the pile of a study.

    Parameters
    ----------
    settings : SceneSettings
        Sections of the configuration.
    particle : Particle
        The mean grain.
    height_mm : float
        Height of the pile, which is that of the target.
    """
    measure = settings.measure_of({})
    # Without a configured height of a grain it is the geometric mean of its axes.
    grain_mm = measure.berry_height_mm
    if not grain_mm:
        grain_mm = 1e3 * float(np.prod(particle.axes_m)) ** (1 / 3)
    return Pile(
        n_grains=settings.section(funnel.NAME, funnel.FunnelSettings).berries,
        particle=particle,
        measure=measure.with_grain_height(grain_mm),
        height_mm=height_mm,
    )


def warnings(
    config: Mapping[str, Any], particle: "Particle", dataset_csv: str | PathLike | None
) -> Iterator[str]:
    """Yield a line of text for each assessed target, to print before the first pour."""
    for assessment in assess_targets(config, particle, dataset_csv).values():
        warning = "" if assessment.possible else "WARNING: "
        yield f"reach: {warning}{assessment.sentence}"


def assess(
    target: Target,
    definition: str,
    pile: Pile,
    dataset_csv: str | PathLike | None = None,
) -> Reach:
    """Compare the target of an angle with the angles of real piles.

    Parameters
    ----------
    target : Target
        The target.
    definition : str
        Definition of the angle.
    pile : Pile
        The study's pile.
    dataset_csv : path, optional
        Samples of the study itself. Without them, or with too few, the angles are those
        of the table.
    """
    band = None
    if dataset_csv is not None:
        band = band_of_samples(dataset_csv, target.name, pile.height_mm)
    if band is None:
        band = band_of_table(definition, pile)
    return Reach(
        target=target,
        pile=pile,
        line=line_of(pile.measure, definition),
        bound_deg=steepest_deg(definition, pile.height_mm, pile.grains_m3),
        band=band,
    )


def cone_tan(height_mm: float, volume_m3: float) -> float:
    """Compute the slope of a cone of a Height and a volume, the tangent of its angle.

    Its volume is pi h^3 / (3 tan^2).
    """
    height_m = 1e-3 * height_mm
    return math.sqrt(math.pi * height_m**3 / (3 * volume_m3))


def steepest_deg(definition: str, height_mm: float, grains_m3: float) -> float | None:
    """Compute the steepest angle of a pile of a Height and a volume of grains [deg].

    A side that falls ever less steeply outwards has, over equal steps of distance, no
    steeper regression line from foot to crest than the cone of its Height and volume. A
    line that sees less of the toe may be steeper: then mass sets no bound, and the result
    is None.
    """
    if definition != "whole":
        return None
    return math.degrees(math.atan(cone_tan(height_mm, grains_m3 / DENSEST_PACKING)))


def convert_to_height(
    angle_deg: "pd.Series", height_mm: "pd.Series", to_mm: float
) -> "pd.Series":
    """Convert angles of piles to those of piles of another Height and the same volume.

    As for cones of one volume, the tangent of the angle goes with Height^1.5.

    Parameters
    ----------
    angle_deg, height_mm : Series
        Angles and Heights of the piles.
    to_mm : float
        The other Height, the same for all.

    Returns
    -------
    Series
        The converted angles [degrees].
    """
    tangent = np.tan(np.radians(angle_deg)) * (to_mm / height_mm) ** 1.5
    return np.degrees(np.arctan(tangent))


def band_of_table(definition: str, pile: Pile) -> Band:
    """Look up the angles of piles in the table, and convert them to a study's pile.

    The table has ratios of the angle's tangent to that of the cone with the Height and
    the volume of the pile. Its piles have `GRAINS` grains, so the angles are changed to
    the number of grains of this pile.

    Parameters
    ----------
    definition : str
        Definition of the angle.
    pile : Pile
        The study's pile: number and size of its grains, and its Height.

    Returns
    -------
    Band
        Mean, scatter and largest of the angles, and where they come from.
    """
    assert pile.measure.berry_height_mm is not None
    grain_share = pile.measure.berry_height_mm / pile.height_mm
    row, is_exact = nearest_row(pile.measure, definition, grain_share)
    mean_deg = _angle_of_ratio(row["mean"], definition, pile)
    low_deg = _angle_of_ratio(row["mean"] - row["sd"], definition, pile)
    high_deg = _angle_of_ratio(row["mean"] + row["sd"], definition, pile)
    sd_deg = (high_deg - low_deg) / 2

    # Other grains add a scatter of their own.
    has_table_shape = _has_shape_of_table(pile.particle)
    grain_sd_deg = 0.0 if has_table_shape else OTHER_GRAIN_DEG

    source = [f"{row['samples']} samples of the goji berry"]
    if not has_table_shape:
        source.append("not of this grain")
    if pile.n_grains != GRAINS:
        source.append(f"{GRAINS} grains each, changed to {pile.n_grains}")
    if not is_exact:
        line_keys = {key: row[key] for key in LINE_KEYS[definition]}
        line = line_of(pile.measure.model_copy(update=line_keys), definition)
        source.append(f"by the nearest line measured, '{line}'")
    return Band(
        mean=mean_deg,
        sd=math.hypot(sd_deg, grain_sd_deg),
        largest=_angle_of_ratio(row["largest"], definition, pile),
        source=", ".join(source),
    )


def _angle_of_ratio(ratio: float, definition: str, pile: Pile) -> float:
    """Convert a ratio of the table to the angle of a study's pile [deg].

    Parameters
    ----------
    ratio : float
        Tangent of the angle over that of the cone with the pile's Height and volume.
    definition : str
        Definition of the angle.
    pile : Pile
        The study's pile.
    """
    cone = cone_tan(pile.height_mm, pile.grains_m3 / funnel.PACKING)
    tabulated = scene_size.TABULATED.get(definition, definition)
    change = scene_size.change(GRAINS, pile.n_grains, tabulated)
    changed_deg = math.degrees(math.atan(ratio * cone)) + change.angle_deg
    # Another number of grains also changes the Height, but the pile has that of the
    # target. So the angle is converted back, as by `convert_to_height`.
    tangent = math.tan(math.radians(changed_deg)) / change.height**1.5
    return math.degrees(math.atan(tangent))


def _has_shape_of_table(particle: "Particle") -> bool:
    """Return whether a grain has the proportions of the grains in the table."""
    axes = sorted(particle.axes_m, reverse=True)
    proportions = np.divide(axes, axes[0])
    table_proportions = np.divide(GRAIN_MM, GRAIN_MM[0])
    return np.allclose(proportions, table_proportions, rtol=SHAPE_TOLERANCE)


def band_of_samples(
    dataset_csv: str | PathLike, response: str, height_mm: float
) -> Band | None:
    """Find the angles that the piles of a study's samples would have at a Height.

    Each pile keeps its volume.

    Parameters
    ----------
    dataset_csv : path
        The table of the samples.
    response : str
        Column of the angle.
    height_mm : float
        The Height.

    Returns
    -------
    Band or None
        None for fewer than `FEWEST_SAMPLES` samples, and for a damaged table, which the
        stage that needs it reports.
    """
    try:
        table = read_table(dataset_csv, ("status", response, "height_mm"))
    except InputError:
        return None
    samples = table[table["status"] == "ok"]
    if len(samples) < FEWEST_SAMPLES:
        return None
    angles = convert_to_height(samples[response], samples["height_mm"], height_mm)
    return Band(
        mean=float(angles.mean()),
        sd=float(angles.std()),
        largest=float(angles.max()),
        source=f"{len(samples)} samples of this study",
    )


def nearest_row(
    measure: MeasureSettings, definition: str, grain_share: float
) -> tuple["pd.Series", bool]:
    """Find the row of the table whose line has the settings nearest to those of a line.

    Parameters
    ----------
    measure : MeasureSettings
        Settings of the line.
    definition : str
        Definition of the angle.
    grain_share : float
        Height of a grain as a share of the pile's, for settings that are one grain.

    Returns
    -------
    row : Series
        The row.
    is_exact : bool
        Whether it is of this very line.
    """
    # A setting may be the word "berry": the height of one grain.
    line_settings = {}
    for key in LINE_KEYS[definition]:
        value = getattr(measure, key)
        line_settings[key] = grain_share if value == "berry" else value
    columns = ("definition", "samples", "mean", "sd", "largest", *line_settings)
    table = read_table(TABLE, columns)
    rows = table[table["definition"] == definition].reset_index(drop=True)

    # The distance of a row is the sum of the differences of its settings. Another rule
    # of the flank counts as the difference 1.
    distances = np.zeros(len(rows))
    for key, value in line_settings.items():
        if key == "flank":
            distances += rows[key] != value
        else:
            distances += (rows[key] - value).abs()
    nearest = int(np.argmin(distances))
    is_exact = bool(distances[nearest] < LINE_TOLERANCE)
    return rows.iloc[nearest], is_exact

"""Estimate whether a study's piles can reach the angle and Height of its targets.

The Height, with a capital letter, is the response `height_mm`: the height of the pile
above the plate. The "line" is the line along the side of a pile that gives its angle of
repose. Its definition and the keys of `LINE_KEYS` determine which points it follows.
"""

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
from repose.common.numbers import format_significant
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import MeasureSettings, line_of

if TYPE_CHECKING:
    import pandas as pd

    from repose.grain.particle import Particle

TABLE_CSV = Path(__file__).with_name("line_slopes.csv")
# Full axes and number of the grains in each pile of the table.
TABLE_GRAIN_MM = (21.14, 11.37, 9.88)
TABLE_N_GRAINS = 500
# Estimate of the largest fraction of a pile that its grains fill: that of the densest
# lattice of equal balls. Shaken ellipsoids reach 0.735 (Donev et al. 2004, Science 303,
# 990). Poured grains reach less, and a tenth of them lies loose beside the pile.
DENSEST_PACKING = 0.74
# A target is out of reach if it lies more than this number of standard deviations from
# the mean of real piles.
LARGEST_DEVIATION = 2.0
# Fewest samples of the study itself that are used instead of the table.
FEWEST_SAMPLES = 20
# Grains count as having the same proportions up to this relative difference.
SHAPE_TOLERANCE = 0.05
# Standard deviation [deg] of the angle between grains of different shapes. The mean
# angles of four crops differ from those of the table by up to 1 degree (whole side), 2
# degrees (secant) and 4.6 degrees (flank).
OTHER_GRAIN_DEG = 3.0
# Distance below which a row of the table belongs to the same line, see
# `find_nearest_row`.
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
    """Statistics of the angles [deg] that real piles of one Height have."""

    mean: float
    sd: float
    largest: float
    source: str  # description of the piles


@dataclass(frozen=True)
class Reach:
    """An estimate of whether piles of the grains can have a target's angle and Height.

    Attributes
    ----------
    target : Target
        The target of the angle.
    pile : Pile
        The piles of the grains.
    line : str
        Description of the line along the side of the pile that gives the angle.
    bound_deg : float or None
        Estimate of the steepest angle that the mass allows; None for a line that may
        leave out the toe of the pile.
    band : Band
        Statistics of the angles of real piles with this Height.
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
        """Whether the target can be reached: within the bound, and near real piles."""
        sd = math.hypot(self.band.sd, self.target.standard_error)
        deviation = (self.target.value - self.band.mean) / sd
        return not self.exceeds_bound and abs(deviation) <= LARGEST_DEVIATION

    @property
    def sentence(self) -> str:
        """The result as text for the user.

        It is a single sentence if the target can be reached. Otherwise up to two
        further sentences give the reason and say what to check.
        """
        band = self.band
        state = "attainable" if self.possible else "out of reach"
        text = (
            f"Target {state}: {self.target.value:.1f} deg at {self.pile.height_mm:.1f} "
            f"mm by the line '{self.line}'; piles of this mass reach an estimated "
            f"{band.mean:.1f} +- {band.sd:.1f} deg, at most about {band.largest:.1f} "
            f"({band.source})."
        )
        if self.exceeds_bound:
            # Convert m3 to mm3.
            grain_mm3 = 1e9 * self.pile.particle.volume_m3
            text += (
                f" By estimate, the mass of {self.pile.n_grains} grains of "
                f"{format_significant(grain_mm3)} mm3 allows at most {self.bound_deg:.1f} deg."
            )
        if not self.possible:
            text += (
                " Check the line, the number and mass of the grains, and that both "
                "targets are of the same piles."
            )
        return text

    def record(self) -> dict[str, Any]:
        """Return the entry for the material card."""
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
    """A poured pile of a study that is as high as the target of its Height."""

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
    """Estimate for each target angle of the poured pile whether it can be reached.

    Parameters
    ----------
    config : mapping
        The configuration.
    particle : Particle
        The mean grain.
    dataset_csv : path, optional
        File with the samples of the study itself, which were measured with the same
        settings.

    Returns
    -------
    dict
        The estimates, by the name of the response. The dict is empty if the Height is
        not a target, because the estimate needs the Height and the angle of the same
        piles.
    """
    settings = SceneSettings(config)
    targets = {
        target.name: target for target in Targets.of(settings.targets_of(funnel.NAME))
    }
    if "height_mm" not in targets:
        return {}
    pile = _make_pile(settings, particle, height_mm=targets["height_mm"].value)

    # Find the definition of each response that is an angle. `aor_deg` has the
    # definition that the configuration chooses. `MEAN_KEYS` has the response of every
    # definition; here the definition of every response is needed.
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
        Height of the pile, which is the value of the target.
    """
    measure = settings.measure_of({})
    # If the configuration does not give the height of a grain, it is the geometric mean
    # of the axes.
    grain_mm = measure.berry_height_mm
    if not grain_mm:
        grain_mm = 1e3 * float(np.prod(particle.axes_m)) ** (1 / 3)
    return Pile(
        n_grains=settings.section(funnel.NAME, funnel.FunnelSettings).berries,
        particle=particle,
        measure=measure.with_grain_height(grain_mm),
        height_mm=height_mm,
    )


def describe_assessments(
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
        Definition of the angle, such as "flank".
    pile : Pile
        The study's pile.
    dataset_csv : path, optional
        File with the samples of the study itself. Without it, or with too few samples,
        the angles come from the table.
    """
    band = None
    if dataset_csv is not None:
        band = compute_band_of_samples(dataset_csv, target.name, pile.height_mm)
    if band is None:
        band = look_up_band(definition, pile)
    return Reach(
        target=target,
        pile=pile,
        line=line_of(pile.measure, definition),
        bound_deg=compute_steepest_angle(definition, pile.height_mm, pile.grains_m3),
        band=band,
    )


def compute_cone_slope(height_mm: float, volume_m3: float) -> float:
    """Compute the slope of a cone from its Height and volume.

    A cone of height h and angle a has the volume pi h^3 / (3 tan(a)^2). The slope is
    tan(a).
    """
    height_m = 1e-3 * height_mm
    return math.sqrt(math.pi * height_m**3 / (3 * volume_m3))


def compute_steepest_angle(
    definition: str, height_mm: float, grains_m3: float
) -> float | None:
    """Estimate the steepest angle of a pile from its Height and its volume of grains.

    If the slope of the side decreases outwards, a regression line over the whole side
    is no steeper than the cone of the same Height and volume. This holds if the points of
    the line are equally spaced in distance. A line that leaves out the toe may be
    steeper.

    Parameters
    ----------
    definition : str
        Definition of the angle.
    height_mm : float
        Height of the pile.
    grains_m3 : float
        Volume of all grains, without the gaps between them.

    Returns
    -------
    float or None
        The angle [deg]; None for a line that may leave out the toe.
    """
    if definition != "whole":
        return None
    smallest_volume_m3 = grains_m3 / DENSEST_PACKING
    slope = compute_cone_slope(height_mm, smallest_volume_m3)
    return math.degrees(math.atan(slope))


def convert_to_height(
    angle_deg: "pd.Series", height_mm: "pd.Series", to_mm: float
) -> "pd.Series":
    """Convert angles of piles to those at another Height, but with the same volume.

    The tangent of the angle is proportional to Height^1.5, which is exact for cones.

    Parameters
    ----------
    angle_deg, height_mm : Series
        Angles and Heights of the piles.
    to_mm : float
        The other Height, which is the same for all piles.

    Returns
    -------
    Series
        The converted angles [deg].
    """
    tangent = np.tan(np.radians(angle_deg)) * (to_mm / height_mm) ** 1.5
    return np.degrees(np.arctan(tangent))


def look_up_band(definition: str, pile: Pile) -> Band:
    """Estimate the angles of a study's piles from the table of measured piles.

    The table contains slope ratios: the slope of the measured line divided by that of
    the cone with the Height and volume of the pile. Its piles consist of
    `TABLE_N_GRAINS` goji berries. So the ratios are converted to angles for the number
    of grains in the study and the Height of its target.

    Parameters
    ----------
    definition : str
        Definition of the angle, such as "flank".
    pile : Pile
        The study's pile: number and size of its grains, and the Height of the target.

    Returns
    -------
    Band
        Mean, standard deviation and largest of the angles, with a description of the
        piles from which they come.
    """
    # `_make_pile` sets the height of a grain.
    assert pile.measure.berry_height_mm is not None
    grain_share = pile.measure.berry_height_mm / pile.height_mm
    row, is_exact = find_nearest_row(pile.measure, definition, grain_share)
    mean_deg = _convert_ratio_to_angle(row["mean"], definition, pile)
    low_deg = _convert_ratio_to_angle(row["mean"] - row["sd"], definition, pile)
    high_deg = _convert_ratio_to_angle(row["mean"] + row["sd"], definition, pile)
    # Half of the difference is the standard deviation of the angle.
    sd_deg = (high_deg - low_deg) / 2

    # The angles are less certain for grains of another shape. `OTHER_GRAIN_DEG` is the
    # standard deviation between such grains.
    has_table_shape = _has_shape_of_table(pile.particle)
    grain_sd_deg = 0.0 if has_table_shape else OTHER_GRAIN_DEG

    # Describe the piles of the table, and how they differ from those of the study.
    source = [f"{row['samples']} samples of the goji berry"]
    if not has_table_shape:
        source.append("not of this grain")
    if pile.n_grains != TABLE_N_GRAINS:
        source.append(f"{TABLE_N_GRAINS} grains each, changed to {pile.n_grains}")
    if not is_exact:
        line_keys = {key: row[key] for key in LINE_KEYS[definition]}
        line = line_of(pile.measure.model_copy(update=line_keys), definition)
        source.append(f"by the nearest line measured, '{line}'")
    return Band(
        mean=mean_deg,
        sd=math.hypot(sd_deg, grain_sd_deg),
        largest=_convert_ratio_to_angle(row["largest"], definition, pile),
        source=", ".join(source),
    )


def _convert_ratio_to_angle(ratio: float, definition: str, pile: Pile) -> float:
    """Convert a slope ratio from the table to the angle of a study's pile [deg].

    Parameters
    ----------
    ratio : float
        Slope of the line over that of the cone with the Height and volume of the pile.
    definition : str
        Definition of the angle.
    pile : Pile
        The study's pile.
    """
    cone_slope = compute_cone_slope(pile.height_mm, pile.grains_m3 / funnel.PACKING)
    tabulated = scene_size.TABULATED.get(definition, definition)
    change = scene_size.interpolate_change(TABLE_N_GRAINS, pile.n_grains, tabulated)
    changed_deg = math.degrees(math.atan(ratio * cone_slope)) + change.angle_deg
    # Another number of grains also changes the Height by the factor `change.height`.
    # However, this pile has the Height of the target. Convert the angle to that Height
    # in the same way as `convert_to_height`.
    tangent = math.tan(math.radians(changed_deg)) / change.height**1.5
    return math.degrees(math.atan(tangent))


def _has_shape_of_table(particle: "Particle") -> bool:
    """Return whether a grain has nearly the proportions of the grains in the table."""
    axes = sorted(particle.axes_m, reverse=True)
    # The proportions are the axes divided by the longest axis.
    proportions = np.divide(axes, axes[0])
    table_proportions = np.divide(TABLE_GRAIN_MM, TABLE_GRAIN_MM[0])
    return np.allclose(proportions, table_proportions, rtol=SHAPE_TOLERANCE)


def compute_band_of_samples(
    dataset_csv: str | PathLike, response: str, height_mm: float
) -> Band | None:
    """Compute statistics of the angles that a study's own piles would have at a Height.

    The piles of its samples have different Heights. Each angle is converted to the
    given Height, while the pile keeps its volume (`convert_to_height`).

    Parameters
    ----------
    dataset_csv : path
        The table of the samples.
    response : str
        Column of the angle.
    height_mm : float
        The Height: height of the pile above the plate.

    Returns
    -------
    Band or None
        Mean, standard deviation and largest of the converted angles. None if there are
        fewer than `FEWEST_SAMPLES` samples, or if the table cannot be read.
    """
    # A missing or damaged table is no error here. The stage that needs this table will
    # report it.
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


def find_nearest_row(
    measure: MeasureSettings, definition: str, grain_share: float
) -> tuple["pd.Series", bool]:
    """Find the row of the table whose angle is measured in the most similar way.

    An angle is the slope of a line along the side of the pile. A row of the table
    line_slopes.csv belongs to a line with certain settings (`LINE_KEYS`), such as the
    fractions of the Height between which the line is fitted. The nearest row is the one
    whose settings differ least from the given ones.

    Parameters
    ----------
    measure : MeasureSettings
        Settings of the line, as attributes with the names of the columns.
    definition : str
        Definition of the angle, such as "flank". Only rows with this definition are
        considered.
    grain_share : float
        Height of a grain as a fraction of the Height of the pile.

    Returns
    -------
    row : Series
        The row, with statistics of the slope of its line (``mean``, ``sd``,
        ``largest``).
    is_exact : bool
        Whether this line has the same settings as the given one, within
        `LINE_TOLERANCE`.
    """
    # Numbers among the settings are fractions. The word "berry" stands for the height
    # of one grain, so convert it to a fraction of the Height.
    line_settings = {}
    for key in LINE_KEYS[definition]:
        value = getattr(measure, key)
        line_settings[key] = grain_share if value == "berry" else value
    columns = ("definition", "samples", "mean", "sd", "largest", *line_settings)
    table = read_table(TABLE_CSV, columns)
    rows = table[table["definition"] == definition].reset_index(drop=True)

    # The distance of a row is the sum of the differences between its settings and those
    # of the line. Numbers are fractions of the Height or of the points of a side, so
    # they can be added. The setting `flank` is the name of a rule. Another rule counts
    # as a difference of 1, which is as large as a difference of fractions can be.
    distances = np.zeros(len(rows))
    for key, value in line_settings.items():
        if key == "flank":
            distances += rows[key] != value
        else:
            distances += (rows[key] - value).abs()
    nearest = int(np.argmin(distances))
    is_exact = bool(distances[nearest] < LINE_TOLERANCE)
    return rows.iloc[nearest], is_exact

"""The rule of the shape study: how it chooses particle, tension, filling and definition of the angle.

This file is the rule. It was committed before the first pour of the study; the tables quote its SHA-256.

1. Particle. Each axis is within 5 % of the measured one, the mass within 2 % of the measured mass, and the volume of
   the body within 5 % of the berry's, which is mass over density. The volume of a multisphere is that of the union of
   its spheres.
2. Pile. The packing in the core of the piles is one that a fruit can have: bulk density of the core over the density of
   the berry is from 0.55 to 0.70, or beyond by less than two standard errors; mean over the pours at the published
   parameter sets. At least three of four pours make a pile. The bulk density in the measuring cylinder stands beside
   it in the tables.
3. Nearness. Of each combination of particle, tension, filling and definition of the angle: the distance
   sqrt(mean over the published sets of the sum over the targets of ((here - published) / sd)^2), with the standard
   deviation sd of the physical piles. An angle always goes with the Height of the same piles.
4. Finalists. Of the combinations that fulfil 1 and 2, the nearest one of each of the four nearest cells; a cell is a
   particle with a tension and a filling. To them comes the most physical combination, see 7.
5. Fresh seeds. The finalists are poured again with seeds that no earlier pour had: at the published sets, and at
   samples of the design. A finalist meets the published piles if the mean difference over the sets of every target is
   at most one sd, and if the signal-to-noise ratio of its angle over the design is at least 1.3, or below it by less
   than two standard errors.
6. Choice. The first finalist, in the order of the distances of 3, that meets the published piles.
7. If none does, the most physical combination is chosen. Its particle is the one that fulfils 1 and 2 and whose surface
   lies nearest to that of the measured body (least rms deviation; in a tie the first listed). Its tension is `release`:
   dry fruits do not pull at each other, and a hit returns the restitution asked for. Its filling is the nearest by 3.
   Its definition is the nearest by 3 of those that can reach the physical pile: over the design's samples, the
   regression of the angle on the Height gives an angle within one sd of the physical one at the physical Height, which
   lies inside the range of the samples. If no definition can, the Height alone is the target.
8. Effective model. The nearest combination of all, whatever 1 and 2 say of it, is poured with the fresh seeds, too. If
   it meets the published piles by 5, it is told as an effective model that reproduces one rig. It is never the choice,
   unless 4 makes it a finalist as well.
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.responses import name_derived_column
from repose.calibrate.targets import Target

NEAR_AXES = 0.05
NEAR_MASS = 0.02
NEAR_VOLUME = 0.05
LEAST_PACKING = 0.55
LARGEST_PACKING = 0.70
LEAST_SHARE_OF_PILES = 0.75
FINALISTS = 4
LEAST_SIGNAL_TO_NOISE = 1.3
STANDARD_ERRORS = 2.0
PHYSICAL_TENSION = "release"
CELL = ["particle", "tension", "filling"]
COMBINATION = [*CELL, "definition"]


def sha256() -> str:
    """Hash of this file."""
    return hashlib.sha256(Path(__file__).read_bytes()).hexdigest()


def particle_row(
    body: Mapping[str, Any], mass_g: float, density_kg_m3: float
) -> dict[str, Any]:
    """Compare a particle with the measured berry, and say whether it is one (1).

    Parameters
    ----------
    about : mapping
        Content of a cell's JSON file.
    mass_g, density_kg_m3 : float
        Of the measured berry.

    Returns
    -------
    dict
    """
    axes = np.array(body["axes_mm"])
    measured = np.array(body["measured_axes_mm"])
    off_axes = float(np.abs(axes / measured - 1).max())
    off_mass = abs(body["mass_g"] / mass_g - 1)
    off_volume = body["volume_mm3"] / (1e6 * mass_g / density_kg_m3) - 1
    near = (
        off_axes <= NEAR_AXES
        and off_mass <= NEAR_MASS
        and abs(off_volume) <= NEAR_VOLUME
    )
    return {
        "particle": body["particle"],
        "spheres": body["spheres"],
        **{f"axis_{k + 1}_mm": value for k, value in enumerate(axes)},
        "mass_g": body["mass_g"],
        "volume_mm3": body["volume_mm3"],
        "deviation_rms_mm": body["deviation_rms_mm"],
        "deviation_max_mm": body["deviation_max_mm"],
        "largest_axis_deviation": off_axes,
        "mass_deviation": off_mass,
        "volume_deviation": off_volume,
        "measured_berry": near,
    }


def packs_like_a_fruit(packing: float, standard_error: float) -> bool:
    """Whether a packing is possible, or too near to a bound to be refused (2).

    Parameters
    ----------
    packing, standard_error : float
        Bulk density over the density of the berry.

    Returns
    -------
    bool
    """
    beyond = max(LEAST_PACKING - packing, packing - LARGEST_PACKING, 0.0)
    return beyond == 0.0 or beyond < STANDARD_ERRORS * standard_error


def finalists(combinations: pd.DataFrame, particles: pd.DataFrame) -> pd.DataFrame:
    """Choose the combinations that are poured again (4, 7, 8).

    Parameters
    ----------
    combinations : pandas.DataFrame
        With `COMBINATION`, ``distance``, ``eligible``.
    particles : pandas.DataFrame
        Rows of `particle_row`, in the order in which the study lists them.

    Returns
    -------
    pandas.DataFrame
        Rows of `combinations` with their ``role``: each ``finalist``, the nearest first, then the ``physical`` and the
        ``effective`` one.
    """
    ordered = combinations.sort_values("distance", kind="stable")
    eligible = ordered[ordered["eligible"]]
    nearest = eligible.drop_duplicates(CELL).head(FINALISTS).assign(role="finalist")
    release = eligible[eligible["tension"] == PHYSICAL_TENSION]
    # idxmin takes the first of equals: size distributions change no shape
    candidates = particles[particles["particle"].isin(release["particle"])].set_index(
        "particle"
    )
    truest = None if candidates.empty else candidates["deviation_rms_mm"].idxmin()
    physical = release[release["particle"] == truest].head(1).assign(role="physical")
    effective = ordered[ordered["distance"].notna()].head(1).assign(role="effective")
    return pd.concat([nearest, physical, effective], ignore_index=True)


def has_signal(ratio: float, standard_error: float) -> bool:
    """Whether a signal-to-noise ratio is large enough, or too near to be refused (5).

    Parameters
    ----------
    ratio, standard_error : float

    Returns
    -------
    bool
    """
    return ratio + STANDARD_ERRORS * standard_error >= LEAST_SIGNAL_TO_NOISE


def meets(row: Mapping[str, Any], targets: Sequence[Target]) -> bool:
    """Whether a finalist's fresh pours meet the published piles (5).

    Parameters
    ----------
    row : mapping
        Mean differences from the published piles, ``signal_to_noise`` and ``signal_to_noise_se``.
    targets : sequence of Target

    Returns
    -------
    bool
    """
    near = all(
        abs(row[name_derived_column(target.name, "difference")]) <= target.sd
        for target in targets
    )
    return near and has_signal(row["signal_to_noise"], row["signal_to_noise_se"])


def reached(means: pd.DataFrame, angle: Target, height: Target) -> dict[str, Any]:
    """Whether piles of a particle can have the physical angle together with the physical Height (7).

    Parameters
    ----------
    means : pandas.DataFrame
        ``angle`` and ``height``, a row for each sample of the design.
    angle, height : Target
        Of the physical pile.

    Returns
    -------
    dict
        ``angle_at_height`` by the regression, NaN where there are fewer than three samples; ``reached``.
    """
    known = means.dropna()
    if len(known) < 3:
        return {"angle_at_height": math.nan, "reached": False}
    slope, offset = np.polyfit(known["height"], known["angle"], 1)
    at = float(slope * height.value + offset)
    inside = known["height"].min() <= height.value <= known["height"].max()
    return {
        "angle_at_height": at,
        "reached": bool(inside and abs(at - angle.value) <= angle.sd),
    }


def choice(
    rows: Sequence[Mapping[str, Any]], definitions: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Say what the study chooses (6, 7, 8).

    Parameters
    ----------
    rows : sequence of mapping
        Of `finalists`, in their order, with ``meets``.
    definitions : sequence of mapping
        Of the most physical combination: each definition of the angle, the nearest first, with ``reached``.

    Returns
    -------
    dict
        ``chosen``: a row, or None without finalists. ``meets_the_published_piles``. ``angle_is_a_target``: whether the
        chosen definition can reach the physical pile. ``effective``: the row of the effective model, or None.
    """
    met = [row for row in rows if row["role"] == "finalist" and row["meets"]]
    within = [row for row in definitions if row["reached"]]
    chosen = next(iter(met or within or definitions), None)
    effective = next((row for row in rows if row["role"] == "effective"), None)
    return {
        "chosen": None if chosen is None else dict(chosen),
        "meets_the_published_piles": bool(met),
        "angle_is_a_target": bool(met or within),
        "effective": None if effective is None else dict(effective),
    }

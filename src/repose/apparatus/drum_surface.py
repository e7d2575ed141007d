"""What is measured of a drum that has turned: the surface of its bed, and how the bed moved in the slip.

Nothing here turns a drum: a changed definition measures the states that were kept.
"""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.apparatus.drum_geometry import Drum
from repose.measure import bed

if TYPE_CHECKING:
    from repose.particle.particle import Particle

STATES = ("start", "report", "before", "after")


def surface_of(
    position: np.ndarray,
    quaternion: np.ndarray,
    scale: np.ndarray,
    config: Mapping[str, Any],
    particle: "Particle",
    section: str = "drum",
) -> bed.Surface:
    """The surface of a bed as a configuration defines it.

    Parameters
    ----------
    position : numpy.ndarray, (N, 3)
        Centres of the berries [m].
    quaternion : numpy.ndarray, (N, 4)
        w, x, y, z, from the body to the world.
    scale : numpy.ndarray, (N,)
        Sizes relative to the particle.
    config : mapping
        The whole configuration.
    particle : Particle
    section : str, optional
        Of the configuration, that describes the drum.

    Returns
    -------
    repose.measure.bed.Surface

    Raises
    ------
    ValueError
        If the bed has none.
    """
    return bed.measure_surface(
        position,
        quaternion,
        particle,
        Drum.of(config[section]).radius_m,
        config["measure"]["mm_per_pixel"],
        config[section]["fit_share"],
        scale,
    )


def surface_angles(
    position: np.ndarray,
    quaternion: np.ndarray,
    scale: np.ndarray,
    config: Mapping[str, Any],
    particle: "Particle",
    section: str = "drum",
) -> np.ndarray:
    """Angle of the surface in each frame.

    Parameters
    ----------
    position : numpy.ndarray, (T, N, 3)
        Centres of the berries [m].
    quaternion : numpy.ndarray, (T, N, 4)
    scale, config, particle, section
        As in `surface_of`.

    Returns
    -------
    numpy.ndarray, (T,)
        Degrees; NaN where the bed has no surface.
    """
    found = np.full(len(position), math.nan)
    for k, (centres, turns) in enumerate(zip(position, quaternion, strict=True)):
        try:
            found[k] = surface_of(centres, turns, scale, config, particle, section).angle_deg
        except ValueError:
            continue
    return found


def no_surface(config: Mapping[str, Any]) -> str:
    """Why a bed has no surface, in words.

    Parameters
    ----------
    config : mapping
        The whole configuration.

    Returns
    -------
    str
    """
    scale = config["measure"]["mm_per_pixel"]
    return f"the bed has no surface that {scale:g} mm a pixel (measure.mm_per_pixel) resolve"


def of_run(
    record: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
    config: Mapping[str, Any],
    particle: "Particle",
) -> tuple[dict[str, Any], np.ndarray]:
    """A run of the drum, measured.

    Parameters
    ----------
    record, arrays
        As `repose.apparatus.drum.run` gives them.
    config : mapping
        The whole configuration.
    particle : Particle

    Returns
    -------
    measured : dict
        The record with the angles of the surface and, of a slip, the numbers of `_of_slip`. Where the surface before or
        after a slip cannot be measured, the status is ``no_surface`` and there are no numbers.
    profile : numpy.ndarray, (bins, 4)
        Motion by depth as `bed.depth_profile` gives it, lengths in mm; empty without a slip.
    """
    measured, profile = dict(record), np.zeros((0, 4))
    if record["status"] not in ("ok", "no_slip"):
        return measured, profile
    states = STATES if record["status"] == "ok" else STATES[:2]
    angles = surface_angles(
        np.array([arrays[f"position_{state}"] for state in states]),
        np.array([arrays[f"quaternion_{state}"] for state in states]),
        arrays["scale"],
        config,
        particle,
    )
    for state, angle in zip(states, angles, strict=True):
        measured[f"{state}_surface_deg"] = float(angle) if math.isfinite(angle) else None
    if record["status"] == "no_slip":
        return measured, profile
    if not np.isfinite(angles[2:]).all():
        judged = {"seed": record["seed"], "status": "no_surface", "reason": no_surface(config)}
        return judged | {"rotation_from_s": record["rotation_from_s"]}, profile
    numbers, profile = _of_slip(record, arrays, config, particle)
    return measured | {"surface_drop_deg": float(angles[2] - angles[3])} | numbers, profile


def _of_slip(record, arrays, config, particle):
    """How the berries moved in the slip; None where no berry lies under the part of the surface that is fitted."""
    centres = arrays["position_before"], arrays["position_after"]
    before = surface_of(centres[0], arrays["quaternion_before"], arrays["scale"], config, particle)
    turned_rad = math.radians(record["after_turned_deg"] - record["before_turned_deg"])
    depth, moved = bed.slip_displacement(*centres, turned_rad, before)
    bin_m = 1e-3 * config["drum"]["depth_bin_mm"]
    profile = bed.depth_profile(depth, moved, bin_m) * (1e3, 1e3, 1e3, 1.0)
    numbers = {
        "moved_share": bed.moved_share(moved, particle),
        "surface_moved_mm": float(profile[0, 1]) if len(profile) else None,
        "wall_moved_mm": float(profile[-1, 1]) if len(profile) else None,
    }
    return numbers, profile

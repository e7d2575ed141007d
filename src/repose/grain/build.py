"""Make the simulated particle of a grain: fit it to the mesh of the grain."""

import functools
import math
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from repose.common.errors import InputError
from repose.common.files import write_bytes, write_table
from repose.dem.rotations import sphere_directions
from repose.grain import mesh_from_axes, sphere_packing, support_fit
from repose.grain.berry_files import SIZE_COLUMNS, read_grain
from repose.grain.mesh import (
    compute_body,
    compute_support,
    ellipsoid_mesh,
    load_mesh,
    read_stl,
    write_stl,
)
from repose.grain.particle import KINDS, MM, Body, Particle, check_positive
from repose.grain.settings import GrainSettings
from repose.grain.support import support

MESH_FILE = "berry.stl"
N_DIRECTIONS = 2000  # in which the support of a mesh is fitted

# Limits of a fitted particle
LARGEST_DEVIATION = 0.15  # of the support values, in mean radii of the mesh
VOLUME_TOLERANCE = 0.1  # sharp edges cost a smooth body volume, and with it mass
ELLIPSOID_TOLERANCE = 2  # times the volume tolerance, for a single ellipsoid

# Comparison of a scan with the table of sizes
SIDES = ("shortest", "middle", "longest")
# A larger ratio of a side to the mean of the sizes means another unit or crop.
LARGEST_RATIO = 1.8


def fit_particle(
    mesh: trimesh.Trimesh,
    density_kg_m3: float,
    stl: str = "",
    source: object = "mesh",
    kind: str = "smooth",
) -> Particle:
    """Fit a convex particle to the support values of a mesh.

    The mass is the density times the volume of the particle, not of the mesh, because an
    ellipsoid is smaller than a fuller grain of the same axes. If all vertices of a mesh
    lie on an ellipsoid, the particle is this ellipsoid. Its volume is a little larger
    than that of the mesh, and the deviations include the parts that the facets cut off.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm, in its principal pose.
    density_kg_m3 : float
        Density of the grain.
    stl : str
        Name of the mesh's file, for the particle.
    source : object
        The mesh's file, for messages.
    kind : str
        "ellipsoid" for a single ellipsoid, "smooth" for a sum of a few.

    Returns
    -------
    Particle
        The particle in SI units.

    Raises
    ------
    InputError
        If the particle does not represent the mesh.
    """
    check_positive(source, density_kg_m3=density_kg_m3)
    # Extents of the mesh from its centre [m], and the radius of a ball of its volume
    directions = sphere_directions(N_DIRECTIONS)
    mesh_support = compute_support(mesh, directions) * MM
    radius = np.cbrt(mesh.volume * 3 / (4 * math.pi)) * MM
    is_ellipsoid = kind == "ellipsoid"
    fit = support_fit.recognise_ellipsoid(
        mesh.vertices * MM, radius, directions, mesh_support
    )
    if fit is None:
        counts = (1,) if is_ellipsoid else support_fit.COMPONENTS
        fit = support_fit.fit_components(directions, mesh_support, radius, counts)
    # Round to nanometres, because smaller digits are only rounding errors of the file.
    semi_axes = np.round(fit, 9)

    # Refuse a particle that does not represent the mesh.
    deviations = np.abs(support(semi_axes, directions) - mesh_support)
    volume, second_moments = support_fit.volume_integrals(semi_axes)
    tolerance = VOLUME_TOLERANCE * (ELLIPSOID_TOLERANCE if is_ellipsoid else 1)
    _check_fit(
        relative_deviation=deviations.max() / radius,
        volume_ratio=volume / (mesh.volume * MM**3),
        tolerance=tolerance,
        source=source,
    )

    body = compute_body(mesh, density_kg_m3)
    return Particle(
        kind="ellipsoid" if len(semi_axes) == 1 else "smooth",
        semi_axes_m=semi_axes,
        density_kg_m3=float(density_kg_m3),
        volume_m3=volume,
        mass_kg=density_kg_m3 * volume,
        inertia_kg_m2=density_kg_m3 * (second_moments.sum() - second_moments),
        bounding_radius_m=support_fit.bounding_radius(semi_axes),
        deviation_max_m=float(deviations.max()),
        deviation_rms_m=float(np.sqrt(np.mean(deviations**2))),
        stl=str(stl),
        mesh_volume_m3=body.volume_m3,
        mesh_inertia_kg_m2=body.inertia_kg_m2,
        mesh_axes_m=body.axes_m,
    )


def _check_fit(
    *, relative_deviation: float, volume_ratio: float, tolerance: float, source: object
) -> None:
    """Raise InputError if the fitted particle does not represent the mesh.

    Parameters
    ----------
    relative_deviation : float
        Largest deviation of the surface over the mesh's mean radius.
    volume_ratio : float
        Volume of the particle over that of the mesh.
    tolerance : float
        Allowed difference of this ratio from 1.
    source : object
        The mesh's file, for messages.
    """
    if relative_deviation > LARGEST_DEVIATION:
        key = "largest deviation of the particle over the mesh's mean radius"
        allowed = (
            f"at most {LARGEST_DEVIATION:g}: the particle is smooth and symmetric to "
            "three planes"
        )
        raise InputError(source, key, round(float(relative_deviation), 3), allowed)
    if abs(volume_ratio - 1) > tolerance:
        key = "volume of the particle over the mesh's"
        low = 1 - tolerance
        high = 1 + tolerance
        allowed = f"from {low:g} to {high:g}: the particle is smooth, without edges"
        raise InputError(source, key, round(float(volume_ratio), 3), allowed)


def make_particle(
    mesh: trimesh.Trimesh,
    density_kg_m3: float,
    kind: str,
    spheres: int | str = 14,
    surface: str = "smooth",
    stl: str = "",
    source: object = "mesh",
) -> Particle:
    """Make a particle of any of the `KINDS` from a mesh.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm, in its principal pose.
    density_kg_m3 : float
        Density of the grain.
    kind : str
        One of `KINDS`.
    spheres : int or str
        Number of spheres of a multisphere, or "fewest".
    surface : str
        Kind of surface of a multisphere, see `sphere_packing.pack`.
    stl : str
        Name of the mesh's file, for the particle.
    source : object
        The mesh's file, for messages.

    Returns
    -------
    Particle
        The particle in SI units.

    Raises
    ------
    InputError
        If the particle cannot be made.
    """
    if kind not in KINDS:
        raise InputError(source, "particle", kind, ", ".join(KINDS))
    if kind != "multisphere":
        return fit_particle(mesh, density_kg_m3, stl=stl, source=source, kind=kind)
    check_positive(source, density_kg_m3=density_kg_m3)

    packing = sphere_packing.pack(mesh, spheres, surface, source)
    # Spheres overlap, so mass and moments of inertia are those of the mesh.
    body = compute_body(mesh, density_kg_m3)
    centres = packing.spheres_m[:, :3]
    radii = packing.spheres_m[:, 3]
    return Particle(
        kind="multisphere",
        semi_axes_m=np.zeros((0, 3)),
        density_kg_m3=float(density_kg_m3),
        volume_m3=packing.volume_m3,
        mass_kg=body.mass_kg,
        inertia_kg_m2=body.inertia_kg_m2,
        bounding_radius_m=float((np.linalg.norm(centres, axis=1) + radii).max()),
        deviation_max_m=packing.deviation_max_m,
        deviation_rms_m=packing.deviation_rms_m,
        spheres_m=packing.spheres_m,
        stl=str(stl),
        mesh_volume_m3=body.volume_m3,
        mesh_inertia_kg_m2=body.inertia_kg_m2,
        mesh_axes_m=body.axes_m,
    )


def compare(particles: Mapping[str, Particle | InputError]) -> list[dict[str, Any]]:
    """Compare the particles of one mesh.

    Parameters
    ----------
    particles : mapping
        The particles by name; an error stands for one that could not be made.

    Returns
    -------
    list of dict
        A row for the mesh, if any particle could be made, and a row for each particle.
        A row has volume, mass, principal moments of inertia, extents and deviations. For
        a particle that could not be made, the key `refused` has the error instead.
    """
    rows = []
    # Each particle has the same mesh, so the first one gives its row.
    possible = [body for body in particles.values() if isinstance(body, Particle)]
    mesh = possible[0].mesh if possible else None
    if mesh is not None:
        rows.append(_make_row("mesh", mesh))
    # Then one row for each particle
    for name, particle in particles.items():
        if isinstance(particle, InputError):
            rows.append({"body": name, "refused": str(particle)})
            continue
        assert particle.mesh_volume_m3 is not None
        volume_ratio = particle.volume_m3 / particle.mesh_volume_m3
        row = _make_row(name, particle)
        row["volume_deviation_percent"] = 100 * (volume_ratio - 1)
        row["deviation_max_mm"] = particle.deviation_max_m / MM
        row["deviation_rms_mm"] = particle.deviation_rms_m / MM
        row["parts"] = len(particle.semi_axes_m) + len(particle.spheres_m)
        rows.append(row)
    return rows


def _make_row(name: str, body: Particle | Body) -> dict[str, Any]:
    """List volume, mass, principal moments and extents of a body by column."""
    row: dict[str, Any] = {
        "body": name,
        "volume_mm3": body.volume_m3 / MM**3,
        "mass_g": body.mass_kg * 1e3,
    }
    for axis, moment in zip("xyz", body.inertia_kg_m2, strict=True):
        row[f"inertia_{axis}_g_mm2"] = 1e9 * moment
    for axis, extent in zip("xyz", body.axes_m, strict=True):
        row[f"axis_{axis}_mm"] = extent / MM
    return row


def of_settings(grain: Mapping[str, Any], section: GrainSettings) -> Particle:
    """Make the particle of a configuration, the same as `run` makes.

    Parameters
    ----------
    grain : mapping
        The mean grain: its axes and its density.
    section : GrainSettings
        The section `berry`.
    """
    source = section.stl or MESH_FILE
    density_kg_m3 = grain["density_kg_m3"]
    return _make_particle_from_file(
        _make_mesh_file(grain, section.stl, section.mass_g),
        density_kg_m3,
        kind=section.particle,
        spheres=section.spheres,
        surface=section.surface,
        source=str(source),
    )


# A particle takes a second to fit, and every load of a configuration makes it anew.
@functools.lru_cache(maxsize=8)
def _make_particle_from_file(
    content: bytes,
    density_kg_m3: float,
    *,
    kind: str,
    spheres: int | str,
    surface: str,
    source: str,
) -> Particle:
    """Make the particle of a mesh from the content of its file."""
    return make_particle(
        read_stl(content, source),
        density_kg_m3,
        kind=kind,
        spheres=spheres,
        surface=surface,
        stl=MESH_FILE,
        source=source,
    )


def _make_mesh_file(
    grain: Mapping[str, Any], stl: str | PathLike | None, mass_g: float | None
) -> bytes:
    """Return the content of the mesh file of a grain.

    Parameters
    ----------
    grain : mapping
        The mean grain: its axes (`repose.grain.berry.mean_axes`) and its density.
    stl : path or None
        The user's scan. Without one, the mesh is made from the axes and the mass.
    mass_g : float or None
        Mass of the mean grain. Without one, the mesh is the ellipsoid of the axes.

    Returns
    -------
    bytes
        An STL file.
    """
    axes_mm = [grain[name] for name in SIZE_COLUMNS]
    if stl is not None:
        scan = load_mesh(stl)
        _check_sides(scan, axes_mm, stl)
        return write_stl(scan)
    return _make_mesh_file_from_axes(tuple(axes_mm), mass_g, grain["density_kg_m3"])


@functools.lru_cache(maxsize=8)
def _make_mesh_file_from_axes(
    axes_mm: tuple[float, ...], mass_g: float | None, density_kg_m3: float
) -> bytes:
    """Make the content of the mesh file of a grain without a scan.

    The result is kept for the next call with the same numbers.

    Parameters
    ----------
    axes_mm : tuple of float
        Full axes of the grain, the longest first.
    mass_g : float or None
        Mass of the grain, which the mesh has. None makes the ellipsoid of the axes.
    density_kg_m3 : float
        Density of the grain.

    Returns
    -------
    bytes
        An STL file.

    Raises
    ------
    InputError
        If no grain has these axes and this mass.
    """
    if mass_g is None:
        return write_stl(ellipsoid_mesh(list(axes_mm)))
    try:
        mesh, _ = mesh_from_axes.grain_mesh(list(axes_mm), mass_g, density_kg_m3)
    except InputError as error:
        if error.key != "mass_g":
            raise
        # If sizes scatter, the mean mass may be too large for the mean axes. Tell the
        # user what to do about it.
        allowed = f"{error.allowed}; without it, the mean volume of the sizes is taken"
        raise InputError(error.source, error.key, error.value, allowed) from error
    return write_stl(mesh)


def _check_sides(
    scan: trimesh.Trimesh, axes_mm: list[float], stl: str | PathLike
) -> None:
    """Raise InputError if a side of a scan is far from the mean of the sizes."""
    extents = sorted(scan.extents)
    for side, extent, mean in zip(SIDES, extents, sorted(axes_mm), strict=True):
        if not mean / LARGEST_RATIO <= extent <= mean * LARGEST_RATIO:
            allowed = (
                f"near {mean:.4g}, its mean in the table of sizes: are both in "
                "millimetres, and of one crop?"
            )
            length = round(float(extent), 4)
            raise InputError(stl, f"{side} side in mm", length, allowed)


def run(
    berry_json: str | PathLike,
    stl: str | PathLike | None = None,
    out_dir: str | PathLike = "results/berry",
    *,
    kind: str = "smooth",
    mass_g: float | None = None,
    spheres: int | str = 14,
    surface: str = "smooth",
) -> Particle:
    """Write berry.stl, particle.json, and particles.csv with all kinds of particles.

    The mesh is the user's scan, or a mesh from the mean axes and the mass. Without a mass
    it is the ellipsoid of the mean axes. The particle is made from the mesh as it is read
    from its file, in single precision.

    Parameters
    ----------
    berry_json : path
        The file of the mean grain.
    stl : path, optional
        The user's scan.
    out_dir : path
        Folder of the files.
    kind : str
        Kind of the particle, one of `KINDS`.
    mass_g : float, optional
        Mass of the mean grain.
    spheres : int or str
        Number of spheres of a multisphere, or "fewest".
    surface : str
        Kind of surface of a multisphere, see `sphere_packing.pack`.

    Returns
    -------
    Particle
        The particle of particle.json.

    Raises
    ------
    InputError
        If this particle cannot be made; another kind that cannot be made is a row of
        particles.csv.
    """
    import pandas as pd

    grain = read_grain(berry_json, (*SIZE_COLUMNS, "density_kg_m3"))
    out = Path(out_dir)
    source = stl or out / MESH_FILE
    content = _make_mesh_file(grain, stl, mass_g)
    mesh = read_stl(content, source)

    def make_particle_of_kind(particle_kind: str) -> Particle:
        return make_particle(
            mesh,
            grain["density_kg_m3"],
            kind=particle_kind,
            spheres=spheres,
            surface=surface,
            stl=MESH_FILE,
            source=source,
        )

    # All kinds are made and compared; only the configured one must succeed.
    particle = make_particle_of_kind(kind)
    particles: dict[str, Particle | InputError] = {}
    for name in KINDS:
        if name == kind:
            particles[name] = particle
            continue
        try:
            particles[name] = make_particle_of_kind(name)
        except InputError as error:
            particles[name] = error

    write_bytes(out / MESH_FILE, content)
    comparison = pd.DataFrame(compare(particles))
    write_table(out / "particles.csv", comparison, float_format="%.6g")
    particle.save(out / "particle.json")
    return particle

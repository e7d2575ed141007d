"""Make the simulated particle of a grain from the mesh of the grain."""

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
from repose.common.numbers import format_significant
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
N_DIRECTIONS = 2000  # directions in which a particle is fitted to a mesh

# Largest allowed deviation of the support values, in mean radii of the mesh
LARGEST_DEVIATION = 0.15
# Largest allowed relative difference between the volumes of particle and mesh. A smooth
# body cannot follow the sharp edges of a mesh, and a single ellipsoid fits less well
# than a sum of several.
VOLUME_TOLERANCE = 0.1
ELLIPSOID_VOLUME_TOLERANCE = 0.2

# Comparison of a scan with the table of sizes
SIDE_NAMES = ("shortest", "middle", "longest")
# If a side differs from the mean of the sizes by a larger factor, one of them has the
# wrong unit, or the scan is of another crop.
LARGEST_SIDE_RATIO = 1.8


def fit_particle(
    mesh: trimesh.Trimesh,
    density_kg_m3: float,
    stl: str = "",
    source: object = "mesh",
    kind: str = "smooth",
) -> Particle:
    """Fit a convex particle to a mesh: one ellipsoid, or a sum of a few ellipsoids.

    The fit compares support values: how far a body extends from its centre in many
    directions. If all vertices of the mesh lie on an ellipsoid, the particle is this
    ellipsoid, whatever `kind` is. Its volume is a little larger than that of the mesh,
    because the facets cut off thin slices of the ellipsoid. The deviations include
    these slices.

    The mass of the particle is the density times the volume of the particle, not of the
    mesh.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm, in its principal pose: centre of mass at the origin, and
        principal axes along x, y and z.
    density_kg_m3 : float
        Density of the grain.
    stl : str
        Name of the mesh's file, which is stored in the particle.
    source : object
        The mesh's file, for messages.
    kind : str
        "ellipsoid" for a single ellipsoid, or "smooth" for a sum of a few ellipsoids.

    Returns
    -------
    Particle
        The particle in SI units.

    Raises
    ------
    InputError
        If the fitted particle differs too much from the mesh.
    """
    check_positive(source, density_kg_m3=density_kg_m3)
    # A support value is the extent of the mesh from its centre in one direction [m].
    # The mean radius is that of a ball with the volume of the mesh. Multiplying by `MM`
    # converts mm to m.
    directions = sphere_directions(N_DIRECTIONS)
    mesh_support = compute_support(mesh, directions) * MM
    mean_radius = np.cbrt(mesh.volume * 3 / (4 * math.pi)) * MM
    is_ellipsoid = kind == "ellipsoid"
    fitted_axes = support_fit.recognise_ellipsoid(
        mesh.vertices * MM, mean_radius, directions, mesh_support
    )
    if fitted_axes is None:
        counts = (1,) if is_ellipsoid else support_fit.COMPONENT_COUNTS
        fitted_axes = support_fit.fit_components(
            directions, mesh_support, mean_radius, counts
        )
    # Round to nanometres, because further digits are only rounding errors of the file.
    semi_axes = np.round(fitted_axes, 9)

    # Reject a particle that does not represent the mesh.
    deviations = np.abs(support(semi_axes, directions) - mesh_support)
    volume, second_moments = support_fit.volume_integrals(semi_axes)
    _check_fit(
        relative_deviation=deviations.max() / mean_radius,
        volume_ratio=volume / (mesh.volume * MM**3),
        volume_tolerance=(
            ELLIPSOID_VOLUME_TOLERANCE if is_ellipsoid else VOLUME_TOLERANCE
        ),
        source=source,
    )

    # Second moments are the integrals of x^2, y^2 and z^2 over the particle. A moment
    # of inertia about one axis is the sum of the second moments of the other two. The
    # mesh has its own properties, which are stored for comparison.
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
    *,
    relative_deviation: float,
    volume_ratio: float,
    volume_tolerance: float,
    source: object,
) -> None:
    """Check that a fitted particle represents its mesh.

    Parameters
    ----------
    relative_deviation : float
        Largest deviation of the support values, in mean radii of the mesh.
    volume_ratio : float
        Volume of the particle over that of the mesh.
    volume_tolerance : float
        Largest allowed difference between this ratio and 1.
    source : object
        The mesh's file, for messages.

    Raises
    ------
    InputError
        If the deviation or the difference between the volumes is too large.
    """
    if relative_deviation > LARGEST_DEVIATION:
        key = "largest deviation of the particle over the mesh's mean radius"
        allowed = (
            f"at most {LARGEST_DEVIATION:g}: the particle is smooth and symmetric to "
            "three planes"
        )
        raise InputError(source, key, round(float(relative_deviation), 3), allowed)
    if abs(volume_ratio - 1) > volume_tolerance:
        key = "volume of the particle over the mesh's"
        low = 1 - volume_tolerance
        high = 1 + volume_tolerance
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
    """Make a particle of a given kind from a mesh.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in mm, in its principal pose: centre of mass at the origin, and
        principal axes along x, y and z.
    density_kg_m3 : float
        Density of the grain.
    kind : str
        One of `KINDS`. `fit_particle` makes the kinds "ellipsoid" and "smooth".
    spheres : int or str
        Number of spheres of a multisphere, or "fewest" for as few as represent the
        mesh.
    surface : str
        Kind of surface of a multisphere, see `sphere_packing.pack`.
    stl : str
        Name of the mesh's file, which is stored in the particle.
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
    # Only a multisphere is left. `fit_particle` checks the density, too.
    check_positive(source, density_kg_m3=density_kg_m3)

    packing = sphere_packing.pack(mesh, spheres, surface, source)
    # The spheres overlap, so their masses and moments of inertia must not be added. The
    # particle has the mass and the moments of the mesh instead.
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


def compare_particles(
    particles: Mapping[str, Particle | InputError],
) -> list[dict[str, Any]]:
    """Compare the properties of particles that were made from the same mesh.

    Parameters
    ----------
    particles : mapping
        The particles by name. If a particle could not be made, the error takes its
        place.

    Returns
    -------
    list of dict
        A row for the mesh, if any particle could be made, and a row for each particle.
        A row has the name (``body``), volume, mass, principal moments of inertia and
        extents. The row of a particle also has its deviations from the mesh, and the
        number of its ellipsoids or spheres (``parts``). For a particle that could not
        be made, the row has only its name and, as ``refused``, the message of the
        error.
    """
    rows = []
    # All particles have the same mesh, so the first particle gives the row of the mesh.
    made_particles = [item for item in particles.values() if isinstance(item, Particle)]
    mesh = made_particles[0].mesh if made_particles else None
    if mesh is not None:
        rows.append(_make_comparison_row("mesh", mesh))
    for name, particle in particles.items():
        if isinstance(particle, InputError):
            rows.append({"body": name, "refused": str(particle)})
            continue
        # All of these particles were made from a mesh.
        assert particle.mesh_volume_m3 is not None
        volume_ratio = particle.volume_m3 / particle.mesh_volume_m3
        row = _make_comparison_row(name, particle)
        row["volume_deviation_percent"] = 100 * (volume_ratio - 1)
        row["deviation_max_mm"] = particle.deviation_max_m / MM
        row["deviation_rms_mm"] = particle.deviation_rms_m / MM
        row["parts"] = len(particle.semi_axes_m) + len(particle.spheres_m)
        rows.append(row)
    return rows


def _make_comparison_row(name: str, body: Particle | Body) -> dict[str, Any]:
    """Make the row with the volume, mass, principal moments and extents of a body."""
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


def make_configured_particle(
    grain: Mapping[str, Any], section: GrainSettings
) -> Particle:
    """Make the particle of a configuration, as `run` would write it to a file.

    Parameters
    ----------
    grain : mapping
        The mean grain with its axes and its density.
    section : GrainSettings
        The section `berry`.

    Returns
    -------
    Particle
        The particle in SI units.
    """
    source = section.stl or MESH_FILE
    density_kg_m3 = grain["density_kg_m3"]
    return _make_particle_from_stl(
        _make_stl(grain, section.stl, section.mass_g),
        density_kg_m3,
        kind=section.particle,
        spheres=section.spheres,
        surface=section.surface,
        source=str(source),
    )


# It takes a second to fit a particle, and each time a configuration is loaded the
# particle is needed again. Therefore the most recent results are cached.
@functools.lru_cache(maxsize=8)
def _make_particle_from_stl(
    stl_content: bytes,
    density_kg_m3: float,
    *,
    kind: str,
    spheres: int | str,
    surface: str,
    source: str,
) -> Particle:
    """Make a particle from the contents of an STL file, see `make_particle`."""
    return make_particle(
        read_stl(stl_content, source),
        density_kg_m3,
        kind=kind,
        spheres=spheres,
        surface=surface,
        stl=MESH_FILE,
        source=source,
    )


def _make_stl(
    grain: Mapping[str, Any], stl: str | PathLike | None, mass_g: float | None
) -> bytes:
    """Make an STL file of a grain, as bytes.

    Parameters
    ----------
    grain : mapping
        The mean grain with its axes (`repose.grain.berry.compute_mean_axes`) and its
        density.
    stl : path or None
        The user's scan. Without a scan, the mesh is made from the axes and the mass.
    mass_g : float or None
        Mass of the mean grain. Without a mass, the mesh is the ellipsoid of the axes.

    Returns
    -------
    bytes
        The contents of the file.

    Raises
    ------
    InputError
        If the scan is invalid or differs too much in size from the grain, or if no
        grain with these axes can have this mass.
    """
    axes_mm = [grain[name] for name in SIZE_COLUMNS]
    if stl is not None:
        scan = load_mesh(stl)
        _check_scan_size(scan, axes_mm, stl)
        return write_stl(scan)
    return _make_stl_from_axes(tuple(axes_mm), mass_g, grain["density_kg_m3"])


@functools.lru_cache(maxsize=8)
def _make_stl_from_axes(
    axes_mm: tuple[float, ...], mass_g: float | None, density_kg_m3: float
) -> bytes:
    """Make an STL file, as bytes, for a grain without a scan.

    The most recent results are cached.

    Parameters
    ----------
    axes_mm : tuple of float
        Full axes of the grain, the longest first.
    mass_g : float or None
        Mass of the grain. If it is None, the mesh is the ellipsoid of the axes.
    density_kg_m3 : float
        Density of the grain.

    Returns
    -------
    bytes
        The contents of the file.

    Raises
    ------
    InputError
        If no grain with these axes can have this mass.
    """
    if mass_g is None:
        return write_stl(ellipsoid_mesh(list(axes_mm)))
    try:
        mesh, _ = mesh_from_axes.make_grain_mesh(list(axes_mm), mass_g, density_kg_m3)
    except InputError as error:
        if error.key != "mass_g":
            raise
        # `make_grain_mesh` names the key `mass_g` if the mass is impossible for the
        # axes. If the grains vary widely in size, their mean mass may be too large for
        # the mean axes. Then the mass can be left out, and the mean volume of the
        # measured sizes is used instead. Tell the user so.
        allowed = f"{error.allowed}; without it, the mean volume of the sizes is taken"
        raise InputError(error.source, error.key, error.value, allowed) from error
    return write_stl(mesh)


def _check_scan_size(
    scan: trimesh.Trimesh, axes_mm: list[float], stl: str | PathLike
) -> None:
    """Check that the sides of a scan fit the mean axes of the measured grains.

    Parameters
    ----------
    scan : Trimesh
        The scan in mm.
    axes_mm : list of float
        Mean axes of the measured grains.
    stl : path
        The file of the scan, for messages.

    Raises
    ------
    InputError
        If a side is far from the corresponding mean axis.
    """
    extents = sorted(scan.extents)
    for name, extent, mean in zip(SIDE_NAMES, extents, sorted(axes_mm), strict=True):
        if not mean / LARGEST_SIDE_RATIO <= extent <= mean * LARGEST_SIDE_RATIO:
            allowed = (
                f"near {format_significant(mean)}, its mean in the table of sizes: are both in "
                "millimetres, and of one crop?"
            )
            length_mm = round(float(extent), 4)
            raise InputError(stl, f"{name} side in mm", length_mm, allowed)


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
    """Make the mesh and the particle of a grain, and write them to files.

    The files are berry.stl (the mesh), particle.json (the particle) and particles.csv
    (a comparison of all kinds of particles). The mesh is the user's scan. Without a
    scan, it is made from the mean axes and the mass of the grain, or as an ellipsoid if
    no mass is given. The particle is made from the mesh after rounding to the single
    precision of the STL file, so that it belongs to the mesh in the file.

    Parameters
    ----------
    berry_json : path
        The file of the mean grain, which the command `berry` writes.
    stl : path, optional
        The user's scan.
    out_dir : path
        Folder to which the files are written.
    kind : str
        Kind of the particle, one of `KINDS`.
    mass_g : float, optional
        Mass of the mean grain. It has no effect if there is a scan.
    spheres : int or str
        Number of spheres of a multisphere, or "fewest" for as few as represent the
        mesh.
    surface : str
        Kind of surface of a multisphere, see `sphere_packing.pack`.

    Returns
    -------
    Particle
        The particle that particle.json describes.

    Raises
    ------
    InputError
        If this particle cannot be made. If a particle of another kind cannot be made,
        particles.csv gives the reason instead.
    """
    # pandas is slow to import, and only this function needs it.
    import pandas as pd

    grain = read_grain(berry_json, (*SIZE_COLUMNS, "density_kg_m3"))
    out = Path(out_dir)
    # Errors name the file of the mesh: the scan, or the file that is written.
    source = stl or out / MESH_FILE
    stl_content = _make_stl(grain, stl, mass_g)
    mesh = read_stl(stl_content, source)

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

    # Make the particle of the wanted kind. If this fails, nothing is written. The other
    # kinds are only needed for the comparison, which lists the errors that they raise.
    particle = make_particle_of_kind(kind)
    particles: dict[str, Particle | InputError] = {}
    for other_kind in KINDS:
        if other_kind == kind:
            particles[other_kind] = particle
            continue
        try:
            particles[other_kind] = make_particle_of_kind(other_kind)
        except InputError as error:
            particles[other_kind] = error

    write_bytes(out / MESH_FILE, stl_content)
    comparison = pd.DataFrame(compare_particles(particles))
    write_table(out / "particles.csv", comparison, float_format="%.6g")
    particle.save(out / "particle.json")
    return particle

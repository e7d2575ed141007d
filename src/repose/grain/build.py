"""From a mesh to the simulated particle: an ellipsoid, a smooth body, or spheres that fill the mesh.

All kinds are made from the same mesh in its principal pose and compared with it: volume, mass, principal moments and
extents.
"""

import math
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from repose.common.errors import InputError, require
from repose.common.files import write_bytes, write_table
from repose.dem.rotations import sphere_directions
from repose.grain import mesh_from_axes, sphere_packing, support_fit
from repose.grain.berry_files import SIZE_COLUMNS, read_berry
from repose.grain.mesh import (
    body_of,
    ellipsoid_mesh,
    load_mesh,
    mesh_of,
    mesh_support,
    stl_of,
)
from repose.grain.particle import KINDS, MM, Body, Particle, check_positive
from repose.grain.settings import GrainSettings
from repose.grain.support import support

LARGEST_DEVIATION = 0.15
SIDES = "shortest", "middle", "longest"
LARGEST_RATIO = 1.8  # of a side of a scan to the mean of the sizes, or the other way round: else another unit or crop
# Sharp edges cost a smooth body volume, and with it mass.
VOLUME_TOLERANCE = 0.1
DIRECTIONS = 2000
MESH_FILE = "berry.stl"


def fit_particle(
    mesh: trimesh.Trimesh,
    density_kg_m3: float,
    stl: str = "",
    source: object = "mesh",
    kind: str = "smooth",
) -> Particle:
    """Fit a convex particle to the support values of a mesh (mm, principal pose).

    Mass is density times the particle's own volume: an ellipsoid holds less than a fuller grain of the same axes. A
    mesh whose vertices lie on an ellipsoid becomes this ellipsoid, whose volume is a little above that of the mesh; the
    deviations include the parts that its facets cut off.
    """
    check_positive(source, density_kg_m3=density_kg_m3)
    n = sphere_directions(DIRECTIONS)
    measured = mesh_support(mesh, n) * MM
    radius = np.cbrt(mesh.volume * 3 / (4 * math.pi)) * MM
    semi_axes = support_fit.recognise_ellipsoid(mesh.vertices * MM, radius, n, measured)
    if semi_axes is None:
        counts = (1,) if kind == "ellipsoid" else support_fit.COMPONENTS
        semi_axes = support_fit.fit_components(n, measured, radius, counts)
    # Below a nanometre lies only the rounding of the file.
    semi_axes = np.round(semi_axes, 9)
    deviation = np.abs(support(semi_axes, n) - measured)
    volume, second_moments = support_fit.volume_integrals(semi_axes)
    tolerance = VOLUME_TOLERANCE * (2 if kind == "ellipsoid" else 1)
    _check_fit(
        deviation.max() / radius, volume / (mesh.volume * MM**3), tolerance, source
    )
    return Particle(
        kind="ellipsoid" if len(semi_axes) == 1 else "smooth",
        semi_axes_m=semi_axes,
        volume_m3=volume,
        mass_kg=density_kg_m3 * volume,
        inertia_kg_m2=density_kg_m3 * (second_moments.sum() - second_moments),
        bounding_radius_m=support_fit.bounding_radius(semi_axes),
        deviation_max_m=float(deviation.max()),
        deviation_rms_m=float(np.sqrt(np.mean(deviation**2))),
        **_origin(body_of(mesh, density_kg_m3), density_kg_m3, stl),
    )


def make_particle(
    mesh: trimesh.Trimesh,
    density_kg_m3: float,
    kind: str,
    spheres: int | str = 14,
    surface: str = "smooth",
    stl: str = "",
    source: object = "mesh",
) -> Particle:
    """Make a particle of any of the `KINDS` from a mesh (mm, principal pose)."""
    require(kind in KINDS, source, "particle", kind, ", ".join(KINDS))
    if kind != "multisphere":
        return fit_particle(mesh, density_kg_m3, stl, source, kind)
    check_positive(source, density_kg_m3=density_kg_m3)
    packing = sphere_packing.pack(mesh, spheres, surface, source)
    body = body_of(mesh, density_kg_m3)
    centres, radii = packing.spheres_m[:, :3], packing.spheres_m[:, 3]
    return Particle(
        kind="multisphere",
        semi_axes_m=np.zeros((0, 3)),
        mass_kg=body.mass_kg,
        inertia_kg_m2=body.inertia_kg_m2,
        bounding_radius_m=float((np.linalg.norm(centres, axis=1) + radii).max()),
        **vars(packing),
        **_origin(body, density_kg_m3, stl),
    )


def _origin(body: Body, density_kg_m3: float, stl: str) -> dict[str, Any]:
    """List the properties of the mesh that a particle keeps."""
    of_mesh = {
        f"mesh_{name}": getattr(body, name)
        for name in ("volume_m3", "inertia_kg_m2", "axes_m")
    }
    return {"density_kg_m3": float(density_kg_m3), "stl": str(stl), **of_mesh}


def compare(particles: Mapping[str, Particle | InputError]) -> list[dict[str, Any]]:
    """List the particles of one mesh in rows, the mesh first: volume, mass, principal moments, extents, deviations."""
    made = [
        particle for particle in particles.values() if isinstance(particle, Particle)
    ]
    rows = [_row("mesh", mesh)] if made and (mesh := made[0].mesh) else []
    for name, particle in particles.items():
        if not isinstance(particle, Particle):
            rows.append({"body": name, "refused": str(particle)})
            continue
        assert particle.mesh_volume_m3 is not None
        rows.append(
            _row(name, particle)
            | {
                "volume_deviation_percent": 100
                * (particle.volume_m3 / particle.mesh_volume_m3 - 1),
                "deviation_max_mm": particle.deviation_max_m / MM,
                "deviation_rms_mm": particle.deviation_rms_m / MM,
                "parts": len(particle.semi_axes_m) + len(particle.spheres_m),
            }
        )
    return rows


def of_settings(grain: Mapping[str, Any], section: GrainSettings) -> Particle:
    """Make the particle of a configuration, the same as by `run`, without the comparison."""
    source = section.stl or MESH_FILE
    mesh = mesh_of(_stl(grain, section.stl, section.mass_g), source)
    kind, spheres, surface = section.particle, section.spheres, section.surface
    return make_particle(
        mesh, grain["density_kg_m3"], kind, spheres, surface, MESH_FILE, source
    )


def _stl(
    grain: Mapping[str, Any], stl: str | PathLike | None, mass_g: float | None
) -> bytes:
    """Return the content of the mesh file: of the user's scan, or a mesh of the mean axes."""
    axes_mm = [grain[name] for name in SIZE_COLUMNS]
    if stl is not None:
        scan = load_mesh(stl)
        for side, extent, mean in zip(
            SIDES, sorted(scan.extents), sorted(axes_mm), strict=True
        ):
            allowed = f"near {mean:.4g}, its mean in the table of sizes: are both in millimetres, and of one crop?"
            good = mean / LARGEST_RATIO <= extent <= mean * LARGEST_RATIO
            require(good, stl, f"{side} side in mm", round(float(extent), 4), allowed)
        return stl_of(scan)
    if mass_g is None:
        return stl_of(ellipsoid_mesh(axes_mm))
    return stl_of(mesh_from_axes.berry_mesh(axes_mm, mass_g, grain["density_kg_m3"])[0])


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
    """Write berry.stl, particle.json, and particles.csv with all kinds of particles (`compare`); return the particle.

    The mesh is the user's scan, or built from the mean axes and the mass (without a mass, their ellipsoid). The
    particle is made from the mesh as in its file, in single precision.
    """
    import pandas as pd

    grain = read_berry(berry_json, (*SIZE_COLUMNS, "density_kg_m3"))
    out = Path(out_dir)
    source, content = stl or out / MESH_FILE, _stl(grain, stl, mass_g)
    mesh = mesh_of(content, source)
    particles: dict[str, Particle | InputError] = {}
    for name in (kind, *(other for other in KINDS if other != kind)):
        try:
            particles[name] = make_particle(
                mesh, grain["density_kg_m3"], name, spheres, surface, MESH_FILE, source
            )
        except InputError as error:
            if name == kind:
                raise
            particles[name] = error
    particle = particles[kind]
    assert isinstance(particle, Particle)
    write_bytes(out / MESH_FILE, content)
    comparison = compare({name: particles[name] for name in KINDS})
    write_table(out / "particles.csv", pd.DataFrame(comparison), float_format="%.6g")
    particle.save(out / "particle.json")
    return particle


def _row(name: str, body: Particle | Body) -> dict[str, Any]:
    """List volume, mass, principal moments and extents of a `Particle` or a `Body`."""
    row = {
        "body": name,
        "volume_mm3": body.volume_m3 / MM**3,
        "mass_g": body.mass_kg * 1e3,
    }
    row |= {
        f"inertia_{x}_g_mm2": 1e9 * value
        for x, value in zip("xyz", body.inertia_kg_m2, strict=True)
    }
    return row | {
        f"axis_{x}_mm": value / MM for x, value in zip("xyz", body.axes_m, strict=True)
    }


def _check_fit(
    relative_deviation: float, volume_ratio: float, tolerance: float, source: object
) -> None:
    """Raise InputError if the fitted particle does not represent the mesh."""
    key = "largest deviation of the particle over the mesh's mean radius"
    allowed = f"at most {LARGEST_DEVIATION:g}: the particle is smooth and symmetric to three planes"
    require(
        relative_deviation <= LARGEST_DEVIATION,
        source,
        key,
        round(float(relative_deviation), 3),
        allowed,
    )
    low, high = 1 - tolerance, 1 + tolerance
    allowed = f"from {low:g} to {high:g}: the particle is smooth, without edges"
    key, good = (
        "volume of the particle over the mesh's",
        abs(volume_ratio - 1) <= tolerance,
    )
    require(good, source, key, round(float(volume_ratio), 3), allowed)

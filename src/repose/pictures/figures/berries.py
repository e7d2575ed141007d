"""Figures 2 and 7: the berries' sizes, and the particle made from the mesh."""

import math
import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.core.errors import InputError
from repose.dem.tessellation import tessellate
from repose.particle import berry, build
from repose.particle.particle import Body, Particle
from repose.particle.sphere_packing import distances

from . import style

AXES = (
    ("long_mm", "long axis", style.BLUE),
    ("major_mm", "major diameter", style.GREEN),
    ("minor_mm", "minor diameter", style.ORANGE),
)
RECONSTRUCTED = "Sizes are a reconstruction from published statistics, not measurements."


def sizes_and_sphericity(inputs: Mapping[str, Any], config: Mapping[str, Any]) -> Figure:
    """Figure 2 and Table 1 of the paper: histograms of the axes and the sphericity (Eq. 1), with normal curves."""
    sizes = berry.read_sizes(inputs["sizes"])
    figure = style.new_figure(style.COLUMN * 1.25, 3.9)
    panels = figure.subplots(2, 2).ravel()
    for panel, (column, label, colour) in zip(panels, AXES, strict=False):
        _histogram(panel, sizes[column].to_numpy(), f"{label} (mm)", colour, "mm")
    sphericity = 100 * berry.sphericity(*(sizes[column].to_numpy() for column, _, _ in AXES))
    _histogram(panels[3], sphericity, "sphericity (%)", style.PURPLE, "%")
    for panel, letter in zip(panels, "abcd", strict=True):
        panel.set_title(letter, fontweight="bold")
    if sizes.attrs["reconstruction"]:
        figure.supxlabel(RECONSTRUCTED, fontsize=7, style="italic", color=style.RED)
    return figure


def _histogram(panel: Axes, values: np.ndarray, label: str, colour: str, unit: str) -> None:
    """Histogram of one size with the normal curve of its mean and standard deviation."""
    mean, sd = values.mean(), values.std(ddof=1)
    # Berries that are all alike still have a bin, and a curve too narrow to see.
    sd_shown = max(sd, 1e-3 * mean)
    ends = min(values.min(), mean - sd_shown), max(values.max(), mean + sd_shown)
    counts, edges, _ = panel.hist(
        values, bins=9, range=ends, color=colour, alpha=0.55, edgecolor="white", linewidth=0.6
    )
    x = np.linspace(mean - 3.2 * sd_shown, mean + 3.2 * sd_shown, 200)
    density = np.exp(-0.5 * ((x - mean) / sd_shown) ** 2) / (sd_shown * math.sqrt(2 * math.pi))
    panel.plot(x, len(values) * (edges[1] - edges[0]) * density, color=style.BLACK)
    panel.set(xlabel=label, ylabel="berries", ylim=(0, 1.35 * counts.max()))
    style.note(panel, f"{mean:.2f} ± {sd:.2f} {unit}\nn = {len(values)}", x=0.98, ha="right")


def particle_and_mesh(inputs: Mapping[str, Any], config: Mapping[str, Any]) -> Figure:
    """Figure 7 of the paper: the mesh and all particles made from it, side by side on the same scale."""
    chosen = build.Particle.load(inputs["particle"])
    mesh = build.load_mesh(inputs["stl"])
    section = config["berry"]
    figure = style.new_figure(style.PAGE, 2.75)
    panels = figure.subplots(1, 4, subplot_kw={"projection": "3d"})
    figure.get_layout_engine().set(w_pad=0.05, h_pad=0.05)
    half = 1.04 * np.ptp(mesh.vertices, axis=0) / 2
    _surface(panels[0], np.asarray(mesh.vertices), np.asarray(mesh.faces), half, edges=len(mesh.faces) < 8000)
    _caption(panels[0], "a  mesh", chosen.mesh, f"{len(mesh.faces)} triangles")
    for panel, kind, letter in zip(panels[1:], build.KINDS, "bcd", strict=True):
        try:
            particle = _made(mesh, kind, chosen, section)
        except InputError as error:
            panel.set_axis_off()
            _caption(panel, f"{letter}  {kind}", None, "\n".join(textwrap.wrap(str(error), 34)))
            continue
        vertices, triangles = _triangles(particle)
        _surface(panel, 1e3 * vertices, triangles, half, edges=False)
        off = f"off by {1e3 * particle.deviation_max_m:.2f} mm at most,\n{1e3 * particle.deviation_rms_m:.3f} mm rms"
        mark = " (poured)" if kind == chosen.kind else ""
        _caption(panel, f"{letter}  {kind}{mark}", particle, f"{_parts(particle)}\n{off}")
    return figure


def _made(mesh: trimesh.Trimesh, kind: str, chosen: Particle, section: Mapping[str, Any]) -> Particle:
    """The chosen particle, or one of another kind from the same mesh."""
    if kind == chosen.kind:
        return chosen
    return build.make_particle(mesh, chosen.density_kg_m3, kind, section["spheres"], section["surface"])


def _parts(particle: Particle) -> str:
    """The parts of a particle, in words."""
    if particle.is_clump:
        return f"{len(particle.spheres_m)} spheres"
    count = len(particle.semi_axes_m)
    return "one ellipsoid" if count == 1 else f"sum of {count} ellipsoids"


def _triangles(particle: Particle) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) in m and triangles of the surface of a particle; for spheres only the outer parts."""
    if not particle.is_clump:
        points, _, triangles = tessellate(particle, 36, 72)
        return points, triangles
    ball = trimesh.creation.icosphere(subdivisions=4)
    vertices, faces = [], []
    for k, sphere in enumerate(particle.spheres_m):
        points = sphere[:3] + sphere[3] * np.asarray(ball.vertices)
        others = np.delete(particle.spheres_m, k, axis=0)
        middle = points[ball.faces].mean(axis=1)
        seen = distances(others, middle) > -0.05 * sphere[3] if len(others) else np.ones(len(middle), bool)
        faces.append(ball.faces[seen] + k * len(points))
        vertices.append(points)
    return np.concatenate(vertices), np.concatenate(faces)


def _caption(panel: Axes, title: str, body: Particle | Body | None, words: str) -> None:
    """Name, volume, mass, moments and further words on a body."""
    panel.set_title(title, loc="center", pad=0, fontsize=8, fontweight="bold")
    if body is not None:
        moments = ", ".join(f"{1e9 * value:.1f}" for value in body.inertia_kg_m2)
        axes = " × ".join(f"{1e3 * value:.1f}" for value in body.axes_m)
        words = (
            f"{1e9 * body.volume_m3:.0f} mm³, {1e3 * body.mass_kg:.3f} g\n{moments} g mm²\n{axes} mm\n{words}"
        )
    panel.text2D(0.5, -0.02, words, transform=panel.transAxes, ha="center", va="top", fontsize=6.5)


def _surface(
    panel: Axes, vertices_mm: np.ndarray, triangles: np.ndarray, half: np.ndarray, edges: bool
) -> None:
    """Shaded triangles of a body."""
    corners = vertices_mm[triangles]
    normals = trimesh.triangles.normals(corners)[0]
    # Triangles at the poles of the grid have no area, and trimesh leaves their normals out.
    corners = corners[trimesh.triangles.area(corners) > 1e-12]
    light = np.clip(normals @ np.array([0.35, -0.55, 0.76]), 0, 1)
    base = np.array([0.80, 0.22, 0.12])
    colour = np.clip(base * (0.45 + 0.65 * light[:, None]) + 0.15 * light[:, None] ** 8, 0, 1)
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    line = {"edgecolor": (0.2, 0.05, 0.03, 0.35), "linewidth": 0.15} if edges else {"edgecolor": colour}
    panel.add_collection3d(Poly3DCollection(corners, facecolor=colour, linewidths=0.15, **line))
    panel.set_proj_type("ortho")
    panel.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), zlim=(-half[2], half[2]))
    panel.set_box_aspect(tuple(half), zoom=1.2)
    panel.view_init(elev=22, azim=-58)
    panel.set_axis_off()

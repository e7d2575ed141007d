"""Figures 2 and 7: the berries' sizes, and the particle made from the mesh."""

import math

import numpy as np
import trimesh

from repose import berry, shape
from repose.dem.tessellation import tessellate

from . import style

AXES = (
    ("long_mm", "long axis", style.BLUE),
    ("major_mm", "major diameter", style.GREEN),
    ("minor_mm", "minor diameter", style.ORANGE),
)
RECONSTRUCTED = "Sizes are a reconstruction from published statistics, not measurements."


def sizes_and_sphericity(inputs, config):
    """Figure 2: histograms of the axes and the sphericity with the normal curves of their moments."""
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


def _histogram(panel, values, label, colour, unit):
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


def particle_and_mesh(inputs, config):
    """Figure 7: the mesh and the particle fitted to it, side by side on axes of the same scale."""
    mesh = shape.load_mesh(inputs["stl"])
    particle = shape.Particle.load(inputs["particle"])
    points, _, triangles = tessellate(particle, 36, 72)
    figure = style.new_figure(style.PAGE * 0.9, 3.1)
    panels = figure.subplots(1, 2, subplot_kw={"projection": "3d"})
    figure.get_layout_engine().set(w_pad=0.22, h_pad=0.12)
    half = 1.02 * max(np.abs(mesh.vertices).max(axis=0).max(), 1e3 * np.abs(points).max())
    _surface(panels[0], np.asarray(mesh.vertices), np.asarray(mesh.faces), half, edges=True)
    _surface(panels[1], 1e3 * points, triangles, half, edges=False)
    panels[0].set_title(f"a  mesh: {len(mesh.faces)} triangles, {mesh.volume:.0f} mm³", loc="center", pad=2)
    components = len(particle.semi_axes_m)
    kind = "ellipsoid" if components == 1 else f"sum of {components} ellipsoids"
    volume, mass = 1e9 * particle.volume_m3, 1e3 * particle.mass_kg
    panels[1].set_title(f"b  particle: {kind}, {volume:.0f} mm³, {mass:.2f} g", loc="center", pad=2)
    deviation = 1e3 * particle.deviation_max_m
    figure.supxlabel(f"largest deviation of the particle from the mesh: {deviation:.3f} mm", fontsize=7)
    return figure


def _surface(panel, vertices_mm, triangles, half, edges):
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
    panel.set(xlim=(-half, half), ylim=(-half, half), zlim=(-half, half), box_aspect=(1, 1, 1))
    panel.view_init(elev=22, azim=-58)
    panel.set(xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
    for axis in (panel.xaxis, panel.yaxis, panel.zaxis):
        axis.labelpad = -4
        axis.set_tick_params(pad=-2)
        axis.set_pane_color((0.97, 0.97, 0.97))

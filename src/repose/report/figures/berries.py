"""Figures 2 and 7: the grains' sizes, and the particle made from the mesh."""

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from repose.common.errors import InputError
from repose.grain import berry
from repose.grain.particle import KINDS, Body, Particle

from . import style
from .registry import Inputs, Shown, figure

PICTURE_PIXELS = 400  # width of a body's picture at the default resolution

AXES = (
    ("long_mm", "long axis", style.BLUE),
    ("major_mm", "major diameter", style.GREEN),
    ("minor_mm", "minor diameter", style.ORANGE),
)
RECONSTRUCTED = (
    "Sizes are a reconstruction from published statistics, not measurements."
)


@figure("figure02", "Figure 2", {"sizes": "{config[berry][sizes]}"})
def sizes_and_sphericity(inputs: Inputs, study: Shown) -> Figure:
    """Draw histograms of the axes and of the sphericity (Eq. 1 and Table 1 of the paper), with normal curves.

    Figure 2. Sizes of the grains, with the normal curves of their means and standard deviations. Where the table
    of sizes says so in its first line, it is a reconstruction from published statistics and was not measured.
    """
    sizes = berry.read_sizes(inputs["sizes"])
    figure, panels = style.grid(4, 2.1, columns=4, sharey=True)
    for panel, (column, label, colour) in zip(panels, AXES, strict=False):
        _histogram(panel, sizes[column].to_numpy(), f"{label} (mm)", colour, "mm")
    sphericity = 100 * berry.sphericity(
        *(sizes[column].to_numpy() for column, _, _ in AXES)
    )
    _histogram(panels[3], sphericity, "sphericity (%)", style.PURPLE, "%")
    style.name_panels(panels)
    panels[0].set_ylabel("number of grains")
    panels[0].yaxis.set_major_locator(MaxNLocator(integer=True))
    style.below(
        figure, "curves: normal distributions of these means and standard deviations"
    )
    if sizes.attrs["reconstruction"]:
        figure.suptitle(RECONSTRUCTED, fontsize=7, style="italic", color=style.RED)
    return figure


def _histogram(
    panel: Axes, values: np.ndarray, label: str, colour: str, unit: str
) -> None:
    """Draw the histogram of one size with the normal curve of its mean and standard deviation."""
    from scipy import stats  # slow to import

    mean, sd = values.mean(), values.std(ddof=1)
    # Equal grains have one bin, and a curve too narrow to see.
    sd_shown = max(sd, 1e-3 * mean)
    ends = min(values.min(), mean - sd_shown), max(values.max(), mean + sd_shown)
    look = {"color": colour, "alpha": 0.55, "edgecolor": "white", "linewidth": 0.6}
    counts, edges, _ = panel.hist(values, bins=9, range=ends, **look)
    x = np.linspace(mean - 3.2 * sd_shown, mean + 3.2 * sd_shown, 200)
    panel.plot(
        x,
        len(values) * (edges[1] - edges[0]) * stats.norm.pdf(x, mean, sd_shown),
        color=style.BLACK,
    )
    panel.set(xlabel=label, ylim=(0, max(panel.get_ylim()[1], 1.35 * counts.max())))
    style.note(
        panel, f"{mean:.2f} ± {sd:.2f} {unit}\nn = {len(values)}", x=0.98, ha="right"
    )


MESH = {"stl": "berry/berry.stl", "particle": "berry/particle.json"}


@figure("figure07", "Figure 7", MESH, reads=("berry", "colour"))
def particle_and_mesh(inputs: Inputs, study: Shown) -> Figure:
    """Draw the mesh and all particles made from it, side by side on the same scale.

    Figure 7. The grain: its mesh, and the particle that the simulator makes of the mesh.
    """
    # slow to import, and the other figures do without
    from repose.grain import build
    from repose.grain.mesh import load_mesh
    from repose.report.renderer.render import render_bodies, render_mesh
    from repose.report.renderer.scenery import Setting, look_at

    chosen = Particle.load(inputs["particle"])
    mesh = load_mesh(inputs["stl"])
    in_m = mesh.copy().apply_scale(1e-3)
    width = style.pixels(study, PICTURE_PIXELS)
    camera: dict[str, Any] = {
        "width": width,
        "height": round(0.78 * width),
        "field_of_view_deg": style.TELEPHOTO_DEG,
    }
    camera |= {"elevation_deg": 22.0, "azimuth_deg": -58.0}
    frame_m = 1.05 * np.asarray(in_m.vertices)
    view = camera | {"frame_m": frame_m, "supersample": 3, "colour": study.colour}
    figure = style.new_figure(style.PAGE, 2.35)
    figure.set_layout_engine("compressed")
    panels = figure.subplots(1, 4)
    _caption(panels[0], "a  mesh", chosen.mesh, f"{len(mesh.faces)} triangles")
    panels[0].imshow(render_mesh(in_m, **view))
    style.scale_bar(
        panels[0], look_at(frame_m, **camera), np.zeros(3), max(in_m.extents)
    )
    how = study.berry.spheres, study.berry.surface
    for panel, kind, letter in zip(panels[1:], KINDS, "bcd", strict=True):
        poured = kind == chosen.kind
        try:
            particle = (
                chosen
                if poured
                else build.make_particle(mesh, chosen.density_kg_m3, kind, *how)
            )
        except InputError as error:
            _caption(
                panel,
                f"{letter}  {kind}",
                None,
                "\n".join(textwrap.wrap(str(error), 34)),
            )
            continue
        alone = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]), [particle]
        panel.imshow(render_bodies(*alone, setting=Setting(None), **view))
        off = f"off by {1e3 * particle.deviation_max_m:.2f} mm at most,\n{1e3 * particle.deviation_rms_m:.3f} mm rms"
        _caption(
            panel,
            f"{letter}  {kind}{' (poured)' * poured}",
            particle,
            f"{_parts(particle)}\n{off}",
        )
    return figure


def _parts(particle: Particle) -> str:
    """Say the parts of a particle, in words."""
    if particle.is_clump:
        return f"{len(particle.spheres_m)} spheres"
    count = len(particle.semi_axes_m)
    return "one ellipsoid" if count == 1 else f"sum of {count} ellipsoids"


def _caption(panel: Axes, title: str, body: Particle | Body | None, words: str) -> None:
    """Draw the name, volume, mass, moments and further words on a body."""
    panel.axis("off")
    panel.set_title(title, loc="center", fontweight="bold")
    if body is not None:
        moments = ", ".join(f"{1e9 * value:.1f}" for value in body.inertia_kg_m2)
        axes = " × ".join(f"{1e3 * value:.1f}" for value in body.axes_m)
        size = f"volume {1e9 * body.volume_m3:.0f} mm³, mass {1e3 * body.mass_kg:.3f} g"
        words = f"{axes} mm\n{size}\nmoments {moments} g mm²\n{words}"
    style.note(panel, words, x=0.5, y=-0.04, ha="center", fontsize=6.5)

"""Draw Figures 2 and 7: the grains' sizes, and the particle made from the mesh."""

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from repose.common.errors import InputError
from repose.grain import berry
from repose.grain.particle import KINDS, Body, Particle

from . import panels, style
from .registry import Inputs, StudyView

# Minimum standard deviation of the drawn curve, as a fraction of the mean
MIN_RELATIVE_SD = 1e-3
# Half the width of a drawn normal curve, in standard deviations.
CURVE_HALF_WIDTH_SDS = 3.2
PICTURE_PIXELS = 400  # width of the picture of a grain at the default resolution
# Upper edge of the text below a picture, as a fraction of the panel's height, and the
# size of this text
DESCRIPTION_Y = -0.04
DESCRIPTION_FONT_SIZE = 6.5
N_BINS = 9  # of a histogram
HISTOGRAM_HEIGHT = 2.1  # inches, of a panel with its labels
# Height of a histogram's panel, as a multiple of the highest bar. It leaves room for
# the numbers above the bars.
PANEL_HEIGHT_FACTOR = 1.35

# Column of the table of sizes, label and colour of each axis of a grain.
GRAIN_AXES = (
    ("long_mm", "long axis", style.BLUE),
    ("major_mm", "major diameter", style.GREEN),
    ("minor_mm", "minor diameter", style.ORANGE),
)
RECONSTRUCTION_NOTE = (
    "Sizes are a reconstruction from published statistics, not measurements."
)


def draw_sizes_and_sphericity(inputs: Inputs, study: StudyView) -> Figure:
    """Draw histograms of the axes and of the sphericity of the grains.

    The sphericity is computed from the axes (Eq. 1 and Table 1 of the paper).

    Parameters
    ----------
    inputs : mapping
        Path of the table of sizes, as `sizes`, which contains the axes of each grain.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    sizes = berry.read_sizes(inputs["sizes"])
    # Draw a panel for each axis of the grains, and one for the sphericity.
    n_panels = len(GRAIN_AXES) + 1
    figure, histogram_panels = panels.grid(
        n_panels, HISTOGRAM_HEIGHT, columns=n_panels, sharey=True
    )
    *axis_panels, sphericity_panel = histogram_panels
    axis_lengths = [sizes[column].to_numpy() for column, _, _ in GRAIN_AXES]
    for panel, lengths, (_, label, colour) in zip(
        axis_panels, axis_lengths, GRAIN_AXES, strict=True
    ):
        _draw_histogram(panel, lengths, label=f"{label} (mm)", colour=colour, unit="mm")
    sphericity_percent = 100 * berry.sphericity(*axis_lengths)
    _draw_histogram(
        sphericity_panel,
        sphericity_percent,
        label="sphericity (%)",
        colour=style.PURPLE,
        unit="%",
    )
    style.label_panels(histogram_panels)
    first_panel = histogram_panels[0]
    first_panel.set_ylabel("number of grains")
    first_panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    style.write_below(
        figure,
        "curves: normal distributions with the mean and deviation in each panel",
    )
    # `read_sizes` sets this flag if a comment in the file says so.
    if sizes.attrs["reconstruction"]:
        figure.suptitle(
            RECONSTRUCTION_NOTE, fontsize=7, style="italic", color=style.RED
        )
    return figure


def _draw_histogram(
    panel: Axes, values: np.ndarray, label: str, colour: str, unit: str
) -> None:
    """Draw the histogram of a size with a normal curve of the same mean and deviation.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    values : ndarray
        The size of each grain (N,).
    label : str
        Label of the axis.
    colour : str
        Colour of the bars.
    unit : str
        Unit of the size, for the numbers in the panel.
    """
    from scipy import stats  # slow to import

    mean = values.mean()
    sd = values.std(ddof=1)
    # If all grains are equal, widen the axis and the curve so that they can be seen.
    shown_sd = max(sd, MIN_RELATIVE_SD * mean)
    low = min(values.min(), mean - shown_sd)
    high = max(values.max(), mean + shown_sd)
    counts, edges, _ = panel.hist(
        values,
        bins=N_BINS,
        range=(low, high),
        color=colour,
        alpha=0.55,
        edgecolor="white",
        linewidth=0.6,
    )
    # Scale the normal density to the expected number of grains in a bin.
    x = np.linspace(
        mean - CURVE_HALF_WIDTH_SDS * shown_sd,
        mean + CURVE_HALF_WIDTH_SDS * shown_sd,
        200,
    )
    bin_width = edges[1] - edges[0]
    expected_count = len(values) * bin_width * stats.norm.pdf(x, mean, shown_sd)
    panel.plot(x, expected_count, color=style.BLACK)
    # The panels share their y axis and are drawn one after another. So a panel must not
    # lower the top that an earlier panel has set.
    top = max(panel.get_ylim()[1], PANEL_HEIGHT_FACTOR * counts.max())
    panel.set(xlabel=label, ylim=(0, top))
    text = f"{mean:.2f} ± {sd:.2f} {unit}\nn = {len(values)}"
    style.write_note(panel, text, x=0.98, ha="right")


def draw_particle_and_mesh(inputs: Inputs, study: StudyView) -> Figure:
    """Draw the mesh and each kind of particle made from it, to the same scale.

    If a kind of particle cannot be made, the reason takes the place of its picture.

    Parameters
    ----------
    inputs : mapping
        Paths of the simulated particle, as `particle`, and of its mesh, as `stl`.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    # These imports are slow, and the other figures do not need them.
    from repose.grain.mesh import load_mesh
    from repose.report.renderer.render import render_bodies, render_mesh
    from repose.report.renderer.scenery import Scenery, look_at

    simulated = Particle.load(inputs["particle"])
    mesh = load_mesh(inputs["stl"])
    mesh_in_m = mesh.copy().apply_scale(1e-3)

    # All pictures are taken with the same camera, so they have the same scale.
    width = style.scale_picture_pixels(study, PICTURE_PIXELS)
    camera: dict[str, Any] = {
        "width": width,
        "height": round(0.78 * width),
        "field_of_view_deg": style.TELEPHOTO_DEG,
        "elevation_deg": 22.0,
        "azimuth_deg": -58.0,
    }
    frame_m = 1.05 * np.asarray(mesh_in_m.vertices)
    view = camera | {
        "frame_m": frame_m,
        "supersample": 3,
        "colour": study.settings.colour,
    }

    figure = style.new_figure(style.PAGE, 2.35)
    figure.set_layout_engine("compressed")
    mesh_panel, *particle_panels = figure.subplots(1, 4)
    mesh_text = f"{len(mesh.faces)} triangles"
    # The file of a particle may lack the properties of its mesh.
    if simulated.mesh is not None:
        mesh_text = _describe_body(simulated.mesh, mesh_text)
    _write_description(mesh_panel, "a  mesh", mesh_text)
    mesh_panel.imshow(render_mesh(mesh_in_m, **view))
    style.draw_scale_bar(
        mesh_panel,
        look_at(frame_m, **camera),
        point_m=np.zeros(3),
        extent_m=max(mesh_in_m.extents),
    )
    for panel, kind, letter in zip(particle_panels, KINDS, "bcd", strict=True):
        title = f"{letter}  {kind}"
        try:
            particle = _make_particle_of_kind(
                kind, mesh, simulated=simulated, study=study
            )
        except InputError as error:
            # Not every kind of particle can be made from every mesh.
            reason = "\n".join(textwrap.wrap(str(error), 34))
            _write_description(panel, title, reason)
            continue
        if kind == simulated.kind:
            title += " (poured)"
        text = _describe_body(particle, _describe_composition(particle))
        _write_description(panel, title, text)
        picture = render_bodies(
            np.zeros((1, 3)),
            np.array([[1.0, 0.0, 0.0, 0.0]]),
            [particle],
            scenery=Scenery(None),
            **view,
        )
        panel.imshow(picture)
    return figure


def _describe_composition(particle: Particle) -> str:
    """Describe what a particle consists of, and its distance from the mesh."""
    return (
        f"{_describe_parts(particle)}\n"
        f"off by {1e3 * particle.deviation_max_m:.2f} mm at most,\n"
        f"{1e3 * particle.deviation_rms_m:.3f} mm rms"
    )


def _make_particle_of_kind(
    kind: str, mesh: Any, simulated: Particle, study: StudyView
) -> Particle:
    """Make the particle of a kind from the mesh, with the settings of the study.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    mesh : Trimesh
        The mesh in mm.
    simulated : Particle
        The simulated particle, which is returned if it is of this kind.
    study : StudyView
        The study.

    Returns
    -------
    Particle
        The particle.

    Raises
    ------
    InputError
        If a particle of this kind cannot be made from the mesh.
    """
    from repose.grain import build  # slow to import

    if kind == simulated.kind:
        return simulated
    settings = study.settings.berry
    return build.make_particle(
        mesh,
        simulated.density_kg_m3,
        kind=kind,
        spheres=settings.spheres,
        surface=settings.surface,
    )


def _describe_parts(particle: Particle) -> str:
    """Describe the parts that a particle consists of."""
    if particle.is_clump:
        return f"{len(particle.spheres_m)} spheres"
    count = len(particle.semi_axes_m)
    return "one ellipsoid" if count == 1 else f"sum of {count} ellipsoids"


def _describe_body(body: Particle | Body, further_lines: str) -> str:
    """Describe the axes, volume, mass and moments of inertia of a body in three lines.

    `further_lines` are written below them.
    """
    axes = " × ".join(f"{1e3 * value:.1f}" for value in body.axes_m)
    volume = f"{1e9 * body.volume_m3:.0f}"
    mass = f"{1e3 * body.mass_kg:.3f}"
    moments = ", ".join(f"{1e9 * value:.1f}" for value in body.inertia_kg_m2)
    return (
        f"{axes} mm\n"
        f"volume {volume} mm³, mass {mass} g\n"
        f"moments {moments} g mm²\n"
        f"{further_lines}"
    )


def _write_description(panel: Axes, title: str, text: str) -> None:
    """Write a title above the picture in a panel, and a text below the picture.

    The axes of the panel are hidden.
    """
    panel.axis("off")
    panel.set_title(title, loc="center", fontweight="bold")
    style.write_note(
        panel,
        text,
        x=0.5,
        y=DESCRIPTION_Y,
        ha="center",
        fontsize=DESCRIPTION_FONT_SIZE,
    )

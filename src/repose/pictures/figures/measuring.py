"""The definitions of the angle of repose, drawn on the same pile."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.measure import pile
from repose.measure.angles import DEFINITIONS
from repose.measure.saved_piles import side_view
from repose.measure.saved_pours import first_pour
from repose.particle.berry_files import read_berry
from repose.particle.particle import Particle

from . import style

COLOURS = dict(
    zip(DEFINITIONS, (style.BLUE, style.RED, style.GREEN, style.PURPLE, style.ORANGE), strict=True)
)
STYLES = dict(zip(DEFINITIONS, ("-", "-", "-", (0, (4, 2)), (0, (2, 1))), strict=True))
WORDS = {
    "flank": "line fitted from {fit_from} to {fit_to}",
    "secant": "from the foot, one grain high, to the crest",
    "steepest": "the steepest half of the flank",
    "whole": "line fitted from foot to crest",
    "straightest": "line fitted to the straightest window",
}


def definitions(inputs: Mapping[str, str], config: Mapping[str, Any]) -> Figure:
    """Five definitions on the first view of a pile (above), and their values in every view (below)."""
    berry = read_berry(inputs["berry"])
    settings = pile.MeasureSettings.of(config["measure"], berry)
    poured, particle = first_pour(inputs["heap"]), Particle.load(inputs["particle"])
    figure = style.new_figure(style.PAGE, 3.7)
    above, below = figure.subplots(2, 1, height_ratios=(1.9, 1))
    measured = _view(above, side_view(poured, particle, settings), settings)
    everywhere = pile.measure_pile(
        poured["position"],
        poured["quaternion"],
        particle,
        settings,
        members=poured["in_pile"],
        scales=poured.get("scale"),
    )
    _views(below, everywhere, measured)
    return figure


def _view(panel: Axes, image: np.ndarray, settings: pile.MeasureSettings) -> pile.Measurement:
    """The silhouette in mm about its crest with both lines of each definition; returns its measurement."""
    scale = settings.mm_per_pixel
    measured = pile.measure_segmented(
        pile.segment(image, settings.largest_pile_only, image.shape[0] - 0.5), settings
    )
    height, width = image.shape
    crest = measured.top[0]
    panel.imshow(
        np.where(image < 128, 205, 255).astype(np.uint8),
        cmap="gray",
        vmin=0,
        vmax=255,
        extent=((-0.5 - crest) * scale, (width - 0.5 - crest) * scale, 0, height * scale),
    )
    levels, ends = {"one grain": settings.berry_height_mm}, {}
    for key in ("fit_from", "fit_to"):
        end = getattr(settings, key)
        ends[key] = "one grain" if end == "berry" else f"{100 * end:.0f} % of the height"
        if end != "berry":
            levels[ends[key]] = end * measured.height_mm
    for name, angle in measured.angles.items():
        for line in angle.lines:
            u, row = np.array(line).T
            panel.plot(
                (u - crest) * scale,
                (measured.base_row - row) * scale,
                color=COLOURS[name],
                ls=STYLES[name],
                lw=1.5,
            )
        label = f"{name} {angle.aor_deg:.1f}°: {WORDS[name].format_map(ends)}"
        panel.plot([], [], color=COLOURS[name], ls=STYLES[name], label=label)
    left, right = panel.get_xlim()
    for name, z in levels.items():
        panel.axhline(z, color=style.GREY, lw=0.6, ls=":", zorder=0.5)
        panel.text(right, z, f" {name}", va="center", fontsize=6.8)
    panel.set(xlim=(left, right), ylim=(0, 1.08 * measured.height_mm), aspect="equal")
    panel.set(xlabel="distance from the crest (mm)", ylabel="height (mm)")
    panel.figure.legend(*panel.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    panel.set_title("a  one view")
    return measured


def _views(panel: Axes, everywhere: pile.PileResult, measured: pile.Measurement) -> None:
    """Each definition in every view, its mean, and a ring around the first view."""
    for k, name in enumerate(DEFINITIONS):
        values = everywhere.aor[name]
        panel.plot(values, np.full(values.size, -k), "o", ms=3.5, color=COLOURS[name], alpha=0.55, mew=0)
        if (mean := everywhere.mean_deg(name)) is not None:
            panel.plot([mean, mean], [-k - 0.32, -k + 0.32], color=COLOURS[name], lw=1.6)
            panel.text(mean, -k + 0.36, f"{mean:.1f}°", ha="center", va="bottom", fontsize=6.5)
        if name in measured.angles:
            panel.plot(measured.angles[name].aor_deg, -k, "o", ms=7, mfc="none", mec=style.BLACK, mew=0.7)
    panel.set_yticks([-k for k in range(len(DEFINITIONS))], DEFINITIONS)
    panel.set_ylim(0.9 - len(DEFINITIONS) - 0.4, 0.9)
    panel.set_xlabel("angle of repose (deg)")
    panel.set_title(f"b  all {everywhere.view_height_mm.size} views, their mean (bar), and view a (ring)")

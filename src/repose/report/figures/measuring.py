"""The definitions of the angle of repose, drawn on the same pile."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.grain.berry_files import read_berry
from repose.grain.particle import Particle
from repose.measure import pile
from repose.measure.angles import DEFINITIONS
from repose.measure.photographs.segmentation import segment
from repose.measure.saved_piles import side_view
from repose.measure.saved_pours import first_pour
from repose.measure.silhouette import Grains

from . import style
from .registry import MEASURED_PILE, Inputs, Shown, figure, has_pile

COLOURS = dict(
    zip(
        DEFINITIONS,
        (style.BLUE, style.RED, style.GREEN, style.PURPLE, style.ORANGE),
        strict=True,
    )
)
STYLES = dict(zip(DEFINITIONS, ("-", "-", "-", (0, (4, 2)), (0, (2, 1))), strict=True))


@figure(
    "definitions",
    "Definitions of the angle",
    MEASURED_PILE,
    reads=("measure",),
    when=has_pile,
)
def definitions(inputs: Inputs, study: Shown) -> Figure:
    """Draw every definition on the first view of a pile (above), and their values in every view (below).

    The definitions of the angle of repose on the pile of the representative solution: their lines in one side view,
    and the angle that each gives in all views. The study calibrates the definition {measure[response]}; ``repose
    docs measurement`` compares them.
    """
    settings = pile.MeasureSettings.of(vars(study.measure), read_berry(inputs["berry"]))
    poured, particle = first_pour(inputs["heap"]), Particle.load(inputs["particle"])
    figure = style.new_figure(style.PAGE, 4.4)
    above, below = figure.subplots(2, 1, height_ratios=(1.5, 1))
    measured = _view(above, side_view(poured, particle, settings), settings)
    _views(
        below,
        pile.measure_pile(Grains.of(poured, particle), settings, poured["in_pile"]),
        measured,
    )
    return figure


def _view(
    panel: Axes, image: np.ndarray, settings: pile.MeasureSettings
) -> pile.Measurement:
    """Draw the silhouette in mm about its crest with both lines of each definition, and give its measurement."""
    scale = settings.mm_per_pixel
    measured = pile.measure_segmented(
        segment(image, settings.largest_pile_only, image.shape[0] - 0.5), settings
    )
    height, width = image.shape
    crest = measured.top[0]
    extent = ((-0.5 - crest) * scale, (width - 0.5 - crest) * scale, 0, height * scale)
    panel.imshow(
        np.where(image < 128, 205, 255).astype(np.uint8),
        cmap="gray",
        vmin=0,
        vmax=255,
        extent=extent,
    )
    levels = [(settings.berry_height_mm or 0.0, "one grain")]
    ends = [
        end for end in (settings.fit_from, settings.fit_to) if not isinstance(end, str)
    ]
    levels += [
        (end * measured.height_mm, f"{100 * end:.0f} % of the height") for end in ends
    ]
    for name, angle in measured.angles.items():
        used = name == settings.response
        look = {"color": COLOURS[name], "ls": STYLES[name], "lw": 3.0 if used else 1.5}
        for line in angle.lines:
            u, row = np.array(line).T
            panel.plot((u - crest) * scale, (measured.base_row - row) * scale, **look)
        words = style.line_in_words(vars(settings), name) + ", used" * used
        panel.plot([], [], label=f"{angle.aor_deg:.1f}°  {name}: {words}", **look)
    left, right = panel.get_xlim()
    lowest = 0.0
    for z, name in sorted(levels):
        panel.axhline(z, color=style.GREY, lw=0.6, ls=":", zorder=0.5)
        lowest = max(
            z, lowest + 0.11 * measured.height_mm
        )  # words of near levels stand one above the other
        panel.text(right, lowest, f" {name}", va="center", fontsize=6.8)
    panel.set(
        xlim=(left, right),
        ylim=(0, 1.08 * measured.height_mm),
        aspect="equal",
        title="a  one view",
    )
    panel.set(xlabel="distance from the crest (mm)", ylabel="height (mm)")
    panel.figure.legend(*panel.get_legend_handles_labels(), loc="outside lower left")
    return measured


def _views(
    panel: Axes, everywhere: pile.PileResult, measured: pile.Measurement
) -> None:
    """Draw each definition in every view, its mean, and a ring around the first view."""
    for k, name in enumerate(DEFINITIONS):
        values = everywhere.aor[name]
        panel.plot(
            values,
            np.full(values.size, -k),
            "o",
            ms=3.5,
            color=COLOURS[name],
            alpha=0.55,
            mew=0,
        )
        if (mean := everywhere.mean_deg(name)) is not None:
            panel.plot(
                [mean, mean], [-k - 0.32, -k + 0.32], color=COLOURS[name], lw=1.6
            )
            panel.text(
                1.0,
                -k,
                f"mean {mean:.1f}°",
                transform=panel.get_yaxis_transform(),
                va="center",
            )
        if name in measured.angles:
            panel.plot(
                measured.angles[name].aor_deg,
                -k,
                "o",
                ms=7,
                mfc="none",
                mec=style.BLACK,
                mew=0.7,
            )
    panel.set_yticks([-k for k in range(len(DEFINITIONS))], DEFINITIONS)
    panel.set(ylim=(0.9 - len(DEFINITIONS) - 0.4, 0.9), xlabel="angle of repose (deg)")
    panel.set_title(
        f"b  all {everywhere.view_height_mm.size} views, their mean (bar), and view a (ring)"
    )

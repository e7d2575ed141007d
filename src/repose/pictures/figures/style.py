"""One look for all figures: column widths, fonts, colours safe for colour-blind readers, saving."""

from pathlib import Path

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

MM = 1 / 25.4
COLUMN = 90 * MM
PAGE = 180 * MM
DPI = 180

# Okabe and Ito's palette.
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SKY, PURPLE, GREY, BLACK = "#56B4E9", "#CC79A7", "#8A8F94", "#222222"
BERRY = "#C8321E"

SMALL_RUN = "small run: NOT for use as a result"
AOR, HEIGHT = "angle of repose (deg)", "Height (mm)"
RESPONSES = (("aor_deg", "AoR", "deg"), ("height_mm", "Height", "mm"))

SETTINGS = {
    "font.size": 7.5,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": BLACK,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 6.8,
    "legend.frameon": False,
    "lines.linewidth": 1.1,
    "mathtext.fontset": "dejavusans",
    "grid.color": "#D5D8DB",
    "grid.linewidth": 0.4,
    "savefig.dpi": DPI,
}


def applied():
    """Context in which figures are made: this style alone, whatever the user's own settings."""
    return matplotlib.rc_context({**matplotlib.rcParamsDefault, "backend": "agg", **SETTINGS})


def new_figure(width, height):
    """An empty figure, sizes in inches, laid out so that nothing is cut off."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure, out_path, small_run):
    """Write a PNG without anything that changes from run to run; a small run is marked across the top."""
    Path(out_path).parent.mkdir(parents=True, exist_ok=True)
    if small_run:
        width, height = figure.get_size_inches()
        band = 0.24
        figure.set_size_inches(width, height + band)
        figure.get_layout_engine().set(rect=(0, 0, 1, height / (height + band)))
        figure.text(
            0.5,
            1 - 0.5 * band / (height + band),
            SMALL_RUN,
            ha="center",
            va="center",
            color="white",
            fontweight="bold",
            fontsize=8,
            bbox={"facecolor": RED, "edgecolor": "none", "boxstyle": "square,pad=0.3"},
        )
    figure.savefig(out_path, format="png", dpi=DPI, metadata={"Software": None})


def note(axes, text, x=0.03, y=0.97, **options):
    """Small text inside the axes, by default in the upper left corner."""
    style = {"va": "top", "ha": "left", "fontsize": 6.8, "linespacing": 1.35} | options
    return axes.text(x, y, text, transform=axes.transAxes, **style)

"""Give all figures a common style: sizes, fonts, colours and labels; save figures.

The colours can also be told apart by colour-blind readers.
"""

import io
import math
import textwrap
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

import repose.bench  # noqa: F401  (makes the responses of all bench tests known)
from repose.bench.parameters import LAW_PARAMETERS, PAIRS, SYMBOLS
from repose.calibrate.responses import Response
from repose.calibrate.targets import Target, Targets
from repose.common.errors import InputError
from repose.common.files import StrPath, write_bytes
from repose.common.numbers import format_significant
from repose.measure.settings import MeasureSettings, describe_height_band

if TYPE_CHECKING:
    from repose.report.renderer.scenery import Camera

from .registry import Config, StudyView

# Widths of a journal's column and page, in inches.
INCHES_PER_MM = 1 / 25.4
COLUMN = 85 * INCHES_PER_MM
PAGE = 175 * INCHES_PER_MM
DPI = 180
TELEPHOTO_DEG = 0.8  # field of view of a picture without perspective

# Okabe and Ito's palette.
BLUE = "#0072B2"
ORANGE = "#E69F00"
GREEN = "#009E73"
RED = "#D55E00"
SKY = "#56B4E9"
PURPLE = "#CC79A7"
GREY = "#8A8F94"
BLACK = "#222222"
SERIES = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY)
LINES = ("-", "--", "-.", ":")
STRIP_COLOUR = "#EEF0F2"  # of the range of a parameter
ANSWER_STYLE = {"ms": 5.0, "color": RED, "mec": "white", "mew": 0.6, "zorder": 4}

SMALL_TEXT_PT = 6.8
LETTERS_PER_INCH = 20  # of small text
ALPHABET = "abcdefghijklmnopqrstuvwxyz"

SUBSCRIPTS_NOTE = ", ".join(f"{pair}: {words}" for pair, words in PAIRS.items())
SMALL_RUN_WARNING = "small run: NOT for use as a result"
SMALL_RUN_BAND_INCHES = 0.24

# Metadata by format, without the entries that would change a file from run to run.
FIXED_METADATA = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}


# --- Figures and their files ----------------------------------------------------------


def applied() -> AbstractContextManager[None]:
    """Return a context in which figures have this style, not that of the user."""
    settings = matplotlib.rc_params_from_file(
        Path(__file__).with_name("figures.mplstyle"), use_default_template=False
    )
    return matplotlib.rc_context(
        {**matplotlib.rcParamsDefault, "backend": "agg", **settings}
    )


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure of a given size in inches, which needs no window.

    Its layout makes sure that nothing is cut off.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(
    figure: Figure,
    out_path: StrPath,
    small_run: bool,
    other_formats: Sequence[str] = (),
    dpi: int = DPI,
) -> None:
    """Write a figure in the format of its path and in others, with reproducible bytes.

    Parameters
    ----------
    figure : Figure
        The figure.
    out_path : path
        File that ends in .png, .pdf or .svg.
    small_run : bool
        Whether the run is only a trial. If so, a band across the top says this.
    other_formats : sequence of str
        Endings of further files, without the dot.
    dpi : int
        Resolution of a PNG.
    """
    if small_run:
        _mark_small_run(figure)
    out_path = Path(out_path)
    for kind in (out_path.suffix.removeprefix("."), *other_formats):
        content = encode(figure, kind, dpi).getvalue()
        write_bytes(out_path.with_suffix(f".{kind}"), content)


def _mark_small_run(figure: Figure) -> None:
    """Add a band across the top which says not to use the numbers as a result."""
    width, height = figure.get_size_inches()
    full_height = height + SMALL_RUN_BAND_INCHES
    figure.set_size_inches(width, full_height)
    figure.get_layout_engine().set(rect=(0, 0, 1, height / full_height))
    box = {"facecolor": RED, "edgecolor": "none", "boxstyle": "square,pad=0.3"}
    figure.text(
        0.5,
        1 - 0.5 * SMALL_RUN_BAND_INCHES / full_height,
        SMALL_RUN_WARNING,
        bbox=box,
        ha="center",
        va="center",
        color="white",
        fontweight="bold",
        fontsize=8,
    )


def encode(figure: Figure, kind: str = "png", dpi: int = DPI) -> io.BytesIO:
    """Encode a figure as the contents of a file, with reproducible bytes.

    Parameters
    ----------
    figure : Figure
        The figure.
    kind : str
        Format, one of `FIXED_METADATA`.
    dpi : int
        Resolution of a PNG.

    Returns
    -------
    BytesIO
        The contents of the file.
    """
    content = io.BytesIO()
    figure.savefig(content, format=kind, dpi=dpi, metadata=FIXED_METADATA[kind])
    return content


def check_ending(path: StrPath) -> None:
    """Raise InputError unless the file name ends in a format of `FIXED_METADATA`."""
    endings = [f".{kind}" for kind in FIXED_METADATA]
    suffix = Path(path).suffix
    if suffix not in endings:
        raise InputError(path, key="ending", value=suffix, allowed=" or ".join(endings))


def scale_picture_pixels(study: StudyView, default_pixels: int) -> int:
    """Scale the size of a shaded picture to the resolution of the configuration.

    Parameters
    ----------
    study : StudyView
        The study, with the section `figures` if it has one.
    default_pixels : int
        The size in pixels at the default resolution.

    Returns
    -------
    int
        The size in pixels at the resolution of the configuration.
    """
    dpi = study.config.get("figures", {}).get("dpi", DPI)
    return round(default_pixels * dpi / DPI)


# --- Words ----------------------------------------------------------------------------


def read_targets(config: Config) -> Targets:
    """Return the targets in the order of the configuration."""
    return StudyView(config).targets


def response_label(response: Response, before: str = "") -> str:
    """Write the label of an axis, such as ``predicted AoR (deg)``.

    A dash stands for a missing unit. The word `before` precedes the symbol.
    """
    return f"{before} {response.symbol} ({response.unit or '–'})".lstrip()


def parameter_label(name: str) -> str:
    """Write the axis label of a parameter: its symbol and unit, or else its name."""
    if name not in SYMBOLS:
        return name
    unit = LAW_PARAMETERS[name].constant.unit if name in LAW_PARAMETERS else ""
    return f"{SYMBOLS[name]} ({unit or '–'})"


def describe_line(settings: MeasureSettings, definition: str | None = None) -> str:
    """Describe the line through a pile's side that defines an angle, for a figure.

    Parameters
    ----------
    settings : MeasureSettings
        Settings of the lines.
    definition : str, optional
        Name of a definition of the angle, one of `repose.measure.angles.DEFINITIONS`.
        By default, it is that of the calibrated angle, `settings.response`.

    Returns
    -------
    str
        The description, such as "line from the foot to the crest".
    """
    definition = definition or settings.response
    if definition == "secant":
        return "line from the foot to the crest"
    if definition == "whole":
        return "line fitted to the whole side"
    if definition == "straightest":
        percent = 100 * settings.smallest_window
        return (
            "line fitted to the straightest part of the side, at least "
            f"{percent:.2g} % of it"
        )
    height_band = describe_height_band(settings)
    if definition == "steepest":
        return (
            "line fitted to the steepest part, at least half, of the side from "
            f"{height_band}"
        )
    # The remaining definition, "flank", uses all of the side between two heights.
    return f"line fitted to the side from {height_band}"


def explain_symbols(figure: Figure, config: Config) -> None:
    """Explain the calibrated angle and the subscripts below a figure.

    Only symbols that occur in the figure are explained. Call this once, as the last
    step: a second call would write the note again. If there is a legend below the
    figure, the note becomes part of its title. Otherwise it follows the text below the
    figure.

    Parameters
    ----------
    figure : Figure
        The figure, which must otherwise be complete.
    config : mapping
        The configuration of the study, or the sections that the figure reads.
    """
    shown_text = " ".join(text.get_text() for text in figure.findobj(Text))
    explanations = _explain_angles(config, shown_text)
    if any(symbol in shown_text for symbol in SYMBOLS.values()):
        explanations.append(SUBSCRIPTS_NOTE)
    if not explanations:
        return

    width = int(LETTERS_PER_INCH * figure.get_figwidth())
    note = "\n".join(textwrap.fill(sentence, width) for sentence in explanations)
    lowest_legend = _find_lowest_legend(figure)
    if lowest_legend is None:
        text_below = figure.get_supxlabel()
        figure.supxlabel(f"{text_below}\n{note}".lstrip(), fontsize=SMALL_TEXT_PT)
    else:
        # The legend occupies the lower edge, so make the note part of its title.
        title = lowest_legend.get_title().get_text()
        lowest_legend.set_title(f"{title}\n{note}".lstrip(), {"size": SMALL_TEXT_PT})


def _explain_angles(config: Config, shown_text: str) -> list[str]:
    """Describe how each calibrated angle is measured, if the figure shows its symbol.

    The angle of a pile is the slope of a line through its side, and there are several
    definitions of this line.

    Parameters
    ----------
    config : mapping
        The configuration. Without its sections `targets` and `measure`, there is
        nothing to explain.
    shown_text : str
        All texts of the figure. A symbol may occur anywhere in it.

    Returns
    -------
    list of str
        A sentence for each angle.
    """
    if not {"targets", "measure"} <= config.keys():
        return []
    study = StudyView(config)
    explanations = []
    for response in study.targets.responses:
        # The definition of a response lists the settings on which it depends. The key
        # `measure.response` chooses the line of the angle.
        is_calibrated_angle = "measure.response" in response.definition
        if is_calibrated_angle and response.symbol in shown_text:
            line = describe_line(study.settings.measure)
            explanations.append(
                f"{response.symbol}: {response.label} (simulated piles: {line})"
            )
    return explanations


def _find_lowest_legend(figure: Figure) -> Any:
    """Find the legend at the lower edge of a figure; None if there is none."""
    for legend in figure.legends:
        if getattr(legend, "_outside_loc", None) == "lower":
            return legend
    return None


def write_below(figure: Figure, note: str) -> None:
    """Write a note in small text below a figure, wrapped to the figure's width."""
    width = int(LETTERS_PER_INCH * figure.get_figwidth())
    figure.supxlabel(textwrap.fill(note, width), fontsize=SMALL_TEXT_PT)


def write_note(
    axes: Axes, text: str, x: float = 0.03, y: float = 0.97, **options: Any
) -> Text:
    """Write small text inside the axes, by default in the upper left corner.

    Parameters
    ----------
    axes : Axes
        The axes.
    text : str
        The text.
    x, y : float
        Position of its upper left corner, as fractions of the axes.
    **options
        Arguments of matplotlib's `text`, which may change the alignment.

    Returns
    -------
    Text
        The text, as an object of matplotlib.
    """
    text_style = {
        "va": "top",
        "ha": "left",
        "fontsize": SMALL_TEXT_PT,
        "linespacing": 1.35,
    }
    return axes.text(x, y, text, transform=axes.transAxes, **(text_style | options))


def panel_letter(k: int) -> str:
    """Name panel number `k`, counted from 0: ``a`` for 0, ``aa`` for 26."""
    return ALPHABET[k % 26] * (1 + k // 26)


def label_panels(panels: Sequence[Axes]) -> None:
    """Write the letter of each panel as its title; a single panel gets none."""
    if len(panels) > 1:
        for k, panel in enumerate(panels):
            panel.set_title(panel_letter(k), fontweight="bold")


def draw_legend(panels: Sequence[Axes], **options: Any) -> None:
    """Draw one legend for all panels of a figure, in which each label occurs once.

    `options` are arguments of matplotlib's `legend`.
    """
    handle_of_label: dict[str, Any] = {}
    for panel in panels:
        handles, labels = panel.get_legend_handles_labels()
        handle_of_label.update(zip(labels, handles, strict=True))
    panels[0].figure.legend(handle_of_label.values(), handle_of_label.keys(), **options)


# --- Marks ----------------------------------------------------------------------------


def series_style(k: int) -> dict[str, str]:
    """Choose the colour and line style of curve `k`, counted from 0, for `plot`."""
    return {
        "color": SERIES[k % len(SERIES)],
        "ls": LINES[k % len(LINES)],
    }


def draw_band(panel: Axes, low: float, high: float, label: str) -> None:
    """Draw a green band across a panel, such as a target range.

    Parameters
    ----------
    panel : Axes
        The panel.
    low, high : float
        Ends of the band on the y axis.
    label : str
        Label of the band in the legend.
    """
    panel.axhspan(low, high, color=GREEN, alpha=0.15, lw=0, label=label)


def draw_tolerance(panel: Axes, percent: float) -> None:
    """Draw the tolerance of a deviation, in percent, as a band around zero."""
    draw_band(panel, -percent, high=percent, label=f"near enough, ±{percent:g} %")
    panel.axhline(0, color=GREY, lw=0.7)


def prepare_deviations(
    panel: Axes, target: Target, percent: float, xlabel: str
) -> None:
    """Prepare a panel for deviations of a response from its target, in percent.

    Parameters
    ----------
    panel : Axes
        The panel, to which labels, a title and the band of the tolerance are added.
    target : Target
        The target.
    percent : float
        The tolerance in percent of the target.
    xlabel : str
        Label of the x axis.
    """
    draw_tolerance(panel, percent)
    panel.set(xlabel=xlabel, ylabel="off the target (% of it)")
    response = target.response
    panel.set_title(
        f"{response.symbol}, target {format_significant(target.aim)} {response.unit}"
    )


def round_length(longest: float) -> float:
    """Round a length down to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(longest))
    return power * max(digit for digit in (1, 2, 5) if digit * power <= longest)


def draw_scale_bar(
    panel: Axes,
    camera: "Camera",
    point_m: np.ndarray,
    extent_m: float,
    suffix: str = "",
) -> None:
    """Draw a scale bar in the lower right corner of a camera's picture.

    Its length is 1, 2 or 5 times a power of ten, and at most 30 % of `extent_m`.

    Parameters
    ----------
    panel : Axes
        The panel of the picture.
    camera : Camera
        The camera of the picture.
    point_m : ndarray
        A point (3,) in the coordinates of the simulation. In a picture with
        perspective, the bar is correct only at this point's distance from the camera.
    extent_m : float
        Length of the object in the picture.
    suffix : str
        Text that follows the length of the bar.
    """
    length_m = round_length(0.3 * extent_m)
    # Compute the length in pixels of a bar that begins at the point and lies across the
    # view.
    right_axis, _, _ = camera.axes
    ends_m = point_m + np.outer([0.0, length_m], right_axis)
    x, _, _ = camera.project(ends_m)
    length_px = x[1] - x[0]

    # Place the bar near the lower right corner, and its text a little above it.
    right = 0.97 * camera.width
    row = 0.94 * camera.height
    # Add a white margin, because the bar may lie over grains.
    margin = [withStroke(linewidth=3, foreground="white")]
    panel.plot(
        [right - length_px, right],
        [row, row],
        lw=1.6,
        solid_capstyle="butt",
        color=BLACK,
        path_effects=margin,
    )
    panel.text(
        right,
        row - 0.02 * camera.height,
        f"{1e3 * length_m:g} mm{suffix}",
        ha="right",
        va="bottom",
        fontsize=SMALL_TEXT_PT,
        color=BLACK,
        path_effects=margin,
    )

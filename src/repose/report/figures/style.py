"""The common style of all figures: sizes, fonts, colours for colour-blind readers, labels of responses, saving."""

import io
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, FigureBase
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

import repose.bench  # noqa: F401  (makes the responses of all bench tests known)
from repose.bench.parameters import FURTHER, PAIRS, SYMBOLS
from repose.calibrate.responses import Response
from repose.calibrate.targets import Target, Targets
from repose.common.errors import require
from repose.common.files import Path_, write_bytes
from repose.measure.settings import line_of

if TYPE_CHECKING:
    from repose.report.renderer.scenery import Camera

from .registry import Config, Shown

MM = 1 / 25.4
COLUMN = 85 * MM  # of a journal
PAGE = 175 * MM
DPI = 180
TELEPHOTO_DEG = 0.8  # field of view of a picture without perspective

# Okabe and Ito's palette.
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SKY, PURPLE, GREY, BLACK = "#56B4E9", "#CC79A7", "#8A8F94", "#222222"
SERIES = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY)
LINES = ("-", "--", "-.", ":")
ANSWER = {"ms": 5.0, "color": RED, "mec": "white", "mew": 0.6, "zorder": 4}

SUBSCRIPTS = ", ".join(f"{pair}: {words}" for pair, words in PAIRS.items())
SMALL_RUN = "small run: NOT for use as a result"

# Entries of a file that would change from run to run.
UNDATED = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}


def applied() -> AbstractContextManager[None]:
    """Give the context with this style alone, independent of the user's settings, which it restores at its end."""
    settings = matplotlib.rc_params_from_file(
        Path(__file__).with_name("figures.mplstyle"), use_default_template=False
    )
    return matplotlib.rc_context(
        {**matplotlib.rcParamsDefault, "backend": "agg", **settings}
    )


def new_figure(width: float, height: float) -> Figure:
    """Draw an empty figure of this size in inches, laid out so that no part is cut off; it needs no window."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def targets_of(config: Config) -> Targets:
    """Give the targets of a configuration, in its order."""
    return Shown(config).targets


def response_label(response: Response, before: str = "") -> str:
    """Write the label of an axis, as ``predicted AoR (deg)``, with a dash for no unit; `before` precedes the symbol."""
    return f"{before} {response.symbol} ({response.unit or '–'})".lstrip()


def line_in_words(section: Mapping[str, Any], definition: str | None = None) -> str:
    """Say which line a definition of the angle draws, as `line_of` does for tables; default: the calibrated one."""
    _, band, _ = line_of(section, "flank").split(", ")
    return {
        "flank": f"line fitted to the side from {band}",
        "secant": "line from the foot to the crest",
        "steepest": f"line fitted to the steepest half or more of the side from {band}",
        "whole": "line fitted to the whole side",
        "straightest": f"line fitted to the straightest {100 * section['smallest_window']:.2g} % or more of the side",
    }[definition or section["response"]]


def explain_symbols(figure: Figure, config: Config) -> None:
    """Say below a figure which line of a pile its calibrated angle belongs to, and what subscripts stand for."""
    shown, lines = " ".join(text.get_text() for text in figure.findobj(Text)), []
    for one in (
        targets_of(config).responses if {"targets", "measure"} <= config.keys() else ()
    ):
        if "measure.response" in one.definition and one.symbol in shown:
            lines.append(
                f"{one.symbol}: {one.label} (simulated piles: {line_in_words(vars(Shown(config).measure))})"
            )
    if any(symbol in shown for symbol in SYMBOLS.values()):
        lines.append(SUBSCRIPTS)
    words = "\n".join(
        textwrap.fill(line, int(20 * figure.get_figwidth())) for line in lines
    )
    lowest = [
        legend
        for legend in figure.legends
        if getattr(legend, "_outside_loc", None) == "lower"
    ]
    if lowest and lines:  # the layout has one place at the lower edge
        title = lowest[0].get_title().get_text()
        lowest[0].set_title(f"{title}\n{words}".lstrip(), {"size": 6.8})
    elif lines:
        figure.supxlabel(f"{figure.get_supxlabel()}\n{words}".lstrip(), fontsize=6.8)


def below(figure: Figure, words: str) -> None:
    """Write small words below a figure, wrapped to its width."""
    figure.supxlabel(
        textwrap.fill(words, int(20 * figure.get_figwidth())), fontsize=6.8
    )


def one_legend(panels: Sequence[Axes], **look: Any) -> None:
    """Draw one legend for all panels, with each label once."""
    once = {
        label: one
        for panel in panels
        for one, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    panels[0].figure.legend(once.values(), once.keys(), **look)


def band(panel: Axes, low: float, high: float, label: str) -> None:
    """Draw the band of what is measured or near enough, across a panel."""
    panel.axhspan(low, high, color=GREEN, alpha=0.15, lw=0, label=label)


def near_enough(panel: Axes, percent: float) -> None:
    """Draw the tolerance of a deviation in percent as a band about zero."""
    band(panel, -percent, percent, f"near enough, ±{percent:g} %")
    panel.axhline(0, color=GREY, lw=0.7)


def off_target(panel: Axes, target: Target, percent: float, across: str) -> None:
    """Prepare a panel for deviations of one response from its target, in percent of it, over something."""
    near_enough(panel, percent)
    panel.set(xlabel=across, ylabel="off the target (% of it)")
    panel.set_title(
        f"{target.response.symbol}, target {target.aim:g} {target.response.unit}"
    )


def parameter_label(name: str) -> str:
    """Write the label of an axis of a parameter: its symbol and its unit, a dash for a number; its name if unknown."""
    if name not in SYMBOLS:
        return name
    return f"{SYMBOLS[name]} ({(FURTHER[name].constant.unit if name in FURTHER else '') or '–'})"


def letter(k: int) -> str:
    """Name of panel number k, from 0: ``a`` for 0, ``aa`` for 26."""
    return "abcdefghijklmnopqrstuvwxyz"[k % 26] * (1 + k // 26)


def name_panels(panels: Sequence[Axes]) -> None:
    """Give each panel its letter as title, in order; a single panel gets none."""
    if len(panels) > 1:
        for k, panel in enumerate(panels):
            panel.set_title(letter(k), fontweight="bold")


def series(k: int) -> dict[str, str]:
    """Give ``color`` and ``ls`` of curve number k, from 0, for `plot`; the first seven have colours of their own."""
    return {"color": SERIES[k % len(SERIES)], "ls": LINES[k % len(LINES)]}


def grid(
    count: int,
    height: float,
    columns: int = 2,
    further: float = 0.0,
    width: float = PAGE,
    **options: Any,
) -> tuple[Figure, list[Axes]]:
    """Draw an empty figure with a panel for each of `count` things, in rows of a height, and with `further` height."""
    figure = new_figure(
        width, further + height * math.ceil(count / min(columns, count))
    )
    return figure, panels_in(figure, count, columns, **options)


def panels_in(
    figure: FigureBase, count: int, columns: int = 2, **options: Any
) -> list[Axes]:
    """Give `count` panels in an empty figure; the other places stay empty."""
    columns = min(columns, count)
    panels = figure.subplots(
        math.ceil(count / columns), columns, squeeze=False, **options
    ).ravel()
    for panel in panels[count:]:
        panel.axis("off")
    return list(panels[:count])


def over_parameters(
    study: Shown, height: float
) -> tuple[Figure, Iterator[tuple[Axes, Target, str]]]:
    """Give an empty figure and its panels, a row for each target and a column for each free parameter."""
    targets, free = study.targets, study.space.free
    figure = new_figure(PAGE, 0.5 + height * len(targets))
    panels = figure.subplots(
        len(targets), len(free), sharex="col", sharey="row", squeeze=False
    )
    for panel, target in zip(panels[:, 0], targets, strict=True):
        panel.set_ylabel(response_label(target.response))
    for panel, name in zip(panels[-1], free, strict=True):
        panel.set_xlabel(parameter_label(name), fontsize=8.5)
        panel.set_xlim(study.ranges[name])
    return figure, (
        (panel, *place)
        for panel, place in zip(panels.flat, product(targets, free), strict=True)
    )


def pairs_of_parameters(
    figure: FigureBase, study: Shown, room: float = 0.0
) -> Iterator[tuple[Axes, str, str]]:
    """Yield panels below and on the diagonal of a square of all pairs, each with its parameters across and down.

    Their axes are the ranges with `room` to each side, a share of the range.
    """
    names = study.space.free
    ends = {
        name: (low - room * (high - low), high + room * (high - low))
        for name, (low, high) in study.ranges.items()
    }
    panels = figure.subplots(len(names), len(names), sharex="col", squeeze=False)
    for (row, column), panel in np.ndenumerate(panels):
        across, down = names[column], names[row]
        if column > row:
            panel.axis("off")
            continue
        yield panel, across, down
        panel.set_xlim(ends[across])
        panel.tick_params(labelsize=6, labelleft=column == 0 and row > 0)
        if row == column:
            panel.set_yticks([])
            panel.spines["left"].set_visible(False)
        else:
            panel.set_ylim(ends[down])
        if row == len(names) - 1:
            panel.set_xlabel(parameter_label(across), fontsize=8.5)
        if column == 0 and row > 0:
            panel.set_ylabel(parameter_label(down), fontsize=8.5)


def strips(panel: Axes, names: Sequence[str]) -> None:
    """Label the axes of a panel with a strip for each parameter from the top, its range from 0 to 1."""
    panel.set_yticks(
        range(len(names)),
        [SYMBOLS.get(name, name) for name in reversed(names)],
        fontsize=9,
    )
    panel.set_xticks([0, 0.25, 0.5, 0.75, 1.0])
    panel.set_xlabel("place in the parameter's range (dimensionless)")
    panel.spines["left"].set_visible(False)
    panel.tick_params(axis="y", length=0)


def save(
    figure: Figure,
    out_path: Path_,
    small_run: bool,
    further: Sequence[str] = (),
    dpi: int = DPI,
) -> None:
    """Write a figure in the format of its path and in `further` ones, a small run marked; the same bytes each time."""
    if small_run:
        width, height = figure.get_size_inches()
        band = 0.24
        figure.set_size_inches(width, height + band)
        figure.get_layout_engine().set(rect=(0, 0, 1, height / (height + band)))
        look = {
            "ha": "center",
            "va": "center",
            "color": "white",
            "fontweight": "bold",
            "fontsize": 8,
        }
        box = {"facecolor": RED, "edgecolor": "none", "boxstyle": "square,pad=0.3"}
        figure.text(0.5, 1 - 0.5 * band / (height + band), SMALL_RUN, bbox=box, **look)
    out_path = Path(out_path)
    for kind in (out_path.suffix.removeprefix("."), *further):
        write_bytes(
            out_path.with_suffix(f".{kind}"), encoded(figure, kind, dpi).getvalue()
        )


def check_ending(path: Path_) -> None:
    """Raise InputError for an ending that no figure has."""
    endings = [f".{kind}" for kind in UNDATED]
    require(
        Path(path).suffix in endings,
        path,
        "ending",
        Path(path).suffix,
        " or ".join(endings),
    )


def encoded(figure: Figure, kind: str = "png", dpi: int = DPI) -> io.BytesIO:
    """Give a figure as the content of a file; the same bytes each time."""
    content = io.BytesIO()
    figure.savefig(content, format=kind, dpi=dpi, metadata=UNDATED[kind])
    return content


def pixels(study: Shown, at_default: int) -> int:
    """Give the size of a shaded picture: as given at the default resolution, in proportion at the configuration's."""
    return round(at_default * study.config.get("figures", {}).get("dpi", DPI) / DPI)


def scale_bar(
    panel: Axes, camera: "Camera", place_m: np.ndarray, extent_m: float, where: str = ""
) -> None:
    """Draw a bar of 1, 2 or 5 times a power of ten, at most 0.3 of an extent, at the scale of a camera at a place.

    It lies in the lower right corner of the camera's picture; `where` follows its length in words.
    """
    power = 10.0 ** math.floor(math.log10(0.3 * extent_m))
    length_m = power * max(step for step in (1, 2, 5) if step * power <= 0.3 * extent_m)
    x, _, _ = camera.project(place_m + np.outer([0.0, length_m], camera.axes[0]))
    right, low = 0.97 * camera.width, 0.94 * camera.height
    look = {
        "color": BLACK,
        "path_effects": [withStroke(linewidth=3, foreground="white")],
    }  # also over grains
    panel.plot(
        [right - x[1] + x[0], right], [low, low], lw=1.6, solid_capstyle="butt", **look
    )
    words = f"{1e3 * length_m:g} mm{where}"
    panel.text(
        right,
        low - 0.02 * camera.height,
        words,
        ha="right",
        va="bottom",
        fontsize=6.8,
        **look,
    )


def note(
    axes: Axes, text: str, x: float = 0.03, y: float = 0.97, **options: Any
) -> Text:
    """Give small text inside the axes, by default in the upper left corner; `x` and `y` are shares of the axes."""
    style = {"va": "top", "ha": "left", "fontsize": 6.8, "linespacing": 1.35} | options
    return axes.text(x, y, text, transform=axes.transAxes, **style)

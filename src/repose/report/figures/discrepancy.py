"""Information in the measurements over the size of the simulator's discrepancy."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.common.files import read_table

from . import style
from .registry import OF_POSTERIOR, Inputs, Shown, figure

COLUMNS = (
    "discrepancy_percent",
    "discrepancy_correlation",
    "evidence",
    "information_bits",
    "effective_points",
)
BITS = ("discrepancy_percent", "information_bits")
FEW = 400  # effective points, below which a row is a rough estimate
PALE = 0.3  # opacity of rough estimates
ERROR = "assumed error of the simulator"


@figure(
    "discrepancy",
    "Discrepancy",
    {"discrepancy": "posterior/discrepancy.csv"},
    **OF_POSTERIOR,
)
def over_the_discrepancy(inputs: Inputs, study: Shown) -> Figure:
    """Draw information and intervals over the discrepancy.

    Information of the measurements on the parameters, over the discrepancy: the error that the simulator has with
    the best parameters, too. Above the information; below the 95 % interval of each parameter in its range. Where a
    shape study is given, its spread of plausible models is marked.
    """
    names = study.space.free
    ends = [f"{name}_{end}" for name in names for end in ("low", "high")]
    table = read_table(inputs["discrepancy"], (*COLUMNS, *ends))
    stated, of_study = (
        table[table["evidence"] == "stated"],
        table[table["evidence"] != "stated"],
    )
    rows = -(-len(names) // 3)
    figure = style.new_figure(style.PAGE, 2.3 + 1.55 * rows)
    above, below = figure.subfigures(2, 1, height_ratios=[2.3, 1.55 * rows])
    bits = above.subplots()
    for k, (correlation, own) in enumerate(stated.groupby("discrepancy_correlation")):
        how = (
            f"correlation {correlation:g}"
            if correlation
            else "independent between targets"
        )
        for part, look in (
            (own, {"alpha": PALE}),
            (_sure(own), {"label": f"assumed, {how}"}),
        ):
            bits.plot(*(part[key] for key in BITS), **style.series(k), **look)
    bits.plot(
        *(of_study[key] for key in BITS),
        "D",
        color=style.RED,
        label="spread of the shape study's models",
    )
    rough = stated[stated["effective_points"] < FEW]
    if len(rough):
        words = f"fewer than {FEW} effective points, with pale lines"
        bits.plot(
            *(rough[key] for key in BITS), "o", mfc="white", mec=style.GREY, label=words
        )
    bits.set(
        ylabel="information\n(bits; 1 bit halves the range)",
        xlabel=f"{ERROR} (% of the target)",
        ylim=(0, None),
    )
    bits.grid(True)
    bits.legend()
    panels = style.panels_in(below, len(names), 3)
    for panel, name in zip(panels, names, strict=True):
        _intervals(panel, name, stated, of_study)
        panel.set(ylabel=style.parameter_label(name), ylim=study.ranges[name])
    words = "95 % intervals of the parameters, in their ranges; bands: error assumed as above"
    below.suptitle(
        words + "; bar: spread of the shape study's models" * bool(len(of_study)),
        fontsize=7.5,
    )
    for panel in panels[max(0, len(names) - 3) :]:
        panel.set_xlabel("assumed error (%)")
    return figure


def _sure(rows: pd.DataFrame) -> pd.DataFrame:
    """Empty the rows that are rough estimates."""
    return rows.where(rows["effective_points"] >= FEW)


def _intervals(
    panel: Axes, name: str, stated: pd.DataFrame, of_study: pd.DataFrame
) -> None:
    """Draw the 95 % interval of one parameter: a band for each stated correlation, a bar for the shape study."""
    ends = [f"{name}_low", f"{name}_high"]
    for k, (_, own) in enumerate(stated.groupby("discrepancy_correlation")):
        look = style.series(k)
        for part, alpha in ((own, PALE), (_sure(own), 1.0)):
            x = part["discrepancy_percent"]
            panel.fill_between(
                x,
                *part[ends].to_numpy().T,
                color=look["color"],
                alpha=0.15 * alpha,
                lw=0,
            )
            panel.plot(x, part[ends], lw=1.1, alpha=alpha, **look)
    for _, row in of_study.iterrows():
        panel.plot(
            2 * [row["discrepancy_percent"]],
            row[ends],
            "-_",
            color=style.RED,
            lw=1.4,
            ms=6,
        )

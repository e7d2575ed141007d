"""Each pair of targets as a plane: reach of the samples, ranges of the targets, and the answer."""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from repose.calibrate.targets import Target, Targets
from repose.common.files import read_table

from . import style
from .registry import Inputs, Shown, figure

if TYPE_CHECKING:
    from repose.config.pipeline import PipelineConfig

Tables = Mapping[str, pd.DataFrame]  # by the names in `SAMPLES`
SAMPLES = {
    "dataset": ("parameter sets of the design, simulated", style.BLUE),
    "pool": ("further sets, simulated", style.SKY),
    "fresh": ("sets with many pours each", style.PURPLE),
    "own": ("parameter sets, simulated", style.BLUE),
}
BARS = "a point is the mean of one parameter set's piles; bars: ± 1 standard error of a mean"


INPUTS = {
    "dataset": "{answer.dataset}",
    "feasible": "{answer.feasible}",
    "table4": "{answer.table4}",
}
POOL: dict[str, Any] = {
    "if_there": {"pool": "pool/dataset.csv", "fresh": "pool/fresh_dataset.csv"}
}


def plain(targets: Targets) -> Targets:
    """Leave out the targets that are scores of a profile."""
    return Targets(target for target in targets if target.profile is None)


def _has_pairs(study: "PipelineConfig") -> bool:
    """Tell whether the targets have a plane."""
    return len(plain(study.targets)) > 1


@figure(
    "plane",
    "Targets against each other",
    INPUTS,
    **POOL,
    reads=("targets",),
    when=_has_pairs,
)
def planes(inputs: Inputs, study: Shown) -> Figure:
    """Draw all samples, target ranges, measured piles, solutions and the answer, for each pair of targets.

    Targets against each other: all samples with their standard errors, and of the pool if it was poured; the target
    ranges; the mean of the measured piles with its standard error; the predictions of the solutions that the search
    lists; and the answer, as predicted and as simulated with fresh seeds, with its standard error.
    """
    targets = plain(study.targets)
    simulated = [target.response.simulated for target in targets]
    columns = ("status", *targets.names, *targets.errors)
    tables = {key: read_table(inputs[key], columns) for key in SAMPLES if key in inputs}
    good = {key: table[table["status"] == "ok"] for key, table in tables.items()}
    solutions = read_table(inputs["feasible"], ("feasible", *targets.predicted))
    checked = read_table(
        inputs["table4"], ("role", *targets.predicted, *simulated, *targets.errors)
    )
    answer = checked[checked["role"] == "representative"].iloc[0]
    width = style.PAGE if len(targets) > 2 else 0.75 * style.PAGE
    figure, panels = style.grid(math.comb(len(targets), 2), 4.7, width=width)
    draw(panels, targets, good, solutions, answer, BARS)
    return figure


def draw(
    panels: Sequence[Axes],
    targets: Targets,
    samples: Tables,
    solutions: pd.DataFrame,
    answer: pd.Series,
    bars: str,
) -> None:
    """Draw each pair of targets with the means of `samples`, by the names in `SAMPLES`; `bars` explains their bars.

    Of an answer without simulated responses only the prediction is shown.
    """
    for panel, (across, up) in zip(panels, combinations(targets, 2), strict=True):
        _samples(panel, samples, across, up)
        _targets(panel, across, up)
        _solutions(panel, solutions, answer, across, up)
    style.name_panels(panels)
    style.one_legend(
        panels, loc="outside lower center", ncols=2, title=bars, title_fontsize=6.8
    )


def _samples(panel: Axes, tables: Tables, across: Target, up: Target) -> None:
    """Draw the means of the samples with their standard errors."""
    for key, table in tables.items():
        label, colour = SAMPLES[key]
        x, y = table[across.name], table[up.name]
        dx, dy = (table[target.response.error].fillna(0.0) for target in (across, up))
        panel.errorbar(
            x,
            y,
            xerr=dx,
            yerr=dy,
            fmt="none",
            elinewidth=0.4,
            ecolor=colour,
            alpha=0.25,
        )
        panel.plot(
            x, y, "o", ms=2.6, mew=0, color=colour, label=f"{len(table)} {label}"
        )


def _targets(panel: Axes, across: Target, up: Target) -> None:
    """Draw the box of the target ranges, and the mean of the measured piles with its standard error."""
    sides = across.high - across.low, up.high - up.low
    look = {
        "fc": "none",
        "ec": style.GREEN,
        "lw": 1.4,
        "zorder": 3,
        "label": "asked for: target ranges",
    }
    panel.add_patch(Rectangle((across.low, up.low), *sides, **look))
    look = {
        "fmt": "D",
        "ms": 8,
        "mfc": "none",
        "color": style.BLACK,
        "elinewidth": 1.2,
        "capsize": 3,
        "zorder": 4,
    }
    look |= {"xerr": across.standard_error, "yerr": up.standard_error}
    look["label"] = f"measured ± standard error of {across.repetitions} repetitions"
    panel.errorbar(across.value, up.value, **look)
    for name, response in (("xlabel", across.response), ("ylabel", up.response)):
        before = "" if response.label == response.symbol else f"{response.label},"
        panel.set(**{name: style.response_label(response, before)})


def _solutions(
    panel: Axes, solutions: pd.DataFrame, answer: pd.Series, across: Target, up: Target
) -> None:
    """Draw the predictions of the solutions, and the answer as predicted and as simulated."""
    x, y = across.response, up.response
    kind = (
        "feasible solutions"
        if solutions["feasible"].any()
        else "nearest solutions, none feasible"
    )
    look = {"ms": 2.6, "mew": 0, "color": style.ORANGE, "zorder": 5}
    panel.plot(
        solutions[x.predicted],
        solutions[y.predicted],
        "o",
        **look,
        label=f"{kind}, predicted",
    )
    look = {"ms": 7, "mfc": "none", "color": style.RED, "zorder": 6}
    panel.plot(
        answer[x.predicted],
        answer[y.predicted],
        "s",
        **look,
        label="the answer, predicted",
    )
    if x.simulated not in answer:
        return
    look = {
        "fmt": "s",
        "ms": 6,
        "color": style.RED,
        "mec": "white",
        "elinewidth": 1.4,
        "capsize": 3,
        "zorder": 7,
    }
    look |= {
        key: answer[own.error]
        for key, own in (("xerr", x), ("yerr", y))
        if pd.notna(answer[own.error])
    }
    panel.errorbar(
        answer[x.simulated], answer[y.simulated], label="the answer, simulated", **look
    )

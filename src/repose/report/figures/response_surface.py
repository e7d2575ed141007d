"""Figures of the response surface strategy: Pareto charts, perturbation plots, contours."""

from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.bench.parameters import SYMBOLS
from repose.calibrate.designs.model import Model
from repose.calibrate.strategies.response_surface.screening import models_of
from repose.calibrate.targets import Target, Targets
from repose.common.files import read_json, read_table

from . import style
from .registry import Inputs, Shown, figure

GRID = 60
SURFACE: dict[str, Any] = {
    "reads": ("targets",),
    "folder": "response_surface",
    "category": "Response surface",
}
FITTED = {
    "samples": "response_surface/surface.csv",
    "dataset": "response_surface/dataset.csv",
}


@figure(
    "pareto_screening",
    "Pareto chart of the screening",
    {"effects": "response_surface/screening_effects.csv"},
    "Standardised effects of the Plackett-Burman screening. A parameter goes on where its bar passes the dashed line.",
    **SURFACE,
)
@figure(
    "pareto_surface",
    "Pareto chart of the surface",
    {"effects": "response_surface/surface_effects.csv"},
    "Standardised effects of the response surface: single parameters, products of two, squares.",
    **SURFACE,
)
def pareto(inputs: Inputs, study: Shown) -> Figure:
    """Draw the standardised effects of a step, the largest first, with the limits of significance."""
    columns = ("response", "term", "coefficient", "t", "limit_t", "limit_bonferroni")
    effects, targets = read_table(inputs["effects"], columns), study.targets
    terms = len(effects) // len(targets)
    figure, panels = style.grid(len(targets), 1.0 + 0.19 * terms, columns=len(targets))
    for panel, target in zip(panels, targets, strict=True):
        own = effects[effects["response"] == target.name].sort_values("t")
        colours = np.where(own["coefficient"] > 0, style.ORANGE, style.BLUE)
        panel.barh(
            [_words(term) for term in own["term"]], own["t"], color=colours, height=0.7
        )
        for name, line, words in (
            ("t", "--", "5 % for one term"),
            ("bonferroni", "-", "5 % for all terms"),
        ):
            panel.axvline(
                own[f"limit_{name}"].iloc[0],
                color=style.BLACK,
                ls=line,
                lw=0.8,
                label=words,
            )
        panel.set(
            xlabel="|t| of the effect",
            title=f"{target.response.symbol}: orange raises it, blue lowers it",
        )
    panels[-1].legend(loc="lower right")
    return figure


@figure("perturbation", "Perturbation plot", FITTED, **SURFACE)
def perturbation(inputs: Inputs, study: Shown) -> Figure:
    """Draw each response over one factor after the other.

    Each response over one parameter after the other, the others at the centre of the design; grey: the target.
    """
    targets, models = study.targets, _models(inputs, study.targets)
    figure, panels = style.grid(len(models), 2.9, columns=len(models))
    coded = np.linspace(-1, 1, GRID)
    for panel, target, model in zip(panels, targets, models, strict=True):
        for k, (name, way) in enumerate(
            zip(model.factors, np.eye(len(model.factors)), strict=True)
        ):
            panel.plot(
                coded,
                model.predict(np.outer(coded, way)),
                label=SYMBOLS[name],
                **style.series(k),
            )
        panel.axhline(target.aim, color=style.GREY, lw=0.8)
        panel.set(xlabel="factor (coded)", ylabel=style.response_label(target.response))
    panels[-1].legend(loc="best")
    return figure


@figure(
    "contours",
    "Contours of the surface",
    FITTED | {"optimum": "response_surface/optimum.json"},
    **SURFACE,
)
def contours(inputs: Inputs, study: Shown) -> Figure:
    """Draw each response over every pair of factors.

    Each response over every pair of parameters, the others at the optimum (star); the black line is the target.
    """
    targets, models = study.targets, _models(inputs, study.targets)
    best = read_json(inputs["optimum"], ("coded",), "output of repose stage conclude")[
        "coded"
    ]
    pairs = list(combinations(range(len(models[0].factors)), 2))
    shown = [
        (target, model, pair)
        for target, model in zip(targets, models, strict=True)
        for pair in pairs
    ]
    figure, panels = style.grid(
        len(shown), 2.3, columns=min(3, max(len(pairs), len(models)))
    )
    for panel, (target, model, pair) in zip(panels, shown, strict=True):
        _contour(
            panel, model, target, pair, np.array([best[name] for name in model.factors])
        )
    return figure


def _contour(
    panel: Axes, model: Model, target: Target, pair: tuple[int, int], point: np.ndarray
) -> None:
    """Draw one response over two factors; the thick line is its target, the star the optimum."""
    across, up = np.meshgrid(np.linspace(-1, 1, GRID), np.linspace(-1, 1, GRID))
    points = np.repeat(point[None], GRID * GRID, axis=0)
    points[:, pair] = np.column_stack([across.ravel(), up.ravel()])
    values = model.predict(points).reshape(GRID, GRID)
    panel.contourf(across, up, values, levels=12, cmap="viridis", alpha=0.85)
    panel.clabel(
        panel.contour(across, up, values, levels=6, colors="white", linewidths=0.5),
        fontsize=6,
    )
    if values.min() < target.aim < values.max():
        panel.contour(
            across, up, values, levels=[target.aim], colors=style.BLACK, linewidths=1.4
        )
    panel.plot(*point[[*pair]], "*", ms=8, mfc=style.ORANGE, mec=style.BLACK, mew=0.5)
    names = [f"{SYMBOLS[model.factors[k]]} (coded)" for k in pair]
    panel.set(
        xlabel=names[0], ylabel=names[1], title=style.response_label(target.response)
    )


def _models(inputs: Inputs, targets: Targets) -> list[Model]:
    """Fit the surfaces."""
    table, dataset = (
        pd.DataFrame(read_table(inputs[name], ("sample",)))
        for name in ("samples", "dataset")
    )
    return models_of(table, dataset, targets, "quadratic")


def _words(term: str) -> str:
    """Say a term with the parameters' symbols."""
    if term.endswith("^2"):
        return f"{SYMBOLS[term[:-2]]}²"
    return " × ".join(SYMBOLS[name] for name in term.split("*"))

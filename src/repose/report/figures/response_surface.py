"""Draw the response surface strategy: Pareto charts, perturbation plots, contours."""

from itertools import combinations, product

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.bench.parameters import SYMBOLS
from repose.calibrate.designs.model import Model
from repose.calibrate.designs.region import Region
from repose.calibrate.strategies.response_surface.screening import fit_models
from repose.calibrate.strategies.response_surface.surface import make_surface_region
from repose.calibrate.targets import Target, Targets
from repose.common.files import read_json, read_table

from . import panels, style
from .registry import Inputs, StudyView

GRID_POINTS = 60  # along each factor
MAX_COLUMNS = 3  # of contour plots in a row
CONTOUR_ROW_HEIGHT = 2.3  # inches
# Height of a Pareto chart in inches: without any bar, and for each bar
PARETO_BASE_HEIGHT = 1.0
HEIGHT_PER_BAR = 0.19
# Numbers of levels of the coloured areas and of the white lines in a contour plot
N_AREAS = 12
N_LINES = 6
EFFECT_COLUMNS = (
    "response",
    "term",
    "coefficient",
    "t",
    "limit_t",
    "limit_bonferroni",
)


def draw_pareto_charts(inputs: Inputs, study: StudyView) -> Figure:
    """Draw a Pareto chart of each response: bars for its standardised effects.

    The largest effect is at the top, and lines show the limits of significance.

    Parameters
    ----------
    inputs : mapping
        Path of the table `effects`, which has a row for each term of each response. The
        terms are the same for all responses. The column `t` contains the effect of the
        term, without its sign, over its standard error.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    effects = read_table(inputs["effects"], EFFECT_COLUMNS)
    # Each term is a bar.
    n_terms = len(effects) // len(targets)
    row_height = PARETO_BASE_HEIGHT + HEIGHT_PER_BAR * n_terms
    figure, axes = panels.grid(len(targets), row_height, columns=len(targets))
    for panel, target in zip(axes, targets, strict=True):
        effects_of_target = effects[effects["response"] == target.name].sort_values("t")
        _draw_effects(panel, effects_of_target)
        symbol = target.response.symbol
        # The colours are those of `_draw_effects`.
        panel.set_title(f"{symbol}: orange raises it, blue lowers it")
    axes[-1].legend(loc="lower right")
    return figure


def _draw_effects(panel: Axes, effects: pd.DataFrame) -> None:
    """Draw the effects of the terms on one response, with the limits of significance.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    effects : DataFrame
        A row for each term, with the columns `EFFECT_COLUMNS`.
    """
    is_rising = effects["coefficient"] > 0
    panel.barh(
        [_format_term(term) for term in effects["term"]],
        effects["t"],
        color=np.where(is_rising, style.ORANGE, style.BLUE),
        height=0.7,
    )
    for column, line_style, label in (
        ("limit_t", "--", "5 % for one term"),
        ("limit_bonferroni", "-", "5 % for all terms"),
    ):
        limit = effects[column].iloc[0]
        panel.axvline(limit, color=style.BLACK, ls=line_style, lw=0.8, label=label)
    panel.set_xlabel("|t| of the effect")


def draw_perturbation_plots(inputs: Inputs, study: StudyView) -> Figure:
    """Draw each response over one factor at a time.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `samples` contains the parameters, and `dataset` the responses,
        to which the surfaces are fitted.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    models = _fit_models(inputs, targets)
    region = _find_allowed_region(inputs, study)
    figure, axes = panels.grid(len(models), 2.9, columns=len(models))
    coded = np.linspace(-1, 1, GRID_POINTS)
    for panel, target, model in zip(axes, targets, models, strict=True):
        for k, name in enumerate(model.factors):
            # Vary one factor from -1 to 1, and keep the others at the centre, 0.
            points = np.zeros((GRID_POINTS, len(model.factors)))
            points[:, k] = coded
            panel.plot(
                coded,
                _predict_allowed(model, points, region),
                label=SYMBOLS.get(name, name),
                **style.series_style(k),
            )
        panel.axhline(target.aim, color=style.GREY, lw=0.8)
        panel.set(xlabel="factor (coded)", ylabel=style.response_label(target.response))
    axes[-1].legend(loc="best")
    return figure


def draw_contour_plots(inputs: Inputs, study: StudyView) -> Figure:
    """Draw contour plots of the fitted surface of each response over pairs of factors.

    The surfaces are fitted to the simulated samples first. A factor is a parameter
    that is coded, so that its range extends from -1 to 1.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `samples` contains the parameters, and `dataset` the responses,
        to which the surfaces are fitted. `optimum` contains the factors of the optimum.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    targets = study.targets
    models = _fit_models(inputs, targets)
    region = _find_allowed_region(inputs, study)
    optimum = read_json(
        inputs["optimum"], ("coded",), "output of repose stage conclude"
    )["coded"]
    factors = models[0].factors  # the same for all models
    point = np.array([optimum[name] for name in factors])
    # There is a panel for each response and each pair of factors. The panels of a
    # response follow each other.
    pairs = list(combinations(range(len(factors)), 2))
    columns = min(MAX_COLUMNS, max(len(pairs), len(models)))
    figure, axes = panels.grid(
        len(models) * len(pairs), CONTOUR_ROW_HEIGHT, columns=columns
    )
    targets_and_models = zip(targets, models, strict=True)
    for panel, ((target, model), pair) in zip(
        axes, product(targets_and_models, pairs), strict=True
    ):
        _draw_contours(panel, model, region, target=target, pair=pair, point=point)
    return figure


def _draw_contours(
    panel: Axes,
    model: Model,
    region: Region | None,
    *,
    target: Target,
    pair: tuple[int, int],
    point: np.ndarray,
) -> None:
    """Draw contours of one response over two factors, with its target and the optimum.

    A black line shows where the response equals its target, and a star the optimum.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    model : Model
        The fitted surface.
    region : Region or None
        The region of the factors that the constraints allow. Only this part of the
        panel is coloured. If it is None, everything is allowed.
    target : Target
        The target of the response.
    pair : tuple of int
        Indices of the factors along x and along y.
    point : ndarray
        The optimum (d,) in coded factors, from -1 to 1.
    """
    # Predict the response on a grid over the two factors. The other factors stay at the
    # optimum.
    coded = np.linspace(-1, 1, GRID_POINTS)
    x_grid, y_grid = np.meshgrid(coded, coded)
    points = np.repeat(point[None], GRID_POINTS * GRID_POINTS, axis=0)
    first, second = pair
    points[:, first] = x_grid.ravel()
    points[:, second] = y_grid.ravel()
    values = _predict_allowed(model, points, region).reshape(x_grid.shape)

    panel.contourf(x_grid, y_grid, values, levels=N_AREAS, cmap="viridis", alpha=0.85)
    lines = panel.contour(
        x_grid, y_grid, values, levels=N_LINES, colors="white", linewidths=0.5
    )
    panel.clabel(lines, fontsize=6)
    # Draw a line where the response equals the target, if it does so anywhere.
    if np.nanmin(values) < target.aim < np.nanmax(values):
        panel.contour(
            x_grid,
            y_grid,
            values,
            levels=[target.aim],
            colors=style.BLACK,
            linewidths=1.4,
        )
    panel.plot(
        point[first],
        point[second],
        "*",
        ms=8,
        mfc=style.ORANGE,
        mec=style.BLACK,
        mew=0.5,
    )
    x_name = model.factors[first]
    y_name = model.factors[second]
    panel.set(
        xlabel=f"{SYMBOLS.get(x_name, x_name)} (coded)",
        ylabel=f"{SYMBOLS.get(y_name, y_name)} (coded)",
        title=style.response_label(target.response),
    )


def _find_allowed_region(inputs: Inputs, study: StudyView) -> Region | None:
    """Find the part of the cube of factors that the constraints allow.

    The result is None if the study has no constraints.
    """
    if not study.parameters.constraints:
        return None
    samples = read_table(inputs["samples"], ("sample", *study.parameters.names))
    return make_surface_region(samples, study.parameters)


def _predict_allowed(
    model: Model, points: np.ndarray, region: Region | None
) -> np.ndarray:
    """Predict a response at points in the allowed region.

    Parameters
    ----------
    model : Model
        The fitted surface of the response.
    points : ndarray
        Points (n, k) in coded factors.
    region : Region or None
        The allowed region. If it is None, all points are allowed.

    Returns
    -------
    ndarray
        The response (n,); NaN at a point outside the region.
    """
    values = model.predict(points)
    if region is None:
        return values
    return np.where(region.is_allowed(points), values, np.nan)


def _fit_models(inputs: Inputs, targets: Targets) -> list[Model]:
    """Fit the surface of each response."""
    samples = read_table(inputs["samples"], ("sample",))
    dataset = read_table(inputs["dataset"], ("sample",))
    return fit_models(samples, dataset, targets=targets, order="quadratic")


def _format_term(term: str) -> str:
    """Write a term of a model with the symbols of its parameters."""
    if term.endswith("^2"):
        return f"{SYMBOLS.get(term[:-2], term[:-2])}²"
    return " × ".join(SYMBOLS.get(name, name) for name in term.split("*"))

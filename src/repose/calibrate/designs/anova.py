"""The analysis of variance of a polynomial model, with the columns and statistics of Design-Expert.

The sum of squares of a term is partial: the gain of the residuals if this term alone were left out.
"""

import math
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.designs.model import Model

ALPHA = 0.05
COLUMNS = ("source", "sum_of_squares", "df", "mean_square", "f", "p")


def pure_error(model: Model) -> tuple[float, int]:
    """Sum the squares, and count the degrees of freedom (0 if none), of runs that were repeated."""
    _, place, counts = np.unique(
        np.round(model.coded, 9), axis=0, return_inverse=True, return_counts=True
    )
    place = place.ravel()
    means = np.bincount(place, weights=model.response) / counts
    return float(((model.response - means[place]) ** 2).sum()), int((counts - 1).sum())


def anova(model: Model) -> pd.DataFrame:
    """Make the ANOVA table with `COLUMNS`; F and p are nan if there is nothing to test by."""
    residual, df_residual, error = model.residual, model.df, model.variance
    total = float(((model.response - model.response.mean()) ** 2).sum())
    rows = [_row("model", total - residual, len(model.terms), error, df_residual)]
    # For a single column the partial sum of squares is b^2 / c, with c its element of (X'X)^-1.
    partial = model.coefficients**2 / np.diag(model.inverse)[1:]
    for name, squares in zip(model.labels, partial.tolist(), strict=True):
        rows.append(_row(name, squares, 1, error, df_residual))
    rows.append(_row("residual", residual, df_residual))
    pure, df_pure = pure_error(model)
    if df_pure:
        lack, df_lack = residual - pure, df_residual - df_pure
        rows += [
            _row("lack of fit", lack, df_lack, _mean(pure, df_pure), df_pure),
            _row("pure error", pure, df_pure),
        ]
    rows.append(_row("total", total, len(model.response) - 1))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def statistics(model: Model) -> dict[str, float]:
    """Compute statistics of the fit, as in Design-Expert; nan without degrees of freedom for the error.

    `press` is the sum of the squared errors of predicting each run from all others. `adequate_precision` is the range
    of the predictions over their mean standard error.
    """
    n, residual, df = len(model.response), model.residual, model.df
    total = anova(model).set_index("source").loc["model", "sum_of_squares"] + residual
    sigma = math.sqrt(model.variance)
    leverage = np.einsum("ij,jk,ik->i", model.matrix, model.inverse, model.matrix)
    with np.errstate(divide="ignore", invalid="ignore"):
        press = (
            float(((model.residuals / (1 - leverage)) ** 2).sum()) if df else math.nan
        )
    fitted = model.matrix @ model.fitted
    spread = sigma * math.sqrt(model.matrix.shape[1] / n)
    return {
        "std_dev": sigma,
        "mean": float(model.response.mean()),
        "cv_percent": 100 * _ratio(sigma, float(model.response.mean())),
        "press": press,
        "r2": 1 - _ratio(residual, total),
        "adjusted_r2": 1 - _ratio(_mean(residual, df), total / (n - 1)),
        "predicted_r2": 1 - _ratio(press, total),
        "adequate_precision": _ratio(float(np.ptp(fitted)), spread),
    }


def effects(model: Model) -> pd.DataFrame:
    """List the terms for the Pareto chart, the largest contribution first.

    `term`, `coefficient` in coded units, `standard_error`, `t` (the standardised effect, without sign), `p`, and
    `contribution_percent`: the term's partial sum of squares over the total.
    """
    table, errors = (
        anova(model).set_index("source"),
        np.sqrt(model.variance * np.diag(model.inverse)),
    )
    estimates = pd.DataFrame(
        {
            "term": model.labels,
            "coefficient": model.coefficients,
            "standard_error": errors[1:],
        }
    )
    estimates["t"] = (estimates["coefficient"] / estimates["standard_error"]).abs()
    estimates["p"] = table.loc[model.labels, "p"].to_numpy()
    partial = table.loc[model.labels, "sum_of_squares"].to_numpy(float)
    estimates["contribution_percent"] = (
        100 * partial / float(table.loc["total", "sum_of_squares"])
    )
    return estimates.sort_values(
        "contribution_percent", ascending=False, ignore_index=True
    )


def limits(model: Model) -> dict[str, float]:
    """Find the two lines of the Pareto chart at significance `ALPHA`; nan without degrees of freedom.

    A single term above `t` is significant; without any effect, a share `ALPHA` of all studies at most has a term above
    `bonferroni`.
    """
    from scipy import stats

    tests = {"t": 1, "bonferroni": len(model.terms)}
    return {
        name: float(stats.t.isf(ALPHA / 2 / count, model.df or math.nan))
        for name, count in tests.items()
    }


def _mean(total: float, df: float) -> float:
    """Return the mean square, or nan without degrees of freedom."""
    return total / df if df else math.nan


def _ratio(above: float, below: float) -> float:
    """Divide, or return nan for a zero below."""
    return above / below if below else math.nan


def _row(
    source: str, total: float, df: int, error: float = math.nan, df_error: int = 0
) -> tuple[Any, ...]:
    """Make a row of the table, in the order of `COLUMNS`, tested against a mean square."""
    from scipy import stats

    mean = _mean(total, df)
    f = _ratio(mean, error)
    p = (
        float(stats.f.sf(f, df, df_error))
        if df and df_error and math.isfinite(f)
        else math.nan
    )
    return (source, total, df, mean, f, p)

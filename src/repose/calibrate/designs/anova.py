"""Make the analysis of variance of a polynomial model.

Columns and statistics are those of Design-Expert. The sum of squares of a term is
partial. It is the amount by which the residual sum of squares would rise if only this
term were left out.
"""

import math
from typing import NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.designs.model import Model

SIGNIFICANCE_LEVEL = 0.05  # for the lines in the Pareto chart
POINT_DECIMALS = 9  # decimals to which the coordinates of repeated runs agree
ANOVA_COLUMNS = ("source", "sum_of_squares", "df", "mean_square", "f", "p")


class PureError(NamedTuple):
    """Scatter of repeated runs about their means."""

    sum_of_squares: float
    df: int  # degrees of freedom; 0 if no run was repeated


class _Row(NamedTuple):
    """A row of the ANOVA table; the fields are `ANOVA_COLUMNS`."""

    source: str
    sum_of_squares: float
    df: int
    mean_square: float
    f: float = math.nan
    p: float = math.nan


def compute_pure_error(model: Model) -> PureError:
    """Compute the scatter of the runs of a model that were repeated."""
    # Runs at the same point are a group.
    _, group, size = np.unique(
        np.round(model.coded, POINT_DECIMALS),
        axis=0,
        return_inverse=True,
        return_counts=True,
    )
    group = group.ravel()
    means = np.bincount(group, weights=model.response) / size
    sum_of_squares = float(((model.response - means[group]) ** 2).sum())
    return PureError(sum_of_squares, int((size - 1).sum()))


def make_anova_table(model: Model) -> pd.DataFrame:
    """Make the ANOVA table of a model.

    The model and its terms are tested against the mean square of the residuals, and the
    lack of fit against that of the pure error.

    Parameters
    ----------
    model : Model
        The polynomial, fitted to its runs.

    Returns
    -------
    pandas.DataFrame
        The columns are `ANOVA_COLUMNS`. There is a row for the model, for each term,
        for the residual and for the total. If runs were repeated, there are also rows
        for the lack of fit and the pure error. F and p are NaN in a row that is not
        tested.
    """
    # Sums of squares of the residuals, and of the responses about their mean.
    residual = model.residual_squares
    total = float(((model.response - model.response.mean()) ** 2).sum())
    rows = [
        _make_tested_row(
            "model",
            total - residual,
            df=len(model.terms),
            error_mean_square=model.variance,
            error_df=model.df,
        )
    ]
    # Let b be the coefficient of a term, and c its element on the diagonal of (X'X)^-1,
    # which is `model.inverse`. Then the partial sum of squares is b^2 / c. The first
    # element on the diagonal belongs to the constant. `model.coefficients` leaves the
    # constant out, because it is not a term.
    partial_squares = model.coefficients**2 / np.diag(model.inverse)[1:]
    for label, sum_of_squares in zip(
        model.labels, partial_squares.tolist(), strict=True
    ):
        rows.append(
            _make_tested_row(
                label,
                sum_of_squares,
                df=1,
                error_mean_square=model.variance,
                error_df=model.df,
            )
        )
    rows.append(_make_row("residual", residual, model.df))

    # Split the residuals into lack of fit and pure error, if runs were repeated.
    pure = compute_pure_error(model)
    if pure.df:
        rows.append(
            _make_tested_row(
                "lack of fit",
                residual - pure.sum_of_squares,
                df=model.df - pure.df,
                error_mean_square=_compute_mean_square(pure.sum_of_squares, pure.df),
                error_df=pure.df,
            )
        )
        rows.append(_make_row("pure error", pure.sum_of_squares, pure.df))
    rows.append(_make_row("total", total, len(model.response) - 1))
    return pd.DataFrame(rows, columns=list(ANOVA_COLUMNS))


def compute_statistics(model: Model) -> dict[str, float]:
    """Compute the statistics of the fit that the program Design-Expert shows.

    Parameters
    ----------
    model : Model
        The fitted polynomial.

    Returns
    -------
    dict
        `std_dev` is the standard deviation of the residuals, and `mean` the mean
        response. `cv_percent` is the first in percent of the second. `press` is the sum
        of the squared errors of predicting each run from all others. `r2`,
        `adjusted_r2` and `predicted_r2` are coefficients of determination.
        `adequate_precision` is the range of the predictions divided by their mean
        standard error. If the error has no degrees of freedom, the statistics that need
        it are NaN.
    """
    n_runs = len(model.response)
    # Sums of squares of the residuals, and of the responses about their mean. The
    # latter is the sum of squares of the model plus that of the residuals.
    residual_squares = model.residual_squares
    anova = make_anova_table(model).set_index("source")
    total_squares = anova.loc["model", "sum_of_squares"] + residual_squares
    mean = float(model.response.mean())
    sigma = math.sqrt(model.variance)
    press = _compute_press(model)
    predictions = model.matrix @ model.all_coefficients
    # The mean variance of the predictions is sigma^2 p / n, for n runs and p
    # coefficients.
    n_coefficients = model.matrix.shape[1]
    mean_standard_error = sigma * math.sqrt(n_coefficients / n_runs)
    mean_residual_square = _compute_mean_square(residual_squares, model.df)
    # `_divide` returns NaN for a denominator of 0.
    return {
        "std_dev": sigma,
        "mean": mean,
        "cv_percent": 100 * _divide(sigma, mean),
        "press": press,
        "r2": 1 - _divide(residual_squares, total_squares),
        "adjusted_r2": 1 - _divide(mean_residual_square, total_squares / (n_runs - 1)),
        "predicted_r2": 1 - _divide(press, total_squares),
        "adequate_precision": _divide(float(np.ptp(predictions)), mean_standard_error),
    }


def _compute_press(model: Model) -> float:
    """Sum the squared errors of predicting each run from all others.

    The error of predicting a run from all others is its residual divided by
    1 - leverage. The sum is NaN if there are no degrees of freedom.
    """
    if not model.df:
        return math.nan
    leverage = np.einsum("ij,jk,ik->i", model.matrix, model.inverse, model.matrix)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(((model.residuals / (1 - leverage)) ** 2).sum())


def list_effects(model: Model) -> pd.DataFrame:
    """List the effects of the terms for the Pareto chart.

    Parameters
    ----------
    model : Model
        The fitted polynomial.

    Returns
    -------
    pandas.DataFrame
        A row for each term, the largest contribution first: `term`, `coefficient` in
        coded units, `standard_error`, `t` (absolute value of the coefficient divided by
        its standard error), `p`, and `contribution_percent` (the partial sum of squares
        in percent of the total).
    """
    table = make_anova_table(model).set_index("source")
    # The covariance of all coefficients is variance * (X'X)^-1, and `model.inverse` is
    # (X'X)^-1. The first coefficient is the constant, which is not an effect. The
    # others are in the order of `model.labels`.
    errors = np.sqrt(model.variance * np.diag(model.inverse))
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
    total = float(table.loc["total", "sum_of_squares"])
    estimates["contribution_percent"] = 100 * partial / total
    return estimates.sort_values(
        "contribution_percent", ascending=False, ignore_index=True
    )


def compute_pareto_limits(model: Model) -> dict[str, float]:
    """Compute the two lines of the Pareto chart, above which an effect is significant.

    The line `t` is for testing a single term: a term above it is significant. The line
    `bonferroni` is for testing all terms at once: if no term has an effect, the
    probability that any lies above this line is at most `SIGNIFICANCE_LEVEL`. Both
    lines are NaN if there are no degrees of freedom.
    """
    from scipy import stats

    df = model.df or math.nan
    return {
        "t": float(stats.t.isf(SIGNIFICANCE_LEVEL / 2 / 1, df)),
        "bonferroni": float(stats.t.isf(SIGNIFICANCE_LEVEL / 2 / len(model.terms), df)),
    }


def _compute_mean_square(total: float, df: float) -> float:
    """Compute a mean square; NaN if there are no degrees of freedom."""
    return total / df if df else math.nan


def _divide(numerator: float, denominator: float) -> float:
    """Divide two numbers; NaN for a denominator of 0."""
    return numerator / denominator if denominator else math.nan


def _make_row(source: str, sum_of_squares: float, df: int) -> _Row:
    """Make a row of the ANOVA table without a test."""
    return _Row(source, sum_of_squares, df, _compute_mean_square(sum_of_squares, df))


def _make_tested_row(
    source: str,
    sum_of_squares: float,
    *,
    df: int,
    error_mean_square: float,
    error_df: int,
) -> _Row:
    """Make a row of the ANOVA table with an F test.

    F is the mean square of the row divided by that of the error.

    Parameters
    ----------
    source : str
        Name of the row.
    sum_of_squares : float
        Sum of squares of the row.
    df : int
        Degrees of freedom of the sum of squares.
    error_mean_square : float
        Mean square of the error: of the residuals, or of the pure error.
    error_df : int
        Degrees of freedom of the error.

    Returns
    -------
    _Row
        F and p are NaN if they cannot be computed.
    """
    from scipy import stats

    row = _make_row(source, sum_of_squares, df)
    f = _divide(row.mean_square, error_mean_square)
    p = math.nan
    if df and error_df and math.isfinite(f):
        p = float(stats.f.sf(f, df, error_df))
    return row._replace(f=f, p=p)

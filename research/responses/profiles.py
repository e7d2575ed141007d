"""The whole profile as a target: information in its principal components beside angle and Height.

The profile of a pile is half its width R(z) at many heights z. Over a design it varies along few directions, the
principal components of the samples' mean profiles. Each component has a surrogate of its own. Measured profiles are
inverted by the likelihood of their components,

    V'R ~ N(f(theta), S_y + S_s + V' S_d V),

with the directions V, the scatter S_y of the mean of all repetitions, the surrogates' error S_s, and a discrepancy S_d
of the half-widths themselves: a share of their mean, correlated between heights. So it means the same for two numbers
and for the whole profile. Angle and Height stand beside them, with the same discrepancy of their own means.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import response
from repose.calibrate.targets import Targets
from repose.common.files import write_json, write_table
from research.responses import discrepancies, information
from research.responses.design_surrogates import NOISY, WORST_R2, Predict, fitted
from research.responses.plausible import plausible_truths, prior_points
from research.responses.responses_over_design import (
    Known,
    cross_validated_r2,
    over_design,
    surrogate_covariance,
)

SPACING_MM = 3.0  # between two heights; half a berry's smallest radius
MOST_COMPONENTS = 8
TWO_NUMBERS = ("aor_deg", "height_mm")
PROFILE = "profile"
BOTH = "profile and both numbers"


def levels_mm(highest_mm: float) -> np.ndarray:
    """Heights (levels,) at which a profile is taken, up to that of the highest pile."""
    return SPACING_MM * np.arange(1, max(2, int(highest_mm / SPACING_MM)) + 1)


def principal(
    means: np.ndarray, most: int = MOST_COMPONENTS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Principal components of profiles (samples, levels): centre (levels,), directions, shares of the variance.

    The directions (levels, components) have length 1 and are orthogonal; at most `most` components are kept.
    """
    centre = means.mean(axis=0)
    _, size, rows = np.linalg.svd(means - centre, full_matrices=False)
    return centre, rows[:most].T, (size**2 / (size**2).sum())[:most]


def study(
    X: np.ndarray,
    samples: np.ndarray,
    runs: pd.DataFrame,
    levels: int,
    targets: Targets,
    space: ParameterSpace,
    settings: Mapping[str, Any],
) -> tuple[dict[str, pd.DataFrame], dict[str, Any]]:
    """Information in the whole profile beside angle and Height: ``components``, ``information`` and a summary.

    X (samples, 6) are parameters, `samples` their numbers. `runs` are good runs: ``sample``, ``aor_deg``, ``height_mm``
    and half-widths [mm] by the number of their level. The Height is one of the targets. `settings` joins the sections
    ``second_responses`` and ``joint_targets``. InputError if fewer points of the prior than ``truths`` meet the
    targets.
    """
    numbers = [
        name for name in dict.fromkeys((*TWO_NUMBERS, *targets.names)) if name in runs
    ]
    widths = runs[list(range(levels))].to_numpy(float)
    means = pd.DataFrame(widths).groupby(runs["sample"].to_numpy()).mean().to_numpy()
    centre, directions, share = principal(means)
    values = np.column_stack(
        [runs[numbers].to_numpy(float), (widths - centre) @ directions]
    )
    known = [
        over_design(column, runs["sample"].to_numpy(), samples) for column in values.T
    ]
    predict, residuals, r2 = _surrogates(X, known, settings)
    kept = [
        k
        for k, column in enumerate(known)
        if k < len(numbers)
        or (column.row["signal_to_noise"] >= NOISY and r2[k] >= WORST_R2)
    ]
    names = [*numbers, *(f"component_{k + 1}" for k in range(directions.shape[1]))]
    correlation = _noise(values, runs["sample"])[np.ix_(kept, kept)]
    within = np.array([known[k].row["sd_within"] for k in kept])
    measured = (
        np.outer(within, within)
        * correlation
        / min(target.repetitions for target in targets)
    )
    errors = np.column_stack([known[k].error for k in kept])
    error = measured + surrogate_covariance(residuals[:, kept], errors, correlation)
    prior = prior_points(space, settings, lambda points: predict(points)[:, kept])
    truths, normal = plausible_truths(
        prior.predicted, [names[k] for k in kept], targets, settings
    )
    place = {names[k]: row for row, k in enumerate(kept)}
    components = [place[name] for name in place if name.startswith("component")]
    two = [place[name] for name in numbers if name in TWO_NUMBERS]
    sets = {name: [place[name]] for name in numbers if name in TWO_NUMBERS}
    sets |= {"both numbers": two, PROFILE: components, BOTH: [*two, *components]}
    rows = []
    for percent in (0.0, float(settings["discrepancy_percent"])):
        for correlated in (
            (0.0, settings["discrepancy_correlation"]) if percent else (0.0,)
        ):
            spread = _discrepancy(
                percent, correlated, centre, directions, numbers, known, settings
            )
            covariance = error + spread[np.ix_(kept, kept)]
            by_set = {
                label: information.averaged(prior, truths, normal, columns, covariance)
                for label, columns in sets.items()
            }
            for label, found in by_set.items():
                gain = found["all"] - by_set["both numbers"]["all"]
                row = {
                    "discrepancy_percent": percent,
                    "discrepancy_correlation": correlated,
                    "set": label,
                    "bits": found["bits"],
                    "bits_se": found["bits_se"],
                    "gain_bits": gain.mean(),
                }
                row["gain_se_bits"] = gain.std(ddof=1) / np.sqrt(len(gain))
                widest = found["widths"] * prior.widths
                row |= {
                    f"width_{name}": width
                    for name, width in zip(space.free, widest, strict=True)
                }
                rows.append(row | {"effective_points": found["effective"]})
    table = [
        {"number": name, "variance_share": part, "kept": k in kept, "r2": r2[k]}
        | known[k].row
        for k, (name, part) in enumerate(
            zip(names, [*[np.nan] * len(numbers), *share], strict=True)
        )
    ]
    summary = {
        "samples": len(X),
        "levels": levels,
        "components": len(components),
        "truths": len(truths),
    }
    return {
        "components": pd.DataFrame(table),
        "information": pd.DataFrame(rows),
    }, summary


def _surrogates(
    X: np.ndarray, known: list[Known], settings: Mapping[str, Any]
) -> tuple[Predict, np.ndarray, list[float]]:
    """All surrogates as one function, their residuals on unseen samples (samples, k), and their R2."""
    fold = (
        np.random.default_rng(settings["seed"]).permutation(len(X)) % settings["folds"]
    )
    models = []
    errors = []
    r2 = []
    for column in known:
        predicted = np.full(len(X), np.nan)
        for k in range(settings["folds"]):
            seen = column._replace(mean=np.where(fold == k, np.nan, column.mean))
            predicted[fold == k] = fitted(X, seen, settings)(X[fold == k])
        predicted[~np.isfinite(column.mean)] = np.nan
        errors.append(predicted - column.mean)
        r2.append(cross_validated_r2(column, predicted))
        models.append(fitted(X, column, settings))
    return (
        lambda points: np.column_stack([model(points) for model in models]),
        np.column_stack(errors),
        r2,
    )


def _noise(values, sample):
    """Correlation of columns from run to run within samples."""
    table = pd.DataFrame(values)
    deviations = table - table.groupby(sample.to_numpy()).transform("mean")
    return np.corrcoef(deviations.to_numpy().T)


def _discrepancy(percent, correlated, centre, directions, numbers, known, settings):
    """S_d of the numbers and of the components."""
    sd = percent / 100 * np.abs(centre)
    if percent > 0:
        sd = np.maximum(sd, settings["smallest_discrepancy"].get("mm", 0.0))
    of_widths = correlated * np.outer(sd, sd)
    np.fill_diagonal(of_widths, sd**2)
    means = np.array([column.row["mean"] for column in known[: len(numbers)]])
    size = discrepancies.sizes(
        numbers, means, percent, settings["smallest_discrepancy"]
    )
    over = np.column_stack([column.mean for column in known[: len(numbers)]])
    k = len(numbers) + directions.shape[1]
    found = np.zeros((k, k))
    found[: len(numbers), : len(numbers)] = discrepancies.covariance(
        numbers, size, over, correlated
    )
    found[len(numbers) :, len(numbers) :] = directions.T @ of_widths @ directions
    return found


def message(tables: Mapping[str, pd.DataFrame], summary: Mapping[str, Any]) -> str:
    """Put the study in words."""
    lines = [f"{summary['components']} components of the profile have a surrogate"]
    for row in tables["information"].itertuples():
        label = response(row.set).label if row.set in TWO_NUMBERS else row.set
        case = f"discrepancy {row.discrepancy_percent:g} %, correlation {row.discrepancy_correlation:g}"
        lines.append(f"{case}: {label}: {row.bits:.2f} ± {row.bits_se:.2f} bits")
    return "\n".join(lines)


def run(
    X: np.ndarray,
    samples: np.ndarray,
    runs: pd.DataFrame,
    levels: int,
    targets: Targets,
    space: ParameterSpace,
    settings: Mapping[str, Any],
    out_dir: str | Path,
) -> str:
    """Write components.csv, information.csv and profiles.json; return the message."""
    tables, summary = study(X, samples, runs, levels, targets, space, settings)
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table)
    write_json(Path(out_dir) / "profiles.json", summary)
    return message(tables, summary)

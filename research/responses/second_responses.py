"""The next measurement to make: how far a further response narrows the posterior of the parameters.

A few numbers do not determine six parameters. For the targets and for each further response r
(`offered`, and those of other bench tests that were run with samples of the design):

signal to noise
    sd between samples over the sd of a run about its sample's mean (`repose.calibrate.variance`)
surrogate
    a network of its own, trained on the means of all samples; its R2 by cross-validation, on the means and with their
    noise taken off
information
    of a set of responses, over the prior: KL of the posterior from the prior, in bits; and for each parameter the bits
    and the width of its 95 % interval over the prior's

These responses are not measured yet, so observations are hypothetical: a plausible truth theta* is a point whose
predicted targets lie in their ranges, and

    y = f(theta*) + e,  e ~ N(0, S_y + S_s + S_d)

    S_y
        Mean of as many repetitions as the targets have, each scattering as runs of one sample do, with their
        correlations.
    S_s
        The surrogates' own error: covariance of the cross-validated residuals, less the noise of the means.
    S_d
        Discrepancy, which no parameters of the model remove: a share of each response's mean, but no less than a
        smallest value in the response's unit, independent; once none, once `discrepancy_percent`, or the response's
        own in `discrepancies`.

The posterior is that of importance sampling (`research.responses.information`).
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import response
from repose.calibrate.targets import Targets
from repose.calibrate.training import compute_corrected_r2
from repose.common.files import write_json, write_table
from research.responses import discrepancies, information
from research.responses.plausible import (
    measured_covariance,
    plausible_truths,
    prior_points,
)
from research.responses.response_sets import (
    base_label,
    minutes_of,
    sets_of,
    source_of,
    ways_of,
)
from research.responses.responses_over_design import (
    Data,
    cross_validated_r2,
    left_out,
    noise_correlation,
    surrogate_covariance,
    trained,
)

NOISY = 0.5  # a response with less signal than this share of its noise is not modelled
WORST_R2 = 0.2  # nor is a response whose surrogate explains less, as after few runs of the drum
FEWEST_EFFECTIVE = 30
WAYS_COLUMNS = (
    "discrepancy_percent",
    "way",
    "responses",
    "minutes",
    "gain_bits",
    "gain_se_bits",
    "bits_a_minute",
)


class Modelled(NamedTuple):
    """The responses that have a surrogate; k is their number."""

    names: list[str]
    # cross-validated (samples,), of every response that was tried
    predicted: dict[str, np.ndarray]
    correlation: np.ndarray  # (k, k), of the noise from run to run
    surrogate: np.ndarray  # (k, k), S_s


def study(
    data: Data, targets: Targets, space: ParameterSpace, settings: Mapping[str, Any]
) -> tuple[dict[str, pd.DataFrame], dict[str, Any]]:
    """Narrowing of the posterior by each set of responses: tables and a summary.

    The tables are ``responses``, ``information``, ``narrowing``, ``ways`` and ``order``. `settings` holds ``points``,
    ``truths``, ``folds``, ``seed``, ``discrepancy_percent``, the surrogates' ``hidden``, ``epochs`` and ``starts``,
    ``smallest_discrepancy`` by unit, and ``minutes`` of work by way; ``discrepancies`` [%] by response are optional.
    InputError if fewer points of the prior than ``truths`` meet all targets.
    """
    model = modelled(data, targets.names, settings)
    prior = prior_of(data, model.names, space, settings)
    truths, normal = plausible_truths(prior.predicted, model.names, targets, settings)
    tables: dict[str, list] = {
        "information": [],
        "narrowing": [],
        "order": [],
        "ways": [],
    }
    sets = sets_of(model.names, targets.responses)
    base_set = base_label(targets.responses)
    least = math.inf
    discrepancy_of = dict(settings.get("discrepancies", {}))
    cases: dict[float, dict[str, float]] = {
        0.0: {},
        float(settings["discrepancy_percent"]): discrepancy_of,
    }
    for percent, apart in cases.items():
        covariance = observed_covariance(
            data, model, targets, percent, apart, settings["smallest_discrepancy"]
        )
        base = None
        for label, chosen in sets.items():
            columns = [model.names.index(name) for name in chosen]
            found = information.averaged(prior, truths, normal, columns, covariance)
            base = found if label == base_set else base
            least = min(least, found["effective"])
            tables["information"].append(_information(percent, label, found, base))
            tables["narrowing"] += _narrowing(percent, label, found, base, space.free)
        for way, responses in ways_of(model.names, targets.names).items():
            columns = [model.names.index(name) for name in (*targets.names, *responses)]
            found = information.averaged(prior, truths, normal, columns, covariance)
            tables["ways"].append(
                _way(percent, way, responses, found, base, settings["minutes"])
            )
        rows = information.in_order(
            prior, truths, normal, model.names, targets.names, covariance
        )
        tables["order"] += [{"discrepancy_percent": percent, **row} for row in rows]
    rows = [
        _row(name, response, model.predicted.get(name), name in model.names)
        for name, response in data.known.items()
    ]
    summary = {
        "samples": len(data.X),
        "physical_piles": int(min(target.repetitions for target in targets)),
        "truths": len(truths),
        "least_effective_points": least,
        "left_out": [name for name in data.known if name not in model.names],
        "modelled": model.names,
        "noise_correlation": model.correlation.round(3).tolist(),
    } | ({"discrepancies": discrepancy_of} if discrepancy_of else {})
    frames = {"responses": pd.DataFrame(rows)} | {
        name: pd.DataFrame(table) for name, table in tables.items()
    }
    if not tables["ways"]:  # every response is a target
        frames["ways"] = pd.DataFrame(columns=list(WAYS_COLUMNS))
    return frames, summary


def modelled(data: Data, base: Sequence[str], settings: Mapping[str, Any]) -> Modelled:
    """Responses with enough signal and a good enough surrogate; those of `base`, the targets, are always kept."""
    known = data.known
    predicted = {
        name: left_out(data.X, response, settings)
        for name, response in known.items()
        if name in base or response.row["signal_to_noise"] >= NOISY
    }
    names = [
        name
        for name, values in predicted.items()
        if name in base or cross_validated_r2(known[name], values) >= WORST_R2
    ]
    correlation = noise_correlation(data.runs, names)
    residuals = np.column_stack([predicted[name] - known[name].mean for name in names])
    errors = np.column_stack([known[name].error for name in names])
    return Modelled(
        names,
        predicted,
        correlation,
        surrogate_covariance(residuals, errors, correlation),
    )


def prior_of(
    data: Data, names: Sequence[str], space: ParameterSpace, settings: Mapping[str, Any]
) -> information.Prior:
    """Draw a Sobol sequence over the prior, with the predictions there of networks trained on all samples."""
    models = [trained(data.X, data.known[name], settings) for name in names]
    return prior_points(
        space,
        settings,
        lambda points: np.column_stack([model.predict(points) for model in models]),
    )


def observed_covariance(
    data: Data,
    model: Modelled,
    targets: Targets,
    percent: float,
    apart: Mapping[str, float] | None = None,
    smallest: Mapping[str, float] | None = None,
) -> np.ndarray:
    """Covariance S_y + S_s + S_d (k, k) of observed and predicted responses.

    The discrepancy is `percent` of each mean, or that of `apart` by response, but not below `smallest` by unit; see
    `research.responses.discrepancies.sizes`.
    """
    means = np.array([data.known[name].row["mean"] for name in model.names])
    percents = {name: (apart or {}).get(name, percent) for name in model.names}
    sd = discrepancies.sizes(model.names, means, percents, smallest or {})
    measured = measured_covariance(data, model.names, model.correlation, targets)
    return measured + model.surrogate + np.diag(sd**2)


def message(tables: Mapping[str, pd.DataFrame], summary: Mapping[str, Any]) -> str:
    """Put the next measurement to make in words."""
    rows = tables["information"]
    rows = rows[rows["discrepancy_percent"] == rows["discrepancy_percent"].iloc[0]]
    single = rows[rows["set"].isin(summary["modelled"])].sort_values(
        "gain_bits", ascending=False, kind="stable"
    )
    lines = [
        f"{response(row.set).label}: {row.gain_bits:.2f} ± {row.gain_se_bits:.2f} bits more"
        for row in single.itertuples()
    ]
    if summary["left_out"]:
        names = ", ".join(response(name).label for name in summary["left_out"])
        lines.append(
            f"left out, too little signal or too few runs for a surrogate: {names}"
        )
    if summary["least_effective_points"] < FEWEST_EFFECTIVE:
        lines.append(
            f"FEW POINTS: a posterior rests on {summary['least_effective_points']:.0f} of the prior's points; raise "
            "second_responses.points"
        )
    return "\n".join(lines)


def _row(name, known, predicted, is_modelled):
    """Make the row of responses.csv of one response."""
    row = {"response": name, "source": source_of(name), **known.row}
    row |= {
        "modelled": is_modelled,
        "r2": None,
        "r2_noise_corrected": None,
        "rmse": None,
    }
    if predicted is not None:
        has_prediction = np.isfinite(predicted)
        y = known.mean[has_prediction]
        p = predicted[has_prediction]
        error = known.error[has_prediction]
        row |= {
            "r2": cross_validated_r2(known, predicted),
            "r2_noise_corrected": compute_corrected_r2(y, p, error),
        }
        row["rmse"] = float(np.sqrt(np.mean((y - p) ** 2)))
    return row


def _information(percent, label, found, base):
    """Make the row of information.csv of one set."""
    row = {
        "discrepancy_percent": percent,
        "set": label,
        "bits": found["bits"],
        "bits_se": found["bits_se"],
    }
    if base is not None:
        gain = found["all"] - base["all"]
        row |= {
            "gain_bits": gain.mean(),
            "gain_se_bits": gain.std(ddof=1) / math.sqrt(len(gain)),
        }
        row["mean_width"] = float(found["widths"].mean())
    return row | {"least_effective_points": found["effective"]}


def _way(percent, way, responses, found, base, minutes):
    """Make the row of ways.csv of one way to get further responses."""
    gain = found["all"] - base["all"]
    work = minutes_of(way, minutes)
    row = {
        "discrepancy_percent": percent,
        "way": way,
        "responses": " ".join(responses),
        "minutes": work,
        "gain_bits": gain.mean(),
        "gain_se_bits": gain.std(ddof=1) / math.sqrt(len(gain)),
    }
    return row | {"bits_a_minute": gain.mean() / work}


def _narrowing(percent, label, found, base, free):
    """Make the rows of narrowing.csv of one set, one for each free parameter."""
    rows = []
    for k, name in enumerate(free):
        row = {
            "discrepancy_percent": percent,
            "set": label,
            "parameter": name,
            "bits": found["parameter_bits"][k],
            "width_ratio": found["widths"][k],
        }
        row["width_ratio_se"] = found["widths_se"][k]
        row["over_base"] = (
            found["widths"][k] / base["widths"][k] if base is not None else None
        )
        rows.append(row)
    return rows


def run(
    data: Data,
    targets: Targets,
    space: ParameterSpace,
    settings: Mapping[str, Any],
    out_dir: str | Path,
) -> str:
    """Write responses.csv, information.csv, narrowing.csv, ways.csv, order.csv and responses.json; return the message.

    `data` come from `further_runs.read`.
    """
    tables, summary = study(data, targets, space, settings)
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table)
    write_json(Path(out_dir) / "responses.json", summary)
    return message(tables, summary)

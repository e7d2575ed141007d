"""Several tests at once: which few of them, bench tests and direct tests of a parameter, narrow the parameters enough.

A bench test is observed with all its responses that can be modelled. A direct test, such as an inclined plane, observes
one parameter itself with a standard deviation. Its information before it is made is computed as in
`research.responses.second_responses`, for plausible truths, with a discrepancy that is correlated within a bench test
(`repose.calibrate.uncertainty.discrepancy`).

All sets of at most `most_tests` tests are ranked in the normal approximation with a linear model; the best of them are
computed again by importance sampling. A set is as good as its widest interval among the `parameters` narrowest ones.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from repose.bench.parameters import PARAMETERS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets
from repose.common.files import write_json, write_table
from research.responses import hidden_truths, information, second_responses
from research.responses.design_surrogates import Surrogates
from research.responses.observables import (
    PILE,
    direct,
    discrepancy_of,
    tests_of,
    with_parameters,
)
from research.responses.plausible import (
    measured_covariance,
    plausible_truths,
    prior_points,
)
from research.responses.responses_over_design import Data

VERIFIED = 12  # sets for importance sampling, beside single tests and pairs
# width of the credible interval of a normal distribution, in standard deviations
NORMAL_WIDTH = float(np.diff(stats.norm.interval(information.CREDIBLE_PROBABILITY))[0])


def approximate_widths(
    prior: information.Prior, columns: Sequence[int], covariance: np.ndarray
) -> np.ndarray:
    """Widths (d,) of the 95 % intervals in the normal approximation with a linear model.

    They are in places, and at most those of the prior. `columns` are the observed numbers; `covariance` (k, k) is of
    all.
    """
    design = np.column_stack([np.ones(len(prior.place)), prior.place])
    slopes = np.linalg.lstsq(design, prior.predicted[:, columns], rcond=None)[0][1:]
    gained = slopes @ np.linalg.solve(covariance[np.ix_(columns, columns)], slopes.T)
    known = np.diag(1.0 / prior.place.var(axis=0))
    return np.minimum(
        NORMAL_WIDTH * np.sqrt(np.diag(np.linalg.inv(known + gained))), prior.widths
    )


def merit(widths: np.ndarray, parameters: int) -> float:
    """Widest interval among the `parameters` narrowest ones."""
    return float(np.sort(widths)[min(parameters, len(widths)) - 1])


def study(
    data: Data, targets: Targets, space: ParameterSpace, settings: Mapping[str, Any]
) -> tuple[dict[str, pd.DataFrame], dict[str, Any]]:
    """Tables ``tests``, ``pairs``, ``sets`` and ``coverage``, and a summary.

    They show the information in single tests, pairs and the best sets, and how often the intervals hold hidden truths.
    `data` has all bench tests; `settings` joins the sections ``second_responses`` and ``joint_targets``. InputError if
    fewer points of the prior than ``truths`` meet all targets.
    """
    surrogates = Surrogates.of(data, targets.names, settings)
    names = surrogates.names
    prior = prior_points(space, settings, surrogates.predict)
    truths, normal = plausible_truths(prior.predicted, names, targets, settings)
    error = measured_covariance(data, names, surrogates.correlation, targets)
    tests = tests_of(
        names,
        error + surrogates.covariance + discrepancy_of(data, names, settings),
        space,
        settings,
    )
    tested = [k for k, name in enumerate(space.free) if direct(name) in tests.columns]
    with_parameters(prior, tested)
    more = np.random.default_rng(settings["seed"] + 1).normal(
        size=(len(truths), len(tested))
    )
    normal = np.hstack([normal, more])

    def information_of(chosen):
        return information.averaged(
            prior, truths, normal, tests.of(chosen), tests.covariance
        )

    count = settings["parameters"]
    wide = settings["width_percent"] / 100
    base = information.averaged(
        prior,
        truths,
        normal,
        [names.index(name) for name in targets.names],
        tests.covariance,
    )
    singles = [
        _row(space, prior, tests, (name,), information_of((name,)), count, wide)
        for name in tests.columns
    ]
    for row, name in zip(singles, tests.columns, strict=True):
        columns = sorted(
            {*tests.of((name,)), *(names.index(name) for name in targets.names)}
        )
        beside = information.averaged(prior, truths, normal, columns, tests.covariance)
        gain = beside["all"] - base["all"]
        row["gain_bits"] = gain.mean()
        row["gain_se_bits"] = gain.std(ddof=1) / math.sqrt(len(gain))
        row["gain_bits_a_minute"] = gain.mean() / tests.minutes[name]
    pairs = [
        _row(space, prior, tests, pair, information_of(pair), count, wide)
        for pair in itertools.combinations(tests.columns, 2)
    ]
    ranked = sorted(
        _sets(tests, settings["most_tests"]),
        key=lambda chosen: _score(prior, tests, chosen, count),
    )
    sets = [
        _row(space, prior, tests, choice, information_of(choice), count, wide)
        for choice in ranked[:VERIFIED]
    ]
    everything = tuple(tests.columns)
    sets.append(
        _row(space, prior, tests, everything, information_of(everything), count, wide)
    )
    frames = {
        "tests": _sorted(singles, "bits", False),
        "pairs": _sorted(pairs, "bits", False),
        "sets": _sorted(sets, "merit", True),
    }
    best = frames["sets"][frames["sets"]["tests"] <= settings["most_tests"]].iloc[0]
    chosen = {"best": tuple(best["set"].split(" + ")), "everything": everything}
    chosen |= {PILE: (PILE,)} if PILE in tests.columns else {}
    coverage = hidden_truths.coverage(data, surrogates, tests, space, settings, chosen)
    frames["coverage"] = coverage
    summary = {
        "samples": len(data.X),
        "truths": len(truths),
        "modelled": list(names),
        "left_out": surrogates.left_out,
        "r2": surrogates.r2,
        "base": list(targets.names),
        "base_bits": base["bits"],
        "best": best["set"],
        "best_merit": float(best["merit"]),
        "met": bool(best["narrow"] >= count),
        "most_tests": settings["most_tests"],
        "parameters": count,
        "width_percent": settings["width_percent"],
        "discrepancy_percent": settings["discrepancy_percent"],
        "discrepancy_correlation": settings["discrepancy_correlation"],
        "sets": sum(1 for _ in _sets(tests, settings["most_tests"])),
        "least_effective_points": float(
            min(frames[table]["effective_points"].min() for table in ("tests", "sets"))
        ),
    }
    return frames, summary


def _sets(tests, most):
    """All sets of one to `most` tests."""
    for size in range(1, min(most, len(tests.columns)) + 1):
        yield from itertools.combinations(tests.columns, size)


def _score(prior, tests, chosen, count):
    """Merit of a set in the normal approximation."""
    return merit(approximate_widths(prior, tests.of(chosen), tests.covariance), count)


def _row(space, prior, tests, chosen, found, count, wide):
    """Make the row of a set: bits, minutes, widths of all parameters."""
    widths = found["widths"] * prior.widths
    approximate = approximate_widths(prior, tests.of(chosen), tests.covariance)
    minutes = sum(tests.minutes[name] for name in chosen)
    row = {
        "set": " + ".join(chosen),
        "tests": len(chosen),
        "minutes": minutes,
        "bits": found["bits"],
        "bits_se": found["bits_se"],
        "bits_a_minute": found["bits"] / minutes,
        "merit": merit(widths, count),
        "merit_approximate": merit(approximate, count),
    }
    row["narrow"] = int((widths < wide).sum())
    row |= {
        f"width_{name}": width for name, width in zip(space.free, widths, strict=True)
    }
    errors = found["widths_se"] * prior.widths
    row |= {
        f"width_se_{name}": error
        for name, error in zip(space.free, errors, strict=True)
    }
    return row | {"effective_points": found["effective"]}


def _sorted(rows, column, ascending):
    """Sort a table by a column."""
    table = pd.DataFrame(rows)
    return table.sort_values(column, ascending=ascending, kind="stable").reset_index(
        drop=True
    )


def message(tables: Mapping[str, pd.DataFrame], summary: Mapping[str, Any]) -> str:
    """Tell the bits of each test and pair, whether so few tests suffice, and how often intervals hold hidden truths."""
    lines = [
        f"{row.set}: {row.bits:.2f} ± {row.bits_se:.2f} bits, {row.gain_bits:.2f} beside the targets"
        for row in tables["tests"].itertuples()
    ]
    pair = tables["pairs"].iloc[0]
    best = tables["sets"].set_index("set").loc[summary["best"]]
    lines.append(
        f"the most informative pair: {pair['set']}, {pair['bits']:.2f} ± {pair['bits_se']:.2f} bits"
    )
    widths = ", ".join(
        f"{name} {100 * best[f'width_{name}']:.0f} %"
        for name in PARAMETERS
        if f"width_{name}" in best.index
    )
    goal = f"{summary['parameters']} intervals below {summary['width_percent']:g} % of their ranges"
    if summary["met"]:
        outcome = f"{summary['best']} brings {goal}"
    else:
        outcome = f"no set of so few tests brings {goal}"
    lines.append(f"{outcome}; nearest is {summary['best']}: {widths}")
    lines += [
        f"hidden truths, {row.set}: {100 * row.coverage:.1f} ± {100 * row.coverage_se:.1f} % of the intervals hold"
        for row in tables["coverage"].query("parameter == 'all'").itertuples()
    ]
    if summary["least_effective_points"] < second_responses.FEWEST_EFFECTIVE:
        lines.append(
            f"FEW POINTS: a posterior rests on {summary['least_effective_points']:.0f} of the prior's points, and its "
            "intervals are too narrow; raise second_responses.points"
        )
    return "\n".join(lines)


def run(
    data: Data,
    targets: Targets,
    space: ParameterSpace,
    settings: Mapping[str, Any],
    out_dir: str | Path,
) -> str:
    """Write tests.csv, pairs.csv, sets.csv, coverage.csv and joint.json; return the message."""
    tables, summary = study(data, targets, space, settings)
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table)
    write_json(Path(out_dir) / "joint.json", summary)
    return message(tables, summary)

"""The report in HTML: the answer, its check against the pile, sliders for other parameters, the method."""

import html
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.bench.parameters import LABELS
from repose.calibrate import card
from repose.calibrate.answer import (
    NOT_AGAIN,
    SAID,
    Check,
    Result,
    in_one_line,
    nearness,
    out_of_reach,
)
from repose.calibrate.designs.latin_hypercube import METHODS
from repose.calibrate.runs import error_of
from repose.calibrate.targets import Target
from repose.calibrate.uncertainty.posterior import LARGEST_R_HAT
from repose.common.files import read_json
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import line_for, line_of
from repose.report.page.html import fill, folded, picture, table, text
from repose.report.page.prediction import is_whole
from repose.report.page.study import CAPTIONS, Results
from repose.stages.card import read as read_card

SURE = 0.95


def share(value: float | None) -> str:
    """Write a probability in words, no more precise than the runs allow; "unknown" for None."""
    if value is None:
        return "unknown"
    return (
        "more than 99 %"
        if value > 0.995
        else "less than 1 %"
        if value < 0.005
        else f"{100 * value:.0f} %"
    )


def answer(study: Results) -> str:
    """Write the parameters, their intervals, and the probability that they meet the targets."""
    kind, words = verdict(study)
    first, _, others = _escaped(words).partition(". ")
    rows = [_parameter_row(study, k) for k in range(len(study.space.names))]
    intervals = [] if study.posterior is None else ["95 % interval", "left open"]
    head = ["parameter", "meaning", "value", *intervals, "searched", "sets found"]
    named = (replace(check, response=check.label) for check in _checks(study))
    near = f"<p>{_escaped(nearness(named))}</p>" if study.number("n_seeds") else ""
    record = study.record
    commit = f", commit {record['commit']}" if record.get("commit") else ""
    made = f"Results of {study.date}, by repose {record.get('repose')}{commit}, on {record.get('processor')}."
    said = {
        "kind": kind,
        "first": first,
        "others": others,
        "origin": html.escape(made),
        "nearness": near,
    }
    said |= {
        "impossible": "".join(f"{one}\n" for one in impossible(study.files)),
        "known": _how_well_known(study),
    }
    return fill(
        "answer.html",
        label=html.escape(study.shown.label),
        table=table(head, rows, "answer"),
        **said,
    )


def _escaped(words: str) -> str:
    """Write the words of a message as HTML."""
    return html.escape(words).replace("+-", "±")


def verdict(study: Results) -> tuple[str, str]:
    """Tell whether the targets are met: a class of the style, and the line that ends a run, with the probability."""
    found = Result(
        label=study.shown.label,
        parameters=dict(zip(study.space.names, study.answer.tolist(), strict=True)),
        feasible=study.summary["feasible"],
        message=study.summary["message"],
        checks=tuple(_checks(study)),
        folder=Path(),
        within=study.within,
        out_of_reach=out_of_reach(study.summary),
        small_run=study.shown.small_run,
    )
    line = in_one_line(found.met, found.checks, found.reason, found.small_run)
    if found.met is None and found.feasible:
        line = line.replace(SAID[None], "targets predicted to be met")
    good = found.feasible and found.met is not False
    kind = (
        ("good" if (study.chance["all"] or 0.0) >= SURE else "fair") if good else "bad"
    )
    return (
        kind,
        f"{line[0].upper()}{line[1:]} {_probability(study) if found.feasible else found.message}",
    )


def _probability(study: Results) -> str:
    """Write the probability that the targets are met, in sentences."""
    chance, k = study.chance["all"], len(study.targets)
    if chance is None:
        return "How probable this is, is unknown: fewer than two runs of these parameters could be measured."
    which = ("the response lies", "both responses lie", f"all {k} responses lie")[
        min(k, 3) - 1
    ]
    judged = "as the surrogate predicts; these parameters were not simulated again"
    if (runs := study.number("n_seeds")) is not None:
        judged = f"judged by {runs:.0f} new simulations with these parameters"
    near = (
        (percent, within)
        for percent, within in study.within.items()
        if within is not None
    )
    nearer = (
        f" Within {percent:g} % of the target{'s' * (k > 1)}: {share(within)}."
        for percent, within in near
    )
    return f"With a probability of {share(chance)} {which} inside the target range, {judged}.{''.join(nearer)}"


def impossible(files: Mapping[str, str]) -> Iterator[str]:
    """Give a paragraph for each angle of the card that piles of these grains cannot have at the targeted Height."""
    for test in read_card(files["card"])["tests"] if "card" in files else ():
        if "reach" in test and not test["reach"]["possible"]:
            yield f'<p class="verdict bad">{_escaped(test["reach"]["sentence"])}</p>'


def _checks(study: Results) -> Iterator[Check]:
    """Give the answer's predicted, simulated and measured responses."""
    runs = study.number("n_seeds")
    status = NOT_AGAIN if runs is None else text(study.row.get("status"))
    for target in study.targets:
        own = target.response
        names = {
            "simulated": own.simulated,
            "standard_error": own.error,
            "predicted": own.predicted,
        }
        numbers = {field: study.number(name) for field, name in names.items()}
        line = line_for(study.shown.config.get("measure"), target.name)
        yield Check.of(target, **numbers, runs=int(runs or 0), status=status, line=line)


def _parameter_row(study: Results, k: int) -> list[Any]:
    """Give the row of one parameter in the answer."""
    space, name = study.space, study.space.names[k]
    if name in space.fixed:
        unknown = [] if study.posterior is None else ["", ""]
        return [
            name,
            LABELS.get(name, name),
            f"{study.answer[k]:.4g}",
            *unknown,
            "fixed",
            "",
        ]
    i = space.free.index(name)
    values, value = study.feasible[name], float(study.answer[k])
    if study.posterior is None:
        interval, shown = [], card.held(space, name, value, value, value)
    else:
        row = study.posterior.loc[name]
        shown = card.held(
            space, name, value, float(row["credible_low"]), float(row["credible_high"])
        )
        interval = [
            f"{shown['low']:.3g} to {shown['high']:.3g}",
            f"{100 * row['width_ratio']:.0f} %",
        ]
    searched, found = (
        f"{space.low[i]:.3g} to {space.high[i]:.3g}",
        f"{values.min():.3g} to {values.max():.3g}",
    )
    return [
        name,
        card.with_remark(LABELS.get(name, name), shown),
        f"{value:.4g}",
        *interval,
        searched,
        found,
    ]


def _how_well_known(study: Results) -> str:
    """Write the meaning of the intervals."""
    intervals, unsettled = "" if study.posterior is None else fill("intervals.html"), ""
    if study.posterior is not None and study.posterior["r_hat"].max() > LARGEST_R_HAT:
        unsettled = '<p class="bad">The intervals are not settled: raise <code>posterior.steps</code>.</p>'
    return fill("known.html", intervals=intervals, unsettled=unsettled)


def check(study: Results) -> str:
    """Write measured, predicted and simulated responses, and the pile."""
    head = [
        "response",
        "measured",
        "target range",
        "predicted",
        "simulated",
        "difference",
        "inside",
    ]
    head = (
        head if study.number("n_seeds") is not None else head[: head.index("simulated")]
    )
    rows = [_response_row(study, target)[: len(head)] for target in study.targets]
    trouble = text(study.row.get("reason"))
    parts = {
        "trouble": f'<p class="note">Of these simulations: {trouble}.</p>'
        if trouble
        else ""
    }
    parts |= {"lines": _lines(study), "pile": _pile(study), "table4": _table4(study)}
    parts |= {
        "table": table(head, rows, "check"),
        "keys": fill("keys.html", blue="the new simulations"),
    }
    return fill("check.html", **parts)


def _lines(study: Results) -> str:
    """Write the answer's piles by every definition of the angle; empty without piles."""
    if not set(MEAN_KEYS.values()) <= set(study.row.index):
        return ""
    measure, rows = study.shown.measure, []
    calibrated = {line_for(measure, name) for name in study.targets.names}
    for name, column in MEAN_KEYS.items():
        line, mean = (
            line_of(measure, name),
            _with_error(study.number(column), study.number(error_of(column)), " deg"),
        )
        rows.append([line, mean, "calibrated" if line in calibrated else ""])
    return f"<h3>The same piles by other lines</h3>\n{table(['line', 'simulated', ''], rows, 'lines')}"


def _with_error(mean: float | None, error: float | None, unit: str = "") -> str:
    """Write a mean with its standard error."""
    return (
        "no result"
        if mean is None or pd.isna(mean)
        else f"{mean:.4g} ± {error or 0:.2g}{unit}"
    )


def _table4(study: Results) -> str:
    """Write the sets simulated again: responses as predicted and as simulated; empty for the answer alone."""
    if len(study.table4) < 2:
        return ""
    sets = [row for _, row in study.table4.iterrows()]
    head, rows = (
        ["set", "role", "runs"],
        [[row.get(key) for key in ("solution", "role", "n_seeds")] for row in sets],
    )
    for one in study.targets.responses:
        head += [
            f"{one.symbol} {word} ({one.unit or '–'})"
            for word in ("predicted", "simulated")
        ]
        for cells, row in zip(rows, sets, strict=True):
            cells += [
                row[one.predicted],
                _with_error(row.get(one.simulated), row.get(one.error)),
            ]
    return f"<h3>Table 4: sets simulated again, mean ± standard error</h3>\n{table(head, rows, 'sets')}"


def _response_row(study: Results, target: Target) -> list[str]:
    """Give the row of one target."""
    response, unit = target.response, target.response.unit
    predicted, simulated, error = map(
        study.number, (response.predicted, response.simulated, response.error)
    )
    away = (
        ""
        if simulated is None
        else f"{100 * (simulated - target.value) / target.whole_value:+.1f} %"
    )
    measured = f"{target.value:.4g} ± {target.sd:.2g} {unit} (n = {target.repetitions})"
    within, found = (
        f"{target.low:g} to {target.high:g} {unit}",
        _with_error(simulated, error, f" {unit}"),
    )
    before = f"{predicted:.4g} {unit}" if predicted is not None else ""
    return [
        response.label,
        measured,
        within,
        before,
        found,
        away,
        share(study.chance[target.name]),
    ]


def _pile(study: Results) -> str:
    """Write the 3-D view beside the photograph, or beside the measured silhouette."""
    pictures, view = (
        _pictures(study, CAPTIONS["pile"]),
        fill("pile.html") if "trajectory" in study.files else "",
    )
    pictures = f"<div>{pictures}</div>" if pictures else ""
    kind = "pair" if pictures and view else "pair alone"
    return f'<div class="{kind}">{view}{pictures}</div>' if pictures or view else ""


def _pictures(study: Results, captions: Mapping[str, str]) -> str:
    """Write the pictures that the study has, with their captions by name."""
    return "".join(
        picture(study.files[name], words)
        for name, words in captions.items()
        if name in study.files
    )


def other_parameters(study: Results) -> str:
    """Write sliders with the surrogate's predictions; empty without a surrogate."""
    if study.surrogate is None:
        return ""
    name = html.escape(study.surrogate.name)
    how = (
        fill("whole.html")
        if is_whole(study.surrogate)
        else fill("curves.html", surrogate=name)
    )
    return fill("sliders.html", how=how, keys=fill("keys.html", blue="the prediction"))


def how_found(study: Results) -> str:
    """Write the steps with their numbers and figures."""
    steps = "".join(f"<li>{html.escape(step)}</li>" for step in _steps(study))
    pictures = _pictures(study, study.captions)
    return fill(
        "found.html",
        steps=steps,
        pictures=fill("pictures.html", pictures=pictures) if pictures else "",
    )


def all_tables(tables: Mapping[str, pd.DataFrame]) -> str:
    """Write the study's tables, each behind its title."""
    shown = "".join(folded(title, table) for title, table in tables.items())
    return f'<div class="screen"><h3>Tables</h3>{shown}</div>' if shown else ""


def _steps(study: Results) -> Iterator[str]:
    """Say the method in sentences."""
    if "steps" in study.summary:
        yield from study.summary["steps"]
        return
    design, free, all_ = (
        study.shown.design,
        study.space.dimensions,
        len(study.space.names),
    )
    searched = (
        f"{free} parameters"
        if free == all_
        else f"{free} of {all_} parameters, the others fixed"
    )
    benches = " and ".join(study.targets.apparatus).replace("_", " ")
    yield f"Design: {design.samples} parameter sets over {searched} ({METHODS[design.method]})."
    simulated = read_json(study.files["dataset_summary"], {"text": str})
    yield f"Simulation of the bench test ({benches}): {simulated['text']}"
    if study.surrogate is not None:
        yield f"Surrogate ({study.surrogate.name.replace('_', ' ')}): {_accuracy(study)}"
    yield f"Search: {study.summary['message']}"
    again = f"{len(study.table4)} of the sets found were simulated again with new seeds"
    yield f"Check: {again}; the answer {study.row.get('n_seeds', 0):.0f} times."


def _accuracy(study: Results) -> str:
    """Write the accuracy of the surrogate on samples that were not used in its training."""
    test = read_json(study.files["metrics"]).get("test") or {}
    parts = []
    for response in study.targets.responses:
        found = test.get(response.name, {})
        if np.isfinite(found.get("rmse") or np.nan):
            parts.append(
                f"{response.label} to {found['rmse']:.2g} {response.unit} (R² {found['r2']:.2f})"
            )
    if not parts:
        return "its accuracy was not tested."
    return f"on samples that it had not learned from, it predicts the {' and the '.join(parts)}."

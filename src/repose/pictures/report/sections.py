"""The report in HTML: the answer, its check against the pile, sliders for other parameters, the method."""

import html
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.chain import card
from repose.chain.answer import NOT_AGAIN, Check, Result, in_one_line, nearness, out_of_reach
from repose.chain.design import METHODS
from repose.core.parameters import LABELS
from repose.core.runs import error_of
from repose.core.targets import Target
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import line_for, line_of
from repose.pictures.report.html import folded, picture, table, text
from repose.pictures.report.prediction import is_whole
from repose.pictures.report.study import PICTURES, Study
from repose.studies.posterior import LARGEST_R_HAT

SURE = 0.95
KEYS = """<p class="note">Green band: the target range. Diamond and its line: the measured mean and its
standard deviation. Blue: {blue}, the line holds the true mean with 95 % probability.</p>"""


def share(value: float | None) -> str:
    """Write a probability in words, no more precise than the runs allow; "unknown" for None."""
    if value is None:
        return "unknown"
    if value > 0.995:
        return "more than 99 %"
    return "less than 1 %" if value < 0.005 else f"{100 * value:.0f} %"


def answer(study: Study) -> str:
    """Write the parameters, their intervals, and the probability that they meet the targets."""
    kind, words = verdict(study)
    first, _, others = html.escape(words).replace("+-", "±").partition(". ")
    rows = [_parameter_row(study, k) for k in range(len(study.space.names))]
    head = ["parameter", "meaning", "value", *_interval_head(study), "searched", "sets found"]
    return "\n".join(
        [
            f"<h1>Contact parameters: {html.escape(study.config['label'])}</h1>",
            f'<p class="verdict {kind}"><b>{first}.</b> {others}</p>',
            *impossible(study.files),
            _origin(study),
            f"<p>{html.escape(nearness(_named(study)).replace('+-', '±'))}</p>" if study.number("n_seeds") else "",
            table(head, rows, "answer"),
            '<p class="buttons screen"><button id="copy" class="act" type="button">Copy the parameters</button></p>',
            _how_well_known(study),
        ]
    )


def _origin(study: Study) -> str:
    """Write the date, version, commit and processor of the results in a line."""
    record = study.record
    commit = f", commit {record['commit']}" if record.get("commit") else ""
    made = f"Results of {study.date}, by repose {record.get('repose')}{commit}, on {record.get('processor')}."
    return f'<p class="note" id="origin">{html.escape(made)}</p>'


def verdict(study: Study) -> tuple[str, str]:
    """Tell whether the targets are met: a class of the style, and the line that ends a run, with the probability."""
    found = Result(
        label=study.config["label"],
        parameters=dict(zip(study.space.names, study.answer.tolist(), strict=True)),
        feasible=study.summary["feasible"],
        message=study.summary["message"],
        checks=tuple(_checks(study)),
        folder=Path(),
        within=study.within,
        out_of_reach=out_of_reach(study.summary),
        small_run=study.config["small_run"],
    )
    line = in_one_line(found.met, found.checks, found.reason, found.small_run)
    good = found.feasible and found.met is not False
    kind = ("good" if (study.chance["all"] or 0.0) >= SURE else "fair") if good else "bad"
    return kind, f"{line[0].upper()}{line[1:]} {_probability(study) if found.feasible else found.message}"


def _probability(study: Study) -> str:
    """Write the probability that the targets are met, in sentences."""
    chance, k = study.chance["all"], len(study.targets)
    if chance is None:
        return "How probable this is, is unknown: fewer than two runs of these parameters could be measured."
    which = ("the response lies", "both responses lie", f"all {k} responses lie")[min(k, 3) - 1]
    runs = study.number("n_seeds")
    judged = "as the surrogate predicts; these parameters were not simulated again"
    if runs is not None:
        judged = f"judged by {runs:.0f} new simulations with these parameters"
    return f"With a probability of {share(chance)} {which} inside the target range, {judged}." + "".join(
        f" Within {percent:g} % of the target{'s' if k > 1 else ''}: {share(within)}."
        for percent, within in study.within.items()
        if within is not None
    )


def impossible(files: Mapping[str, str]) -> Iterator[str]:
    """Give a paragraph for each angle of the card that piles of these grains cannot have at the targeted Height."""
    for test in card.read(files["card"])["tests"] if "card" in files else ():
        if "reach" in test and not test["reach"]["possible"]:
            sentence = html.escape(test["reach"]["sentence"]).replace("+-", "±")
            yield f'<p class="verdict bad">{sentence}</p>'


def _checks(study: Study) -> Iterator[Check]:
    """Give the answer's predicted, simulated and measured responses."""
    runs = study.number("n_seeds")
    status = NOT_AGAIN if runs is None else text(study.row.get("status"))
    for target in study.targets:
        own = target.response
        predicted, simulated, error = map(study.number, (own.predicted, own.simulated, own.error))
        line = line_for(study.config.get("measure"), target.name)
        check = Check.of(target, simulated, error, int(runs or 0), status)
        yield replace(check, predicted=predicted, line=line)


def _named(study: Study) -> Iterator[Check]:
    """Give the checks with their responses in words."""
    return (replace(check, response=check.label) for check in _checks(study))


def _interval_head(study: Study) -> list[str]:
    """Give the head of the column of intervals, if there is one."""
    return [] if study.posterior is None else ["95 % interval", "left open"]


def _parameter_row(study: Study, k: int) -> list[Any]:
    """Give the row of one parameter in the answer."""
    space, name = study.space, study.space.names[k]
    if name in space.fixed:
        unknown = [] if study.posterior is None else ["", ""]
        return [name, LABELS.get(name, name), f"{study.answer[k]:.4g}", *unknown, "fixed", ""]
    i = space.free.index(name)
    values, value = study.feasible[name], float(study.answer[k])
    if study.posterior is None:
        interval, shown = [], card.held(space, name, value, value, value)
    else:
        row = study.posterior.loc[name]
        shown = card.held(space, name, value, float(row["credible_low"]), float(row["credible_high"]))
        interval = [f"{shown['low']:.3g} to {shown['high']:.3g}", f"{100 * row['width_ratio']:.0f} %"]
    searched = f"{space.low[i]:.3g} to {space.high[i]:.3g}"
    return [
        name,
        card.with_remark(LABELS.get(name, name), shown),
        f"{value:.4g}",
        *interval,
        searched,
        f"{values.min():.3g} to {values.max():.3g}",
    ]


def _how_well_known(study: Study) -> str:
    """Write the meaning of the intervals."""
    parts = [
        "<p class='note'>The values are one parameter set. Use it as a whole: other sets agree with the measurements "
        "as well as it does, and values of different sets must not be mixed."
    ]
    if study.posterior is not None:
        parts.append(
            " The 95 % interval follows from the measurements, for each parameter by itself. Where it did not hold the "
            "value, the row says that this lies at a bound of the range, or that the interval is widened. Left open: "
            "the width of the 95 % over the width before any measurement. Near 100 % the measurements do not determine "
            "this parameter."
        )
    parts.append(" Sets found: the span of the sets that the search kept.</p>")
    if study.posterior is not None and study.posterior["r_hat"].max() > LARGEST_R_HAT:
        parts.append('<p class="bad">The intervals are not settled: raise <code>posterior.steps</code>.</p>')
    return "".join(parts)


def check(study: Study) -> str:
    """Write measured, predicted and simulated responses, and the pile."""
    head = ["response", "measured", "target range", "predicted", "simulated", "difference", "inside"]
    rows = [_response_row(study, target) for target in study.targets]
    trouble = text(study.row.get("reason"))
    return "\n".join(
        [
            "<h2>The check against the pile</h2>",
            table(head, rows, "check"),
            '<p class="note">Measured: mean ± standard deviation of the repetitions. Simulated: mean ± standard error '
            "of new simulations that neither the surrogate nor the search had seen. Inside: the probability that "
            "the simulated mean lies in the target range.</p>",
            f'<p class="note">Of these simulations: {trouble}.</p>' if trouble else "",
            '<div id="checks"></div>',
            KEYS.format(blue="the new simulations"),
            _lines(study),
            _pile(study),
            _table4(study),
        ]
    )


def _lines(study: Study) -> str:
    """Write the answer's piles by every definition of the angle; empty without piles."""
    if not set(MEAN_KEYS.values()) <= set(study.row.index):
        return ""
    measure, rows = study.config["measure"], []
    calibrated = {line_for(measure, name) for name in study.targets.names}
    for name, column in MEAN_KEYS.items():
        mean, error = study.number(column), study.number(error_of(column))
        shown = "no result" if mean is None else f"{mean:.4g} ± {error or 0:.2g} deg"
        line = line_of(measure, name)
        rows.append([line, shown, "calibrated" if line in calibrated else ""])
    return f"<h3>The same piles by other lines</h3>\n{table(['line', 'simulated', ''], rows, 'lines')}"


def _table4(study: Study) -> str:
    """Write the sets simulated again: responses as predicted and as simulated; empty for the answer alone."""
    if len(study.table4) < 2:
        return ""
    head, columns = ["set", "role", "runs"], []
    for response in study.targets.responses:
        head += [f"{response.symbol} {word} ({response.unit or '–'})" for word in ("predicted", "simulated")]
        columns.append((response.predicted, response.simulated, response.error))
    rows = []
    for _, row in study.table4.iterrows():
        cells = [row.get(key) for key in ("solution", "role", "n_seeds")]
        for predicted, simulated, error in columns:
            shown = f"{row[simulated]:.4g} ± {row[error]:.2g}" if pd.notna(row.get(simulated)) else "no result"
            cells += [row[predicted], shown]
        rows.append(cells)
    return f"<h3>Table 4: sets simulated again, mean ± standard error</h3>\n{table(head, rows, 'sets')}"


def _response_row(study: Study, target: Target) -> list[str]:
    """Give the row of one target."""
    response, unit = target.response, target.response.unit
    predicted, simulated, error = (
        study.number(column) for column in (response.predicted, response.simulated, response.error)
    )
    shown = "no result" if simulated is None else f"{simulated:.4g} ± {error or 0:.2g} {unit}"
    away = "" if simulated is None else f"{100 * (simulated - target.value) / target.whole_value:+.1f} %"
    return [
        response.label,
        f"{target.value:.4g} ± {target.sd:.2g} {unit} (n = {target.repetitions})",
        f"{target.low:g} to {target.high:g} {unit}",
        f"{predicted:.4g} {unit}" if predicted is not None else "",
        shown,
        away,
        share(study.chance[target.name]),
    ]


def _pile(study: Study) -> str:
    """Write the 3-D view beside the photograph, or beside the measured silhouette."""
    files, beside = study.files, ""
    if "photograph" in files:
        beside += picture(files["photograph"], "The physical pile")
    if "overlay" in files:
        words = "How the simulated pile was measured: its outline, height and angle"
        beside += picture(files["overlay"], words)
    beside = f"<div>{beside}</div>" if beside else ""
    if "trajectory" not in files:
        return f'<div class="pair alone">{beside}</div>' if beside else ""
    buttons = "".join(
        f'<button class="act quiet" type="button" id="look-{name}">{words}</button>'
        for name, words in (("side", "From the side"), ("above", "From above"), ("pour", "With the funnel"))
    )
    keys = "Arrow keys turn it, plus and minus zoom, 0 puts it back."
    view = f"""<div><div id="view"><canvas id="pile" tabindex="0" role="application"
aria-label="The simulated pile in 3-D. {keys}"></canvas></div>
<p class="buttons screen">{buttons}</p>
<p class="buttons screen"><button class="act" type="button" id="play">Play the pour</button>
<input type="range" id="time" min="0" max="1" step="1" aria-label="Time of the pour"><output id="clock"></output></p>
<p class="note">The simulated pile of these parameters.<span class="screen"> Drag to turn it. {keys} The slider goes
through the pouring.</span></p></div>"""
    return f'<div class="pair{"" if beside else " alone"}">{view}{beside}</div>'


def other_parameters(study: Study) -> str:
    """Write sliders with the surrogate's predictions; empty without a surrogate."""
    if study.surrogate is None:
        return ""
    if is_whole(study.surrogate):
        how = (
            "The network predicts the simulated means, or the mean of several networks does; the error comes from the "
            "Bayesian training, with the disagreement of the networks."
        )
    else:
        how = (
            f"The surrogate ({study.surrogate.name}) was evaluated beforehand along each parameter through the answer: "
            "moving one slider puts the others back."
        )
    return f"""<div class="screen"><h2>Other parameters</h2>
<p>Move a parameter and see what the surrogate predicts, without a simulation. {html.escape(how)}</p>
<div class="try"><div><div id="sliders"></div>
<p class="buttons"><button id="home" class="act quiet" type="button">Back to the answer</button></p></div>
<div id="predictions" aria-live="polite"></div></div>
{KEYS.format(blue="the prediction")}</div>"""


def how_found(study: Study) -> str:
    """Write the steps with their numbers and figures."""
    steps = "".join(f"<li>{html.escape(step)}</li>" for step in _steps(study))
    pictures = "".join(picture(study.files[name], caption) for name, caption in PICTURES.items() if name in study.files)
    hint = '<p class="note">A click on a figure opens it large.</p>'
    shown = f'{hint}<div class="pictures">{pictures}</div>' if pictures else ""
    return f'<div class="screen"><h2>How it was found</h2>\n<ol class="steps">{steps}</ol>\n{shown}</div>'


def all_tables(tables: Mapping[str, pd.DataFrame]) -> str:
    """Write the study's tables, each behind its title."""
    shown = "".join(folded(title, table) for title, table in tables.items())
    return f'<div class="screen"><h3>Tables</h3>{shown}</div>' if shown else ""


def _steps(study: Study) -> Iterator[str]:
    """Say the method in sentences."""
    if "steps" in study.summary:
        yield from study.summary["steps"]
        return
    config, row = study.config, study.row
    open_ = study.space.dimensions
    free = (
        f"{open_} parameters"
        if open_ == len(study.space.names)
        else f"{open_} of {len(study.space.names)} parameters, the others fixed"
    )
    benches = " and ".join(study.targets.apparatus).replace("_", " ")
    yield f"Design: {config['design']['samples']} parameter sets over {free} ({METHODS[config['design']['method']]})."
    yield f"Simulation of the bench test ({benches}): {study.dataset_summary['text']}"
    if study.surrogate is not None:
        yield f"Surrogate ({study.surrogate.name.replace('_', ' ')}): {_accuracy(study)}"
    yield f"Search: {study.summary['message']}"
    again = f"{len(study.table4)} of the sets found were simulated again with new seeds"
    yield f"Check: {again}; the answer {row.get('n_seeds', 0):.0f} times."


def _accuracy(study: Study) -> str:
    """Write the accuracy of the surrogate on samples that were not used in its training."""
    test: dict[str, Any] = study.metrics.get("test") or {}
    parts = [
        f"{response.label} to {test[response.name]['rmse']:.2g} {response.unit} (R² {test[response.name]['r2']:.2f})"
        for response in study.targets.responses
        if response.name in test and np.isfinite(test[response.name].get("rmse") or np.nan)
    ]
    if not parts:
        return "its accuracy was not tested."
    return f"on samples that it had not learned from, it predicts the {' and the '.join(parts)}."

"""Describe the answer of a strategy in tables and sentences."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.bounds import find_near_bounds
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.strategies.base import Answer
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.targets import Targets
from repose.common.files import StrPath, write_json, write_table
from repose.common.numbers import format_significant


def describe_answer(
    answer: Answer, space: ParameterSpace, targets: Targets
) -> dict[str, Any]:
    """Collect facts about an answer, for a file that is read when it is checked.

    Parameters
    ----------
    answer : Answer
        The answer.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        - ``feasible``: whether the answer is predicted inside all ranges
        - ``message``: a sentence that explains this
        - ``predicted_error``: standard errors (k,) of the predicted responses
        - ``solutions``: the result of `tabulate_solutions`
        - ``near_bounds``: the result of `find_near_bounds`; empty without a model
        - ``simulated``: numbers of the samples that already simulated the answer
    """
    predicted = answer
    parameters_near_bounds = []
    if answer.model is not None:
        # The mean of a simulated answer comes from its runs instead of the model.
        if answer.simulated:
            predicted = _predict_again(answer, answer.model)
        values = dict(zip(space.names, answer.values.tolist(), strict=True))
        parameters_near_bounds = find_near_bounds(answer.model, values, space)
    # A strategy may have added a note that belongs to the message.
    note = answer.notes.get("note", "")
    feasible, message = judge_answer(predicted, targets, note)
    return {
        "feasible": feasible,
        "message": message,
        "predicted_error": predicted.error,
        "solutions": tabulate_solutions(predicted, feasible, space, targets),
        "near_bounds": parameters_near_bounds,
        "simulated": answer.simulated,
    }


def _predict_again(answer: Answer, model: Predictor) -> Answer:
    """Return a copy of an answer whose mean and covariance are predicted by its model.

    The mean of a simulated answer is that of its runs. The check compares these runs
    with the model, so the tables need the prediction of the model.
    """
    point = answer.values[None]
    return replace(
        answer,
        mean=model.predict(point)[0],
        covariance=model.covariance(point)[0],
    )


def judge_answer(answer: Answer, targets: Targets, note: str = "") -> tuple[bool, str]:
    """Judge whether the predicted responses of an answer lie inside all ranges.

    Parameters
    ----------
    answer : Answer
        Its `mean` has the predicted responses.
    targets : Targets
        The targets of the study, with their ranges.
    note : str, optional
        Text that is added to the message.

    Returns
    -------
    feasible : bool
        Whether all responses lie inside their ranges.
    message : str
        Sentence with the prediction and the ranges, followed by the note.
    """
    is_inside = (answer.mean >= targets.low) & (answer.mean <= targets.high)
    feasible = bool(is_inside.all())
    predicted = targets.format_with_units(
        [format_significant(value) for value in answer.mean]
    )
    ranges = targets.format_with_units(
        [
            f"{format_significant(target.low)}-{format_significant(target.high)}"
            for target in targets
        ]
    )
    where = "inside" if feasible else "NOT inside"
    message = f"The answer is predicted {predicted}, {where} {ranges}. {note}"
    return feasible, message.rstrip()


def tabulate_solutions(
    answer: Answer, feasible: bool, space: ParameterSpace, targets: Targets
) -> pd.DataFrame:
    """Make the table of solutions: the answer, and the other parameter sets after it.

    Parameters
    ----------
    answer : Answer
        The answer.
    feasible : bool
        Whether the responses of the answer are predicted inside all ranges, as
        `judge_answer` returns it. A strategy chooses only other sets that are.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.

    Returns
    -------
    pandas.DataFrame
        A row for each solution: `solution` (its number from 1), the parameters, the
        predicted responses, `feasible`, and `representative` (True for the answer).
    """
    parameter_sets = np.vstack([answer.values, answer.others])
    table = pd.DataFrame(parameter_sets, columns=list(space.names))
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table[list(targets.predicted)] = np.vstack([answer.mean, answer.others_mean])
    table["feasible"] = [feasible] + [True] * len(answer.others)
    # The answer comes first.
    table["representative"] = table["solution"] == 1
    return table


def write_notes(
    notes: Mapping[str, Any], files: Iterable[str], out_dir: StrPath
) -> None:
    """Write notes of an answer into a folder.

    Parameters
    ----------
    notes : mapping
        Tables and mappings by name, as in `Answer`.
    files : iterable of str
        The name of each note with its ending, as in `Strategy.files`.
    out_dir : path
        Folder for the files.
    """
    for file in files:
        path = Path(out_dir) / file
        note = notes[path.stem]
        if path.suffix == ".csv":
            write_table(path, pd.DataFrame(note))
        else:
            write_json(path, note)


def select_separated(unit_points: np.ndarray, settings: MigaSettings) -> np.ndarray:
    """Choose points that are at least a minimum distance apart.

    Parameters
    ----------
    unit_points : numpy.ndarray, (n, d)
        Points of the unit cube, the best first.
    settings : MigaSettings
        Its key ``distance`` is the minimum distance. The unit is half the width of a
        range, because the search has the coordinates -1 to 1. At most ``solutions``
        points are chosen.

    Returns
    -------
    numpy.ndarray of int
        Row numbers of the chosen points. A point is chosen if it keeps the distance
        from all points chosen before it.
    """
    from scipy.spatial.distance import cdist

    rows: list[int] = []
    for k, point in enumerate(unit_points):
        # A range of a parameter has the length 1 in the unit cube, so the factor 2
        # gives a distance in half ranges.
        if (
            not rows
            or 2 * cdist(unit_points[rows], point[None]).min() >= settings.distance
        ):
            rows.append(k)
        if len(rows) == settings.solutions:
            break
    return np.array(rows, dtype=int)

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
    """Describe an answer, for a file that is read when the answer is checked.

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
        ``feasible``, whether the answer is predicted to meet the targets; ``message``,
        a sentence that explains this; ``predicted_error``, the standard errors (k,) of
        the predicted responses; ``solutions``, the result of `tabulate_solutions`;
        ``near_bounds``, the result of `find_near_bounds`; ``simulated``, the numbers of
        the samples that already simulated the answer.
    """
    predicted = answer
    parameters_near_bounds = []
    if answer.model is not None:
        if answer.simulated:
            predicted = _predict_again(answer, answer.model)
        values = dict(zip(space.names, answer.values.tolist(), strict=True))
        parameters_near_bounds = find_near_bounds(answer.model, values, space)
    feasible, message = judge_answer(predicted, targets, answer.notes.get("note", ""))
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
    """Judge whether an answer is predicted inside all ranges.

    Returns
    -------
    feasible : bool
        Whether the answer is predicted inside all ranges.
    message : str
        Sentence with the prediction and the ranges, followed by the note.
    """
    is_inside = (answer.mean >= targets.low) & (answer.mean <= targets.high)
    feasible = bool(is_inside.all())
    predicted = targets.in_words([format_significant(value) for value in answer.mean])
    ranges = targets.in_words([f"{target.low:g}-{target.high:g}" for target in targets])
    where = "inside" if feasible else "NOT inside"
    message = f"The answer is predicted {predicted}, {where} {ranges}. {note}"
    return feasible, message.rstrip()


def tabulate_solutions(
    answer: Answer, feasible: bool, space: ParameterSpace, targets: Targets
) -> pd.DataFrame:
    """Make the table of the answer and of the other parameter sets.

    Parameters
    ----------
    answer : Answer
        The answer.
    feasible : bool
        Whether the answer is predicted inside all ranges. The other sets always are.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.

    Returns
    -------
    pandas.DataFrame
        `solution` from 1, parameters, predicted responses, `feasible`,
        `representative`.
    """
    sets = np.vstack([answer.values, answer.others])
    table = pd.DataFrame(sets, columns=list(space.names))
    table.insert(0, "solution", np.arange(1, len(table) + 1))
    table[list(targets.predicted)] = np.vstack([answer.mean, answer.others_mean])
    table["feasible"] = [feasible] + [True] * len(answer.others)
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


def select_separated(unit: np.ndarray, section: MigaSettings) -> np.ndarray:
    """Choose points that are at least a certain distance apart.

    Parameters
    ----------
    unit : numpy.ndarray, (n, d)
        Points of the unit cube, the best first.
    section : MigaSettings
        Its key ``distance`` is the least distance, in half ranges. At most
        ``solutions`` points are chosen.

    Returns
    -------
    numpy.ndarray of int
        Row numbers of the chosen points. A point is chosen if it keeps the distance
        from all points chosen before it.
    """
    from scipy.spatial.distance import cdist

    rows: list[int] = []
    for k, point in enumerate(unit):
        # A range of a parameter has the length 1 in the unit cube, so the factor 2
        # gives a distance in half ranges.
        if not rows or 2 * cdist(unit[rows], point[None]).min() >= section.distance:
            rows.append(k)
        if len(rows) == section.solutions:
            break
    return np.array(rows, dtype=int)

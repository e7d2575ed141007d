"""Write the report of a calibration whose simulator is the user's own program."""

import io
import os
from datetime import date

from repose.calibrate.calibration import Calibration
from repose.calibrate.runs import name_error_column
from repose.common import provenance
from repose.common.files import convert_to_path
from repose.report.figures import own, style
from repose.report.page import captions, page
from repose.report.page.study import Results

# Key of an answer's note that contains the table of the intervals of its solutions.
INTERVALS_KEY = "intervals"


def write(calibration: Calibration, out_path: str | os.PathLike[str]) -> None:
    """Write the report of a calibration as one HTML file.

    The calibration is first converted to the results that the report of any study has.

    Parameters
    ----------
    calibration : Calibration
        The outcome of a study, with its answer.
    out_path : path
        The file to write.

    Raises
    ------
    InputError
        If `out_path` is not a path.
    """
    out_path = convert_to_path("path", out_path)
    study = calibration.study
    result = calibration.as_answer()
    # The first row of the solutions is the answer. It is checked here in place of sets
    # that are simulated again.
    answer = calibration.solutions[:1].copy()
    if calibration.check is not None:
        means = calibration.summarise_check()
        answer["n_seeds"] = means["n_seeds"]
        answer["status"] = means["status"]
        for response in study.targets.responses:
            answer[response.simulated] = means[response.name]
            answer[response.standard_error] = means[name_error_column(response.name)]
    for response in study.targets.responses:
        if response.name in calibration.optimism:
            optimism = calibration.optimism[response.name]
            answer[response.optimism] = optimism["optimism"]
            answer[response.optimism_error] = optimism["optimism_se"]
    results = Results(
        label=study.settings.label,
        is_small_run=False,
        targets=study.targets,
        parameters=study.parameters,
        answer_row=answer.iloc[0],
        probability=calibration.compute_target_probabilities(),
        probability_within=result.within,
        posterior=calibration.posterior.parameters.set_index("parameter"),
        surrogate=calibration.model,
        solutions=calibration.solutions,
        checked_sets=answer,
        samples=calibration.samples,
        summary=calibration.summary,
        date=date.today().isoformat(),
        origin=provenance.describe_machine(),
        files=_draw_figures(calibration),
        runs_of_answer=[]
        if calibration.check is None
        else calibration.check.to_dict("records"),
        captions=captions.OWN_SIMULATOR_FIGURES,
    )
    tables = {
        "Simulated samples": calibration.samples,
        "Parameter sets found": calibration.solutions,
    }
    notes = calibration.answer.notes
    if INTERVALS_KEY in notes:
        tables["Span of the sets found"] = notes[INTERVALS_KEY]
    page.write_report_of_results(results, tables, out_path)


def _draw_figures(calibration: Calibration) -> dict[str, io.BytesIO]:
    """Draw the figures of a calibration as files in memory, by name."""
    files = {}
    with style.applied():
        for name, part in own.list_figures(calibration).items():
            figure = style.new_figure(style.PAGE, part.height)
            part.draw(figure)
            files[name] = style.encode(figure)
    return files

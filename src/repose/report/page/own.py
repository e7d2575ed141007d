"""The report of a study with a simulator of the user's own."""

import os
from datetime import date

from repose.calibrate.answer import WITHIN
from repose.calibrate.calibration import Calibration
from repose.common import provenance
from repose.common.files import path_of
from repose.report.figures import own, style
from repose.report.page import page
from repose.report.page.study import CAPTIONS, Results


def write(calibration: Calibration, out_path: str | os.PathLike[str]) -> None:
    """Write the report; InputError for what is no path."""
    out_path = path_of("path", out_path)
    files = {}
    with style.applied():
        for name, (height, draw) in own.parts(calibration).items():
            figure = style.new_figure(style.PAGE, height)
            draw(figure)
            files[name] = style.encoded(figure)
    shown = Results(
        shown=own.shown(calibration), row=calibration.solutions.iloc[0],
        chance=dict.fromkeys(calibration.study.targets.names) | {"all": calibration.probability["inside"]},
        within={percent: calibration.probability[column] for percent, column in WITHIN.items()},
        posterior=calibration.posterior.parameters.set_index("parameter"), surrogate=calibration.model,
        feasible=calibration.solutions, table4=calibration.solutions[:1], dataset=calibration.samples,
        summary=calibration.summary, date=date.today().isoformat(), record=provenance.machine(), files=files,
        captions=CAPTIONS["own"],
    )  # fmt: skip
    tables = {
        "Simulated samples": calibration.samples,
        "Parameter sets found": calibration.solutions,
    }
    page.write_study(shown, tables, out_path)

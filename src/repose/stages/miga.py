"""The stage `miga`: search for parameter sets whose predictions meet the targets."""

from pathlib import Path
from typing import Any

from repose.calibrate import expected_loss
from repose.calibrate.bounds import find_near_bounds
from repose.calibrate.inversion import invert
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.responses import Definitions, reject_other_definitions
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.surrogates import load
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.common.files import StrPath, read_table, write_json, write_table

# Columns of the published intervals of the parameters.
INTERVAL_COLUMNS = ("low", "high", "dispersion_percent")


def find_solutions(
    surrogate_json: StrPath,
    out_dir: StrPath,
    *,
    parameters: ParameterSpace,
    targets: Targets,
    definitions: Definitions,
    settings: MigaSettings,
    table3_csv: StrPath | None = None,
    support: Support | None = None,
    source: object = "configuration",
) -> dict[str, Any]:
    """Find parameter sets that meet the targets, and write them with their intervals.

    The search uses the surrogate, a function that predicts the responses of a parameter
    set. It is called an inversion, because it goes from responses to parameters.

    Parameters
    ----------
    surrogate_json : path
        The surrogate that the stage `network` has written.
    out_dir : path
        Folder for feasible.csv, intervals.csv, history.csv and summary.json.
    parameters : ParameterSpace
        The ranges to search.
    targets : Targets
        The responses to meet.
    definitions : mapping
        How the configuration defines these responses.
    settings : MigaSettings
        The section `miga`.
    table3_csv : path, optional
        Published intervals, which are listed next to those of the search.
    support : Support, optional
        Region that the samples cover. Parameter sets outside it get a warning.
    source : object, optional
        File of the configuration, for error messages.

    Returns
    -------
    dict
        The content of summary.json.

    Raises
    ------
    InputError
        If the surrogate has other responses or definitions.
    """
    surrogate = load(surrogate_json, targets.names)
    reject_other_definitions(
        surrogate.definitions, surrogate_json, expected=definitions, source=source
    )
    # Read the published intervals before the search, which takes minutes.
    published = None
    if table3_csv is not None:
        published = read_table(table3_csv, ("parameter", *INTERVAL_COLUMNS))

    inversion = invert(
        surrogate, parameters, targets=targets, settings=settings, support=support
    )

    intervals = inversion.intervals
    if published is not None:
        # The intervals of the search have the names of the parameters in the column
        # `variable`, the published ones in the column `parameter`.
        published_intervals = published.set_index("parameter")[list(INTERVAL_COLUMNS)]
        intervals = intervals.join(
            published_intervals.add_prefix("published_"), on="variable"
        )

    # The answer is the representative solution. If the surrogate knows the errors of
    # its predictions, assess the answer by the distribution of these errors, too, and
    # list the parameters that lie near a bound of their range.
    summary = inversion.summary
    answer = summary["representative"]
    if surrogate.can_predict_errors:
        summary["representative_judged"] = expected_loss.assess_by_errors(
            surrogate, answer, targets=targets, names=parameters.names
        )
        summary["near_bounds"] = find_near_bounds(surrogate, answer, parameters)

    out = Path(out_dir)
    write_table(out / "feasible.csv", inversion.solutions)
    write_table(out / "intervals.csv", intervals)
    write_table(out / "history.csv", inversion.history)
    write_json(out / "summary.json", summary)
    return summary

"""The stage `network`: train a surrogate of the simulator on the table of samples."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from repose.calibrate.dataset_files import read_definitions
from repose.calibrate.responses import Definitions, reject_other_definitions
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Targets
from repose.calibrate.training import train_surrogate
from repose.common.files import StrPath, write_json, write_table
from repose.stages.parameter_sets import list_parameters
from repose.stages.tables import read_dataset, read_runs


def write_surrogate(  # noqa: PLR0913  (tables, and what the study says about them)
    dataset_csv: StrPath,
    runs_csv: StrPath,
    out_dir: StrPath,
    *,
    targets: Targets,
    definitions: Definitions,
    surrogate_kind: str,
    settings: NetworkSettings,
    parameter_names: Sequence[str] | None = None,
    scale: Mapping[str, str] | None = None,
    source: object = "configuration",
) -> dict[str, Any]:
    """Train a surrogate of the simulator, and write it with its predictions.

    A surrogate is a function that predicts the responses of a parameter set. The tables
    are checked before the training.

    Parameters
    ----------
    dataset_csv, runs_csv : path
        Table of samples, and table of their single runs.
    out_dir : path
        Folder for network.json (the surrogate), metrics.json (how well it fits),
        predictions.csv (its predictions for the samples) and starts.csv (the result of
        each random start of the training).
    targets : Targets
        The responses to learn.
    definitions : mapping
        How the configuration defines these responses. If it is empty, the surrogate
        stores the definitions of the table instead.
    surrogate_kind : str
        Name of the kind of surrogate.
    settings : NetworkSettings
        The section `network`.
    parameter_names : sequence of str, optional
        Names of the parameters, if another program simulates the study. By default,
        they are the contact parameters of repose that the table has.
    scale : mapping, optional
        Scale of each parameter whose scale is not linear: the name of the scale, by
        name of the parameter.
    source : object, optional
        File of the configuration, for error messages.

    Returns
    -------
    dict
        The content of metrics.json.

    Raises
    ------
    InputError
        If the tables are damaged, use other definitions or have too few samples.
    """
    dataset = read_dataset(dataset_csv, targets, parameter_names)
    runs = read_runs(runs_csv, targets, dataset=dataset, dataset_csv=dataset_csv)
    dataset_definitions, summary_json = read_definitions(dataset_csv)
    reject_other_definitions(
        dataset_definitions, summary_json, expected=definitions, source=source
    )
    training = train_surrogate(
        dataset,
        runs,
        targets=targets,
        settings=settings,
        names=list_parameters(dataset, parameter_names),
        definitions=definitions or dataset_definitions,
        # Errors of the training concern the samples, so they name this table.
        source=dataset_csv,
        surrogate=surrogate_kind,
        scale=scale,
    )
    out = Path(out_dir)
    training.model.save(out / "network.json")
    write_json(out / "metrics.json", training.metrics)
    write_table(out / "predictions.csv", training.predictions)
    write_table(out / "starts.csv", training.starts)
    return training.metrics

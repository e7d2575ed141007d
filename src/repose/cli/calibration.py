"""Subcommands of the calibration, from the table of samples to the simulated answer."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.options import DATASET, FEASIBLE, NETWORK, OPTIMISM, RUNS, SAMPLES
from repose.cli.registry import Option, subcommand
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.stages.parameter_sets import list_job_files

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.surrogates.support import Support

SUPPORT = Option(
    "--dataset",
    help="dataset.csv; with it solutions outside its samples carry a warning",
)


def _list_jobs(args: argparse.Namespace) -> list[Path]:
    """List the files of the jobs; a folder stands for the files of all its samples."""
    return list_job_files(args.jobs, args.samples)


@subcommand(
    Option(
        "jobs",
        nargs="+",
        find_files=_list_jobs,
        help="JSON files that the subcommand measure_runs or heap wrote, or their folder",
    ),
    SAMPLES.with_changes(help="the design"),
    Option("--prefix", default="", help="put before the names of the tables"),
    out="results",
)
def dataset(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Collect all jobs in one table.

    The table has the responses with their standard errors, and the failures with their
    reasons.

    Examples
    --------
    $ repose stage dataset results/heaps --samples results/design/samples.csv --out results
    """
    from repose.stages import dataset

    dataset.write_dataset(
        args.samples,
        _list_jobs(args),
        study.targets,
        study.definitions,
        args.out,
        args.prefix,
        parameter_names=study.parameter_names,
    )


@subcommand(DATASET, RUNS, out="results/network")
def network(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Train the surrogate, by default the BP network with Bayesian regularisation.

    Examples
    --------
    $ repose stage network --dataset results/dataset.csv --runs results/runs.csv
    """
    from repose.calibrate.training import describe_training
    from repose.stages import network

    metrics = network.write_surrogate(
        args.dataset,
        args.runs,
        args.out,
        targets=study.targets,
        definitions=study.definitions,
        surrogate_kind=study.settings.surrogate,
        settings=study.settings.network,
        parameter_names=study.parameter_names,
        scale=study.parameters.scale,
        source=args.config,
    )
    print(describe_training(metrics))


@subcommand(NETWORK, SUPPORT, out="results/miga")
def miga(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Invert the network with the multi-island genetic algorithm (Eq. 11-12).

    Examples
    --------
    $ repose stage miga --network results/network/network.json
    """
    from repose.stages import miga

    summary = miga.find_solutions(
        args.network,
        args.out,
        parameters=study.parameters,
        targets=study.targets,
        definitions=study.definitions,
        settings=study.settings.miga,
        table3_csv=study.published("table3.csv"),
        support=_find_support(args, study),
        source=args.config,
    )
    print(summary["message"])


@subcommand(NETWORK, DATASET, RUNS, out="results/miga")
def optimism(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Estimate by how much the predictions of the search are too favourable.

    Examples
    --------
    $ repose stage optimism --network results/network/network.json --dataset results/dataset.csv
    """
    from repose.stages import optimism

    table = optimism.write_optimism(
        args.network,
        args.dataset,
        args.runs,
        Path(args.out) / "optimism.csv",
        parameters=study.parameters,
        targets=study.targets,
        settings=study.settings.miga,
        n_solutions=study.settings.validation.solutions,
        parameter_names=study.parameter_names,
    )
    print(table.to_string(index=False))


@subcommand(FEASIBLE, out="results/validation")
def solutions(args: argparse.Namespace, study: PipelineConfig) -> None:
    """List the parameter sets to simulate again: the representative solution and others.

    Examples
    --------
    $ repose stage solutions --feasible results/miga/feasible.csv
    """
    from repose.stages import validate

    validate.write_solutions(
        args.feasible,
        study.parameters,
        study.targets,
        study.settings.validation.solutions,
        Path(args.out) / "solutions.csv",
    )


@subcommand(out="results/validation")
def published_solutions(args: argparse.Namespace, study: PipelineConfig) -> None:
    """List the published parameter sets to simulate.

    Examples
    --------
    $ repose stage published_solutions --out results/validation
    """
    from repose.stages import validate

    published_csv = _require_published_table(args, study)
    out = Path(args.out) / "published_solutions.csv"
    validate.write_published_solutions(published_csv, study.parameters.names, out)


@subcommand(
    Option(
        "jobs", nargs="*", help="JSON files that measure_runs wrote, one for each set"
    ),
    out="results",
)
def published_sets(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Collect the runs of the published parameter sets in one table.

    The table also has the published values of their piles.

    Examples
    --------
    $ repose stage published_sets results/validation/heaps/1??.json --out results
    """
    from repose.common import provenance
    from repose.config import dependencies
    from repose.measure.saved_pours import POURS_ENDING
    from repose.stages import validate

    # Check that runs and measurements were made with this engine and scene. NAME.json is
    # the measurement of the runs in NAME.pours.json, which is in the same folder.
    measured_jobs = [Path(job) for job in args.jobs]
    saved_jobs = [path.with_suffix(POURS_ENDING) for path in measured_jobs]
    outdated_files = dependencies.find_outdated_files(
        study.config, [*measured_jobs, *saved_jobs]
    )
    if outdated_files:
        raise InputError(
            outdated_files[0],
            key="provenance",
            value="another engine or scene",
            allowed=f"runs of this engine with the settings of {args.config}",
        )

    # Each row states with which engine and scene it was simulated. Other studies use
    # the table only if their engine and scene are the same.
    record = provenance.get_current_record() or {}
    simulator = {
        "engine": record.get("engine"),
        "scene": dependencies.hash_scene(study.config),
    }
    out = Path(args.out) / "published_sets.csv"
    validate.write_published_sets(
        _require_published_table(args, study),
        args.jobs,
        out,
        parameter_names=study.parameters.names,
        targets=study.targets,
        simulated_by=simulator,
    )


def _require_published_table(args: argparse.Namespace, study: PipelineConfig) -> str:
    """Return the path of the table of published solutions, which the study must name.

    Parameters
    ----------
    args : argparse.Namespace
        The options. The message names the configuration in them.
    study : PipelineConfig
        The study.

    Raises
    ------
    InputError
        If the study names no such table.
    """
    published = study.settings.validation.published
    if published is None:
        raise InputError(
            args.config,
            key="validation.published",
            value=None,
            allowed="a table of published solutions",
        )
    return published


@subcommand(
    Option(
        "jobs",
        nargs="+",
        help="JSON files that measure_runs wrote, one for each solution",
    ),
    Option(
        "--solutions",
        default="results/validation/solutions.csv",
        help="file of the subcommand solutions",
    ),
    SUPPORT,
    OPTIMISM,
    out="results/validation",
)
def validate(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Compare predicted and simulated responses of the solutions (Table 4).

    The comparison is written as table4.csv, which has the columns of Table 4 of the
    article. The answer is also compared with the measurement, and published parameter
    sets with their publication.

    Examples
    --------
    $ repose stage validate results/validation/heaps/???.json
    """
    from repose.calibrate.optimism import OPTIMISM_COLUMNS
    from repose.common.files import read_table
    from repose.stages import validate as validation

    # Published sets are contact parameters of repose. If another program simulates the
    # study, they cannot be compared.
    published = None
    if study.simulator is None:
        published = _read_published_comparison(study)
    optimism = None
    if args.optimism is not None:
        optimism = read_table(args.optimism, OPTIMISM_COLUMNS)
    validation.write_comparison(
        args.solutions,
        args.jobs,
        args.out,
        targets=study.targets,
        measure=study.settings.measure,
        published=published,
        support=_find_support(args, study),
        optimism=optimism,
        parameter_names=study.parameter_names,
    )


def _read_published_comparison(study: PipelineConfig) -> "pd.DataFrame":
    """Read the stored simulations of the published sets, for the responses of a study."""
    from repose.common.provenance import engine_hash
    from repose.config import dependencies
    from repose.stages import validate

    simulator = {
        "engine": engine_hash(),
        "scene": dependencies.hash_scene(study.config),
    }
    return validate.compare_with_published(
        study.settings.validation.published_simulated,
        parameter_names=study.parameters.names,
        targets=study.targets,
        measure=study.settings.measure,
        simulated_by=simulator,
    )


def _find_support(args: argparse.Namespace, study: PipelineConfig) -> "Support | None":
    """Find the region of parameter space that the samples cover.

    Parameters
    ----------
    args : argparse.Namespace
        The options. `dataset` is the path of the table of samples.
    study : PipelineConfig
        The study.

    Returns
    -------
    Support or None
        The region, outside which predictions are uncertain and solutions get a warning.
        None if --dataset was not given.

    Raises
    ------
    InputError
        If the dataset defines its responses differently from the study.
    """
    if not args.dataset:
        return None

    # Import these slow modules only if they are needed.
    from repose.calibrate.dataset_files import read_definitions
    from repose.calibrate.responses import reject_other_definitions
    from repose.calibrate.surrogates.support import Support

    definitions, summary = read_definitions(args.dataset)
    reject_other_definitions(
        definitions, summary, expected=study.definitions, source=args.config
    )
    return Support.from_dataset(args.dataset, study.parameters)

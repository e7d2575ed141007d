"""Read the contact parameters and seeds of a simulation from the options."""

from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence

from repose.bench.parameters import LABELS, LAW_PARAMETERS, PARAMETERS, check_value
from repose.calibrate import seeds as streams
from repose.cli.options import split_pairs
from repose.cli.registry import Option
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.stages.parameter_sets import read_sample

# Largest number of runs of a parameter set in one call, far more than the 1000 that a
# study may have.
MAX_SEEDS = 10_000
PARAMETER_SET = (
    Option(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"a contact parameter: {', '.join(PARAMETERS)}, with some contact laws "
        f"{', '.join(LAW_PARAMETERS)}; "
        "a parameter without --set takes the centre of its range",
    ),
    # Do not record this file, because the results contain the parameters themselves.
    Option(
        "--samples",
        help="CSV with a column sample and a column per parameter, instead of --set",
        recorded=False,
    ),
    Option(
        "--sample",
        type=int,
        help="number in the column sample, which names the files",
    ),
)


def _read_purpose(text: str) -> str | int:
    """Read the purpose of a stream of random numbers: its name, or its number.

    Other programs refer to streams by their numbers.
    """
    if text in streams.PURPOSE_STREAMS:
        return text
    if not text.isdecimal():
        raise ArgumentTypeError(
            f"invalid choice: {text!r} (choose from {', '.join(streams.PURPOSE_STREAMS)})"
        )
    return int(text)


SEED = Option(
    "--seed",
    type=int,
    action="append",
    help="seed of a run (1); may be given several times",
)
STUDY_SEEDS = (
    Option(
        "--seeds",
        type=int,
        metavar="N",
        help="the study's own first N seeds of this sample, instead of --seed",
    ),
    Option(
        "--purpose",
        type=_read_purpose,
        default="design",
        metavar="NAME",
        help="which of the study's streams --seeds draws from (design)",
    ),
)


def read_parameters(
    assignments: Sequence[str],
    samples: str | None,
    sample: int | None,
    study: PipelineConfig,
) -> dict[str, float]:
    """Read the contact parameters of a simulation from the options.

    Parameters
    ----------
    assignments : sequence of str
        The values of --set, each of the form NAME=VALUE. Parameters without a value
        take the centre of their range.
    samples : str or None
        The table of --samples, which replaces --set.
    sample : int or None
        The number of a sample in this table, chosen by --sample.
    study : PipelineConfig
        The study, with the names and ranges of its parameters.

    Returns
    -------
    dict of str to float
        The value of each parameter by its name.

    Raises
    ------
    InputError
        If options contradict each other, or a name or value is not allowed.
    """
    if samples:
        if assignments or sample is None:
            raise InputError(
                "command line",
                key="--samples",
                value=samples,
                allowed="together with --sample, without --set",
            )
        return _read_parameters_of_sample(samples, sample, study)
    if sample is not None:
        raise InputError(
            "command line",
            key="--sample",
            value=sample,
            allowed="together with --samples",
        )
    return _read_assigned_parameters(assignments, study)


def _read_assigned_parameters(
    assignments: Sequence[str], study: PipelineConfig
) -> dict[str, float]:
    """Read the contact parameters of --set.

    A parameter that is not given has the centre of its range.

    Parameters
    ----------
    assignments : sequence of str
        The values of --set, each of the form NAME=VALUE.
    study : PipelineConfig
        The study.

    Returns
    -------
    dict of str to float
        The value of each parameter by its name.

    Raises
    ------
    InputError
        If a name is not that of a parameter of the study, or a value is not allowed.
    """
    texts = split_pairs(assignments, "--set")

    # Check all names before reading the first value.
    names = study.parameters.names
    for name, text in texts.items():
        if name not in names:
            known_names = ", ".join(f"{known} ({LABELS[known]})" for known in names)
            raise InputError(
                "command line",
                key=f"--set {name}",
                value=text,
                allowed=f"a parameter of {known_names}",
            )

    values = dict(study.parameters.centre)
    for name, text in texts.items():
        values[name] = check_value(name, text, "command line")
    return values


def _read_parameters_of_sample(
    samples: str, sample: int, study: PipelineConfig
) -> dict[str, float]:
    """Read the parameters of a sample from a table.

    Parameters
    ----------
    samples : str
        The table: a column `sample`, and a column for each parameter.
    sample : int
        The number of the sample.
    study : PipelineConfig
        The study.

    Raises
    ------
    InputError
        If the table has a column that is not a parameter of the study.
    """
    values = read_sample(samples, sample)
    for name, value in values.items():
        if name not in study.parameters.names:
            raise InputError(
                f"{samples}, sample {sample}",
                key=name,
                value=value,
                allowed="no such column: the study has no parameter of this name, or its laws lack "
                "it",
            )
    return values


def read_seeds(seeds: list[int] | None) -> list[int]:
    """Return the seeds of --seed, or seed 1 if the user gave none.

    Parameters
    ----------
    seeds : list of int or None
        The values of the option; None if the user did not give it.

    Returns
    -------
    list of int
        The seeds.

    Raises
    ------
    InputError
        If a seed is negative, or is given twice.
    """
    if not seeds:
        return [1]
    are_distinct = len(set(seeds)) == len(seeds)
    if min(seeds) < 0 or not are_distinct:
        raise InputError(
            "command line",
            key="--seed",
            value=seeds,
            allowed="distinct whole numbers from 0",
        )
    return seeds


def choose_seeds(
    args: Namespace, study_seed: int, apparatus: str = streams.UNNAMED
) -> list[int]:
    """Choose the seeds of the runs of a parameter set.

    Parameters
    ----------
    args : argparse.Namespace
        The options. Either --seed lists the seeds, or --seeds states how many are
        drawn. They are drawn as in a study, from the stream of --purpose and for the
        sample of --sample.
    study_seed : int
        The seed of the study.
    apparatus : str, optional
        Name of the bench test.

    Returns
    -------
    list of int

    Raises
    ------
    InputError
        If options contradict each other, or a number is not allowed.
    """
    if args.seeds is None:
        return read_seeds(args.seed)
    if args.seed or not 1 <= args.seeds <= MAX_SEEDS:
        raise InputError(
            "command line",
            key="--seeds",
            value=args.seeds,
            allowed=f"from 1 to {MAX_SEEDS}, without --seed",
        )
    # Without a sample, draw the seeds for number 0, which no sample has.
    sample = args.sample or 0
    return streams.draw_run_seeds(
        study_seed, args.purpose, number=sample, count=args.seeds, apparatus=apparatus
    )

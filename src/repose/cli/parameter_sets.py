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

# Largest number of runs of a parameter set in one call. A study has at most 1000.
MOST_SEEDS = 10_000
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
        help="number in the column sample; the files are named by it",
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
    entries: Sequence[str],
    samples: str | None,
    sample: int | None,
    study: PipelineConfig,
) -> dict[str, float]:
    """Read the contact parameters of a simulation from the options.

    Parameters
    ----------
    entries : sequence of str
        The NAME=VALUE entries of --set. Parameters without an entry take the centre of
        their range.
    samples : str or None
        The table of --samples, which replaces --set.
    sample : int or None
        The sample of the table, chosen by --sample.
    study : PipelineConfig
        The study.

    Returns
    -------
    dict
        Values by name.

    Raises
    ------
    InputError
        If options contradict each other, or a name or value is not allowed.
    """
    # With --samples, read the parameters of one sample from the table.
    texts = split_pairs(entries, "--set")
    if samples:
        if texts or sample is None:
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

    # Check all names before reading the first value.
    names = study.parameters.names
    for name, text in texts.items():
        labelled = ", ".join(f"{known} ({LABELS[known]})" for known in names)
        if name not in names:
            raise InputError(
                "command line",
                key=f"--set {name}",
                value=text,
                allowed=f"a parameter of {labelled}",
            )

    # Begin with the centres of the ranges, and replace what the user gives.
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
        If the table has a column that is no parameter of the study.
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
    """Read the seeds of --seed.

    Parameters
    ----------
    seeds : list of int or None
        The values of the option; None without it, which means seed 1.

    Returns
    -------
    list of int

    Raises
    ------
    InputError
        Unless they are distinct whole numbers from 0.
    """
    seeds = seeds or [1]
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
        The options. --seed lists the seeds. --seeds is a number of seeds that are drawn
        as in a study, from the stream of --purpose and for the sample of --sample.
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
        If the options exclude each other, or a number is not allowed.
    """
    if args.seeds is None:
        return read_seeds(args.seed)
    if args.seed or not 1 <= args.seeds <= MOST_SEEDS:
        raise InputError(
            "command line",
            key="--seeds",
            value=args.seeds,
            allowed=f"from 1 to {MOST_SEEDS}, without --seed",
        )
    sample = args.sample or 0
    return streams.draw_run_seeds(
        study_seed, args.purpose, number=sample, count=args.seeds, apparatus=apparatus
    )

"""Options for the contact parameters and seeds of a simulation, and their values."""

from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence

from repose.bench.parameters import FURTHER, LABELS, PARAMETERS, check_value
from repose.calibrate import seeds as streams
from repose.cli.options import pairs, require_option
from repose.cli.registry import Option
from repose.common.errors import InputError, require
from repose.config.pipeline import PipelineConfig
from repose.stages.parameter_sets import read_sample

MOST_SEEDS = 10_000  # runs of a parameter set; a study has at most 1000
PARAMETER_SET = (
    Option(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"a contact parameter: {', '.join(PARAMETERS)}, with some contact laws {', '.join(FURTHER)}; "
        "a parameter without --set takes the centre of its range",
    ),
    # the parameter set is written into the results themselves
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


def _purpose(word: str) -> str | int:
    """Read a purpose, by its name or by the number of a stream that another program uses."""
    if word in streams.PURPOSES:
        return word
    if not word.isdecimal():
        raise ArgumentTypeError(
            f"invalid choice: {word!r} (choose from {', '.join(streams.PURPOSES)})"
        )
    return int(word)


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
        type=_purpose,
        default="design",
        metavar="NAME",
        help="which of the study's streams --seeds draws from (design)",
    ),
)


def parameters(
    entries: Sequence[str],
    samples: str | None,
    sample: int | None,
    study: PipelineConfig,
) -> dict[str, float]:
    """Read the parameters by name from --set or a row of --samples; one not set has the centre of its range."""
    known = study.parameters.names
    chosen = pairs(entries, "--set")
    if samples:
        if chosen or sample is None:
            raise InputError(
                "command line",
                "--samples",
                samples,
                "together with --sample, without --set",
            )
        found = read_sample(samples, sample)
        for name in found:
            allowed = "no such column: the study has no parameter of this name, or its laws lack it"
            require(
                name in known, f"{samples}, sample {sample}", name, found[name], allowed
            )
        return found
    require_option(sample is None, "--sample", sample, "together with --samples")
    for name, value in chosen.items():
        listed = ", ".join(f"{key} ({LABELS[key]})" for key in known)
        require_option(
            name in known, f"--set {name}", value, f"a parameter of {listed}"
        )
    return study.parameters.centre | {
        name: check_value(name, value, "command line") for name, value in chosen.items()
    }


def run_seeds(seeds: list[int] | None) -> list[int]:
    """Return the seeds of --seed, without it seed 1; InputError unless they are distinct whole numbers from 0."""
    seeds = seeds or [1]
    require_option(
        min(seeds) >= 0 and len(set(seeds)) == len(seeds),
        "--seed",
        seeds,
        "distinct whole numbers from 0",
    )
    return seeds


def pour_seeds(
    args: Namespace, study_seed: int, apparatus: str = streams.UNNAMED
) -> list[int]:
    """Return the seeds of --seed, or the study's own by --seeds, for the purpose and sample of `args`."""
    if args.seeds is None:
        return run_seeds(args.seed)
    if args.seed or not 1 <= args.seeds <= MOST_SEEDS:
        raise InputError(
            "command line",
            "--seeds",
            args.seeds,
            f"from 1 to {MOST_SEEDS}, without --seed",
        )
    return streams.pour_seeds(
        study_seed, args.purpose, args.sample or 0, args.seeds, apparatus
    )

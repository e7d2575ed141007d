"""Options that tell a simulation its contact parameters and seeds, and what they mean."""

import csv
from pathlib import Path

from repose.cli.options import pairs
from repose.cli.registry import Option
from repose.core import seeds as streams
from repose.core.errors import InputError
from repose.core.parameters import LABELS, PARAMETERS, PHYSICAL_LIMITS

PARAMETER_SET = (
    Option(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"a contact parameter: {', '.join(PARAMETERS)}; one that is not set has the centre of its range",
    ),
    Option("--samples", help="CSV with the columns sample and the six, instead of --set"),
    Option("--sample", type=int, help="number in the column sample; also the name of the files"),
)
SEED = Option("--seed", type=int, action="append", help="seed of a run (1); may be given several times")
STUDY_SEEDS = (
    Option("--seeds", type=int, metavar="N", help="N seeds of the study's own, instead of --seed"),
    Option(
        "--purpose",
        choices=tuple(streams.PURPOSES),
        default="design",
        help="which of the study's streams --seeds draws from (design)",
    ),
)


def parameters(entries, samples, sample, ranges):
    """The six parameters by name: from --set, or from a row of --samples.

    entries: of --set, NAME=VALUE; samples: path of a CSV or None; sample: number in its column sample or None;
    ranges: (low, high) of each parameter, whose centre one that is not set has. Raises InputError.
    """
    given = {name: _number(text, name) for name, text in pairs(entries, "--set").items()}
    if samples:
        if given or sample is None:
            raise InputError("command line", "--samples", samples, "together with --sample, without --set")
        given = _row(samples, sample)
    elif sample is not None:
        raise InputError("command line", "--sample", sample, "together with --samples")
    for name, value in given.items():
        _check(name, value, samples or "command line")
    return {name: given.get(name, round(sum(ranges[name]) / 2, 12)) for name in PARAMETERS}


def run_seeds(given):
    """Seeds from --seed, a list or None; InputError unless they are distinct whole numbers from 0."""
    given = given or [1]
    if min(given) < 0 or len(set(given)) < len(given):
        raise InputError("command line", "--seed", given, "distinct whole numbers from 0")
    return given


def pour_seeds(args, study_seed, apparatus=streams.UNNAMED):
    """Seeds from --seed, or --seeds of the study's streams; InputError for both."""
    if args.seeds is None:
        return run_seeds(args.seed)
    if args.seed or args.seeds < 1:
        raise InputError("command line", "--seeds", args.seeds, "at least 1, without --seed")
    return streams.pour_seeds(study_seed, args.purpose, args.sample or 0, args.seeds, apparatus)


def _check(name, value, source):
    """InputError unless name is a parameter and value is within its physical limits."""
    if name not in PARAMETERS:
        known = ", ".join(f"{key} ({LABELS[key]})" for key in PARAMETERS)
        raise InputError("command line", f"--set {name}", value, f"a parameter of {known}")
    low, high = PHYSICAL_LIMITS[name]
    if not low <= value <= high or value == float("inf"):
        limit = f"{low:g} to {high:g}" if high < float("inf") else f"a finite number of at least {low:g}"
        raise InputError(source, name, value, limit)


def _row(path, number):
    """The parameters of a sample in a CSV that has the column sample."""
    if not Path(path).is_file():
        raise InputError(path, "file", None, "an existing CSV file")
    with Path(path).open(encoding="utf-8", newline="") as lines:
        reader = csv.DictReader(lines)
        columns = reader.fieldnames or []
        for name in ("sample", *PARAMETERS):
            if name not in columns:
                raise InputError(
                    path, "header", ",".join(columns), f"columns sample, {', '.join(PARAMETERS)}"
                )
        rows = {row["sample"]: row for row in reader}
    if str(number) not in rows:
        raise InputError(path, "sample", number, f"one of {len(rows)}: {', '.join(list(rows)[:3])}, ...")
    source = f"{path}, sample {number}"
    return {name: _number(rows[str(number)][name], name, source) for name in PARAMETERS}


def _number(text, name, source="command line"):
    """A number, or InputError."""
    try:
        return float(text)
    except ValueError:
        raise InputError(source, name, text, "a number") from None

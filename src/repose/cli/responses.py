"""Verbs of further responses: measure them on a pile, and compare their information."""

import argparse
import math

from repose.cli.berries import BERRY_AND_PARTICLE, berry_and_particle
from repose.cli.options import DATASET, RUNS, pairs
from repose.cli.registry import Family, Option
from repose.config.reading import section
from repose.config.study import Study
from repose.core.errors import InputError

family = Family()

RESPONSES = RUNS.but(default="results/responses/runs.csv", help="what measure_responses wrote")
JOBS = Option(
    "--jobs",
    nargs="+",
    default=[],
    help="folders that measure_runs wrote into, of other bench tests with samples of the same design",
)


@family.verb(
    "measure further responses of saved pours: profile, packing, loose berries, discharge time",
    example="results/heaps/???.pours.json --runs results/runs.csv",
    out="results/responses/runs.csv",
    options=[
        Option("pours", nargs="+", help="NAME.pours.json files of the verb pour, NAME.npz beside them"),
        RUNS,
        *BERRY_AND_PARTICLE,
    ],
)
def measure_responses(args: argparse.Namespace) -> None:
    from repose.measure import further_responses

    study = Study.load(args.config)
    berry_of, particle = berry_and_particle(study, args.berry, args.particle)
    table = further_responses.run(study.config, args.pours, args.runs, particle, berry_of, args.out)
    print(table[list(further_responses.MEASURED)].describe().round(2).to_string())


@family.verb(
    "tell how much each further response narrows the posterior of the parameters",
    example="--runs results/responses/runs.csv --dataset results/dataset.csv",
    out="results/responses",
    options=[
        RESPONSES,
        DATASET,
        JOBS,
        Option(
            "--discrepancy",
            action="append",
            default=[],
            metavar="NAME=PERCENT",
            help="discrepancy of one response, instead of posterior.discrepancy_percent; may be repeated",
        ),
    ],
)
def second_responses(args: argparse.Namespace) -> None:
    from repose.studies import further_runs, second_responses

    study = Study.load(args.config)
    settings = study.config["second_responses"] | {
        key: study.config["network"][key] for key in ("hidden", "epochs")
    }
    settings |= {"discrepancy_percent": study.config["posterior"]["discrepancy_percent"]}
    own = pairs(args.discrepancy, "--discrepancy")
    targets, space = study.targets, study.parameters
    data = further_runs.read(args.runs, args.dataset, targets, study.config["measure"]["response"], args.jobs)
    settings["discrepancies"] = {name: _percent(name, text, data.known) for name, text in own.items()}
    print(second_responses.run(data, targets, space, settings, args.out))


@family.verb(
    "tell which few tests narrow the parameters enough: the pile, other bench tests, direct tests of a parameter",
    example="--runs results/responses/runs.csv --jobs results/joint_targets/discharge_runs",
    out="results/joint_targets",
    options=[RESPONSES, DATASET, JOBS],
)
def joint_targets(args: argparse.Namespace) -> None:
    from repose.studies import further_runs, joint_targets

    study = Study.load(args.config)
    settings = (
        study.config["network"] | study.config["second_responses"] | section(study.config, "joint_targets")
    )
    targets, space = study.targets, study.parameters
    data = further_runs.read(args.runs, args.dataset, targets, study.config["measure"]["response"], args.jobs)
    print(joint_targets.run(data, targets, space, settings, args.out))


@family.verb(
    "tell what the whole profile of the piles, its principal components, adds beside angle and Height",
    example="results/heaps/???.pours.json --runs results/runs.csv",
    out="results/profiles",
    options=[
        Option("pours", nargs="+", help="NAME.pours.json files of the verb pour, NAME.npz beside them"),
        RUNS,
        DATASET,
        *BERRY_AND_PARTICLE,
    ],
)
def profiles(args: argparse.Namespace) -> None:
    from repose.core.files import read_table
    from repose.core.parameters import PARAMETERS
    from repose.measure import half_widths
    from repose.measure.pile import MeasureSettings
    from repose.studies import profiles

    study = Study.load(args.config)
    berry_of, particle = berry_and_particle(study, args.berry, args.particle)
    settings = (
        study.config["network"] | study.config["second_responses"] | section(study.config, "joint_targets")
    )
    table = read_table(args.dataset, ("sample", *PARAMETERS, "status"))
    table = table[table["status"] == "ok"]
    runs = read_table(args.runs, ("sample", "seed", "status", *profiles.TWO_NUMBERS))
    runs = runs[(runs["status"] == "ok") & runs["sample"].isin(table["sample"])]
    levels = profiles.levels_mm(float(runs["height_mm"].max()))
    good = set(map(tuple, runs[["sample", "seed"]].to_numpy()))
    seen = MeasureSettings.of(study.config["measure"], berry_of)
    widths = half_widths.of_pours(args.pours, good, particle, seen, levels)
    runs = runs.merge(widths, on=["sample", "seed"])
    table = table[table["sample"].isin(runs["sample"])]
    X, samples = table[list(PARAMETERS)].to_numpy(float), table["sample"].to_numpy()
    targets, space = study.targets, study.parameters
    print(profiles.run(X, samples, runs, len(levels), targets, space, settings, args.out))


def _percent(name, text, known):
    """The discrepancy of one response as a number; InputError for another response or number."""
    option = f"--discrepancy {name}"
    if name not in known:
        raise InputError("command line", option, text, f"a response of {', '.join(known)}")
    try:
        percent = float(text)
    except ValueError:
        percent = math.nan
    if not 0 <= percent <= 100:
        raise InputError("command line", option, text, "a number from 0 to 100")
    return percent

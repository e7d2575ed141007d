"""The next measurement: further responses of the pile, other bench tests, direct tests of a parameter."""

import math

import pandas as pd

from repose.bench.parameters import PARAMETERS
from repose.common.errors import InputError
from repose.common.files import read_table, write_table
from repose.grain.berry_files import read_grain
from repose.grain.particle import Particle
from repose.measure.angles import MEAN_KEYS
from repose.measure.further_responses import RESPONSE_NAMES
from repose.measure.settings import MeasureSettings
from research.responses import (
    further_runs,
    half_widths,
    joint_targets,
    linear_effects,
    profiles,
    saved_piles,
    second_responses,
)
from research.script import Script, option

PILES = (
    option(
        "pours",
        nargs="+",
        help="NAME.pours.json files of the design's pours, NAME.npz beside them",
    ),
    option("--runs", default="results/runs.csv"),
    option("--berry", default="results/berry/berry.json"),
    option("--particle", default="results/berry/particle.json"),
)
DATASET = option("--dataset", default="results/dataset.csv")
OVER_DESIGN = (
    option("--runs", default="results/responses/runs.csv", help="of the part measure"),
    DATASET,
    option(
        "--jobs",
        nargs="+",
        default=[],
        help="folders of measured runs of other bench tests, same design",
    ),
)
SHARE = option(
    "--discrepancy",
    action="append",
    default=[],
    metavar="NAME=PERCENT",
    help="discrepancy of one response, instead of posterior.discrepancy_percent; may be repeated",
)

script = Script("responses", __doc__)


@script.part("measure", "results/responses/runs.csv", *PILES)
def measure(args, config):
    """Measure further responses of saved pours: profile, packing, loose grains, discharge time."""
    particle = Particle.load(args.particle)
    berry = read_grain(args.berry)
    table = saved_piles.run(config, args.pours, args.runs, particle, berry, args.out)
    return table[list(RESPONSE_NAMES)].describe().round(2).to_string()


@script.part(
    "effects",
    "results/responses/effects.csv",
    option("--runs", default="results/responses/runs.csv", help="of the part measure"),
    DATASET,
)
def effects(args, config):
    """Fit each response of the pile linearly in the parameters, as it is and at equal packing."""
    names = ("height_mm", *MEAN_KEYS.values(), *RESPONSE_NAMES)
    runs = read_table(args.runs, ("sample", "status", *names))
    samples = read_table(args.dataset, ("sample", *PARAMETERS))
    both = [
        linear_effects.effects(
            samples,
            runs[runs["status"] == "ok"],
            args.study.parameters,
            names,
            at_equal,
        )
        for at_equal in ("", "packing_percent")
    ]
    table = pd.concat(both, ignore_index=True)
    write_table(args.out, table)
    return table.round(2).to_string(index=False)


@script.part("second", "results/responses", *OVER_DESIGN, SHARE)
def second(args, config):
    """Tell how much each further response narrows the posterior of the parameters."""
    settings = config["second_responses"] | {
        key: config["network"][key] for key in ("hidden", "epochs")
    }
    settings |= {"discrepancy_percent": config["posterior"]["discrepancy_percent"]}
    targets, space, data = _over_design(args, config)
    settings["discrepancies"] = dict(
        _fraction(share, data.known) for share in args.discrepancy
    )
    return second_responses.run(data, targets, space, settings, args.out)


@script.part("joint", "results/joint_targets", *OVER_DESIGN)
def joint(args, config):
    """Tell which few tests narrow the parameters enough: the pile, other bench tests, direct tests of a parameter."""
    settings = config["network"] | config["second_responses"] | config["joint_targets"]
    targets, space, data = _over_design(args, config)
    return joint_targets.run(data, targets, space, settings, args.out)


@script.part("profiles", "results/profiles", *PILES, DATASET)
def profile(args, config):
    """Tell what the principal components of the piles' whole profile add beside angle and Height."""
    particle = Particle.load(args.particle)
    berry = read_grain(args.berry)
    settings = config["network"] | config["second_responses"] | config["joint_targets"]
    table = read_table(args.dataset, ("sample", *PARAMETERS, "status"))
    table = table[table["status"] == "ok"]
    runs = read_table(args.runs, ("sample", "seed", "status", *profiles.TWO_NUMBERS))
    runs = runs[(runs["status"] == "ok") & runs["sample"].isin(table["sample"])]
    levels = profiles.levels_mm(float(runs["height_mm"].max()))
    good = set(map(tuple, runs[["sample", "seed"]].to_numpy()))
    seen = MeasureSettings.with_defaults(**config["measure"]).for_grain(berry)
    widths = half_widths.of_pours(args.pours, good, particle, seen, levels)
    runs = runs.merge(widths, on=["sample", "seed"])
    table = table[table["sample"].isin(runs["sample"])]
    X = table[list(PARAMETERS)].to_numpy(float)
    samples = table["sample"].to_numpy()
    targets = args.study.targets
    space = args.study.parameters
    return profiles.run(
        X, samples, runs, len(levels), targets, space, settings, args.out
    )


def _over_design(args, config):
    """Targets, ranges, and the responses over the samples of the design."""
    targets = args.study.targets
    space = args.study.parameters
    definition = config["measure"]["response"]
    return (
        targets,
        space,
        further_runs.read(args.runs, args.dataset, targets, definition, args.jobs),
    )


def _fraction(entry, known):
    """Read the discrepancy of one response, by its name; InputError for another response or number."""
    name, _, text = entry.partition("=")
    if name not in known:
        raise InputError(
            "command line",
            f"--discrepancy {name}",
            text,
            f"a response of {', '.join(known)}",
        )
    try:
        percent = float(text)
    except ValueError:
        percent = math.nan
    if not 0 <= percent <= 100:
        raise InputError(
            "command line", f"--discrepancy {name}", text, "a number from 0 to 100"
        )
    return name, percent


if __name__ == "__main__":
    script.run()

"""The lines of the angle compared: bias on known shapes, noise, signal over the design, and the choice by the rule."""

import pandas as pd

from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import read_table, write_table
from repose.grain.berry_files import read_grain
from repose.grain.particle import Particle
from repose.measure import pile
from research.measurement import (
    line_choice,
    line_slopes,
    loose_grain,
    measurement_study,
)
from research.script import Script, option

script = Script("measurement", __doc__)
GRAIN = (
    option("--berry", default="results/berry/berry.json"),
    option("--particle", default="results/berry/particle.json"),
)


@script.part(
    "lines",
    "results/measurement_study",
    option(
        "heaps",
        nargs="+",
        help=".npz files of the design's pours, NAME.pours.json beside them",
    ),
    option("--representative", help=".npz file of one parameter set with more pours"),
    option(
        "--shapes", type=int, default=8, help="piles of each known shape and angle (8)"
    ),
    *GRAIN,
)
def lines(args, config):
    """Compare the lines on saved piles and on known shapes; choose one by the rule."""
    if args.shapes < 1:
        raise InputError("command line", "--shapes", args.shapes, "at least 1")
    particle = Particle.load(args.particle)
    berry = read_grain(args.berry)
    section = config["measure"]
    tables = measurement_study.run(
        args.heaps, args.representative, particle, section, berry, args.out, args.shapes
    )
    piles = tables.pop("piles")
    texts = [
        table.round(2).to_string(index="measured" not in table)
        for table in tables.values()
    ]
    by_name = {target.name: target for target in Targets.of(config["targets"])}
    if {"aor_deg", "height_mm"} <= set(by_name):
        published = config["validation"]["published"]
        needed = ("aor_simulated_deg", "height_simulated_mm")
        pairs = (
            read_table(published, needed).dropna(subset=needed)
            if published
            else pd.DataFrame()
        )
        facts = line_choice.facts(
            piles,
            tables["noise"],
            tables["bias"],
            by_name["aor_deg"],
            by_name["height_mm"],
            pairs.to_dict("records"),
        )
        verdicts = line_choice.verdicts(facts)
        write_table(f"{args.out}/choice.csv", facts)
        write_table(f"{args.out}/verdicts.csv", verdicts)
        texts += [
            facts.round(2).to_string(index=False),
            verdicts.to_string(index=False),
            f"the line of the publication, by the rule: {line_choice.chosen(facts)[0]}",
            f"the line that tells parameter sets apart best: {line_choice.best_told_apart(facts)}",
        ]
    return "\n\n".join(texts)


@script.part(
    "loose_grain",
    "results/measurement_study/loose_grain.csv",
    option("heaps", nargs="+", help=".npz files of pours, NAME.pours.json beside them"),
    *GRAIN,
)
def loose(args, config):
    """Move one grain to the foot or onto the crest of saved piles; see how far each line's angle goes."""
    particle = Particle.load(args.particle)
    settings = pile.MeasureSettings.with_defaults(**config["measure"]).for_grain(
        read_grain(args.berry)
    )
    table = loose_grain.shifts(
        args.heaps, particle, pile.with_grain_height(settings, particle)
    )
    write_table(args.out, table)
    return table.round(2).to_string(index=False)


@script.part(
    "line_slopes",
    "results/measurement_study/line_slopes.csv",
    option(
        "heaps",
        nargs="+",
        help=".npz files of the design's pours, NAME.pours.json beside them",
    ),
    *GRAIN,
)
def slopes(args, config):
    """Every line's angle on saved piles beside the cone of their Height: src/repose/bench/line_slopes.csv."""
    particle = Particle.load(args.particle)
    berry = read_grain(args.berry)
    return line_slopes.run(args.heaps, particle, config, berry, args.out).to_string(
        index=False
    )


if __name__ == "__main__":
    script.run()

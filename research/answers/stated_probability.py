"""Whether the sequential strategy's stated probability agrees with the share of its answers that are right.

    python -m research.answers.stated_probability --truths 0 100

Campaigns for hidden parameter sets, as in `hidden_truths.py`, in cells of emulated truth (`emulated.py`), number of
targets, and noise of a pour. A row for each answer on the way, after 32, 48, 64 and 80 pours. A run that was stopped
goes on where it was.

The rule, written before the first run. An answer is right if all its true mean responses lie within 1 % of their
targets. In each cell the answers fall into five classes of the stated probability. The share of a class is the mean
over its campaigns of their own shares, and so is the stated probability. The standard error is that of the mean over
campaigns of right less stated, but no less than that of as many campaigns that are right with the stated probability.
A class agrees if share and stated probability differ by at most two standard errors. Classes with fewer than ten
campaigns do not count. The model was developed with other hidden sets, ten for each cell but `ripple`, and nothing is
changed after this run: a class that does not agree stands with its numbers in research/docs/sequential_tests.md.
"""

import numpy as np
import pandas as pd

from repose.config.pipeline import PipelineConfig
from research.answers.emulated import Simulator, options
from research.answers.hidden_truths import TOLERANCE, goal_of, sequential

FIRST_SEED = 11000
MOST_POURS = 80
RESPONSES = {1: ["height_mm"], 2: ["aor_deg", "height_mm"]}
CELLS = (
    ("process", 1, 2.5),
    ("process", 1, 7.5),
    ("ripple", 1, 2.5),
    ("two_minima", 1, 2.5),
    ("process", 2, 2.5),
    ("process", 2, 7.5),
    ("deep_ripple", 1, 2.5),
)
COLUMNS = [
    "emulator",
    "responses",
    "noise_percent",
    "truth",
    "pours",
    "probability",
    "error_percent",
    "stop",
]
CLASSES = 5
FEWEST = 10
ERRORS = 2


def campaign(simulator, names, number, config, space):
    """Rows of the answers for one hidden set: pours, stated probability, true error in percent, why it stopped."""
    aims = simulator.mean(
        np.random.default_rng([FIRST_SEED, number]).random((1, space.dimensions))
    )[0]
    _, goal = goal_of(names, aims, space)
    random = np.random.default_rng([FIRST_SEED, number, 1])
    for pours, answer, probability, stop in sequential(
        simulator, goal, config, random, MOST_POURS
    ):
        error = 100 * np.abs(simulator.mean(answer[None])[0] / aims - 1).max()
        yield pours, probability, error, stop


def classes(table):
    """Classes of each cell: campaigns, stated probability, share that is right, its standard error, and agreement."""
    rows = []
    table = table.assign(
        right=table["error_percent"] < TOLERANCE,
        class_=(table["probability"] * CLASSES).astype(int).clip(upper=CLASSES - 1),
    )
    for key, group in table.groupby(
        ["emulator", "responses", "noise_percent", "class_"], sort=False
    ):
        by_truth = group.groupby("truth")[["probability", "right"]].mean()
        stated, right = by_truth.mean()
        count = len(by_truth)
        sd = (
            (by_truth["right"] - by_truth["probability"]).std() if count > 1 else np.nan
        )
        error = np.fmax(sd, np.sqrt(stated * (1 - stated))) / np.sqrt(count)
        agrees = abs(right - stated) <= ERRORS * error if count >= FEWEST else None
        rows.append((*key, count, stated, right, error, agrees))
    columns = ["emulator", "responses", "noise_percent", "class_"]
    found = pd.DataFrame(
        rows, columns=[*columns, "campaigns", "stated", "right", "error", "agrees"]
    )
    return found.sort_values(["responses", "noise_percent", "emulator", "class_"])


def summary(found):
    """The classes as a table of Markdown."""
    yield "| truth | targets | noise | class | campaigns | stated | right | agrees |"
    yield f"|{'---|' * 8}"
    for row in found.itertuples():
        ends = f"{row.class_ / CLASSES:g}-{(row.class_ + 1) / CLASSES:g}"
        agrees = {None: "-", True: "yes", False: "**no**"}[row.agrees]
        yield (
            f"| {row.emulator} | {row.responses} | {row.noise_percent:g} % | {ends} | {row.campaigns}"
            f" | {row.stated:.2f} | {row.right:.2f} ± {row.error:.2f} | {agrees} |"
        )


def main():
    parser = options(__doc__, "research/answers/stated_probability.csv")
    parser.add_argument(
        "--truths", type=int, nargs=2, default=[0, 100], metavar=("FROM", "TO")
    )
    args = parser.parse_args()
    study = PipelineConfig.load(args.config)
    config = study.config
    table = (
        pd.read_csv(args.out) if args.out.exists() else pd.DataFrame(columns=COLUMNS)
    )
    done = set(table[COLUMNS[:4]].itertuples(index=False, name=None))
    for cell in CELLS:
        simulator = Simulator(args.pool, RESPONSES[cell[1]], config, cell[0], cell[2])
        for number in range(*args.truths):
            if (*cell, number) in done:
                continue
            rows = campaign(
                simulator, RESPONSES[cell[1]], number, config, study.parameters
            )
            new = pd.DataFrame([(*cell, number, *row) for row in rows], columns=COLUMNS)
            table = pd.concat([table, new], ignore_index=True) if len(table) else new
            table.to_csv(args.out, index=False, float_format="%.4g")
    print(*summary(classes(table)), sep="\n")


if __name__ == "__main__":
    main()

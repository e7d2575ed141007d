"""The sequential strategy beside other methods at equal pours: hidden parameter sets, found again from noisy pours.

    python -m research.answers.hidden_truths --truths 0 40
    python -m research.answers.hidden_truths --truths 0 40 --responses aor_deg height_mm
    python -m research.answers.hidden_truths --truths 0 20 --methods sequential --noise-percent 1
    python -m research.answers.hidden_truths --truths 0 20 --emulator networks --out networks.csv

The simulator is that of `emulated.py`. A hidden parameter set is drawn from the ranges; its mean responses are the
targets. The error of an answer is the largest deviation of its true mean responses from the targets, in percent of
them. Each hidden set depends on its number alone, so a run that was stopped goes on where it was. Whether the stated
probabilities are right is the question of `stated_probability.py`.

  sequential            `strategy: sequential`; its answer after each batch, with the probability that it states
  GP on one hypercube   the same model and the same answer from one Latin hypercube, two pours a sample
  published chain       in small: hypercube, four pours a sample, Bayesian network, local search

The other methods stand in `rivals.py`, which says how to install the packages that they need.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from repose.calibrate.designs.latin_hypercube import lhsdesign
from repose.calibrate.responses import response
from repose.calibrate.search.objective import Objective
from repose.calibrate.strategies import plan
from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.strategies.sequential.advise import advise, rank_points
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import Kriging, ObservedSamples
from repose.calibrate.targets import Target, Targets
from repose.config.pipeline import PipelineConfig
from research.answers import rivals
from research.answers.emulated import EMULATORS, Simulator, options
from research.comparison import points
from research.comparison.models import configured_network
from research.comparison.proposals import local_search

BUDGETS = (80, 120)
# pours after which `repose plan` prints the probabilities
GRID = (
    32,
    48,
    64,
    80,
    96,
    112,
    120,
)
TABLE = Path("research/answers/hidden_truths.csv")
TOLERANCE = 1.0  # percent
NETWORK = {"starts": 5, "epochs": 300}  # fewer than config.yaml's, for time
FIRST_SEED = 3000  # sets of other seeds were looked at while the strategy was made


def goal_of(names, aims, space):
    """Targets, of which nothing is known but their mean, and the goal."""
    targets = Targets(
        [
            Target(response(name), aim, 0.0, 1, 0.98 * aim, 1.02 * aim, aim)
            for name, aim in zip(names, aims.tolist(), strict=True)
        ]
    )
    return targets, Goal.from_targets(targets, TOLERANCE, space)


def sequential(simulator, goal, config, random, most_pours):
    """Answers after each batch: pours, point, probability, and why it stopped."""
    section = SequentialSettings(
        **config["sequential"] | {"most_pours": most_pours, "probability": 0.99}
    )
    first = lhsdesign(section.start_samples, goal.space.dimensions, rng=random)
    data = simulator.pour(first, section.seeds, random)
    while True:
        poured = data.values.shape[0] * data.values.shape[1]
        advice = advise(data, goal, section, poured, random, None)
        yield poured, advice.answer, advice.probability, advice.stop
        if advice.stop:
            return
        new = simulator.pour(advice.batch, section.seeds, random)
        data = ObservedSamples(
            np.vstack([data.unit_points, new.unit_points]),
            np.concatenate([data.values, new.values]),
        )


def of_the_strategy(simulator, goal, targets, config, random, budgets):
    """Answers of the sequential strategy."""
    for pours, answer, probability, _ in sequential(
        simulator, goal, config, random, max(budgets)
    ):
        yield pours, answer, probability


def kriging(simulator, goal, targets, config, random, budgets):
    """Answer of the same model from one hypercube."""
    for budget in budgets:
        data = simulator.pour(
            lhsdesign(budget // 2, goal.space.dimensions, rng=random), 2, random
        )
        model = Kriging(data)
        found, scores = rank_points(model, goal, data, random)
        answer = found[scores.argmax()]
        yield budget, answer, float(goal.probability(*model.predict(answer[None]))[0])


def network(simulator, goal, targets, config, random, budgets):
    """Answer of the published chain in small."""
    settings = config["network"] | NETWORK
    for budget in budgets:
        data = simulator.pour(
            lhsdesign(budget // 4, goal.space.dimensions, rng=random), 4, random
        )
        model = configured_network(
            points.Points(*data), settings, int(random.integers(2**31))
        )
        objective = Objective(targets)
        answer, _ = local_search(
            lambda x, model_=model: model_(x)[0],
            objective,
            goal.space.dimensions,
            5,
            random,
        )
        yield budget, answer, np.nan


METHODS = {
    "sequential": of_the_strategy,
    "GP on one hypercube": kriging,
    "published chain": network,
    **rivals.METHODS,
}


def of_truth(number, simulator, names, space, config, methods, noise):
    """Rows of one hidden parameter set; `noise` in percent."""
    hidden = np.random.default_rng([FIRST_SEED, number]).random((1, space.dimensions))
    aims = simulator.mean(hidden)[0]
    targets, goal = goal_of(names, aims, space)
    rows = []
    for method in methods:
        random = np.random.default_rng(
            [FIRST_SEED, number, list(METHODS).index(method)]
        )
        for pours, answer, probability in METHODS[method](
            simulator, goal, targets, config, random, BUDGETS
        ):
            error = 100 * np.abs(simulator.mean(answer[None])[0] / aims - 1).max()
            rows.append((len(names), method, number, noise, pours, error, probability))
    return rows


def summary(table):
    """Errors by method and budget, and how far the stated probabilities are right at a stop, at the pool's noise."""
    table = table[table["noise_percent"] == plan.DEFAULT_NOISE_PERCENT]
    lines = [
        "| responses | method | pours | truths | median worst error | 90th percentile | within 1 % | within 2 % |"
    ]
    lines.append("|---|---|---|---|---|---|---|---|")
    for (k, method, pours), rows in table.groupby(
        ["responses", "method", "pours"], sort=False
    ):
        if pours in BUDGETS:
            error = rows["error_percent"]
            lines.append(
                f"| {k} | {method} | {pours} | {len(rows)} | {error.median():.2f} % | {error.quantile(0.9):.2f} %"
                f" | {(error < 1).mean():.2f} | {(error < 2).mean():.2f} |"
            )
    lines += [
        "",
        "| responses | stop at | runs that stop | right | pours, median |",
        "|---|---|---|---|---|",
    ]
    for k, rows in table[table["method"] == "sequential"].groupby("responses"):
        for level in (0.5, 0.6, 0.7, 0.8, 0.9):
            first = rows[rows["probability"] >= level].groupby("truth").first()
            right = (first["error_percent"] < TOLERANCE).mean()
            pours = first["pours"].median()
            stopped = f"{len(first)} of {rows['truth'].nunique()}"
            lines.append(f"| {k} | {level} | {stopped} | {right:.2f} | {pours:.0f} |")
    return "\n".join(lines)


def success(table):
    """Share of the answers within 1 % and 2 % by responses, noise and pours: what `repose plan` reads.

    The answer after so many pours is that of the last batch until then, also of a campaign that stopped before.
    """
    rows = table[table["method"] == "sequential"]
    found = []
    for (k, noise), group in rows.groupby(["responses", "noise_percent"]):
        for pours in GRID:
            error = (
                group[group["pours"] <= pours].groupby("truth")["error_percent"].last()
            )
            found.append(
                (k, noise, pours, len(error), (error < 1).mean(), (error < 2).mean())
            )
    shares = [f"within_{percent:g}_percent" for percent in plan.TOLERANCES]
    return pd.DataFrame(
        found, columns=["responses", "noise_percent", "pours", "truths", *shares]
    )


def main():
    parser = options(__doc__, TABLE)
    parser.add_argument("--emulator", choices=EMULATORS, default="process")
    parser.add_argument(
        "--truths", type=int, nargs=2, default=[0, 40], metavar=("FROM", "TO")
    )
    parser.add_argument(
        "--noise-percent",
        type=float,
        default=plan.DEFAULT_NOISE_PERCENT,
        help="of a pour; 5: as in the pool",
    )
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    args = parser.parse_args()
    if args.emulator != "process" and args.out == TABLE:
        parser.error(
            f"--emulator {args.emulator}: --out is the table of the Gaussian process; expected another file"
        )

    columns = [
        "responses",
        "method",
        "truth",
        "noise_percent",
        "pours",
        "error_percent",
        "probability",
    ]
    table = (
        pd.read_csv(args.out) if args.out.exists() else pd.DataFrame(columns=columns)
    )
    study = PipelineConfig.load(args.config)
    config = study.config
    space = study.parameters
    simulator = Simulator(
        args.pool, args.responses, config, args.emulator, args.noise_percent
    )
    for number in range(*args.truths):
        same = (table["truth"] == number) & (table["responses"] == len(args.responses))
        done = table[same & (table["noise_percent"] == args.noise_percent)]["method"]
        methods = [method for method in args.methods if method not in set(done)]
        rows = of_truth(
            number,
            simulator,
            args.responses,
            space,
            config,
            methods,
            args.noise_percent,
        )
        table = pd.concat(
            [table, pd.DataFrame(rows, columns=columns)], ignore_index=True
        )
        table.to_csv(args.out, index=False, float_format="%.4g")
    if args.out == TABLE:  # what `repose plan` reads belongs to the table that is kept
        success(table).to_csv(plan.SUCCESS_FILE, index=False, float_format="%.4f")
    print(summary(table))


if __name__ == "__main__":
    main()

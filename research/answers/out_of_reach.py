"""Frequency of the verdict "out of reach" of the sequential strategy, right and wrong.

    python -m research.answers.out_of_reach --campaigns 1000 1050 --responses height_mm
    python -m research.answers.out_of_reach --campaigns 1000 1050 --responses aor_deg height_mm

The simulator is that of `emulated.py`. A target lies at the edge of what it can give (`edge`), 1 % inside
(`inside`), so that the nearest parameter set misses it by 3.85 % of it (`beyond`: 4 % above the highest) or by 9.1 %
(`far`), in a direction that each campaign draws. `default` is the pair of `config.yaml`'s article. A row for each look:
pours, the stated probability that any parameter set meets the targets, why the campaign stopped, and Eq. 11 of the
answer beside the least of some 17,000 points.
"""

import numpy as np
import pandas as pd

from repose.calibrate.designs.latin_hypercube import lhsdesign
from repose.calibrate.strategies.sequential import SequentialSettings
from repose.calibrate.strategies.sequential.advise import advise
from repose.calibrate.strategies.sequential.kriging import ObservedSamples
from repose.config.pipeline import PipelineConfig
from research.answers.emulated import Simulator, options
from research.answers.hidden_truths import goal_of

MISS = {"beyond": 0.0385, "far": 0.0909}
KINDS = ("beyond", "edge", "inside", "far")
DEFAULT = {"aor_deg": 32.87, "height_mm": 65.57}
LOOKS = (32, 40, 48, 56, 64)


def dense(simulator, d):
    """Points all over the ranges, their corners, and more where responses are extreme; and their mean responses."""
    random = np.random.default_rng(0)
    unit = random.random((12000, d))
    unit = np.vstack([unit, np.unique(np.round(unit[:2000]), axis=0)])
    mean = simulator.mean(unit)
    for towards in np.vstack(
        [np.eye(mean.shape[1]), random.standard_normal((4, mean.shape[1]))]
    ):
        for along in (towards, -towards):
            for step in (0.1, 0.03):
                best = unit[
                    np.argsort(-(mean / mean.mean(axis=0)) @ along)[:20]
                ].repeat(20, axis=0)
                near = np.clip(best + step * random.standard_normal(best.shape), 0, 1)
                unit = np.vstack([unit, near])
                mean = np.vstack([mean, simulator.mean(near)])
    return unit, mean


def aims(kind, mean, random):
    """Targets of a campaign."""
    k = mean.shape[1]
    drawn = random.normal(size=k) if k > 1 else random.choice([-1.0, 1.0], 1)
    covariance = np.atleast_2d(np.cov(mean.T))
    along = np.linalg.cholesky(np.linalg.inv(covariance)) @ drawn
    edge = mean[(mean @ along).argmax()]
    out = covariance @ along
    out /= np.abs(out / edge).max()
    if kind in ("edge", "inside"):
        return edge - (kind == "inside") * 0.01 * out
    low = 0.0
    high = 0.6
    for _ in range(30):
        middle = (low + high) / 2
        aim = edge + middle * out
        short = np.abs(mean / aim - 1).max(axis=1).min() < MISS[kind]
        low, high = (middle, high) if short else (low, middle)
    return edge + high * out


def campaign(simulator, names, aim, mean, section, space, random):
    """Rows of one campaign."""
    _, goal = goal_of(names, aim, space)
    least = goal.compute_deviations(mean)[1].min()
    data = simulator.pour(
        lhsdesign(section.start_samples, space.dimensions, rng=random), 2, random
    )
    while True:
        pours = 2 * len(data.unit_points)
        advice = advise(data, goal, section, pours, random, None)
        answer_loss = goal.compute_deviations(simulator.mean(advice.answer[None]))[1][0]
        yield pours, advice.reach.probability, advice.stop, answer_loss, least
        if advice.stop:
            return
        new = simulator.pour(advice.batch, 2, random)
        data = ObservedSamples(
            np.vstack([data.unit_points, new.unit_points]),
            np.concatenate([data.values, new.values]),
        )


def summary(table):
    """Share of the campaigns that have stopped so, by number of pours."""
    heads = " | ".join(f"by {pours}" for pours in LOOKS)
    yield f"| responses | target | campaigns | {heads} | Eq. 11 above the least, median |"
    yield f"|{'---|' * (len(LOOKS) + 4)}"
    for (k, kind), rows in table.groupby(["responses", "kind"]):
        stopped = rows[rows["stop"] == "out_of_reach"]
        count = rows["campaign"].nunique()
        shares = " | ".join(
            f"{(stopped['pours'] <= pours).sum() / count:.2f}" for pours in LOOKS
        )
        yield f"| {k} | {kind} | {count} | {shares} | {(stopped['F'] - stopped['F_least']).median():.2f} |"


def main():
    parser = options(__doc__, "research/answers/out_of_reach.csv")
    parser.add_argument(
        "--campaigns", type=int, nargs=2, default=[1000, 1050], metavar=("FROM", "TO")
    )
    args = parser.parse_args()
    study = PipelineConfig.load(args.config)
    config = study.config
    space = study.parameters
    section = SequentialSettings(
        **config["sequential"] | {"most_pours": max(LOOKS), "probability": 0.99}
    )
    simulator = Simulator(args.pool, args.responses, config)
    mean = dense(simulator, space.dimensions)[1]
    columns = [
        "kind",
        "responses",
        "campaign",
        "pours",
        "in_reach",
        "stop",
        "F",
        "F_least",
    ]
    table = (
        pd.read_csv(args.out) if args.out.exists() else pd.DataFrame(columns=columns)
    )
    k = len(args.responses)
    kinds = (*KINDS, "default") if k > 1 else KINDS
    for number in range(*args.campaigns):
        for kind in kinds:
            if kind == "default":
                aim = np.array([DEFAULT[name] for name in args.responses])
            else:
                aim = aims(kind, mean, np.random.default_rng([77, number, k]))
            random = np.random.default_rng([5, number, k])
            rows = campaign(
                simulator, args.responses, aim, mean, section, space, random
            )
            new = pd.DataFrame(
                [(kind, k, number, *row) for row in rows], columns=columns
            )
            table = pd.concat([table, new], ignore_index=True)
            table.to_csv(args.out, index=False, float_format="%.4g")
    print(*summary(table), sep="\n")


if __name__ == "__main__":
    main()

"""The campaign of the lifted piles: which of them are run, in which order, and which modulus decides.

    python examples/lifted_piles/campaign.py

runs what is missing, one pile after another on one core, until all are there or the budget of processor time is spent.
With --state it runs nothing and says what is there. README.md has the rules; they were committed before the first pile.
"""

import argparse
import itertools
import math
from collections.abc import Iterator

import discharges
import drums
import lifted_piles
import numpy as np
import pandas as pd
from lifted_piles import OUT, PUBLISHED, name, rows

from repose.common.files import read_json, write_table

BUDGET_H = 10.0
MODULI = (0.01, 0.1, 1.0)  # the softest first
SEEDS = (1, 2)
CORNERS = (
    (0.2, 0.0),
    (0.2, 0.25),
    (0.6, 0.0),
    (0.6, 0.25),
    (0.4, 0.125),
)  # static and rolling friction
RANGES = (0.4, 0.25)
ANGLE_DEG, ONE_ANGLE_DEG, DENSITY_PERCENT = 0.5, 1.0, 0.5
DECKS_STEP_S = 8e-6  # two piles of the middle row have it
THIRD = 3
STIFF = 0.1  # of the discharges at least: a softer grain that falls may pass through the plug
NOT_RECORDED = "not recorded"  # hash of the engine of the runs before it was noted
OTHERS_ROW, OTHERS_MODULUS = 1, 0.1  # of the tilted drum with other grains and walls


def five() -> list[int]:
    """Rows nearest to the corners and the middle of both frictions, each by its ranges."""
    points = rows()[["fric", "rollfric"]].to_numpy()
    return [
        int(rows().index[np.hypot(*((points - corner) / RANGES).T).argmin()])
        for corner in CORNERS
    ]


def there(
    row: int, seed: int, modulus: float, time_step_s: float | None = None
) -> dict | None:
    """The pile's numbers, where it has been run."""
    file = f"{name(row, seed, modulus, time_step_s)}.json"
    return next(
        (
            read_json(folder / file)
            for folder in (OUT, PUBLISHED)
            if (folder / file).exists()
        ),
        None,
    )


def means(row: int, modulus: float) -> pd.Series:
    """Mean angle and density of the seeds of a row; NaN where one is missing."""
    piles = [there(row, seed, modulus) or {} for seed in SEEDS]
    return pd.Series(
        {
            key: np.mean([one.get(key, math.nan) for one in piles])
            for key in ("angle_deg", "density_kg_m3")
        }
    )


def shifts(modulus: float) -> pd.DataFrame:
    """Angle and density of the five at a modulus less those at that of the decks, a row each."""
    return pd.DataFrame(
        {row: means(row, modulus) - means(row, 1.0) for row in five()}
    ).T


def good(modulus: float) -> bool:
    """Whether the five say that a modulus changes neither angle nor density by much."""
    found = shifts(modulus)
    density = found["density_kg_m3"].mean() / np.mean(
        [means(row, 1.0)["density_kg_m3"] for row in five()]
    )
    mean, largest = abs(found["angle_deg"].mean()), found["angle_deg"].abs().max()
    return bool(
        mean <= ANGLE_DEG
        and largest <= ONE_ANGLE_DEG
        and 100.0 * abs(density) <= DENSITY_PERCENT
    )


def jobs() -> Iterator[tuple]:
    """Row, seed, modulus (and time step) of each pile, in the order of the rules; the modulus decides as it goes on."""
    for seed, modulus, row in itertools.product(SEEDS, MODULI, five()):
        yield row, seed, modulus
    modulus = next(factor for factor in MODULI if good(factor))
    yield from (
        (row, seed, modulus)
        for seed, row in itertools.product(SEEDS, numbers(judged=True))
    )
    yield from ((five()[-1], seed, 1.0, DECKS_STEP_S) for seed in SEEDS)


def numbers(judged: bool) -> list[int]:
    """Every third row, or the other ones."""
    every = [int(row) for row in rows().index]
    return (
        every[::THIRD]
        if judged
        else [row for row in every if row not in every[::THIRD]]
    )


def other_jobs() -> Iterator[tuple]:
    """The same of the other rows; a row has both its seeds before the next one begins."""
    modulus = next(factor for factor in MODULI if good(factor))
    yield from (
        (row, seed, modulus)
        for row, seed in itertools.product(numbers(judged=False), SEEDS)
    )


def further_jobs() -> Iterator[tuple]:
    """Drums, tilted drums and discharges: module, and row, seed, modulus (and tilt, grain, walls)."""
    modulus = next(factor for factor in MODULI if good(factor))
    for tilted, seed in itertools.product((False, True), SEEDS):
        yield from (
            (drums, (int(row), seed, modulus, tilted))
            for row in drums.rows(tilted).index
        )
    for seed in SEEDS:
        yield from (
            (discharges, (int(row), seed, max(modulus, STIFF)))
            for row in discharges.rows().index
        )
    for seed, grain, wall in itertools.product(SEEDS, ("sphere", "wheat"), drums.WALLS):
        yield drums, (OTHERS_ROW, seed, OTHERS_MODULUS, True, grain, wall)


def spent_h() -> float:
    """Processor time of all runs that are there, in either folder [h]."""
    files = {
        path.name: path
        for folder in (PUBLISHED, OUT)
        for path in folder.glob("*_seed_*.json")
    }
    return sum(read_json(path)["processor_s"] for path in files.values()) / 3600.0


def predictions(kind: str) -> pd.DataFrame:
    """Every run of a kind (row: pile) that is there, a line each."""
    files = {
        path.name: path
        for folder in (PUBLISHED, OUT)
        for path in folder.glob(f"{kind}_*_seed_*.json")
    }
    table = pd.DataFrame([read_json(path) for _name, path in sorted(files.items())])
    if "engine" not in table:
        table["engine"] = NOT_RECORDED
    return table.fillna({"engine": NOT_RECORDED})


def run_all() -> None:
    """Run what is missing until the budget is spent."""
    piles, others = (
        ((lifted_piles, job) for job in some()) for some in (jobs, other_jobs)
    )
    for of, job in itertools.chain(piles, others, further_jobs()):
        if any(
            (folder / f"{of.name(*job)}.json").exists() for folder in (OUT, PUBLISHED)
        ):
            continue
        if spent_h() >= BUDGET_H:
            print(f"the budget of {BUDGET_H:g} h is spent", flush=True)
            return
        print(of.name(*job), f"{of.one(*job)['processor_s']:.0f} s", flush=True)


def main() -> None:
    """Run what is missing, or say what is there."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument(
        "--state",
        action="store_true",
        help="number of piles, hours, shifts of the softer moduli",
    )
    parser.add_argument(
        "--write", action="store_true", help=f"write what is there to {PUBLISHED}"
    )
    asked = parser.parse_args()
    if asked.write:
        for kind in ("row", "drum", "tilted", "discharge"):
            if len(table := predictions(kind)):
                write_table(PUBLISHED / f"predicted_{kind}.csv", table)
    elif asked.state:
        print(f"{len(predictions('row'))} piles, {spent_h():.2f} h; the five: {five()}")
        for modulus in MODULI[:-1]:
            print(
                f"modulus {modulus:g}:",
                shifts(modulus).round(2).to_string(),
                f"good: {good(modulus)}",
                sep="\n",
            )
    else:
        run_all()


if __name__ == "__main__":
    main()

"""The committed predictions beside the other project's results: differences, slope, density, rates.

    python examples/lifted_piles/compare.py REPOSITORY

reads the predictions of results/published/lifted_piles and the results of a copy of its repository, prints both side by
side, and writes compared_KIND.csv there. README.md has the rules of the judgement; they are older than the predictions.
Without REPOSITORY the tables compared_KIND.csv are judged as they are.

The other project keeps `statistics.pstdev` of the seeds of a row (its calibration/runner.py): of two seeds half of their
difference. The standard deviation of one seed is then sqrt 2 times that. All columns of both sides are read as the latter.
"""

import argparse

import numpy as np
import pandas as pd
from lifted_piles import PUBLISHED
from parameters import table_of
from scipy import stats

from repose.common.files import write_table

# For each kind of run: its table there, our number, theirs, and the largest difference that is allowed.
KINDS = {
    "row": ("pile", "angle_deg", "aor", 1.0),
    "drum": ("drum", "angle_deg", "drum_aor", 1.0),
    "tilted": ("tilted_drum", "angle_deg", "drum45_aor", 1.0),
    "discharge": ("discharge", "rate_g_s", "flow_gs", 3.0),  # per cent
}
OF_THEIRS = [
    "hash",
    "trial_dir",
    "drum_trial",
    "trial",
    "role",
]  # columns that say where they keep a run
# Column with the number of their seeds; where there is none, it is `SEEDS_THERE`.
COUNTS = {"row": "n_ok", "drum": "drum_n_ok", "tilted": "n_ok"}
SEEDS_THERE = 2
DECISIVE = {"grain": "sphere", "walls": "cover"}  # of drums


def ours(kind: str) -> pd.DataFrame:
    """Means over the seeds of each row at the full modulus, which decided, with the number of the seeds."""
    table = pd.read_csv(PUBLISHED / f"predicted_{kind}.csv")
    table = table[table["modulus"] == 1.0]
    if "time_step_s" in table:
        table = table[
            np.isclose(table["time_step_s"], table["time_step_s"].max(), rtol=0.01)
        ]
    for key, value in DECISIVE.items():
        table = table[table[key] == value] if key in table else table
    numbers = [
        key
        for key in ("angle_deg", "rings_angle_deg", "density_kg_m3", "rate_g_s")
        if key in table
    ]
    rows = table.groupby("row")
    return (
        rows[numbers].mean().assign(seeds=rows.size(), seeds_sd=rows[numbers[0]].std())
    )


def seeds_there(kind: str, both: pd.DataFrame) -> pd.Series:
    """Number of their seeds of each row."""
    if kind in COUNTS:
        return both[COUNTS[kind]]
    return pd.Series(SEEDS_THERE, index=both.index)


def seed_scatter(population_sd: pd.Series, seeds: pd.Series | int) -> pd.Series:
    """Standard deviation of one seed, from that of a population of so many."""
    return population_sd * np.sqrt(seeds / (seeds - 1))


def root_mean_square(values: pd.Series) -> float:
    """Root of the mean square."""
    return float(np.sqrt((values**2).mean()))


def compared(kind: str, repository: str) -> pd.DataFrame:
    """Both side by side, a line for each row that has two seeds here."""
    test, own, other, _ = KINDS[kind]
    both = ours(kind).merge(
        table_of(repository, test).drop(columns=OF_THEIRS, errors="ignore"),
        on="row",
        suffixes=("", "_theirs"),
    )
    both["seeds_sd_theirs"] = seed_scatter(
        both[f"{other}_std"], seeds_there(kind, both)
    )
    both["difference"] = both[own] - both[other]
    if kind == "discharge":
        both["difference"] *= 100.0 / both[other]
    if kind == "row":
        both["density_percent"] = 100.0 * (
            both["density_kg_m3"] / both["bulk_density"] - 1.0
        )
    return both[both["seeds"] > 1].dropna(subset=["difference"])


def scatters(kind: str, both: pd.DataFrame) -> tuple[float, float]:
    """Standard deviation of one seed here and there, in the unit of the differences."""
    _, own, other, _ = KINDS[kind]
    here, there = both["seeds_sd"], both["seeds_sd_theirs"]
    if kind == "discharge":
        here, there = 100.0 * here / both[own], 100.0 * there / both[other]
    return root_mean_square(here), root_mean_square(there)


def judged(kind: str, both: pd.DataFrame) -> str:
    """The sentence of a kind."""
    _, own, other, most = KINDS[kind]
    off, unit = both["difference"], "%" if kind == "discharge" else "deg"
    here, there = scatters(kind, both)
    # Equal engines would differ by the scatter of the means of the seeds.
    shares = (1 / both["seeds"]).mean(), (1 / seeds_there(kind, both)).mean()
    equal = np.sqrt(here**2 * shares[0] + there**2 * shares[1])
    chi_squared = float((off**2).sum() / equal**2)
    words = [
        f"{kind}: {len(both)} rows, root mean square {np.sqrt((off**2).mean()):.2f} {unit} (at most {most:g})",
        f"mean {off.mean():+.2f} +- {off.std() / np.sqrt(len(off)):.2f}, largest {off.abs().max():.2f}",
        f"one seed scatters by {here:.2f} here and {there:.2f} there, two differ by {np.sqrt(2.0) * here:.2f} and "
        f"{np.sqrt(2.0) * there:.2f}, equal engines by {equal:.2f} (root mean square)",
        f"chi squared {chi_squared:.0f} on {len(both)}, p {stats.chi2.sf(chi_squared, len(both)):.2g}",
    ]
    if len(both) > 2:
        line = stats.linregress(both[other], both[own])
        words.append(
            f"slope of ours on theirs {line.slope:.3f} +- {line.stderr:.3f}, correlation {line.rvalue:.3f}"
        )
    if "density_percent" in both:
        density = both["density_percent"]
        words.append(
            f"density {density.mean():+.2f} +- {density.std() / np.sqrt(len(density)):.2f} %"
        )
    return "; ".join(words)


def main() -> None:
    """Print the comparison and write its tables."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument(
        "repository",
        nargs="?",
        help="a clone of JoshuaMayo-vectr/DEM-calibration; without it the kept tables are judged",
    )
    parser.add_argument(
        "--kinds",
        nargs="+",
        choices=KINDS,
        default=list(KINDS),
        help="tables of the others stay unread",
    )
    asked = parser.parse_args()
    for kind in asked.kinds:
        table = PUBLISHED / f"compared_{kind}.csv"
        if asked.repository is None:
            if table.is_file():
                print(judged(kind, pd.read_csv(table)))
        elif (PUBLISHED / f"predicted_{kind}.csv").is_file():
            both = compared(kind, asked.repository)
            write_table(table, both.reset_index())
            print(judged(kind, both))


if __name__ == "__main__":
    main()

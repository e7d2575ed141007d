"""The committed predictions beside the other project's results: differences, slope, density, rates.

    python examples/lifted_piles/compare.py REPOSITORY

reads the predictions of results/published/lifted_piles and the results of a copy of its repository, prints both side by
side, and writes compared_KIND.csv there. README.md has the rules of the judgement; they are older than the predictions.
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


def compared(kind: str, repository: str) -> pd.DataFrame:
    """Both side by side, a line for each row that has two seeds here."""
    test, own, other, _ = KINDS[kind]
    both = ours(kind).merge(
        table_of(repository, test).drop(columns=OF_THEIRS, errors="ignore"),
        on="row",
        suffixes=("", "_theirs"),
    )
    both["difference"] = both[own] - both[other]
    if kind == "discharge":
        both["difference"] *= 100.0 / both[other]
    if kind == "row":
        both["density_percent"] = 100.0 * (
            both["density_kg_m3"] / both["bulk_density"] - 1.0
        )
    return both[both["seeds"] > 1].dropna(subset=["difference"])


def judged(kind: str, both: pd.DataFrame) -> str:
    """The sentence of a kind."""
    _, own, other, most = KINDS[kind]
    off, unit = both["difference"], "%" if kind == "discharge" else "deg"
    words = [
        f"{kind}: {len(both)} rows, root mean square {np.sqrt((off**2).mean()):.2f} {unit} (at most {most:g})",
        f"mean {off.mean():+.2f} +- {off.std() / np.sqrt(len(off)):.2f}, largest {off.abs().max():.2f}",
        f"two seeds here differ by {np.sqrt(2.0 * (both['seeds_sd'] ** 2).mean()):.2f} (root mean square)",
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
        "repository", help="a clone of JoshuaMayo-vectr/DEM-calibration"
    )
    parser.add_argument(
        "--kinds",
        nargs="+",
        choices=KINDS,
        default=list(KINDS),
        help="tables of the others stay unread",
    )
    asked = parser.parse_args()
    repository = asked.repository
    for kind in asked.kinds:
        if (PUBLISHED / f"predicted_{kind}.csv").is_file():
            both = compared(kind, repository)
            write_table(PUBLISHED / f"compared_{kind}.csv", both.reset_index())
            print(judged(kind, both))


if __name__ == "__main__":
    main()

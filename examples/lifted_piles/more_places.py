"""Drums and discharges at ten further places of the box, for a surrogate of both.

    python examples/lifted_piles/more_places.py

runs what is missing, a drum and a discharge at each place with one seed and the full modulus, and writes more_drum.csv
and more_discharge.csv to results/published/lifted_piles. The places do not depend on any result.
"""

from functools import partial

import discharges
import drums
import numpy as np
import pandas as pd
from lifted_piles import OUT, PUBLISHED, Contents
from scipy.spatial.distance import cdist
from scipy.stats import qmc

from repose.common.files import read_json, write_json, write_table

# Ranges of the static friction, the rolling friction and the restitution of the 45 piles.
LOW, HIGH = np.array([0.2, 0.0, 0.3]), np.array([0.6, 0.25, 0.7])
POWERS = np.array([1.0, 0.5, 1.0])
PLACES, CANDIDATES, SEED = 10, 1024, 1
KEYS = {"drum": ["angle_deg", "left"], "discharge": ["rate_g_s", "early"]}
RECORDED = ["grains", "time_step_s", "processor_s", "engine"]
MEASURED = {
    "drum": partial(drums.measured, tilted=False),
    "discharge": discharges.measured,
}


def places() -> np.ndarray:
    """Places (10, 3), each the candidate that is farthest from all drums and places before it.

    Distances are in the root of the rolling friction, in which the surrogate learns, too.
    """
    known = drums.rows(tilted=False)[list(Contents._fields)].to_numpy()
    chosen = ((known - LOW) / (HIGH - LOW)) ** POWERS
    points = qmc.Sobol(len(LOW), seed=SEED).random(CANDIDATES)
    for _ in range(PLACES):
        farthest = cdist(points, chosen).min(axis=1).argmax()
        chosen = np.vstack([chosen, points[farthest]])
    return LOW + chosen[len(known) :] ** (1.0 / POWERS) * (HIGH - LOW)


def one(kind: str, place: int, contents: Contents) -> dict:
    """Run a drum or a discharge, or read the file that has it."""
    path = OUT / f"{kind}_place_{place}_seed_{SEED}.json"
    if not path.exists():
        record = {"place": place, "seed": SEED, **contents._asdict()}
        write_json(path, record | MEASURED[kind](contents, SEED))
    return read_json(path)


def main() -> None:
    """Run the places, and write their tables after each."""
    records: dict[str, list[dict]] = {kind: [] for kind in KEYS}
    for place, values in enumerate(places(), start=1):
        contents = Contents(*map(float, values))
        for kind, found in records.items():
            found.append(one(kind, place, contents))
            columns = ["place", "seed", *Contents._fields, *KEYS[kind], *RECORDED]
            write_table(PUBLISHED / f"more_{kind}.csv", pd.DataFrame(found)[columns])
            print(kind, place, found[-1][KEYS[kind][0]], flush=True)


if __name__ == "__main__":
    main()

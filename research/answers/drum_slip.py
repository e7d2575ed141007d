"""Why the bed of the article's drum slips earlier than ours: explanations that pours can test.

    python -m research.answers.drum_slip --out research/answers/drum_slip.csv

Turns the drum of `config/config.yaml` with several sets of parameters, six seeds each, and writes a row for each run.
research/docs/drum_slip.md says what each explanation predicts, and how the rows judge it. A run takes some 15 s; one
that is in the table already is not repeated.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from repose.bench import bench
from repose.config.pipeline import PipelineConfig
from repose.measure.bed import equivalent_diameter

ANSWERS = Path("results/published/goji_berry/validation/table4.csv")
ARTICLE = Path("resources/published/table4.csv")
WALL_FRICTIONS = (0.3, 0.2, 0.1)  # below the range of `mus_gp`
SEEDS = range(1, 7)
COLUMNS = (
    "case",
    "seed",
    "status",
    "start_surface_deg",
    "report_turned_deg",
    "moved_grains",
    "moved_share",
    "bed_moved_mm",
    "before_turned_deg",
    "before_surface_deg",
    "wall_moved_mm",
)


def cases(parameters):
    """Return the parameter sets by name."""
    answers = pd.read_csv(ANSWERS)
    answer = answers[answers["role"] == "representative"].iloc[0]
    sets = pd.read_csv(ARTICLE)
    article = sets[sets["solution"] == "representative"].iloc[0]
    values = {
        "our answer": {name: float(answer[name]) for name in parameters},
        "article's answer": {name: float(article[name]) for name in parameters},
    }
    for friction in WALL_FRICTIONS:
        smoother = values["article's answer"] | {"mus_gp": friction}
        values[f"article's answer, mus_gp {friction:g}"] = smoother
    return values


def motion_against_drum(start_m, later_m, turned_deg):
    """Distance by which each grain has moved in the frame that turns with the drum.

    Parameters
    ----------
    start_m, later_m : array
        Centres (N, 3) [m] when the rotation began, and later; the drum's axis is y.
    turned_deg : float
        Angle by which the drum has turned in between; it carries +z towards +x at the
        bottom, so a grain that moves with it goes from (0, -r) towards (+r, 0) in (x, z).

    Returns
    -------
    array
        Vectors (N, 3) [m].
    """
    angle = np.radians(turned_deg)
    x, y, z = start_m.T
    carried = np.column_stack(
        [
            x * np.cos(angle) - z * np.sin(angle),
            y,
            x * np.sin(angle) + z * np.cos(angle),
        ]
    )
    return later_m - carried


def turned(study, parameters, seed):
    """Turn the drum once and return the numbers of the table."""
    test = bench("drum")
    scene = study.scene(parameters, seed)
    run = test.run(scene)
    measured = test.result(run.record, run.arrays, scene)
    row = {name: measured.get(name) for name in COLUMNS if name in measured}
    row["seed"] = seed
    row["status"] = measured["status"]
    if "position_report" not in run.arrays:
        return row

    motion_m = motion_against_drum(
        run.arrays["position_start"],
        run.arrays["position_report"],
        float(run.arrays["turned_report_deg"]),
    )
    distance_mm = 1e3 * np.linalg.norm(motion_m, axis=1)
    diameter_mm = 1e3 * equivalent_diameter(scene.particle)
    has_moved = distance_mm > diameter_mm
    row["moved_grains"] = int(has_moved.sum())
    row["moved_share"] = float(has_moved.mean())
    row["bed_moved_mm"] = float(1e3 * np.linalg.norm(motion_m.mean(axis=0)))
    return row


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--config", nargs="+", default=["config/config.yaml"])
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    args = parser.parse_args()

    study = PipelineConfig.load(*args.config)
    rows = pd.read_csv(args.out).to_dict("records") if args.out.exists() else []
    finished = {(row["case"], row["seed"]) for row in rows}
    for name, parameters in cases(study.parameters.names).items():
        for seed in args.seeds:
            if (name, seed) in finished:
                continue
            rows.append({"case": name, **turned(study, parameters, seed)})
            pd.DataFrame(rows, columns=COLUMNS).to_csv(args.out, index=False)
            print(rows[-1], flush=True)


if __name__ == "__main__":
    main()

"""The angles of four bench tests, with one grain and one set of parameters.

python examples/bench_tests/beside.py

The parameters are the centre of the ranges.
"""

from pathlib import Path

from repose.bench import bench
from repose.calibrate.runs import mean_and_error
from repose.config.pipeline import PipelineConfig
from repose.stages.job import run_once

FOLDER = Path(__file__).parent
ANGLES = {
    "funnel": ("aor_deg",),
    "lifted_cylinder": ("lifted_aor_deg",),
    "drawdown": ("drawdown_above_deg", "drawdown_below_deg"),
    "turning": ("turning_deg", "turning_2_deg"),
}
SEEDS = range(1, 7)


def main():
    """Print a row for each angle."""
    print("| bench test | response | angle, deg | runs |\n|---|---|---|---|")
    for name, responses in ANGLES.items():
        runs = run_all_seeds(name)
        for response in responses:
            angles = [run[response] for run in runs if run.get(response) is not None]
            mean, error = mean_and_error(angles)
            text = "no number" if mean is None else f"{mean:.1f} ± {error or 0:.1f}"
            print(f"| {name} | `{response}` | {text} | {len(angles)} |", flush=True)


def run_all_seeds(name):
    """Run a bench test with each seed; return the measured runs."""
    files = ["config/config.yaml"]
    own_file = FOLDER / f"{name}.yaml"
    if own_file.exists():
        files.append(own_file)
    study = PipelineConfig.load(*files)
    runs = []
    for seed in SEEDS:
        scene = study.scene(study.parameters.centre, seed)
        measured, _ = run_once(bench(name), scene)
        runs.append(measured)
    return runs


if __name__ == "__main__":
    main()

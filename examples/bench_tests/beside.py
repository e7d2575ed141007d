"""One grain with one set of parameters, the centre of the ranges: its angles in four bench tests beside each other.

python examples/bench_tests/beside.py
"""

from pathlib import Path

from repose.bench import bench
from repose.calibrate.runs import mean_and_error
from repose.config.pipeline import PipelineConfig
from repose.stages.job import run_once

HERE = Path(__file__).parent
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
        own = HERE / f"{name}.yaml"
        study = PipelineConfig.load(
            "config/config.yaml", *([own] if own.exists() else [])
        )
        test, values = bench(name), study.parameters.centre
        measured = []
        for seed in SEEDS:
            measured += [run_once(test, study.scene(values, seed))[0]]
        for response in responses:
            angles = [
                one[response] for one in measured if one.get(response) is not None
            ]
            mean, error = mean_and_error(angles)
            shown = "no number" if mean is None else f"{mean:.1f} ± {error or 0:.1f}"
            print(f"| {name} | `{response}` | {shown} | {len(angles)} |", flush=True)


if __name__ == "__main__":
    main()

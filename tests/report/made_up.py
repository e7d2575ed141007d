"""Made-up inputs of the figures of the main chain and the drum: smooth numbers in the workflow's columns."""

import json

import made_up_studies
import matplotlib.text
import numpy as np
import pandas as pd
from shared import RANGES, TARGETS, every_bench_test

from repose.bench.parameters import PARAMETERS
from repose.calibrate.responses import name_derived_column
from repose.calibrate.targets import Targets
from repose.grain import build
from repose.report import figures

MEASURE = every_bench_test()["measure"] | {
    "views": 2,
    "mm_per_pixel": 0.5,
    "response": "flank",
}
# the fewest are searched for long
BERRY = every_bench_test()["berry"] | {"spheres": 14}
CONFIG = every_bench_test() | {"measure": MEASURE, "berry": BERRY, "small_run": False}
PUBLISHED = ("aor_deg", "height_mm")


def cone_of_berries(count=260, height_m=0.06, radius_m=0.11):
    """Centres and quaternions of berries scattered in a cone: looks like a pile, holds no physics."""
    rng = np.random.default_rng(3)
    a, b, c = rng.random((count, 3)).T
    z = height_m * (1 - a ** (1 / 3)) + 0.004
    r = radius_m * (1 - z / (height_m + 0.005)) * np.sqrt(b)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.column_stack(
        [r * np.cos(6.283 * c), r * np.sin(6.283 * c), z]
    ), quaternions


def made_up_tables(folder, targets=TARGETS):
    """Tables of the workflow's columns with smooth made-up responses, and a network of their names."""
    rng = np.random.default_rng(1)
    targets = Targets.of(targets)
    samples_ = pd.DataFrame(
        {name: rng.uniform(*RANGES[name], 150) for name in PARAMETERS}
    )
    trend = (
        sum(
            (samples_[name] - low) / (high - low)
            for name, (low, high) in RANGES.items()
        )
        - 3
    )
    samples_.insert(0, "sample", np.arange(1, 151))
    dataset = samples_.assign(status="ok", reason="", n_seeds=8, discharge_s=16.5)
    split = np.repeat(["train", "validation", "test"], [106, 22, 22])
    predictions = pd.DataFrame({"sample": dataset["sample"], "split": split})
    narrow = {
        n: low + (high - low) * rng.uniform(0.3, 0.55, 90)
        for n, (low, high) in RANGES.items()
    }
    feasible = pd.DataFrame(
        {"solution": np.arange(1, 91), **narrow, "objective": rng.random(90)}
    )
    feasible["feasible"] = True
    feasible["representative"] = feasible.index == 0
    table4 = feasible.iloc[[0, 3, 20, 40, 60, 80]][["solution", *PARAMETERS]].copy()
    published = table4.assign(solution=["22", "15", "56", "84", "2", "representative"])
    table4["role"] = ["representative"] + 5 * ["spread"]
    theirs = published[["solution"]][:2].copy()
    for target in targets:
        response = target.response
        sd = target.sd
        predictions[response.predicted] = target.value + 2 * sd * trend
        values = predictions[response.predicted] + rng.normal(0, 0.5 * sd, 150)
        dataset[response.name] = predictions[response.name] = values
        dataset[response.standard_error] = rng.uniform(0.2, 0.4, 150) * sd
        feasible[response.predicted] = rng.normal(target.value, 0.1 * sd, 90)
        table4[response.predicted] = target.value
        for table, mean in ((table4, target.value), (published, target.value - 2 * sd)):
            table[response.simulated] = rng.normal(mean, 0.5 * sd, 6)
            table[response.standard_error] = 0.3 * sd
        if response.name in PUBLISHED:
            published[name_derived_column(response.name, "published_simulated")] = (
                target.value
            )
            theirs[response.predicted] = target.value
            theirs[response.simulated] = 0.99 * target.value
    failed = [4, 50, 70]
    dataset.loc[failed, ["status", "reason"]] = [
        "jammed",
        "3 berries in the funnel at the end",
    ]
    dataset.loc[failed, [*targets.names, *targets.errors]] = np.nan
    comparison = pd.DataFrame(
        {"method": ["random", "lhsdesign", "optimal"], "min_distance": [0.13, 0.2, 0.4]}
    )
    frames = {
        "samples": samples_,
        "dataset": dataset,
        "predictions": predictions.drop(failed),
        "feasible": feasible,
        "table4": table4,
        "published": published,
        "theirs": theirs,
    }
    frames["comparison"] = comparison
    for name, frame in frames.items():
        frame.to_csv(folder / f"{name}.csv", index=False)
    write_network(
        folder / "network.json",
        targets.names,
        rng.normal(size=(12, 6)),
        rng.normal(size=(len(targets), 12)),
    )
    return {path.stem: path for path in folder.iterdir()}


def write_network(path, outputs, W1, W2):
    low, high = np.transpose([RANGES[name] for name in PARAMETERS])
    arrays = {
        "W1": W1,
        "b1": np.zeros(len(W1)),
        "W2": W2,
        "b2": np.full(len(W2), 0.5),
        "input_min": low,
        "input_max": high,
        "output_min": np.zeros(len(W2)),
        "output_max": np.ones(len(W2)),
    }
    content = {name: np.asarray(value).tolist() for name, value in arrays.items()}
    content |= {
        "inputs": list(PARAMETERS),
        "outputs": list(outputs),
        "surrogate": "network",
    }
    path.write_text(
        json.dumps(
            content | {"scaled_range": [-1.0, 1.0], "activation": ["tansig", "purelin"]}
        )
    )


def made_up_drum(folder, centres, quaternions):
    """States, record, runs and profile of a drum with the workflow's columns."""
    turned = {"start": 0.0, "report": 27.0, "before": 51.0, "after": 53.0}
    states = {f"turned_{state}_deg": angle for state, angle in turned.items()}
    states |= {f"position_{state}": centres for state in turned}
    np.savez(
        folder / "states.npz",
        **states,
        **{f"quaternion_{state}": quaternions for state in turned},
    )
    time_s = np.arange(0.0, 12.0, 0.1)
    angle = np.minimum(5.0 * time_s, 44.0) - np.where(time_s > 10.2, 4.0, 0.0)
    record = pd.DataFrame(
        {
            "seed": 7,
            "time_s": time_s,
            "turned_deg": 5.0 * time_s,
            "surface_deg": angle + 1,
        }
    )
    record.assign(bed_deg=angle, energy_j=1e-8).to_csv(
        folder / "record.csv", index=False
    )
    run = {
        "seed": 7,
        "status": "ok",
        "report_time_s": 5.4,
        "before_time_s": 10.2,
        "after_time_s": 12.0,
        "before_bed_deg": 44.0,
        "before_turned_deg": 51.0,
    }
    pd.DataFrame([run]).to_csv(folder / "runs.csv", index=False)
    depth = np.arange(2.5, 50.0, 5.0)
    profile = pd.DataFrame(
        {"seed": 7, "depth_mm": depth, "moved_mm": 60 * np.exp(-depth / 12)}
    )
    profile.assign(moved_sd_mm=5.0, berries=40).to_csv(
        folder / "profile.csv", index=False
    )


def made_up_inputs(folder):
    """Made-up inputs of every figure in a folder: name of the file without its ending to its path."""
    made_up_tables(folder)
    long = np.random.default_rng(2).normal(21, 2, 50)
    sizes = pd.DataFrame(
        {"long_mm": long, "major_mm": 0.54 * long, "minor_mm": 0.46 * long}
    )
    (folder / "sizes.csv").write_text("# reconstruction\n" + sizes.to_csv(index=False))
    mesh = build.ellipsoid_mesh([21.14, 11.37, 9.88], subdivisions=3)
    mesh.export(folder / "berry.stl")
    build.fit_particle(mesh, 840.47).save(folder / "particle.json")
    (folder / "axes.json").write_text(
        '{"long_mm": 21.14, "major_mm": 11.37, "minor_mm": 9.88}'
    )
    centres, quaternions = cone_of_berries()
    np.savez(
        folder / "heap.npz",
        position_7=centres,
        quaternion_7=quaternions,
        in_pile_7=np.ones(len(centres), bool),
    )
    frames = np.float32([centres * np.nan, centres, centres])
    turns = np.float32([quaternions] * 3)
    np.savez(
        folder / "trajectory.npz",
        time_s=[0.0, 9.0, 18.0],
        position=frames,
        quaternion=turns,
    )
    made_up_drum(folder, centres - [0.0, 0.0, 0.1], quaternions)
    (folder / "summary.json").write_text(json.dumps({"feasible": True, "message": ""}))
    low = [0.199, 0.600, 0.036, 0.202, 0.455, 0.181]
    high = [0.256, 0.659, 0.038, 0.248, 0.529, 0.188]
    pd.DataFrame({"parameter": PARAMETERS, "low": low, "high": high}).to_csv(
        folder / "table3.csv", index=False
    )
    made_up_studies.write(folder, CONFIG)
    return {path.stem: path for path in folder.iterdir()} | {"folder": folder}


def inputs_of(name, inputs):
    further = {
        "figure14": {"published": "table3"},
        "validation": {"published": "table4"},
        "noise": {"runs": "noise_runs"},
        "plane": {"pool": "dataset", "fresh": "dataset"},
        "figure13": {"fresh": "dataset"},
        "corner": {"summary": "posterior_summary"},
        "region": {"summary": "posterior_summary"},
    }
    files = {"stl": "berry", "berry": "axes"} | further.get(name, {})
    return {
        key: inputs[files.get(key, key)] for key in figures.FIGURES[name].all_inputs
    }


def texts_of(figure):
    return " | ".join(text.get_text() for text in figure.findobj(matplotlib.text.Text))

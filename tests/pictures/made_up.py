"""Made-up inputs of the figures: smooth numbers in the workflow's columns, no physics."""

import json

import matplotlib.text
import numpy as np
import pandas as pd
from shared import TARGETS

from repose.core.parameters import PARAMETERS
from repose.core.targets import Targets
from repose.measure.angles import DEFINITIONS
from repose.particle import build
from repose.pictures import figures
from repose.pictures.figures import (
    inversion,
)
from repose.studies import noise
from repose.studies.comparison.search import REFERENCE

RANGES = dict(
    zip(PARAMETERS, ([0.1, 0.4], [0.35, 0.75], [0.02, 0.07], [0.2, 0.5], [0.4, 0.8], [0.1, 0.3]), strict=True)
)
CONFIG = {
    "compare_search": {"tolerance": 0.01},
    "shape_study": {
        "particles": dict.fromkeys(("ellipsoid", "rough_spheres")),
        "fillings": dict.fromkeys(("open_cone", "lying")),
    },
    "berry": {"spheres": 14, "surface": "smooth"},
    "small_run": False,
    "parameters": RANGES,
    "design": {"method": "optimal"},
    "funnel": {
        "inlet_diameter_mm": 150.0,
        "outlet_diameter_mm": 32.0,
        "cone_angle_deg": 60.0,
        "tube_length_mm": 0.0,
        "rim_radius_mm": 1.0,
        "outlet_height_mm": 100.0,
        "plate_diameter_mm": 600.0,
        "factory_height_mm": 12.0,
        "factory_diameter_mm": 150.0,
    },
    "measure": {
        "views": 2,
        "mm_per_pixel": 0.5,
        "response": "flank",
        "fit_from": 0.1,
        "fit_to": 0.8,
        "berry_height_mm": None,
        "largest_pile_only": True,
        "flank": "columns",
    },
    "drum": {
        "outer_diameter_mm": 300.0,
        "wall_thickness_mm": 5.0,
        "length_mm": 340.0,
        "angular_velocity_rad_s": 0.0873,
        "report_s": 10.0,
        "fit_share": 0.6,
    },
    "refine": {"tolerance_percent": 1.0, "standard_error_percent": 0.7},
    "targets": TARGETS,
}
DOT = """digraph snakemake_dag {
    graph[bgcolor=white, margin=0];
    0[label = "all", color = "0.0 0.6 0.85", style="rounded"];
    1[label = "report", color = "0.1 0.6 0.85", style="rounded"];
    2[label = "heap", color = "0.3 0.6 0.85", style="rounded,dashed"];
    3[label = "design", color = "0.5 0.6 0.85", style="rounded"];
    4[label = "berry", color = "0.6 0.6 0.85", style="rounded"];
    1 -> 0
    2 -> 1
    3 -> 2
    4 -> 2
    4 -> 0
}
"""


def cone_of_berries(count=260, height_m=0.06, radius_m=0.11):
    """Centres and quaternions of berries scattered in a cone: looks like a pile, holds no physics."""
    rng = np.random.default_rng(3)
    share = rng.random((count, 3))
    z = height_m * (1 - share[:, 0] ** (1 / 3)) + 0.004
    r = radius_m * (1 - z / (height_m + 0.005)) * np.sqrt(share[:, 1])
    centres = np.column_stack([r * np.cos(6.283 * share[:, 2]), r * np.sin(6.283 * share[:, 2]), z])
    quaternions = rng.normal(size=(count, 4))
    return centres, quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def made_up_tables(folder):
    """Tables of the workflow's columns with smooth made-up responses; returns the frames."""
    rng = np.random.default_rng(1)
    table = pd.DataFrame({name: rng.uniform(*RANGES[name], 150) for name in PARAMETERS})
    unit = {name: (table[name] - low) / (high - low) for name, (low, high) in RANGES.items()}
    aor = 20 + 4 * unit["mus_gp"] + 4 * unit["mur_gg"] - 2 * unit["e_gg"]
    height = 50 + 9 * unit["mus_gp"] + 9 * unit["mur_gg"] - 6 * unit["e_gg"]
    table.insert(0, "sample", np.arange(1, 151))
    samples_ = table.copy()
    table["status"], table["reason"], table["n_seeds"] = "ok", "", 8
    table["aor_deg"], table["aor_se_deg"] = aor + rng.normal(0, 0.5, 150), rng.uniform(0.3, 0.7, 150)
    table["height_mm"], table["height_se_mm"] = height + rng.normal(0, 1, 150), rng.uniform(0.6, 1.4, 150)
    table["discharge_s"] = 16.5
    table.loc[[4, 50, 70], ["status", "reason"]] = ["jammed", "3 berries in the funnel at the end"]
    table.loc[[4, 50, 70], ["aor_deg", "aor_se_deg", "height_mm", "height_se_mm"]] = np.nan
    good = table[table["status"] == "ok"]
    split = np.repeat(["train", "validation", "test"], [103, 22, 22])
    predictions = pd.DataFrame({"sample": good["sample"], "split": split, "aor_deg": good["aor_deg"]})
    predictions["aor_predicted_deg"] = aor[good.index]
    predictions["height_mm"], predictions["height_predicted_mm"] = good["height_mm"], height[good.index]
    narrow = {n: low + (high - low) * rng.uniform(0.3, 0.55, 90) for n, (low, high) in RANGES.items()}
    feasible = pd.DataFrame({"solution": np.arange(1, 91), **narrow})
    feasible["aor_predicted_deg"] = rng.normal(32.8, 0.2, 90)
    feasible["height_predicted_mm"] = rng.normal(65.6, 0.4, 90)
    feasible["objective"] = rng.random(90)
    feasible["feasible"], feasible["representative"] = True, feasible.index == 0
    generation = np.arange(0, 8701, 10)
    history = pd.DataFrame({"round": generation // 10, "generation": generation})
    history["evaluations"] = 200 * (generation + 1)
    history["best_objective"] = 0.002 + np.exp(-generation / 300)
    history["mean_objective"] = 0.05 + 1.2 * np.exp(-generation / 400)
    history["feasible_found"] = np.maximum(0, generation - 400) * 3
    table4 = feasible.iloc[[0, 3, 20, 40, 60, 80]][["solution", *PARAMETERS]].copy()
    table4["aor_predicted_deg"], table4["height_predicted_mm"] = 32.8, 65.6
    for column, centre, sd in (("aor_simulated_deg", 32, 0.7), ("height_simulated_mm", 65, 1.2)):
        table4[column] = centre + sd * rng.normal(size=6)
    table4["role"] = ["representative"] + 5 * ["spread"]
    table4["aor_se_deg"], table4["height_se_mm"] = 0.5, 1.1
    published = table4.drop(columns=["role", "aor_predicted_deg", "height_predicted_mm"])
    published["aor_published_simulated_deg"], published["height_published_simulated_mm"] = 32.0, 65.0
    published["solution"] = ["22", "15", "56", "84", "2", "representative"]
    comparison = pd.DataFrame(
        {"method": ["random", "lhsdesign", "optimal"], "samples": 150, "min_distance": [0.13, 0.2, 0.4]}
    )
    frames = {
        "samples": samples_,
        "dataset": table,
        "predictions": predictions,
        "feasible": feasible,
        "history": history,
        "table4": table4,
        "published": published,
        "comparison": comparison,
    }
    for name, frame in frames.items():
        frame.to_csv(folder / f"{name}.csv", index=False)
    return frames


def made_up_drum(folder, centres, quaternions):
    """States, record, runs and profile of a drum with the workflow's columns."""
    turned = {"start": 0.0, "report": 27.0, "before": 51.0, "after": 53.0}
    states = {f"turned_{state}_deg": angle for state, angle in turned.items()}
    states |= {f"position_{state}": centres for state in turned}
    np.savez(folder / "states.npz", **states, **{f"quaternion_{state}": quaternions for state in turned})
    time_s = np.arange(0.0, 12.0, 0.1)
    angle = np.minimum(5.0 * time_s, 44.0) - np.where(time_s > 10.2, 4.0, 0.0)
    record = pd.DataFrame({"seed": 7, "time_s": time_s, "turned_deg": 5.0 * time_s, "surface_deg": angle + 1})
    record.assign(bed_deg=angle, energy_j=1e-8).to_csv(folder / "record.csv", index=False)
    run = {"seed": 7, "status": "ok", "report_time_s": 5.4, "before_time_s": 10.2, "before_bed_deg": 44.0}
    pd.DataFrame([run | {"after_time_s": 12.0}]).to_csv(folder / "runs.csv", index=False)
    depth = np.arange(2.5, 50.0, 5.0)
    profile = pd.DataFrame({"seed": 7, "depth_mm": depth, "moved_mm": 60 * np.exp(-depth / 12)})
    profile.assign(moved_sd_mm=5.0, berries=40).to_csv(folder / "profile.csv", index=False)


def made_up_inputs(folder):
    """Made-up inputs of every figure in a folder: name of the file without its ending to its path."""
    made_up_tables(folder)
    rng = np.random.default_rng(2)
    long = rng.normal(21, 2, 50)
    sizes = pd.DataFrame({"long_mm": long, "major_mm": 0.54 * long, "minor_mm": 0.46 * long})
    (folder / "sizes.csv").write_text("# reconstruction\n" + sizes.to_csv(index=False))
    mesh = build.ellipsoid_mesh([21.14, 11.37, 9.88], subdivisions=3)
    mesh.export(folder / "berry.stl")
    build.fit_particle(mesh, 840.47).save(folder / "particle.json")
    (folder / "axes.json").write_text('{"long_mm": 21.14, "major_mm": 11.37, "minor_mm": 9.88}')
    centres, quaternions = cone_of_berries()
    in_pile = np.ones(len(centres), bool)
    np.savez(folder / "heap.npz", position_7=centres, quaternion_7=quaternions, in_pile_7=in_pile)
    frames = np.stack([np.full_like(centres, np.nan), centres, centres]).astype(np.float32)
    turns = np.stack([quaternions] * 3).astype(np.float32)
    np.savez(folder / "trajectory.npz", time_s=[0.0, 9.0, 18.0], position=frames, quaternion=turns)
    made_up_drum(folder, centres - [0.0, 0.0, 0.1], quaternions)
    network = {"inputs": list(PARAMETERS), "outputs": ["aor_deg", "height_mm"]}
    network |= {"W1": rng.normal(size=(12, 6)).tolist(), "W2": rng.normal(size=(2, 12)).tolist()}
    (folder / "network.json").write_text(json.dumps(network | {"activation": ["tansig", "purelin"]}))
    (folder / "summary.json").write_text(json.dumps({"feasible": True, "message": ""}))
    (folder / "rules.dot").write_text(DOT)
    intervals = pd.DataFrame({"parameter": PARAMETERS})
    intervals["low"] = [0.199, 0.600, 0.036, 0.202, 0.455, 0.181]
    intervals["high"] = [0.256, 0.659, 0.038, 0.248, 0.529, 0.188]
    intervals.to_csv(folder / "table3.csv", index=False)
    made_up_uncertainty(folder, rng)
    made_up_pool_comparisons(folder)
    made_up_representations(folder)
    made_up_comparisons(folder)
    made_up_rounds(folder)
    return {path.stem: path for path in folder.iterdir()} | {"folder": folder}


def made_up_pool_comparisons(folder):
    """Tables of the comparisons on the pool: shares that rise with the simulations."""
    both = [("aor_deg", 0.0), ("height_mm", -0.02)]
    rows = []
    for response, less in both:
        for source, sizes in (("main design", (600, 900)), ("pool", (240, 480, 1760))):
            for n in sizes:
                share = 1 - 20 / n + less
                row = {"training": source, "simulations": n, "seeds": 4, "response": response}
                row |= {"r2": share - 0.02, "r2_low": share - 0.05, "r2_high": share, "r2_bar": 0.94}
                row |= {
                    "explainable": share,
                    "explainable_low": share - 0.03,
                    "explainable_high": share + 0.02,
                }
                rows.append(row | {"explainable_bar": 0.95, "reachable_r2": 0.99})
    pd.DataFrame(rows).to_csv(folder / "accuracy.csv", index=False)
    rows = []
    for k, model in enumerate(("network", "quadratic surface", "random forest")):
        for response, less in both:
            for training, n in (("pool", 120), ("pool", 440), ("main design", 900)):
                row = {"model": model, "training": training, "simulations": n, "response": response}
                rows.append(row | {"explainable": 1 - 20 / n - 0.05 * k + less, "explainable_se": 0.01})
    pd.DataFrame(rows).to_csv(folder / "surrogates.csv", index=False)
    rows = []
    for response, less in both:
        for design, data in (("optimal", "emulated"), ("random", "emulated"), ("optimal", "real")):
            for n in (30, 150):
                row = {"comparison": "designs", "design": design, "data": data, "fit": "network", "points": n}
                row |= {"seeds": 6, "response": response, "explainable": 1 - 8 / n + less}
                rows.append(row | {"explainable_se": 0.01})
        for seeds in (1, 4, 16):
            row = {
                "comparison": "points against seeds",
                "design": "sobol",
                "data": "emulated",
                "fit": "network",
            }
            row |= {"points": 480 // seeds, "seeds": seeds, "response": response, "explainable": 0.9 + less}
            rows.append(row | {"explainable_se": 0.01})
    pd.DataFrame(rows).to_csv(folder / "sampling.csv", index=False)


def made_up_representations(folder):
    """Two tables of a shape study in which every combination is off by its own distance."""
    section, rows = CONFIG["shape_study"], []
    for i, particle in enumerate(section["particles"]):
        for j, filling in enumerate(section["fillings"]):
            for k, definition in enumerate(DEFINITIONS):
                row = {
                    "particle": particle,
                    "filling": filling,
                    "definition": definition,
                    "distance": 1.0 + i,
                }
                row |= {"aor_difference_deg": i - 2.0 + 3 * k, "height_difference_mm": 4.0 * j - 6.0}
                rows.append(row | {"aor_se_deg": 0.2, "height_se_mm": 0.5})
    pd.DataFrame(rows).to_csv(folder / "combinations.csv", index=False)
    sets = pd.DataFrame({"kind": "published", "definition": "secant", "set": ["2", "15"]})
    sets["aor_deg"], sets["aor_difference_deg"] = [33.0, 32.0], [-0.7, -0.2]
    sets["height_mm"], sets["height_difference_mm"] = [65.0, 66.0], [0.2, 1.8]
    sets.to_csv(folder / "sets.csv", index=False)


def made_up_uncertainty(folder, rng):
    """Tables of noise, posterior and sensitivity; the posterior leans to the upper end of every range."""
    runs = pd.DataFrame({"sample": np.repeat(np.arange(20), 4), "seed": np.tile(np.arange(4), 20)})
    runs["status"] = np.where(rng.random(80) < 0.05, "jammed", "ok")
    for column, mean, spread in (("aor_deg", 24.0, 1.5), ("height_mm", 61.0, 3.0)):
        runs[column] = mean + 1.4 * spread * np.sin(runs["sample"]) + rng.normal(0, spread, 80)
    runs.to_csv(folder / "noise_runs.csv", index=False)
    noise.run(folder / "noise_runs.csv", Targets.of(CONFIG["targets"]), folder / "floor")
    for name in ("seeds.csv", "noise.json"):
        (folder / "floor" / name).rename(folder / name)
    draws = pd.DataFrame(
        {name: low + (high - low) * rng.beta(3, 1, 500) for name, (low, high) in RANGES.items()}
    )
    draws.to_csv(folder / "draws.csv", index=False)
    rows = pd.DataFrame({"parameter": PARAMETERS, "width_ratio": 0.7, "information_bits": 0.4})
    low, high = np.array([RANGES[name] for name in PARAMETERS]).T
    places = {"low": 0, "high": 1, "credible_low": 0.3, "credible_high": 1, "median": 0.8}
    places |= {"published_low": 0.4, "published_high": 0.5, "miga_low": 0.6, "miga_high": 0.62}
    for column, place in places.items():
        rows[column] = low + place * (high - low)
    rows.to_csv(folder / "posterior.csv", index=False)
    summary = {
        "misfit": {"squared_distance": 4.0},
        "thin_share": 0.98,
        "converged": False,
        "largest_r_hat": 1.2,
    }
    predicted = {name: {"mean": 30.0, "low": 29.0, "high": 31.0} for name in ("aor_deg", "height_mm")}
    summary |= {"least_effective_draws": 90.0, "predicted": predicted}
    (folder / "posterior_summary.json").write_text(json.dumps(summary))
    sobol = [
        {"response": response, "parameter": name, "first": 0.15, "first_low": 0.1, "first_high": 0.2}
        | {"total": 0.2, "total_low": 0.18, "total_high": 0.22}
        for response in ("aor_deg", "height_mm")
        for name in PARAMETERS
    ]
    pd.DataFrame(sobol).to_csv(folder / "sobol.csv", index=False)
    effects = pd.concat(
        pd.DataFrame({"parameter": name, "value": np.linspace(*RANGES[name], 5)}) for name in PARAMETERS
    )
    effects["aor_deg"], effects["height_mm"] = np.tile([20, 22, 24, 25, 25.5], 6), 60.0
    effects.to_csv(folder / "effects.csv", index=False)


def made_up_comparisons(folder):
    """Tables of searches, of the whole method, and of further responses."""
    at = np.array([10, 100, 1000])
    curves, methods = [], []
    for k, name in enumerate(inversion.SEARCHES):
        many = at * 10 if name == "miga_whole" else at
        curves.append(pd.DataFrame({"method": name, "evaluations": many, "log10_mean": -k - np.log10(at)}))
        methods.append({"method": name, "reached": 10 - 5 * (name == "random"), "repetitions": 10})
        methods[-1] |= {"evaluations_to_tolerance": 100.0 * (k + 1), "evaluations_to_tolerance_se": 10.0}
        methods[-1] |= {"listed_coverage": 0.05 * k, "met_coverage": 0.06 * k}
    methods.append({"method": REFERENCE, "listed_coverage": 0.5, "met_coverage": 0.5})
    pd.concat(curves).assign(log10_se=0.1).to_csv(folder / "curves.csv", index=False)
    errors = {"listed_coverage_se": 0.01, "met_coverage_se": 0.01}
    pd.DataFrame(methods).assign(**errors).to_csv(folder / "methods.csv", index=False)
    whole = [
        {
            "data": kind,
            "samples": n,
            "method": name,
            "simulations": 6 * n,
            "aor_off_deg": 5 / n,
            "aor_off_deg_se": 1 / n,
        }
        | {"height_off_mm": 9 / n, "height_off_mm_se": 1 / n}
        for kind in inversion.KINDS
        for n in (30, 60)
        for name in inversion.WHOLE
    ]
    pd.DataFrame(whole).to_csv(folder / "whole.csv", index=False)
    sets = ["AoR and Height", "loose_percent", "drum_slip_deg", "whole pile", "pile and drum"]
    information = [
        {
            "discrepancy_percent": p,
            "set": name,
            "bits": 5.0 + k,
            "bits_se": 0.2,
            "gain_bits": k,
            "gain_se_bits": 0.1,
        }
        for p in (0.0, 2.0)
        for k, name in enumerate(sets)
    ]
    pd.DataFrame(information).to_csv(folder / "information.csv", index=False)
    narrowing = [
        {
            "discrepancy_percent": 0.0,
            "set": name,
            "parameter": p,
            "width_ratio": 0.7,
            "over_base": 1 - 0.15 * k,
        }
        for k, name in enumerate(sets)
        for p in PARAMETERS
    ]
    pd.DataFrame(narrowing).to_csv(folder / "narrowing.csv", index=False)
    known = pd.DataFrame({"response": ["aor_deg", "height_mm", "loose_percent", "drum_slip_deg"]})
    known.assign(signal_to_noise=1.5, r2=0.9).to_csv(folder / "responses.csv", index=False)
    pd.DataFrame({"place": [1]}).to_csv(folder / "order.csv", index=False)


def made_up_rounds(folder):
    """Three rounds of a refinement; the second gave no pile, the third is within."""
    rounds = pd.DataFrame({"round": [0, 1, 2], "n_seeds": [64, 20, 63]})
    rounds["outcome"] = ["not within", "no pile", "within"]
    for name, unit, target in (("aor", "deg", 32.87), ("height", "mm", 65.57)):
        rounds[f"{name}_target_{unit}"] = target
        rounds[f"{name}_predicted_{unit}"] = target * np.array([1.0, 1.001, 1.0])
        rounds[f"{name}_simulated_{unit}"] = target * np.array([0.96, np.nan, 1.005])
        rounds[f"{name}_se_{unit}"] = target * np.array([0.006, np.nan, 0.005])
    rounds.to_csv(folder / "rounds.csv", index=False)
    (folder / "refined_summary.json").write_text(json.dumps({"why": "round 2 meets both targets"}))


def inputs_of(name, inputs):
    """The figure's inputs, optional ones included, out of the made-up files."""
    files = {"stl": "berry", "berry": "axes", "dot": "rules"}
    if name == "figure14":
        files["published"] = "table3"
    if name == "validation":
        files["published"] = "table4"
    if name == "noise":
        files["runs"] = "noise_runs"
    if name == "corner":
        files["summary"] = "posterior_summary"
    if name == "approach":
        files["summary"] = "refined_summary"
    keys = figures.FIGURES[name][1] + figures.OPTIONAL.get(name, ())
    return {key: inputs[files.get(key, key)] for key in keys}


def words(figure):
    """All texts of a figure."""
    return " | ".join(text.get_text() for text in figure.findobj(matplotlib.text.Text))

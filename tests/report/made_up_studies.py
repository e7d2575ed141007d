"""Made-up inputs of the studies' figures: smooth numbers in the workflow's columns."""

import itertools
import json

import numpy as np
import pandas as pd

from repose.bench.space import contact_space
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty import noise


def write(folder, config):
    space = contact_space(config["parameters"])
    targets = Targets.of(config["targets"])
    rng = np.random.default_rng(2)
    _noise(folder, rng, targets)
    _uncertainty(folder, rng, space, targets)
    _discrepancy(folder, space)
    _region(folder, space)


def _noise(folder, rng, targets):
    runs = pd.DataFrame(
        {"sample": np.repeat(np.arange(20), 4), "seed": np.tile(np.arange(4), 20)}
    )
    runs["status"] = np.where(rng.random(80) < 0.05, "jammed", "ok")
    for target in targets:
        runs[target.name] = target.value + target.sd * (
            np.sin(runs["sample"]) + rng.normal(0, 0.7, 80)
        )
    runs.to_csv(folder / "noise_runs.csv", index=False)
    noise.write_noise_floor(folder / "noise_runs.csv", targets, folder / "floor")
    for name in ("seeds.csv", "noise.json"):
        (folder / "floor" / name).rename(folder / name)


def _uncertainty(folder, rng, space, targets):
    """Tables of posterior and sensitivity; the posterior leans to the upper end of every range."""
    low = space.low
    high = space.high
    draws = pd.DataFrame(
        low + (high - low) * rng.beta(3, 1, (500, len(low))), columns=list(space.free)
    )
    draws.assign(**space.fixed).to_csv(folder / "draws.csv", index=False)
    rows = pd.DataFrame(
        {"parameter": space.free, "width_ratio": 0.7, "information_bits": 0.4}
    )
    places = {
        "low": 0,
        "high": 1,
        "credible_low": 0.3,
        "credible_high": 1,
        "median": 0.8,
        "published_low": 0.4,
        "published_high": 0.5,
        "miga_low": 0.6,
        "miga_high": 0.62,
    }
    for column, place in places.items():
        rows[column] = low + place * (high - low)
    rows.to_csv(folder / "posterior.csv", index=False)
    summary = {
        "misfit": {"squared_distance": 4.0},
        "thin_share": 0.98,
        "converged": False,
        "largest_r_hat": 1.2,
    }
    predicted = {
        name: {"mean": 30.0, "low": 29.0, "high": 31.0} for name in targets.names
    }
    summary |= {
        "least_effective_draws": 90.0,
        "predicted": predicted,
        "not_implausible_share": 0.5,
    }
    (folder / "posterior_summary.json").write_text(json.dumps(summary))
    sobol = pd.DataFrame(
        itertools.product(targets.names, space.free), columns=["response", "parameter"]
    )
    sobol = sobol.assign(
        first=0.15,
        first_low=0.1,
        first_high=0.2,
        total=0.2,
        total_low=0.18,
        total_high=0.22,
    )
    sobol.to_csv(folder / "sobol.csv", index=False)
    ranges = zip(space.free, low, high, strict=True)
    effects = pd.concat(
        pd.DataFrame({"parameter": name, "value": np.linspace(*ends, 5)})
        for name, *ends in ranges
    )
    for target in targets:
        effects[target.name] = target.value + effects["value"]
    effects.to_csv(folder / "effects.csv", index=False)


def _discrepancy(folder, space):
    """Bits and intervals over a stated discrepancy, independent and correlated, and of a shape study."""
    stated = [
        (percent, correlation, "stated")
        for correlation in (0.0, 0.9)
        for percent in (0.0, 2.0, 10.0)
    ]
    columns = ["discrepancy_percent", "discrepancy_correlation", "evidence"]
    table = pd.DataFrame([*stated, (13.0, 0.8, "shape study")], columns=columns)
    table["information_bits"] = 3.0 / (1.0 + table["discrepancy_percent"])
    table["effective_points"] = np.where(
        table["discrepancy_percent"] > 0.0, 5000.0, 200.0
    )
    for name in space.free:
        table[f"{name}_low"] = 0.2
        table[f"{name}_high"] = 0.3
    table.to_csv(folder / "discrepancy.csv", index=False)


def _region(folder, space):
    """Projections of a region that is all of every pair."""
    pairs = pd.DataFrame(itertools.combinations(space.free, 2), columns=["x", "y"])
    cells = pd.DataFrame(
        itertools.product((0.25, 0.75), repeat=2), columns=["x_quantile", "y_quantile"]
    )
    table = pairs.merge(cells, how="cross").assign(least_implausibility=1.0, share=1.0)
    table.to_csv(folder / "region.csv", index=False)

"""A made-up finished study, small: what a report is made of."""

import json

import numpy as np
import pandas as pd
from made_up import CONFIG, cone_of_berries
from shared import RANGES

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.surrogates import make
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Targets
from repose.grain import build

ANSWER = {
    "e_gg": 0.2,
    "mus_gg": 0.5,
    "mur_gg": 0.04,
    "e_gp": 0.3,
    "mus_gp": 0.6,
    "mur_gp": 0.2,
}
SETTINGS = {
    "hidden": 3,
    "epochs": 60,
    "goal": 0.0,
    "starts": 1,
    "seed": 1,
    "prior": "inputs",
}


def made_up_study(folder, targets, surrogate="network", fixed=(), runs=12):
    """Files of a study in a folder; returns configuration, jobs and files as `page.write_report` takes them."""
    rng = np.random.default_rng(5)
    parameters = {
        name: {"fixed": ANSWER[name]} if name in fixed else RANGES[name]
        for name in PARAMETERS
    }
    config = CONFIG | {
        "targets": targets,
        "parameters": parameters,
        "label": "made <up> & small",
        "small_run": True,
    }
    config |= {"design": {"method": "optimal", "samples": 60}}
    found = Targets.of(targets)
    space = contact_space(parameters)
    X = space.values(rng.random((60, space.dimensions)))
    unit = (X - [RANGES[name][0] for name in PARAMETERS]) / [
        high - low for low, high in RANGES.values()
    ]
    slopes = rng.uniform(-0.1, 0.1, (len(PARAMETERS), len(found)))
    Y = found.value * (
        1 + (unit - 0.5) @ slopes + 0.005 * rng.normal(size=(60, len(found)))
    )
    model = (
        make(surrogate, NetworkSettings.from_keys(SETTINGS))
        .describe(PARAMETERS, found.names)
        .fit(X, Y)
    )
    model.save(folder / "network.json")
    dataset = pd.DataFrame(X, columns=PARAMETERS).assign(
        sample=np.arange(1, 61), status="ok"
    )
    dataset[list(found.names)] = Y
    dataset[list(found.errors)] = 0.4
    answer = np.array([ANSWER[name] for name in PARAMETERS])
    sets = pd.DataFrame(
        answer + 0.01 * np.arange(6)[:, None], columns=PARAMETERS
    ).assign(solution=np.arange(6) + 1)
    table4 = sets.assign(
        role=["representative"] + 5 * ["spread"], n_seeds=runs, status="ok", reason=""
    )
    table4[list(found.predicted)] = model.predict(sets[list(PARAMETERS)].to_numpy())
    simulated = found.value + 0.3 * rng.normal(size=(runs, len(found)))
    for target, values in zip(found, simulated.T, strict=True):
        table4[target.response.simulated] = values.mean()
        table4[target.response.standard_error] = values.std() / runs**0.5
    posterior = pd.DataFrame(
        {
            "parameter": space.free,
            "credible_low": space.low,
            "credible_high": space.high,
        }
    )
    posterior["width_ratio"] = 0.9
    posterior["information_bits"] = 0.1
    posterior["r_hat"] = 1.1
    frames = {
        "dataset": dataset,
        "feasible": sets,
        "table4": table4,
        "posterior": posterior,
    }
    for name, frame in frames.items():
        frame.to_csv(folder / f"{name}.csv", index=False)
    texts = {
        "metrics": {"test": {name: {"r2": 0.9, "rmse": 0.5} for name in found.names}},
        "dataset_summary": {
            "by_status": {"ok": 60},
            "runs_by_status": {"ok": 178, "jammed": 2},
        },
        "summary": {"feasible": True, "message": "6 sets found."},
    }
    files = {name: folder / f"{name}.csv" for name in frames}
    files |= {name: folder / f"{name}.json" for name in ("network", *texts, "particle")}
    for bench, columns in found.benches.items():
        rows = pd.DataFrame(
            simulated[:, columns], columns=[found.names[k] for k in columns]
        )
        runs_of = rows.assign(status="ok", seed=range(runs)).to_dict("records")
        texts[f"job_{bench}"] = {
            "sample": 1,
            "parameters": ANSWER,
            "apparatus": bench,
            "runs": runs_of,
        }
    for name, content in texts.items():
        (folder / f"{name}.json").write_text(json.dumps(content))
    made_up_pour(folder)
    jobs = [folder / f"job_{bench}.json" for bench in found.apparatus]
    return config, jobs, files | {"trajectory": folder / "trajectory.npz"}


def made_up_pour(folder):
    """A particle of spheres, and a pile of 80 of them that falls from 100 mm."""
    particle = build.fit_particle(
        build.ellipsoid_mesh([21.14, 11.37, 9.88], subdivisions=2), 840.47
    )
    particle.save(folder / "particle.json")
    centres, quaternions = cone_of_berries(80)
    positions = np.float32(
        [centres + np.array([0, 0, 0.1]) * share for share in np.linspace(1, 0, 9)]
    )
    positions[:5, 40:] = np.nan
    times = np.linspace(0, 4, 9)
    np.savez(
        folder / "trajectory.npz",
        time_s=times,
        position=positions,
        quaternion=np.float32([quaternions] * 9),
    )

"""One heap job: pour the berries with several seeds and write where they came to rest, to be measured.

A pour that gives no pile to measure is a result too: it gets a status and a reason instead of a number.
"""

from contextlib import nullcontext
from pathlib import Path

import numpy as np

from repose.apparatus import scenes
from repose.core.files import write_json
from repose.core.parameters import PARAMETERS
from repose.measure import pile, saved_pours

# A pile that has lost more than this share of its berries over the edge of the plate is not the pile poured.
LARGEST_LOSS = 0.1


def status_of(poured, funnel, rest_energy_j):
    """Status and reason of a pour before it is measured: ok, unstable, jammed, left_plate or not_at_rest.

    poured: `scenes.Pour`; funnel: the configuration's section of that name; rest_energy_j: of a berry.
    """
    n = funnel["berries"]
    if not np.all(np.isfinite(poured.centres_m)) or not np.isfinite(poured.kinetic_energy_j):
        return "unstable", "a position is not finite; the time step is too long for these contacts"
    if poured.in_funnel or len(poured.centres_m) < n:
        waiting = n - len(poured.centres_m)
        return "jammed", f"{poured.in_funnel} berries in the funnel and {waiting} not yet poured at the end"
    if poured.off_plate > LARGEST_LOSS * n:
        return "left_plate", f"{poured.off_plate} of {n} berries left the plate"
    energy = poured.kinetic_energy_j / max(1, int(poured.in_pile.sum()))
    if energy > rest_energy_j:
        return (
            "not_at_rest",
            f"kinetic energy {energy:.2e} J a berry, more than {funnel['rest_energy_j']:.0e}",
        )
    if 1e3 * poured.largest_motion_m > funnel["rest_motion_mm"]:
        return "not_at_rest", (
            f"a berry moved {1e3 * poured.largest_motion_m:.2f} mm in the last {funnel['rest_window_s']:g} s, "
            f"more than {funnel['rest_motion_mm']:g}"
        )
    return "ok", ""


def pour_once(config, parameters, seed, particle, berry, trajectory_interval_s=None, progress=None):
    """Pour once. Returns the record of the pour (units in its keys) and the `scenes.Pour`."""
    poured = scenes.pour(config, parameters, seed, particle, berry, trajectory_interval_s, progress)
    status, reason = status_of(poured, config["funnel"], config["simulation"]["rest_energy_j"])
    record = {
        "seed": int(seed),
        "status": status,
        "reason": reason,
        "discharge_s": poured.discharge_s if np.isfinite(poured.discharge_s) else None,
        "berries_on_plate": int(poured.on_plate.sum()),
        "berries_in_pile": int(poured.in_pile.sum()),
        "berries_off_plate": poured.off_plate,
        "kinetic_energy_J": poured.kinetic_energy_j if np.isfinite(poured.kinetic_energy_j) else None,
        "wall_s": round(poured.wall_s, 3),
        "us_per_step": round(poured.us_per_step, 2),
    }
    return record, poured


def run_once(config, parameters, seed, particle, berry, trajectory_interval_s=None, progress=None):
    """Pour and measure once. Returns the record of the run (units in its keys) and the `scenes.Pour`."""
    record, poured = pour_once(config, parameters, seed, particle, berry, trajectory_interval_s, progress)
    settings = pile.MeasureSettings.of(config["measure"], berry)
    return saved_pours.measure_pour(record, _arrays(poured), particle, settings), poured


def pour_job(
    config, name, parameters, seeds, particle, berry, out_dir, trajectory_interval_s=None, progress=None
):
    """Pour one parameter set with all its seeds and write OUT/NAME.npz and OUT/NAME.pours.json.

    config: whole configuration; name: stem of the files (the sample's number); parameters: the six by name;
    seeds: integers; particle: `shape.Particle`; berry: mapping with shear_modulus_pa and poisson_ratio;
    trajectory_interval_s: also write OUT/NAME_trajectory_SEED.npz with positions at this interval; progress: called
    with each seed, gives a context manager that is called with the simulated time (see `dem.progress.display`).
    The .npz holds position_SEED (N, 3) m, quaternion_SEED (N, 4) and in_pile_SEED (N,). The JSON is written last
    and in one move, so a file that is there is complete. Returns the JSON's path.
    """
    out_dir = Path(out_dir)
    out_dir.mkdir(parents=True, exist_ok=True)
    pours, finals = [], {}
    for seed in seeds:
        with progress(seed) if progress else nullcontext() as report:
            record, poured = pour_once(
                config, parameters, seed, particle, berry, trajectory_interval_s, report
            )
        pours.append(record)
        finals |= {f"{key}_{seed}": values for key, values in _arrays(poured).items()}
        if poured.frames is not None:
            np.savez_compressed(out_dir / f"{name}_trajectory_{seed}.npz", **poured.frames)
    np.savez_compressed(out_dir / f"{name}.npz", **finals)
    job = {
        "sample": int(name) if str(name).isdigit() else name,
        "config": config["label"],
        "parameters": {p: float(parameters[p]) for p in PARAMETERS},
        "time_step_s": config["simulation"]["time_step_s"],
        "pours": pours,
    }
    path = out_dir / f"{name}{saved_pours.POURS}"
    write_json(path, job)
    return path


def run_job(
    config, name, parameters, seeds, particle, berry, out_dir, trajectory_interval_s=None, progress=None
):
    """Pour one parameter set with all its seeds, measure the piles, and write OUT/NAME.json beside the files
    of `pour_job`, whose arguments these are. Returns the JSON's content."""
    path = pour_job(
        config, name, parameters, seeds, particle, berry, out_dir, trajectory_interval_s, progress
    )
    return saved_pours.measure_job(config, path, particle, berry, out_dir)


def _arrays(poured):
    """What is kept of a pour, in single precision: 0.03 um at the edge of the plate."""
    arrays = {
        "position": poured.centres_m.astype(np.float32),
        "quaternion": poured.quaternions.astype(np.float32),
        "in_pile": poured.in_pile,
    }
    scales = getattr(poured, "scales", None)
    return arrays if scales is None else arrays | {"scale": np.asarray(scales, np.float32)}

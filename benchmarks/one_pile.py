"""One pile in several programs: the same grains, poured with the exported decks, beside this engine.

    python benchmarks/one_pile.py spheres      # minutes: 100 spheres in every program; writes the table in peers.md
    python benchmarks/one_pile.py pour repose liggghts lammps yade      # any of them, again until all runs are there
    python benchmarks/one_pile.py table

`spheres` pours 100 spheres of the volume of the default berry through a wide outlet. `pour` takes 120 default
berries of three spheres each, two parameter sets, and also this engine with the laws of the others, one after another,
and the decks with the dashpot along the tangent that they leave out. 16 seeds each; every pile is measured by the same
code from the places of its spheres. Needs `liggghts` and `yade` (Debian) and LAMMPS (--lmp). A run that stands in the
work folder is not made again.
"""

import argparse
import os
import re
import shlex
import subprocess
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import peer_laws  # noqa: F401
from peers import write_section
from scipy.spatial import cKDTree

from repose import export
from repose.bench import Scene, funnel
from repose.bench.settings import SceneSettings, SimulationSettings
from repose.common.places import list_default_configs
from repose.config.pipeline import PipelineConfig
from repose.dem.rotations import rotation_matrices
from repose.export.job import make_equal_sphere, make_job
from repose.export.laws import compute_rolling_coefficient
from repose.measure.clusters import largest_cluster
from repose.measure.pile import MeasureSettings
from repose.measure.saved_piles import pile_responses

HERE = Path(__file__).resolve().parent
RATE_PER_S = 60.0
DURATION_S = 3.2
TIME_STEP_S = 2e-4
SEEDS = 16
# A pile is at rest below this kinetic energy of a grain, 13 mm/s, in every program.
REST_J = 1e-7
# A pile that has lost more than a tenth of its grains over the edge of the plate is not the pile poured.
FEWEST_LEFT = 0.9
# The calibrated answer of results/published/height_alone, and the centre with the frictions at the top.
SETS = {
    "calibrated": {
        "e_gg": 0.3319,
        "mus_gg": 0.6308,
        "mur_gg": 0.03316,
        "e_gp": 0.3373,
        "mus_gp": 0.6212,
        "mur_gp": 0.2692,
    },
    "high": {
        "e_gg": 0.25,
        "mus_gg": 0.75,
        "mur_gg": 0.07,
        "e_gp": 0.35,
        "mus_gp": 0.8,
        "mur_gp": 0.3,
    },
}
# With the frictions of the others single spheres roll all over the plate.
SETS["spheres"] = SETS["calibrated"] | {
    "mus_gg": 0.75,
    "mur_gg": 0.1,
    "mus_gp": 0.8,
    "mur_gp": 0.5,
}
SPHERES = {"calibrated": 3, "high": 3, "spheres": 1}  # of a grain
GRAINS = {"calibrated": 120, "high": 120, "spheres": 100}
# Not as in the default funnel: a wider outlet, in which no spheres jam, nearer to the plate.
FUNNEL = {"spheres": {"outlet_diameter_mm": 50.0, "outlet_height_mm": 70.0}}
# This engine: Coulomb's limit, law of rolling, contact law.
OURS = {
    "repose": (None, "budget", "hertz_mindlin_rescaled"),
    "repose, spring as theirs": (None, "budget", "hertz_mindlin"),
    "repose, rolling as theirs": (None, "spring", "hertz_mindlin_rescaled"),
    "repose, all laws as theirs": ("total", "spring", "body_damping"),
}
PEERS = ("liggghts", "lammps", "yade")
# The same decks with the dashpot along the tangent that the programs have and the decks leave out. LAMMPS takes it as a
# share of the normal one: the root of the stiffnesses' ratio, 4 G* / E*.
DASHPOTS = {
    "liggghts": (" tangential_damping off", ""),
    "lammps": (r"(tangential mindlin \S+) 0 ", r"\1 0.9 "),
    "yade": (r"betas=by_pair\(0.0, 0.0\)", "betas=DAMPING"),
}
# Decks by their names: the program, and what is replaced in its text.
DECKS = {name: (name, None) for name in PEERS} | {
    f"{name}, tangential dashpot": (name, change) for name, change in DASHPOTS.items()
}
SECTION = "## One pile in several programs"
# The line of the table's angles, whatever the study calibrates.
LINE = {"response": "secant", "fit_from": 0.1, "fit_to": 0.8, "flank": "columns"}
RESPONSES = {
    "aor_deg": "angle, secant deg",
    "aor_flank_deg": "angle, flank deg",
    "height_mm": "Height mm",
}


@cache
def grain(source, spheres):
    """The default berry and its clump, or the sphere of its volume."""
    study = PipelineConfig.load(source)
    if spheres == 1:
        return study.grain, make_equal_sphere(study.particle)
    clump = {"particle": "multisphere", "spheres": spheres}
    study = PipelineConfig.of(
        study.config | {"berry": study.config["berry"] | clump}, source
    )
    return study.grain, study.particle


@cache
def study(set_name):
    """Configuration, grain, particle, and what is exported, of a parameter set."""
    source = str(list_default_configs()[-1])
    config = PipelineConfig.load(source).config
    config["funnel"] |= {
        "berries": GRAINS[set_name],
        "rate_per_s": RATE_PER_S,
        "duration_s": DURATION_S,
    }
    config["funnel"] |= FUNNEL.get(set_name, {})
    config["simulation"]["time_step_s"] = TIME_STEP_S
    berry, particle = grain(source, SPHERES[set_name])
    job = replace(
        make_job(config, SETS[set_name], particle, berry), time_step_s=TIME_STEP_S
    )
    return config, berry, particle, job


class Limited(SimulationSettings):
    """Laws with another limit of friction than their tension's; without a configuration's bounds."""

    friction_limit: str

    @property
    def laws(self):
        return super().laws | {"friction_limit": self.friction_limit}


def pour_ours(name, set_name, seed):
    """Places of the spheres (N, M, 3) of a pour with this engine, and its status."""
    config, berry, particle, job = study(set_name)
    limit, rolling, law = OURS[name]
    laws = {"friction_limit": limit, "contact_law": law, "rolling_law": rolling}
    simulation = Limited.model_construct(**config["simulation"] | laws)
    values = their_rolling(set_name, job) if rolling == "spring" else SETS[set_name]
    settings = SceneSettings(config, {"simulation": simulation})
    poured = funnel.FunnelTest().pour(Scene(settings, values, berry, particle, seed))
    turned = np.einsum(
        "nij,mj->nmi", rotation_matrices(poured.quaternions), particle.spheres_m[:, :3]
    )
    status = funnel.FunnelTest().status_of(poured, settings)[0]
    if status == "not_at_rest" and poured.kinetic_energy_j < REST_J * GRAINS[set_name]:
        status = "ok"
    return poured.centres_m[:, None] + turned, status


def their_rolling(set_name, job):
    """The parameters with the coefficients of rolling that the decks hold."""
    rolling = {
        f"mur_{key}": compute_rolling_coefficient(job, pair)
        for key, pair in (("gg", job.grains), ("gp", job.on_wall))
    }
    return SETS[set_name] | rolling


def commands_of(lmp):
    """How the programs are started in the folder of a deck."""
    return {
        "liggghts": "liggghts -in in.pour -log none",
        "lammps": f"{lmp} -in in.pour -log none",
        "yade": "yade -n -x -j1 pour.py",
    }


def run_deck(name, job, commands, edit=lambda text, folder: text):
    """The spheres at the end of a deck, after a change of its text."""
    program, change = DECKS[name]
    with tempfile.TemporaryDirectory() as folder:
        deck = export.write_deck(job, program, folder)[0]
        text = edit(deck.read_text(), Path(folder))
        deck.write_text(re.sub(*change, text) if change else text)
        done = subprocess.run(
            shlex.split(commands[program]),
            cwd=folder,
            capture_output=True,
            text=True,
            errors="replace",
        )
        file = Path(folder) / ("pile.csv" if program == "yade" else "pile.dump")
        if not file.exists():
            raise RuntimeError(f"{program}: {done.stdout[-600:]} {done.stderr[-600:]}")
        return read_pile(file, len(job.particle.spheres_m))


def pour_theirs(name, set_name, seed, commands):
    """Places of the spheres (N, M, 3) of a pour with an exported deck, and its status."""
    job = replace(study(set_name)[3], seed=seed)
    table = run_deck(name, job, commands)
    spheres = SPHERES[set_name]
    full = table.groupby("grain").filter(lambda rows: len(rows) == spheres)
    places = full[["x", "y", "z"]].to_numpy().reshape(-1, spheres, 3)
    speeds = np.linalg.norm(
        full[["vx", "vy", "vz"]].to_numpy().reshape(-1, spheres, 3).mean(axis=1), axis=1
    )
    moving = 0.5 * job.particle.mass_kg * np.mean(speeds**2)
    if len(places) < FEWEST_LEFT * GRAINS[set_name]:
        return places, "lost"
    if places[:, :, 2].max() > job.surfaces.outlet_height_m:
        return places, "jammed"
    return places, "ok" if moving < REST_J else f"moving {moving:.1e} J"


def read_pile(path, spheres):
    """The spheres that a deck wrote at its end, with the number of their grain."""
    if path.suffix == ".csv":
        return pd.read_csv(path)
    lines = path.read_text().splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("ITEM: ATOMS"))
    columns = lines[start].split()[2:]
    table = pd.DataFrame(
        [line.split() for line in lines[start + 1 :]], columns=columns
    ).astype(float)
    table["grain"] = table["mol"] if "mol" in table else (table["id"] - 1) // spheres
    return table.sort_values(["grain", "id"], kind="stable")


def measured(places, config, berry, particle):
    """Responses of a pile of spheres (N, M, 3); those beyond the edge of the plate are not in it."""
    radius = 0.5e-3 * config["funnel"]["plate_diameter_mm"]
    places = places[np.linalg.norm(places[:, :, :2].mean(axis=1), axis=1) < radius]
    body = particle.spheres_m[:, :3]
    radii = particle.spheres_m[:, 3]
    centres, quaternions = zip(
        *(pose(body, spheres) for spheres in places), strict=True
    )
    flat = places.reshape(-1, 3)
    owner = np.repeat(np.arange(len(places)), len(body))
    pairs = cKDTree(flat).query_pairs(2.0 * radii.max() + 1e-6, output_type="ndarray")
    reach = radii[pairs % len(body)].sum(axis=1) + 1e-6
    touching = np.linalg.norm(flat[pairs[:, 0]] - flat[pairs[:, 1]], axis=1) < reach
    contacts = owner[pairs[touching]]
    contacts = contacts[contacts[:, 0] != contacts[:, 1]]
    arrays = {
        "position": np.array(centres),
        "quaternion": np.array(quaternions),
        "in_pile": largest_cluster(contacts, np.ones(len(places), bool)),
    }
    settings = MeasureSettings.with_defaults(**config["measure"] | LINE).for_grain(
        berry
    )
    found, _ = pile_responses(
        arrays, particle, settings, config["funnel"]["plate_diameter_mm"]
    )
    return {name: found.get(name) for name in RESPONSES} | {
        "in_pile": int(arrays["in_pile"].sum())
    }


def pose(body, spheres):
    """Centre and quaternion of a clump from the places of its spheres (Kabsch)."""
    middle = body.mean(axis=0)
    there = spheres.mean(axis=0)
    u, _, vt = np.linalg.svd((body - middle).T @ (spheres - there))
    turn = vt.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(turn).as_quat()
    return there - turn @ middle, np.array([w, x, y, z])


def pour(arguments, sets=("calibrated", "high")):
    """Make the runs that are not there."""
    commands = commands_of(arguments.lmp)
    for seed in range(1, arguments.seeds + 1):
        for name in arguments.engines:
            for set_name in sets:
                file = arguments.work / f"{name}-{set_name}-{seed}.npz".replace(
                    " ", "_"
                )
                if file.exists():
                    continue
                if name in OURS:
                    places, status = pour_ours(name, set_name, seed)
                else:
                    places, status = pour_theirs(name, set_name, seed, commands)
                np.savez(
                    file,
                    places=places,
                    engine=name,
                    set=set_name,
                    seed=seed,
                    status=status,
                )
                print(
                    name,
                    set_name,
                    seed,
                    status,
                    f"highest {1e3 * places[:, :, 2].max():.1f} mm",
                    flush=True,
                )


def compared(runs):
    """Means, standard errors and differences from this engine with its own laws and with theirs."""
    rows = []
    for (set_name, engine), group in runs.groupby(["set", "engine"], sort=False):
        good = group[group.status == "ok"]
        row = {
            "set": set_name,
            "engine": engine,
            "runs": len(good),
            "failed": len(group) - len(good),
        }
        for response in RESPONSES:
            mean = good[response].mean()
            error = good[response].sem()
            row |= {response: mean, f"{response}_se": error}
            for label, ours in (
                ("z", "repose"),
                ("z_their_laws", "repose, all laws as theirs"),
            ):
                other = runs[
                    (runs.set == set_name)
                    & (runs.engine == ours)
                    & (runs.status == "ok")
                ][response]
                z = (
                    (mean - other.mean()) / np.hypot(error, other.sem())
                    if engine != ours
                    else 0.0
                )
                row[f"{response}_{label}"] = z
        rows.append(row)
    return pd.DataFrame(rows)


def record_of(file):
    """A run as a row: whose it is, how it ended, and its responses."""
    with np.load(file) as saved:
        places = saved["places"]
        record = {key: saved[key].item() for key in ("engine", "set", "seed", "status")}
    if record["status"] != "ok":
        return record
    config, berry, particle, _ = study(record["set"])
    return record | measured(places, config, berry, particle)


def runs_of(arguments, sets):
    """Runs of these sets as a table."""
    files = [
        file for name in sets for file in sorted(arguments.work.glob(f"*-{name}-*.npz"))
    ]
    records = [record_of(file) for file in files]
    order = [*OURS, *DECKS]
    records.sort(
        key=lambda r: (sets.index(r["set"]), order.index(r["engine"]), r["seed"])
    )
    return pd.DataFrame(records)


def spheres(arguments):
    """Pour the spheres in this engine and in the other programs, and write their table into peers.md."""
    arguments.engines = ["repose", "repose, all laws as theirs", *PEERS]
    pour(arguments, ("spheres",))
    rows = compared(runs_of(arguments, ("spheres",)))
    outlet = FUNNEL["spheres"]
    text = f"""{SECTION}

Written by `python benchmarks/one_pile.py spheres`: {GRAINS["spheres"]} spheres with volume and mass of the default
berry fall through an outlet of {outlet["outlet_diameter_mm"]:g} mm, {outlet["outlet_height_mm"]:g} mm above the plate,
{RATE_PER_S:g} a second, time step {TIME_STEP_S:g} s, in this engine and with the decks of `repose export`,
{arguments.seeds} seeds each. Mean and standard error; z is the difference from this engine over its standard error, in
brackets from this engine with the laws of the decks.

{markdown(rows)}
"""
    write_section(HERE / "peers.md", text)
    print(text)


def table(arguments):
    """Write the tables and print them."""
    runs = runs_of(arguments, ("calibrated", "high"))
    runs.to_csv(HERE / "one_pile_runs.csv", index=False, float_format="%.4f")
    rows = compared(runs)
    rows.to_csv(HERE / "one_pile.csv", index=False, float_format="%.3f")
    print(markdown(rows))


def markdown(rows):
    """The rows for people: mean +- standard error, and the differences over theirs."""
    told = rows[["set", "engine", "runs", "failed"]].copy()
    for response, label in RESPONSES.items():
        told[label] = [
            f"{mean:.1f} +- {error:.1f}"
            for mean, error in zip(rows[response], rows[f"{response}_se"], strict=True)
        ]
        told[f"z, {label}"] = [
            f"{z:.1f} ({z_between:.1f})"
            for z, z_between in zip(
                rows[f"{response}_z"], rows[f"{response}_z_their_laws"], strict=True
            )
        ]
    return told.to_markdown(index=False)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=("spheres", "pour", "table"))
    parser.add_argument("engines", nargs="*", default=[*OURS, *DECKS])
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--lmp", default="lmp", help="LAMMPS, with its path")
    parser.add_argument(
        "--work",
        type=Path,
        default=Path(tempfile.gettempdir()) / "repose-one-pile",
        help="folder of the runs",
    )
    arguments = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    arguments.work.mkdir(parents=True, exist_ok=True)
    {"spheres": spheres, "pour": pour, "table": table}[arguments.action](arguments)


if __name__ == "__main__":
    main()

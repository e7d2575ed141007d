"""A hit returns its restitution: damping goes by the mass at the contact, and contacts of one pair share it."""

import numpy as np
import pytest
import trimesh
from dem.clump_scenes import MASS, bent, scene
from dem.common import FLOOR, GOJI, PVC, mesh_of
from oracles import hertz_mindlin as slow_hertz_mindlin
from oracles import mass_at_contact, rotation
from verification.random_hits import STIFF_LIMIT, particles, simulate_hits

from repose.dem import Contact
from repose.dem.kernels import state as st
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli


def slow_step(s, i, others, contact):
    """Impulse and angular impulse on body i in the first step of contacts with others, by the words of the law.

    others: numbers of bodies, or normals out of planes through the origin. Returns the number of contacts, too.
    """
    dt = s.physics.dt
    beta = damping_ratio(contact.restitution)
    spheres, mass, inertia, place, velocity, spin = body_of(s, i)
    force = np.zeros(3)
    torque = np.zeros(3)
    count = 0
    for other in others:
        found = []
        for x, y, z, r in spheres:
            centre = np.array([x, y, z])
            if isinstance(
                other, np.ndarray
            ):  # outward normal of a plane through the origin
                gap = centre @ other - r
                found.append((gap, -other, r, centre + (r + 0.5 * gap) * -other))
                continue
            for u, v, w, p in body_of(s, other)[0]:
                between = np.array([u, v, w]) - centre
                gap = np.linalg.norm(between) - r - p
                n = between / np.linalg.norm(between)
                found.append((gap, n, r * p / (r + p), centre + (r + 0.5 * gap) * n))
        found = [place for place in found if place[0] < 0.0]
        count += len(found)
        young, shear = effective_moduli(
            GOJI, PVC if isinstance(other, np.ndarray) else GOJI
        )
        for gap, n, radius, point in found:
            touching = [(mass, inertia, point - place)]
            v = velocity + np.cross(spin, point - place)
            if not isinstance(other, np.ndarray):
                _spheres, mass_b, inertia_b, place_b, velocity_b, spin_b = body_of(
                    s, other
                )
                touching.append((mass_b, inertia_b, point - place_b))
                v = v - velocity_b - np.cross(spin_b, point - place_b)
            law = (
                young,
                shear,
                mass_at_contact(touching, n) / len(found),
                beta,
                contact.static_friction,
            )
            push, *_rest = slow_hertz_mindlin(
                law, -gap, radius, n, v, np.zeros(3), dt, True, "elastic"
            )
            force = force + push
            torque = torque + np.cross(point - place, push)
    return count, dt * force, dt * torque


def body_of(s, i):
    """Spheres in the world (M, 4), mass, inertia in the world, place, velocity and angular velocity of body i."""
    turn = rotation(s.quaternions[i])
    shape = s.shapes["bent"]
    centres = shape.spheres_m[:, :3] @ turn.T + s.positions[i]
    return (
        np.column_stack([centres, shape.spheres_m[:, 3]]),
        shape.mass_kg,
        turn @ np.diag(shape.inertia_kg_m2) @ turn.T,
        s.positions[i].copy(),
        s.velocities[i].copy(),
        s.angular_velocities[i].copy(),
    )


@pytest.mark.parametrize(
    "on",
    [
        "clump",
        "plane",
        pytest.param("mesh", marks=(pytest.mark.slow, pytest.mark.essential)),
    ],
)
def test_contacts_of_one_pair_share_the_damping(on):
    """The first step of two clumps, or a clump and a wall, that overlap in several places, beside the law in words."""
    rng = np.random.default_rng(12)
    contact = Contact(0.2, 0.5, 0.0)
    block = trimesh.creation.box((0.2, 0.2, 0.02)).apply_translation((0.0, 0.0, -0.01))
    walls = {
        "clump": None,
        "plane": {"floor": FLOOR},
        "mesh": {"block": mesh_of(block, 1e-3)},
    }[on]
    most = 0
    for _ in range(40):
        s = scene({"bent": bent()}, contact, walls, dt=1e-6)
        # nearly parallel bodies, so that several spheres touch
        tilt = np.array([1.0, *0.02 * rng.normal(size=3)])
        place = (0.0, 0.0, 0.0065) if on == "clump" else (0.01, 0.02, 0.0034)
        s.add("bent", place, tilt, rng.normal(size=3), 30.0 * rng.normal(size=3))
        if on == "clump":
            s.add(
                "bent",
                (0.0, 0.0, 0.0),
                (1.0, 0.0, 0.0, 0.0),
                rng.normal(size=3),
                30.0 * rng.normal(size=3),
            )
        momentum = MASS * s.velocities[0]
        spin = s.angular_momenta[0]
        count, push, twist = slow_step(
            s, 0, [1 if on == "clump" else np.array([0.0, 0.0, 1.0])], contact
        )
        s.run_steps(1)
        found = {"clump": st.N_PAIRS, "plane": st.N_PLANE, "mesh": st.N_MESHED}[on]
        if (
            s.counts[found] < count
        ):  # a sphere that is already deep in a mesh came from its inside
            continue
        most = max(most, count)
        assert MASS * s.velocities[0] - momentum == pytest.approx(
            push, rel=1e-6, abs=1e-6 * np.abs(push).max()
        )
        assert s.angular_momenta[0] - spin == pytest.approx(
            twist, rel=1e-6, abs=1e-6 * np.abs(twist).max()
        )
    assert most >= 3


@pytest.mark.parametrize("tension", ["keep", "release"])
@pytest.mark.parametrize(
    ("name", "contact_law"),
    [
        ("ellipsoid", "hertz_mindlin"),
        ("rough clump", "hertz_mindlin_rescaled"),
        pytest.param("ellipsoid", "linear_spring", marks=pytest.mark.slow),
    ],
)
def test_a_stiff_hit_returns_its_restitution_wherever_it_is_hit(
    name, tension, contact_law
):
    for on_plane in (False, True):
        for e in (0.2, 0.7):
            laws = {"contact_law": contact_law, "tension": tension}
            found = simulate_hits(
                particles()[name], e, STIFF_LIMIT, on_plane, 12, **laws
            ).restitution
            assert np.median(np.abs(found - e)) < 0.01
            assert np.mean(found) == pytest.approx(e, abs=0.02)

import functools

import numpy as np
import pytest
from dem.common import BARREL, BERRY, GOJI, random_direction, simulation
from oracles import gap as slow_gap
from oracles import hertz_mindlin as slow_hertz_mindlin
from oracles import mass_at_contact, support_point
from refusals import value_error

from repose.dem import Contact, random_quaternion
from repose.dem.kernels import state as st
from repose.dem.kernels import tile as tl
from repose.dem.kernels.contact import solve_gap
from repose.dem.kernels.damped_mass import write_mobility
from repose.dem.kernels.forces import add_forces_to_loads
from repose.dem.kernels.jit import kernel
from repose.dem.kernels.simd import gather, rsqrt_by_processor, rsqrt_by_steps
from repose.dem.laws import hertz_mindlin
from repose.dem.laws import rolling as rolling_budget
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.laws.law import contact_forces, rolling_resistance
from repose.dem.materials import effective_moduli
from repose.dem.rotations import rotation_matrix

LANES = st.LANES
ROWS = tl.LAW_ROW + hertz_mindlin.LAW.n_rows
KEPT = st.PAIR_STATE // LANES + hertz_mindlin.LAW.n_state
SPHERE = np.full((1, 3), 0.006)  # on the engine's way for spheres
BODIES = {"ellipsoid": BERRY, "two ellipsoids": BARREL, "sphere": SPHERE}
MOMENTS = np.array([1.2e-8, 2.9e-8, 3.3e-8])  # kg m2
UPPER = np.triu_indices(3)


@kernel
def pair_tile(t, contacts, rows, first, second, parts, dt, law, rolling, load):
    gather(rows, rows.shape[1], first, 0, t, tl.A)
    gather(rows, rows.shape[1], second, 0, t, tl.B)
    tl.write_pair_geometry(t, contacts, parts)
    write_mobility(t, contacts, tl.A, tl.RA, parts, 0.0)
    write_mobility(t, contacts, tl.B, tl.RB, parts, 1.0)
    column = st.share_column(parts) * LANES
    for k in range(LANES):
        t[tl.SHARE + k] = min(t[tl.A + column + k], t[tl.B + column + k])
    contact_forces(law, t, contacts, st.PAIR_STATE, dt)
    tl.write_torques(t)
    rolling_resistance(rolling, t, contacts, st.PAIR_STATE, dt)
    add_forces_to_loads(load, first, 0, t, tl.TO_A)
    add_forces_to_loads(load, second, 0, t, tl.TO_B)


def empty_tile():
    """A tile, its rows by lanes, what contacts keep, and that by lanes."""
    t = st.aligned_zeros(ROWS * LANES)
    contacts = st.new_contacts(LANES, KEPT)[0]
    return t, t.reshape(ROWS, LANES), contacts, contacts.reshape(KEPT, LANES)


def parts_of(axes):
    """As `shapes.count_ellipsoids`, for a body with the moments of its axes."""
    return st.SPHERES if axes is SPHERE else len(axes)


def engine_rows(bodies, axes, mass, moments=MOMENTS):
    """The engine's rows of bodies given as (position, quaternion, velocity, angular velocity)."""
    rows = st.new_bodies(len(bodies), parts_of(axes)).rows
    for row, (position, quaternion, velocity, turning) in zip(
        rows, bodies, strict=False
    ):
        row[st.POSITION : st.POSITION + 3] = position
        row[st.VELOCITY : st.VELOCITY + 3] = velocity
        row[st.ANGULAR_VELOCITY : st.ANGULAR_VELOCITY + 3] = turning
        row[st.INVERSE_MASS] = 1.0 / mass
        if axes is SPHERE:
            row[st.SPHERE_RADIUS] = axes[0, 0]
            continue
        turn = rotation_matrix(quaternion)
        row[st.INVERSE_INERTIA : st.INVERSE_INERTIA + 6] = (
            turn @ np.diag(1.0 / moments) @ turn.T
        )[UPPER]
        for k, part in enumerate(axes):
            matrix = turn @ np.diag(part**2) @ turn.T
            row[st.SHAPE + 6 * k : st.SHAPE + 6 * k + 6] = matrix[UPPER]
    return rows


def random_pair(rng, overlap_range):
    """Two berries at a random distance around touching."""
    bodies = [
        [None, random_quaternion(rng), rng.normal(size=3), 30.0 * rng.normal(size=3)]
        for _ in range(2)
    ]
    direction = random_direction(rng)
    bodies[0][0] = rng.normal(size=3)
    bodies[1][0] = bodies[0][0] + direction * 0.02
    return bodies, direction, rng.uniform(*overlap_range)


def at_gap(bodies, axes, direction, target):
    """Move the second body until the gap is near its target; the gap then, and its normal."""
    for _ in range(30):
        gap, normal = slow_gap(
            axes, bodies[1][0] - bodies[0][0], bodies[0][1], bodies[1][1], count=1500
        )
        if abs(gap - target) < 1e-5:
            break
        bodies[1][0] = bodies[1][0] + direction * (target - gap) / max(
            normal @ direction, 0.2
        )
    return gap, normal


@pytest.mark.parametrize("reciprocal_root", [rsqrt_by_steps, rsqrt_by_processor])
def test_reciprocal_root(reciprocal_root):
    for x in 10.0 ** np.random.default_rng(1).uniform(-120.0, 120.0, 2000):
        assert reciprocal_root(x) * np.sqrt(x) == pytest.approx(1.0, abs=1e-15)
    assert 0.0 * reciprocal_root(0.0) == 0.0


@pytest.mark.parametrize("columns", [16, 24, 40])
def test_gather_and_scatter_are_plain_copies(columns):
    rng = np.random.default_rng(columns)
    rows = rng.normal(size=(40, columns))
    load = st.aligned_zeros(40, 8)
    index = rng.integers(0, 40, LANES).astype(np.uint32)  # a body comes more than once
    t = st.aligned_zeros(ROWS * LANES)
    gather(rows, rows.shape[1], index, 0, t, tl.A)
    assert np.array_equal(t.reshape(ROWS, LANES)[:columns], rows[index].T)
    add_forces_to_loads(load, index, 0, t, tl.A)
    expected = np.zeros((40, 8))
    np.add.at(expected, index, rows[index][:, :8])
    assert np.array_equal(load, expected)


@pytest.mark.parametrize("axes", BODIES.values(), ids=BODIES)
def test_gap_and_normal_agree_with_a_dense_search(axes):
    rng = np.random.default_rng(7)
    for _ in range(60):
        bodies, direction, target = random_pair(rng, (-6e-4, 2e-3))
        slow, slow_normal = at_gap(bodies, axes, direction, target)
        normal = direction.copy()
        fast = solve_gap(
            engine_rows(bodies, axes, 1.0), parts_of(axes), 0, 1, normal, 1e-9, np.inf
        )
        assert fast == pytest.approx(slow, abs=1e-10)
        assert np.linalg.norm(normal - slow_normal) < 2e-5


def test_a_proven_gap_is_never_too_large():
    rng = np.random.default_rng(8)
    for _ in range(100):
        bodies, direction, target = random_pair(rng, (1e-4, 8e-3))
        true, _ = at_gap(bodies, BERRY, direction, target)
        assert (
            solve_gap(
                engine_rows(bodies, BERRY, 1.0), 1, 0, 1, direction.copy(), 1e-9, 1e-3
            )
            <= true + 1e-12
        )


def test_radii_of_two_spheres_are_those_of_hertz():
    radius = 0.005
    sphere = np.full((1, 3), radius)
    bodies = [[np.zeros(3), (1, 0, 0, 0), np.zeros(3), np.zeros(3)] for _ in range(2)]
    bodies[1][0] = np.array([0.0, 0.0, 1.99 * radius])
    rows = engine_rows(bodies, sphere, 1e-3)
    t, lanes, contacts, _ = empty_tile()
    first = np.zeros(LANES, np.uint32)
    load = st.aligned_zeros(len(rows), st.LOAD_COLUMNS)
    laws = hertz_mindlin.LAW.make_options(), rolling_budget.LAW.make_options()
    pair_tile(t, contacts, rows, first, first + np.uint32(1), 1, 2e-4, *laws, load)
    assert np.allclose(lanes[tl.RADIUS // LANES], radius / 2.0, rtol=1e-12)
    assert np.allclose(lanes[tl.GAP // LANES], -0.01 * radius, rtol=1e-9)


def mass_of_pair(mass, quaternions, arms, normal):
    """Effective mass of two bodies, each hit at the end of its arm along the normal."""
    bodies = []
    for quaternion, arm in zip(quaternions, arms, strict=True):
        turn = rotation_matrix(quaternion)
        bodies.append((mass, turn @ np.diag(MOMENTS) @ turn.T, arm))
    return mass_at_contact(bodies, normal)


@functools.cache
def tile_of_pairs(name):
    """A random pair of bodies for each lane: the bodies, their gap, its normal and a normal near it, and a spring."""
    rng = np.random.default_rng(9)
    pairs = []
    for _ in range(LANES):
        bodies, direction, target = random_pair(rng, (-5e-4, 2e-4))
        gap, normal = at_gap(bodies, BODIES[name], direction, target)
        # a normal as a time step leaves it: off by a few milliradians
        start = normal + 2e-3 * random_direction(rng)
        spring = 2e-5 * rng.normal(size=3)
        pairs.append((bodies, gap, normal, start / np.linalg.norm(start), spring))
    return pairs, rng.uniform(0.2, 1.0, (LANES, 2))


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("limit", ["elastic", "total"])
@pytest.mark.parametrize("tension", ["release", "keep"])
def test_a_tile_of_contacts_agrees_with_the_slow_law(name, tension, limit):
    """A tile computes one random pair of bodies in each lane; a quarter of them do not touch."""
    axes = BODIES[name]
    contact = Contact(0.3, 0.55, 0.04)
    mass = 1.04e-3
    dt = 2e-4
    t, lanes, contacts, kept = empty_tile()
    tl.fill_constants(t, tl.LAW, hertz_mindlin.constants(GOJI, GOJI, contact))
    tl.fill_constants(t, tl.ROLLING, rolling_budget.constants(GOJI, GOJI, contact))
    pairs, shares = tile_of_pairs(name)
    for lane, (_bodies, _gap, _normal, start, spring) in enumerate(pairs):
        kept[0:3, lane] = start
        kept[3:6, lane] = spring
    rows = engine_rows([body for pair in pairs for body in pair[0]], axes, mass)
    rows[: 2 * LANES, st.share_column(parts_of(axes))] = shares.ravel()
    load = st.aligned_zeros(len(rows), st.LOAD_COLUMNS)
    first = np.arange(0, 2 * LANES, 2, dtype=np.uint32)
    second = first + np.uint32(1)
    laws = [
        law.LAW.make_options(tension, limit) for law in (hertz_mindlin, rolling_budget)
    ]
    pair_tile(t, contacts, rows, first, second, parts_of(axes), dt, *laws, load)

    for lane, (bodies, gap, normal, _start, spring) in enumerate(pairs):
        (x_a, q_a, v_a, o_a), (x_b, q_b, v_b, o_b) = bodies
        tile_gap = lanes[tl.GAP // LANES, lane]
        tile_normal = kept[0:3, lane]
        arm_a = lanes[tl.RA // LANES :][:3, lane]
        arm_b = lanes[tl.RB // LANES :][:3, lane]
        assert tile_gap == pytest.approx(gap, abs=5e-8)
        assert np.linalg.norm(tile_normal - normal) < 3e-4
        # the contact is in the middle between the two surfaces
        point_a = support_point(axes, q_a, normal)
        point_b = support_point(axes, q_b, -normal) + x_b - x_a
        assert np.linalg.norm(arm_a - 0.5 * (point_a + point_b)) < 1e-5
        assert np.allclose(arm_a - arm_b, x_b - x_a, atol=1e-15)
        load_a = load[2 * lane]
        load_b = load[2 * lane + 1]
        if gap > 0.0:
            assert np.all(load_a[:3] == 0.0)
            assert np.all(kept[3:6, lane] == 0.0)
            continue
        # the slow law on the tile's own geometry: what is tested here is the force
        slow_law = (
            *effective_moduli(GOJI, GOJI),
            mass_of_pair(mass, (q_a, q_b), (arm_a, arm_b), tile_normal),
            damping_ratio(contact.restitution),
            contact.static_friction,
        )
        velocity = v_a + np.cross(o_a, arm_a) - v_b - np.cross(o_b, arm_b)
        force, new_spring, push = slow_hertz_mindlin(
            slow_law,
            overlap=-tile_gap,
            radius=lanes[tl.RADIUS // LANES, lane],
            n=tile_normal,
            v=velocity,
            spring=spring,
            dt=dt,
            tension=tension == "keep",
            limit=limit,
            share=shares[lane].min(),
        )
        for body, arm, body_force in ((load_a, arm_a, force), (load_b, arm_b, -force)):
            torque = np.cross(arm, body_force)
            rolling = contact.rolling_friction * push * np.linalg.norm(arm)
            assert np.allclose(body[0:3], body_force, rtol=1e-9, atol=1e-12)
            assert np.allclose(body[3:6], torque, rtol=1e-9, atol=1e-14)
            assert body[st.ROLL] == pytest.approx(rolling, rel=1e-9)
        assert np.allclose(kept[3:6, lane], new_spring, rtol=1e-9, atol=1e-15)


def test_a_glued_body_carries_another_and_stays():
    s = simulation(
        np.full((1, 3), 0.006),
        Contact(0.3, 0.5, 0.1),
        dt=4e-5,
        gravity_m_s2=(0.0, 0.0, -9.81),
    )
    s.glue(
        s.add(
            (0.0, 0.0, 0.0),
            velocity_m_s=(0.5, 0.0, 0.0),
            angular_velocity_rad_s=(0.0, 3.0, 0.0),
        )
    )
    s.add((0.0, 0.0, 0.0121))
    s.run_steps(5_000)
    assert np.array_equal(s.positions[0], np.zeros(3))
    assert s.positions[1, 2] == pytest.approx(0.012, abs=3e-4)
    assert s.masses_kg[0] == 0.0
    value_error("body is 2; expected an index below 2", s.glue, 2)

import numpy as np
import pytest
from dem.common import BARREL, BERRY, random_direction, random_quaternion
from oracles import gap as slow_gap
from oracles import hertz_mindlin, support_point

from repose.dem import state as st
from repose.dem import tile as tl
from repose.dem.contact import solve_gap
from repose.dem.engine import gather_pair
from repose.dem.jit import kernel


@kernel
def fill_lane(t, lane, a, b):
    gather_pair(t, lane, a, b)


def pair_rows(rng, overlap_range):
    """Two berries at a random distance around touching."""
    rows = np.zeros((2, st.BODY_COLUMNS))
    for i in range(2):
        rows[i, 3:7] = random_quaternion(rng)
        rows[i, 7:10] = rng.normal(size=3)
        rows[i, 10:13] = 30.0 * rng.normal(size=3)
    direction = random_direction(rng)
    rows[0, 0:3] = rng.normal(size=3)
    rows[1, 0:3] = rows[0, 0:3] + direction * 0.02
    return rows, direction, rng.uniform(*overlap_range)


def at_gap(rows, axes, direction, target):
    """Move the second berry along a line until the true gap is the target."""
    for _ in range(30):
        d = rows[1, 0:3] - rows[0, 0:3]
        gap, normal = slow_gap(axes, d, rows[0, 3:7], rows[1, 3:7], count=1500)
        if abs(gap - target) < 1e-10:
            break
        rows[1, 0:3] += direction * (target - gap) / max(normal @ direction, 0.2)
    return gap, normal


@pytest.mark.parametrize("axes", [BERRY, BARREL], ids=["ellipsoid", "two ellipsoids"])
def test_gap_and_normal_agree_with_a_dense_search(axes):
    rng = np.random.default_rng(7)
    for _ in range(60):
        rows, direction, target = pair_rows(rng, (-6e-4, 2e-3))
        slow, slow_normal = at_gap(rows, axes, direction, target)
        normal = direction.copy()
        fast = solve_gap(axes**2, rows, 0, 1, normal, 1e-9, np.inf)
        assert fast == pytest.approx(slow, abs=1e-10)
        assert np.linalg.norm(normal - slow_normal) < 2e-5


def test_a_proven_gap_is_never_larger_than_the_true_one():
    rng = np.random.default_rng(8)
    for _ in range(100):
        rows, direction, target = pair_rows(rng, (1e-4, 8e-3))
        true, _ = at_gap(rows, BERRY, direction, target)
        proven = solve_gap(BERRY**2, rows, 0, 1, direction.copy(), 1e-9, 1e-3)
        assert proven <= true + 1e-12


@pytest.mark.parametrize("axes", [BERRY, BARREL], ids=["ellipsoid", "two ellipsoids"])
@pytest.mark.parametrize("tension", [0.0, 1.0])
def test_a_tile_of_contacts_agrees_with_the_slow_law(axes, tension):
    rng = np.random.default_rng(9)
    t = np.zeros(tl.ROWS * tl.LANES)
    lanes = t.reshape(tl.ROWS, tl.LANES)
    contacts = st.new_contacts(tl.LANES)[0]
    kept = contacts.reshape(st.CONTACT_ROWS, tl.LANES)
    law = np.array([63236.0, 12797.6, 5.2e-4, 0.35, 0.55])
    dt = 2e-4
    cases = []
    for lane in range(tl.LANES):
        rows, direction, target = pair_rows(rng, (-5e-4, 2e-4))
        slow, normal = at_gap(rows, axes, direction, target)
        # a normal as a time step leaves it: off by a few milliradians
        start = normal + 2e-3 * random_direction(rng)
        start /= np.linalg.norm(start)
        spring = 2e-5 * rng.normal(size=3)
        kept[0:3, lane], kept[3:6, lane] = start, spring
        fill_lane(t, lane, rows[0], rows[1])
        cases.append((rows, slow, normal, spring))
    tl.body_a(t, contacts, axes**2)
    tl.body_b(t, contacts, axes**2)
    tl.pair_geometry(t, contacts)
    tl.forces(t, contacts, law, dt, tension)

    def row(start, lane, count=3):
        first = start // tl.LANES
        return lanes[first : first + count, lane]

    for lane, (rows, slow, normal, spring) in enumerate(cases):
        assert lanes[tl.GAP // tl.LANES, lane] == pytest.approx(slow, abs=5e-8)
        assert np.linalg.norm(kept[0:3, lane] - normal) < 3e-4
        arm_a, arm_b = row(tl.RA, lane), row(tl.RB, lane)
        point_a = support_point(axes, rows[0, 3:7], normal)
        point_b = support_point(axes, rows[1, 3:7], -normal) + rows[1, 0:3] - rows[0, 0:3]
        assert np.linalg.norm(arm_a - 0.5 * (point_a + point_b)) < 1e-5
        assert np.allclose(arm_a - arm_b, rows[1, 0:3] - rows[0, 0:3], atol=1e-15)
        velocity = rows[0, 7:10] + np.cross(rows[0, 10:13], arm_a)
        velocity = velocity - rows[1, 7:10] - np.cross(rows[1, 10:13], arm_b)
        if slow > 0.0:
            assert np.all(row(tl.F, lane) == 0.0)
            assert np.all(kept[3:6, lane] == 0.0)
            continue
        # the slow law on the tile's own geometry: what is tested here is the force
        force, new_spring = hertz_mindlin(
            law, -lanes[tl.GAP // tl.LANES, lane], lanes[tl.RADIUS // tl.LANES, lane],
            kept[0:3, lane], velocity, spring, dt, tension,
        )  # fmt: skip
        assert np.allclose(row(tl.F, lane), force, rtol=1e-9, atol=1e-12)
        assert np.allclose(kept[3:6, lane], new_spring, rtol=1e-9, atol=1e-15)
        assert np.allclose(row(tl.TA, lane), np.cross(arm_a, force), rtol=1e-9, atol=1e-14)
        assert np.allclose(row(tl.TB, lane), np.cross(arm_b, -force), rtol=1e-9, atol=1e-14)


def test_effective_radius_of_spheres_is_that_of_hertz():
    radius = 0.005
    t = np.zeros(tl.ROWS * tl.LANES)
    lanes = t.reshape(tl.ROWS, tl.LANES)
    contacts = st.new_contacts(tl.LANES)[0]
    lanes[tl.A // tl.LANES] = lanes[tl.B // tl.LANES] = 1.0
    lanes[tl.D // tl.LANES + 2] = 1.99 * radius
    squares = np.full((1, 3), radius**2)
    tl.body_a(t, contacts, squares)
    tl.body_b(t, contacts, squares)
    tl.pair_geometry(t, contacts)
    assert np.allclose(lanes[tl.RADIUS // tl.LANES], radius / 2.0, rtol=1e-12)
    assert np.allclose(lanes[tl.GAP // tl.LANES], -0.01 * radius, rtol=1e-9)

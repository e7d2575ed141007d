import itertools

import numpy as np
import pytest
from dem.common import BERRY, simulation

from repose.dem import Contact, Plane, Shape, random_quaternion
from repose.dem.kernels import state as st
from repose.dem.kernels.contact import solve_gap
from repose.verification.machine import simulation_of


def slow_contacts(s):
    """Every pair that overlaps, by looking at all of them."""
    found = []
    for i, j in itertools.combinations(range(s.n_bodies), 2):
        d = s.positions[j] - s.positions[i]
        distance = np.linalg.norm(d)
        if distance < 2.0 * s.radius:
            gap = solve_gap(s.bodies.rows, s.physics.parts, i, j, d / distance, 1e-10, np.inf)
            if gap < 0.0:
                found.append((i, j, gap))
    return found


@pytest.mark.parametrize("seed", [1, 2])
def test_the_contact_list_is_that_of_all_pairs_at_every_moment(seed):
    rng = np.random.default_rng(seed)
    walls = {
        "floor": Plane((0, 0, 0), (0, 0, 1), "wall"),
        "right": Plane((0.04, 0, 0), (-1, 0, 0), "wall"),
        "left": Plane((-0.04, 0, 0), (1, 0, 0), "wall"),
    }
    n = 60
    s = simulation(
        BERRY, Contact(0.3, 0.5, 0.05), walls=walls, gravity_m_s2=(0, 0, -9.81), dt=2e-4, capacity=n,
        lower=(-0.05, -0.05, 0.0), upper=(0.05, 0.05, 0.2),
    )  # fmt: skip
    places = itertools.product((-0.025, 0.0, 0.025), (-0.025, 0.0, 0.025), np.arange(0.015, 0.18, 0.0225))
    for place in itertools.islice(places, n):
        s.add(np.array(place) + 5e-4 * rng.random(3), random_quaternion(rng), 0.3 * rng.normal(size=3))
    seen = 0
    for _ in range(75):
        s.run_steps(23)
        slow = {(i, j): g for i, j, g in slow_contacts(s)}
        fast = {tuple(pair) for pair in s.contacts()}
        # the list is made before a step moves the bodies: only pairs that just met or parted may differ
        for pair in fast ^ set(slow):
            i, j = pair
            d = s.positions[j] - s.positions[i]
            gap = solve_gap(s.bodies.rows, s.physics.parts, i, j, d / np.linalg.norm(d), 1e-10, np.inf)
            assert abs(gap) < 6e-4
        assert len(s.contacts()) == len(fast)
        seen += len(slow)
    assert seen > 1000


def test_lists_grow_when_they_fill_up():
    n = 125
    runs = []
    for shrink in (False, True):
        s = simulation(BERRY, Contact(0.3, 0.5, 0.05), capacity=n, dt=1e-4)
        rng = np.random.default_rng(5)
        if shrink:
            s.pairs = st.new_pairs(32, 100, n, 3)
        for k, place in enumerate(itertools.product(np.arange(5) * 0.022 - 0.05, repeat=3)):
            s.add(np.array(place), random_quaternion(rng), -0.8 * np.array(place) / 0.05)
            if k % 10 == 9:
                s.run_steps(1)
        s.run_steps(400)
        assert len(s.pairs.first) > 32
        assert len(s.pairs.near_limit) > 100
        runs.append(s.positions.copy())
    assert np.array_equal(*runs)


def test_small_grains_in_a_large_box_need_memory_for_the_grains_alone():
    # 10 um grains in a box of 2 m: cells all over the box would take 3 PiB
    n, radius = 40, 1e-5
    s = simulation(
        np.full((1, 3), radius), Contact(0.3, 0.5, 0.0), dt=1e-9, capacity=n,
        lower=(-1.0, -1.0, -1.0), upper=(1.0, 1.0, 1.0),
    )  # fmt: skip
    assert s.grid.head.nbytes < 1e5
    rng = np.random.default_rng(3)
    for k in range(n):
        # in clusters far apart, some of them outside of the box
        corner = (-0.9, 0.0, 0.9, 3.0)[k % 4]
        s.add(corner + 1.5 * radius * rng.uniform(-1.0, 1.0, 3), (1, 0, 0, 0))
    s.run_steps(1)
    found = {(i, j) for i, j, _gap in slow_contacts(s)}
    assert len(found) > 40
    assert {tuple(pair) for pair in s.contacts()} >= {(i, j) for i, j, gap in slow_contacts(s) if gap < -1e-9}


@pytest.mark.parametrize("cells", [1, 8, 27, 4096])
def test_bodies_meet_whatever_the_number_of_cells(cells, monkeypatch):
    monkeypatch.setattr(st, "CELLS_PER_BODY", 0)
    monkeypatch.setattr(st, "FEWEST_CELLS", cells)
    test_the_contact_list_is_that_of_all_pairs_at_every_moment(1)


def test_a_dense_lattice_of_long_bodies_has_room_in_the_lists():
    axes = np.array([0.004, 0.004, 0.01])
    s = simulation_of(Shape.ellipsoid(axes, 800.0, "berry"), Contact(0.3, 0.5, 0.02), 1e-5, capacity=1000)
    for place in np.indices((10, 10, 10)).reshape(3, -1).T:
        s.add("body", 2.001 * axes * (place - 4.5))
    s.run_steps(1)
    assert s.counts[st.N_NEAR] > 6 * 1000

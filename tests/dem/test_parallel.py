import itertools

import numpy as np
import pytest
from dem.common import BERRY, DOWN, FLOOR, simulation
from refusals import not_refused

from repose.dem import Contact, Plane, random_quaternion
from repose.dem.kernels import parallel
from repose.dem.kernels import state as st
from repose.dem.kernels.order import compute_morton_codes

STEPS = 1200


def falling(threads, count=120, seed=4, speed_m_s=0.1):
    walls = {"floor": FLOOR}
    for name, place, normal in (("right", 0.04, -1), ("left", -0.04, 1)):
        walls[name] = Plane((place, 0, 0), (normal, 0, 0), "wall")
        walls[name + " too"] = Plane((0, place, 0), (0, normal, 0), "wall")
    s = simulation(
        BERRY,
        Contact(0.3, 0.5, 0.05),
        walls=walls,
        gravity_m_s2=DOWN,
        dt=2e-4,
        capacity=count,
        threads=threads,
        lower=(-0.05, -0.05, 0.0),
        upper=(0.05, 0.05, 0.3),
    )
    rng = np.random.default_rng(seed)
    lattice = (-0.025, 0.0, 0.025)
    for place in itertools.islice(
        itertools.product(np.arange(0.015, 0.4, 0.0225), lattice, lattice), count
    ):
        start = np.array(place)[[1, 2, 0]] + 5e-4 * rng.random(3)
        s.add(start, random_quaternion(rng), speed_m_s * rng.normal(size=3))
    return s


@pytest.fixture
def small_is_shared(monkeypatch):
    monkeypatch.setattr(parallel, "FEWEST_BODIES", 1)


@pytest.mark.slow
@pytest.mark.essential
def test_neither_threads_nor_cuts_change_a_bit(small_is_shared):
    def state_after(threads, parts):
        s = falling(threads)
        for steps in parts:
            s.run_steps(steps)
        return s.positions.copy(), s.quaternions, s.contacts()

    one_thread = state_after(1, [STEPS])
    assert len(one_thread[2]) > 100
    for threads, parts in (
        (2, [STEPS]),
        (3, [STEPS]),
        (2, [1, 499, 500, 7, STEPS - 1007]),
    ):
        state = state_after(threads, parts)
        for array, expected in zip(state, one_thread, strict=True):
            assert np.array_equal(array, expected), (threads, parts)


@pytest.mark.slow
@pytest.mark.essential
def test_shares_of_bodies_move_them_as_one_does(small_is_shared, monkeypatch):
    """Compared after so few steps that rounding has not grown yet."""
    shared = falling(1)
    monkeypatch.setattr(parallel, "FEWEST_BODIES", 1000)
    plain = falling(1)
    for s in (shared, plain):
        s.run_steps(350)
    assert len(plain.contacts()) + int(plain.counts[st.N_PLANE]) > 20
    assert np.allclose(shared.positions, plain.positions, atol=1e-9)


@pytest.mark.slow
@pytest.mark.essential
def test_pairs_that_are_left_alone_still_meet_in_time(small_is_shared, monkeypatch):
    """A lattice creeps together so slowly that its pairs are left alone for most of the steps."""

    def creeping():
        s = simulation(
            BERRY,
            Contact(0.3, 0.5, 0.05),
            dt=2e-4,
            capacity=64,
            lower=(-0.2,) * 3,
            upper=(0.2,) * 3,
        )
        for place in itertools.product((-0.033, -0.011, 0.011, 0.033), repeat=3):
            x, y, z = place
            s.add((x, 0.55 * y, 0.5 * z), velocity_m_s=-0.08 * np.array(place))
        return s

    met = []
    for fewest in (1, 1000):
        monkeypatch.setattr(parallel, "FEWEST_BODIES", fewest)
        s = creeping()
        found = []
        left_alone = 0
        for _ in range(100):
            s.run_steps(50)
            found.append(s.contacts())
            path = parallel.sum_group_paths(
                s.grid.paths[parallel.ALL_STEPS], s.pairs.near_groups[0]
            )
            left_alone += int(path < s.pairs.near_check[0])
        met.append(found)
        assert (left_alone > 50) == (fewest == 1)
    assert len(met[0][0]) == 0
    assert max(len(contacts) for contacts in met[0]) > 20
    assert all(
        np.array_equal(first, second) for first, second in zip(*met, strict=True)
    )


@pytest.mark.slow
@pytest.mark.essential
def test_new_numbers_change_nothing_that_users_see(small_is_shared):
    s = falling(1)
    s.run_steps(STEPS - 1)

    def state():
        # contacts have another order after bodies have other numbers
        rows = st.contact_rows(s.pairs.data, len(s.contacts()))
        places = s.bodies.rows[s.pairs.first[: len(rows)], :3]
        springs = sorted(map(tuple, np.column_stack([places, rows])))
        return (
            s.positions,
            s.quaternions,
            s.angular_momenta,
            s.contacts(),
            s.kinetic_energies(),
            np.array(springs),
        )

    before = state()
    numbers = s._engine_numbers.copy()
    s._renumber_bodies()
    assert not np.array_equal(numbers, s._engine_numbers)
    for first, second in zip(before, state(), strict=True):
        assert np.array_equal(first, second)


def test_morton_numbers_of_a_small_grid_and_wrong_numbers_of_threads():
    shape = np.array([2, 2, 4])
    cells = np.arange(16)
    x = cells // 8
    y = cells // 4 % 2
    z = cells % 4
    assert np.array_equal(
        compute_morton_codes(cells, shape), x + 2 * y + 4 * (z % 2) + 32 * (z // 2)
    )
    wrong = [
        (threads, f"threads is {threads}; expected 1 to 8") for threads in (0, 9, 1.5)
    ]
    assert not not_refused(falling, wrong, ValueError)

"""The search for contacts against all pairs of bodies and of spheres."""

import itertools

import numpy as np
import pytest
from dem.clump_scenes import BENT_INERTIA, MASS, scene
from dem.common import simulation
from dem.test_clumps import all_spheres, cloud
from dem.test_parallel import falling
from verification.simulations import simulation_of

from repose.dem import Clump, Contact, Shape, random_quaternion
from repose.dem.kernels import state as st
from repose.dem.kernels.clumps import MOST_WATCHED
from repose.dem.kernels.contact import solve_gap


def slow_contacts(s):
    found = []
    apart = s.positions - s.positions[:, None]
    distances = np.linalg.norm(apart, axis=2)
    for i, j in np.argwhere(np.triu(distances < 2.0 * s.radius, k=1)):
        direction = apart[i, j] / distances[i, j]
        gap = solve_gap(s.bodies.rows, s.physics.parts, i, j, direction, 1e-10, np.inf)
        if gap < 0.0:
            found.append((i, j, gap))
    return found


@pytest.mark.parametrize("seed", [1, 2])
def test_the_contact_list_is_that_of_all_pairs_at_every_moment(seed):
    s = falling(1, 60, seed, 0.3)
    seen = 0
    for _ in range(75):
        s.run_steps(23)
        slow = {(i, j): g for i, j, g in slow_contacts(s)}
        fast = {tuple(pair) for pair in s.contacts()}
        # the list is made before a step moves the bodies: only pairs that just met or parted may differ
        for i, j in fast ^ set(slow):
            d = s.positions[j] - s.positions[i]
            normal = d / np.linalg.norm(d)
            gap = solve_gap(s.bodies.rows, s.physics.parts, i, j, normal, 1e-10, np.inf)
            assert abs(gap) < 6e-4
        assert len(s.contacts()) == len(fast)
        seen += len(slow)
    assert seen > 1000


def test_memory_goes_with_the_grains_alone():
    """Grains of 10 um in a box of 2 m: cells all over the box would take 3 PiB."""
    n = 40
    radius = 1e-5
    s = simulation(
        np.full((1, 3), radius),
        Contact(0.3, 0.5, 0.0),
        dt=1e-9,
        capacity=n,
        lower=(-1.0, -1.0, -1.0),
        upper=(1.0, 1.0, 1.0),
    )
    assert s.grid.head.nbytes < 1e5
    rng = np.random.default_rng(3)
    # four clusters far apart, one of them outside of the box
    for k in range(n):
        centre = (-0.9, 0.0, 0.9, 3.0)[k % 4]
        s.add(centre + 1.5 * radius * rng.uniform(-1.0, 1.0, 3), (1, 0, 0, 0))
    s.run_steps(1)
    assert len({(i, j) for i, j, _gap in slow_contacts(s)}) > 40
    found = {tuple(pair) for pair in s.contacts()}
    assert found >= {(i, j) for i, j, gap in slow_contacts(s) if gap < -1e-9}


def test_a_dense_lattice_has_room_for_its_pairs():
    axes = np.array([0.004, 0.004, 0.01])
    s = simulation_of(
        Shape.ellipsoid(axes, 800.0, "grain"),
        Contact(0.3, 0.5, 0.02),
        1e-5,
        capacity=1000,
    )
    for place in np.indices((10, 10, 10)).reshape(3, -1).T:
        s.add("body", 2.001 * axes * (place - 4.5))
    s.run_steps(1)
    assert s.counts[st.N_NEAR] > 6 * 1000


@pytest.mark.parametrize("cells", [1, 8, 27, 4096])
def test_bodies_meet_whatever_the_number_of_cells(cells, monkeypatch):
    monkeypatch.setattr(st, "CELLS_PER_BODY", 0)
    monkeypatch.setattr(st, "FEWEST_CELLS", cells)
    test_the_contact_list_is_that_of_all_pairs_at_every_moment(1)


# sixteen spheres with dents between them: many pairs of two bodies touch and part
PLACES = np.random.default_rng(16).uniform(-1.0, 1.0, (16, 3)) * [7e-3, 3e-3, 2.5e-3]
ROUGH = np.column_stack([PLACES, np.random.default_rng(17).uniform(2e-3, 3.5e-3, 16)])


def entries(s):
    """Number of each entry, its bodies' displacements, gaps of all pairs of spheres, pairs touching and watched."""
    centres, radii, bodies, _ = all_spheres(s)
    for k in range(s.counts[st.N_NEAR]):
        i = int(s.pairs.near_first[k])
        j = int(s.pairs.near_second[k])
        if i == s.capacity:
            continue
        a = np.flatnonzero(bodies == i)
        b = np.flatnonzero(bodies == j)
        distances = np.linalg.norm(centres[a][:, None] - centres[b], axis=2)
        gaps = distances - radii[a][:, None] - radii[b]
        n_pairs = s.counts[st.N_PAIRS]
        is_of_entry = s.pairs.entry[:n_pairs] == k
        touching = [tuple(pair) for pair in s.pairs.spheres[:n_pairs][is_of_entry]]
        watched = [tuple(pair) for pair in s.pairs.watched[k, : s.pairs.n_watched[k]]]
        displacement = s.bodies.displacement[i] + s.bodies.displacement[j]
        yield k, displacement, gaps, touching, watched


def check_limits(s):
    """Hold all limits against the gaps of all pairs of spheres; returns how many were watched and how many touch."""
    seen = np.zeros(2, int)
    for k, total, gaps, touching, watched in entries(s):
        assert len(set(watched) | set(touching)) == len(watched) + len(touching)
        limits = s.pairs.watched_limit[k, : len(watched)]
        assert all(
            gaps[pair] >= limit - total - 1e-12
            for pair, limit in zip(watched, limits, strict=True)
        )
        for pair in [*watched, *touching]:
            gaps[pair] = np.inf
        assert gaps.min() >= s.pairs.unwatched_limit[k] - total - 1e-12
        assert s.pairs.near_limit[k] <= min(
            s.pairs.unwatched_limit[k], limits.min(initial=np.inf)
        )
        seen += len(watched), len(touching)
    return seen


def test_no_pair_of_spheres_comes_nearer_than_its_limit_says():
    for s in (cloud(seed=3), rubbing()):
        seen = np.zeros(2, int)
        for _ in range(60):
            s.run_steps(17)
            seen += check_limits(s)
        assert seen[0] > 1000
        assert seen[1] > 100


def test_a_pair_that_ends_is_seen_in_time():
    s = rubbing()
    ended = 0
    s.run_steps(500)
    for _ in range(40):
        before = {}
        for k, total, gaps, touching, watched in entries(s):
            before[k] = set(touching)
            # watch further pairs, up to the last slot
            for pair in zip(
                *np.unravel_index(np.argsort(gaps, axis=None), gaps.shape), strict=True
            ):
                n = s.pairs.n_watched[k]
                if (
                    n < MOST_WATCHED
                    and gaps[pair] > 0.0
                    and pair not in watched
                    and pair not in touching
                ):
                    s.pairs.watched[k, n] = pair
                    s.pairs.watched_limit[k, n] = total + gaps[pair]
                    s.pairs.near_limit[k] = min(
                        s.pairs.near_limit[k], total + gaps[pair]
                    )
                    s.pairs.n_watched[k] += 1
        s.run_steps(10)
        check_limits(s)
        for k, _total, _gaps, touching, watched in entries(s):
            ended += len(before.get(k, set()) - set(touching) - set(watched))
    assert ended > 10


def rubbing():
    s = scene(
        {"rough": Clump(ROUGH, MASS, BENT_INERTIA, "body")},
        Contact(0.2, 0.2, 0.0),
        dt=5e-5,
        capacity=27,
    )
    rng = np.random.default_rng(5)
    for place in itertools.product((-0.025, 0.0, 0.025), repeat=3):
        place = np.array(place)
        s.add(
            "rough",
            place,
            random_quaternion(rng),
            -20.0 * place,
            30.0 * rng.normal(size=3),
        )
    return s

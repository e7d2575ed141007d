"""What an entry of two clumps remembers of their spheres bounds what has come of all of them."""

import itertools

import numpy as np
from dem.clump_scenes import BENT_INERTIA, MASS, scene
from dem.test_clumps import all_spheres, cloud

from repose.dem import Clump, Contact, random_quaternion
from repose.dem.kernels import state as st
from repose.dem.kernels.clumps import SLOTS

# sixteen spheres with dents between them: many pairs of two bodies touch and part
ROUGH = np.column_stack(
    [
        np.random.default_rng(16).uniform(-1.0, 1.0, (16, 3)) * [7e-3, 3e-3, 2.5e-3],
        np.random.default_rng(17).uniform(2e-3, 3.5e-3, 16),
    ]
)


def entries(s):
    """Number of each entry, its bodies' displacements, gaps of all pairs of spheres, pairs touching and watched."""
    centres, radii, bodies, _ = all_spheres(s)
    for k in range(s.counts[st.N_NEAR]):
        i, j = int(s.pairs.near_first[k]), int(s.pairs.near_second[k])
        if i == s.capacity:
            continue
        a, b = np.flatnonzero(bodies == i), np.flatnonzero(bodies == j)
        gaps = np.linalg.norm(centres[a][:, None] - centres[b], axis=2) - radii[a][:, None] - radii[b]
        contacts = s.pairs.entry[: s.counts[st.N_PAIRS]] == k
        touching = [tuple(pair) for pair in s.pairs.spheres[: s.counts[st.N_PAIRS]][contacts]]
        watched = [tuple(pair) for pair in s.pairs.watched[k, : s.pairs.n_watched[k]]]
        yield k, s.bodies.displacement[i] + s.bodies.displacement[j], gaps, touching, watched


def check_limits(s):
    """Hold all limits against the gaps of all pairs of spheres; returns how many were watched and how many touch."""
    seen = np.zeros(2, int)
    for k, total, gaps, touching, watched in entries(s):
        assert len(set(watched) | set(touching)) == len(watched) + len(touching)
        limits = s.pairs.watched_limit[k, : len(watched)]
        assert all(gaps[pair] >= limit - total - 1e-12 for pair, limit in zip(watched, limits, strict=True))
        for pair in [*watched, *touching]:
            gaps[pair] = np.inf
        assert gaps.min() >= s.pairs.near_rest[k] - total - 1e-12
        assert s.pairs.near_limit[k] <= min(s.pairs.near_rest[k], limits.min(initial=np.inf))
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


def test_a_contact_that_ends_is_looked_at_in_time_where_no_slot_is_left():
    s, ended = rubbing(), 0
    s.run_steps(500)
    for _ in range(40):
        before = {}
        for k, total, gaps, touching, watched in entries(s):
            before[k] = set(touching)
            # watch further pairs, up to the last slot
            for pair in zip(*np.unravel_index(np.argsort(gaps, axis=None), gaps.shape), strict=True):
                n = s.pairs.n_watched[k]
                if n < SLOTS and gaps[pair] > 0.0 and pair not in watched and pair not in touching:
                    s.pairs.watched[k, n], s.pairs.watched_limit[k, n] = pair, total + gaps[pair]
                    s.pairs.near_limit[k] = min(s.pairs.near_limit[k], total + gaps[pair])
                    s.pairs.n_watched[k] += 1
        s.run_steps(10)
        check_limits(s)
        for k, _total, _gaps, touching, watched in entries(s):
            ended += len(before.get(k, set()) - set(touching) - set(watched))
    assert ended > 10


def rubbing():
    """Rough clumps that spin and press against each other."""
    s = scene({"rough": Clump(ROUGH, MASS, BENT_INERTIA, "body")}, Contact(0.2, 0.2, 0.0), dt=5e-5, capacity=27)
    rng = np.random.default_rng(5)
    for place in itertools.product((-0.025, 0.0, 0.025), repeat=3):
        place = np.array(place)
        s.add("rough", place, random_quaternion(rng), -20.0 * place, 30.0 * rng.normal(size=3))
    return s

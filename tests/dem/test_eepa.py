"""Edinburgh elasto-plastic adhesion: its branches beside closed forms, work of cycles, hits, and the time step."""

import itertools
import math
from functools import partial

import numpy as np
import pytest
from dem.common import GOJI, LANES, head_on, normal_force, simulation, tile_of
from dem.test_cohesion import compare_with_the_dry_law

from repose.dem import Contact
from repose.dem.constants import PLASTICITY_RATIO, SURFACE_ENERGY
from repose.dem.kernels import tile as tl
from repose.dem.laws import CONTACT_LAWS, eepa
from repose.dem.materials import effective_moduli

RADIUS = 3e-3  # R*
LAW = CONTACT_LAWS["eepa"]
K1 = 4.0 / 3.0 * effective_moduli(GOJI, GOJI)[0] * math.sqrt(RADIUS)
DEEP = 2e-4


def contact(plasticity, gamma=0.0, e=1.0, sliding=0.0):
    return Contact(
        e,
        sliding,
        0.0,
        constants={PLASTICITY_RATIO.name: plasticity, SURFACE_ENERGY.name: gamma},
    )


def forces_on(path, plasticity, gamma, **options):
    """Normal forces of the kernel along a path of overlaps."""
    tile, kept = tile_of(LAW, GOJI, contact(plasticity, gamma), RADIUS)
    return np.array(
        [normal_force(LAW, tile, kept, overlap, **options)[0] for overlap in path]
    )


def pull(plasticity, gamma):
    """The strongest pull after pressing to DEEP, d_p^1.5, and k2."""
    k2 = K1 / (1.0 - plasticity)
    plastic = plasticity * DEEP**1.5
    circle = math.sqrt(2.0 * RADIUS * plastic ** (2.0 / 3.0))
    return min(3.0 * math.pi * gamma * circle, 0.5 * k2 * plastic), plastic, k2


@pytest.mark.parametrize("gamma", [0.0, 0.02, 50.0])
@pytest.mark.parametrize("plasticity", [0.2, 0.8])
def test_branches_are_those_of_the_equations(plasticity, gamma):
    strongest, plastic, k2 = pull(plasticity, gamma)
    up = np.linspace(0.0, DEEP, 50)[1:]
    down = np.linspace(DEEP, 0.0, 4001)[:-1]
    meets = plastic - strongest / k2
    adhesion = -strongest / meets * down**1.5
    expected = np.where(down**1.5 > meets, k2 * (down**1.5 - plastic), adhesion)
    found = forces_on([*up, *down], plasticity, gamma)
    np.testing.assert_allclose(found[:49], K1 * up**1.5, rtol=1e-12)
    np.testing.assert_allclose(
        found[49:], expected, rtol=1e-9, atol=1e-12 * K1 * DEEP**1.5
    )
    assert found.min() == pytest.approx(-strongest, rel=2e-2, abs=1e-15)
    if gamma == 0.02:
        assert strongest == pytest.approx(
            3.0 * math.pi * gamma * math.sqrt(2.0 * RADIUS * plastic ** (2 / 3))
        )
    elif gamma:
        assert strongest == pytest.approx(0.5 * k2 * plastic)


@pytest.mark.parametrize("gamma", [0.0, 0.02])
def test_work_of_a_cycle(gamma):
    plasticity = 0.6
    strongest, plastic, k2 = pull(plasticity, gamma)
    meets = (plastic - strongest / k2) ** (2.0 / 3.0)
    loading = K1 * DEEP**2.5 / 2.5
    unloading = k2 * ((DEEP**2.5 - meets**2.5) / 2.5 - plastic * (DEEP - meets))
    pulled = strongest / meets**1.5 * meets**2.5 / 2.5
    path = np.concatenate([np.linspace(0.0, DEEP, 2001), np.linspace(DEEP, 0.0, 20001)])
    work = np.trapezoid(forces_on(path, plasticity, gamma), path)
    assert work == pytest.approx(loading - unloading + pulled, rel=1e-4)
    if gamma == 0.0:
        expected = math.sqrt(unloading / loading)
        assert eepa.restitution(plasticity) == pytest.approx(expected)


@pytest.mark.parametrize("gamma", [0.0, 0.02, 50.0])
def test_a_contact_that_is_loaded_again_goes_up_as_it_unloads_and_gives_no_energy(
    gamma,
):
    """From the adhesive branch without a jump; on paths to and fro the work on the contact is never below zero."""
    plasticity = 0.5
    strongest, plastic, k2 = pull(plasticity, gamma)
    back = 0.6 * (plastic - strongest / k2) ** (2.0 / 3.0)
    down = np.linspace(DEEP, back, 2000)
    again = np.linspace(back, 1.2 * back, 200)[1:]
    found = forces_on([*down, *again], plasticity, gamma)[1999:]
    line = found[0] + k2 * (again**1.5 - back**1.5)
    loading = line < K1 * again**1.5  # below the virgin branch
    np.testing.assert_allclose(
        found[1:][loading], line[loading], rtol=1e-6, atol=1e-9 * K1 * DEEP**1.5
    )
    rng = np.random.default_rng(5)
    for _ in range(3):
        turns = [0.0, *rng.uniform(0.0, DEEP, 12), 0.0]
        path = np.concatenate(
            [np.linspace(a, b, 300) for a, b in itertools.pairwise(turns)]
        )
        forces = forces_on(path, plasticity, gamma)
        work = np.concatenate(
            [[0.0], np.cumsum(0.5 * (forces[1:] + forces[:-1]) * np.diff(path))]
        )
        assert work.min() > -1e-6 * work.max()
        assert np.abs(np.diff(forces)).max() < 0.05 * K1 * DEEP**1.5


def test_without_plasticity_it_is_the_dry_law_and_its_step_that_of_unloading():
    compare_with_the_dry_law("eepa", contact(0.0, 0.5, 0.4, 0.5), DEEP, 1e-15)
    plasticity = 0.5
    gamma = 0.02
    strongest, plastic, k2 = pull(plasticity, gamma)
    tile, kept = tile_of(LAW, GOJI, contact(plasticity, gamma), RADIUS)
    meets = plastic - strongest / k2
    for overlap in np.linspace(DEEP, 0.0, 100)[:-1]:
        limit = (
            normal_force(LAW, tile, kept, overlap)[0] + strongest / meets * overlap**1.5
        )
        np.testing.assert_allclose(
            tile[tl.PUSH // LANES], limit, rtol=1e-9, atol=1e-12 * K1 * DEEP**1.5
        )
    assert limit == pytest.approx(0.0, abs=1e-9 * K1 * DEEP**1.5)
    scene = partial(simulation, [[6e-3] * 3], contact_law="eepa", dt=1e-6)
    steps = [
        scene(contact=contact(plasticity)).longest_time_step()
        for plasticity in (0.0, 0.75)
    ]
    assert steps[1] == pytest.approx(0.5 * steps[0])


@pytest.mark.slow
@pytest.mark.parametrize("plasticity", [0.3, 0.8])
def test_a_hit_returns_the_restitution_of_its_plasticity(plasticity):
    """Head-on, without dashpot; with a dashpot it returns less than either alone."""

    def returned(e):
        s = head_on(e, contact=contact(plasticity, e=e), contact_law="eepa", dt=1e-5)
        while s.velocities[1, 0] < 1e-3 or len(s.contacts()):
            s.run_steps(20)
        return s.velocities[1, 0] / 0.5

    assert returned(1.0) == pytest.approx(eepa.restitution(plasticity), rel=5e-3)
    assert returned(0.7) < min(0.7, eepa.restitution(plasticity))

"""Cohesion: forces beside closed forms, work of a cycle, hits that stick, and how long walls hold a body."""

import math

import numpy as np
import pytest
from dem.common import GOJI, simulation
from oracles import jkr_force

from repose.dem import Contact, Material
from repose.dem.constants import COHESION_ENERGY_DENSITY, SURFACE_ENERGY
from repose.dem.kernels import clump_tile as ct
from repose.dem.kernels import state as st
from repose.dem.kernels import tile as tl
from repose.dem.laws import CONTACT_LAWS, jkr
from repose.dem.materials import effective_moduli

LANES = st.LANES
LAMMPS = Material(4.8e10 / 2.4, 0.2)  # of the unit tests of LAMMPS, package GRANULAR
RADIUS = 0.006


def coherent(gamma, e=1.0, sliding=0.0, rolling=0.0):
    return Contact(e, sliding, rolling, constants={SURFACE_ENERGY.name: gamma})


def tile_of(law, material, contact, radius, mass=1e-3):
    """A tile of equal contacts of two bodies at rest, normals along z, and what they keep."""
    tile = np.zeros((tl.LAW_ROW + law.n_rows, LANES))
    kept = np.zeros((ct.PAIR_STATE // LANES + law.n_state, LANES))
    tile[tl.LAW_ROW :][: law.n_constants] = law.constants(material, material, contact)[:, None]
    tile[tl.INVERSE_MASS // LANES], tile[tl.RADIUS // LANES] = 1.0 / mass, radius
    kept[2] = 1.0
    return tile, kept


def normal_force(law, tile, kept, overlap, at=st.PAIR_STATE, dt=0.0):
    """Normal force of each lane at an overlap; above 0 where it pushes."""
    tile[tl.GAP // LANES] = -np.asarray(overlap)
    law.kernel(law.make_options("keep"), tile.ravel(), kept.ravel(), at, dt)
    return -tile[tl.TO_A // LANES + 2]


def test_jkr_at_zero_overlap_pulls_as_in_the_unit_test_of_lammps():
    law = CONTACT_LAWS["jkr"]
    force = normal_force(law, *tile_of(law, LAMMPS, coherent(0.1), 0.005), 1e-18)
    np.testing.assert_allclose(force, -4.1888e-3, rtol=1e-5)
    np.testing.assert_allclose(force, -8.0 / 3.0 * math.pi * 0.1 * 0.005, rtol=1e-9)
    assert jkr.pull_off_force(coherent(0.1), 0.005) == pytest.approx(3.0 * math.pi * 0.1 * 0.005)


@pytest.mark.parametrize("gamma", [1e-9, 0.05, 20.0])
def test_jkr_on_a_path_to_and_fro_agrees_with_a_search_for_the_circle(gamma):
    law, (young, _) = CONTACT_LAWS["jkr"], effective_moduli(GOJI, GOJI)
    tile, kept = tile_of(law, GOJI, coherent(gamma), 3e-3)
    unit = (4.0 * math.pi * gamma * 3e-3**2 / young) ** (2.0 / 3.0) / 3e-3
    deepest, parting, strongest, ends = 3e-4 + 2.0 * unit, -0.4725 * unit, 0.0, 0
    path = (*np.linspace(1e-9, deepest, 40), *np.linspace(deepest, 1.1 * parting, 400), 1.2 * parting)
    for step, overlap in enumerate(path):
        radius = 3e-3 * (1.0 + 1e-5 * step)
        tile[tl.RADIUS // LANES] = radius
        force = normal_force(law, tile, kept, overlap)
        expected = jkr_force(young, 2.0 * gamma, radius, overlap)
        if expected is None:
            ends += 1
            np.testing.assert_array_equal(force, 0.0)
            assert kept[(st.PAIR_STATE + jkr.REACH) // LANES, 0] < -overlap
        else:
            strongest = min(strongest, expected / (3.0 * math.pi * gamma * radius))
            np.testing.assert_allclose(force, expected, rtol=1e-6, atol=1e-8 * gamma * radius)
    assert ends > 0
    assert gamma < 1e-6 or strongest == pytest.approx(-1.0, abs=2e-3)


def test_jkr_without_surface_energy_is_the_dry_law():
    forces = []
    for name, contact in (
        ("jkr", coherent(0.0, 0.4, 0.5)),
        ("hertz_mindlin_rescaled", Contact(0.4, 0.5, 0.0)),
    ):
        law = CONTACT_LAWS[name]
        tile, kept = tile_of(law, GOJI, contact, 3e-3)
        tile[tl.A // LANES + st.VELOCITY :][:3] = np.random.default_rng(4).normal(size=(3, LANES))
        for overlap in 3e-4 * (0.3 + np.sin(np.arange(30) / 4.0)):
            normal_force(law, tile, kept, overlap, dt=1e-5)
            forces.append(tile[tl.TO_A // LANES :][:3].copy())
    np.testing.assert_allclose(forces[:30], forces[30:], rtol=1e-12, atol=1e-18)


def test_work_of_a_cycle_of_jkr():
    """7.09 (w^5 R*^4 / E*^2)^(1/3): 0.663 pi w A^2 by the integral of the force from s = 1 to parting."""
    law, gamma, radius = CONTACT_LAWS["jkr"], 0.05, 3e-3
    tile, kept = tile_of(law, GOJI, coherent(gamma), radius)
    young, _ = effective_moduli(GOJI, GOJI)
    path = np.concatenate([np.linspace(1e-18, 3e-4, 2001), np.linspace(3e-4, -3e-4, 40001)])
    forces = np.array([normal_force(law, tile, kept, overlap)[0] for overlap in path])
    ended = 2002 + np.flatnonzero(forces[2002:] == 0.0)[0]
    work = np.trapezoid(forces[:ended], path[:ended])
    assert work == pytest.approx(sticking_energy(2.0 * gamma, radius, young), rel=3e-3)
    assert 7.09 * ((2.0 * gamma) ** 5 * radius**4 / young**2) ** (1.0 / 3.0) == pytest.approx(
        sticking_energy(2.0 * gamma, radius, young), rel=1e-3
    )


def sticking_energy(work, radius, young):
    """Work that a cycle of loading and unloading takes."""

    def integral(s):
        return 8.0 / 3.0 * s**7 - s**4 - 16.0 / 15.0 * s**10

    unit = (2.0 * math.pi * work * radius**2 / young) ** (1.0 / 3.0)
    return math.pi * work * unit**2 * (integral(1.0) - integral(0.25 ** (1.0 / 3.0)))


@pytest.mark.parametrize("radii", [(2e-3, 5e-3), (4e-3, 4e-3), (3e-3, math.inf)])
@pytest.mark.parametrize("of_spheres", [0, 1])
def test_area_of_sjkr_is_that_of_liggghts(radii, of_spheres):
    law, density, (a, b) = CONTACT_LAWS["sjkr"], 2e4, radii
    contact = Contact(1.0, 0.0, 0.0, constants={COHESION_ENERGY_DENSITY.name: density})
    reduced = a if b == math.inf else a * b / (a + b)
    tile, kept = tile_of(law, GOJI, contact, reduced)
    for row, radius in ((tl.HA, a), (tl.HB, b)):
        tile[row // LANES + 3] = tile[row // LANES + 5] = radius
    kept[ct.REACH // LANES] = a + b
    young, _ = effective_moduli(GOJI, GOJI)
    for overlap in (1e-5, 2e-4, 1e-3):
        law.geometry(law.make_options(), tile.ravel(), kept.ravel(), of_spheres, int(b == math.inf))
        force = normal_force(law, tile, kept, overlap, ct.PAIR_STATE)
        r = a - overlap if b == math.inf else a + b - overlap
        area = (
            math.pi * (a**2 - r**2)
            if b == math.inf
            else -math.pi / 4.0 * (r - a - b) * (r + a - b) * (r - a + b) * (r + a + b) / r**2
        )
        hertz = 4.0 / 3.0 * young * math.sqrt(reduced) * overlap**1.5
        np.testing.assert_allclose(force, hertz - density * area, rtol=1e-9)
    assert normal_force(law, tile, kept, -1e-9, ct.PAIR_STATE)[0] == 0.0


def test_a_contact_names_the_constants_that_its_law_needs():
    with pytest.raises(
        ValueError, match=r"'jkr' needs constants\['surface_energy_j_m2'\], the surface energy in J/m2"
    ):
        simulation(contact=Contact(0.3, 0.5, 0.0), contact_law="jkr")
    with pytest.raises(ValueError, match=r"'sjkr' needs constants\['cohesion_energy_density_j_m3'\]"):
        simulation(contact=coherent(0.1), contact_law="sjkr")
    with pytest.raises(
        ValueError, match=r"surface_energy_j_m2 is no constant of .* 'hertz_mindlin'; allowed: none"
    ):
        simulation(contact=coherent(0.1))
    for wrong in (-0.1, math.inf, "much", None):
        with pytest.raises(ValueError, match=r"surface_energy_j_m2 is .*; allowed: 0 or more J/m2"):
            simulation(contact=coherent(wrong), contact_law="jkr")
    with pytest.raises(ValueError, match=r"constants is \[\]; allowed: name: number"):
        Contact(0.3, 0.5, 0.0, constants=[])

"""Single contacts with published numbers: an oblique hit of LAMMPS' unit tests, and two contacts of Dosta et al."""

import numpy as np
import pytest
from dem.clump_scenes import FLOOR, scene

from repose.dem import Contact, Material, Shape
from repose.dem.materials import effective_moduli


def on_floor(radius, density, materials, contact, dt, height, velocity=(0.0, 0.0, 0.0), gravity=(0.0, 0.0, 0.0)):
    """One sphere above a floor."""
    laws = {"contact_law": "hertz_mindlin_rescaled", "tension": "keep"}
    sphere = Shape.sphere(radius, density, "body")
    s = scene({"body": sphere}, contact, {"floor": FLOOR}, dt, 1, gravity, **materials, **laws)
    s.add("body", (0.0, 0.0, height), velocity_m_s=velocity)
    return s


def material(young, poisson):
    return Material(young / (2.0 * (1.0 + poisson)), poisson)


def test_an_oblique_hit_leaves_as_in_the_unit_test_of_lammps():
    """`dem04` after test 4 of Chung and Ooi (2011): aluminium alloy, 40 degrees; the contact slides throughout.

    The number of LAMMPS is that of rigid bodies; here the arm is shorter by half the overlap.
    """
    alloy = material(7e10, 0.33)
    s = on_floor(
        0.0025, 2700.0, {"body": alloy, "wall": alloy}, Contact(0.98, 0.092, 0.0), 2e-8, 0.0025 + 1e-7,
        (2.5069, 0.0, -2.9876),
    )  # fmt: skip
    s.run_steps(1500)
    assert s.velocities[0, 2] == pytest.approx(2.927848, rel=1e-4)
    assert s.velocities[0, 0] == pytest.approx(1.962679, rel=1e-4)
    assert np.linalg.norm(s.angular_velocities[0]) == pytest.approx(544.22, rel=3e-3)


STEEL = material(210e9, 0.2)  # of the plate (Dosta et al., Comput. Phys. Commun. 296 (2024) 109066)


def test_a_sphere_leaves_a_steel_plate_as_in_the_benchmark_of_dosta_and_others():
    """It touches after exactly 20 steps, to rounding, and the first force grows with the fourth root of the overlap."""
    s = on_floor(
        1e-3, 2500.0, {"body": material(1e9, 0.2), "wall": STEEL}, Contact(0.4, 0.0, 0.0), 5e-7, 1.01e-3,
        (0.0, 0.0, -1.0),
    )  # fmt: skip
    s.run_steps(121)
    assert s.velocities[0, 2] == pytest.approx(0.40107538, rel=3e-5)
    assert 1e3 * s.positions[0, 2] == pytest.approx(1.00724022, rel=1e-6)


def test_a_steel_sphere_slides_on_a_plate_as_in_the_benchmark_of_dosta_and_others():
    """From rest, sunk under its weight: 4 m/s2 along the plate, and 2.5 mu g / r about the axis."""
    mass, (young, _) = 7200.0 * 4.0 / 3.0 * np.pi * 1e-9, effective_moduli(STEEL, STEEL)
    sunk = (5.0 * mass / (4.0 / 3.0 * young * np.sqrt(1e-3))) ** (2.0 / 3.0)
    s = on_floor(
        1e-3, 7200.0, {"body": STEEL, "wall": STEEL}, Contact(0.4, 0.2, 0.0), 2.5e-7, 1e-3 - sunk,
        gravity=(5.0, 0.0, -5.0),
    )  # fmt: skip
    s.run_steps(20002)
    assert s.velocities[0, 0] == pytest.approx(0.02000311, rel=1e-4)
    assert s.angular_velocities[0, 1] == pytest.approx(12.498321, rel=3e-4)

"""A berry from a few numbers: closed-form volumes, axes, mass; what is impossible is refused."""

import math

import numpy as np
import pytest
from refusals import input_error

from repose.particle import build, mesh_from_axes
from repose.particle.mesh import principal_pose

GOJI_MM, GOJI_G, DENSITY = (21.14, 11.37, 9.88), 1.25, 840.47


def fullness(shape):
    """Share of its bounding box that a smooth body fills, V / (L W T), in closed form."""
    m, k = mesh_from_axes.profile_exponents(shape)
    beta = math.gamma(1 / m) * math.gamma(2 * k + 1) / math.gamma(1 / m + 2 * k + 1)
    return math.pi / 4 * beta / m


@pytest.mark.parametrize(
    ("number", "share"), [(1.0, np.pi / 4 * 8 / 15), (2.0, np.pi / 6), (3.0, 0.63308), (1e3, np.pi / 4)]
)
def test_fullness_in_closed_form(number, share):
    assert fullness(number) == pytest.approx(share, rel=2e-4)


@pytest.mark.parametrize("number", [1.2, 2.0, 2.9, 5.0])
def test_the_mesh_has_the_axes_the_mass_and_the_exponent_it_was_made_from(number):
    axes = np.array([20.0, 12.0, 9.0])
    mass = 1e-6 * DENSITY * fullness(number) * axes.prod()
    mesh, found = mesh_from_axes.berry_mesh(axes, mass, DENSITY)
    assert mesh.is_watertight
    assert mesh.volume * DENSITY * 1e-6 == pytest.approx(mass, rel=1e-9)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), axes, rtol=1e-3)
    assert found == pytest.approx(number, rel=0.02)


def test_taper_and_wrinkles_keep_mass_and_axes():
    mesh, _ = mesh_from_axes.berry_mesh(GOJI_MM, 1.05, DENSITY, taper=0.1, wrinkles=8, wrinkle_depth_mm=0.2)
    assert mesh.is_watertight
    assert mesh.volume * DENSITY * 1e-6 == pytest.approx(1.05, rel=1e-9)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), GOJI_MM, rtol=2e-3)
    assert mesh.center_mass[0] > 0.1
    # Grooves: the belly's radius swings by their depth, eight times round.
    ring = mesh.vertices[np.abs(mesh.vertices[:, 0] - 1.0).argsort()[: mesh_from_axes.SECTORS]]
    size = np.hypot(ring[:, 1] / GOJI_MM[1], ring[:, 2] / GOJI_MM[2]) * 2
    assert np.ptp(size) == pytest.approx(0.2 / (GOJI_MM[2] / 2), rel=0.05)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"mass_g": 2.0}, "to 1.56 for these axes"),
        ({"mass_g": 0.5}, "0.42 to 0.78 of the box"),
        ({"axes_mm": (9.0, 12.0, 20.0)}, "longest first"),
        ({"taper": 2.0}, "-0.5 to 0.5"),
        ({"wrinkles": 5}, "wrinkle_depth_mm"),
        ({"wrinkles": 5, "wrinkle_depth_mm": 3.0}, "0 to 0.741"),
        ({"density_kg_m3": -1.0}, "positive"),
    ],
)
def test_impossible_berries_are_refused_with_what_is_allowed(keys, words):
    arguments = {"axes_mm": GOJI_MM, "mass_g": GOJI_G, "density_kg_m3": DENSITY} | keys
    input_error(words, mesh_from_axes.berry_mesh, **arguments)


def test_the_goji_berry_is_two_ellipsoids():
    """1.25 g and 1487 mm3, as measured, within 1 % of the minor axis by two components."""
    mesh = principal_pose(mesh_from_axes.berry_mesh(GOJI_MM, GOJI_G, DENSITY)[0])
    particle = build.fit_particle(mesh, DENSITY)
    assert particle.kind == "smooth"
    assert len(particle.semi_axes_m) == 2
    assert particle.volume_m3 * 1e9 == pytest.approx(1487.3, rel=2e-3)
    assert particle.mass_kg == pytest.approx(1.25e-3, rel=2e-3)
    assert particle.deviation_max_m < 0.01 * 9.88e-3
    np.testing.assert_allclose(particle.axes_m * 1e3, GOJI_MM, rtol=0.012)
    np.testing.assert_allclose(particle.inertia_kg_m2, particle.mesh_inertia_kg_m2, rtol=0.005)

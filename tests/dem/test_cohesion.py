"""Cohesion: forces beside closed forms, work of a cycle, hits that stick, and how long walls hold a body."""

import math

import numpy as np
import pytest
from dem.clump_scenes import CONE, ball_of_one, bent
from dem.clump_scenes import scene as scene_of
from dem.common import (
    DENSITY,
    DOWN,
    FLOOR,
    GOJI,
    LANES,
    PVC,
    angular_momentum,
    normal_force,
    simulation,
    tile_of,
)
from dem.test_epsd import GRAVITY, on_floor, smooth
from dem.test_epsd import scene as rolling_scene
from oracles import jkr_force
from refusals import value_error
from scipy.optimize import brentq
from verification.simulations import smooth as smooth_body

from repose.dem import Cone, Contact, Cylinder, Material, Mesh, Motion, RingEdge, Shape
from repose.dem.constants import COHESION_ENERGY_DENSITY, OF_LAWS, SURFACE_ENERGY
from repose.dem.kernels import clump_tile as ct
from repose.dem.kernels import state as st
from repose.dem.kernels import tile as tl
from repose.dem.laws import CONTACT_LAWS, jkr
from repose.dem.laws.epsd import HERTZ_TWIST
from repose.dem.materials import effective_moduli

LAMMPS = Material(4.8e10 / 2.4, 0.2)  # of the unit tests of LAMMPS, package GRANULAR
RADIUS = 0.006


def coherent(gamma, e=1.0, sliding=0.0, rolling=0.0):
    return Contact(e, sliding, rolling, constants={SURFACE_ENERGY.name: gamma})


def test_jkr_pulls_as_in_lammps_and_without_energy_is_the_dry_law():
    law = CONTACT_LAWS["jkr"]
    force = normal_force(law, *tile_of(law, LAMMPS, coherent(0.1), 0.005), 1e-18)
    np.testing.assert_allclose(force, -4.1888e-3, rtol=1e-5)
    np.testing.assert_allclose(force, -8.0 / 3.0 * math.pi * 0.1 * 0.005, rtol=1e-9)
    expected = 3.0 * math.pi * 0.1 * 0.005
    assert jkr.pull_off_force(coherent(0.1), 0.005) == pytest.approx(expected)
    compare_with_the_dry_law("jkr", coherent(0.0, 0.4, 0.5), 3e-4, 1e-18)


def test_jkr_needs_its_sticking_energy_to_part():
    # 7.09 (w^5 R*^4 / E*^2)^(1/3): 0.663 pi w A^2 by the integral of the force from s = 1 to parting.
    law = CONTACT_LAWS["jkr"]
    gamma = 0.05
    radius = 3e-3
    tile, kept = tile_of(law, GOJI, coherent(gamma), radius)
    young, _ = effective_moduli(GOJI, GOJI)
    path = np.concatenate(
        [np.linspace(1e-18, 3e-4, 2001), np.linspace(3e-4, -3e-4, 40001)]
    )
    forces = np.array([normal_force(law, tile, kept, overlap)[0] for overlap in path])
    ended = 2002 + np.flatnonzero(forces[2002:] == 0.0)[0]
    work = np.trapezoid(forces[:ended], path[:ended])
    known = sticking_energy(2.0 * gamma, radius, young)
    assert work == pytest.approx(known, rel=3e-3)
    assert 7.09 * ((2.0 * gamma) ** 5 * radius**4 / young**2) ** (
        1.0 / 3.0
    ) == pytest.approx(known, rel=1e-3)


@pytest.mark.parametrize("gamma", [1e-9, 0.05, 20.0])
def test_jkr_on_a_path_to_and_fro_agrees_with_a_search_for_the_circle(gamma):
    law = CONTACT_LAWS["jkr"]
    young, _ = effective_moduli(GOJI, GOJI)
    tile, kept = tile_of(law, GOJI, coherent(gamma), 3e-3)
    unit = (4.0 * math.pi * gamma * 3e-3**2 / young) ** (2.0 / 3.0) / 3e-3
    deepest = 3e-4 + 2.0 * unit
    parting = -0.4725 * unit
    strongest = 0.0
    ends = 0
    path = (
        *np.linspace(1e-9, deepest, 40),
        *np.linspace(deepest, 1.1 * parting, 400),
        1.2 * parting,
    )
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
            np.testing.assert_allclose(
                force, expected, rtol=1e-6, atol=1e-8 * gamma * radius
            )
    assert ends > 0
    assert gamma < 1e-6 or strongest == pytest.approx(-1.0, abs=2e-3)


def compare_with_the_dry_law(name, cohesive, deep, atol):
    forces = []
    for law, contact in (
        (name, cohesive),
        ("hertz_mindlin_rescaled", Contact(0.4, 0.5, 0.0)),
    ):
        law = CONTACT_LAWS[law]
        tile, kept = tile_of(law, GOJI, contact, 3e-3)
        tile[tl.A // LANES + st.VELOCITY :][:3] = np.random.default_rng(4).normal(
            size=(3, LANES)
        )
        for overlap in deep * (0.3 + np.sin(np.arange(30) / 4.0)):
            normal_force(law, tile, kept, overlap, dt=1e-5)
            forces.append(tile[tl.TO_A // LANES :][:3].copy())
    np.testing.assert_allclose(forces[:30], forces[30:], rtol=1e-12, atol=atol)


def sticking_energy(work, radius, young):
    def integral(s):
        return 8.0 / 3.0 * s**7 - s**4 - 16.0 / 15.0 * s**10

    unit = (2.0 * math.pi * work * radius**2 / young) ** (1.0 / 3.0)
    return math.pi * work * unit**2 * (integral(1.0) - integral(0.25 ** (1.0 / 3.0)))


@pytest.mark.parametrize("radii", [(2e-3, 5e-3), (4e-3, 4e-3), (3e-3, math.inf)])
@pytest.mark.parametrize("of_spheres", [0, 1])
def test_area_of_sjkr_is_that_of_liggghts(radii, of_spheres):
    """The area is that of the disc in which two spheres, or a sphere and a plane (radius b infinite), cut each other."""
    law = CONTACT_LAWS["sjkr"]
    density = 2e4
    a, b = radii
    on_plane = b == math.inf
    contact = Contact(1.0, 0.0, 0.0, constants={COHESION_ENERGY_DENSITY.name: density})
    reduced = a if on_plane else a * b / (a + b)
    tile, kept = tile_of(law, GOJI, contact, reduced)
    tile[tl.AREA_A // LANES] = a**2
    tile[tl.AREA_B // LANES] = b**2
    kept[ct.REACH // LANES] = a + b
    young, _ = effective_moduli(GOJI, GOJI)
    for overlap in (1e-5, 2e-4, 1e-3):
        law.geometry(
            law.make_options(), tile.ravel(), kept.ravel(), of_spheres, int(on_plane)
        )
        force = normal_force(law, tile, kept, overlap, ct.PAIR_STATE)
        if on_plane:
            area = math.pi * (a**2 - (a - overlap) ** 2)
        else:
            r = a + b - overlap  # distance of the centres
            factors = (r - a - b) * (r + a - b) * (r - a + b) * (r + a + b)
            area = -math.pi / 4.0 * factors / r**2
        hertz = 4.0 / 3.0 * young * math.sqrt(reduced) * overlap**1.5
        np.testing.assert_allclose(force, hertz - density * area, rtol=1e-9)
    assert normal_force(law, tile, kept, -1e-9, ct.PAIR_STATE)[0] == 0.0
    # unused lanes hold a body that lies on itself
    deepest = 2.0 * a if on_plane else a + b
    assert np.isfinite(normal_force(law, tile, kept, deepest, ct.PAIR_STATE)).all()


@pytest.mark.slow
@pytest.mark.parametrize("contact_law", ["hertz_mindlin_rescaled", "jkr"])
@pytest.mark.parametrize("law", ["constant_torque", "epsd", "epsd2"])
def test_spin_on_a_floor_is_slowed_by_load_and_adhesion(law, contact_law):
    """By mu_t (m g + 3 pi w R) a0 over 0.4 m R^2: the limit holds twice the pull-off force, and the circle is JKR's."""
    gamma = 0.05 if contact_law == "jkr" else 0.0
    twisting = 0.5
    contact = Contact(
        0.2, 0.4, 0.1, twisting, constants={SURFACE_ENERGY.name: gamma} if gamma else {}
    )
    keywords = {
        "contact_law": contact_law,
        "rolling_law": law,
        "spin": (0.0, 0.0, 150.0),
        "material": GOJI,
    }
    s = on_floor(smooth(), contact, dt=2e-5, **keywords)
    s.run_steps(4000)
    radius = s.radius
    mass = s.shapes["body"].mass_kg
    overlap = radius - s.positions[0, 2]
    circle = (
        jkr.circle_radius(GOJI, PVC, contact, radius, overlap)
        if gamma
        else math.sqrt(radius * overlap)
    )
    before = s.angular_velocities[0, 2]
    s.run_steps(2000)
    limit = mass * GRAVITY + 3.0 * math.pi * 2.0 * gamma * radius
    slowed = twisting * limit * circle / (0.4 * mass * radius**2) * 2000 * s.time_step_s
    assert before - s.angular_velocities[0, 2] == pytest.approx(slowed, rel=5e-3)
    assert before > 2.0 * slowed
    assert twisting != HERTZ_TWIST * 0.4


@pytest.mark.slow
@pytest.mark.parametrize("law", ["constant_torque", "epsd", "epsd2"])
def test_two_that_part_across_a_gap_keep_their_angular_momentum(law):
    contact = Contact(0.5, 0.5, 0.3, constants={SURFACE_ENERGY.name: 1.0})
    s = rolling_scene(
        smooth(),
        contact,
        dt=2e-6,
        gravity=(0.0, 0.0, 0.0),
        contact_law="jkr",
        rolling_law=law,
    )
    s.add("body", (0.0, 0.0, 0.0), angular_velocity_rad_s=(3.0, 1.0, 2.0))
    s.add(
        "body",
        (0.0, 0.0, 2.0 * s.radius - 1e-5),
        (1, 0, 0, 0),
        (0.0, 0.02, 2.0),
        (-2.0, 1.0, -3.0),
    )
    before = angular_momentum(s)
    gaps = []
    spins = []
    for _ in range(400):
        s.run_steps(2)
        gaps.append(np.linalg.norm(s.positions[1] - s.positions[0]) - 2.0 * s.radius)
        spins.append(s.angular_velocities[0, 2])
        if not len(s.contacts()):
            break
    apart = np.array(gaps) > 0.0
    assert np.abs(angular_momentum(s) - before).max() < 1e-9 * np.abs(before).max()
    assert apart.sum() > 3
    assert np.ptp(np.array(spins)[apart]) > 0.0, "resisted across the gap"


KINDS = ("sphere", "smooth", "clump")


def solid(kind, radius=RADIUS, density=DENSITY):
    if kind == "clump":
        return ball_of_one(radius, density=density)
    return (Shape.sphere if kind == "sphere" else smooth_body)(radius, density, "body")


def scene(shape, contact, material=GOJI, **keywords):
    keywords = {
        "contact_law": "jkr",
        "lower": (-0.2, -0.2, -0.2),
        "upper": (0.2, 0.2, 0.2),
    } | keywords
    return scene_of({"body": shape}, contact, body=material, **keywords)


def settled_overlap(contact, law, tension, kind):
    """Overlap at rest of two spheres of Lethe's test: 0.2 m wide, 1e5 Pa, 0.3."""
    s = scene(
        solid(kind, 0.1, 1000.0),
        contact,
        Material(1e5 / 2.6, 0.3),
        dt=2e-4,
        contact_law=law,
        tension=tension,
    )
    s.add("body", (-0.0999, 0.0, 0.0))
    s.add("body", (0.0999, 0.0, 0.0))
    s.run_steps(30000)
    assert np.abs(s.velocities).max() < 1e-6
    return s.overlaps()[1][0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_spheres_at_rest_overlap_as_in_the_test_of_lethe(kind):
    for tension in ("keep", "release"):
        assert settled_overlap(
            coherent(50.0, 0.3), "jkr", tension, kind
        ) == pytest.approx(0.010703, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_spheres_of_sjkr_rest_where_hertz_carries_the_cohesion(kind):
    density = 2000.0
    young, _ = effective_moduli(Material(1e5 / 2.6, 0.3), Material(1e5 / 2.6, 0.3))

    def rest(overlap):
        r = 0.2 - overlap
        area = math.pi / 4.0 * overlap * r * r * (r + 0.2) / r**2
        return 4.0 / 3.0 * young * math.sqrt(0.05) * overlap**1.5 - density * area

    contact = Contact(0.3, 0.0, 0.0, constants={COHESION_ENERGY_DENSITY.name: density})
    assert settled_overlap(contact, "sjkr", "keep", kind) == pytest.approx(
        brentq(rest, 1e-5, 0.05), rel=1e-4
    )


GAMMA = 0.05
TUBE = 0.05
CORE = 0.03
EDGE = 0.002


def walls():
    """Walls by name: wall, R* of a sphere on it, place where the sphere touches it, normal into the wall."""
    corners = 0.05 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    down = (0.0, 0.0, -1.0)
    out = (1.0, 0.0, 0.0)
    slant = np.array([0.09, 0.0, -0.054]) / math.hypot(0.09, 0.054)
    yield "plane", FLOOR, RADIUS, (0.0, 0.0, 0.0), down
    mesh = Mesh(corners, [[0, 1, 2], [0, 2, 3]], "wall", edge_radius_m=0.001)
    yield "mesh", mesh, RADIUS, (0.011, 0.003, 0.0), down
    hollow = RADIUS / math.sqrt(1.0 - RADIUS / TUBE)
    yield (
        "tube",
        Cylinder((0.0, 0.0, -0.1), (0.0, 0.0, 1.0), 0.2, TUBE, "wall"),
        hollow,
        (TUBE, 0.0, 0.0),
        out,
    )
    hollow = RADIUS / math.sqrt(1.0 - RADIUS * slant[0] / 0.043)
    cone = Cone.between((0.0, 0.0, 0.03), (0.0, 0.0, 1.0), 0.09, 0.016, 0.07, "wall")
    yield "cone", cone, hollow, (0.043, 0.0, 0.075), slant
    bent = 1.0 / math.sqrt(
        (1.0 / RADIUS + 1.0 / EDGE) * (1.0 / RADIUS - 1.0 / (CORE - EDGE))
    )
    yield "ring", RingEdge(CORE, EDGE, "wall"), bent, (CORE - EDGE, 0.0, 0.0), out


WALLS = {name: rest for name, *rest in walls()}


def hit(kind, wall, share):
    """Energy after a hit and before it over the work of a cycle, and how many contacts hold the body in the end."""
    contact = coherent(GAMMA)
    shape = solid(kind)
    if wall is None:
        s = scene(shape, contact)
        radius = 0.5 * RADIUS
        mass = 0.5 * shape.mass_kg
        young, _ = effective_moduli(GOJI, GOJI)
        s.add("body", (RADIUS, 0.0, 0.0))
        place = (0.0, 0.0, 0.0)
        normal = (1.0, 0.0, 0.0)
    else:
        surface, radius, place, normal = WALLS[wall]
        s = scene(shape, contact, walls={"wall": surface})
        mass = shape.mass_kg
        young, _ = effective_moduli(GOJI, PVC)
    work = sticking_energy(2.0 * GAMMA, radius, young)
    normal = np.array(normal)
    velocity = math.sqrt(2.0 * share * work / mass) * normal
    s.add("body", np.array(place) - (RADIUS + 1e-6) * normal, velocity_m_s=velocity)
    s.run_steps(20000)
    drift = s.velocities.mean(axis=0) if wall is None else 0.0
    left = 0.5 * shape.mass_kg * np.sum((s.velocities - drift) ** 2)
    return left / work, len(s.contacts()) + len(s.wall_overlaps()[0])


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("wall", [None, *WALLS])
def test_a_hit_below_the_sticking_speed_sticks_and_one_above_it_leaves_without_the_work_of_a_cycle(
    kind, wall
):
    assert hit(kind, wall, 0.9)[1] == 1
    left, contacts = hit(kind, wall, 2.0)
    assert contacts == 0
    assert left == pytest.approx(1.0, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("wall", list(WALLS))
def test_a_wall_holds_a_body_up_to_the_pull_off_force(kind, wall):
    surface, radius, place, normal = WALLS[wall]
    shape = solid(kind)
    contact = coherent(GAMMA, 0.1, 5.0, 5.0)
    s = scene(shape, contact, walls={"wall": surface})
    s.add("body", np.array(place) - (RADIUS - 1e-5) * np.array(normal))
    s.run_steps(3000)
    pull = jkr.pull_off_force(contact, radius) / shape.mass_kg
    for share in np.linspace(0.0, 0.97, 50):
        s.physics.gravity[:] = -share * pull * np.array(normal)
        s.run_steps(300)
    s.run_steps(20000)
    assert np.abs(s.velocities).max() < 1e-6
    assert len(s.wall_overlaps()[0]) == 1
    s.physics.gravity[:] = -1.02 * pull * np.array(normal)
    s.run_steps(10000)
    assert len(s.wall_overlaps()[0]) == 0


def lifted_pile(gamma, seed):
    """Mean height of 150 spheres over their mean distance from the axis, at rest after a cylinder was lifted."""
    rng = np.random.default_rng(seed)
    wide = 0.024
    s = scene(
        solid("sphere", 0.004),
        coherent(gamma, 0.3, 0.4, 0.05),
        dt=1e-4,
        on_wall=coherent(0.0, 0.3, 0.2, 0.05),
        capacity=150,
        gravity=DOWN,
        tension="release",
        walls={
            "floor": FLOOR,
            "cylinder": Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.4, wide, "wall"),
        },
    )
    for number in range(150):
        angle = 0.5 * math.pi * number + rng.normal(0.0, 0.2)
        place = 0.5 * wide * math.cos(angle), 0.5 * wide * math.sin(angle)
        s.add("body", (*place, 0.006 + 0.0084 * (number // 4)))
    s.run(1.0, False)
    s.set_motion("cylinder", Motion((0.0, 0.0, 0.1)))
    s.run(1.5, False)
    assert s.kinetic_energies().max() < 1e-9
    return s.positions[:, 2].mean() / np.hypot(*s.positions[:, :2].T).mean()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["smooth", "clump"])
def test_a_place_that_no_contact_uses_keeps_nothing_of_an_earlier_one(kind):
    """Such places belong to a body of their own, which stays where it is: it is the walls' side of contacts, too."""
    shape, at = (bent(), ct) if kind == "clump" else (smooth(), st)
    walls = {"floor": FLOOR, "cone": CONE}
    contact = coherent(0.05, 0.5, 0.5, 0.05)
    s = scene_of(
        {"body": shape},
        contact,
        walls,
        1e-4,
        9,
        (0.0, 0.0, -GRAVITY),
        contact_law="jkr",
    )
    for k in range(9):
        s.add("body", (0.025 * (k % 3 - 1), 0.025 * (k // 3 - 1), 0.08 + 0.004 * k))
    left = 0
    lists = [("curved", at.WALL_STATE, st.N_CURVED)]
    # the smooth body of unused places touches itself and planes, with finite forces that move nothing
    if kind == "clump":
        lists += [
            ("flat", at.WALL_STATE, st.N_PLANE),
            ("pairs", at.PAIR_STATE, st.N_PAIRS),
        ]
    for _ in range(60):
        s.run_steps(50)
        for name, begin, number in lists:
            data = getattr(s, name).data
            used = s.counts[number]
            kept = data.reshape(len(data), -1, LANES)[:, begin // LANES :].transpose(
                0, 2, 1
            )
            assert not kept.reshape(-1, kept.shape[2])[used:].any(), (name, s.steps)
            left = max(left, used)
        assert not s.bodies.rows[s.capacity, :6].any()
    assert left > 2
    assert np.isfinite(s.positions).all()


@pytest.mark.slow
def test_a_pile_is_steeper_the_higher_the_surface_energy():
    """0.100, 0.141 and 0.189 with errors of 0.001, 0.004 and 0.007 on an Intel Xeon."""
    steepness = np.array(
        [[lifted_pile(gamma, seed) for seed in range(6)] for gamma in (0.0, 0.02, 0.05)]
    )
    error = steepness.std(axis=1, ddof=1) / math.sqrt(6)
    assert np.all(
        np.diff(steepness.mean(axis=1)) > 3.0 * np.hypot(error[1:], error[:-1])
    )


def test_the_constants_of_each_law_are_known_and_asked_for_by_name():
    for name, law in CONTACT_LAWS.items():
        assert OF_LAWS.get(name, ()) == law.asks
    with pytest.raises(
        ValueError,
        match=r"'jkr' needs constants\['surface_energy_j_m2'\], the surface energy in J/m2",
    ):
        simulation(contact=Contact(0.3, 0.5, 0.0), contact_law="jkr")
    with pytest.raises(
        ValueError, match=r"'sjkr' needs constants\['cohesion_energy_density_j_m3'\]"
    ):
        simulation(contact=coherent(0.1), contact_law="sjkr")
    with pytest.raises(
        ValueError,
        match=r"surface_energy_j_m2 is not a constant of .* 'hertz_mindlin'; expected none",
    ):
        simulation(contact=coherent(0.1))
    for wrong in (-0.1, math.inf, "much", None):
        with pytest.raises(
            ValueError, match=r"surface_energy_j_m2 is .*; expected 0 or more J/m2"
        ):
            simulation(contact=coherent(wrong), contact_law="jkr")
    value_error(
        r"constants is \[\]; expected name: number",
        Contact,
        0.3,
        0.5,
        0.0,
        constants=[],
    )

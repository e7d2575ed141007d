"""The tangential force that pressing keeps and unloading lowers: beside its increments, and along known paths."""

import math
from dataclasses import replace

import numpy as np
import pytest
from dem.clump_scenes import ball_of_one, bent, scene
from dem.common import BERRY, GOJI, LANES, PVC, random_direction, tile_of
from dem.test_epsd import berry, smooth
from oracles import hertz_mindlin_rescaled as slow_law

from repose.dem import Contact, Motion, Plane
from repose.dem.kernels import state as st
from repose.dem.kernels import tile as tl
from repose.dem.laws import CONTACT_LAWS
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

LAW = CONTACT_LAWS["hertz_mindlin_rescaled"]
RADIUS = 0.006
HEAVY = 1e9
STEP = 5e-5
SPEED = 0.01
NO_SLIP = Contact(1.0, 100.0, 0.0)


@pytest.mark.parametrize(
    ("tension", "limit"), [("keep", "elastic"), ("release", "total"), ("cut", "total")]
)
def test_a_tile_of_contacts_on_random_paths_agrees_with_the_increments_of_the_force(
    tension, limit
):
    rng = np.random.default_rng(11)
    dt = 1e-4
    steps = 120
    mass = 1.1e-3
    contact = Contact(0.4, 0.5, 0.0)
    tile, kept = tile_of(LAW, GOJI, contact, 3e-3, mass, tension)
    shares = tile[tl.SHARE // LANES] = rng.uniform(0.2, 1.0, LANES)
    law = (
        *effective_moduli(GOJI, GOJI),
        mass,
        damping_ratio(contact.restitution, tension),
        contact.static_friction,
    )
    options = LAW.make_options(tension)
    normal = np.array([random_direction(rng) for _ in range(LANES)])
    phase = rng.uniform(0.0, 6.0, LANES)
    period = rng.uniform(20.0, 90.0, LANES)
    pull = np.zeros((LANES, 3))
    before = np.zeros(LANES)
    slid = stuck = parted = 0
    for step in range(steps):
        # the overlap swings and is none now and then; body A slides to and fro on B at rest, and the plane tilts
        overlap = 3e-4 * (0.7 + np.sin(phase + step / period * 6.3))
        radius = 3e-3 * (1.0 + 0.2 * np.sin(step / period))
        normal += 2e-3 * rng.normal(size=normal.shape)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        velocity = 0.06 * rng.normal(size=(LANES, 3)) * (1.0 + 9.0 * (step % 5 == 0))
        tile[tl.GAP // LANES] = -overlap
        tile[tl.RADIUS // LANES] = radius
        tile[tl.A // LANES + st.VELOCITY :][:3] = velocity.T
        kept[:3] = normal.T
        LAW.kernel(options, tile.ravel(), kept.ravel(), st.NORMAL + 3 * LANES, dt)
        force = tile[tl.TO_A // LANES :][:3].T
        push = tile[tl.PUSH // LANES]
        for k in range(LANES):
            if overlap[k] <= 0.0:
                pull[k] = 0.0
                before[k] = 0.0
                parted = parted + 1
                assert np.all(force[k] == 0.0)
                assert np.all(kept[3:, k] == 0.0)
                continue
            expected, pull[k], limiting, before[k] = slow_law(
                law,
                overlap[k],
                radius[k],
                normal[k],
                velocity[k],
                pull[k],
                before[k],
                dt,
                tension == "keep",
                limit,
                shares[k],
            )
            assert np.allclose(force[k], expected, rtol=1e-9, atol=1e-13)
            assert push[k] == pytest.approx(limiting, rel=1e-9)
            full = np.linalg.norm(pull[k]) > 0.999 * contact.static_friction * limiting
            slid = slid + full
            stuck = stuck + (not full)
    assert min(slid, stuck, parted) > 200


def heavy(shape):
    return replace(
        shape,
        mass_kg=HEAVY * shape.mass_kg,
        inertia_kg_m2=HEAVY * np.array(shape.inertia_kg_m2),
    )


# shape, R* and depth below the centre of the place that touches a floor; two spheres of the bent clump are the lowest
SHAPES = [
    pytest.param(smooth, RADIUS, RADIUS, id="sphere"),
    pytest.param(
        berry, BERRY[0, 0] * BERRY[0, 1] / BERRY[0, 2], BERRY[0, 2], id="berry"
    ),
    pytest.param(
        ball_of_one, RADIUS, RADIUS, id="clump of one", marks=pytest.mark.slow
    ),
]


class Led:
    """A body that nothing moves, and a floor that is led along legs; overlaps and slides in m."""

    def __init__(self, shape, depth, contact=NO_SLIP, **laws):
        laws = {"contact_law": "hertz_mindlin_rescaled", "tension": "release"} | laws
        floor = Plane((0.0, 0.0, -depth - 1e-6), (0.0, 0.0, 1.0), "wall")
        self.simulation = scene(
            {"body": heavy(shape)}, contact, {"floor": floor}, STEP, **laws
        )
        self.simulation.add("body", (0.0, 0.0, 0.0))
        self.work = 0.0
        self.force = np.zeros(3)

    def begin(self, way):
        """Let the floor set off along a way; the number of steps that it takes."""
        steps = math.ceil(np.linalg.norm(way) / (SPEED * STEP))
        self.simulation.set_motion("floor", Motion(way / (steps * STEP)))
        return steps

    def force_after(self, x, z):
        """The force on the floor at the end of a leg [N]."""
        self.simulation.run_steps(self.begin(np.array([x, 0.0, z])))
        return -self.simulation.wall_loads()["floor"].force_n

    def add_work(self, x, z):
        """Add the work of a leg, for which the force of each step is needed."""
        way = np.array([x, 0.0, z])
        steps = self.begin(way)
        for _ in range(steps):
            self.simulation.run_steps(1)
            now = -self.simulation.wall_loads()["floor"].force_n
            self.work += float(0.5 * (self.force + now) @ way) / steps
            self.force = now


@pytest.mark.parametrize(("shape", "radius", "depth"), SHAPES)
def test_an_unloading_lowers_the_force_with_the_circle_and_an_end_takes_it_all(
    shape, radius, depth
):
    led = Led(shape(), depth)
    _, shear = effective_moduli(GOJI, PVC)
    circle = np.sqrt(radius * np.array([2e-4, 8e-4, 5e-4]))
    assert led.force_after(0.0, 2e-4 + 1e-6)[0] == 0.0
    slid = led.force_after(1e-4, 0.0)[0]
    assert slid == pytest.approx(8.0 * shear * circle[0] * 1e-4, rel=1e-3)
    assert led.force_after(0.0, 6e-4)[0] == pytest.approx(slid, rel=1e-4)
    expected = slid * circle[2] / circle[1]
    assert led.force_after(0.0, -3e-4)[0] == pytest.approx(expected, rel=1e-3)
    # pressed again it stays where the unloading left it
    expected = slid * circle[2] / circle[1]
    assert led.force_after(0.0, 3e-4)[0] == pytest.approx(expected, rel=1e-3)
    led = Led(shape(), depth)
    led.force_after(0.0, 4e-4 + 1e-6)
    slid = led.force_after(1e-4, 0.0)[0]
    assert led.force_after(0.0, -5e-4)[0] == 0.0
    assert abs(led.force_after(0.0, 5e-4)[0]) < 1e-5 * slid


def loop(led, forward):
    """Energy that comes out of a closed path: slide and press, or press and slide, and back [J]."""
    legs = [(2e-4, 0.0), (0.0, 8e-4)][:: 1 if forward else -1]
    for x, z in [
        (0.0, 2e-4 + 1e-6),
        *legs,
        *((-x, -z) for x, z in legs),
        (0.0, -2e-4 - 1e-6),
    ]:
        led.add_work(x, z)
    return -led.work


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "depth"),
    [
        pytest.param(smooth, RADIUS, id="sphere"),
        pytest.param(berry, BERRY[0, 2], id="berry"),
        pytest.param(ball_of_one, RADIUS, id="clump of one", marks=pytest.mark.slow),
        pytest.param(bent, 4.5e-3, id="bent clump", marks=pytest.mark.slow),
    ],
)
def test_a_closed_path_without_slip_gives_no_energy(shape, depth):
    for forward in (True, False):
        assert loop(Led(shape(), depth), forward) < 2e-8
    # the spring of the present stiffness gives a microjoule one way or the other: the path does tell
    laws = {"contact_law": "hertz_mindlin", "tension": "keep"}
    assert (
        max(loop(Led(shape(), depth, **laws), forward) for forward in (True, False))
        > 1e-6
    )

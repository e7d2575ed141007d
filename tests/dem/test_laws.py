import math
import subprocess
import sys

import numpy as np
import pytest
from dem.common import GOJI, LANES, head_on, normal_force, simulation, tile_of
from refusals import value_error

from repose.dem import Contact, Material
from repose.dem.kernels import state as st
from repose.dem.kernels import tile as tl
from repose.dem.kernels.jit import JIT_OFF
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS, hertz_mindlin, linear_spring
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

SPHERE = np.full((1, 3), 0.006)
LINEAR = {"contact_law": "linear_spring"}


@pytest.mark.slow
def test_a_linear_spring_touches_for_half_a_period_and_overlaps_by_its_amplitude():
    e = 0.6
    speed = 0.3
    dt = 2e-6
    s = head_on(e, speed, dt, **LINEAR)
    young, _ = effective_moduli(GOJI, GOJI)
    mass = 0.5 * s.mass_kg
    radius = 0.003
    b = damping_ratio(e)
    natural = math.sqrt(
        4.0 / 3.0 * young * math.sqrt(linear_spring.SECANT) * radius / mass
    )
    damped = natural * math.sqrt(1.0 - b * b)
    deepest = 0.0
    steps = 0
    for _ in range(20000):
        s.run_steps(1)
        overlap = 0.012 - (s.positions[1, 0] - s.positions[0, 0])
        deepest = max(deepest, overlap)
        steps = steps + (overlap > 0.0)
        if steps and overlap <= 0.0:
            break
    assert steps * dt == pytest.approx(math.pi / damped, rel=2e-3)
    quarter = math.atan(math.sqrt(1.0 - b * b) / b) / damped
    expected = (
        2.0
        * speed
        / damped
        * math.exp(-b * natural * quarter)
        * math.sin(damped * quarter)
    )
    assert deepest == pytest.approx(expected, rel=2e-3)


def test_laws_are_chosen_by_name():
    for laws in (CONTACT_LAWS, ROLLING_LAWS):
        assert all(law.name == name for name, law in laws.items())
    value_error(
        "contact_law is 'hooke'; expected 'hertz_mindlin', 'hertz_",
        simulation,
        contact_law="hooke",
    )
    with pytest.raises(
        ValueError,
        match="rolling_law is None; expected 'budget', 'constant_torque', 'epsd', 'epsd2'",
    ):
        simulation(rolling_law=None)
    # a linear spring has a time step of its own
    assert (
        head_on(0.5, **LINEAR).longest_time_step()
        != simulation(SPHERE).longest_time_step()
    )


def test_a_linear_spring_is_as_stiff_as_hertz_at_its_secant_and_swings_half_a_period():
    radius = 3e-3
    mass = 1e-3
    law = linear_spring.LAW
    overlap = linear_spring.SECANT * radius
    hertz = (
        4.0 / 3.0 * effective_moduli(GOJI, GOJI)[0] * math.sqrt(radius) * overlap**1.5
    )
    tile, kept = tile_of(law, GOJI, Contact(0.5, 0.3, 0.0), radius, mass)
    normal_force(law, tile, kept, overlap, dt=1e-6)
    np.testing.assert_allclose(tile[tl.PUSH // LANES], hertz, rtol=1e-12)
    half_a_period = math.pi * math.sqrt(mass * overlap / hertz)
    lasts = linear_spring.contact_time(
        GOJI, GOJI, Contact(1.0, 0.0, 0.0), mass, radius, 1.0
    )
    assert lasts == pytest.approx(half_a_period)


@pytest.mark.parametrize("tension", ["keep", "release", "cut"])
@pytest.mark.parametrize("law", list(CONTACT_LAWS.values()), ids=list(CONTACT_LAWS))
def test_a_contact_beyond_the_edge_of_a_disc_has_no_force(law, tension):
    """The linear spring gave 0 times infinity there, and where a contact may pull, berries lost their places."""
    contact = Contact(
        0.5, 0.3, 0.0, constants={constant.name: 0.1 for constant in law.asks}
    )
    tile, kept = tile_of(law, GOJI, contact, 3e-3, tension=tension)
    tile[tl.GAP // LANES] = tl.BEYOND
    tile[tl.A // LANES + 5] = -0.1
    kept[2] = -1.0
    law.kernel(
        law.make_options(tension=tension),
        tile.ravel(),
        kept.ravel(),
        st.PAIR_STATE,
        1e-6,
    )
    np.testing.assert_array_equal(tile[tl.TO_A // LANES :][:3], 0.0)
    np.testing.assert_array_equal(tile[tl.PUSH // LANES], 0.0)


def test_effective_moduli_and_the_duration_of_an_impact_by_hand():
    """E = 2.6 and 4.8 MPa: 1/E* = 0.91/2.6 + 0.96/4.8, 1/G* = 1.7/1 + 1.8/2, both 1/MPa."""
    young, shear = effective_moduli(Material(1e6, 0.3), Material(2e6, 0.2))
    assert young == pytest.approx(1e6 / 0.55)
    assert shear == pytest.approx(1e6 / 2.6)
    # t = 2/v times the integral of 1 / sqrt(1 - (x/D)^(5/2)) up to the deepest overlap D; x = D sin(a)^(4/5)
    mass = 1e-3
    radius = 3e-3
    speed = 0.5
    stiffness = 4.0 / 3.0 * effective_moduli(GOJI, GOJI)[0] * math.sqrt(radius)
    deepest = (1.25 * mass * speed**2 / stiffness) ** 0.4
    angle = (np.arange(200000) + 0.5) * (0.5 * math.pi / 200000)
    duration = (
        2.0
        * deepest
        / speed
        * 0.8
        * np.sum(np.sin(angle) ** -0.2)
        * (angle[1] - angle[0])
    )
    lasts = hertz_mindlin.contact_time(
        GOJI, GOJI, Contact(1.0, 0.0, 0.0), mass, radius, speed
    )
    assert lasts == pytest.approx(duration, rel=1e-3)


OUTSIDE = """
from collections import namedtuple
import own_helper
from repose.dem.kernels import parallel
from repose.dem.laws.law import Law

def folder():
    return parallel.advance_shared.stats.cache_path

def kernel(law, t, c, at, dt):
    own_helper_function(t)

own_helper_function = own_helper.doubled

before = folder()
Law("own", namedtuple("Own", "tension"), None, 0, 0, 0, kernel, {})
print(before, folder())
"""


@pytest.mark.skipif(JIT_OFF, reason="there is no compiled code")
def test_a_law_from_outside_has_compiled_code_of_its_own(tmp_path):
    script = tmp_path / "own_law.py"
    helper = tmp_path / "own_helper.py"
    folders = []
    for edit, factor in (("", 2), ("\n# another kernel\n", 2), ("", 3)):
        script.write_text(OUTSIDE + edit)
        helper.write_text(f"def doubled(t):\n    return {factor} * t\n")
        run = subprocess.run(
            [sys.executable, script], capture_output=True, text=True, check=True
        )
        folders += [run.stdout.split()]
    assert len({before for before, _ in folders}) == 1
    assert len({after for _, after in folders}) == 3

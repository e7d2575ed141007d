"""Impacts of spinning spheres: tests 6 to 8 of Chung & Ooi (2011), Granular Matter 13, 643-656.

The gross sliding of a sphere is explained in `repose.verification.oblique`.
"""

from typing import Any

import numpy as np

from repose.dem import Contact

from .case import Curve, Effort, Panel, Result, Row, close
from .hertz import Solid, hertz_on_plane
from .machine import STEPS_PER_CONTACT, spheres, steps_of_impact
from .oblique import impact, sliding_impulse, sliding_rows

ALUMINIUM = Solid("aluminium", 70e9, 0.33, 2700.0)
NYLON = Solid("nylon", 2.5e9, 0.40, 1000.0)
SPINS = np.array([0.175, 0.5, 1.0, 1.75, 2.5, 3.5, 4.5, 6.0, 9.0, 13.0, 17.0, 21.0])
SLIDING = [7, 9, 11]  # indices of the spins that slide through the whole impact
SPIN_CONTACT, SPIN_RADIUS, SPIN_NORMAL = Contact(0.5, 0.4, 0.0), 0.1, 0.2


def _plane_spins(solid: Solid, spins: np.ndarray, **laws: Any) -> tuple[np.ndarray, np.ndarray]:
    """Tangential velocity and spin after test 6's impacts, each (len(spins),)."""
    impacts = [
        impact(solid, SPIN_RADIUS, SPIN_CONTACT, (0.0, 0.0, -SPIN_NORMAL), (0.0, float(w), 0.0), **laws)
        for w in spins
    ]
    return np.array([v[0] for v, _ in impacts]), np.array([w[1] for _, w in impacts])


def _pair_spins(
    solid: Solid,
    spins: np.ndarray,
    sense: float = 1.0,
    radius: float = SPIN_RADIUS,
    factor: float = 1.0,
    **laws: Any,
) -> tuple[np.ndarray, np.ndarray]:
    """The same for the upper of two spheres; the spin of the other is `sense` times its own.

    `radius` is of the other sphere, `factor` its stiffness and density over the first sphere's; with a factor
    above 1 it is at rest.
    """
    other = Solid(
        "other", factor * solid.elastic_modulus_pa, solid.poisson_ratio, factor * solid.density_kg_m3
    )
    step = 0.5 * hertz_on_plane(solid, SPIN_RADIUS, SPIN_NORMAL).duration_s / STEPS_PER_CONTACT
    gap = 1e-7
    moves = 0.0 if factor > 1.0 else SPIN_NORMAL
    tangential, turning = [], []
    for w in spins:
        simulation = spheres(
            (solid, other),
            (SPIN_RADIUS, radius),
            SPIN_CONTACT,
            ((0.0, 0.0, SPIN_RADIUS + gap), (0.0, 0.0, -radius - gap)),
            ((0.0, 0.0, -SPIN_NORMAL), (0.0, 0.0, moves)),
            ((0.0, w, 0.0), (0.0, sense * w if factor == 1.0 else 0.0, 0.0)),
            step,
            **laws,
        )
        tension = laws.get("tension", "keep")
        simulation.run_steps(2 * steps_of_impact(SPIN_CONTACT.restitution, tension))
        tangential.append(simulation.velocities[0, 0])
        turning.append(simulation.angular_velocities[0, 1])
    return np.array(tangential), np.array(turning)


def _spin_rows(solid: Solid, tangential: np.ndarray, turning: np.ndarray, tension: str) -> list[Row]:
    """Rows of the spins that slide through the whole impact."""
    hertz = hertz_on_plane(solid, SPIN_RADIUS, SPIN_NORMAL)
    rows = []
    for k in SLIDING:
        at = f"{solid.name}, {SPINS[k]:g} rad/s"
        found, before = (tangential[k], turning[k]), (0.0, SPINS[k])
        rows += sliding_rows(at, SPIN_CONTACT, hertz, SPIN_RADIUS, found, before, tension)
    return rows


def _spin_panels(velocities: tuple[Curve, ...], spins: tuple[Curve, ...]) -> list[Panel]:
    """Panels of velocity and spin after the impact, with gross sliding of rigid bodies as a line."""
    x = "spin before the impact (rad/s)"
    sliding = np.array([3.5 * 1.2, 21.0])
    rigid = sliding_impulse(SPIN_CONTACT, SPIN_NORMAL)
    velocities = (Curve("gross sliding, rigid", sliding, [rigid, rigid], reference=True), *velocities)
    lost = 2.5 * rigid / SPIN_RADIUS
    spins = (Curve("gross sliding, rigid", sliding, sliding - lost, reference=True), *spins)
    return [
        Panel(x, "tangential velocity after (m/s)", velocities),
        Panel(x, "spin after (rad/s)", spins),
    ]


def plane_spins(effort: Effort) -> Result:
    """Test 6: radius 0.1 m, 0.2 m/s, e 0.5, mu 0.4, spins 0.175 to 21 rad/s; aluminium and nylon.

    Chung, Y. C., & Ooi, J. Y. (2011). Granular Matter 13, 643-656, test 6.
    """
    rows, velocities, spins = [], [], []
    for solid in (ALUMINIUM, NYLON):
        v, w = _plane_spins(solid, SPINS, **effort.laws)
        rows += _spin_rows(solid, v, w, effort.tension)
        velocities.append(Curve(f"{solid.name}, repose", SPINS, v))
        spins.append(Curve(f"{solid.name}, repose", SPINS, w))
    return Result(
        "Chung & Ooi 6: normal impact of a spinning sphere on a rigid plane",
        "tangential velocity and spin in gross sliding",
        rows,
        _spin_panels(tuple(velocities), tuple(spins)),
    )


def equal_spheres(effort: Effort) -> Result:
    """Test 7: two equal spheres of test 6's materials, each 0.2 m/s, spins of the same and of opposite sense.

    With one sense of rotation, as vectors, the surfaces move against each other and the contact point stays: each
    sphere is one on a plane of its own. With opposite vectors the surfaces move together and nothing is exchanged.

    Chung, Y. C., & Ooi, J. Y. (2011). Granular Matter 13, 643-656, test 7.
    """
    rows, velocities, spins = [], [], []
    for solid in (ALUMINIUM, NYLON):
        v, w = _pair_spins(solid, SPINS, **effort.laws)
        rows += _spin_rows(solid, v, w, effort.tension)
        velocities.append(Curve(f"{solid.name}, repose", SPINS, v))
        spins.append(Curve(f"{solid.name}, repose", SPINS, w))
        v, w = _pair_spins(solid, SPINS[[3, -1]], sense=-1.0, **effort.laws)
        rows.append(
            close(
                f"{solid.name}: tangential velocity, opposite spin vectors",
                "m/s",
                abs(v).max(),
                0.0,
                scale=0.12,
            )
        )
        rows.append(close(f"{solid.name}: spin, opposite spin vectors", "rad/s", w[-1], SPINS[-1]))
    return Result(
        "Chung & Ooi 7: impact of two equal spinning spheres",
        "tangential velocity and spin in gross sliding; none exchanged when the surfaces move together",
        rows,
        _spin_panels(tuple(velocities), tuple(spins)),
    )


def unequal_spheres(effort: Effort) -> Result:
    """Test 8: spheres of radii 0.1 and 0.5 m, the second 1000 times stiffer and denser: test 6 again.

    Chung, Y. C., & Ooi, J. Y. (2011). Granular Matter 13, 643-656, test 8.
    """
    rows, velocities, spins = [], [], []
    for solid in (ALUMINIUM, NYLON):
        v, w = _pair_spins(solid, SPINS, radius=0.5, factor=1000.0, **effort.laws)
        plane_v, plane_w = _plane_spins(solid, SPINS, **effort.laws)
        source = "test 6, same simulator"
        for k in (1, 3, 5, 8, 11):
            at = f"{solid.name}, {SPINS[k]:g} rad/s"
            rows.append(close(f"{at}: tangential velocity", "m/s", v[k], plane_v[k], source))
            rows.append(
                close(f"{at}: spin", "rad/s", w[k], plane_w[k], source, scale=max(abs(plane_w[k]), SPINS[k]))
            )
        velocities += [Curve(f"{solid.name}, test 6", SPINS, plane_v, line=True), Curve(solid.name, SPINS, v)]
        spins += [Curve(f"{solid.name}, test 6", SPINS, plane_w, line=True), Curve(solid.name, SPINS, w)]
    return Result(
        "Chung & Ooi 8: impact of a spinning sphere on a large, stiff and heavy one",
        "tangential velocity and spin beside those of test 6",
        rows,
        _spin_panels(tuple(velocities), tuple(spins)),
    )

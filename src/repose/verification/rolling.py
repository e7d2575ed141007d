"""Sphere and berry on a plane under gravity: rest, sliding, rolling, slope, rocking."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import ellipe, ellipk

from repose.dem import Contact, Material, Plane, Shape, Simulation
from repose.dem.materials import effective_moduli

from .case import Curve, Effort, Panel, Result, close, reported
from .machine import BERRY, BERRY_DENSITY, BERRY_M, FLOOR, PVC, UP, berry_simulation

GRAVITY = 9.81
RADIUS = 0.006
STIFF = Material(4.3e7, 0.32)  # a thousand berries stiff: the overlap is 1e-5 of the radius
ELLIPTIC_NOTE = "the engine takes R* = sqrt(R1 R2) in the law of spheres; Hertz's own solution is elliptic"


def resting_overlap(mass: float, radius: float, material: Material) -> float:
    """Overlap that carries the weight: (m g / (4/3 E* sqrt(R*)))^(2/3) [m]."""
    young, _ = effective_moduli(material, PVC)
    return (mass * GRAVITY / (4.0 / 3.0 * young * math.sqrt(radius))) ** (2.0 / 3.0)


def sphere_on_floor(contact: Contact, speed_m_s: float, spin_rad_s: float) -> Simulation:
    """A stiff sphere at its resting overlap, moving along x and spinning about y."""
    shape = Shape.sphere(RADIUS, BERRY_DENSITY, "sphere")
    simulation = Simulation(
        {"sphere": shape},
        {"sphere": STIFF, "wall": PVC},
        {("sphere", "sphere"): contact, ("sphere", "wall"): contact},
        1e-5,
        capacity=1,
        lower=(-1.0, -0.1, -0.1),
        upper=(1.0, 0.1, 0.1),
        walls={"floor": Plane(FLOOR, UP, "wall")},
        gravity_m_s2=(0.0, 0.0, -GRAVITY),
    )
    height = RADIUS - resting_overlap(shape.mass_kg, RADIUS, STIFF)
    simulation.add(
        "sphere",
        (0.0, 0.0, height),
        velocity_m_s=(speed_m_s, 0.0, 0.0),
        angular_velocity_rad_s=(0.0, spin_rad_s, 0.0),
    )
    return simulation


def _track(simulation: Simulation, steps: int, every: int) -> np.ndarray:
    """Time, speed and R times spin of the first body, once every `every` steps."""
    found = []
    for _ in range(steps // every):
        simulation.run_steps(every)
        found.append(
            (simulation.time_s, simulation.velocities[0, 0], RADIUS * simulation.angular_velocities[0, 1])
        )
    return np.array(found).T


def slip_to_roll(_effort: Effort) -> Result:
    """A sphere that begins sliding ends rolling with 5/7 of its speed, and a rolling one is slowed by 5/7 mu_r g."""
    start, friction = 0.5, 0.4
    time, speed, rim = _track(sphere_on_floor(Contact(0.3, friction, 0.0), start, 0.0), 6000, 150)
    until = 2.0 * start / (7.0 * friction * GRAVITY)
    line = np.array([0.0, until, time[-1]])
    rows = [
        close("speed after slipping", "m/s", speed[-1], 5.0 / 7.0 * start),
        close("R spin after slipping", "m/s", rim[-1], 5.0 / 7.0 * start),
        close(
            "deceleration while slipping",
            "m/s2",
            (speed[0] - speed[12]) / (time[12] - time[0]),
            friction * GRAVITY,
        ),
    ]
    rolling = 0.05
    simulation = sphere_on_floor(Contact(0.3, 0.8, rolling), 0.3, 0.3 / RADIUS)
    t, v, _ = _track(simulation, 20000, 500)
    slope = 5.0 / 7.0 * rolling * GRAVITY
    rows.append(close("deceleration by the rolling torque", "m/s2", (v[0] - v[-1]) / (t[-1] - t[0]), slope))
    panels = [
        Panel(
            "time (s)",
            "speed (m/s)",
            (
                Curve("closed form", line, [start, 5 / 7 * start, 5 / 7 * start], reference=True),
                Curve("closed form, R spin", line, [0.0, 5 / 7 * start, 5 / 7 * start], reference=True),
                Curve("speed", time, speed),
                Curve("R spin", time, rim),
            ),
        ),
        Panel(
            "time (s)",
            "speed of the rolling sphere (m/s)",
            (Curve("0.3 m/s - 5/7 mu_r g t", t, 0.3 - slope * t, reference=True), Curve("repose", t, v)),
        ),
    ]
    return Result(
        "Slipping to rolling, and rolling resistance",
        "a sphere of radius 6 mm on a plane: u = 5/7 u0; mu g; 5/7 mu_r g",
        rows,
        panels,
    )


def slope_acceleration(angle_deg: float, friction: float) -> float:
    """Acceleration of a berry that cannot roll, lying on a slope [m/s2], between 0.06 s and 0.16 s."""
    slope = math.radians(angle_deg)
    down = (GRAVITY * math.sin(slope), 0.0, -GRAVITY * math.cos(slope))
    simulation = berry_simulation(
        Contact(0.3, friction, 5.0),
        2e-5,
        walls={"floor": Plane(FLOOR, UP, "wall")},
        material=STIFF,
        gravity_m_s2=down,
        upper=(0.5, 0.1, 0.1),
    )
    simulation.add("berry", (0.0, 0.0, BERRY_M[2]))
    simulation.run_steps(3000)
    before = simulation.velocities[0, 0]
    simulation.run_steps(5000)
    return (simulation.velocities[0, 0] - before) / 0.1


def coulomb_slope(_effort: Effort) -> Result:
    """A berry on a slope sticks below the angle of friction and slides above it."""
    friction = 0.5
    limit = math.degrees(math.atan(friction))
    angles = np.array([10.0, 20.0, limit - 0.5, limit + 0.5, 30.0, 35.0, 45.0])
    found = np.array([slope_acceleration(angle, friction) for angle in angles])
    fine = np.linspace(5.0, 50.0, 200)

    def exact(angle: float | np.ndarray) -> np.ndarray:
        a = np.radians(angle)
        return np.maximum(GRAVITY * (np.sin(a) - friction * np.cos(a)), 0.0)

    rows = [
        close(
            f"acceleration at {angle:.2f} deg",
            "m/s2",
            a,
            float(exact(angle)),
            scale=max(float(exact(angle)), 0.1),
        )
        for angle, a in zip(angles, found, strict=True)
    ]
    panel = Panel(
        "slope (deg)",
        "acceleration (m/s2)",
        (Curve("g (sin - mu cos), or 0", fine, exact(fine), reference=True), Curve("repose", angles, found)),
    )
    return Result(
        "Coulomb's slope", "acceleration of a berry, mu 0.5, that is kept from rolling", rows, [panel]
    )


def elliptic_overlap(mass: float, radii: Sequence[float], young: float) -> float:
    """Hertz's overlap of an elliptic contact under the weight [m] (Johnson 1985, Eq. 4.26-4.28).

    radii: the two relative radii of curvature, the larger first. The eccentricity solves
    (R1 / R2) = (E(e) / (1 - e^2) - K(e)) / (K(e) - E(e)) with complete elliptic integrals of e^2.
    """
    low, high = 1e-9, 1.0 - 1e-9
    for _ in range(200):
        m = 0.5 * (low + high)
        ratio = (ellipe(m) / (1.0 - m) - ellipk(m)) / (ellipk(m) - ellipe(m))
        low, high = (m, high) if ratio < radii[0] / radii[1] else (low, m)
    shape = (ellipe(m) / (1.0 - m) - ellipk(m)) * (ellipk(m) - ellipe(m))
    axis_ratio = (1.0 - m) ** -0.5  # a / b
    radius_e = math.sqrt(radii[0] * radii[1])
    # c^3 = (a b)^1.5 = 3 P R_e / (4 E*) * 4 / (pi e^2) (b / a)^1.5 sqrt(shape)
    c3 = 0.75 * mass * GRAVITY * radius_e / young * 4.0 / (math.pi * m) * axis_ratio**-1.5 * math.sqrt(shape)
    a, b = c3 ** (1.0 / 3.0) * math.sqrt(axis_ratio), c3 ** (1.0 / 3.0) / math.sqrt(axis_ratio)
    return 1.5 * mass * GRAVITY / (math.pi * a * b * young) * b * ellipk(m)


def berry_at_rest(_effort: Effort) -> Result:
    """A berry lies on a plate, each of its axes vertical in turn, at the overlap of its curvature."""
    quarter = math.sqrt(0.5)
    turns = {
        "shortest": (1, 0, 0, 0),
        "middle": (quarter, quarter, 0, 0),
        "longest": (quarter, 0, quarter, 0),
    }
    young, _ = effective_moduli(BERRY, PVC)
    rows, radii_drawn, found_drawn = [], [], []
    for (name, turn), up in zip(turns.items(), (2, 1, 0), strict=True):
        height = BERRY_M[up]
        radii = sorted((axis**2 / height for k, axis in enumerate(BERRY_M) if k != up), reverse=True)
        simulation = berry_simulation(
            Contact(0.3, 0.5, 0.1),
            1e-4,
            walls={"floor": Plane(FLOOR, UP, "wall")},
            gravity_m_s2=(0.0, 0.0, -GRAVITY),
        )
        mass = simulation.shapes["berry"].mass_kg
        expected = resting_overlap(mass, math.sqrt(radii[0] * radii[1]), BERRY)
        simulation.add("berry", (0.0, 0.0, height), turn)
        simulation.run_steps(6000)
        found = height - simulation.positions[0, 2]
        rows.append(close(f"{name} axis up: overlap", "um", 1e6 * found, 1e6 * expected))
        note = f"{ELLIPTIC_NOTE}; R1 / R2 = {radii[0] / radii[1]:.2f}"
        rows.append(
            reported(
                f"{name} axis up: overlap", "um", 1e6 * found, note, 1e6 * elliptic_overlap(mass, radii, young),
                "closed form, elliptic Hertz contact",
            )
        )  # fmt: skip
        radii_drawn.append(1e3 * math.sqrt(radii[0] * radii[1]))
        found_drawn.append(1e6 * found)
    fine = np.linspace(0.8 * min(radii_drawn), 1.1 * max(radii_drawn), 100)
    exact = [1e6 * resting_overlap(mass, 1e-3 * r, BERRY) for r in fine]
    panel = Panel(
        "sqrt(R1 R2) of the contact (mm)",
        "overlap at rest (um)",
        (Curve("Hertz", fine, exact, reference=True), Curve("repose", radii_drawn, found_drawn)),
    )
    return Result("A berry at rest on a plate", "overlap under its own weight", rows, [panel])


def rocking_period(a: float, c: float) -> float:
    """Period of a berry that rocks without slipping in the plane of the semi-axes a (level) and c (upright) [s].

    Its potential energy is m g h(theta), h the support function; the moment of inertia about the contact is
    I + m c^2, I = m (a^2 + c^2) / 5, and the stiffness m g h'' = m g (a^2 / c - c).
    """
    return 2.0 * math.pi * math.sqrt(((a * a + c * c) / 5.0 + c * c) / (GRAVITY * (a * a / c - c)))


def rocking(_effort: Effort) -> Result:
    """A berry tilted by a degree from its flat rest rocks with the period of theory, about either level axis."""
    rows, curves = [], []
    for name, level, about in (("about the middle axis", 0, 1), ("about the long axis", 1, 0)):
        period = rocking_period(BERRY_M[level], BERRY_M[2])
        time, tilt = _rocking_history(level, about, 3.0 * period)
        rows.append(close(f"period {name}", "s", period_of(time, tilt), period))
        cut = time < 2.0 * period
        fine = np.linspace(0.0, 2.0, 300)
        curves.append(Curve(f"theory, {name}", fine * period, np.cos(2.0 * math.pi * fine), reference=True))
        curves.append(Curve(f"repose, {name}", time[cut][::25], tilt[cut][::25]))
    panel = Panel("time (s)", "tilt (deg)", tuple(curves))
    return Result(
        "A berry rocks on a plane",
        "period of small oscillations; a berry a thousand times stiffer, so that it hardly sinks in",
        rows,
        [panel],
    )


def _rocking_history(level: int, about: int, duration_s: float) -> np.ndarray:
    """Time and tilt [deg] about a body axis of a berry released at one degree."""
    step, start = 2e-5, math.radians(1.0)
    simulation = berry_simulation(
        Contact(0.3, 10.0, 0.0),
        step,
        walls={"floor": Plane(FLOOR, UP, "wall")},
        material=STIFF,
        gravity_m_s2=(0.0, 0.0, -GRAVITY),
    )
    mass = simulation.shapes["berry"].mass_kg
    height = math.hypot(BERRY_M[2] * math.cos(start), BERRY_M[level] * math.sin(start))
    turn = np.zeros(4)
    turn[0], turn[1 + about] = math.cos(0.5 * start), math.sin(0.5 * start)
    radius = BERRY_M[0] * BERRY_M[1] / BERRY_M[2]
    simulation.add("berry", (0.0, 0.0, height - resting_overlap(mass, radius, STIFF)), turn)
    every = 20
    found = []
    for _ in range(int(duration_s / step / every)):
        simulation.run_steps(every)
        q = simulation.quaternions[0]
        found.append((simulation.time_s, math.degrees(2.0 * math.asin(q[1 + about]))))
    return np.array(found).T


def period_of(time: np.ndarray, wave: np.ndarray) -> float:
    """Mean period from the zero crossings of a wave."""
    k = np.flatnonzero(wave[:-1] * wave[1:] < 0.0)
    zeros = time[k] - wave[k] * (time[k + 1] - time[k]) / (wave[k + 1] - wave[k])
    return 2.0 * (zeros[-1] - zeros[0]) / (len(zeros) - 1)

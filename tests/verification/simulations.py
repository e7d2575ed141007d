"""Simulations that several cases share: impacts of spheres, and grains."""

import math

import numpy as np
from verification.hertz import hertz_on_plane, rigid

from repose.dem import Contact, Material, Plane, Shape, Simulation, time_steps
from repose.dem.laws.hertz_mindlin import damping_ratio
from repose.dem.materials import effective_moduli

STEPS_PER_CONTACT = 1500  # time steps in the contact time of Hertz
STILL = (0.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)
ON_FLOOR = {"floor": Plane(STILL, UP, "wall")}
GRAVITY = 9.81
# Semi-axes [m], density [kg/m3] and material of a published fruit (Ji et al. 2026): a
# long, soft body.
GRAIN_M = (0.01057, 0.005685, 0.00494)
GRAIN_DENSITY = 840.47
GRAIN = Material(4.3e4, 0.32)
PVC = Material(1.12e9, 0.4)
STIFF = Material(4.3e7, 0.32)  # a thousand times a grain: overlaps of 1e-5 of a radius


def smooth(radius_m, density_kg_m3, material):
    """Make a sphere as the sum of two of half its radius.

    The engine treats it as a smooth body, not as a sphere.
    """
    sphere = Shape.sphere(radius_m, density_kg_m3, material)
    halves = np.full((2, 3), 0.5 * radius_m)
    return Shape(halves, sphere.mass_kg, sphere.inertia_kg_m2, material)


def simulation_of(shape, contact, step_s, material=GRAIN, wall=PVC, **keywords):
    """Make an empty simulation of bodies of one shape, "body".

    Without walls and gravity, and for one body.

    The materials are named "grain" and "wall"; the box reaches 0.1 m to each side.
    `keywords` replace that.
    """
    world = {
        "capacity": 1,
        "gravity_m_s2": STILL,
        "lower": (-0.1, -0.1, -0.1),
        "upper": (0.1, 0.1, 0.1),
    }
    materials = {"grain": material, "wall": wall}
    contacts = {("grain", "grain"): contact, ("grain", "wall"): contact}
    return Simulation(
        {"body": shape}, materials, contacts, step_s, **(world | keywords)
    )


def grain_simulation(contact, step_s, axes=GRAIN_M, **keywords):
    """Make `simulation_of` grains, ellipsoids with these semi-axes [m]."""
    shape = Shape.ellipsoid(axes, GRAIN_DENSITY, "grain")
    return simulation_of(shape, contact, step_s, **keywords)


def under_gravity(walls=ON_FLOOR):
    """Give keywords of `simulation_of` for gravity, by default on a floor."""
    return {"walls": walls, "gravity_m_s2": (0.0, 0.0, -GRAVITY)}


def resting_overlap(mass, radius, material):
    """Compute the overlap [m] that carries a sphere on a plate of PVC.

    It is (m g / (4/3 E* sqrt(R*)))^(2/3).
    """
    young, _ = effective_moduli(material, PVC)
    return (mass * GRAVITY / (4.0 / 3.0 * young * math.sqrt(radius))) ** (2.0 / 3.0)


def box(west, east, south, north):
    """Make a floor and four walls at these x and y [m]."""
    return ON_FLOOR | {
        "west": Plane((west, 0.0, 0.0), (1.0, 0.0, 0.0), "wall"),
        "east": Plane((east, 0.0, 0.0), (-1.0, 0.0, 0.0), "wall"),
        "south": Plane((0.0, south, 0.0), (0.0, 1.0, 0.0), "wall"),
        "north": Plane((0.0, north, 0.0), (0.0, -1.0, 0.0), "wall"),
    }


def sphere_over_plane(
    solid,
    radius_m,
    contact,
    velocity_m_s,
    spin_rad_s=STILL,
    steps_per_contact=STEPS_PER_CONTACT,
    **laws,
):
    """Put a sphere just above a rigid plane, without gravity.

    Return also the steps until it has surely left.
    """
    hertz = hertz_on_plane(solid, radius_m, abs(velocity_m_s[2]))
    step = hertz.duration_s / steps_per_contact
    reach = 4.0 * radius_m
    simulation = simulation_of(
        smooth(radius_m, solid.density_kg_m3, "grain"),
        contact,
        step,
        material=solid.material,
        wall=rigid(solid.material),
        walls=ON_FLOOR,
        lower=3 * (-reach,),
        upper=3 * (reach,),
        **laws,
    )
    height = radius_m + 3.5 * step * hertz.speed
    simulation.add(
        "body",
        (0.0, 0.0, height),
        velocity_m_s=velocity_m_s,
        angular_velocity_rad_s=spin_rad_s,
    )
    tension = laws.get("tension", "keep")
    steps = steps_of_impact(contact.restitution, tension, steps_per_contact)
    return simulation, steps


def impact(solid, radius_m, contact, velocity_m_s, spin_rad_s=STILL, **keywords):
    """Simulate an impact of a sphere on a rigid plane.

    Returns its velocity [m/s] and spin [rad/s] afterwards, each (3,).
    """
    simulation, steps = sphere_over_plane(
        solid, radius_m, contact, velocity_m_s, spin_rad_s, **keywords
    )
    simulation.run_steps(steps)
    return simulation.velocities[0].copy(), simulation.angular_velocities[0].copy()


def steps_of_impact(restitution, tension="keep", steps_per_contact=STEPS_PER_CONTACT):
    """Count the time steps of an impact.

    A damped contact lasts longer than Hertz's time.
    """
    beta = damping_ratio(restitution, tension)
    return int(steps_per_contact * (1.3 + 1.5 * beta))


def two_spheres(a, b, contact, step_s, **laws):
    """Make an empty simulation of two spheres, "a" and "b", each (solid, radius [m]).

    In space, without gravity.
    """
    reach = 4.0 * max(a[1], b[1])
    shapes = {}
    materials = {}
    for name, (solid, radius_m) in {"a": a, "b": b}.items():
        shapes[name] = smooth(radius_m, solid.density_kg_m3, name)
        materials[name] = solid.material
    return Simulation(
        shapes,
        materials,
        dict.fromkeys((("a", "a"), ("a", "b"), ("b", "b")), contact),
        step_s,
        capacity=2,
        gravity_m_s2=STILL,
        lower=3 * (-reach,),
        upper=3 * (reach,),
        **laws,
    )


def stiffened_simulation(
    shape, contact, stiffening, speed_m_s, steps_per_contact, **keywords
):
    """Make `simulation_of` bodies of stiffened material, with its time step [s].

    The shear moduli of grain and wall are multiplied by `stiffening`. The step is the
    contact time of the shortest impact at this speed over `steps_per_contact`.
    """
    grain = Material(stiffening * GRAIN.shear_modulus_pa, GRAIN.poisson_ratio)
    wall = Material(stiffening * PVC.shear_modulus_pa, PVC.poisson_ratio)

    def make(step_s):
        return simulation_of(
            shape, contact, step_s, material=grain, wall=wall, **keywords
        )

    limit = time_steps.compute_impact_limit(
        make(1e-15).scene, shape, shape, speed_m_s
    ).time_step_s
    step = limit * time_steps.STEPS_PER_CONTACT / steps_per_contact
    return make(step), step


def track(simulation, count, steps, look):
    """Run `steps` steps `count` times; collect what `look` returns after each."""
    rows = []
    for _ in range(count):
        simulation.run_steps(steps)
        rows.append(look())
    return np.array(rows)


def random_direction(rng):
    """Draw a uniformly random unit vector."""
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def frictionless(restitution=1.0):
    """Make a contact without any friction."""
    return Contact(restitution, 0.0, 0.0)

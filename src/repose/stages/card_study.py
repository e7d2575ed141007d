"""What a card alone gives for a deck: the sections of a configuration, the grain, the particle."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from repose.bench.funnel import FunnelSettings
from repose.bench.settings import SimulationSettings
from repose.common.errors import InputError, raise_together, require
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
from repose.stages.card import laws
from repose.stages.card_model import faults_of

if TYPE_CHECKING:
    from repose.grain.particle import Particle

GRAVITY_M_S2, REST_ENERGY_J = (
    9.81,
    1.0e-9,
)  # a card of an earlier version has no gravity; a deck looks for no rest
ALLOWED = "the card of a study with piles of the funnel"


def configuration_of(card: Mapping[str, Any], source: object) -> dict[str, Any]:
    """Return the sections that a deck reads; the time step is the longest of the engine where the card has none."""
    bench = next(
        (test["bench"] for test in card["tests"] if test["apparatus"] == "funnel"), None
    )
    if bench is None:
        raise InputError(
            source, "tests", [test["apparatus"] for test in card["tests"]], ALLOWED
        )
    simulation = {
        "gravity_m_s2": GRAVITY_M_S2,
        "time_step_s": 1.0e-2,
        **card.get("simulation", {}),
    }
    simulation |= {"rest_energy_j": REST_ENERGY_J, **_laws_of(card, source)}
    sizes = "measured" if card["grain"]["relative_spread"] else "none"
    config = {
        "label": card["material"],
        "berry": {"size_distribution": sizes},
        "wall": dict(card["wall"]),
    }
    funnel = bench | {"seeds": 1}
    try:
        FunnelSettings.model_validate(funnel)
    except ValidationError as error:
        raise_together(
            InputError(source, f"tests.bench.{key}", value, words)
            for key, value, words in faults_of(error)
        )
    return config | {"simulation": simulation, "funnel": funnel}


def _laws_of(card: Mapping[str, Any], source: object) -> dict[str, str]:
    """Find the laws by the sentences that a card has of them."""
    for contact, tension, rolling in product(
        CONTACT_LAWS, ("release", "keep"), ROLLING_LAWS
    ):
        chosen = {"contact_law": contact, "tension": tension, "rolling_law": rolling}
        if laws(SimulationSettings.model_construct(None, **chosen)) == card["laws"]:
            return chosen
    raise InputError(
        source,
        "laws",
        card["laws"]["normal"],
        "laws of this version; give --config, the study's own",
    )


def particle_of(
    card: Mapping[str, Any], spheres: int | None, source: object
) -> "Particle":
    """Make the particle of a card; a smooth one is filled with `spheres`, by default it stays as it is."""
    import trimesh  # slow to import

    from repose.dem.tessellation import tessellate
    from repose.grain import build
    from repose.grain.mesh import principal_pose
    from repose.grain.particle import Particle

    grain = card["grain"]
    sizes, balls = (
        1e-3 * np.array(grain[key], float) for key in ("ellipsoids_mm", "spheres_mm")
    )
    allowed = "the moments of the clump, which cards of earlier versions lack; give --config, the study's own"
    require(
        len(balls) <= 1 or "inertia_kg_m2" in grain,
        source,
        "grain.inertia_kg_m2",
        None,
        allowed,
    )
    reach = (
        np.linalg.norm(balls[:, :3], axis=1) + balls[:, 3]
        if len(balls)
        else sizes.sum(axis=0)
    )
    mass_kg, volume_m3 = 1e-3 * grain["mass_g"], 1e-9 * grain["volume_mm3"]
    particle = Particle(
        kind=grain["shape"],
        semi_axes_m=sizes.reshape(-1, 3),
        density_kg_m3=grain["density_kg_m3"],
        volume_m3=volume_m3,
        mass_kg=mass_kg,
        inertia_kg_m2=np.array(
            grain.get("inertia_kg_m2", np.full(3, 0.4 * mass_kg * reach.max() ** 2))
        ),
        bounding_radius_m=float(reach.max()),
        deviation_max_m=0.0,
        deviation_rms_m=0.0,
        spheres_m=balls.reshape(-1, 4),
    )
    if spheres is None or spheres == 1 or particle.is_clump:
        return particle
    points, _, triangles = tessellate(particle, 48, 96)
    mesh = trimesh.Trimesh(1e3 * points, triangles)
    filled = build.make_particle(
        principal_pose(mesh), particle.density_kg_m3, "multisphere", spheres
    )
    # the mesh is a little smaller than the body
    return replace(
        filled,
        mass_kg=mass_kg,
        inertia_kg_m2=mass_kg / filled.mass_kg * filled.inertia_kg_m2,
    )

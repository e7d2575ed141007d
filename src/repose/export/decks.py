"""Write a deck from a template in this folder, with numbers of at most nine digits.

The templates are written in Jinja, in which a value stands in double braces. For
example, ``{{ x | digits(6) }}`` writes x with six digits.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from repose.dem.laws import ROLLING_LAWS
from repose.export.job import Job
from repose.export.laws import describe_law_constants


def format_number(number: float, count: int = 9) -> str:
    """Write a number with at most `count` significant digits."""
    return f"{number:.{count}g}"


def _format_float(value: object) -> object:
    """Write a float with nine digits; return any other value unchanged."""
    return format_number(value) if isinstance(value, float) else value


# A deck is not HTML, so special characters need not be escaped.
_ENVIRONMENT = Environment(  # nosec B701
    loader=FileSystemLoader(Path(__file__).parent),
    trim_blocks=True,
    keep_trailing_newline=True,
    undefined=StrictUndefined,
    finalize=_format_float,
)
_ENVIRONMENT.filters["digits"] = format_number


def fill_template(name: str, job: Job, **values: object) -> str:
    """Fill a template in this folder with the numbers of a job.

    Parameters
    ----------
    name : str
        File name of the template.
    job : Job
        The grain and its pour, whose numbers every template can use.
    **values : object
        Values that only this template needs, by their names in the template.

    Returns
    -------
    str
        The contents of the file.
    """
    return _ENVIRONMENT.get_template(name).render(collect_common_values(job) | values)


def collect_common_values(job: Job) -> dict[str, Any]:
    """Collect the values that all templates share, by their names in the templates.

    Lengths are in m, and durations are numbers of time steps.
    """
    particle = job.particle
    grain_radius_m = particle.bounding_radius_m
    # Grains are created in the factory, and fall from there onto the plate.
    factory_height_m = job.factory_height_m
    scene_radius_m = max(job.plate_radius_m, 0.5 * job.surfaces.inlet_diameter_m)
    n_steps = job.count_steps(job.funnel.duration_s)
    ixx, iyy, izz = particle.inertia_kg_m2.tolist()
    return {
        "job": job,
        # Conditions on which lines of a template depend.
        "sphere": job.is_sphere,
        "clump": not job.is_sphere,
        "tube": job.surfaces.tube_length_m > 0.0,
        # The grain.
        "radius": float(particle.spheres_m[0, 3]),
        "reach": grain_radius_m,
        "ixx": ixx,
        "iyy": iyy,
        "izz": izz,
        # The box.
        "half": scene_radius_m + 4.0 * grain_radius_m,
        "top": factory_height_m + 4.0 * grain_radius_m,
        # Neighbour lists also include spheres up to this distance apart, so that they
        # stay valid for several time steps.
        "skin": 0.75 * job.mean_radius_m,
        # The factory.
        "factory_radius": job.factory_radius_m,
        "factory_height": factory_height_m,
        "factory_low": factory_height_m - 1e-4,
        "factory_high": factory_height_m + 1e-4,
        # The pour.
        "every": job.count_steps(1.0 / job.funnel.rate_per_s),
        "steps": n_steps,
        "thermo": max(1, n_steps // 20),
    }


def join_numbers(values: Iterable[float], separator: str = " ") -> str:
    """Write numbers with nine digits, one after the other."""
    return separator.join(map(format_number, values))


# --- the head of a deck ---------------------------------------------------------------


def write_head(
    job: Job, program_differences: Sequence[str], comment: str = "# "
) -> str:
    """Write the comment lines at the head of a deck.

    These lines name the study, and state its parameters and all differences between the
    deck and the study.

    Parameters
    ----------
    job : Job
        The grain and its pour.
    program_differences : sequence of str
        The differences between this program and the study. The function adds the
        differences that all programs have.
    comment : str
        The beginning of a comment line in the language of the program.

    Returns
    -------
    str
        The lines, without a line break at the end.
    """
    grains = job.grains
    on_wall = job.on_wall
    percent = 100 * job.time_step_s / job.rayleigh_s
    lines = [
        f"Pour of {job.funnel.berries} grains of the study `{job.label}`, written by "
        "`repose export`. SI units.",
        f"Calibrated: e {grains.restitution:.6g}, mu_s {grains.static_friction:.6g}, "
        f"mu_r {grains.rolling_friction:.6g} between",
        f"grains; e {on_wall.restitution:.6g}, mu_s {on_wall.static_friction:.6g}, "
        f"mu_r {on_wall.rolling_friction:.6g} between grain and wall.",
        *describe_law_constants(job),
        f"Time step {job.time_step_s:g} s: {percent:.1f} % of the Rayleigh time of the "
        "smallest sphere.",
        "Not as in the study:",
    ]
    differences = (*_list_common_differences(job), *program_differences, *job.notes)
    lines += [f"- {difference}" for difference in differences]
    return "\n".join(comment + line for line in lines)


def _list_common_differences(job: Job) -> list[str]:
    """List the differences from the study that the decks of all programs have."""
    differences = [_describe_rolling_difference(job)]
    if not job.is_sphere:
        differences.append(
            "each pair of spheres is damped with the bodies' masses; in the study the "
            "spheres of one pair of bodies share the damping, and the mass counts the "
            "rotation"
        )
    differences.append(
        "no dashpot along the tangent; in the study Coulomb's limit includes it. In "
        "LIGGGHTS and YADE its force is added to that limit, in LAMMPS it winds up the "
        "spring: the friction of a grazing impact was 1.7 times that of the study, or a "
        "sixth of it"
    )
    if job.simulation.tension == "keep":
        differences.append(
            "Coulomb's limit uses the damped normal force, in the study only its elastic "
            "part"
        )
    return differences


def _describe_rolling_difference(job: Job) -> str:
    """Describe how the rolling resistance in a deck differs from that in the study.

    If the law of the study acts on each body, no program has an equivalent, so the deck
    uses another law. The programs do have the other laws, but let them act between two
    spheres instead of two grains.

    Parameters
    ----------
    job : Job
        The grain and its pour.

    Returns
    -------
    str
        A description without a full stop.
    """
    law = job.simulation.rolling_law
    lever_mm = 1e3 * job.lever_m
    if ROLLING_LAWS.entry(law).of_each_body:
        difference = (
            "rolling resistance is a spring with a limit against the relative rotation "
            "(model C of Ai et al. 2011, with or without damping); in the study each body "
            "has a budget (model A). The coefficients here are those of the study times "
            f"the mean lever {lever_mm:.3g} mm over the effective radius of two spheres"
        )
        if job.is_sphere:
            difference += (
                "; with mu_r 0.1 piles of spheres were 5 to 7 degrees lower for this "
                "reason"
            )
        return difference

    # The program has a law of the same name, but it acts between single spheres.
    resistance = "its own stiffness and damping"
    if law == "constant_torque":
        resistance = "a constant torque"
    return (
        f"rolling resistance is between two spheres, with {resistance}; in the study "
        f"{law} between two bodies, which also resists spin about the normal. The "
        f"coefficients here are those of the study times the mean lever {lever_mm:.3g} mm "
        "over the radius of a sphere"
    )

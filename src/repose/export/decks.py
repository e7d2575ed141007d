"""Write an input file of another program from a template in this folder.

Numbers have at most nine digits. All input files of a program are called its deck.

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


# Distance between the surfaces of two spheres up to which neighbour lists include them,
# over the mean radius of the spheres. The lists then stay valid for several time steps.
SKIN_FRACTION = 0.75
# Distance of the sides and the top of the box from the outermost positions of the
# centres of grains, over the radius of a grain.
MARGIN_FACTOR = 4.0
# Half of the height of the flat region in which grains are created [m].
HALF_FACTORY_DEPTH_M = 1e-4
# Number of times that a program prints its state during a run.
N_REPORTS = 20

# An input script is not HTML, so special characters need not be escaped.
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

    The templates are the files *.jinja in this folder. A key that is renamed here must
    be renamed in all of them.

    Returns
    -------
    dict
        Lengths are in m, moments of inertia in kg m2, and durations are numbers of time
        steps. The three conditions are bools, and `job` is the job itself.
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
        # The grain. `radius` is that of its first sphere, which templates only use if
        # the grain is a single sphere. `reach` is the radius of a sphere around the
        # whole grain.
        "radius": float(particle.spheres_m[0, 3]),
        "reach": grain_radius_m,
        "ixx": ixx,
        "iyy": iyy,
        "izz": izz,
        # Half the width of the box that contains everything, and its upper end.
        "half": scene_radius_m + MARGIN_FACTOR * grain_radius_m,
        "top": factory_height_m + MARGIN_FACTOR * grain_radius_m,
        "skin": SKIN_FRACTION * job.mean_radius_m,
        # The factory, a flat cylinder in which grains are created.
        "factory_radius": job.factory_radius_m,
        "factory_height": factory_height_m,
        "factory_low": factory_height_m - HALF_FACTORY_DEPTH_M,
        "factory_high": factory_height_m + HALF_FACTORY_DEPTH_M,
        # Time steps between two grains, time steps of the whole run, and time steps
        # between two printed lines about its state.
        "every": job.count_steps(1.0 / job.funnel.rate_per_s),
        "steps": n_steps,
        "thermo": max(1, n_steps // N_REPORTS),
    }


def join_numbers(values: Iterable[float], separator: str = " ") -> str:
    """Write numbers with nine digits, one after the other."""
    return separator.join(map(format_number, values))


# --- the head of an input script ------------------------------------------------------


def format_head(
    job: Job, program_differences: Sequence[str], comment: str = "# "
) -> str:
    """Format the comment lines at the head of an input script.

    These lines name the study, and state its parameters and all differences between the
    script and the study.

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
    # The contacts between two grains, and between grain and wall.
    grains = job.grains
    on_wall = job.on_wall
    percent = 100 * job.time_step_s / job.rayleigh_s
    lines = [
        f"Pour of {job.funnel.berries} grains of the study `{job.label}`, written by "
        "`repose export`. SI units.",
        # This sentence is broken into two lines.
        f"Calibrated: e {grains.restitution:.6g}, mu_s {grains.static_friction:.6g}, "
        f"mu_r {grains.rolling_friction:.6g} between",
        f"grains; e {on_wall.restitution:.6g}, mu_s {on_wall.static_friction:.6g}, "
        f"mu_r {on_wall.rolling_friction:.6g} between grain and wall.",
        *describe_law_constants(job),
        f"Time step {job.time_step_s:g} s: {percent:.1f} % of the Rayleigh time of the "
        "smallest sphere.",
        "Differences from the study:",
    ]
    differences = (*_list_common_differences(job), *program_differences, *job.notes)
    lines += [f"- {difference}" for difference in differences]
    return "\n".join(comment + line for line in lines)


def _list_common_differences(job: Job) -> list[str]:
    """List the differences from the study that all other programs have.

    Each is a description without a full stop.
    """
    differences = [_describe_rolling_difference(job)]
    if not job.is_sphere:
        differences.append(
            "each pair of spheres is damped with the masses of its two grains; in the "
            "study all pairs of spheres of two grains share the damping, and the "
            "effective mass includes the rotation of the grains"
        )
    differences.append(
        "there is no tangential dashpot; in the study there is one, and Coulomb's limit "
        "includes its force. LIGGGHTS and YADE would add this force to the limit, and "
        "in LAMMPS it would wind up the spring: the friction of a grazing impact was 1.7 "
        "times that of the study, or a sixth of it"
    )
    if job.simulation.tension == "keep":
        differences.append(
            "Coulomb's limit uses the damped normal force; in the study it uses only the "
            "elastic part of this force"
        )
    return differences


def _describe_rolling_difference(job: Job) -> str:
    """Describe how the rolling resistance in a program differs from that in the study.

    There are two kinds of laws. A law of the first kind resists the rotation of each
    grain by itself. No other program has such a law, so the input script uses another
    one. A law of the second kind resists the rotation of one grain relative to another.
    Other programs have these laws, but apply them to two touching spheres instead of
    two whole grains.

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
    # `of_each_body` tells a law of the first kind.
    if ROLLING_LAWS.entry(law).of_each_body:
        difference = (
            "rolling resistance is a spring with a limit against the relative rotation "
            "(model C of Ai et al. 2011, with or without damping); in the study each "
            "grain has a limited torque of its own (model A). The coefficients here are "
            f"those of the study times the mean lever arm {lever_mm:.3g} mm over the "
            "effective radius of two spheres"
        )
        if job.is_sphere:
            # The numbers were measured.
            difference += (
                "; with mu_r 0.1, piles of spheres were 5 to 7 degrees lower for this "
                "reason"
            )
        return difference

    # The program has a law of the same name. The law with a constant torque has neither
    # stiffness nor damping.
    resistance = "its own stiffness and damping"
    if law == "constant_torque":
        resistance = "a constant torque"
    return (
        f"rolling resistance is between two spheres, with {resistance}; in the study "
        f"{law} is between two grains, and also resists spin about the normal. The "
        "coefficients here are those of the study times the mean lever arm "
        f"{lever_mm:.3g} mm over the radius of a sphere"
    )

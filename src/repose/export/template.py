"""The text of a deck, with names for values."""

import re
import string
from pathlib import Path

from repose.export.job import Job
from repose.export.laws import differences, skin_m


class _Text(string.Template):
    """A text in which @{name} stands for a value, since $ and braces have a meaning in the decks."""

    delimiter = "@"


def filled(name: str, job: Job, comment: str, unlike: list[str], **values: object) -> str:
    """The template `name` of this folder, filled with `values` and the numbers that all decks share, to nine digits.

    `comment` begins a line of the head, `unlike` are the program's differences. Lines that begin with @sphere| or
    @clump| are for such grains only.
    """
    text = Path(__file__).with_name(name).read_text(encoding="utf-8")
    kind, other = ("sphere", "clump") if job.is_sphere else ("clump", "sphere")
    text = re.sub(rf"^@{other}\|.*\n|^@{kind}\|", "", text, flags=re.MULTILINE)
    values |= _shared(job) | {"head": differences(job, comment, unlike)}
    words = {key: f"{value:.9g}" if isinstance(value, float) else value for key, value in values.items()}
    return _Text(text).substitute(words)


def _shared(job: Job) -> dict[str, object]:
    """Grain, walls, box, pour and times, by the names in the templates."""
    steps, reach = job.steps(job.duration_s), job.bounding_radius_m
    ixx, iyy, izz = job.inertia_kg_m2.tolist()
    return {
        "density": job.density_kg_m3,
        "mass": job.mass_kg,
        "radius": float(job.spheres_m[0, 3]),
        "ixx": ixx,
        "iyy": iyy,
        "izz": izz,
        "young_grain": job.grain.elastic_modulus_pa,
        "young_wall": job.wall.elastic_modulus_pa,
        "poisson_grain": job.grain.poisson_ratio,
        "poisson_wall": job.wall.poisson_ratio,
        "mus_gg": job.grains.static_friction,
        "mus_gp": job.on_wall.static_friction,
        "half": max(job.plate_radius_m, 0.5 * job.funnel.inlet_diameter_m) + 4.0 * reach,
        "top": job.factory_height_m + 4.0 * reach,
        "reach": reach,
        "skin": skin_m(job),
        "factory_radius": job.factory_radius_m,
        "factory_height": job.factory_height_m,
        "factory_low": job.factory_height_m - 1e-4,
        "factory_high": job.factory_height_m + 1e-4,
        "count": job.count,
        "every": job.steps(1.0 / job.rate_per_s),
        "gravity": job.gravity_m_s2,
        "time_step": job.time_step_s,
        "steps": steps,
        "thermo": max(1, steps // 20),
    }

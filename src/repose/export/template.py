"""The text of a deck, with names for values."""

import re
from collections.abc import Iterable
from functools import reduce
from pathlib import Path

from repose.export.job import Job
from repose.export.laws import further_laws

# A text in which @{name}, @{name.attribute} or @{name:format} is a value, since $ and braces have a meaning in decks.
VALUE = re.compile(r"@\{(\w+)((?:\.\w+)*)(?::([^}]+))?\}")
CONDITIONAL = re.compile(r"^@(!?\w+(?:@!?\w+)*)\|(.*\n)", re.MULTILINE)


def filled(name: str, job: Job, *conditions: str, **values: object) -> str:
    """Fill the template `name` of this folder with `values`, the job and the numbers of all decks, to nine digits.

    A line that begins with @sphere|, @clump|, @tube|, a law's name, as @jkr|, or one of `conditions` is for such
    grains, funnels, laws and decks alone, one with @!jkr| for all others, one with @jkr@clump| where both hold. A line
    that ends with a backslash goes on in the next one.
    """
    text = Path(__file__).with_name(name).read_text(encoding="utf-8")
    tube = ("tube",) if job.surfaces.tube_length_m else ()
    there = {
        "sphere" if job.is_sphere else "clump",
        *tube,
        *job.simulation.laws.values(),
        *conditions,
    }

    def kept(line: re.Match[str]) -> str:
        holds = (
            (word.removeprefix("!") in there) != word.startswith("!")
            for word in line[1].split("@")
        )
        return line[2] if all(holds) else ""

    text = CONDITIONAL.sub(kept, text).replace("\\\n", "")
    values = _shared(job) | {"job": job} | values

    def word(found: re.Match[str]) -> str:
        value: object = reduce(getattr, found[2].split(".")[1:], values[found[1]])
        return format(value, found[3] or (".9g" if isinstance(value, float) else ""))

    return VALUE.sub(word, text)


def head(job: Job, comment: str, *conditions: str, **values: object) -> str:
    """Write the head of a deck as comment lines: the study, and how the program, one of `conditions`, differs."""
    lines = filled(
        "head.txt", job, *conditions, further=further_laws(job), **values
    ).splitlines()
    return "\n".join(comment + line for line in lines)


def numbers(values: Iterable[float], between: str = " ") -> str:
    """Write numbers to nine digits."""
    return between.join(f"{value:.9g}" for value in values)


def _shared(job: Job) -> dict[str, object]:
    """Collect grain, box, pour, times and notes by the names in the templates."""
    steps, reach, height_m = (
        job.steps(job.funnel.duration_s),
        job.particle.bounding_radius_m,
        job.factory_height_m,
    )
    ixx, iyy, izz = job.particle.inertia_kg_m2.tolist()
    values = {
        "ixx": ixx,
        "iyy": iyy,
        "izz": izz,
        "radius": float(job.particle.spheres_m[0, 3]),
    }
    values |= {
        "half": max(job.plate_radius_m, 0.5 * job.surfaces.inlet_diameter_m)
        + 4.0 * reach,
        "reach": reach,
    }
    # reach of neighbour lists beyond the spheres: for several steps of a grain that falls at 2 m/s, 0.4 mm each
    values |= {"top": height_m + 4.0 * reach, "skin": 0.75 * job.mean_radius_m}
    values |= {
        "factory_radius": 0.5e-3 * job.funnel.factory_diameter_mm - reach,
        "factory_height": height_m,
    }
    values |= {"factory_low": height_m - 1e-4, "factory_high": height_m + 1e-4}
    values |= {
        "percent": 100 * job.time_step_s / job.rayleigh_s,
        "lever_mm": 1e3 * job.lever_m,
    }
    values |= {"notes": "\n".join(f"- {note}" for note in job.notes)}
    return values | {
        "every": job.steps(1.0 / job.funnel.rate_per_s),
        "steps": steps,
        "thermo": max(1, steps // 20),
    }

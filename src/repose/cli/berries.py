"""The berry and its particle: from files that the options name, or made from the configuration."""

import json
import tempfile
from pathlib import Path

from repose.cli.options import PUBLISHED
from repose.cli.registry import Option
from repose.core.errors import InputError

BERRY_AND_PARTICLE = (
    Option("--berry", help="berry.json; made from the configuration if not given"),
    Option("--particle", help="particle.json; made from the configuration if not given"),
)


def berry_and_particle(config, source, berry_json=None, particle_json=None):
    """Content of berry.json, a dict, and the Particle.

    config: checked configuration; source: its file, for messages; berry_json, particle_json: files to read
    instead of making them from the configuration. Raises InputError.
    """
    from repose.config import checks
    from repose.particle.build import Particle

    with tempfile.TemporaryDirectory() as folder:
        if berry_json is None:
            checks.check_inputs(config, source)
            write_berry(config, PUBLISHED / "table1.csv", folder)
            berry_json = Path(folder) / "berry.json"
        check_berry(berry_json)
        particle = (
            write_particle(config, berry_json, folder)
            if particle_json is None
            else Particle.load(particle_json)
        )
        return json.loads(Path(berry_json).read_text()), particle


def check_berry(berry_json):
    """InputError unless the file exists."""
    if not Path(berry_json).is_file():
        raise InputError(berry_json, "file", None, "an existing file, written by `repose berry`")


def write_berry(config, table1, out_dir):
    """Sizes and moduli of the configuration's berry, written to a folder beside the published table1."""
    from repose.particle import berry

    section = config["berry"]
    material = (section["density_kg_m3"], section["poisson_ratio"], section["shear_modulus_pa"])
    berry.run(section["sizes"], section["compression"], table1, out_dir, *material)


def write_particle(config, berry_json, out_dir):
    """The configuration's Particle, written to a folder."""
    from repose.particle import build

    section = config["berry"]
    return build.run(
        berry_json,
        section["stl"],
        out_dir,
        kind=section["particle"],
        mass_g=section["mass_g"],
        spheres=section["spheres"],
        surface=section["surface"],
        time_step_s=config["simulation"]["time_step_s"],
        restitution=config["parameters"]["e_gp"][0],
    )

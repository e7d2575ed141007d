"""Get the grain and its particle from files, or make them from the configuration.

The grain is the measured one: its mean axes, density and moduli, as in berry.json. The
particle is the simulated one: its shape, mass and inertia, as in particle.json.
"""

from os import PathLike
from typing import TYPE_CHECKING, Any

from repose.cli.registry import Option
from repose.config.pipeline import PipelineConfig

if TYPE_CHECKING:
    from repose.grain.particle import Particle

DEFAULT_HELP = "made from the configuration if not given"
BERRY_AND_PARTICLE = (
    Option("--berry", help=f"berry.json; {DEFAULT_HELP}"),
    Option("--particle", help=f"particle.json; {DEFAULT_HELP}"),
)


def load_grain_and_particle(
    study: PipelineConfig,
    berry_json: str | PathLike | None = None,
    particle_json: str | PathLike | None = None,
) -> "tuple[dict[str, Any], Particle]":
    """Load the measured grain and the simulated one, from files or from the study.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    berry_json, particle_json : path, optional
        The files of --berry and --particle. If one is None, the study supplies its
        content.

    Returns
    -------
    dict
        The mean of the measured grains, as in berry.json.
    Particle
        The particle that represents this grain in simulations.

    Raises
    ------
    InputError
        If a file, or the grain section of the study, is invalid.
    """
    from repose.grain import berry_files
    from repose.grain.particle import Particle

    # Get the grain.
    if berry_json is None:
        grain = study.grain
    else:
        columns = (*berry_files.SIZE_COLUMNS, *berry_files.MODULI)
        grain = berry_files.read_grain(berry_json, columns)

    # Get its particle. The particle of the study may be used only for the grain of the
    # study.
    if particle_json is not None:
        return grain, Particle.load(particle_json)
    if berry_json is None:
        return grain, study.particle

    # Make a particle for the grain of the file. The study determines the kind of its
    # shape. Import the module only here, because it loads a library of meshes.
    from repose.grain import build

    return grain, build.make_configured_particle(grain, study.settings.berry)

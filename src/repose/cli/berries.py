"""The grain and its particle: read from files, or made from the configuration."""

from os import PathLike
from typing import TYPE_CHECKING, Any

from repose.cli.registry import Option
from repose.config.pipeline import PipelineConfig

if TYPE_CHECKING:
    from repose.grain.particle import Particle

MADE = "made from the configuration if not given"
BERRY_AND_PARTICLE = (
    Option("--berry", help=f"berry.json; {MADE}"),
    Option("--particle", help=f"particle.json; {MADE}"),
)


def berry_and_particle(
    study: PipelineConfig,
    berry_json: str | PathLike | None = None,
    particle_json: str | PathLike | None = None,
) -> "tuple[dict[str, Any], Particle]":
    """Return the grain as in berry.json and its particle, each from its file or else from the study."""
    from repose.grain import berry_files
    from repose.grain.particle import Particle

    needed = (*berry_files.SIZE_COLUMNS, *berry_files.MODULI)
    of_berry = (
        study.grain
        if berry_json is None
        else berry_files.read_berry(berry_json, needed)
    )
    if particle_json is not None:
        return of_berry, Particle.load(particle_json)
    if berry_json is None:
        return of_berry, study.particle
    from repose.grain import build

    return of_berry, build.of_settings(of_berry, study.settings.berry)

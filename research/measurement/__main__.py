"""The definitions of the angle compared: bias on known shapes, noise, signal over the design."""

from repose.core.errors import InputError
from repose.particle.berry_files import read_berry
from repose.particle.particle import Particle
from research.measurement import measurement_study
from research.script import Script, option

script = Script("measurement", __doc__)


@script.part(
    "definitions",
    "results/measurement_study",
    option("heaps", nargs="+", help=".npz files of the design's pours, NAME.pours.json beside them"),
    option("--representative", required=True, help=".npz file of the published representative solution"),
    option("--shapes", type=int, default=8, help="piles of each known shape and angle (8)"),
    option("--berry", default="results/berry/berry.json"),
    option("--particle", default="results/berry/particle.json"),
)
def definitions(args, config):
    """Compare the definitions on saved piles and on known shapes."""
    if args.shapes < 1:
        raise InputError("command line", "--shapes", args.shapes, "at least 1")
    particle, berry, section = Particle.load(args.particle), read_berry(args.berry), config["measure"]
    tables = measurement_study.run(
        args.heaps, args.representative, particle, section, berry, args.out, args.shapes
    )
    return "\n".join(table.round(2).to_string(index="measured" not in table) for table in tables.values())


if __name__ == "__main__":
    script.run()

"""Draw a figure of these studies from the files that it shows."""

from repose.report import figures
from research.figures import FIGURES
from research.script import Script, option

script = Script("figures", __doc__)


@script.part(
    "draw",
    "figure.png",
    option("name", choices=FIGURES),
    option("--input", action="append", default=[], metavar="NAME=PATH"),
)
def draw(args, config):
    """Draw one figure."""
    inputs = dict(pair.split("=", 1) for pair in args.input)
    figures.draw(args.name, inputs, args.out, config, FIGURES)


if __name__ == "__main__":
    script.run()

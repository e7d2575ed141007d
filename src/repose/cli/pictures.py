"""Subcommands that draw: figures, films, the report."""

import argparse
from typing import Any

from repose.cli.options import INPUT, split_pairs
from repose.cli.registry import Option, subcommand
from repose.config.pipeline import PipelineConfig

# Numbers of pictures in a film, of a whole study and of a small run. Each picture takes
# nearly a second to draw.
FILM_FRAMES = 72
SMALL_FILM_FRAMES = 20


@subcommand(
    Option("name", help="name of the figure, such as figure13"),
    INPUT.with_changes(help="a file that the figure shows"),
    out="figure.png",
)
def figure(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Draw one figure from the files that it shows.

    Examples
    --------
    $ repose figure dataset --input dataset=results/dataset.csv --out dataset.png
    """
    from repose.report import figures

    inputs = split_pairs(args.input, "--input")
    figures.draw(args.name, inputs, out_path=args.out, config=study.config)


@subcommand(
    Option("trajectory", help=".npz file that `heap --trajectory` or `drum` wrote"),
    Option("--particle", required=True, help="particle.json of that run"),
    Option("--drum", action="store_true", help="the trajectory is a drum's"),
    out="pour.gif",
)
def film(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Make an animation of a pour or of a drum.

    Examples
    --------
    $ repose film results/try/heap_trajectory_1.npz --particle results/berry/particle.json
    """
    from repose.grain.particle import Particle

    # This module has the name of the subcommand.
    from repose.report.renderer import film as animation
    from repose.report.renderer import scenery

    # The sections of the bench tests are not known to the type checker.
    settings: Any = study.settings
    particle = Particle.load(args.particle)
    frames = SMALL_FILM_FRAMES if settings.small_run else FILM_FRAMES

    # The walls of a drum turn, so they are drawn anew in each picture. Those of the
    # funnel are at rest, and are made once.
    if args.drum:
        animation.animate_drum(
            args.trajectory,
            particle,
            args.out,
            settings.drum,
            frames=frames,
            colour=settings.colour,
        )
    else:
        animation.animate_pour(
            args.trajectory,
            particle,
            args.out,
            scenery.make_funnel_walls(settings.funnel.funnel),
            frames=frames,
            colour=settings.colour,
        )


@subcommand(
    Option(
        "jobs",
        nargs="*",
        help="measured runs of the answer, one .json file for each bench test",
    ),
    INPUT.with_changes(help="a file of the study"),
    Option(
        "--table",
        action="append",
        default=[],
        metavar="TITLE=PATH",
        help="a table that the page shows",
    ),
    out="report.html",
)
def report(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Write the report of a study as a page for a browser.

    Examples
    --------
    $ repose stage report results/validation/heaps/001.json --input network=results/network/network.json --out report.html
    """
    from repose.report.page import page

    files = split_pairs(args.input, "--input")
    tables = split_pairs(args.table, "--table")
    page.write_report(
        study.config, args.jobs, files=files, tables=tables, out_path=args.out
    )

"""Verbs of the shape study: particles, fillings and definitions of the angle."""

from repose.cli.options import BERRY, SAMPLES
from repose.cli.registry import Family, Option
from repose.config import loader

family = Family()


@family.verb(
    "pour and measure one combination of particle and filling at the published or the designed parameters",
    example="--cell published-smooth-open_cone",
    out="results/shape/cells",
    options=[
        Option("--cell", required=True, help="KIND-PARTICLE-FILLING of the section shape_study"),
        BERRY,
        SAMPLES,
    ],
)
def shape_cell(args):
    from repose.studies import shape_study

    config = loader.load(args.config)
    shape_study.check(config, args.config)
    shape_study.run_cell(config, args.cell, args.berry, args.samples, args.out)


@family.verb(
    "compare particles, fillings and definitions of the angle with the published piles; choose the best combination",
    example="results/shape/cells/*.csv",
    out="results/shape",
    options=[Option("cells", nargs="+", help="CSV files of shape_cell")],
)
def shape_study(args):
    from repose.studies import shape_study

    shape_study.run_tables(loader.load(args.config), args.cells, args.out)

"""Verbs of the shape study: particles, tensions, fillings and definitions of the angle."""

import argparse

from repose.cli.options import BERRY, SAMPLES
from repose.cli.registry import Family, Option
from repose.config.reading import section
from repose.config.study import Study

family = Family()


@family.verb(
    "pour and measure one combination of particle, tension and filling, or fill a measuring cylinder",
    example="--cell published-smooth-keep-open_cone",
    out="results/shape/cells",
    options=[
        Option("--cell", required=True, help="KIND-PARTICLE-TENSION-FILLING of the section shape_study"),
        BERRY,
        SAMPLES,
    ],
)
def shape_cell(args: argparse.Namespace) -> None:
    from repose.studies import shape_cells, shape_study

    study = Study.load(args.config)
    section(study.config, "shape_study")
    shape_cells.check(study.config, args.config)
    shape_study.run_cell(study.config, args.cell, args.berry, args.samples, args.out)


@family.verb(
    "compare particles, tensions, fillings and definitions of the angle with the published piles; select finalists",
    example="results/shape/cells/published-*.csv results/shape/cells/bulk-*.csv",
    out="results/shape",
    options=[Option("cells", nargs="+", help="CSV files of shape_cell")],
)
def shape_selection(args: argparse.Namespace) -> None:
    from repose.studies import shape_study

    study = Study.load(args.config)
    section(study.config, "shape_study")
    shape_study.run_selection(study.config, args.cells, args.out)


@family.verb(
    "judge the finalists by their fresh pours and choose one",
    example="results/shape/cells/*.csv --finalists results/shape/finalists.csv",
    out="results/shape",
    options=[
        Option("cells", nargs="+", help="CSV files of shape_cell"),
        Option("--finalists", required=True, help="what shape_selection wrote"),
    ],
)
def shape_study(args: argparse.Namespace) -> None:
    from repose.studies import shape_study

    study = Study.load(args.config)
    section(study.config, "shape_study")
    shape_study.run_verdict(study.config, args.cells, args.finalists, args.out)

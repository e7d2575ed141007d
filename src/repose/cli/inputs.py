"""Subcommands for the inputs of a study: the grain, its particle, the samples."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.options import BERRY
from repose.cli.own_simulator import load_any_study
from repose.cli.registry import Option, load_study, subcommand
from repose.common.errors import InputError
from repose.common.files import write_bytes, write_table
from repose.common.numbers import format_significant
from repose.config.pipeline import PipelineConfig

if TYPE_CHECKING:
    from repose.calibrate.parameter_space import ParameterSpace
    from repose.calibrate.study import Study


def _load_study_of_grain(args: argparse.Namespace) -> PipelineConfig | None:
    """Load the study; return None if only a mesh is built, which needs no study."""
    return None if args.axes or args.stl else load_study(args)


@subcommand(
    Option(
        "--axes",
        type=float,
        nargs=3,
        metavar="MM",
        help="only build a mesh of a grain, with these three axes; with --mass-g and "
        "--stl",
    ),
    Option(
        "--stl",
        help="mesh file to write; with --axes and --mass-g",
        recorded=False,
    ),
    Option(
        "--mass-g",
        type=float,
        help="mass of the grain in the mesh [g]; mass and density determine how much of "
        "the box around it the shape fills",
    ),
    Option(
        "--density",
        type=float,
        help="density of the grain in the mesh [kg/m3] (that of the configuration)",
    ),
    Option(
        "--taper",
        type=float,
        default=0.0,
        help="widening of the mesh at one end, as a fraction of its width (0)",
    ),
    Option(
        "--wrinkles",
        type=int,
        default=0,
        help="number of grooves along the mesh (0)",
    ),
    Option(
        "--wrinkle-depth-mm",
        type=float,
        default=0.0,
        help="depth of the grooves in mm (0)",
    ),
    out="results/berry",
    study=_load_study_of_grain,
)
def berry(args: argparse.Namespace, study: PipelineConfig | None) -> None:
    """Compute sphericity and moduli of the grain, or build its mesh.

    The sphericity follows from measured sizes, and the moduli follow from compression
    tests (Eq. 1-4). With --axes the mesh is built from the axes and the mass.

    Examples
    --------
    $ repose stage berry --axes 6.6 5.6 4.5 --mass-g 0.11 --density 1250 --stl results/crop.stl
    """
    from repose.common.tables import print_columns
    from repose.grain import berry as grain_stage

    # `_load_study_of_grain` returns no study if --axes or --stl asks for a mesh.
    if study is None:
        _build_mesh(args)
        return
    section = study.settings.berry
    grain_stage.run(section, study.published("table1.csv"), args.out)
    # Show what was read from the user's tables.
    print_columns(section.sizes)
    if section.compression is not None:
        print_columns(section.compression)


def _build_mesh(args: argparse.Namespace) -> None:
    """Build the mesh of a grain from its axes, mass and density; write it as STL.

    A line with the volume and the profile of the mesh is printed.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `berry` about the mesh, from `axes` to
        `wrinkle_depth_mm`. Without --density the density of the configuration is used.

    Raises
    ------
    InputError
        If --axes, --mass-g or --stl is missing or 0.
    """
    from repose.grain import mesh_from_axes

    if not (args.axes and args.stl and args.mass_g):
        raise InputError(
            "command line",
            key="berry --axes",
            value=args.axes,
            allowed="together with --mass-g and --stl",
        )
    density = args.density
    if density is None:
        density = load_study(args).settings.berry.density_kg_m3
    # Mass and density give the volume, which is smaller than the box of the axes. The
    # function finds the shape that has this volume. A shape with a larger number fills
    # more of the box.
    mesh, shape_number = mesh_from_axes.make_grain_mesh(
        args.axes,
        args.mass_g,
        density_kg_m3=density,
        taper=args.taper,
        wrinkles=args.wrinkles,
        wrinkle_depth_mm=args.wrinkle_depth_mm,
        source="command line",
    )
    stl = mesh.export(file_type="stl")
    assert isinstance(stl, bytes)
    write_bytes(args.stl, stl)

    # Print which fraction of its bounding box the shape fills, and its profile: the
    # half width at the position t along the axis, from -1 to 1, relative to that in the
    # middle.
    box_mm3 = math.prod(args.axes)
    inner_exponent, outer_exponent = mesh_from_axes.compute_profile_exponents(
        shape_number
    )
    print(
        f"{args.stl}: {format_significant(mesh.volume)} mm3, {mesh.volume / box_mm3:.3f} of the box "
        f"around it, profile (1 - |t|^{inner_exponent:.3g})^{outer_exponent:.3g}"
    )


@subcommand(BERRY, out="results/berry")
def shape(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Make mesh and particle of the grain.

    The result includes volume, mass, inertia and the deviation from the mesh.

    Examples
    --------
    $ repose stage shape --berry results/berry/berry.json
    """
    from repose.grain import build

    settings = study.settings.berry
    build.run(
        args.berry,
        settings.stl,
        args.out,
        kind=settings.particle,
        mass_g=settings.mass_g,
        spheres=settings.spheres,
        surface=settings.surface,
    )


@subcommand(out="results/design", study=load_any_study)
def design(args: argparse.Namespace, study: "PipelineConfig | Study") -> None:
    """Make the Latin hypercube design of the parameters.

    The table samples.csv in the folder of --out has the parameter sets to simulate. The
    parameters are the contact parameters of repose, or those of the user's own
    simulator.

    Examples
    --------
    $ repose design --out results/design
    """
    from repose.stages import design as design_stage

    # If repose simulates the study, the design is a table of samples.
    if isinstance(study, PipelineConfig):
        design_stage.write_design(study.parameters, study.settings.design, args.out)
        _print_allowed_fraction(study.parameters)
        return

    # For the user's own simulator, it is a table of runs, some of which share a sample.
    # Without any runs so far, the strategy asks for those of the design.
    table = study.ask()
    path = Path(args.out) / "samples.csv"
    write_table(path, table)
    n_samples = table["sample"].nunique()
    print(f"{path}: {len(table)} runs of {n_samples} samples to simulate")
    _print_allowed_fraction(study.parameters)


def _print_allowed_fraction(space: "ParameterSpace") -> None:
    """Print which fraction of the ranges the constraints allow, if there are any."""
    if space.constraints:
        rules = ", ".join(constraint.text for constraint in space.constraints)
        print(
            f"{rules}: {100 * space.allowed_fraction:.0f} % of the ranges are allowed; the "
            "samples are spread evenly over them, but do not form a Latin hypercube"
        )

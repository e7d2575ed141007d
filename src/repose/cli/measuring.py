"""Verbs that measure: a picture of a pile, the side view of a simulated one, the definitions of the angle."""

import argparse
from pathlib import Path
from typing import Any

from repose.cli.berries import BERRY_AND_PARTICLE, berry_and_particle
from repose.cli.options import JSON
from repose.cli.registry import Family, Option
from repose.config import loader
from repose.core.errors import InputError
from repose.core.files import json_text

# From a microscope's pixel to a heap of a hall [mm].
SCALES = (1e-3, 100.0)

family = Family()


@family.verb(
    "measure angle of repose and Height of the pile in a photograph or a silhouette",
    example="pile.jpg --mm-per-pixel 0.1",
    options=[
        Option("picture", help="side view of a pile: PNG, JPEG, TIFF or BMP"),
        Option(
            "--mm-per-pixel", type=float, required=True, help="scale of the picture: millimetres per pixel"
        ),
        Option(
            "--base-row",
            type=float,
            help="row of the plate in pixels from the top, where a shadow hides the pile's foot (its lowest row)",
        ),
        Option("--overlay", help="picture with the fitted lines (beside the picture, NAME_overlay.png)"),
        Option("--berry", help="berry.json with the mean axes (those of the configuration)"),
        JSON.but(help="print left_deg, right_deg, aor_deg, height_mm and more as JSON"),
    ],
)
def measure(args: argparse.Namespace) -> None:
    from repose.core.files import write_image
    from repose.core.ledger import check_replaceable
    from repose.measure import drawing, pile

    source = Path(args.picture)
    overlay = Path(args.overlay or source.with_name(f"{source.stem}_overlay.png"))
    if overlay.resolve() == source.resolve():
        raise InputError("command line", "--overlay", args.overlay, "another file than the picture")
    check_replaceable(overlay)
    low, high = SCALES
    if not low <= args.mm_per_pixel <= high:
        raise InputError(
            "command line", "--mm-per-pixel", args.mm_per_pixel, f"a number from {low:g} to {high:g}"
        )
    config = loader.load(args.config)
    how = pile.MeasureSettings.of(config["measure"], _axes(args.berry, config))
    image = pile.read_image(args.picture)
    try:
        measured = pile.measure_image(image, args.mm_per_pixel, how, base_row=args.base_row)
    except pile.NoFlankError as error:
        write_image(overlay, drawing.overlay_of_failure(image, how, args.base_row))
        allowed = f"a pile with two flanks, seen from the side; {overlay} shows what was taken for the pile"
        raise InputError(args.picture, "pile", str(error), allowed) from None
    write_image(overlay, drawing.overlay(image, measured))
    values: dict[str, Any] = measured.record()
    if args.json:
        print(json_text(values))
        return
    print("left {left_deg:.2f} deg, right {right_deg:.2f} deg".format(**values))
    print("angle of repose {aor_deg:.2f} deg, Height {height_mm:.2f} mm".format(**values))
    for name in pile.DEFINITIONS:
        angle, mark = measured.angles.get(name), "  <- response" if name == how.response else ""
        print(f"{name:>10}: {f'{angle.aor_deg:.2f} deg{mark}' if angle else measured.reasons[name]}")
    if how.berry_height_mm is not None:
        print(f"height of a berry: {how.berry_height_mm:.2f} mm, of {args.berry or args.config}")
    print(f"fitted lines: {overlay}")


def _axes(berry_json, config):
    """Mean axes of the berry, from the file given or from the sizes of the configuration."""
    if berry_json is not None:
        from repose.particle.berry_files import read_berry

        return read_berry(berry_json)
    if config["measure"]["berry_height_mm"] is not None:
        return {}
    from repose.particle import berry

    sizes = berry.read_sizes(config["berry"]["sizes"])
    return {column: float(sizes[column].mean()) for column in berry.SIZE_COLUMNS}


@family.verb(
    "draw the side view of a simulated pile, dark on light",
    example="results/try/heap.npz --particle results/berry/particle.json",
    out="silhouette.png",
    options=[
        Option("heap", help=".npz file that the verb pour or heap wrote; its first seed is shown"),
        Option("--particle", required=True, help="particle.json of that heap"),
        Option("--azimuth", type=float, default=0.0, help="direction of view in degrees (0)"),
    ],
)
def silhouette(args: argparse.Namespace) -> None:
    from repose.core.files import write_image
    from repose.measure.pile import MeasureSettings
    from repose.measure.saved_piles import side_view
    from repose.measure.saved_pours import first_pour
    from repose.particle.build import Particle

    how = MeasureSettings(**loader.load(args.config)["measure"])
    picture = side_view(first_pour(args.heap), Particle.load(args.particle), how, args.azimuth)
    write_image(args.out, picture)


@family.verb(
    "compare the definitions of the angle: bias on known shapes, noise, signal over the design",
    example="results/heaps/???.npz --representative results/validation/heaps/106.npz",
    out="results/measurement_study",
    options=[
        Option("heaps", nargs="+", help=".npz files of the design's pours, NAME.pours.json beside them"),
        Option("--representative", required=True, help=".npz file of the published representative solution"),
        Option("--shapes", type=int, default=8, help="piles of each known shape and angle (8)"),
        *BERRY_AND_PARTICLE,
    ],
)
def measurement_study(args: argparse.Namespace) -> None:
    if args.shapes < 1:
        raise InputError("command line", "--shapes", args.shapes, "at least 1")
    config = loader.load(args.config)
    berry_of, particle = berry_and_particle(config, args.config, args.berry, args.particle)

    from repose.studies import measurement_study

    tables = measurement_study.run(
        args.heaps, args.representative, particle, config["measure"], berry_of, args.out, args.shapes
    )
    for table in tables.values():
        print(table.round(2).to_string(index="measured" not in table))

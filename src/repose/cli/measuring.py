"""Verbs that measure: a picture of a pile, the side view of a simulated one, the definitions of the angle."""

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.cli.options import BERRY, JSON, require_option
from repose.cli.registry import CONFIG, Option, load, verb
from repose.common.errors import InputError, raise_together
from repose.common.files import json_text
from repose.common.keys import section
from repose.common.provenance import hash_of_file
from repose.config.pipeline import PipelineConfig

if TYPE_CHECKING:
    from repose.measure.photographs.photograph import Scale
    from repose.measure.settings import MeasureSettings

# Pixel sizes from a microscope to a heap in a hall [mm].
SCALES = (1e-3, 100.0)
LINE = "its line of the angle (default: from foot to crest)"
BENCHES = "funnel or lifted_cylinder, which leave a pile, turning or drawdown"
POINTS = "three points of the drum's inner rim, or of the box's two lower inner corners"
SIZES = "sizes.csv"  # of a crop's folder


@verb(
    Option(
        "pictures",
        nargs="+",
        help="side views of piles, one or many: PNG, JPEG, TIFF or BMP",
    ),
    Option(
        "--square-mm",
        type=float,
        default=20.0,
        help="squares of the printed sheet, as measured (20)",
    ),
    Option(
        "--lens",
        nargs="+",
        default=[],
        help="photographs of the sheet alone, by the same camera",
    ),
    Option(
        "--mm-per-pixel", type=float, help="scale, where no sheet is in the photographs"
    ),
    Option(
        "--length",
        nargs=5,
        type=float,
        metavar=("MM", "X1", "Y1", "X2", "Y2"),
        help="instead of the scale: a level length and the pixels of its ends, column and row",
    ),
    Option(
        "--base-row",
        type=float,
        help="row of the plate in pixels from the top, without the sheet",
    ),
    Option(
        "--grain-mm",
        type=float,
        help="height of a grain, for the secant (by --config or sizes.csv)",
    ),
    CONFIG.with_changes(default=None, help=f"the study that the photographs are for; {LINE}"),
    Option("--bench", default="funnel", help=f"bench test: {BENCHES} (funnel)"),
    Option(
        "--points",
        nargs="+",
        type=float,
        metavar="PX",
        help=f"column and row of {POINTS}",
    ),
    Option(
        "--doubtful",
        action="store_true",
        help="doubtful photographs count in the mean and in the targets",
    ),
    JSON.with_changes(help="print every number as JSON"),
    out="measured",
    config=False,
)
def measure(args: argparse.Namespace) -> None:
    """Measure the piles, the drum or the box in photographs.

    example: *.jpg --square-mm 20 --out measured
    """
    from repose.bench import bench_tests
    from repose.bench import photographs as of_apparatus
    from repose.common.files import write_image
    from repose.common.ledger import check_replaceable
    from repose.measure.photographs import drawing
    from repose.measure.photographs import photograph as photographs
    from repose.measure.photographs.tables import (
        as_record,
        describe,
        tables,
        write_tables,
    )

    of_pile = {
        bench.name: bench.photographed for bench in bench_tests() if bench.photographed
    }
    allowed = "one of " + ", ".join((*of_pile, *of_apparatus.RESPONSES))
    require_option(
        args.bench in (*of_pile, *of_apparatus.RESPONSES),
        "--bench",
        args.bench,
        allowed,
    )
    for name in (
        ("points",)
        if args.bench in of_pile
        else ("lens", "mm_per_pixel", "length", "base_row")
    ):
        if value := getattr(args, name):
            raise InputError(
                "command line",
                f"--{name.replace('_', '-')}",
                value,
                f"nothing with --bench {args.bench}",
            )
    out = Path(args.out)
    pictures, faults = photographs.readable([Path(name) for name in args.pictures])
    if not pictures:
        raise_together(faults)
    for fault in faults:
        print(f"repose: left out: {fault}", file=sys.stderr)
    overlays, hashes = (
        [out / f"{path.stem}.png" for path in pictures],
        list(map(hash_of_file, pictures)),
    )
    for path, overlay, content in zip(pictures, overlays, hashes, strict=True):
        require_option(
            overlays.count(overlay) == 1,
            "pictures",
            path.name,
            "photographs whose names differ",
        )
        require_option(
            hashes.count(content) == 1,
            "pictures",
            path.name,
            "each picture once: this is a copy",
        )
        check_replaceable(overlay)
        other = overlay.resolve() != path.resolve()
        require_option(
            other, "--out", args.out, "another folder than that of the photographs"
        )
    scale, how = _scale(args), _settings(args)
    if args.bench not in of_pile:
        _measure_apparatus(args, pictures, overlays, how)
        return
    results = photographs.measure_all(
        pictures, how, scale, [Path(name) for name in args.lens]
    )
    for photograph, overlay in zip(results, overlays, strict=True):
        view, pile, measured = photograph.view, photograph.pile, photograph.measurement
        shown = (
            drawing.overlay_of_refused(view, pile)
            if measured is None
            else drawing.overlay(view, measured)
        )
        write_image(overlay, shown)
    allowed = "a pile with two flanks, seen from the side; {} shows the part taken for the pile"
    if all(photograph.measurement is None for photograph in results):
        both = zip(results, overlays, strict=True)
        raise_together(
            InputError(one.path, "pile", one.refused, allowed.format(overlay))
            for one, overlay in both
        )
    made = tables(results, how, args.doubtful)
    write_tables(made, how, out, args.bench, of_pile[args.bench])
    print(
        json_text(as_record(made)) if args.json else describe(results, made, how, out)
    )


def _measure_apparatus(
    args: argparse.Namespace,
    pictures: list[Path],
    overlays: list[Path],
    how: "MeasureSettings",
) -> None:
    """Measure photographs of a drum or of a box."""
    from repose.bench import photographs
    from repose.bench.settings import SceneSettings
    from repose.bench.turning import TurningSettings
    from repose.common.files import write_image, write_table
    from repose.measure.photographs.tables import as_record, write_tables

    if args.config is None:
        raise InputError(
            "command line",
            "--config",
            None,
            f"a study, whose section {args.bench} has the measures",
        )
    settings, out = SceneSettings(load(args).config), Path(args.out)
    section(settings.config, args.bench)
    results = photographs.measure_all(
        pictures, args.points or (), settings, args.bench, how
    )
    for seen, overlay in zip(results, overlays, strict=True):
        write_image(overlay, photographs.stacked(seen.views))
    if all(seen.refused for seen in results):
        allowed = "a bed with a surface that differs from its background"
        raise_together(
            InputError(seen.path, args.bench, seen.refused, allowed) for seen in results
        )
    made = photographs.tables(results, args.bench)
    write_tables(
        made,
        how,
        out,
        args.bench,
        {name: name for name in photographs.RESPONSES[args.bench]},
    )
    if args.bench == "turning":
        write_table(
            out / "profile.csv",
            photographs.profile(results, settings.section("turning", TurningSettings)),
        )
    print(
        json_text(as_record(made))
        if args.json
        else photographs.describe(results, made, out)
    )


def _scale(args: argparse.Namespace) -> "Scale":
    """Read the scale from the command line."""
    from repose.measure.photographs.photograph import (
        LEAST_LENGTH_PX,
        MOST_LEVEL_DEG,
        Scale,
        level_length,
    )

    def number(option: str, value: float, low: float, high: float) -> None:
        require_option(
            low <= value <= high, option, value, f"a number from {low:g} to {high:g}"
        )

    require_option(
        args.mm_per_pixel is None or not args.length,
        "--length",
        args.length,
        "without --mm-per-pixel",
    )
    scale, level = args.mm_per_pixel, 0.0
    number("--square-mm", args.square_mm, 1, 1000)
    if args.length:
        number("--length", args.length[0], 1, 1e5)
        if (found := level_length(*args.length)) is None:
            allowed = f"ends at least {LEAST_LENGTH_PX} pixels apart, left first, level to {MOST_LEVEL_DEG:g} degrees"
            raise InputError("command line", "--length", args.length, allowed)
        scale, level = found
    if scale is not None:
        number("--length" if args.length else "--mm-per-pixel", scale, *SCALES)
        require_option(
            not args.lens, "--lens", args.lens, "with the printed sheet as the scale"
        )
    elif args.base_row is not None:
        raise InputError(
            "command line",
            "--base-row",
            args.base_row,
            "with --mm-per-pixel or --length",
        )
    return Scale(args.square_mm, scale, args.base_row, level)


def _settings(args: argparse.Namespace) -> "MeasureSettings":
    """Make settings of the measurement; outside a study a line from foot to crest, and the folder's grain."""
    from repose.measure.settings import MeasureSettings, mean_axes_mm

    if args.grain_mm is not None and not 0.1 <= args.grain_mm <= 1000:
        raise InputError(
            "command line", "--grain-mm", args.grain_mm, "a number from 0.1 to 1000"
        )
    section: dict[str, Any] = {"berry_height_mm": None}
    sizes_csv = SIZES if Path(SIZES).is_file() else None
    if args.config is not None:
        settings = load(args).settings
        section, sizes_csv = dict(settings.measure), settings.berry.sizes
    if args.grain_mm is not None:
        section["berry_height_mm"] = args.grain_mm
    grain = (
        {}
        if section["berry_height_mm"] is not None or sizes_csv is None
        else mean_axes_mm(sizes_csv)
    )
    return MeasureSettings.of(section, grain)


@verb(
    Option(
        "--square-mm",
        type=float,
        default=20.0,
        help="side of a square, from 5 to 25 (20)",
    ),
    out="sheet.pdf",
    config=False,
)
def marker(args: argparse.Namespace) -> None:
    """Write the sheet (PDF, A4) for the scale, tilt and lens of a photograph.

    example: --out sheet.pdf
    """
    from repose.common.files import write_bytes
    from repose.measure.photographs import sheet

    require_option(
        5 <= args.square_mm <= 25,
        "--square-mm",
        args.square_mm,
        "a number from 5 to 25",
    )
    require_option(
        Path(args.out).suffix.lower() == ".pdf",
        "--out",
        args.out,
        "a file that ends with .pdf",
    )
    write_bytes(args.out, sheet.pdf(args.square_mm))
    print(
        f"print {args.out} at 100 %, check its line of 100 mm, cut it out: `repose docs photographs`"
    )


@verb(
    Option(
        "heap",
        help=".npz file that the verb pour or heap wrote; its first seed is shown",
    ),
    Option("--particle", required=True, help="particle.json of that heap"),
    Option(
        "--azimuth", type=float, default=0.0, help="direction of view in degrees (0)"
    ),
    out="silhouette.png",
)
def silhouette(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Draw the side view of a simulated pile, dark on light.

    example: results/try/heap.npz --particle results/berry/particle.json
    """
    from repose.common.files import write_image
    from repose.grain.particle import Particle
    from repose.measure.pile import MeasureSettings
    from repose.measure.saved_piles import side_view
    from repose.measure.saved_pours import first_pour

    require_option(
        math.isfinite(args.azimuth), "--azimuth", args.azimuth, "a finite angle"
    )
    how = MeasureSettings(**dict(study.settings.measure))
    write_image(
        args.out,
        side_view(
            first_pour(args.heap), Particle.load(args.particle), how, args.azimuth
        ),
    )


@verb(
    Option("picture", help="file of the verb silhouette"),
    Option(
        "--overlay",
        default="overlay.png",
        help="picture with the fitted lines (overlay.png)",
        recorded=False,
    ),
    BERRY,
    out="measured.json",
)
def measure_silhouette(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Measure the side view that the verb silhouette drew, as a photograph is measured.

    example: silhouette.png --overlay overlay.png
    """
    from repose.common.files import write_image, write_json
    from repose.grain.berry_files import read_berry
    from repose.measure import pile
    from repose.measure.photographs import drawing

    how = pile.MeasureSettings.of(dict(study.settings.measure), read_berry(args.berry))
    image = pile.read_image(args.picture)
    try:
        measured = pile.measure_image(image, how.mm_per_pixel, how)
    except pile.NoFlankError as error:
        raise InputError(
            args.picture,
            "pile",
            str(error),
            "a pile with two flanks, seen from the side",
        ) from None
    write_image(args.overlay, drawing.overlay(image, measured))
    write_json(args.out, measured.record())

"""Subcommands that measure piles: in photographs, and in views of simulated piles."""

import argparse
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.cli.options import BERRY, JSON
from repose.cli.registry import CONFIG, Option, load_study, subcommand
from repose.common.errors import InputError, raise_together
from repose.common.files import format_json
from repose.common.keys import require_section
from repose.common.numbers import format_decimals, format_significant
from repose.common.provenance import hash_file
from repose.config.pipeline import PipelineConfig
from repose.measure.conventions import DIRECTIONS

if TYPE_CHECKING:
    import pandas as pd

    from repose.bench.photographs import PhotographResult
    from repose.measure.particles import ParticlePile
    from repose.measure.photographs.photograph import Photograph, Scale
    from repose.measure.settings import MeasureSettings

# Smallest and largest size of a pixel [mm], from a microscope to a heap in a hall.
PIXEL_SIZE_LIMITS_MM = (1e-3, 100.0)
# Options of `measure` that only a photograph of a pile needs, and those that only a
# photograph of a drum or a box needs. The scale of a drum or a box comes from points of
# known distance.
PILE_OPTIONS = ("lens", "mm_per_pixel", "length", "base_row")
BED_OPTIONS = ("points",)
ANGLE_LINE_HELP = "its line of the angle (default: over the whole side)"
BENCH_HELP = "funnel or lifted_cylinder, which leave a pile, turning or drawdown"
POINTS_HELP = (
    "three points of the drum's inner rim, or of the box's two lower inner corners"
)
# Table of measured sizes in the folder of a crop.
SIZES_FILE = "sizes.csv"
# Table of the piles that were measured in files of particles.
PARTICLE_TABLE_FILE = "piles.csv"
# Table of runs with the responses of their piles.
RESULTS_TABLE_FILE = "results.csv"
# Table of the median profile of the bed in a turning drum.
PROFILE_TABLE_FILE = "profile.csv"
EXPECTED_PILE = "a pile with two flanks, seen from the side"
SCALES = "the printed sheet in the picture, --mm-per-pixel or --length"


@subcommand(
    Option(
        "pictures",
        nargs="+",
        help="side views of piles, one or many: PNG, JPEG, TIFF or BMP; or files of "
        "particles of any simulator: a dump, VTK, CSV or Yade's text",
    ),
    Option(
        "--square-mm",
        type=float,
        default=20.0,
        help="side of a square on the printed sheet, as you measured it [mm] (20)",
    ),
    Option(
        "--lens",
        nargs="+",
        default=[],
        help="photographs that show only the sheet, taken by the same camera",
    ),
    Option(
        "--mm-per-pixel",
        type=float,
        help="scale of photographs that do not show the sheet [mm per pixel]",
    ),
    Option(
        "--length",
        nargs=5,
        type=float,
        metavar=("MM", "X1", "Y1", "X2", "Y2"),
        help="scale from a level line: its length in mm, then column and row of each of "
        "its ends in pixels, the left end first",
    ),
    Option(
        "--base-row",
        type=float,
        help="row of the plate, in pixels from the top, in photographs that do not show "
        "the sheet",
    ),
    Option(
        "--grain-mm",
        type=float,
        help="height of a grain [mm], which some definitions of the angle need (from the "
        "study of --configfile, or from sizes.csv)",
    ),
    CONFIG.with_changes(
        default=None, help=f"the study that the photographs are for; {ANGLE_LINE_HELP}"
    ),
    Option("--bench", default="funnel", help=f"bench test: {BENCH_HELP} (funnel)"),
    Option(
        "--points",
        nargs="+",
        type=float,
        metavar="PX",
        help=f"column and row of {POINTS_HELP}",
    ),
    Option(
        "--doubtful",
        action="store_true",
        help="include all doubtful photographs in the mean and in the targets, not only "
        "those whose two sides differ, and doubtful files of particles in results.csv",
    ),
    Option(
        "--unit",
        default="m",
        help="unit of lengths in a file of particles: m, cm or mm (m)",
    ),
    Option(
        "--up",
        choices=tuple(DIRECTIONS),
        help="direction against gravity in a file of particles: x, y, z, -x, -y or -z "
        "(found from the plane on which most grains lie)",
    ),
    Option(
        "--base",
        type=float,
        help="height of the plate in a file of particles, in its unit (found from the "
        "lowest grains)",
    ),
    Option(
        "--radius",
        type=float,
        help="radius of all particles in files without sizes, in their unit; such a file "
        "may be rows of x, y, z alone",
    ),
    Option(
        "--runs",
        help="table of `repose design`; the subcommand then writes results.csv for "
        "`repose tell`. A file of particles must be named by its sample and run, such as "
        "3_1.csv",
    ),
    JSON.with_changes(help="print every number as JSON"),
    out="measured",
    config=False,
)
def measure(args: argparse.Namespace) -> None:
    """Measure piles in photographs or in files of particles.

    Photographs may also show the drum or the box.

    Examples
    --------
    $ repose measure *.jpg --square-mm 20 --out measured
    """
    if _are_particle_files(args.pictures):
        _measure_particle_files(args)
        return

    # Check all options and files before the first photograph is measured.
    piles = _find_photographed_piles()
    _check_bench_options(args, piles)
    pictures = _select_readable_pictures(args.pictures)
    overlays = _choose_overlay_paths(pictures, args.out)
    scale = _read_scale(args)
    settings = _make_measure_settings(args)

    # Measure a pile, or the bed in a drum or a box.
    if args.bench in piles:
        _measure_piles(
            args, pictures, overlays=overlays, scale=scale, settings=settings
        )
    else:
        _measure_beds(args, pictures, overlays=overlays, settings=settings)


def _are_particle_files(paths: Sequence[str]) -> bool:
    """Tell whether files contain particles instead of pictures, but never both.

    Parameters
    ----------
    paths : sequence of str
        Paths of the files. Files that do not exist are ignored.

    Returns
    -------
    bool

    Raises
    ------
    InputError
        If some files contain particles and others are pictures.
    """
    from repose.measure.particle_files import is_particle_file

    existing_paths = [path for path in paths if Path(path).is_file()]
    particle_files = [path for path in existing_paths if is_particle_file(path)]
    if not particle_files:
        return False
    pictures = [path for path in existing_paths if path not in particle_files]
    if pictures:
        raise InputError(
            "command line",
            key="pictures",
            value=", ".join(pictures),
            allowed=f"only files of particles, such as {particle_files[0]}",
        )
    return True


def _measure_particle_files(args: argparse.Namespace) -> None:
    """Measure piles in files of particles; write tables and print the result.

    The tables are piles.csv and, with --runs, results.csv.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `measure`. `pictures` has the paths of the files,
        although they are no pictures.

    Raises
    ------
    InputError
        If an option is not allowed, or a pile has no flanks. A flank is a side of the
        pile that is long enough to fit a line.
    """
    import pandas as pd

    from repose.common.files import write_table
    from repose.common.section import AUTO

    _check_particle_options(args)
    runs = None if args.runs is None else _read_runs(args.runs, args.pictures)
    settings = _make_measure_settings(args)
    if args.config is None:
        # The piles are measured in drawn side views. Without a study, choose the size
        # of their pixels from the size of the grains.
        settings = settings.model_copy(update={"mm_per_pixel": AUTO})

    # Each file gives a row of the table.
    piles = [_measure_particle_file(path, settings, args) for path in args.pictures]
    rows = [
        _make_row_of_pile(path, pile)
        for path, pile in zip(args.pictures, piles, strict=True)
    ]
    table = pd.DataFrame(rows)
    table_path = Path(args.out) / PARTICLE_TABLE_FILE
    write_table(table_path, table)
    # A pile is doubtful if its measurement gave warnings.
    is_included = [args.doubtful or not pile.warnings for pile in piles]
    if runs is not None:
        results = _add_responses_to_runs(runs, table[is_included], args.bench)
        write_table(Path(args.out) / RESULTS_TABLE_FILE, results)

    if args.json:
        print(format_json(table.to_dict("records")))
    else:
        _print_particle_piles(rows, piles, settings, args.unit)
        if runs is not None and not all(is_included):
            print(
                f"doubtful piles: {is_included.count(False)}, not in "
                f"{RESULTS_TABLE_FILE}; --doubtful counts them"
            )
        print(f"all measured numbers, with the angle by every line: {table_path}")


def _measure_particle_file(
    path: str, settings: "MeasureSettings", args: argparse.Namespace
) -> "ParticlePile":
    """Measure the pile in a file of particles.

    Parameters
    ----------
    path : str
        The file.
    settings : MeasureSettings
        How a pile is measured.
    args : argparse.Namespace
        The options `radius`, `unit`, `up` and `base` say how to read the file.

    Returns
    -------
    ParticlePile
        The measured pile.

    Raises
    ------
    InputError
        If the file cannot be read, or the pile has no flanks.
    """
    from repose.common.errors import NoFlankError
    from repose.measure.particle_files import read_particles
    from repose.measure.particles import measure_particles

    particles = read_particles(path, args.radius)
    try:
        return measure_particles(
            particles,
            settings,
            unit=args.unit,
            up=args.up,
            base=args.base,
            source=path,
        )
    except NoFlankError as error:
        grain = f"{format_significant(2 * particles.mean_radius)} {args.unit}"
        raise InputError(
            path,
            key="pile",
            value=error.reason,
            allowed=f"{EXPECTED_PILE}, of particles {grain} wide (--unit {args.unit})",
        ) from error


def _make_row_of_pile(path: str, pile: "ParticlePile") -> dict[str, Any]:
    """Make the row of a measured pile in the table of piles.

    Parameters
    ----------
    path : str
        The file of particles.
    pile : ParticlePile
        Its pile.

    Returns
    -------
    dict
        The row, by column.
    """
    return {
        "file": path,
        "grains": pile.n_grains,
        "particles": pile.n_particles,
        "up": pile.up,
        "base": pile.base,
        **pile.result.record(),
        **pile.other_responses,
        "note": "; ".join([*pile.warnings, *pile.notes]),
    }


def _add_responses_to_runs(
    runs: "pd.DataFrame", piles: "pd.DataFrame", bench: str
) -> "pd.DataFrame":
    """Add the measured responses of the piles to a table of runs.

    Parameters
    ----------
    runs : DataFrame
        The table of runs, as from `_read_runs`: its index is the name of each run.
    piles : DataFrame
        The table of piles, a row for each file of particles.
    bench : str
        Name of the bench test, which has the names of the responses.

    Returns
    -------
    DataFrame
        A copy of the table of runs with a column for each response. Runs without a file
        have no value there.
    """
    results = runs.copy()
    piles_by_run = piles.set_index(piles["file"].map(_find_run_name))
    for column, response in _find_photographed_piles()[bench].items():
        results[response] = results.index.map(piles_by_run[column])
    return results


def _print_particle_piles(
    rows: Iterable[Mapping[str, Any]],
    piles: Iterable["ParticlePile"],
    settings: "MeasureSettings",
    unit: str,
) -> None:
    """Print a line for each measured pile of particles, its warnings and its notes.

    Parameters
    ----------
    rows : iterable of mapping
        The rows of the table of piles.
    piles : iterable of ParticlePile
        The piles, with their warnings and notes.
    settings : MeasureSettings
        How the piles were measured. They determine along which line of a pile the angle
        is measured.
    unit : str
        The unit of lengths in the files.
    """
    from repose.measure.outline_shape import describe_doubtful_views
    from repose.measure.settings import line_of

    for row, pile in zip(rows, piles, strict=True):
        # "Height" is the label of this response in all messages.
        angle = row["aor_deg"]
        angle_text = "no angle" if angle is None else f"{format_decimals(angle)} deg"
        print(
            f"{row['file']}: {angle_text} ({line_of(settings)}), Height "
            f"{format_decimals(row['height_mm'])} mm; {row['grains']} grains, up is {row['up']}, "
            f"the plate at {format_significant(row['base'])} {unit}"
        )
        for line in (*pile.warnings, *(f"note: {note}" for note in pile.notes)):
            print(f"  {line}")
        if pile.result.n_doubtful_views > 0:
            views = describe_doubtful_views(
                pile.result.n_doubtful_views, pile.result.n_measured_views
            )
            print(f"  note: {views}")


def _find_run_name(path: str) -> str:
    """Return the name of a run, such as ``3_1``, from the name of its file."""
    return Path(path).stem


def _check_particle_options(args: argparse.Namespace) -> None:
    """Check the options that are used for files of particles.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `measure`: `unit`, `radius` and `bench`.

    Raises
    ------
    InputError
        For the first option whose value is not allowed.
    """
    from repose.measure.conventions import UNITS

    if args.unit not in UNITS:
        raise InputError(
            "command line",
            key="--unit",
            value=args.unit,
            allowed=f"one of {', '.join(UNITS)}",
        )
    if args.radius is not None and not args.radius > 0:
        raise InputError(
            "command line", key="--radius", value=args.radius, allowed="above 0"
        )
    # A pile in a file of particles is measured like that in a photograph, so the same
    # bench tests are possible.
    bench_tests = _find_photographed_piles()
    if args.bench not in bench_tests:
        raise InputError(
            "command line",
            key="--bench",
            value=args.bench,
            allowed=f"one of the bench tests that leave a pile: {', '.join(bench_tests)}",
        )


def _read_runs(path: str, files: Sequence[str]) -> "pd.DataFrame":
    """Read a table of runs, and check that each file of particles belongs to one.

    Parameters
    ----------
    path : str
        The table, with the columns `sample` and `run`.
    files : sequence of str
        Files of particles, named by sample and run.

    Returns
    -------
    DataFrame
        The table. Its index is the name of each run, such as ``3_1``.

    Raises
    ------
    InputError
        If a file has no row, or two files have the same name.
    """
    from repose.common.files import read_table

    runs = read_table(path, ("sample", "run"))
    # `_find_run_name` returns names of the same form.
    runs.index = runs["sample"].astype(str) + "_" + runs["run"].astype(str)
    names = [_find_run_name(file) for file in files]
    for file, name in zip(files, names, strict=True):
        if name not in runs.index:
            raise InputError(
                "command line",
                key="--runs",
                value=path,
                allowed=(
                    f"a row for {file}; the name of a file gives its sample and run, as "
                    "3_1.csv does"
                ),
            )
        if names.count(name) != 1:
            raise InputError(
                "command line",
                # The files of particles are the values of this argument.
                key="pictures",
                value=file,
                allowed="one file for each run",
            )
    return runs


def _find_photographed_piles() -> dict[str, Mapping[str, str]]:
    """Find the bench tests whose piles can be photographed.

    Returns
    -------
    dict of str to mapping
        For each bench test by name, a mapping from the numbers that are measured in a
        photograph to the responses of the bench test, such as ``aor_deg``.
    """
    from repose.bench import bench_tests

    return {test.name: test.photographed for test in bench_tests() if test.photographed}


def _check_bench_options(args: argparse.Namespace, pile_tests: Iterable[str]) -> None:
    """Reject an unknown bench test, and options that this bench test does not use.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `measure`.
    pile_tests : iterable of str
        Names of the bench tests that leave a pile. The photographs of other bench tests
        show a drum or a box.
    """
    from repose.bench.photographs import RESPONSES  # slow to import

    # The keys of `RESPONSES` are the bench tests whose photographs show a bed of grains
    # in a drum or a box.
    known = (*pile_tests, *RESPONSES)
    if args.bench not in known:
        raise InputError(
            "command line",
            key="--bench",
            value=args.bench,
            allowed=f"one of {', '.join(known)}",
        )

    # A pile does not use the options of a bed, and a bed not those of a pile.
    unused_options = BED_OPTIONS if args.bench in pile_tests else PILE_OPTIONS
    for name in unused_options:
        value = getattr(args, name)
        # An option that was not given is None or an empty list. A length or a scale of
        # 0 is of no use either.
        if value:
            option = f"--{name.replace('_', '-')}"
            raise InputError(
                "command line",
                key=option,
                value=value,
                allowed=f"nothing with --bench {args.bench}",
            )


def _select_readable_pictures(names: Iterable[str]) -> list[Path]:
    """Select the pictures that can be read, and print why others are left out.

    Parameters
    ----------
    names : iterable of str
        Paths of the pictures.

    Raises
    ------
    InputError
        If no picture can be read.
    """
    from repose.measure.photographs.photograph import split_readable

    pictures, faults = split_readable([Path(name) for name in names])
    if not pictures:
        raise_together(faults)
    for fault in faults:
        print(f"repose: left out: {fault}", file=sys.stderr)
    return pictures


def _choose_overlay_paths(pictures: list[Path], out: str) -> list[Path]:
    """Choose where to write the overlay of each photograph, and check all paths.

    An overlay is a copy of a photograph that shows what was measured.

    Parameters
    ----------
    pictures : list of Path
        The photographs.
    out : str
        The folder of the overlays.

    Returns
    -------
    list of Path
        The path of a PNG for each photograph, with the same name except for the suffix.

    Raises
    ------
    InputError
        If two overlays have the same path, a picture is given twice, or an overlay
        would replace a picture or a file of the user.
    """
    from repose.common.ledger import check_replaceable

    overlays = [Path(out) / f"{path.stem}.png" for path in pictures]
    # Copies of the same file have the same hash.
    hashes = [hash_file(path) for path in pictures]
    for path, overlay, content_hash in zip(pictures, overlays, hashes, strict=True):
        # No two pictures may have the same name or the same content.
        if overlays.count(overlay) != 1:
            raise InputError(
                "command line",
                key="pictures",
                value=path.name,
                allowed="photographs whose names differ",
            )
        if hashes.count(content_hash) != 1:
            raise InputError(
                "command line",
                key="pictures",
                value=path.name,
                allowed="each picture once: this is a copy",
            )

        # An overlay must replace neither its picture nor another file of the user.
        check_replaceable(overlay)
        if overlay.resolve() == path.resolve():
            raise InputError(
                "command line",
                key="--out",
                value=out,
                allowed="another folder than that of the photographs",
            )
    return overlays


def _measure_piles(
    args: argparse.Namespace,
    pictures: list[Path],
    overlays: list[Path],
    scale: "Scale",
    settings: "MeasureSettings",
) -> None:
    """Measure photographs of piles; write overlays and tables, and print the result.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `measure`. `lens`, `out`, `doubtful`, `bench` and
        `json` are used.
    pictures : list of Path
        The photographs.
    overlays : list of Path
        Where to write the overlay of each photograph.
    scale : Scale
        The scale of the photographs, or how to find it.
    settings : MeasureSettings
        How a pile is measured.

    Raises
    ------
    InputError
        If no photograph has a pile that can be measured.
    """
    from repose.measure.photographs.photograph import measure_photographs
    from repose.measure.photographs.tables import (
        convert_to_records,
        describe_results,
        make_tables,
        write_tables,
    )

    # Measure the photographs. Write the overlays before the next check: if no
    # photograph can be measured, they show why.
    lens_pictures = [Path(name) for name in args.lens]
    photographs = measure_photographs(
        pictures, settings, scale=scale, lens_paths=lens_pictures
    )
    _write_overlays(photographs, overlays)
    _require_measured_pile(photographs, overlays)

    # Write and print the numbers. With --doubtful, all doubtful photographs are included
    # in the means.
    out = Path(args.out)
    results = make_tables(photographs, settings, args.doubtful)
    responses = _find_photographed_piles()[args.bench]
    write_tables(results, settings, out=out, bench=args.bench, responses=responses)
    if args.json:
        print(format_json(convert_to_records(results)))
    else:
        print(describe_results(photographs, results, settings=settings, out=out))


def _write_overlays(
    photographs: Sequence["Photograph"], overlays: Sequence[Path]
) -> None:
    """Draw what was measured into each photograph, and write the pictures.

    For a photograph without a measurable pile, the overlay shows the area that was
    taken for the pile.

    Parameters
    ----------
    photographs : sequence of Photograph
        The results.
    overlays : sequence of Path
        The file of each overlay.
    """
    from repose.common.files import write_image
    from repose.measure.photographs import drawing

    for photograph, path in zip(photographs, overlays, strict=True):
        if photograph.measurement is None:
            image = drawing.draw_rejected_overlay(photograph.view, photograph.pile)
        else:
            image = drawing.overlay(photograph.view, photograph.measurement)
        write_image(path, image)


def _require_measured_pile(
    photographs: Sequence["Photograph"], overlays: Sequence[Path]
) -> None:
    """Raise an InputError unless some photograph has a pile that was measured.

    The message has a line for each reason to reject a photograph. A missing scale comes
    before the fault of the pile, because it may be the cause.
    """
    if any(photograph.measurement is not None for photograph in photographs):
        return
    faults = []
    for photograph, overlay in zip(photographs, overlays, strict=True):
        if photograph.lacks_scale:
            faults.append(
                InputError(
                    photograph.path, key="scale", value="unknown", allowed=SCALES
                )
            )
        if photograph.rejection_reason:
            fault = InputError(
                photograph.path,
                key="pile",
                value=photograph.rejection_reason,
                allowed=f"{EXPECTED_PILE} ({overlay} shows what was found)",
            )
            faults.append(fault)
    raise_together(faults)


def _measure_beds(
    args: argparse.Namespace,
    pictures: list[Path],
    overlays: list[Path],
    settings: "MeasureSettings",
) -> None:
    """Measure photographs of a drum or a box; write overlays and tables, and print.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `measure`. `config`, `bench`, `points`, `out` and
        `json` are used. The study of --configfile has the sizes of the drum or the box.
    pictures : list of Path
        The photographs.
    overlays : list of Path
        Where to write the overlay of each photograph.
    settings : MeasureSettings
        How an angle is measured.

    Raises
    ------
    InputError
        If there is no study, or no photograph can be measured.
    """
    from repose.bench import photographs
    from repose.bench.settings import SceneSettings
    from repose.bench.turning import TurningSettings
    from repose.common.files import write_image, write_table
    from repose.measure.photographs.tables import convert_to_records, write_tables

    if args.config is None:
        raise InputError(
            "command line",
            key="--configfile",
            value=None,
            allowed=f"a study whose section {args.bench} has the dimensions",
        )
    scene = SceneSettings(load_study(args).config)
    # A study without a section of this bench test is an error.
    require_section(scene.config, args.bench)

    # Measure the photographs, and show in an overlay what was measured.
    results = photographs.measure_all(
        pictures,
        points_px=args.points or (),
        settings=scene,
        bench=args.bench,
        pile_settings=settings,
    )
    for result, overlay in zip(results, overlays, strict=True):
        write_image(overlay, photographs.stack_views(result.views))
    _require_measured_bed(results, args.bench)

    # Write the tables. `write_tables` needs the response of each measured number. For a
    # bed, both have the same name.
    out = Path(args.out)
    tables = photographs.make_tables(results, args.bench)
    responses = {name: name for name in photographs.RESPONSES[args.bench]}
    write_tables(tables, settings, out=out, bench=args.bench, responses=responses)
    # The bench test `turning` is the turning drum.
    if args.bench == "turning":
        turning = scene.section("turning", TurningSettings)
        profile = photographs.find_median_profile(results, turning)
        write_table(out / PROFILE_TABLE_FILE, profile)

    if args.json:
        print(format_json(convert_to_records(tables)))
    else:
        print(photographs.describe_results(results, tables, out))


def _require_measured_bed(results: Sequence["PhotographResult"], bench: str) -> None:
    """Raise an InputError unless some photograph has a bed that was measured.

    The message has the reason for each photograph.
    """
    if not all(result.refused for result in results):
        return
    raise_together(
        InputError(
            result.path,
            key=bench,
            value=result.refused,
            allowed="a bed with a surface that differs from its background",
        )
        for result in results
    )


def _read_scale(args: argparse.Namespace) -> "Scale":
    """Read the scale of the photographs from the options.

    The options --mm-per-pixel and --length give the scale directly. Without them the
    scale is found later, from the printed sheet of squares in each photograph.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `measure`.

    Returns
    -------
    Scale
        The size of a pixel. If it is still unknown, only the size of the squares from
        which it is found.

    Raises
    ------
    InputError
        If options contradict each other, or a number is not allowed.
    """
    from repose.measure.photographs.photograph import Scale

    if args.length and args.mm_per_pixel is not None:
        raise InputError(
            "command line",
            key="--length",
            value=args.length,
            allowed="without --mm-per-pixel",
        )
    _require_between("--square-mm", args.square_mm, low=1, high=1000)
    if args.length:
        # This also checks that --lens was not given.
        return _compute_scale_from_length(args)
    if args.mm_per_pixel is not None:
        _require_between("--mm-per-pixel", args.mm_per_pixel, *PIXEL_SIZE_LIMITS_MM)
        _reject_lens(args)
        return Scale(args.square_mm, args.mm_per_pixel, args.base_row)
    return Scale(args.square_mm, base_row=args.base_row)


def _compute_scale_from_length(args: argparse.Namespace) -> "Scale":
    """Compute the scale of photographs from a level line of known length.

    Parameters
    ----------
    args : argparse.Namespace
        The options of the subcommand `measure`. `length` has the length in mm, then
        column and row of each end in pixels. `square_mm` and `base_row` are passed on,
        and `lens` must be empty.

    Returns
    -------
    Scale
        The size of a pixel, the angle by which the line is tilted, and its ends.

    Raises
    ------
    InputError
        If the line is too short or not level, if its scale is out of range, or if
        --lens was given.
    """
    from repose.measure.photographs.photograph import (
        LARGEST_LEVEL_DEG,
        SHORTEST_LENGTH_PX,
        Scale,
        measure_level_length,
    )

    # Column and row of the left end, then of the right end.
    length_mm, *ends_px = args.length
    _require_between("--length", length_mm, low=1, high=1e5)
    result = measure_level_length(length_mm, *ends_px)
    if result is None:
        raise InputError(
            "command line",
            key="--length",
            value=args.length,
            allowed=(
                f"ends at least {SHORTEST_LENGTH_PX} pixels apart, the left one first, on "
                f"a line that is level within {LARGEST_LEVEL_DEG:g} degrees"
            ),
        )
    mm_per_pixel, level_deg = result
    _require_between("--length", mm_per_pixel, *PIXEL_SIZE_LIMITS_MM)
    _reject_lens(args)
    return Scale(
        args.square_mm,
        mm_per_pixel,
        base_row=args.base_row,
        level_deg=level_deg,
        ends=tuple(ends_px),
    )


def _reject_lens(args: argparse.Namespace) -> None:
    """Raise an InputError if --lens was given, which needs the printed sheet.

    Call this function if the scale does not come from the sheet.
    """
    if args.lens:
        raise InputError(
            "command line",
            key="--lens",
            value=args.lens,
            allowed="only photographs whose scale comes from the printed sheet",
        )


def _require_between(option: str, value: float, low: float, high: float) -> None:
    """Raise an InputError if the number of an option is outside a range."""
    if not low <= value <= high:
        raise InputError(
            "command line",
            key=option,
            value=value,
            allowed=f"a number from {low:g} to {high:g}",
        )


def _make_measure_settings(args: argparse.Namespace) -> "MeasureSettings":
    """Make the settings of the measurement from the study of --configfile and the options.

    Without a study the settings are the defaults. The height of a grain
    (`berry_height_mm`) comes from the first of these sources that has it: the option
    --grain-mm, the settings of the study, the measured sizes. The measured sizes are
    those of the study. Without a study they are in the file sizes.csv in the working
    folder, if there is one.

    Parameters
    ----------
    args : argparse.Namespace
        The options `config` and `grain_mm`.

    Returns
    -------
    MeasureSettings
    """
    from repose.measure.settings import MeasureSettings

    if args.grain_mm is not None:
        _require_between("--grain-mm", args.grain_mm, low=0.1, high=1000)

    # Find the settings, and the table of measured sizes if there is one.
    if args.config is None:
        settings = MeasureSettings.with_defaults()
        sizes_csv = SIZES_FILE if Path(SIZES_FILE).is_file() else None
        keeps_volume = True
    else:
        study = load_study(args).settings
        settings = study.measure
        sizes_csv = study.berry.sizes
        keeps_volume = study.berry.keeps_volume

    # Set the height of a grain. The settings are immutable, so make a changed copy.
    if args.grain_mm is not None:
        return settings.model_copy(update={"berry_height_mm": args.grain_mm})
    if settings.berry_height_mm is None and sizes_csv is not None:
        return settings.for_grain(_read_mean_axes(sizes_csv, keeps_volume))
    return settings


def _read_mean_axes(sizes_csv: str, keeps_volume: bool) -> dict[str, float]:
    """Read a table of measured sizes, and compute the axes of the mean grain.

    Parameters
    ----------
    sizes_csv : str
        The table.
    keeps_volume : bool
        Whether the mean grain has the mean volume.

    Returns
    -------
    dict of str to float
        The axes by name [mm].

    Raises
    ------
    InputError
        If the table is faulty. The message also names the option --grain-mm, which
        makes the table unnecessary.
    """
    from repose.grain.berry import compute_mean_axes
    from repose.grain.berry_files import read_sizes

    try:
        sizes = read_sizes(sizes_csv)
    except InputError as error:
        raise InputError(
            error.source,
            key=error.key,
            value=error.value,
            allowed=f"{error.allowed}; or give the size of a grain by --grain-mm",
        ) from None
    return compute_mean_axes(sizes, keeps_volume)


@subcommand(
    Option(
        "--square-mm",
        type=float,
        default=20.0,
        help="side of a square in mm, from 5 to 25 (20)",
    ),
    out="sheet.pdf",
    config=False,
)
def marker(args: argparse.Namespace) -> None:
    """Write the sheet (PDF, A4) for the scale, tilt and lens of a photograph.

    The sheet has a pattern of squares. It is printed and photographed with the pile, so
    that the size of a pixel, the tilt of the camera and the distortion of its lens can
    be found.

    Examples
    --------
    $ repose marker --out sheet.pdf
    """
    from repose.common.files import write_bytes
    from repose.measure.photographs import sheet

    _require_between("--square-mm", args.square_mm, 5, 25)
    if Path(args.out).suffix.lower() != ".pdf":
        raise InputError(
            "command line",
            key="--out",
            value=args.out,
            allowed="a file that ends with .pdf",
        )
    write_bytes(args.out, sheet.make_pdf(args.square_mm))
    print(
        f"print {args.out} at 100 %, check its line of 100 mm, and cut it out; see "
        "`repose docs photographs`"
    )


@subcommand(
    Option(
        "heap",
        help=".npz file that `repose heap` or `repose stage pour` wrote; the run with its "
        "first seed is shown",
    ),
    Option(
        "--particle", required=True, help="particle.json, the shape of these grains"
    ),
    Option(
        "--azimuth", type=float, default=0.0, help="direction of view in degrees (0)"
    ),
    out="silhouette.png",
)
def silhouette(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Draw the side view of a simulated pile, dark on light.

    Examples
    --------
    $ repose stage silhouette results/try/heap.npz --particle results/berry/particle.json
    """
    from repose.common.files import write_image
    from repose.grain.particle import Particle
    from repose.measure.saved_piles import draw_side_view
    from repose.measure.saved_pours import read_first_pour

    if not math.isfinite(args.azimuth):
        raise InputError(
            "command line",
            key="--azimuth",
            value=args.azimuth,
            allowed="a finite angle",
        )
    settings = study.settings.measure
    pile = read_first_pour(args.heap)
    particle = Particle.load(args.particle)
    picture = draw_side_view(
        pile, particle, settings=settings, azimuth_deg=args.azimuth
    )
    write_image(args.out, picture)


@subcommand(
    Option("picture", help="side view that `repose stage silhouette` wrote"),
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
    """Measure a drawn side view of a pile in the same way as a photograph.

    Examples
    --------
    $ repose stage measure_silhouette silhouette.png --overlay overlay.png
    """
    from repose.common.files import write_image, write_json
    from repose.grain.berry_files import read_grain
    from repose.measure import pile
    from repose.measure.photographs import drawing

    # Some of the angles depend on the height of a grain.
    grain = read_grain(args.berry)
    settings = study.settings.measure.for_grain(grain)
    image = pile.read_image(args.picture)
    try:
        measurement = pile.measure_image(image, settings.mm_per_pixel, settings)
    except pile.NoFlankError as error:
        raise InputError(
            args.picture, key="pile", value=str(error), allowed=EXPECTED_PILE
        ) from None
    write_image(args.overlay, drawing.overlay(image, measurement))
    write_json(args.out, measurement.record())

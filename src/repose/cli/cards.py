"""Verbs of the material card: the answer of a calibration as one file."""

import argparse

from repose.cli.options import BERRY, FEASIBLE, require_option
from repose.cli.registry import Option, verb
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig

FILES_OF = {"show": 1, "compare": 2, "check": 1, "find": 0}
NOT_MET = 3  # exit status of `card check` where the targets are not met
FILES = ("berry", "particle", "feasible", "table4", "posterior", "draws", "dataset")
MIGA, VALIDATION = "results/miga/summary.json", "results/validation/representative.csv"


@verb(
    Option(
        "action",
        choices=tuple(FILES_OF),
        help="show FILE, compare FILE OTHER, check FILE, or find --like",
    ),
    # cards of different engines may be compared
    Option("cards", nargs="*", help="card.json of a finished study", recorded=False),
    Option(
        "--like",
        metavar="6x3x2.6",
        help="find: full axes of the grain in mm, or the diameter of a sphere",
    ),
    Option("--density", type=float, metavar="KG_M3", help="find: density of the grain"),
    config=False,
)
def card(args: argparse.Namespace) -> int:
    """Show a material card, the answer of a study as one file, compare two, or check whether the targets are met.

    Status 0, or 3 where they are not met or this was not simulated; or find the card of a similar grain.

    example: show results/card.json
    """
    from repose.common import faults
    from repose.config.models import settings_type
    from repose.stages import card, card_library, card_text

    if len(args.cards) != FILES_OF[args.action]:
        raise InputError(
            "command line",
            f"card {args.action}",
            args.cards,
            f"files: {FILES_OF[args.action]}",
        )
    allowed = (
        "the axes of the grain, such as 6x3x2.6"
        if args.action == "find"
        else "`card find` alone"
    )
    require_option(
        (args.action == "find") == (args.like is not None), "--like", args.like, allowed
    )
    require_option(
        args.action == "find" or args.density is None,
        "--density",
        args.density,
        allowed,
    )
    if args.action == "find":
        bounds = faults.subschema(["berry", "density_kg_m3"], settings_type())
        good = (
            args.density is None
            or bounds["minimum"] <= args.density <= bounds["maximum"]
        )
        require_option(
            good, "--density", args.density, f"{faults.allowed_by(bounds)}, in kg/m3"
        )
        print(
            "\n".join(card_library.found(card_library.axes_of(args.like), args.density))
        )
        return 0
    cards = [card.read(path) for path in args.cards]
    if args.action == "check":
        print(card_text.verdict(cards[0]))
        return 0 if cards[0]["met"] else NOT_MET
    print(
        card_text.describe(cards[0])
        if args.action == "show"
        else card_text.compared(*cards)
    )
    return 0


@verb(
    BERRY,
    Option(
        "--particle",
        default="results/berry/particle.json",
        help="file of the verb shape",
    ),
    FEASIBLE,
    Option("--summary", default=MIGA, help="file of the verb miga: the answer"),
    Option(
        "--representative",
        default=VALIDATION,
        help="file of the verb validate: the check of the answer",
    ),
    Option(
        "--table4",
        help="table4.csv of the same verb: the piles by every definition of the angle",
    ),
    Option(
        "--posterior",
        help="posterior.csv; with --draws its intervals and correlations stand in the card",
    ),
    Option("--draws", help="draws.csv of the same posterior"),
    Option(
        "--dataset",
        help="dataset.csv of the study's design: what angles its piles have",
    ),
    out="results/card.json",
)
def material_card(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Write the material card of a finished calibration.

    example: --out results/card.json
    """
    from repose.stages import answer, card

    if (args.posterior is None) != (args.draws is None):
        raise InputError(
            "command line", "--posterior", args.posterior, "together with --draws"
        )
    settings = study.settings
    result = answer.read(
        args.summary,
        args.representative,
        args.feasible,
        label=settings.label,
        targets=study.targets,
        measure=settings.measure,
        strategy=settings.strategy,
        results_dir=settings.results_dir,
        small_run=settings.small_run,
    )
    card.run(study, result, {name: getattr(args, name) for name in FILES}, args.out)

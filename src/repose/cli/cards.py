"""Subcommands of the material card: the answer of a calibration as one file."""

import argparse

from repose.cli.options import BERRY, FEASIBLE
from repose.cli.registry import Option, subcommand
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig

# Number of cards that each action needs.
N_CARDS = {"show": 1, "compare": 2, "check": 1}
# Exit statuses of `card check`: some targets are not met, or the check is undecided
# because it has too few runs or none.
NOT_MET_STATUS = 3
UNDECIDED_STATUS = 4
# The options of `material_card` that name a file whose content becomes a part of the
# card.
FILE_OPTIONS = (
    "berry",
    "particle",
    "feasible",
    "table4",
    "posterior",
    "draws",
    "dataset",
    "published",
    "published_simulated",
)
SUMMARY_PATH = "results/miga/summary.json"
REPRESENTATIVE_PATH = "results/validation/representative.csv"


@subcommand(
    Option(
        "action",
        choices=tuple(N_CARDS),
        help="show FILE, compare FILE OTHER, or check FILE",
    ),
    # Do not record the cards, because cards of different engines may be compared.
    Option("cards", nargs="*", help="card.json of a finished study", recorded=False),
    config=False,
)
def card(args: argparse.Namespace) -> int:
    """Show a material card, compare two cards, or check one.

    A card is the answer of a study as one file. A check says whether the targets are
    met. Its exit status is 0 if they are met, 3 if they are not met, and 4 if this is
    undecided or was not simulated. A card whose entries contradict each other, as after
    an edit by hand, is refused with the status 2.

    Examples
    --------
    $ repose card show results/card.json
    """
    from repose.stages import card as card_file
    from repose.stages import card_text

    n_cards = N_CARDS[args.action]
    if len(args.cards) != n_cards:
        noun = "file" if n_cards == 1 else "files"
        raise InputError(
            "command line",
            key=f"card {args.action}",
            value=args.cards,
            allowed=f"{n_cards} {noun}",
        )
    cards = [card_file.read_card(path) for path in args.cards]

    if args.action == "compare":
        print(card_text.compare_cards(*cards))
        return 0
    (only_card,) = cards
    if args.action == "show":
        print(card_text.describe_card(only_card))
        return 0

    # The action is check. The exit status says whether the targets are met. `met` is
    # None if this is undecided.
    print(card_text.format_verdict(only_card))
    are_targets_met = card_text.get_verdict(only_card).met
    if are_targets_met is None:
        return UNDECIDED_STATUS
    return 0 if are_targets_met else NOT_MET_STATUS


@subcommand(
    BERRY,
    Option(
        "--particle",
        default="results/berry/particle.json",
        help="file of the subcommand shape",
    ),
    FEASIBLE,
    Option(
        "--summary",
        default=SUMMARY_PATH,
        help="file of the subcommand miga, with the calibrated parameter set (the answer)",
    ),
    Option(
        "--representative",
        default=REPRESENTATIVE_PATH,
        help="file of the subcommand validate, which compares new runs of the answer with "
        "the targets",
    ),
    Option(
        "--table4",
        help="table4.csv of the subcommand validate, with the angle of the piles by every "
        "definition",
    ),
    Option(
        "--posterior",
        help="posterior.csv; the card then has the intervals and correlations of the "
        "posterior, and --draws must be given, too",
    ),
    Option("--draws", help="draws.csv of the same posterior"),
    Option(
        "--dataset",
        help="dataset.csv of the study; its piles help to judge whether piles of these "
        "grains can have the angle of a target, and the card counts its samples that meet "
        "all targets",
    ),
    Option(
        "--published",
        help="table of published parameter sets; the card then has the recommended one",
    ),
    Option(
        "--published-simulated",
        help="published.csv of the subcommand validate, with these sets simulated here",
    ),
    out="results/card.json",
)
def material_card(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Write the material card of a finished calibration.

    A material card is one file with the grain, the contact laws, the calibrated
    parameters and the check of the answer.

    Examples
    --------
    $ repose stage material_card --out results/card.json
    """
    from repose.stages import answer, card_study

    # Intervals need both files of the posterior.
    if (args.posterior is None) != (args.draws is None):
        raise InputError(
            "command line",
            key="--posterior",
            value=args.posterior,
            allowed="together with --draws",
        )
    settings = study.settings
    result = answer.read_answer(
        args.summary,
        args.representative,
        args.feasible,
        label=settings.label,
        targets=study.targets,
        measure=settings.measure,
        strategy=settings.strategy,
        results_dir=settings.results_dir,
        small_run=settings.small_run,
        parameter_names=study.parameter_names,
    )
    # The values of these options are paths, or None if an option was not given.
    files = {name: getattr(args, name) for name in FILE_OPTIONS}
    card_study.write_card(study, result, files=files, out=args.out)

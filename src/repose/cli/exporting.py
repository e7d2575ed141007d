"""The subcommand that writes the answer as input for other simulation programs."""

import argparse
import copy
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from repose.cli.parameter_sets import PARAMETER_SET, read_parameters
from repose.cli.registry import (
    CONFIG,
    DEFAULT_CONFIG_FILE,
    Option,
    load_study,
    subcommand,
)
from repose.cli.stages import note_built_in_crop
from repose.common import provenance
from repose.common.errors import InputError
from repose.common.section import AUTO
from repose.config.pipeline import PipelineConfig
from repose.export import PROGRAMS, write_deck

if TYPE_CHECKING:
    from repose.grain.particle import Particle

# Number of spheres in a clump: the default and the largest number.
DEFAULT_SPHERES = 14
MOST_SPHERES = 64

Card = Mapping[str, Any]


@subcommand(
    CONFIG.with_changes(
        default=None,
        help="the study's configuration (default: config.json in the folder of the card, "
        "if it is there)",
    ),
    Option(
        "--to",
        required=True,
        type=str.lower,
        choices=list(PROGRAMS),
        help="the program",
    ),
    Option("--card", help="card.json of the finished study: its parameters"),
    *PARAMETER_SET,
    Option(
        "--spheres",
        type=int,
        metavar="N",
        help="number of spheres that represent a grain, or 1 for a sphere of the grain's "
        "volume (default: as in the study if it simulates a clump, 1 for a spherical "
        f"grain, otherwise {DEFAULT_SPHERES})",
    ),
    Option(
        "--seed", type=int, default=1, help="seed of the positions of the grains (1)"
    ),
    Option(
        "--names",
        nargs="+",
        default=[],
        metavar="NAME",
        help="parameters whose numbers are replaced by their names, which makes the input "
        "file a template for the section `simulator` of a study",
    ),
    out="results/export",
    config=False,
)
def export(args: argparse.Namespace) -> None:
    """Write the calibrated grain and its pour for another program.

    The result is an input script (deck) of this program, or a table.

    Examples
    --------
    $ repose export --to yade --card results/card.json --configfile results/config.json --out results/export/yade
    """
    from repose.export.job import Job, make_job
    from repose.export.template import write_template
    from repose.stages.card_study import read_repose_card

    # Read the study, the card, or both. Faults of the configuration are reported before
    # those of the options. Without either, use the default configuration. From here on,
    # `args.config` is the file that messages name.
    study = None if args.config is None else load_study(args)
    _require_one_parameter_option(args)
    _check_numbers(args)
    card = None if args.card is None else read_repose_card(args.card)
    if study is None and card is None:
        note_built_in_crop()
        args.config = DEFAULT_CONFIG_FILE
        study = load_study(args)
    elif study is None:
        study = _load_study_beside_card(args)

    source = _choose_export_source(args, study, card)
    values = _choose_parameter_values(args, study, card)

    def make_job_with(parameters: Mapping[str, float]) -> Job:
        """Make the simulation to export, for any values of the parameters."""
        return make_job(
            config=source.config,
            parameters=parameters,
            particle=source.particle,
            grain=source.grain,
            seed=args.seed,
            one_sphere=source.one_sphere,
        )

    # With --names, write a template, for which the simulation is made with several
    # values of the parameters.
    if args.names:
        paths = write_template(
            make_job_with, values, names=args.names, program=args.to, folder=args.out
        )
    else:
        paths = write_deck(make_job_with(values), args.to, args.out)
    for path in paths:
        print(path)


def _require_one_parameter_option(args: argparse.Namespace) -> None:
    """Raise an InputError unless exactly one option gives the parameters.

    A template needs no such option. In a template the parameters of --names have no
    values, and all others have the centre of their range.
    """
    has_card = args.card is not None
    has_values = bool(args.set) or args.samples is not None
    if has_card and has_values:
        raise InputError(
            "command line",
            key="--card",
            value=args.card,
            allowed="no --set or --samples with it, which also give the parameters",
        )
    if not (has_card or has_values or args.names):
        raise InputError(
            "command line",
            key="--card",
            value=args.card,
            allowed="the card of a finished study, or parameters by --set or --samples",
        )


def _check_numbers(args: argparse.Namespace) -> None:
    """Raise an InputError if the seed or the number of spheres is out of range."""
    if args.seed < 0:
        raise InputError(
            "command line",
            key="--seed",
            value=args.seed,
            allowed="a whole number from 0",
        )
    if args.spheres is not None and not 1 <= args.spheres <= MOST_SPHERES:
        raise InputError(
            "command line",
            key="--spheres",
            value=args.spheres,
            allowed=f"from 1 to {MOST_SPHERES}",
        )


def _load_study_beside_card(args: argparse.Namespace) -> PipelineConfig | None:
    """Load the study whose configuration is in the folder of a card, if there is one.

    A card is the file with the answer of a study, and is enough for an export. The card
    may have been moved to a place where the files of its study are missing. Therefore
    an error of the study is only printed as a note.

    Parameters
    ----------
    args : argparse.Namespace
        The options; `card` is the path of the card. This function sets `config`, which
        messages name, to the file of the study. If the study has faults, `config`
        becomes None.

    Returns
    -------
    PipelineConfig or None
        The study; None if there is none in this folder, or if it has faults.
    """
    from repose.stages.card_study import find_configuration

    path = find_configuration(args.card)
    if path is None:
        return None
    args.config = str(path)
    try:
        study = load_study(args)
        # Test whether the files of the study can be read. The property `grain` reads
        # them when it is first used, and keeps the grain for later.
        _ = study.grain
    except InputError as error:
        args.config = None
        first_line, *_ = str(error).splitlines()
        print(
            f"repose: note: {first_line}; the export uses the card alone",
            file=sys.stderr,
        )
        return None
    return study


def _choose_parameter_values(
    args: argparse.Namespace, study: PipelineConfig | None, card: Card | None
) -> dict[str, float]:
    """Read the parameters from the card, or if there is none, from the options.

    Parameters
    ----------
    args : argparse.Namespace
        The options.
    study : PipelineConfig or None
        The study; None only with a card.
    card : mapping or None
        The card of --card, if there is one.

    Returns
    -------
    dict of str to float
        Values by name.
    """
    if card is not None:
        return {name: entry["value"] for name, entry in card["parameters"].items()}
    assert study is not None
    return read_parameters(args.set, args.samples, sample=args.sample, study=study)


# --- the grain ------------------------------------------------------------------------


class _ExportSource(NamedTuple):
    """What is exported besides the parameters.

    Attributes
    ----------
    config : mapping
        The resolved configuration.
    grain : mapping
        The mean grain, as in berry.json.
    particle : Particle
        The body of the grain.
    one_sphere : bool
        Whether the particle is replaced by a sphere of the same volume.
    """

    config: Mapping[str, Any]
    grain: Mapping[str, Any]
    particle: "Particle"
    one_sphere: bool


def _choose_number_of_spheres(
    args: argparse.Namespace, particle: "Particle"
) -> int | None:
    """Choose the number of spheres that represent the grain.

    Parameters
    ----------
    args : argparse.Namespace
        The options; --spheres gives the number.
    particle : Particle
        The body of the grain in the study or on the card.

    Returns
    -------
    int or None
        If it is 1, the grain becomes a sphere of the same volume. If it is larger, the
        grain becomes a clump of this many spheres. If it is None, the particle is
        already a clump or a sphere, and is not changed.
    """
    from repose.export.job import is_sphere

    if args.spheres:
        return int(args.spheres)
    if particle.is_clump or is_sphere(particle):
        return None
    return DEFAULT_SPHERES


def _choose_export_source(
    args: argparse.Namespace, study: PipelineConfig | None, card: Card | None
) -> _ExportSource:
    """Choose the grain to export, that of the study or that of the card.

    A card is the file with the answer of a study. If there is a study, its grain is
    exported, and the card must belong to the same study. Otherwise the grain is rebuilt
    from the card.

    Parameters
    ----------
    args : argparse.Namespace
        The options.
    study : PipelineConfig or None
        The study; None only with a card.
    card : mapping or None
        The card of --card, if there is one.

    Returns
    -------
    _ExportSource
        The configuration, and the grain converted to spheres.

    Raises
    ------
    InputError
        If the card and the configuration belong to different studies.
    """
    from repose.stages.card_study import require_same_study

    if study is None:
        # `export` makes sure that there is a study or a card.
        assert card is not None
        return _make_source_of_card(args, card)
    source = _make_source_of_study(args, study)
    if card is not None:
        require_same_study(
            card, args.card, study=study, source=args.config, grain=source.grain
        )
    return source


def _make_source_of_study(
    args: argparse.Namespace, study: PipelineConfig
) -> _ExportSource:
    """Make what is exported of a study: its configuration, and its grain as spheres.

    Other programs simulate only spheres.

    Parameters
    ----------
    args : argparse.Namespace
        The options; --spheres gives the number of spheres.
    study : PipelineConfig
        The study.

    Returns
    -------
    _ExportSource
        The configuration and the grain: one sphere, or a clump of spheres.
    """
    from repose.cli.berries import load_grain_and_particle

    grain, particle = load_grain_and_particle(study)
    # None means that the grain already consists of spheres, and 1 that a single sphere
    # replaces it, which `make_job` does.
    n_spheres = _choose_number_of_spheres(args, particle)
    if n_spheres is None:
        return _ExportSource(study.config, grain, particle, one_sphere=False)
    if n_spheres == 1:
        return _ExportSource(study.config, grain, particle, one_sphere=True)

    # Fill the mesh of the grain with spheres.
    clump_study = _replace_particle_by_clump(study, n_spheres, args.config)
    clump_grain, clump = load_grain_and_particle(clump_study)
    return _ExportSource(study.config, clump_grain, clump, one_sphere=False)


def _make_source_of_card(args: argparse.Namespace, card: Card) -> _ExportSource:
    """Make what is exported of a card: its configuration, and its grain as spheres."""
    from repose.stages import card_study

    card_particle = card_study.rebuild_particle(card, None, args.card)
    n_spheres = _choose_number_of_spheres(args, card_particle)
    return _ExportSource(
        config=card_study.rebuild_configuration(card, args.card),
        grain=card["grain"],
        particle=card_study.rebuild_particle(card, n_spheres, args.card),
        one_sphere=n_spheres == 1,
    )


def _replace_particle_by_clump(
    study: PipelineConfig, n_spheres: int, source: str
) -> PipelineConfig:
    """Make a copy of a study, with a clump of spheres as its particle.

    A clump may need a shorter time step than a smooth body, because the stiffnesses of
    its overlapping spheres add up. As a side effect, the changed configuration is noted
    for the provenance of the files that are written afterwards.

    Parameters
    ----------
    study : PipelineConfig
        The study, which is not changed.
    n_spheres : int
        Number of spheres in the clump, at least 2.
    source : str
        File of the study, for messages.

    Returns
    -------
    PipelineConfig
        The copy. Its time step is that of the study, or that of the clump if it is
        shorter.
    """
    config = copy.deepcopy(study.config)
    config["berry"] |= {
        "particle": "multisphere",
        "spheres": n_spheres,
        "surface": "smooth",
    }

    # Use the shorter of the study's time step and the one that is computed for the
    # clump. To get the latter, load the configuration once with the time step `auto`.
    study_step_s = study.settings.simulation.time_step_s
    config["simulation"]["time_step_s"] = AUTO
    clump_step_s = PipelineConfig.of(config, source).settings.simulation.time_step_s
    config["simulation"]["time_step_s"] = min(study_step_s, clump_step_s)
    provenance.note_config(config)
    return PipelineConfig.of(config, source)

"""The verb that writes the answer as input of other simulation programs."""

import argparse
import copy
import sys
from typing import TYPE_CHECKING

from repose.cli.options import require_option
from repose.cli.parameter_sets import PARAMETER_SET, parameters
from repose.cli.registry import CONFIG, Option, load, verb
from repose.common import provenance
from repose.common.errors import InputError
from repose.common.section import AUTO
from repose.config.pipeline import PipelineConfig
from repose.export import PROGRAMS, write

if TYPE_CHECKING:
    from repose.grain.particle import Particle

# Spheres of a clump: the default, and the most that fill a mesh here.
SPHERES, MOST = 14, 64


@verb(
    CONFIG.but(
        default=None,
        help="the study's configuration (default: config.json in the folder of the card, if it is there)",
    ),
    Option("--to", required=True, choices=PROGRAMS, help="the program"),
    Option("--card", help="card.json of the finished study: its parameters"),
    *PARAMETER_SET,
    Option(
        "--spheres",
        type=int,
        metavar="N",
        help="spheres of the clump; 1: the sphere of the grain's volume (default: those of the study's clump, "
        f"1 for a spherical grain, or {SPHERES})",
    ),
    Option("--seed", type=int, default=1, help="of the grains' places (1)"),
    out="results/export",
    config=False,
)
def export(args: argparse.Namespace) -> None:
    """Write the calibrated grain and its pour as a deck of another program, or as a table of its input fields.

    example: --to yade --card results/card.json --config results/config.json --out results/export/yade
    """
    from repose.cli.berries import berry_and_particle
    from repose.export.job import is_sphere, make
    from repose.stages import card_study

    study = None if args.config is None else load(args)
    allowed = "one source of the parameters: --card, --set or --samples"
    require_option(
        (args.card is None) == (bool(args.set) or args.samples is not None),
        "export",
        args.card,
        allowed,
    )
    of_card = None if args.card is None else card_study.read_own(args.card)
    require_option(args.seed >= 0, "--seed", args.seed, "a whole number from 0")
    require_option(
        args.spheres is None or 1 <= args.spheres <= MOST,
        "--spheres",
        args.spheres,
        f"from 1 to {MOST}",
    )
    if study is None:
        found = (
            None if args.card is None else card_study.configuration_of_card(args.card)
        )
        if found is not None or of_card is None:
            args.config = str(found or CONFIG.keywords["default"])
            try:
                study = load(args)
                _ = study.grain
            except (
                InputError
            ) as error:  # the study's files lie in another folder, or nowhere
                if of_card is None:
                    raise
                study = args.config = None
                print(
                    f"repose: note: {error.args[0].splitlines()[0]}; the card alone makes the deck",
                    file=sys.stderr,
                )

    def spheres_of(particle: "Particle") -> int | None:
        return args.spheres or (
            None if particle.is_clump or is_sphere(particle) else SPHERES
        )

    if study is not None:
        grain, particle = berry_and_particle(study)
        spheres = spheres_of(particle)
        if spheres is not None and spheres > 1:
            grain, particle = berry_and_particle(
                _with_clump(study, spheres, args.config)
            )
        config = study.config
        if of_card is not None:
            card_study.require_one_study(of_card, args.card, study, args.config, grain)
    elif of_card is not None:
        config, grain = (
            card_study.configuration_of(of_card, args.card),
            of_card["grain"],
        )
        spheres = spheres_of(card_study.particle_of(of_card, None, args.card))
        particle = card_study.particle_of(of_card, spheres, args.card)
    if of_card is not None:
        values = {name: row["value"] for name, row in of_card["parameters"].items()}
    else:
        assert study is not None
        values = parameters(args.set, args.samples, args.sample, study)
    job = make(config, values, particle, grain, args.seed, one_sphere=spheres == 1)
    for path in write(job, args.to, args.out):
        print(path)


def _with_clump(study: PipelineConfig, spheres: int, source: str) -> PipelineConfig:
    """Give a study a clump as its particle; its time step may have to be shorter than that of a smooth body."""
    changed = copy.deepcopy(study.config)
    changed["berry"] |= {
        "particle": "multisphere",
        "spheres": spheres,
        "surface": "smooth",
    }
    changed["simulation"]["time_step_s"] = (
        AUTO  # spheres at one place add up in stiffness
    )
    steps = [
        one.settings.simulation.time_step_s
        for one in (study, PipelineConfig.of(changed, source))
    ]
    changed["simulation"]["time_step_s"] = min(steps)
    provenance.note_config(changed)
    return PipelineConfig.of(changed, source)

"""The verb that writes the answer as input of other simulation programs."""

import argparse

from repose.cli.parameter_sets import PARAMETER_SET, parameters
from repose.cli.registry import CONFIG, Option, load, verb
from repose.core import provenance
from repose.core.errors import InputError
from repose.core.section import AUTO
from repose.export import PROGRAMS, write

# Spheres of a clump: the default, and the most that fill a mesh here.
SPHERES, MOST = 14, 64


@verb(
    "write the calibrated grain and its pour as a deck of another program, or as a table of its input fields",
    example="--to yade --card results/card.json --config results/config.json --out results/export/yade",
    out="results/export",
    config=False,
    options=[
        CONFIG.but(
            default=None,
            help="the study's configuration (default: config.json beside the card; no card: config/config.yaml)",
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
    ],
)
def export(args: argparse.Namespace) -> None:
    from repose.chain import card
    from repose.cli.berries import berry_and_particle
    from repose.config.study import Study
    from repose.export.job import is_sphere, make

    study = None if args.config is None else load(args)
    _check_source(args)
    of_card = None if args.card is None else card.read_own(args.card)
    if study is None:
        configuration = None if of_card is None else card.configuration_of_card(args.card)
        args.config = CONFIG.keywords["default"] if configuration is None else str(configuration)
        study = load(args)
    if args.seed < 0:
        raise InputError("command line", "--seed", args.seed, "a whole number from 0")
    if args.spheres is not None and not 1 <= args.spheres <= MOST:
        raise InputError("command line", "--spheres", args.spheres, f"from 1 to {MOST}")
    berry, particle = berry_and_particle(study)
    spheres = args.spheres or (None if particle.is_clump or is_sphere(particle) else SPHERES)
    if spheres is not None and spheres > 1:
        filled = {"particle": "multisphere", "spheres": spheres, "surface": "smooth"}
        # spheres at one place add up in stiffness, so their step may have to be shorter than that of a smooth body
        step_s = study.config["simulation"]["time_step_s"]
        automatic = study.config["simulation"] | {"time_step_s": AUTO}
        changed = {"berry": study.config["berry"] | filled, "simulation": automatic}
        study = Study.of(study.config | changed, args.config)
        automatic["time_step_s"] = min(step_s, study.config["simulation"]["time_step_s"])
        study = Study.of(study.config | {"simulation": automatic}, args.config)
        provenance.note_config(study.config)
        berry, particle = berry_and_particle(study)
    config = study.config
    if of_card is None:
        values = parameters(args.set, args.samples, args.sample, config["parameters"])
    else:
        card.require_one_study(of_card, args.card, study, args.config, berry)
        values = {name: row["value"] for name, row in of_card["parameters"].items()}
    job = make(config, values, particle, berry, args.seed, one_sphere=spheres == 1)
    for path in write(job, args.to, args.out):
        print(path)


def _check_source(args: argparse.Namespace) -> None:
    """Require one source of the six parameters: a card, or the options that name them."""
    sets = bool(args.set) or args.samples is not None
    if (args.card is not None) == sets:
        allowed = "one source of the parameters: --card, --set or --samples"
        raise InputError("command line", "export", args.card, allowed)

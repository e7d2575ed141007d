"""The material card: the answer of a calibration as one file, for people and for other programs.

`card.schema.json` beside this file defines the content of a card.
"""

import json
from collections.abc import Mapping
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.apparatus.settings import SimulationSettings
from repose.chain.answer import Answer, Check
from repose.config.definitions import described
from repose.core import provenance
from repose.core.errors import InputError, raise_together
from repose.core.files import read_json, read_table, write_json
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import LABELS, PARAMETERS
from repose.core.targets import Targets

if TYPE_CHECKING:
    import pandas as pd

    from repose.particle.particle import Particle

SCHEMA_PATH = Path(__file__).with_name("card.schema.json")
POSTERIOR, RANGE = "central 95 % of the posterior", "range of the parameter sets found"
WHAT = "a material card"
OK = "ok"
FEWEST_RUNS = 2  # successful runs of each bench test, for the probability that the targets are met
GRAIN = ("density_kg_m3", "elastic_modulus_pa", "shear_modulus_pa", "poisson_ratio")
WALL = ("shear_modulus_pa", "poisson_ratio")
TENSION = {
    "keep": "the damped force may pull at the end of an impact",
    "release": "the force never pulls, damped so that the restitution is as set",
}
LIMIT = {"elastic": "the elastic part of the normal force", "total": "the size of the damped normal force"}


def make(
    config: Mapping[str, Any],
    answer: Answer,
    berry: Mapping[str, Any],
    particle: "Particle",
    feasible: "pd.DataFrame",
    posterior: "tuple[pd.DataFrame, pd.DataFrame] | None" = None,
) -> dict[str, Any]:
    """The card of a finished calibration.

    `berry` is the content of the file of the verb ``berry``, `feasible` the parameter sets found by the search.
    `posterior` holds intervals (`parameter`, `credible_low`, `credible_high`) and draws; without it intervals and
    correlations are those of the sets found.
    """
    space, targets = ParameterSpace.of(config["parameters"]), Targets.of(config["targets"])
    about = {
        "grain": _grain(config, berry, particle),
        "wall": {key: config["wall"][key] for key in WALL},
        "laws": laws(config),
    }
    tests = {one.name: described(config, one.response, berry) for one in targets}
    return assembled(about, tests, answer, space, targets, feasible, posterior)


def assembled(
    about: Mapping[str, Any],
    tests: Mapping[str, Mapping[str, Any]],
    answer: Answer,
    space: ParameterSpace,
    targets: Targets,
    feasible: "pd.DataFrame",
    posterior: "tuple[pd.DataFrame, pd.DataFrame] | None" = None,
) -> dict[str, Any]:
    """A card from its parts.

    `about` holds the simulated grain, wall and laws, or the name of another simulator; `tests` the `definition` and the
    `bench` of each response (`repose.config.definitions.described`). `feasible` and `posterior` as in `make`.
    """
    draws = feasible if posterior is None else posterior[1]
    ends = _ends(space, feasible, posterior)
    correlations = draws[list(space.free)].corr().fillna(0.0)
    simulated = any(check.simulated is not None for check in answer.checks)
    return {
        "card": 1,
        "material": answer.label,
        **about,
        "parameters": {
            name: {
                "meaning": LABELS.get(name, name),
                "value": answer.parameters[name],
                "low": ends[name][0],
                "high": ends[name][1],
                "given": _given(name, space),
            }
            for name in space.names
        },
        "interval": RANGE if posterior is None else POSTERIOR,
        "correlations": {
            one: {other: round(float(correlations.loc[one, other]), 4) for other in space.free}
            for one in space.free
        },
        "tests": [
            _test(check, target, about) | dict(tests[target.name])
            for check, target in _paired(answer.checks, targets)
        ],
        "met": answer.met if simulated or "simulator" not in about else None,
        **({"out_of_reach": True} if answer.out_of_reach else {}),
        "within": {f"{percent:g} %": chance for percent, chance in answer.within.items()},
        "made_by": _made_by(),
    }


def laws(config: Mapping[str, Any]) -> dict[str, str]:
    """The contact laws of a configuration as text, by direction."""
    from repose.dem.laws import CONTACT_LAWS, COULOMB, ROLLING_LAWS

    settings = SimulationSettings.of(config)
    limit = LIMIT[COULOMB[settings.tension]]
    words = {**CONTACT_LAWS[settings.contact_law].words, **ROLLING_LAWS[settings.rolling_law].words}
    told = {direction: text.format(limit=limit) for direction, text in words.items()}
    return told | {"end of an impact": TENSION[settings.tension]}


def _ends(space, feasible, posterior):
    """Interval of each parameter; (None, None) for a fixed parameter."""
    ends: dict[str, tuple[float | None, float | None]] = dict.fromkeys(space.names, (None, None))
    table = None if posterior is None else posterior[0].set_index("parameter")
    for name in space.free:
        if table is None:
            ends[name] = float(feasible[name].min()), float(feasible[name].max())
        else:
            ends[name] = float(table.loc[name, "credible_low"]), float(table.loc[name, "credible_high"])
    return ends


def _given(name, space):
    """Origin of a parameter's value."""
    if name not in space.free:
        return "fixed"
    return "calibrated from a prior" if name in space.prior else "calibrated"


def _grain(config, berry, particle):
    """The grain as simulated."""
    alike = config["berry"]["size_distribution"] == "none"
    return {
        "mean_axes_mm": [berry[key] for key in ("long_mm", "major_mm", "minor_mm")],
        "measured": int(berry["n"]),
        "relative_spread": 0.0 if alike else float(berry["scale_sd"]),
        **{key: berry[key] for key in GRAIN},
        "shape": particle.kind,
        "volume_mm3": _rounded(1e9 * particle.volume_m3),
        "mass_g": _rounded(1e3 * particle.mass_kg),
        "ellipsoids_mm": [[_rounded(1e3 * x) for x in row] for row in particle.semi_axes_m],
        "spheres_mm": [[_rounded(1e3 * x) for x in row] for row in particle.spheres_m],
    }


def _rounded(value):
    """Six digits; more are not measured."""
    return float(f"{value:.6g}")


def _paired(checks, targets):
    """Each check with its target."""
    by_name = {target.name: target for target in targets}
    return [(check, by_name[check.response]) for check in checks]


def _test(check: Check, target, about):
    """The entry of one test of the calibration."""
    return {
        "response": check.response,
        "apparatus": target.response.apparatus,
        "unit": check.unit,
        "measured": check.measured,
        "sd": check.sd,
        "repetitions": target.repetitions,
        "low": check.low,
        "high": check.high,
        "simulated": check.simulated,
        "standard_error": check.standard_error,
        "runs": check.runs,
        "status": check.status,
        "met": None if "simulator" in about and check.simulated is None else check.met,
    }


def _made_by():
    """Version, configuration, engine and seed that made the card."""
    record = provenance.current() or provenance.machine()
    return {
        "version": record["repose"],
        "commit": record["commit"],
        "configuration": record.get("settings"),
        "engine": record.get("engine"),
        "seed": record.get("seed"),
    }


def run(
    config: Mapping[str, Any],
    answer: Answer,
    files: Mapping[str, str | PathLike | None],
    out: str | PathLike,
) -> dict[str, Any]:
    """Write the card of a finished calibration (`make`) and return it.

    `files` has the paths `berry`, `particle`, `feasible`, and `posterior` and `draws`, or None for both.
    """
    from repose.particle.berry_files import SIZE_COLUMNS, read_berry
    from repose.particle.particle import Particle

    needed = (*SIZE_COLUMNS, "density_kg_m3", "elastic_modulus_pa", "shear_modulus_pa")
    berry = read_berry(_path(files, "berry"), (*needed, "n"))
    particle = Particle.load(_path(files, "particle"))
    feasible = read_table(_path(files, "feasible"), PARAMETERS)
    posterior = None
    if files.get("posterior") is not None:
        columns = ("parameter", "credible_low", "credible_high")
        free = ParameterSpace.of(config["parameters"]).free
        posterior = (
            read_table(_path(files, "posterior"), columns),
            read_table(_path(files, "draws"), free),
        )
    card = make(config, answer, berry, particle, feasible, posterior)
    check(card, out)
    write_json(out, card, indent=1)
    return card


def _path(files, name):
    """A path that must be given."""
    path = files.get(name)
    if path is None:
        raise InputError("command line", f"--{name}", None, "the path of a file")
    return path


@cache
def _validator():
    """The schema's validator."""
    import jsonschema

    return jsonschema.Draft202012Validator(json.loads(SCHEMA_PATH.read_text(encoding="utf-8")))


def check(card: Mapping[str, Any], source: object) -> None:
    """Raise InputError, for all faults at once, if the content is no card, or lacks a probability that its runs give.

    `source` names the file in the message.
    """
    faults = sorted(_validator().iter_errors(card), key=lambda error: list(map(str, error.absolute_path)))
    raise_together(
        InputError(
            source,
            ".".join(map(str, error.absolute_path)) or "content",
            error.instance if error.absolute_path else sorted(card),
            f"{WHAT}: {error.message}",
        )
        for error in faults
    )
    runs = min(test["runs"] if test["status"] == OK else 0 for test in card["tests"])
    unknown = [percent for percent, chance in card["within"].items() if chance is None]
    if unknown and runs >= FEWEST_RUNS:
        allowed = f"{WHAT}: a probability, as each test has {FEWEST_RUNS} runs or more"
        raise InputError(source, f"within.{unknown[0]}", None, allowed)


def read(path: str | PathLike) -> dict[str, Any]:
    """Read a card; raise InputError if the file cannot be read or is no card."""
    card = read_json(path, (), WHAT)
    check(card, path)
    return card

"""The material card: the answer of a calibration as one file, for people and for other programs.

`card.schema.json` beside this file defines the content of a card. A card is made, written and read here, compared with
the configuration of its study, and shown as text, alone or beside another.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.apparatus import bench, reach
from repose.apparatus.settings import SimulationSettings
from repose.chain.answer import Answer, Check, in_one_line, nearness
from repose.core import provenance
from repose.core.errors import InputError, raise_together
from repose.core.files import read_json, read_table, write_json
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import LABELS, PHYSICAL_LIMITS
from repose.core.responses import Response, derived
from repose.core.runs import error_of
from repose.core.targets import Target, Targets

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
CHOSEN = "measure.response"  # names the definition of a response that has several
BERRY_HEIGHT = "berry_height_mm"
CONFIG = "config.json"  # the configuration of a study, beside its card
AT_BOUND = 1e-3  # of the range's width: nearer, an answer lies at the bound of what was searched
AGREEMENT = 1e-6  # relative, of a number of the card and of the configuration
MET = {True: "met", False: "NOT met", None: "not simulated again"}

# --- made -----------------------------------------------------------------------------------------


def make(
    config: Mapping[str, Any],
    answer: Answer,
    berry: Mapping[str, Any],
    particle: "Particle",
    feasible: "pd.DataFrame",
    posterior: "tuple[pd.DataFrame, pd.DataFrame] | None" = None,
    dataset_csv: str | PathLike | None = None,
    row: "Mapping[str, Any] | None" = None,
) -> dict[str, Any]:
    """The card of a finished calibration; without a posterior, intervals and correlations come from the sets found.

    `dataset_csv` are the samples of the design. `row` is the answer's in table4.csv, which has its piles by every
    definition of the angle.
    """
    space, targets = ParameterSpace.of(config["parameters"]), Targets.of(config["targets"])
    about = {
        "grain": _grain(config, berry, particle),
        "wall": {key: config["wall"][key] for key in WALL},
        "laws": laws(config),
    }
    tests = {
        name: described(config, target.response, berry) | _lines(config, name, row or {})
        for name, target in zip(targets.names, targets, strict=True)
    }
    for name, found in reach.of(config, particle, dataset_csv).items():
        tests[name]["reach"] = found.record()
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
    """A card from its parts."""
    draws = feasible if posterior is None else posterior[1]
    between = ends(space, feasible, posterior)
    correlations = draws[list(space.free)].corr().fillna(0.0)
    return {
        "card": 1,
        "material": answer.label,
        **about,
        "parameters": {
            name: {
                "meaning": LABELS.get(name, name),
                "value": answer.parameters[name],
                **held(space, name, answer.parameters[name], *between[name]),
                "given": _given(name, space),
            }
            for name in space.names
        },
        "interval": RANGE if posterior is None else POSTERIOR,
        "correlations": {
            parameter: {other: round(float(correlations.loc[parameter, other]), 4) for other in space.free}
            for parameter in space.free
        },
        "tests": [
            _test(check, target) | dict(tests[target.name])
            for check, target in _paired(answer.checks, targets)
        ],
        "met": answer.met,
        "out_of_reach": answer.out_of_reach,
        "reason": answer.reason,
        **({"small_run": True} if answer.small_run else {}),
        "within": {f"{percent:g} %": chance for percent, chance in answer.within.items()},
        "made_by": _made_by(),
    }


def laws(config: Mapping[str, Any]) -> dict[str, str]:
    """The contact laws of a configuration as text, by direction."""
    from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
    from repose.dem.laws.law import COULOMB

    settings = SimulationSettings.of(config)
    contact = CONTACT_LAWS[settings.contact_law]
    limit = contact.limits[COULOMB[settings.tension]]
    words = {**contact.words, **ROLLING_LAWS[settings.rolling_law].words}
    sentences = {direction: text.format(limit=limit) for direction, text in words.items()}
    return sentences | {"end of an impact": contact.ends[settings.tension]}


def described(config: Mapping[str, Any], response: Response, berry: Mapping[str, Any]) -> dict[str, Any]:
    """Definition of a response and settings of its bench test, with the units in the keys."""
    from repose.measure.settings import MeasureSettings

    test = bench(response.apparatus)
    section, others = config[test.name], ("seeds", *test.measured_by)
    if CHOSEN in response.definition:
        own = {other.name: other for other in test.responses}
        response = own.get(derived(response.name, config["measure"]["response"]), response)
    settings = {key.rpartition(".")[2]: value for key, value in response.settings(config).items()}
    if BERRY_HEIGHT in settings:
        height = MeasureSettings.of(config["measure"], berry).berry_height_mm
        settings[BERRY_HEIGHT] = None if height is None else float(f"{height:.6g}")
    profile = next(
        (
            one["profile"]
            for one in config["targets"]
            if one["response"] == response.name and "profile" in one
        ),
        None,
    )
    if profile is not None:
        settings["profile"] = {key: profile[key] for key in ("x", "functions", "covered")}
    return {
        "definition": {"name": response.label, "settings": settings},
        "bench": {
            key: section[key] for key in test.settings.model_fields if key in section and key not in others
        },
    }


def _lines(config, name, row):
    """The line of an angle of a pile, and the same piles by every definition; nothing for another response."""
    from repose.measure.angles import MEAN_KEYS
    from repose.measure.settings import line_for, line_of

    def number(column):
        value = row.get(column)
        return None if value is None or math.isnan(value) else float(value)

    line = line_for(config["measure"], name)
    if not line or not set(MEAN_KEYS.values()) <= set(row):
        return {"line": line} if line else {}
    of = {
        definition: {
            "line": line_of(config["measure"], definition),
            "simulated": number(column),
            "standard_error": number(error_of(column)),
        }
        for definition, column in MEAN_KEYS.items()
    }
    return {"line": line, "definitions": of}


def ends(
    space: ParameterSpace, feasible: "pd.DataFrame", posterior: "tuple[pd.DataFrame, pd.DataFrame] | None"
) -> dict[str, tuple[float | None, float | None]]:
    """Interval of each parameter; (None, None) for a fixed parameter."""
    found: dict[str, tuple[float | None, float | None]] = dict.fromkeys(space.names, (None, None))
    table = None if posterior is None else posterior[0].set_index("parameter")
    for name in space.free:
        if table is None:
            found[name] = float(feasible[name].min()), float(feasible[name].max())
        else:
            found[name] = float(table.loc[name, "credible_low"]), float(table.loc[name, "credible_high"])
    return found


def held(
    space: ParameterSpace, name: str, value: float, low: float | None, high: float | None
) -> dict[str, Any]:
    """The ends of a parameter's interval, which hold its value unless that lies at a bound of what was searched."""
    if name not in space.free or low is None or high is None:
        return {"low": None, "high": None}
    k = space.free.index(name)
    bounds = {"lower": float(space.low[k]), "upper": float(space.high[k])}
    near = AT_BOUND * (bounds["upper"] - bounds["lower"])
    for side, bound in bounds.items():
        if abs(value - bound) <= near:
            return {"low": low, "high": high, "at_bound": side}
    widened = {} if low <= value <= high else {"widened": True}
    return {"low": min(low, value), "high": max(high, value), **widened}


def with_remark(words: str, row: Mapping[str, Any]) -> str:
    """Words on a parameter, with what `held` says of its interval."""
    if "at_bound" in row:
        return f"{words}; at the {row['at_bound']} bound of the range"
    return f"{words}; interval widened to hold the answer" if "widened" in row else words


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


def _test(check: Check, target: Target) -> dict[str, Any]:
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
        **({} if check.whole is None else {"whole": check.whole}),
        **({} if check.predicted is None else {"predicted": check.predicted}),
        "simulated": check.simulated,
        "standard_error": check.standard_error,
        "runs": check.runs,
        "status": check.status,
        "met": check.met,
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


# --- written and read -----------------------------------------------------------------------------


def run(
    config: Mapping[str, Any],
    answer: Answer,
    files: Mapping[str, str | PathLike | None],
    out: str | PathLike,
) -> dict[str, Any]:
    """Write the card of a finished calibration (`make`) and return it."""
    from repose.particle.berry_files import SIZE_COLUMNS, read_berry
    from repose.particle.particle import Particle

    needed = (*SIZE_COLUMNS, "density_kg_m3", "elastic_modulus_pa", "shear_modulus_pa")
    berry = read_berry(_path(files, "berry"), (*needed, "n"))
    particle = Particle.load(_path(files, "particle"))
    feasible = read_table(_path(files, "feasible"), ParameterSpace.of(config["parameters"]).names)
    posterior = None
    if files.get("posterior") is not None:
        columns = ("parameter", "credible_low", "credible_high")
        free = ParameterSpace.of(config["parameters"]).free
        posterior = (
            read_table(_path(files, "posterior"), columns),
            read_table(_path(files, "draws"), free),
        )
    row = None
    if files.get("table4") is not None:
        table4 = read_table(_path(files, "table4"), ("role",))
        row = table4[table4["role"] == "representative"].iloc[0].to_dict()
    card = make(config, answer, berry, particle, feasible, posterior, files.get("dataset"), row)
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
    """Raise InputError, for all faults at once, if the content is not a card, or lacks a computable probability."""
    faults = sorted(_validator().iter_errors(card), key=lambda error: list(map(str, error.absolute_path)))
    raise_together(
        InputError(
            source,
            ".".join(map(str, error.absolute_path)) or "content",
            error.instance if error.absolute_path else sorted(card) or "empty",
            f"{WHAT}: {error.message}",
        )
        for error in faults
    )
    raise_together(InputError(source, *fault) for fault in _impossible(card))
    runs = min(test["runs"] if test["status"] == OK else 0 for test in card["tests"])
    unknown = [percent for percent, chance in card["within"].items() if chance is None]
    if unknown and runs >= FEWEST_RUNS:
        allowed = f"{WHAT}: a probability, as each test has {FEWEST_RUNS} runs or more"
        raise InputError(source, f"within.{unknown[0]}", None, allowed)


def _impossible(card: Mapping[str, Any]) -> Iterator[tuple[str, Any, str]]:
    """Faults of a card that no schema finds: the key, the value and what is allowed."""
    for key, value in _numbers(card):
        if not math.isfinite(value):
            yield key, value, f"{WHAT}: a finite number"
    for name, row in card["parameters"].items():
        if "simulator" not in card:
            least, most = PHYSICAL_LIMITS[name]
            for key in ("value", "low", "high"):
                if row[key] is not None and (row[key] < least or row[key] > most):
                    yield f"parameters.{name}.{key}", row[key], f"{WHAT}: {least:g} to {most:g}"
        ends = (row["low"], row["high"])
        if ends.count(None) == 1 or (None not in ends and ends[0] > ends[1]):
            yield f"parameters.{name}", list(ends), f"{WHAT}: low and high, or null for both"
    names = set(card["correlations"])
    for name, row in card["correlations"].items():
        if set(row) != names:
            yield f"correlations.{name}", sorted(row), f"{WHAT}: {', '.join(sorted(names))}"


def _numbers(value: Any, key: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a card, with its dotted key."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, inner in items:
        yield from _numbers(inner, f"{key}.{name}" if key else str(name))
    if isinstance(value, float):
        yield key, value


def read(path: str | PathLike) -> dict[str, Any]:
    """Read a card; raise InputError if the file cannot be read or is not a card."""
    card = read_json(path, (), WHAT)
    check(card, path)
    return card


# --- of one study ---------------------------------------------------------------------------------


def read_own(card_json: str | PathLike) -> dict[str, Any]:
    """The card of a study that was simulated by this program; the card of another simulator raises InputError."""
    card = read(card_json)
    if "simulator" in card:
        allowed = "none: a card whose study repose simulated"
        raise InputError(card_json, "simulator", card["simulator"], allowed)
    return card


def configuration_of_card(card_json: str | PathLike) -> Path:
    """The configuration that a run wrote beside its card; InputError if there is none."""
    path = Path(card_json).with_name(CONFIG)
    if not path.is_file():
        allowed = f"the configuration of the study of {card_json}, as no {CONFIG} lies beside it"
        raise InputError("command line", "--config", None, allowed)
    return path


def require_one_study(
    card: Mapping[str, Any],
    card_json: str | PathLike,
    config: Mapping[str, Any],
    source: str | PathLike,
    berry: Mapping[str, Any],
) -> None:
    """Raise InputError if card and configuration differ in label, grain, wall, contact laws or a bench test."""
    unlike = list(_differences_from(card, config, berry))
    if unlike:
        key, mine, expected = unlike[0]
        allowed = f"{expected}, as in {source}: card and configuration of one study"
        others = ", ".join(key for key, *_ in unlike[1:])
        raise InputError(card_json, key, mine, allowed + (f"; other differences: {others}" if others else ""))


def _differences_from(
    card: Mapping[str, Any], config: Mapping[str, Any], berry: Mapping[str, Any]
) -> Iterator[tuple[str, Any, Any]]:
    """The differences as (key, value of the card, value of the configuration)."""
    axes = [berry[key] for key in ("long_mm", "major_mm", "minor_mm")]
    expected = {"material": config["label"], "grain.mean_axes_mm": axes}
    expected |= {f"grain.{key}": berry[key] for key in GRAIN}
    expected |= {f"wall.{key}": config["wall"][key] for key in WALL}
    expected |= {f"laws.{key}": law for key, law in laws(config).items()}
    mine = {"material": card["material"]}
    mine |= {
        f"{part}.{key}": value for part in ("grain", "wall", "laws") for key, value in card[part].items()
    }
    for test in card["tests"]:
        section, name = config.get(test["apparatus"], {}), test["apparatus"]
        mine |= {f"{name}.{key}": value for key, value in test["bench"].items()}
        expected |= {f"{name}.{key}": section.get(key) for key in test["bench"]}
    for key, value in expected.items():
        if not _same(mine.get(key), value):
            yield key, mine.get(key), value


def _same(first, second):
    """Whether two values are the same; numbers to the precision of a file."""
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(_same, first, second))
    if isinstance(first, int | float) and isinstance(second, int | float):
        return math.isclose(first, second, rel_tol=AGREEMENT)
    return first == second


# --- shown ----------------------------------------------------------------------------------------


def verdict(card: Mapping[str, Any]) -> str:
    """Whether the targets are met, in one line with numbers, and why."""
    reason = card.get("reason", "The card is of an older version, which gave no reason.")
    line = in_one_line(card["met"], map(_check, card["tests"]), reason, card.get("small_run", False))
    return f"{card['material']}: {line}" + (f"\n{reason}" if card["met"] else "")


def describe(card: Mapping[str, Any]) -> str:
    """A card as text for people."""
    made = card["made_by"]
    free = list(card["correlations"])
    pairs = [(card["correlations"][a][b], a, b) for k, a in enumerate(free) for b in free[k + 1 :]]
    strong = sorted((pair for pair in pairs if abs(pair[0]) >= 0.5), key=lambda pair: -abs(pair[0]))
    return "\n".join(
        [
            f"Material card: {card['material']}; targets {MET[card['met']]}",
            *([card["reason"]] if "reason" in card else []),
            *_about(card),
            f"parameters [{card['interval']}]:",
            *(
                f"  {name:7} {_value(parameter):32} {with_remark(parameter['meaning'], parameter)}"
                for name, parameter in card["parameters"].items()
            ),
            "correlations of 0.5 and more: "
            + ("; ".join(f"{a}, {b} {value:+.2f}" for value, a, b in strong) or "none"),
            "tests:",
            *(f"  {line}" for test in card["tests"] for line in _test_lines(test)),
            f"  {nearness(map(_check, card['tests']))}",
            *(f"  all within {key}: probability {_chance(value)}" for key, value in card["within"].items()),
            *(f"  {name}: {_settings(bench)}" for name, bench in _benches(card).items()),
            f"made by repose {made['version']}, commit {made['commit']}, configuration {made['configuration']}, "
            f"engine {made['engine']}, seed {made['seed']}",
        ]
    )


def _about(card):
    """The simulated grain, wall and laws, or the other simulator."""
    if "simulator" in card:
        chance = card["probability"]
        yield f"simulator: {card['simulator']}"
        yield (
            f"probability that the simulator's means lie within 1 % of all targets: {chance['within_1_percent']:.2f}; "
            f"within 2 %: {chance['within_2_percent']:.2f}; inside all ranges: {chance['inside']:.2f}"
        )
        return
    grain = card["grain"]
    axes = " x ".join(f"{axis:.4g}" for axis in grain["mean_axes_mm"])
    spread = f", spread {100 * grain['relative_spread']:.2g} %" if grain["relative_spread"] else ""
    yield (
        f"grain: {axes} mm (mean of {grain['measured']}{spread}), {grain['shape']}, {grain['volume_mm3']:.4g} mm3, "
        f"{grain['mass_g']:.4g} g"
    )
    yield f"  density {grain['density_kg_m3']:.4g} kg/m3, {_moduli(grain)}"
    yield f"wall: {_moduli(card['wall'])}"
    yield "contact laws:"
    yield from (f"  {name}: {law}" for name, law in card["laws"].items())


def compared(first: Mapping[str, Any], second: Mapping[str, Any]) -> str:
    """Two cards side by side, with the differences that hinder a comparison of their parameters."""
    names = [card["material"] for card in (first, second)]
    rows = [["", *names]]
    for name in dict.fromkeys([*first["parameters"], *second["parameters"]]):
        pair = [card["parameters"].get(name) for card in (first, second)]
        note = [_overlap_note(*pair)] if all(pair) else []
        rows.append([name, *(_value(value) if value else "-" for value in pair), *note])
    tests = [{test["response"]: test for test in card["tests"]} for card in (first, second)]
    for name in dict.fromkeys([*tests[0], *tests[1]]):
        rows.append([name, *(_simulated(own.get(name)) for own in tests)])
    for key in ("mean_axes_mm", "density_kg_m3", "shear_modulus_pa", "shape"):
        if "simulator" not in first and "simulator" not in second:
            rows.append([key, *(_plain(card["grain"][key]) for card in (first, second))])
    widths = [max(len(row[k]) for row in rows if k < len(row)) for k in range(3)]
    lines = [
        "  ".join(f"{cell:{width}}" for cell, width in zip(row, [*widths, 0], strict=False)) for row in rows
    ]
    return "\n".join([*(line.rstrip() for line in lines), *_differences(first, second)])


def _differences(first, second):
    """Sentences on the differences of two cards besides the grain."""
    simulators = [card.get("simulator", "repose") for card in (first, second)]
    if simulators[0] != simulators[1]:
        yield f"Another simulator: {simulators[0]} | {simulators[1]}."
    laws = [card.get("laws", {}) for card in (first, second)]
    for name in dict.fromkeys([*laws[0], *laws[1]] if all(laws) else []):
        pair = [of.get(name, "none") for of in laws]
        if pair[0] != pair[1]:
            yield f"Another law, {name}: {pair[0]} | {pair[1]}. The same parameters would give other piles."
    yield from _other_tests(first, second)
    if first["interval"] != second["interval"]:
        yield f"The intervals differ in kind: {first['interval']} | {second['interval']}."
    if first["made_by"]["engine"] != second["made_by"]["engine"]:
        yield "The versions of the simulator differ."


def _other_tests(first, second):
    """Sentences on responses with different definitions, and on bench tests with different settings."""
    tests = [{test["response"]: test["definition"] for test in card["tests"]} for card in (first, second)]
    for name in (name for name in tests[0] if name in tests[1]):
        pair = [of[name] for of in tests]
        names = [of["name"] or "not stated" for of in pair]
        if names[0] != names[1]:
            yield f"Another definition of {name}: {names[0]} | {names[1]}. Their numbers must not be compared."
        elif pair[0] != pair[1]:
            yield f"{name} is measured with other settings: {_unlike(*(of['settings'] for of in pair))}."
    benches = [_benches(card) for card in (first, second)]
    for name in (name for name in benches[0] if name in benches[1]):
        if benches[0][name] != benches[1][name]:
            yield f"Another {name}: {_unlike(benches[0][name], benches[1][name])}."


def _unlike(first, second):
    """Keys whose values differ, with both."""
    keys = dict.fromkeys([*first, *second])
    differing = [
        (key, *(_plain(of.get(key)) for of in (first, second)))
        for key in keys
        if first.get(key) != second.get(key)
    ]
    return "; ".join(f"{key} {mine} | {theirs}" for key, mine, theirs in differing)


def _overlap_note(first: Mapping[str, Any], second: Mapping[str, Any]) -> str:
    """Whether two intervals overlap."""
    ends = [value for part in (first, second) for value in (part["low"], part["high"])]
    if None in ends:
        return ""
    return "" if ends[0] <= ends[3] and ends[2] <= ends[1] else "intervals apart"


def _value(parameter):
    """A parameter with its interval."""
    if parameter["low"] is None:
        return f"{parameter['value']:.4g} fixed"
    return f"{parameter['value']:.4g} [{parameter['low']:.4g}, {parameter['high']:.4g}]"


def _simulated(test):
    """Simulated and measured response."""
    if test is None:
        return "-"
    simulated = "no number" if test["simulated"] is None else f"{test['simulated']:.4g}"
    return f"{simulated} {test['unit']}, measured {test['measured']:.4g}"


def _check(test):
    """A test of the card as a `Check`."""
    return Check(**{field.name: test[field.name] for field in fields(Check) if field.name in test})


def _test_lines(test):
    """A test with the definition of its response."""
    simulated = _mean(test["simulated"], test["standard_error"])
    simulated += "" if test["simulated"] is None else f" {test['unit']}"
    yield (
        f"{test['response']} ({test['apparatus']}): measured {test['measured']:.4g} (sd {test['sd']:.2g}, "
        f"{test['repetitions']} repetitions), target {test['low']:g} to {test['high']:g}, simulated {simulated} "
        f"(runs: {test['runs']}): {MET[test['met']]}"
    )
    off = _check(test).error_percent
    if off is not None:
        yield f"  predicted {test['predicted']:.4g}, {off:.1f} % off the simulated (the article's solutions: below 5 %)"
    definition = test["definition"]
    name, settings = definition["name"] or "not stated", _settings(definition["settings"])
    yield f"  definition: {name}" + (f"; {settings}" if settings else "")
    if "reach" in test:
        yield f"  {test['reach']['sentence']}"
    if "definitions" in test:
        shown = (
            f"{of['line']}: {_mean(of['simulated'], of['standard_error'])}"
            for of in test["definitions"].values()
        )
        yield f"  the same piles by every line, {test['unit']}: {'; '.join(shown)}"


def _mean(mean, error):
    """A mean with its standard error."""
    if mean is None:
        return "no number"
    return f"{mean:.4g}" + ("" if error is None else f" +- {error:.2g}")


def _settings(section):
    """Keys with their values."""
    return ", ".join(f"{key} {_plain(value)}" for key, value in section.items())


def _benches(card):
    """Settings of each bench test with known settings, by its name."""
    return {test["apparatus"]: test["bench"] for test in card["tests"] if test["bench"] is not None}


def _chance(value):
    """A probability."""
    return "unknown; it requires two good runs of each bench test" if value is None else f"{value:.2f}"


def _moduli(part):
    """Moduli of a material."""
    return f"shear modulus {part['shear_modulus_pa']:.4g} Pa, Poisson's ratio {part['poisson_ratio']:.3g}"


def _plain(value: Any) -> str:
    """A value of a table."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return " x ".join(f"{item:.4g}" for item in value)
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    return f"{value:.4g}" if isinstance(value, int | float) else str(value)

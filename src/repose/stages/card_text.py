"""Material cards as text: one alone, its verdict, or two side by side."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import combinations
from typing import Any

from repose.calibrate.answer import Check, describe_probability, in_one_line, nearness
from repose.stages.card import with_remark

MET = {True: "met", False: "NOT met", None: "not simulated again"}


def verdict(card: Mapping[str, Any]) -> str:
    """Tell whether the targets are met, in one line with numbers, and why."""
    reason = card.get(
        "reason", "The card is of an older version, which gave no reason."
    )
    line = in_one_line(
        card["met"], map(_check, card["tests"]), reason, card.get("small_run", False)
    )
    return f"{card['material']}: {line}" + (f"\n{reason}" if card["met"] else "")


def describe(card: Mapping[str, Any]) -> str:
    """Write a card as text for people."""
    pairs = [
        (card["correlations"][a][b], a, b)
        for a, b in combinations(card["correlations"], 2)
    ]
    strong = sorted(
        (pair for pair in pairs if abs(pair[0]) >= 0.5), key=lambda pair: -abs(pair[0])
    )
    lines = [f"Material card: {card['material']}; targets {MET[card['met']]}"]
    lines += [card["reason"]] if "reason" in card else []
    lines += [*_about(card), f"parameters [{card['interval']}]:"]
    for name, parameter in card["parameters"].items():
        lines.append(
            f"  {name:7} {_value(parameter):32} {with_remark(parameter['meaning'], parameter)}"
        )
    correlations = (
        "; ".join(f"{a}, {b} {value:+.2f}" for value, a, b in strong) or "none"
    )
    lines += [f"correlations of 0.5 and more: {correlations}", "tests:"]
    lines += [f"  {line}" for test in card["tests"] for line in _test_lines(test)]
    lines.append(f"  {nearness(map(_check, card['tests']))}")
    for key, value in card["within"].items():
        chance = (
            "unknown; it requires two good runs of each bench test"
            if value is None
            else f"{value:.2f}"
        )
        lines.append(f"  all within {key}: probability {chance}")
    lines += [f"  {name}: {_settings(bench)}" for name, bench in _benches(card).items()]
    keys = (
        key
        for key in ("commit", "configuration", "engine", "seed")
        if card["made_by"][key] is not None
    )
    made = ", ".join(f"{key} {card['made_by'][key]}" for key in keys)
    return "\n".join([*lines, f"made by repose {card['made_by']['version']}, {made}"])


def _about(card: Mapping[str, Any]) -> Iterator[str]:
    """Describe the simulated grain, wall and laws, or the other simulator."""
    if "simulator" in card:
        yield f"simulator: {card['simulator']}"
        yield f"probability that the simulator's means lie {describe_probability(card['probability'])}"
        return
    grain = card["grain"]
    axes = " x ".join(f"{axis:.4g}" for axis in grain["mean_axes_mm"])
    spread = (
        f", spread {100 * grain['relative_spread']:.2g} %"
        if grain["relative_spread"]
        else ""
    )
    size = f"{grain['volume_mm3']:.4g} mm3, {grain['mass_g']:.4g} g"
    yield f"grain: {axes} mm (mean of {grain['measured']}{spread}), {grain['shape']}, {size}"
    yield f"  density {grain['density_kg_m3']:.4g} kg/m3, {_moduli(grain)}"
    yield f"wall: {_moduli(card['wall'])}"
    yield "contact laws:"
    yield from (f"  {name}: {law}" for name, law in card["laws"].items())


def compared(first: Mapping[str, Any], second: Mapping[str, Any]) -> str:
    """Write two cards side by side, with the differences that hinder a comparison of their parameters."""
    rows = [["", *(card["material"] for card in (first, second))]]
    for name in first["parameters"] | second["parameters"]:
        pair = [card["parameters"].get(name) for card in (first, second)]
        note = [_overlap_note(*pair)] if all(pair) else []
        rows.append([name, *(_value(value) if value else "-" for value in pair), *note])
    tests = [
        {test["response"]: test for test in card["tests"]} for card in (first, second)
    ]
    rows += [
        [name, *(_simulated(own.get(name)) for own in tests)]
        for name in tests[0] | tests[1]
    ]
    if "simulator" not in first and "simulator" not in second:
        keys = "mean_axes_mm", "density_kg_m3", "shear_modulus_pa", "shape"
        rows += [
            [key, *(_plain(card["grain"][key]) for card in (first, second))]
            for key in keys
        ]
    widths = [max(len(row[k]) for row in rows if k < len(row)) for k in range(3)]
    lines = [
        "  ".join(
            f"{cell:{width}}" for cell, width in zip(row, [*widths, 0], strict=False)
        )
        for row in rows
    ]
    return "\n".join([*(line.rstrip() for line in lines), *_differences(first, second)])


def _differences(first: Mapping[str, Any], second: Mapping[str, Any]) -> Iterator[str]:
    """Describe in sentences how two cards differ, the grain aside."""
    simulators = [card.get("simulator", "repose") for card in (first, second)]
    if simulators[0] != simulators[1]:
        yield f"Another simulator: {simulators[0]} | {simulators[1]}."
    laws = [card.get("laws", {}) for card in (first, second)]
    for name in laws[0] | laws[1] if all(laws) else ():
        one, other = (of.get(name, "none") for of in laws)
        if one != other:
            yield f"Another law, {name}: {one} | {other}. The same parameters would give other piles."
    yield from _other_tests(first, second)
    if first["interval"] != second["interval"]:
        yield f"The intervals differ in kind: {first['interval']} | {second['interval']}."
    if first["made_by"]["engine"] != second["made_by"]["engine"]:
        yield "The versions of the simulator differ."


def _other_tests(first: Mapping[str, Any], second: Mapping[str, Any]) -> Iterator[str]:
    """Describe in sentences the responses with different definitions and the bench tests with different settings."""
    tests = [
        {test["response"]: test["definition"] for test in card["tests"]}
        for card in (first, second)
    ]
    for name in (name for name in tests[0] if name in tests[1]):
        pair = [of[name] for of in tests]
        one, other = (of["name"] or "not stated" for of in pair)
        if one != other:
            yield f"Another definition of {name}: {one} | {other}. Their numbers must not be compared."
        elif pair[0] != pair[1]:
            yield f"{name} is measured with other settings: {_unlike(*(of['settings'] for of in pair))}."
    benches = [_benches(card) for card in (first, second)]
    for name in (name for name in benches[0] if name in benches[1]):
        if benches[0][name] != benches[1][name]:
            yield f"Another {name}: {_unlike(benches[0][name], benches[1][name])}."


def _unlike(first: Mapping[str, Any], second: Mapping[str, Any]) -> str:
    """List the keys whose values differ, with both values."""
    differing = (
        key for key in {**first, **second} if first.get(key) != second.get(key)
    )
    return "; ".join(
        f"{key} {_plain(first.get(key))} | {_plain(second.get(key))}"
        for key in differing
    )


def _overlap_note(first: Mapping[str, Any], second: Mapping[str, Any]) -> str:
    """Note that two intervals do not overlap; empty if they do."""
    if None in (first["low"], second["low"]):
        return ""
    return (
        ""
        if first["low"] <= second["high"] and second["low"] <= first["high"]
        else "intervals apart"
    )


def _value(parameter: Mapping[str, Any]) -> str:
    """Write a parameter with its interval."""
    if parameter["low"] is None:
        return f"{parameter['value']:.4g} fixed"
    return f"{parameter['value']:.4g} [{parameter['low']:.4g}, {parameter['high']:.4g}]"


def _simulated(test: Mapping[str, Any] | None) -> str:
    """Write the simulated and the measured response."""
    if test is None:
        return "-"
    known = (
        f"predicted {_mean(test.get('predicted'), None)}"
        if test["met"] is None
        else _mean(test["simulated"], None)
    )
    return f"{known}, measured {test['measured']:.4g} {test['unit']}"


def _check(test: Mapping[str, Any]) -> Check:
    """Read a test of the card as a `Check`."""
    return Check(
        **{
            field.name: test[field.name]
            for field in fields(Check)
            if field.name in test
        }
    )


def _test_lines(test: Mapping[str, Any]) -> Iterator[str]:
    """Describe a test, and how its response is defined."""
    simulated = _mean(test["simulated"], test["standard_error"])
    simulated += "" if test["simulated"] is None else f" {test['unit']}"
    measured = f"measured {test['measured']:.4g} (sd {test['sd']:.2g}, {test['repetitions']} repetitions)"
    aimed = f"target {test['low']:g} to {test['high']:g}, simulated {simulated} (runs: {test['runs']})"
    yield f"{test['response']} ({test['apparatus']}): {measured}, {aimed}: {MET[test['met']]}"
    off = _check(test).error_percent
    if off is not None:
        yield f"  predicted {test['predicted']:.4g}, {off:.1f} % off the simulated (the article's solutions: below 5 %)"
    definition = test["definition"]
    name, settings = (
        definition["name"] or "not stated",
        _settings(definition["settings"]),
    )
    yield f"  definition: {name}" + (f"; {settings}" if settings else "")
    if "reach" in test:
        yield f"  {test['reach']['sentence']}"
    if "definitions" in test:
        shown = (
            f"{of['line']}: {_mean(of['simulated'], of['standard_error'])}"
            for of in test["definitions"].values()
        )
        yield f"  the same piles by every line, {test['unit']}: {'; '.join(shown)}"


def _mean(mean: float | None, error: float | None) -> str:
    """Write a mean with its standard error."""
    return (
        "no number"
        if mean is None
        else f"{mean:.4g}" + ("" if error is None else f" +- {error:.2g}")
    )


def _settings(section: Mapping[str, Any]) -> str:
    """List keys with their values."""
    return ", ".join(f"{key} {_plain(value)}" for key, value in section.items())


def _benches(card: Mapping[str, Any]) -> dict[str, Any]:
    """Find the settings of each bench test that states them, by its name."""
    return {
        test["apparatus"]: test["bench"]
        for test in card["tests"]
        if test["bench"] is not None
    }


def _moduli(part: Mapping[str, Any]) -> str:
    """Write the moduli of a material."""
    return f"shear modulus {part['shear_modulus_pa']:.4g} Pa, Poisson's ratio {part['poisson_ratio']:.3g}"


def _plain(value: Any) -> str:
    """Write a value of a table."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return " x ".join(f"{item:.4g}" for item in value)
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    return f"{value:.4g}" if isinstance(value, int | float) else str(value)

"""Describe material cards in text: a whole card, its verdict, or two side by side."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

from repose.calibrate.answer import (
    NEAR_BOUNDS_INTRODUCTION,
    Assessment,
    Check,
    Verdict,
    describe_differences,
    describe_missing_optimism,
    describe_probabilities,
    describe_state,
    format_verdict_line,
)
from repose.calibrate.card import SOLUTION_RANGE, add_remark
from repose.calibrate.determination import describe_determinations
from repose.calibrate.samples_inside import describe_samples_inside
from repose.common.numbers import format_significant, format_with_error

# A pair of parameters is listed if its absolute correlation is at least this.
STRONG_CORRELATION = 0.5
# Keys of the grain that a comparison shows.
COMPARED_GRAIN_KEYS = ("mean_axes_mm", "density_kg_m3", "shear_modulus_pa", "shape")
N_COLUMNS = 3  # columns of a comparison: a name, and the value of each card
Card = Mapping[str, Any]


def format_verdict(card: Card) -> str:
    """Describe whether the targets are met, with the numbers and the reason."""
    reason = get_reason(card)
    checks = map(Check.from_card_entry, card["tests"])
    state = get_verdict(card)
    line = format_verdict_line(
        state,
        checks,
        reason=reason,
        small_run=card.get("small_run", False),
        status=_describe_state(card),
    )
    text = f"{card['material']}: {line}"
    # If the targets are not met, the line already has the reason.
    return f"{text}\n{reason}" if state is Verdict.MET else text


def _describe_state(card: Card) -> str:
    """Describe the verdict of a card, or what it predicts (`describe_state`)."""
    return describe_state(
        get_verdict(card),
        predicted=card.get("probability", {}).get("inside"),
        out_of_reach=bool(card.get("out_of_reach")),
    )


def get_verdict(card: Card) -> Verdict:
    """Get the verdict of a card.

    A card of an older version has none. It is then computed from the simulated means,
    their standard errors and the numbers of runs.
    """
    if "verdict" in card:
        return Verdict(card["verdict"])
    return _assess_older_card(card).verdict


def get_reason(card: Card) -> str:
    """Get the sentence that explains the verdict of a card.

    A card of an older version has no verdict, and perhaps a sentence about another one.
    The sentence is then written anew.
    """
    if "verdict" in card and "reason" in card:
        return str(card["reason"])
    return _assess_older_card(card).reason


def _assess_older_card(card: Card) -> Assessment:
    """Judge a card of an older version by its tests.

    Such a card says only whether the answer was predicted inside the ranges and all
    simulated means lie inside them. If it says no although all means lie inside, the
    prediction missed the ranges.
    """
    checks = tuple(map(Check.from_card_entry, card["tests"]))
    are_means_inside = all(check.margin >= 0 for check in checks)
    out_of_reach = card.get("out_of_reach", False)
    misses_by_prediction = card["met"] is False and are_means_inside
    return Assessment(
        checks=checks,
        feasible=not (out_of_reach or misses_by_prediction),
        inside=card.get("probability_inside"),
        out_of_reach=out_of_reach,
    )


# --- one card -------------------------------------------------------------------------


def describe_card(card: Card) -> str:
    """Describe a material card in readable text.

    Parameters
    ----------
    card : mapping
        The content of a card that passed `repose.stages.card.check_card`.

    Returns
    -------
    str
        Several lines: whether the targets are met, grain and contact laws, parameters,
        tests, and the version of repose that made the card.
    """
    lines = [f"Material card: {card['material']}; targets {_describe_state(card)}"]
    lines.append(get_reason(card))
    lines += _describe_subject(card)
    lines += _describe_parameters(card)
    lines += _describe_tests(card)
    lines.append(_describe_origin(card["made_by"]))
    return "\n".join(lines)


def _describe_parameters(card: Card) -> Iterator[str]:
    """Describe each parameter with its interval and its meaning, line by line."""
    yield f"parameters [{_describe_interval_kind(card)}]:"
    for name, parameter in card["parameters"].items():
        meaning = add_remark(parameter["meaning"], parameter)
        if "determination" in parameter:
            meaning += f"; {parameter['determination']}"
        # The widths suit the names of contact parameters and numbers of four digits.
        yield f"  {name:7} {_format_interval(parameter):32} {meaning}"
    determinations = [
        parameter["determination"]
        for parameter in card["parameters"].values()
        if "determination" in parameter
    ]
    if determinations:
        yield describe_determinations(determinations)
    yield from _describe_comparisons(card)
    # The card lists parameters whose value is close to an end of its range.
    if "near_bounds" in card:
        yield f"{NEAR_BOUNDS_INTRODUCTION}: {'; '.join(card['near_bounds'])}"
    yield (
        f"correlations of {STRONG_CORRELATION:g} and more: "
        f"{_list_strong_correlations(card)}"
    )


def _describe_comparisons(card: Card) -> Iterator[str]:
    """Describe the samples that meet the targets and the published answer, by line."""
    sentence = describe_samples_inside(card.get("samples_inside", {}))
    if sentence:
        yield sentence
    if "published" not in card:
        return
    published = card["published"]
    source = f" ({published['source']})" if "source" in published else ""
    values = ", ".join(
        f"{name} {format_significant(value)}"
        for name, value in published["parameters"].items()
    )
    text = f"published answer{source}: {values}"
    if "responses" in published:
        units = {test["response"]: test["unit"] for test in card["tests"]}
        means = ", ".join(
            f"{name} {_format_mean(mean['simulated'], mean['standard_error'])} "
            f"{units.get(name, '')}".rstrip()
            for name, mean in published["responses"].items()
        )
        engine = ", by another engine or scene" if "stale" in published else ""
        text += f"; simulated here{engine}: {means} (runs: {published['runs']})"
    yield text


def _describe_tests(card: Card) -> Iterator[str]:
    """Describe all tests of a card, and how well they are met together, line by line.

    A test is a target with the measured, the predicted and the simulated mean of its
    response.
    """
    yield "tests:"
    for test in card["tests"]:
        for line in _describe_test(test):
            yield f"  {line}"
    checks = [Check.from_card_entry(test) for test in card["tests"]]
    if any(check.simulated is not None for check in checks):
        yield f"  {describe_differences(checks)}"
    # `within` has the probability that all means lie within so many percent of their
    # targets. It is unknown with too few runs.
    for percent, probability in card["within"].items():
        if probability is None:
            text = "unknown; it requires two good runs of each bench test"
        else:
            text = f"{probability:.2f}"
        yield f"  all within {percent}: probability {text}"
    for bench_test, settings in _collect_bench_settings(card).items():
        yield f"  {bench_test}: {_format_settings(settings)}"


def _describe_interval_kind(card: Card) -> str:
    """Describe the interval that follows each parameter in brackets."""
    if card["interval"] == SOLUTION_RANGE:
        return f"{SOLUTION_RANGE}, which is not an uncertainty"
    return str(card["interval"])


def _describe_subject(card: Card) -> Iterator[str]:
    """Describe what was simulated, line by line.

    For a study that repose simulated, these lines describe grain, wall and contact
    laws. For a study of another simulator, they state the name of this simulator and
    the probability that its means meet the targets.
    """
    if "simulator" in card:
        yield f"simulator: {card['simulator']}"
        if "probability" in card:
            probability = describe_probabilities(card["probability"])
            yield f"predicted probability that the simulator's means lie {probability}"
            if get_verdict(card) is Verdict.UNCHECKED:
                yield describe_missing_optimism(
                    map(Check.from_card_entry, card["tests"])
                )
        return

    yield from _describe_grain(card["grain"])
    yield f"wall: {_format_moduli(card['wall'])}"
    yield "contact laws:"
    for direction, sentence in card["laws"].items():
        yield f"  {direction}: {sentence}"


def _describe_grain(grain: Card) -> Iterator[str]:
    """Describe size, shape, mass and material of the simulated grain, line by line.

    `grain` is the section `grain` of a card.
    """
    axes = " x ".join(format_significant(axis) for axis in grain["mean_axes_mm"])
    # `measured` is the number of measured grains. It is 1 if only their mean is known.
    if grain["measured"] == 1:
        sizes = "mean axes only"
    else:
        sizes = f"mean of {grain['measured']}"
    # The spread is the standard deviation of the size, as a fraction of its mean. It is
    # 0 if all grains were simulated with the mean size.
    if grain["relative_spread"]:
        sizes += f", spread {format_significant(100 * grain['relative_spread'], 2)} %"
    volume = format_significant(grain["volume_mm3"])
    mass = format_significant(grain["mass_g"])
    yield f"grain: {axes} mm ({sizes}), {grain['shape']}, {volume} mm3, {mass} g"
    density = format_significant(grain["density_kg_m3"])
    yield f"  density {density} kg/m3, {_format_moduli(grain)}"


def _list_strong_correlations(card: Card) -> str:
    """List the strongly correlated pairs of parameters, the strongest first.

    Returns
    -------
    str
        Each pair whose absolute correlation is at least `STRONG_CORRELATION`, or
        "none".
    """
    correlations = card["correlations"]
    correlated_pairs = []
    for first, second in combinations(correlations, 2):
        value = correlations[first].get(second, 0.0)
        if abs(value) >= STRONG_CORRELATION:
            correlated_pairs.append((value, f"{first}, {second} {value:+.2f}"))
    correlated_pairs.sort(key=lambda pair: -abs(pair[0]))
    return "; ".join(text for _, text in correlated_pairs) or "none"


def _describe_test(test: Card) -> Iterator[str]:
    """Describe the result for one target, and how its response is defined.

    The text is yielded line by line.

    Parameters
    ----------
    test : mapping
        An entry of the list `tests` in a card: a target with the measured, the
        predicted and the simulated mean of its response.
    """
    measured = format_significant(test["measured"])
    sd = format_significant(test["sd"], 2)
    check = Check.from_card_entry(test)
    if check.verdict is Verdict.UNCHECKED:
        # Optimism is the expected bias of the prediction.
        predicted = _format_mean(check.predicted, None)
        if check.predicted is not None:
            predicted += f" {test['unit']} ({check.optimism_clause})"
        result = f"predicted {predicted}, {test['status']}"
    else:
        simulated = _format_mean(test["simulated"], test["standard_error"])
        if test["simulated"] is not None:
            simulated += f" {test['unit']}"
        result = (
            f"simulated {simulated} (runs: {test['runs']}): {_get_test_verdict(test)}"
        )
    yield (
        f"{test['response']} ({test['apparatus']}): measured {measured} "
        f"(sd {sd}, {test['repetitions']} repetitions), "
        f"target {format_significant(test['low'])} to {format_significant(test['high'])}, "
        f"{result}"
    )

    # Compare the surrogate's prediction with the simulation, if there is one.
    if check.predicted is not None and check.error_percent is not None:
        predicted = format_significant(check.predicted)
        # Optimism is the expected bias of the prediction.
        yield (
            f"  predicted {predicted} ({check.optimism_clause}), {check.error_percent:.1f} % "
            "off the simulated"
        )

    yield f"  definition: {_format_definition(test['definition'])}"
    # Whether piles of these grains can have the angle of the target.
    if "reach" in test:
        yield f"  {test['reach']['sentence']}"
    # The angle of a pile is the slope of a line along its side. List it by every
    # definition of this line.
    if "definitions" in test:
        angles = _format_angles(test["definitions"])
        yield f"  the same piles by every line, {test['unit']}: {angles}"


def _get_test_verdict(test: Card) -> Verdict:
    """Get the verdict of a test, or compute it for a card of an older version."""
    if "verdict" in test:
        return Verdict(test["verdict"])
    return Check.from_card_entry(test).verdict


def _format_definition(definition: Card) -> str:
    """Write the name of a response's definition, and its settings if it has any."""
    name = definition["name"] or "not stated"
    settings = definition["settings"]
    return f"{name}; {_format_settings(settings)}" if settings else name


def _format_angles(definitions: Card) -> str:
    """List the mean angle of the piles by each definition, after the defining line.

    `definitions` has the line, the mean and its standard error by definition.
    """
    texts = []
    for angle in definitions.values():
        mean = _format_mean(angle["simulated"], angle["standard_error"])
        texts.append(f"{angle['line']}: {mean}")
    return "; ".join(texts)


def _describe_origin(made_by: Card) -> str:
    """Describe with which version, settings and seed a card was made."""
    parts = [f"made by repose {made_by['version']}"]
    for key in ("commit", "configuration", "engine", "seed"):
        if made_by[key] is not None:
            parts.append(f"{key} {made_by[key]}")
    return ", ".join(parts)


# --- two cards ------------------------------------------------------------------------


def compare_cards(first: Card, second: Card) -> str:
    """Format two cards side by side, and below them how their studies differ.

    Parameters
    ----------
    first, second : mapping
        The contents of the cards.

    Returns
    -------
    str
        A table of the parameters, the means and the grain. Below it is a sentence for
        each difference between the studies, because such a difference may mean that the
        parameters must not be compared.
    """
    # A row has a name, the values of the first and the second card, and perhaps a note.
    rows = [["", first["material"], second["material"]]]
    for name in first["parameters"] | second["parameters"]:
        rows.append(_format_parameter_row(name, first, second))

    # Add the simulated and measured mean of each response.
    first_tests = {test["response"]: test for test in first["tests"]}
    second_tests = {test["response"]: test for test in second["tests"]}
    for name in first_tests | second_tests:
        means = (
            _format_means(first_tests.get(name)),
            _format_means(second_tests.get(name)),
        )
        rows.append([name, *means])

    # Only the card of another simulator has the key `simulator`. It has no grain.
    if "simulator" not in first and "simulator" not in second:
        for key in COMPARED_GRAIN_KEYS:
            values = (first["grain"][key], second["grain"][key])
            rows.append([key, *map(_format_value, values)])
    return "\n".join([*_align_columns(rows), *_describe_differences(first, second)])


def _format_parameter_row(name: str, first: Card, second: Card) -> list[str]:
    """Format the values of a parameter in two cards, with a note if they are far apart.

    The value is `-` if a card lacks the parameter.
    """
    parameter = first["parameters"].get(name)
    other_parameter = second["parameters"].get(name)
    row = [
        name,
        "-" if parameter is None else _format_interval(parameter),
        "-" if other_parameter is None else _format_interval(other_parameter),
    ]
    if parameter is not None and other_parameter is not None:
        row.append(_note_overlap(parameter, other_parameter))
    return row


def _align_columns(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Write rows in columns, line by line.

    A row has `N_COLUMNS` cells. A further cell is a note, which needs no alignment.
    """
    widths = [max(len(row[column]) for row in rows) for column in range(N_COLUMNS)]
    for row in rows:
        cells = [
            f"{cell:{width}}"
            for cell, width in zip(row[:N_COLUMNS], widths, strict=True)
        ]
        yield "  ".join([*cells, *row[N_COLUMNS:]]).rstrip()


def _describe_differences(first: Card, second: Card) -> Iterator[str]:
    """Describe how two studies differ, apart from grain, parameters and responses.

    Parameters
    ----------
    first, second : mapping
        The contents of the cards.

    Yields
    ------
    str
        A sentence for each difference in simulator, contact laws, definitions, bench
        tests, kind of intervals, and version.
    """
    simulator = first.get("simulator", "repose")
    other_simulator = second.get("simulator", "repose")
    if simulator != other_simulator:
        yield f"Different simulators: {simulator} | {other_simulator}."
    if "laws" in first and "laws" in second:
        for name in first["laws"] | second["laws"]:
            law = first["laws"].get(name, "none")
            other_law = second["laws"].get(name, "none")
            if law != other_law:
                yield (
                    f"Different laws, {name}: {law} | {other_law}. "
                    "The same parameters would give different piles."
                )
    yield from _describe_different_definitions(first, second)
    yield from _describe_different_bench_tests(first, second)
    if first["interval"] != second["interval"]:
        yield (
            f"The intervals differ in kind: {first['interval']} | {second['interval']}."
        )
    # `engine` is a hash of the code of the simulator and the bench tests.
    if first["made_by"]["engine"] != second["made_by"]["engine"]:
        yield "The versions of the simulator differ."


def _describe_different_definitions(first: Card, second: Card) -> Iterator[str]:
    """Describe each response that two cards define or measure differently.

    Only responses that both cards have are compared.

    Parameters
    ----------
    first, second : mapping
        The contents of the cards.

    Yields
    ------
    str
        A sentence for each such response.
    """
    definitions = {test["response"]: test["definition"] for test in first["tests"]}
    other_definitions = {
        test["response"]: test["definition"] for test in second["tests"]
    }
    for response, definition in definitions.items():
        other_definition = other_definitions.get(response)
        if other_definition is None:
            continue
        name = definition["name"] or "not stated"
        other_name = other_definition["name"] or "not stated"
        if name != other_name:
            yield (
                f"Different definitions of {response}: {name} | {other_name}. "
                "Their numbers must not be compared."
            )
        # The same definition, with other numbers in its settings.
        elif definition != other_definition:
            differences = _format_different_values(
                definition["settings"], other_definition["settings"]
            )
            yield f"{response} is measured with different settings: {differences}."


def _describe_different_bench_tests(first: Card, second: Card) -> Iterator[str]:
    """Describe the bench tests whose settings differ between two cards, line by line."""
    others = _collect_bench_settings(second)
    for name, settings in _collect_bench_settings(first).items():
        if name in others and settings != others[name]:
            yield f"Another {name}: {_format_different_values(settings, others[name])}."


def _format_different_values(first: Card, second: Card) -> str:
    """List the keys whose values differ, with both values."""
    texts = []
    for key in {**first, **second}:
        if first.get(key) != second.get(key):
            texts.append(
                f"{key} {_format_value(first.get(key))} | {_format_value(second.get(key))}"
            )
    return "; ".join(texts)


def _note_overlap(first: Card, second: Card) -> str:
    """Return a note if the intervals of two parameters do not overlap; else nothing."""
    if _is_fixed(first) or _is_fixed(second):
        return ""
    if first["low"] <= second["high"] and second["low"] <= first["high"]:
        return ""
    return "intervals apart"


def _format_means(test: Card | None) -> str:
    """Write the simulated and the measured mean of a test."""
    if test is None:
        return "-"
    mean = _format_mean(test["simulated"], None)
    if test["simulated"] is None and "predicted" in test:
        mean = f"predicted {_format_mean(test.get('predicted'), None)}"
    return f"{mean}, measured {format_significant(test['measured'])} {test['unit']}"


# --- values ---------------------------------------------------------------------------


def _collect_bench_settings(card: Card) -> dict[str, Any]:
    """Find the settings of each bench test that states them, by its name."""
    settings = {}
    for test in card["tests"]:
        if test["bench"] is not None:
            settings[test["apparatus"]] = test["bench"]
    return settings


def _is_fixed(parameter: Card) -> bool:
    """Tell whether a parameter has no interval."""
    return parameter["low"] is None or parameter["high"] is None


def _format_interval(parameter: Card) -> str:
    """Write a parameter with its interval."""
    if _is_fixed(parameter):
        return f"{format_significant(parameter['value'])} fixed"
    interval = f"[{format_significant(parameter['low'])}, {format_significant(parameter['high'])}]"
    return f"{format_significant(parameter['value'])} {interval}"


def _format_mean(mean: float | None, error: float | None) -> str:
    """Write a mean with its standard error, if it is known."""
    if mean is None:
        return "no number"
    return format_with_error(mean, error)


def _format_moduli(material: Card) -> str:
    """Write the moduli of a material."""
    return (
        f"shear modulus {format_significant(material['shear_modulus_pa'])} Pa, "
        f"Poisson's ratio {format_significant(material['poisson_ratio'], 3)}"
    )


def _format_settings(section: Card) -> str:
    """List keys with their values."""
    return ", ".join(f"{key} {_format_value(value)}" for key, value in section.items())


def _format_value(value: Any) -> str:
    """Format a value of a setting or of the grain for readers.

    A number has four digits. The numbers of a list are joined by " x ", like axes.
    """
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return format_significant(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return " x ".join(format_significant(item) for item in value)
    return str(value)

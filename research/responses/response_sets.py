"""Sets of responses whose information is compared."""

from collections.abc import Mapping, Sequence

from repose.calibrate.responses import Response, response
from repose.common.errors import InputError
from repose.measure import further_responses

WHOLE_PILE = "whole pile"
EVERYTHING = "pile and other bench tests"
# How an experimenter gets the further responses of a pile; those of another bench test come together.
ABOVE = "above"
LOOSE = "loose"
PACKING = "packing"
STOPWATCH = "stopwatch"
PROFILE = "profile"
OF_THE_PILE = {
    "radius_90_mm": ABOVE,
    "loose_percent": LOOSE,
    "packing_percent": PACKING,
    "discharge_s": STOPWATCH,
}
WAYS = {
    PROFILE: "profile, same photographs",
    ABOVE: "picture from above",
    LOOSE: "loose grains, counted",
    PACKING: "packing, with a balance",
    STOPWATCH: "time of the pour",
    "drum": "drum, its first slip",
    "turning": "drum, turning steadily",
    "discharge": "funnel filled first, then opened",
    "cylinder": "measuring cylinder, bulk density",
}


def base_label(responses: Sequence[Response]) -> str:
    """Name of the set of all targets, as in ``AoR and Height``."""
    symbols = [response.symbol for response in responses]
    return " and ".join(filter(None, [", ".join(symbols[:-1]), symbols[-1]]))


def sets_of(
    names: Sequence[str], responses: Sequence[Response]
) -> dict[str, tuple[str, ...]]:
    """List sets of responses by label; `names` are all modelled responses, `responses` those of the targets.

    The first target alone (where there are several), the targets, and the targets with each further response. Then the
    targets with all responses of the pile, and with all responses (where some are not of the pile).
    """
    base = tuple(response.name for response in responses)
    extra = [name for name in names if name not in base]
    pile = [name for name in extra if source_of(name) == "pile"]
    found = {f"{responses[0].symbol} alone": base[:1]} if len(base) > 1 else {}
    found |= {base_label(responses): base}
    found |= {name: (*base, name) for name in extra}
    found[WHOLE_PILE] = (*base, *pile)
    if len(pile) < len(extra):
        found[EVERYTHING] = (*base, *extra)
    return found


def source_of(name: str) -> str:
    """Source of a response in the tables: "pile", or the name of another bench test."""
    bench = response(name).apparatus
    return "pile" if bench == further_responses.BENCH else bench


def ways_of(names: Sequence[str], base: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Further responses by the experimenter's way to get them.

    A way is a name of `OF_THE_PILE`, ``profile``, or another bench test. All responses from the outline in the
    photographs are one way. `names` are all modelled responses, `base` those of the targets.
    """
    found: dict[str, list[str]] = {}
    for name in names:
        if name not in base:
            of_pile = source_of(name) == "pile"
            way = (
                OF_THE_PILE.get(name, PROFILE) if of_pile else response(name).apparatus
            )
            found.setdefault(way, []).append(name)
    return {way: tuple(members) for way, members in found.items()}


def minutes_of(way: str, minutes: Mapping[str, float]) -> float:
    """Count an experimenter's work for a way [minutes], all repetitions together.

    `minutes` is `second_responses.minutes` of the configuration; InputError if it lacks the way.
    """
    if way not in minutes:
        allowed = f"minutes of work for {way}, beside {', '.join(minutes)}"
        raise InputError(
            "configuration", "second_responses.minutes", list(minutes), allowed
        )
    return float(minutes[way])

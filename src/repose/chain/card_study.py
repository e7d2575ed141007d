"""The study of a material card: its configuration holds what the card does not."""

import math
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from repose.chain import card as cards
from repose.core.errors import InputError

CONFIG = "config.json"
AGREEMENT = 1e-6  # relative


def read(card_json: str | PathLike) -> dict[str, Any]:
    """The card of a study that was simulated by this program; the card of another simulator raises InputError."""
    found = cards.read(card_json)
    if "simulator" in found:
        allowed = "none: the card of a study that was poured here"
        raise InputError(card_json, "simulator", found["simulator"], allowed)
    return found


def configuration_beside(card_json: str | PathLike) -> Path:
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
    """Raise InputError if card and configuration differ in label, grain, wall, contact laws or a bench test.

    `berry` is the content of the file of the verb ``berry``.
    """
    unlike = list(_differences(card, config, berry))
    if unlike:
        key, mine, theirs = unlike[0]
        allowed = f"{theirs}, as in {source}: card and configuration of one study"
        others = ", ".join(key for key, *_ in unlike[1:])
        raise InputError(card_json, key, mine, allowed + (f"; other differences: {others}" if others else ""))


def _differences(card, config, berry) -> Iterator[tuple[str, Any, Any]]:
    """The differences of the two: key, the card's value, the configuration's."""
    axes = [berry[key] for key in ("long_mm", "major_mm", "minor_mm")]
    theirs = {"material": config["label"], "grain.mean_axes_mm": axes}
    theirs |= {f"grain.{key}": berry[key] for key in cards.GRAIN}
    theirs |= {f"wall.{key}": config["wall"][key] for key in cards.WALL}
    theirs |= {f"laws.{key}": law for key, law in cards.laws(config).items()}
    mine = {"material": card["material"]}
    mine |= {
        f"{part}.{key}": value for part in ("grain", "wall", "laws") for key, value in card[part].items()
    }
    for test in card["tests"]:
        section, name = config.get(test["apparatus"], {}), test["apparatus"]
        mine |= {f"{name}.{key}": value for key, value in test["bench"].items()}
        theirs |= {f"{name}.{key}": section.get(key) for key in test["bench"]}
    for key, value in theirs.items():
        if not _same(mine.get(key), value):
            yield key, mine.get(key), value


def _same(one, other):
    """Whether two values are the same; numbers to the precision of a file."""
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=AGREEMENT)
    return one == other

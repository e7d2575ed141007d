"""The cards that come with the program, and which of them is nearest to a grain."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from repose.common.errors import InputError
from repose.common.places import root
from repose.stages import card
from repose.stages.card_text import MET

GOJI = ("results/published/recommended/card.json", "results/published/fast/card.json")
SIZES = (
    "berries",
    "inlet_diameter_mm",
    "outlet_diameter_mm",
    "outlet_height_mm",
    "plate_diameter_mm",
)  # of the rig
SAME = 0.005
FAR = 0.3  # largest logarithm of a ratio that still is a similar grain: axes or density differ by a third


def library() -> dict[Path, dict[str, Any]]:
    """Read all cards that come with the program, by their files."""
    paths = [*sorted(root().glob("crops/cards/*.json")), *map(root().joinpath, GOJI)]
    return {path: card.read(path) for path in paths if path.is_file()}


def axes_of(words: str) -> list[float]:
    """Read the full axes [mm] of a grain, such as 6x3x2.6, or 5 for a sphere; the longest comes first."""
    parts = [part.strip() for part in re.split("[x*]", words.lower())]
    axes = [float(part) for part in parts if re.fullmatch(r"\d*\.?\d+", part)]
    if len(parts) not in (1, 3) or len(axes) != len(parts) or min(axes) <= 0:
        raise InputError(
            "command line",
            "--like",
            words,
            "three full axes in mm, such as 6x3x2.6, or one diameter",
        )
    return sorted(axes * (3 // len(axes)), reverse=True)


def difference(
    grain: Mapping[str, Any], axes_mm: Sequence[float], density_kg_m3: float | None
) -> float:
    """Compute the root mean square of the logarithms of the ratios of axes and density."""
    pairs = [*zip(sorted(grain["mean_axes_mm"], reverse=True), axes_mm, strict=True)]
    if density_kg_m3 is not None:
        pairs.append((grain["density_kg_m3"], density_kg_m3))
    return math.sqrt(
        sum(math.log(own / other) ** 2 for own, other in pairs) / len(pairs)
    )


def found(axes_mm: Sequence[float], density_kg_m3: float | None) -> Iterator[str]:
    """Describe the cards of the library, the one of the most similar grain first."""
    cards = library()
    far = {
        path: difference(one["grain"], axes_mm, density_kg_m3)
        for path, one in cards.items()
    }
    for path in sorted(far, key=lambda path: far[path]):
        yield from _described(path, cards[path], far[path])
    if min(far.values(), default=math.inf) > FAR:
        yield "No card has a similar grain: parameters of these are a first guess at best; `repose new` begins a study."


def _described(path: Path, one: Mapping[str, Any], far: float) -> Iterator[str]:
    """Describe a card: its grain, the rig, the line of the angle, the version, the family of equal answers."""
    grain, made = one["grain"], one["made_by"]
    axes = " x ".join(f"{axis:.4g}" for axis in grain["mean_axes_mm"])
    words = "the same" if far < SAME else f"differs by {100 * math.expm1(far):.0f} %"
    yield f"{path}: {axes} mm, {grain['density_kg_m3']:.4g} kg/m3, {grain['shape']}; {words}"
    for test in one["tests"]:
        line = test.get("line") or test["definition"]["name"]
        yield f"  {test['response']} {test['measured']:.4g} {test['unit']} ({line})"
    for name, bench in {
        test["apparatus"]: test["bench"] for test in one["tests"] if test["bench"]
    }.items():
        yield f"  {name}: {', '.join(f'{key} {value:g}' for key, value in bench.items() if key.endswith(SIZES))}"
    for name, part in one["parameters"].items():
        family = (
            "fixed"
            if part["low"] is None
            else f"{part['low']:.3g} to {part['high']:.3g}"
        )
        yield f"  {name:7} {part['value']:<6.3g} {family}"
    pairs = (
        (abs(r), f"{a} and {b} {r:+.2f}")
        for a, row in one["correlations"].items()
        for b, r in row.items()
        if a < b
    )
    together = [words for size, words in sorted(pairs, reverse=True)[:3] if size > 0]
    yield f"  answers as good are correlated: {', '.join(together) or 'not known'}"
    yield f"  to: {one['interval']}; targets {MET[one['met']]}; repose {made['version']}, engine {made['engine']}"

"""The number of grains that a poured pile needs, since its angle and Height depend on it.

The table beside this module has piles of two grains in a funnel whose lengths go with the cube root of the number
(`benchmarks/number_of_grains.py`). An angle that is fitted to a flank grows with the number: the flat toe, as high as a
grain, becomes a smaller part of it.
"""

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose.bench.funnel import NAME, FunnelSettings
from repose.bench.settings import SceneSettings
from repose.common.section import AUTO

if TYPE_CHECKING:
    import pandas as pd

TABLE = Path(__file__).with_name("number_of_grains.csv")
LENGTHS = ("outlet_height_mm", "plate_diameter_mm", "tube_length_mm")
# What follows from the other keys of a smaller scene.
COMPUTED = ("factory_diameter_mm", "factory_height_mm", "duration_s")
# What a smaller scene has to say.
OUTLET = ("outlet_diameter_mm", "rim_radius_mm", "cone_angle_deg")
PASTED = ("berries", "inlet_diameter_mm", *LENGTHS, *OUTLET, "rate_per_s")
DISCHARGE = (
    2.5  # a funnel's flow goes with its lengths to this power (Beverloo et al. 1961)
)
OUTLET_GRAINS = 4.0  # narrowest outlet of a smaller scene, in diameters of a grain: one by one they bounce away
COST = (
    7 / 6
)  # time of a pour goes with the number to this power: its bodies, and the time of discharge
CLOSE_DEG = 1.0
STEADY = "secant"  # the angle that depends least on the number of grains
TABULATED = {
    "straightest": "flank"
}  # the definition of the table that is nearest to one that it lacks
LARGE = 1000  # from so many grains on a smaller scene is worth a sentence

Config = Mapping[str, Any]


class Change(NamedTuple):
    """Effect of another number of grains, the mean over the crops of the table."""

    angle_deg: float  # added to the angle
    height: float  # factor of the Height, besides that of the lengths


@functools.cache
def _table() -> "pd.DataFrame":
    import pandas as pd  # not by the processes that pour and measure, of which there are hundreds

    return pd.read_csv(TABLE)


def numbers() -> list[int]:
    """List the numbers of grains for which the table has piles of every crop."""
    table = _table()
    counts = table.groupby("grains")["label"].nunique()
    return counts.index[counts == table["label"].nunique()].tolist()


def change(before: float, after: float, definition: str) -> Change:
    """Find the change of a pile whose scene has another number of grains; clamped at the ends of the table."""
    angles, heights = [], []
    for _, own in _table().groupby("label"):
        first, last = (
            [
                np.interp(np.log(number), np.log(own["grains"]), own[column])
                for number in (before, after)
            ]
            for column in (f"aor_{definition}_deg", "height_scaled_mm")
        )
        angles.append(first[1] - first[0])
        heights.append(last[1] / last[0])
    return Change(float(np.mean(angles)), float(np.mean(heights)))


def scaled(
    funnel: FunnelSettings, grains: int, diameter_mm: float, poured: int | None = None
) -> dict[str, Any]:
    """Write the section `funnel` for another number of grains of the same size.

    All lengths go with the cube root of the number. The outlet stays as wide as `OUTLET_GRAINS` diameters of a grain,
    or as it is where it is narrower. `poured` is the number that this funnel poured, if it is not the section's.
    """
    scale = (grains / (poured or funnel.berries)) ** (1 / 3)
    inlet, outlet = funnel.inlet_diameter_mm, funnel.outlet_diameter_mm
    narrow = max(scale * outlet, min(outlet, OUTLET_GRAINS * diameter_mm))
    wide = max(scale * inlet, min(inlet, 2 * narrow))
    section = funnel.model_dump() | {
        key: scale * getattr(funnel, key) for key in LENGTHS
    }
    section |= {
        "inlet_diameter_mm": wide,
        "outlet_diameter_mm": narrow,
        "berries": grains,
    }
    section["rim_radius_mm"] = min(
        funnel.rim_radius_mm, 0.24 * (wide - narrow)
    )  # 0.25: no cone is left
    section["rate_per_s"] = funnel.rate_per_s * scale**DISCHARGE
    return section | dict.fromkeys(COMPUTED, AUTO)


def enough(grains: int, definition: str) -> int | None:
    """Find the smallest number of the table whose angle is within `CLOSE_DEG` of that of more grains; else None."""
    found = None
    for number in sorted((n for n in numbers() if n < grains), reverse=True):
        if abs(change(grains, number, definition).angle_deg) > CLOSE_DEG:
            break
        found = number
    return found


def advice(
    config: Config, diameter_mm: float, height_mm: float, poured: int | None = None
) -> Iterator[str]:
    """Yield sentences on the number of grains of a pour, and a smaller scene as keys to paste.

    `poured` is the number that the targets need, if it is more than the configured one.
    """
    settings = SceneSettings(config)
    funnel, definition = (
        settings.section(NAME, FunnelSettings),
        settings.measure_of({}).response,
    )
    definition = TABULATED.get(definition, definition)
    grains, least, largest = poured or funnel.berries, min(numbers()), max(numbers())
    compared = min(grains, largest)
    half = change(compared, compared / 2, definition)
    fewer, steady = enough(compared, definition), enough(compared, STEADY)
    close = f"within {CLOSE_DEG:g} deg of that of {compared}"
    stays = f"no smaller number is {close}" + (
        f", but the {STEADY} from {steady} on" if steady else ""
    )
    yield (
        f"grains: the pile is {height_mm / diameter_mm:.2g} grains high. Simulate as many as were poured: half as "
        f"many, in a funnel of 0.79 of the size, change the angle ({definition}) by {half.angle_deg:+.1f} deg, and the "
        f"Height by {100 * (half.height - 1):+.0f} % besides its size; "
        + (f"from {fewer} grains on it is {close}" if fewer else stays)
    )
    if grains < LARGE:
        return
    if fewer is None and grains <= largest:
        yield (
            f"smaller scene: none of {least} to {largest} grains keeps the angle ({definition}) within "
            f"{CLOSE_DEG:g} deg: pour fewer grains by hand, and simulate those"
        )
        return
    number = fewer or largest
    other = change(grains, number, definition)
    high = (number / grains) ** (1 / 3) * other.height
    angle = (
        f"{other.angle_deg:+.1f} deg"
        if fewer
        else "not known: it grows with the number of grains"
    )
    beyond = (
        ""
        if grains <= largest
        else f"; piles of more than {largest} grains have not been compared"
    )
    yield (
        f"smaller scene: {number} grains take {(number / grains) ** COST:.1g} of the time of {grains}; "
        f"angle ({definition}) {angle}, Height {high:.2g} of the target's{beyond}. Pour such a pile by hand, and give "
        "its targets in place of these:"
    )
    keys = scaled(funnel, number, diameter_mm, grains)
    pasted = {key: _rounded(keys[key]) for key in PASTED} | dict.fromkeys(
        COMPUTED, AUTO
    )
    yield _as_yaml(NAME, pasted)
    targets = settings.targets_of(NAME)
    if any(target["response"] == "height_mm" for target in targets):
        yield _as_yaml(
            "targets", [_lower(target, high) for target in config["targets"]]
        )


def _lower(target: dict[str, Any], share: float) -> dict[str, Any]:
    """Copy a target; scale the Height by a share."""
    share = share if target["response"] == "height_mm" else 1.0
    numbers = {key: _rounded(share * target[key]) for key in ("value", "sd")}
    return (
        target | numbers | {"range": [_rounded(share * end) for end in target["range"]]}
    )


def _rounded(number: object) -> object:
    return float(f"{number:.5g}") if isinstance(number, float) else number


def _as_yaml(key: str, value: object) -> str:
    """Write a key in one line, as a configuration takes it."""
    import yaml

    return yaml.safe_dump(
        {key: value}, default_flow_style=True, sort_keys=False, width=10**6
    ).strip()[1:-1]

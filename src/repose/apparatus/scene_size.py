"""The number of grains that a poured pile needs, since its angle and Height depend on it.

The table beside this module has piles of two grains in a funnel whose lengths go with the cube root of the number
(`benchmarks/number_of_grains.py`). An angle that is fitted to a flank grows with the number: the flat toe, as high as a
grain, becomes a smaller part of it.
"""

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

TABLE = Path(__file__).with_name("number_of_grains.csv")
LENGTHS = (
    "inlet_diameter_mm",
    "outlet_height_mm",
    "plate_diameter_mm",
    "factory_diameter_mm",
    "factory_height_mm",
)
# What a smaller scene has to say; the place where grains begin and the duration follow from these.
PASTED = (
    "inlet_diameter_mm",
    "outlet_diameter_mm",
    "cone_angle_deg",
    "outlet_height_mm",
    "plate_diameter_mm",
    "rate_per_s",
)
DISCHARGE = 2.5  # a funnel's flow goes with its lengths to this power (Beverloo et al. 1961)
OUTLET_GRAINS = (
    4.0  # narrowest outlet of a smaller scene, in diameters of a grain: one by one they bounce away
)
COST = 7 / 6  # time of a pour goes with the number to this power: its bodies, and the time of discharge
CLOSE_DEG = 1.0
LARGE = 1000  # from so many grains on a smaller scene is worth a sentence

Config = Mapping[str, Any]


class Change(NamedTuple):
    """Effect of another number of grains, the mean over the crops of the table."""

    angle_deg: float  # added to the angle
    height: float  # factor of the Height, besides that of the lengths


@functools.cache
def _table():
    import pandas as pd  # not by the processes that pour and measure, of which there are hundreds

    return pd.read_csv(TABLE)


def numbers() -> list[int]:
    """Numbers of grains of which the table has piles of every crop."""
    table = _table()
    counts = table.groupby("grains")["label"].nunique()
    return counts.index[counts == table["label"].nunique()].tolist()


def change(before: float, after: float, definition: str) -> Change:
    """Change of a pile whose scene is scaled to another number of grains; beyond the table as at its end."""
    angles, heights = [], []
    for _, own in _table().groupby("label"):
        first, last = (
            [np.interp(np.log(number), np.log(own["grains"]), own[column]) for number in (before, after)]
            for column in (f"aor_{definition}_deg", "height_scaled_mm")
        )
        angles.append(first[1] - first[0])
        heights.append(last[1] / last[0])
    return Change(float(np.mean(angles)), float(np.mean(heights)))


def scaled(funnel: Mapping[str, Any], grains: int, diameter_mm: float) -> dict[str, Any]:
    """The section `funnel` for another number of grains of the same size, all lengths by the cube root of the number.

    The outlet stays as wide as `OUTLET_GRAINS` diameters of a grain, or as it is where it is narrower.
    """
    scale = (grains / funnel["berries"]) ** (1 / 3)
    section = dict(funnel) | {key: scale * funnel[key] for key in LENGTHS}
    outlet = funnel["outlet_diameter_mm"]
    section["outlet_diameter_mm"] = max(scale * outlet, min(outlet, OUTLET_GRAINS * diameter_mm))
    room = max(section["factory_diameter_mm"], section["outlet_diameter_mm"])
    section["factory_diameter_mm"] = min(room, section["inlet_diameter_mm"])
    return section | {"berries": grains, "rate_per_s": funnel["rate_per_s"] * scale**DISCHARGE}


def enough(grains: int, definition: str) -> int | None:
    """Smallest number of the table whose angle is within `CLOSE_DEG` of that of more grains; None if there is none."""
    found = None
    for number in sorted((n for n in numbers() if n < grains), reverse=True):
        if abs(change(grains, number, definition).angle_deg) > CLOSE_DEG:
            break
        found = number
    return found


def advice(config: Config, diameter_mm: float, height_mm: float) -> Iterator[str]:
    """Sentences on the number of grains of a pour."""
    funnel, definition = config["funnel"], config["measure"]["response"]
    grains, largest = funnel["berries"], max(numbers())
    half = change(min(grains, largest), min(grains, largest) / 2, definition)
    yield (
        f"grains: the pile is {height_mm / diameter_mm:.2g} grains high. Simulate as many as were poured: half as "
        f"many, in a funnel of 0.79 of the size, change the angle ({definition}) by {half.angle_deg:+.1f} deg, and the "
        f"Height by {100 * (half.height - 1):+.0f} % besides its size"
    )
    if grains < LARGE:
        return
    fewer = enough(min(grains, largest), definition)
    if fewer is None:
        yield (
            f"smaller scene: none of {min(numbers())} to {largest} grains keeps the angle ({definition}) within "
            f"{CLOSE_DEG:g} deg: pour fewer grains by hand, and simulate those"
        )
        return
    keys = scaled(funnel, fewer, diameter_mm)
    pasted = ", ".join(f"{key}: {keys[key]:.4g}" for key in PASTED)
    other = change(grains, fewer, definition)
    beyond = "" if grains <= largest else f"; piles of more than {largest} grains have not been compared"
    yield (
        f"smaller scene: {fewer} grains take {(fewer / grains) ** COST:.1g} of the time; angle ({definition}) "
        f"{other.angle_deg:+.1f} deg, Height {(fewer / grains) ** (1 / 3) * other.height:.2g} of the target's{beyond}: "
        f"funnel: {{berries: {fewer}, {pasted}}}"
    )

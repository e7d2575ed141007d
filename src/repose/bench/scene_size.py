"""Find how many grains a poured pile needs, since angle and Height depend on it."""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose.bench.funnel import NAME, FunnelSettings
from repose.bench.settings import SceneSettings
from repose.common.section import AUTO

if TYPE_CHECKING:
    import pandas as pd

TABLE = Path(__file__).with_name("number_of_grains.csv")
# Lengths of the funnel that go with the cube root of the number.
SCALED_KEYS = ("outlet_height_mm", "plate_diameter_mm", "tube_length_mm")
# Keys of a smaller scene that follow from its others.
COMPUTED_KEYS = ("factory_diameter_mm", "factory_height_mm", "duration_s")
# Keys that a smaller scene has to give.
PASTED_KEYS = (
    "berries",
    "inlet_diameter_mm",
    *SCALED_KEYS,
    "outlet_diameter_mm",
    "rim_radius_mm",
    "cone_angle_deg",
    "rate_per_s",
)
# Power of its lengths with which a funnel's flow goes (Beverloo et al. 1961).
FLOW_EXPONENT = 2.5
# Narrowest outlet of a smaller scene in diameters of a grain: one by one they bounce away.
OUTLET_GRAINS = 4.0
# Widest rim of a smaller scene over inlet minus outlet; at 0.25 no cone is left.
RIM_SHARE = 0.24
# Power of the number with which the time of a pour goes: its bodies, and their discharge.
TIME_EXPONENT = 7 / 6
# Largest difference of angles that are close.
ANGLE_TOLERANCE_DEG = 1.0
# The angle that depends least on the number of grains.
STEADIEST_ANGLE = "secant"
# Definition in the table that is nearest to one that it lacks.
TABULATED = {"straightest": "flank"}
# Number of grains from which on a smaller scene is proposed.
LARGE_SCENE = 1000

Config = Mapping[str, Any]


class Change(NamedTuple):
    """Effect of another number of grains, the mean over the crops of the table."""

    angle_deg: float  # added to the angle
    height: float  # factor of the Height, besides that of the lengths


@functools.cache
def _read_piles() -> "pd.DataFrame":
    """Read the table of poured piles: a row for each crop and number of grains."""
    # Hundreds of processes pour and measure without pandas, which is slow to import.
    import pandas as pd

    return pd.read_csv(TABLE)


def numbers() -> list[int]:
    """List the numbers of grains for which the table has piles of every crop."""
    piles = _read_piles()
    n_crops = piles["label"].nunique()
    crops_per_number = piles.groupby("grains")["label"].nunique()
    has_every_crop = crops_per_number == n_crops
    return crops_per_number.index[has_every_crop].tolist()


def change(before: float, after: float, definition: str) -> Change:
    """Find how angle and Height of a pile change with the number of grains.

    They are interpolated in the table of poured piles, over the logarithm of the
    number, and averaged over its crops. Numbers outside the table count as its ends.

    Parameters
    ----------
    before, after : float
        The numbers of grains.
    definition : str
        Definition of the angle, a column of the table.

    Returns
    -------
    Change
        What is added to the angle, and the factor of the Height besides that of the
        lengths.
    """
    log_before = np.log(before)
    log_after = np.log(after)
    angle_changes = []
    height_ratios = []
    for _, crop in _read_piles().groupby("label"):
        log_numbers = np.log(crop["grains"])
        angles = crop[f"aor_{definition}_deg"]
        angle_before = np.interp(log_before, log_numbers, angles)
        angle_after = np.interp(log_after, log_numbers, angles)
        angle_changes.append(angle_after - angle_before)
        heights = crop["height_scaled_mm"]
        height_before = np.interp(log_before, log_numbers, heights)
        height_after = np.interp(log_after, log_numbers, heights)
        height_ratios.append(height_after / height_before)
    return Change(
        angle_deg=float(np.mean(angle_changes)), height=float(np.mean(height_ratios))
    )


def scaled(
    funnel: FunnelSettings, grains: int, diameter_mm: float, poured: int | None = None
) -> dict[str, Any]:
    """Write the section `funnel` for another number of grains of the same size.

    All lengths go with the cube root of the number. The outlet stays as wide as
    `OUTLET_GRAINS` diameters of a grain, or as it is where it is narrower.

    Parameters
    ----------
    funnel : FunnelSettings
        The section.
    grains : int
        The other number.
    diameter_mm : float
        Diameter of a grain.
    poured : int, optional
        Number of grains for which the funnel of the section has its lengths; by default
        the section's `berries`.

    Returns
    -------
    dict
        The section by key. Keys that are computed are ``auto``.
    """
    n_poured = poured or funnel.berries
    scale = (grains / n_poured) ** (1 / 3)
    inlet_mm = funnel.inlet_diameter_mm
    outlet_mm = funnel.outlet_diameter_mm
    # Grains that leave a narrower outlet one by one bounce away.
    narrowest_outlet_mm = min(outlet_mm, OUTLET_GRAINS * diameter_mm)
    new_outlet_mm = max(scale * outlet_mm, narrowest_outlet_mm)
    # The inlet stays twice as wide as the outlet, or as it is where it is narrower.
    narrowest_inlet_mm = min(inlet_mm, 2 * new_outlet_mm)
    new_inlet_mm = max(scale * inlet_mm, narrowest_inlet_mm)
    largest_rim_mm = RIM_SHARE * (new_inlet_mm - new_outlet_mm)

    section = funnel.model_dump()
    for key in SCALED_KEYS:
        section[key] = scale * getattr(funnel, key)
    section["inlet_diameter_mm"] = new_inlet_mm
    section["outlet_diameter_mm"] = new_outlet_mm
    section["berries"] = grains
    section["rim_radius_mm"] = min(funnel.rim_radius_mm, largest_rim_mm)
    section["rate_per_s"] = funnel.rate_per_s * scale**FLOW_EXPONENT
    return section | dict.fromkeys(COMPUTED_KEYS, AUTO)


def fewest_grains(grains: int, definition: str) -> int | None:
    """Find the smallest number of grains with nearly the angle of `grains` grains.

    From this number of the table on, the angle differs by at most
    `ANGLE_TOLERANCE_DEG`.

    Parameters
    ----------
    grains : int
        The number of grains to compare with.
    definition : str
        Definition of the angle, a column of the table.

    Returns
    -------
    int or None
        The number; None if no smaller number of the table is enough.
    """
    fewest = None
    smaller_numbers = [number for number in numbers() if number < grains]
    # Go down the table until the angle differs too much.
    for number in sorted(smaller_numbers, reverse=True):
        angle_change_deg = change(grains, number, definition).angle_deg
        if abs(angle_change_deg) > ANGLE_TOLERANCE_DEG:
            break
        fewest = number
    return fewest


# --- advice ---------------------------------------------------------------------------


@dataclass(frozen=True)
class SmallerScene:
    """A scene of fewer grains, which takes less time."""

    n_grains: int  # of the whole scene
    n_fewer: int  # of the smaller one
    angle_change_deg: float | None  # None where it is not known
    height_share: float  # Height over that of the whole scene

    @property
    def time_share(self) -> float:
        """Time of a pour over that of the whole scene."""
        return (self.n_fewer / self.n_grains) ** TIME_EXPONENT


def smaller_scene(n_grains: int, definition: str) -> SmallerScene | None:
    """Find the smallest scene with nearly the angle of a larger one.

    Parameters
    ----------
    n_grains : int
        Number of grains of the larger scene.
    definition : str
        Definition of the angle, a column of the table.

    Returns
    -------
    SmallerScene or None
        None if no smaller number of the table has that angle. For more grains than the
        table has, it is then a scene of the table's largest number, whose change of the
        angle is unknown.
    """
    largest_tabulated = max(numbers())
    n_enough = fewest_grains(min(n_grains, largest_tabulated), definition)
    if n_enough is not None:
        effect = change(n_grains, n_enough, definition)
        return SmallerScene(
            n_grains=n_grains,
            n_fewer=n_enough,
            angle_change_deg=effect.angle_deg,
            height_share=(n_enough / n_grains) ** (1 / 3) * effect.height,
        )
    if n_grains <= largest_tabulated:
        return None
    # The table does not reach the larger scene, so the change of the angle is unknown.
    effect = change(n_grains, largest_tabulated, definition)
    return SmallerScene(
        n_grains=n_grains,
        n_fewer=largest_tabulated,
        angle_change_deg=None,
        height_share=(largest_tabulated / n_grains) ** (1 / 3) * effect.height,
    )


def advice(
    config: Config, diameter_mm: float, height_mm: float, poured: int | None = None
) -> Iterator[str]:
    """Yield sentences of advice on the number of grains of a pour.

    For a large scene, they include a smaller one as keys of a configuration.

    Parameters
    ----------
    config : mapping
        The configuration.
    diameter_mm, height_mm : float
        Diameter of a grain, and Height of the pile.
    poured : int, optional
        Number of grains that the targets need, if it is more than the configured one;
        by default the configured one.

    Yields
    ------
    str
        Sentences, and lines of YAML that can be pasted into the configuration.
    """
    settings = SceneSettings(config)
    funnel = settings.section(NAME, FunnelSettings)
    response = settings.measure_of({}).response
    definition = TABULATED.get(response, response)
    n_grains = poured or funnel.berries

    yield (
        f"grains: the pile is {height_mm / diameter_mm:.2g} grains high. "
        f"{_describe_half(n_grains, definition)} "
        f"{_describe_enough(n_grains, definition)} "
        "Simulate as many grains as were poured."
    )
    if n_grains >= LARGE_SCENE:
        yield from _propose_smaller_scene(settings, n_grains, definition, diameter_mm)


def _propose_smaller_scene(
    settings: SceneSettings, n_grains: int, definition: str, diameter_mm: float
) -> Iterator[str]:
    """Yield sentences about a smaller scene, and its keys as lines of YAML.

    Parameters
    ----------
    settings : SceneSettings
        Sections of the configuration.
    n_grains : int
        Number of grains of the whole scene.
    definition : str
        Definition of the angle, a column of the table.
    diameter_mm : float
        Diameter of a grain.
    """
    scene = smaller_scene(n_grains, definition)
    if scene is None:
        tabulated_numbers = numbers()
        yield (
            f"smaller scene: none of {min(tabulated_numbers)} to "
            f"{max(tabulated_numbers)} grains keeps the {definition} angle within "
            f"{ANGLE_TOLERANCE_DEG:g} deg. Pour fewer grains by hand, "
            "and simulate those."
        )
        return
    yield f"smaller scene: {_describe_scene(scene, definition)}"
    funnel = settings.section(NAME, FunnelSettings)
    yield _write_yaml_line(NAME, _make_pasted_section(funnel, scene, diameter_mm))
    targets = settings.targets_of(NAME)
    if any(target["response"] == "height_mm" for target in targets):
        # A smaller pile is lower, so its Height needs another target.
        scaled_targets = [
            _scale_target(target, scene.height_share)
            for target in settings.config["targets"]
        ]
        yield _write_yaml_line("targets", scaled_targets)


def _describe_half(n_grains: int, definition: str) -> str:
    """Describe the effect of half of the grains, in a funnel that is as much smaller.

    Parameters
    ----------
    n_grains : int
        Number of grains to compare with. A larger number than the table has counts as
        its largest.
    definition : str
        Definition of the angle, a column of the table.
    """
    n_reference = min(n_grains, max(numbers()))
    half = change(n_reference, n_reference / 2, definition)
    direction = "lower" if half.angle_deg < 0 else "raise"
    height_percent = 100 * (half.height - 1)
    return (
        f"Scale effect: {n_reference / 2:.0f} grains instead of {n_reference} would "
        f"{direction} the {definition} angle by {abs(half.angle_deg):.1f} deg and "
        f"change the Height by {height_percent:+.0f} % besides its size."
    )


def _describe_enough(n_grains: int, definition: str) -> str:
    """Describe from which number of grains on the angle hardly changes.

    If there is no such number, it is described for the angle that depends least on it.

    Parameters
    ----------
    n_grains : int
        Number of grains to compare with.
    definition : str
        Definition of the angle, a column of the table.
    """
    n_reference = min(n_grains, max(numbers()))
    close = f"within {ANGLE_TOLERANCE_DEG:g} deg of that of {n_reference}"
    n_enough = fewest_grains(n_reference, definition)
    if n_enough is not None:
        return f"From {n_enough} grains on the angle is {close}."
    n_steady = fewest_grains(n_reference, STEADIEST_ANGLE)
    if n_steady is None:
        return f"No smaller number of grains is {close}."
    return (
        f"No smaller number of grains is {close}; the {STEADIEST_ANGLE} angle is from "
        f"{n_steady} on."
    )


def _describe_scene(scene: SmallerScene, definition: str) -> str:
    """Describe a smaller scene in words: its time, angle and Height.

    Parameters
    ----------
    scene : SmallerScene
        The smaller scene, compared with the larger one.
    definition : str
        Definition of the angle.
    """
    if scene.angle_change_deg is None:
        angle = "grows by an unknown amount with the number of grains"
    else:
        angle = f"changes by {scene.angle_change_deg:+.1f} deg"
    text = (
        f"{scene.n_fewer} grains take {scene.time_share:.1g} of the time of "
        f"{scene.n_grains}; the {definition} angle {angle}, and the Height is "
        f"{scene.height_share:.2g} of the target's."
    )
    largest = max(numbers())
    if scene.n_grains > largest:
        text += f" Piles of more than {largest} grains have not been compared."
    return f"{text} Pour such a pile by hand, and give its targets in place of these:"


def _make_pasted_section(
    funnel: FunnelSettings, scene: SmallerScene, diameter_mm: float
) -> dict[str, Any]:
    """Write the keys of the section `funnel` of a smaller scene."""
    section = scaled(funnel, scene.n_fewer, diameter_mm, poured=scene.n_grains)
    pasted = {key: _rounded(section[key]) for key in PASTED_KEYS}
    return pasted | dict.fromkeys(COMPUTED_KEYS, AUTO)


def _scale_target(target: dict[str, Any], height_share: float) -> dict[str, Any]:
    """Copy a target of a smaller scene.

    The target of the Height is multiplied by `height_share`. Numbers of all targets are
    rounded.
    """
    share = height_share if target["response"] == "height_mm" else 1.0
    return target | {
        "value": _rounded(share * target["value"]),
        "sd": _rounded(share * target["sd"]),
        "range": [_rounded(share * end) for end in target["range"]],
    }


def _rounded(number: object) -> object:
    """Round a float to five digits; leave anything else as it is."""
    return float(f"{number:.5g}") if isinstance(number, float) else number


def _write_yaml_line(key: str, value: object) -> str:
    """Write a key in one line, as a configuration takes it."""
    import yaml

    text = yaml.safe_dump(
        {key: value}, default_flow_style=True, sort_keys=False, width=10**6
    )
    # Leave out the braces around the key.
    return text.strip()[1:-1]

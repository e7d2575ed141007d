"""Find how many grains a poured pile needs.

Angle and Height of a pile depend on the number of its grains. The Height, with a capital
letter, is the response `height_mm`: the height of the pile above the plate. The table
number_of_grains.csv has both for piles of several crops and numbers of grains.
"""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repose.bench.funnel import NAME, FunnelSettings
from repose.bench.settings import SceneSettings
from repose.common.numbers import format_significant
from repose.common.section import AUTO

if TYPE_CHECKING:
    import pandas as pd

TABLE_CSV = Path(__file__).with_name("number_of_grains.csv")
# Lengths of the funnel that are proportional to the cube root of the number of grains.
SCALED_KEYS = ("outlet_height_mm", "plate_diameter_mm", "tube_length_mm")
# Keys of a smaller scene that are computed from its other keys.
COMPUTED_KEYS = ("factory_diameter_mm", "factory_height_mm", "duration_s")
# Keys that are shown when a smaller scene is proposed.
PASTED_KEYS = (
    "berries",
    "inlet_diameter_mm",
    *SCALED_KEYS,
    "outlet_diameter_mm",
    "rim_radius_mm",
    "cone_angle_deg",
    "rate_per_s",
)
# The flow through a funnel is proportional to this power of its lengths (Beverloo et
# al. 1961).
FLOW_EXPONENT = 2.5
# Narrowest outlet of a smaller scene, in diameters of a grain. Grains leave a narrower
# outlet one by one and bounce away.
OUTLET_GRAINS = 4.0
# Largest radius of the rim of a smaller scene, over the difference of the diameters of
# inlet and outlet. At 0.25 no cone would be left.
RIM_SHARE = 0.24
# The time of a pour is proportional to this power of the number of grains. The number
# of bodies contributes 1 to the exponent, and the longer discharge contributes 1/6.
TIME_EXPONENT = 7 / 6
# Largest difference of two angles that are called close.
ANGLE_TOLERANCE_DEG = 1.0
# Definition of the angle that depends least on the number of grains.
STEADIEST_ANGLE = "secant"
# Definitions of the angle that the table lacks, with the most similar one that it has.
TABULATED = {"straightest": "flank"}
# A smaller scene is proposed if a scene has at least this number of grains.
LARGE_SCENE = 1000

Config = Mapping[str, Any]


class Change(NamedTuple):
    """Effect of another number of grains on a pile, averaged over the crops."""

    angle_deg: float  # difference of the angles
    height: float  # ratio of the Heights, each divided by the scale of the lengths


@functools.cache
def _read_piles() -> "pd.DataFrame":
    """Read the table of poured piles: a row for each crop and number of grains."""
    # pandas is slow to import, and the many processes that pour do not need it.
    import pandas as pd

    return pd.read_csv(TABLE_CSV)


def list_tabulated_numbers() -> list[int]:
    """List the numbers of grains for which the table has a pile of every crop."""
    piles = _read_piles()
    n_crops = piles["label"].nunique()
    crops_per_number = piles.groupby("grains")["label"].nunique()
    has_every_crop = crops_per_number == n_crops
    return crops_per_number.index[has_every_crop].tolist()


def interpolate_change(n_before: float, n_after: float, definition: str) -> Change:
    """Interpolate how angle and Height change with the number of grains.

    The table of poured piles is interpolated linearly in the logarithm of the number of
    grains. The changes are averaged over the crops in the table. A number outside the
    table is replaced by the nearest one inside.

    The funnel of the table grows with the number of grains: its lengths are
    proportional to the cube root of the number. The Heights in the table are divided by
    the same factor. So their ratio tells how the Height changes beyond this scaling.

    Parameters
    ----------
    n_before, n_after : float
        The two numbers of grains.
    definition : str
        Definition of the angle, such as "flank", which must be in the table.

    Returns
    -------
    Change
        The difference of the angles, and the ratio of the scaled Heights.
    """
    log_before = np.log(n_before)
    log_after = np.log(n_after)
    angle_changes = []
    height_ratios = []
    for _, crop_piles in _read_piles().groupby("label"):
        # `np.interp` needs ascending numbers, which the table has for each crop.
        log_numbers = np.log(crop_piles["grains"])
        angles = crop_piles[f"aor_{definition}_deg"]
        angle_before = np.interp(log_before, log_numbers, angles)
        angle_after = np.interp(log_after, log_numbers, angles)
        angle_changes.append(angle_after - angle_before)
        heights = crop_piles["height_scaled_mm"]
        height_before = np.interp(log_before, log_numbers, heights)
        height_after = np.interp(log_after, log_numbers, heights)
        height_ratios.append(height_after / height_before)
    return Change(
        angle_deg=float(np.mean(angle_changes)), height=float(np.mean(height_ratios))
    )


def scale_funnel(
    funnel: FunnelSettings, grains: int, diameter_mm: float, poured: int | None = None
) -> dict[str, Any]:
    """Scale the section `funnel` to another number of grains of the same size.

    All lengths are multiplied by the cube root of the ratio of the numbers, so that the
    volume of the funnel stays proportional to that of the grains. However, the outlet
    does not become narrower than `OUTLET_GRAINS` diameters of a grain.

    Parameters
    ----------
    funnel : FunnelSettings
        The section.
    grains : int
        The new number of grains.
    diameter_mm : float
        Diameter of a grain.
    poured : int, optional
        Number of grains for which the lengths of the section are meant. By default, or
        if it is 0, it is the number in the section (`berries`).

    Returns
    -------
    dict
        The scaled section by key. Keys that are computed are ``auto``.
    """
    n_poured = poured or funnel.berries
    scale = (grains / n_poured) ** (1 / 3)
    inlet_mm = funnel.inlet_diameter_mm
    outlet_mm = funnel.outlet_diameter_mm
    # The outlet must be known before the inlet, and both before the rim. An outlet that
    # is already narrow keeps its width.
    narrowest_outlet_mm = min(outlet_mm, OUTLET_GRAINS * diameter_mm)
    new_outlet_mm = max(scale * outlet_mm, narrowest_outlet_mm)
    # The inlet does not become narrower than two outlets, unless it already is.
    narrowest_inlet_mm = min(inlet_mm, 2 * new_outlet_mm)
    new_inlet_mm = max(scale * inlet_mm, narrowest_inlet_mm)
    # The rounded rims of inlet and outlet must leave room for the cone.
    largest_rim_mm = RIM_SHARE * (new_inlet_mm - new_outlet_mm)

    section = funnel.model_dump()
    for key in SCALED_KEYS:
        section[key] = scale * getattr(funnel, key)
    section["inlet_diameter_mm"] = new_inlet_mm
    section["outlet_diameter_mm"] = new_outlet_mm
    section["berries"] = grains
    section["rim_radius_mm"] = min(funnel.rim_radius_mm, largest_rim_mm)
    # Grains are added as quickly as the scaled outlet lets them flow.
    section["rate_per_s"] = funnel.rate_per_s * scale**FLOW_EXPONENT
    return section | dict.fromkeys(COMPUTED_KEYS, AUTO)


def find_fewest_grains(n_grains: int, definition: str) -> int | None:
    """Find the smallest number of grains in the table that gives nearly the same angle.

    The angles of this number and of all larger ones differ by at most
    `ANGLE_TOLERANCE_DEG` from the angle of the given number.

    Parameters
    ----------
    n_grains : int
        The number of grains to compare with.
    definition : str
        Definition of the angle, which must be in the table.

    Returns
    -------
    int or None
        The smallest number; None if no smaller number in the table is enough.
    """
    fewest = None
    smaller_numbers = [
        number for number in list_tabulated_numbers() if number < n_grains
    ]
    # Go down the table until the angle differs too much.
    for number in sorted(smaller_numbers, reverse=True):
        angle_change_deg = interpolate_change(n_grains, number, definition).angle_deg
        if abs(angle_change_deg) > ANGLE_TOLERANCE_DEG:
            break
        fewest = number
    return fewest


# --- advice ---------------------------------------------------------------------------


@dataclass(frozen=True)
class SmallerScene:
    """A scene of fewer grains, which takes less time."""

    n_grains: int  # of the larger scene
    n_fewer: int  # of the smaller scene
    angle_change_deg: float | None  # None if it is unknown
    height_share: float  # ratio of the Height to that of the larger scene

    @property
    def time_share(self) -> float:
        """Ratio of the time of a pour to that of the larger scene."""
        return (self.n_fewer / self.n_grains) ** TIME_EXPONENT


def find_smaller_scene(n_grains: int, definition: str) -> SmallerScene | None:
    """Find the smallest scene whose angle is nearly that of a larger scene.

    The angles come from the table of poured piles. A larger scene that has more grains
    than any pile in the table is compared as if it had the largest number there. That
    number is proposed if no smaller one is enough.

    Parameters
    ----------
    n_grains : int
        Number of grains of the larger scene.
    definition : str
        Definition of the angle, such as "flank", which must be in the table.

    Returns
    -------
    SmallerScene or None
        The smaller scene; None if no number in the table is enough.
    """
    largest_tabulated = max(list_tabulated_numbers())
    n_enough = find_fewest_grains(min(n_grains, largest_tabulated), definition)
    if n_enough is not None:
        # The lengths scale with the cube root of the number of grains. The Height also
        # changes by the factor `effect.height`.
        effect = interpolate_change(n_grains, n_enough, definition)
        return SmallerScene(
            n_grains=n_grains,
            n_fewer=n_enough,
            angle_change_deg=effect.angle_deg,
            height_share=(n_enough / n_grains) ** (1 / 3) * effect.height,
        )
    if n_grains <= largest_tabulated:
        return None
    # The larger scene has more grains than the table, so the change of the angle is
    # unknown. The Height changes as above.
    effect = interpolate_change(n_grains, largest_tabulated, definition)
    return SmallerScene(
        n_grains=n_grains,
        n_fewer=largest_tabulated,
        angle_change_deg=None,
        height_share=(largest_tabulated / n_grains) ** (1 / 3) * effect.height,
    )


def advise(
    config: Config, diameter_mm: float, height_mm: float, poured: int | None = None
) -> Iterator[str]:
    """Yield advice on how many grains to pour.

    For a large scene, the advice proposes a smaller one as lines for the configuration.

    Parameters
    ----------
    config : mapping
        The configuration.
    diameter_mm, height_mm : float
        Diameter of a grain, and Height of the pile: its height above the plate.
    poured : int, optional
        Number of grains that were poured when the targets were measured. By default it
        is the configured number (`berries`).

    Yields
    ------
    str
        Sentences, and lines of YAML that can be pasted into the configuration.
    """
    settings = SceneSettings(config)
    funnel = settings.section(NAME, FunnelSettings)
    # The definition of the angle does not depend on the grain, so the measurements of
    # the grain may be empty here.
    response = settings.measure_of({}).response
    # A definition that the table lacks is replaced by a similar one.
    definition = TABULATED.get(response, response)
    n_grains = poured or funnel.berries

    yield (
        f"grains: the pile is {format_significant(height_mm / diameter_mm, 2)} grains high. "
        f"{_describe_half(n_grains, definition)} "
        f"{_describe_enough(n_grains, definition)} "
        "Simulate as many grains as were poured."
    )
    if n_grains >= LARGE_SCENE:
        yield from _propose_smaller_scene(settings, n_grains, definition, diameter_mm)


def _propose_smaller_scene(
    settings: SceneSettings, n_grains: int, definition: str, diameter_mm: float
) -> Iterator[str]:
    """Yield a sentence about a smaller scene, and its settings as lines of YAML.

    The smaller scene has fewer grains and nearly the same angle. The lines can be
    pasted into the configuration.

    Parameters
    ----------
    settings : SceneSettings
        Sections of the configuration.
    n_grains : int
        Number of grains of the larger scene.
    definition : str
        Definition of the angle, such as "flank". It must be in the table of poured
        piles (`TABLE_CSV`).
    diameter_mm : float
        Diameter of a grain.

    Yields
    ------
    str
        First a sentence. If there is a smaller scene, then the section `funnel`, and
        also all targets if the Height is one of them.
    """
    scene = find_smaller_scene(n_grains, definition)
    if scene is None:
        tabulated_numbers = list_tabulated_numbers()
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
        # A smaller pile is lower, so the target of the Height changes. The other
        # targets are repeated as they are, because a section is pasted as a whole.
        scaled_targets = [
            _scale_target(target, scene.height_share)
            for target in settings.config["targets"]
        ]
        yield _write_yaml_line("targets", scaled_targets)


def _describe_half(n_grains: int, definition: str) -> str:
    """Write how a pile of half as many grains would differ.

    The lengths of the funnel are scaled so that it has half the volume.

    Parameters
    ----------
    n_grains : int
        Number of grains to compare with. If it is larger than all numbers in the table,
        the largest of them replaces it.
    definition : str
        Definition of the angle, which must be in the table.
    """
    n_reference = min(n_grains, max(list_tabulated_numbers()))
    half = interpolate_change(n_reference, n_reference / 2, definition)
    direction = "lower" if half.angle_deg < 0 else "raise"
    # The change of the Height that remains after the lengths of the funnel are scaled.
    height_percent = 100 * (half.height - 1)
    return (
        f"Scale effect: {n_reference / 2:.0f} grains instead of {n_reference} would "
        f"{direction} the {definition} angle by {abs(half.angle_deg):.1f} deg and "
        f"change the Height by {height_percent:+.0f} % besides its size."
    )


def _describe_enough(n_grains: int, definition: str) -> str:
    """Write from which number of grains on the angle stays nearly the same.

    If no smaller number in the table is large enough, the sentence says so. It then
    names the number for the `STEADIEST_ANGLE`, the definition whose angle depends least
    on the number of grains.

    Parameters
    ----------
    n_grains : int
        Number of grains to compare with. If it is larger than all numbers in the table,
        the largest of them replaces it.
    definition : str
        Definition of the angle, such as "flank". It must be in the table.

    Returns
    -------
    str
        One sentence.
    """
    # The table cannot tell anything about a larger number.
    n_reference = min(n_grains, max(list_tabulated_numbers()))
    close = f"within {ANGLE_TOLERANCE_DEG:g} deg of that of {n_reference}"
    n_enough = find_fewest_grains(n_reference, definition)
    if n_enough is not None:
        return f"From {n_enough} grains on the angle is {close}."
    n_steady = find_fewest_grains(n_reference, STEADIEST_ANGLE)
    if n_steady is None:
        return f"No smaller number of grains is {close}."
    return (
        f"No smaller number of grains is {close}; the {STEADIEST_ANGLE} angle is from "
        f"{n_steady} on."
    )


def _describe_scene(scene: SmallerScene, definition: str) -> str:
    """Write how long a smaller scene takes, and how its angle and Height differ.

    The text ends with a colon. The lines of YAML that the caller yields next belong to
    it.

    Parameters
    ----------
    scene : SmallerScene
        The smaller scene, which also describes its differences from the larger one.
    definition : str
        Definition of the angle, such as "flank".
    """
    if scene.angle_change_deg is None:
        angle = "grows by an unknown amount with the number of grains"
    else:
        angle = f"changes by {scene.angle_change_deg:+.1f} deg"
    text = (
        f"{scene.n_fewer} grains take {format_significant(scene.time_share, 1)} of the time of "
        f"{scene.n_grains}; the {definition} angle {angle}, and the Height is "
        f"{format_significant(scene.height_share, 2)} of the target's."
    )
    largest_tabulated = max(list_tabulated_numbers())
    if scene.n_grains > largest_tabulated:
        text += (
            f" Piles of more than {largest_tabulated} grains have not been compared."
        )
    return f"{text} Pour such a pile by hand, and give its targets in place of these:"


def _make_pasted_section(
    funnel: FunnelSettings, scene: SmallerScene, diameter_mm: float
) -> dict[str, Any]:
    """Make the section `funnel` of a smaller scene.

    It contains the keys that a user pastes into a configuration, with rounded numbers.
    """
    section = scale_funnel(funnel, scene.n_fewer, diameter_mm, poured=scene.n_grains)
    pasted = {key: _round_if_float(section[key]) for key in PASTED_KEYS}
    return pasted | dict.fromkeys(COMPUTED_KEYS, AUTO)


def _scale_target(target: dict[str, Any], height_share: float) -> dict[str, Any]:
    """Copy a target for a smaller scene, with rounded numbers.

    Parameters
    ----------
    target : dict
        The target. Only a target of the Height is scaled.
    height_share : float
        Ratio of the Height of the smaller scene to that of the larger scene.
    """
    share = height_share if target["response"] == "height_mm" else 1.0
    return target | {
        "value": _round_if_float(share * target["value"]),
        "sd": _round_if_float(share * target["sd"]),
        "range": [_round_if_float(share * end) for end in target["range"]],
    }


def _round_if_float(value: object) -> object:
    """Round a float to five significant digits. Return any other value unchanged."""
    return float(f"{value:.5g}") if isinstance(value, float) else value


def _write_yaml_line(key: str, value: object) -> str:
    """Write a key and its value as one line of YAML."""
    import yaml

    text = yaml.safe_dump(
        {key: value}, default_flow_style=True, sort_keys=False, width=10**6
    )
    # PyYAML writes the mapping in braces, which are not needed here.
    return text.strip()[1:-1]

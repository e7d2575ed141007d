"""Measure a pile from the final positions of its grains, as a pour saves them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from repose.common.errors import NoFlankError
from repose.measure import pile
from repose.measure.definitions import CALIBRATED_ANGLE, MEAN_KEYS
from repose.measure.saved_pours import Arrays
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import ConvexBody, Grains, SolidBody, draw_silhouette


def pile_responses(
    arrays: Arrays,
    particle: SolidBody,
    settings: MeasureSettings,
    plate_mm: float,
    extra_names: Sequence[str] = (),
) -> tuple[dict[str, Any], dict[str, str]]:
    """Measure the responses of a saved pile: its angles, its height and further ones.

    The angles and the height are always measured. The further responses take more time,
    and are measured only if `extra_names` lists them.

    Parameters
    ----------
    arrays : mapping
        The pour's arrays by name: ``position``, ``quaternion``, ``in_pile`` and, if
        sizes differ, ``scale``.
    particle : SolidBody
        The shape of the grains.
    settings : MeasureSettings
        Settings of the measurement.
    plate_mm : float
        Diameter of the plate.
    extra_names : sequence of str
        Names of responses of `repose.measure.further_responses` to measure, too.

    Returns
    -------
    responses : dict
        The measured responses by name.
    reasons : dict
        The reason why a response is missing, by its name.
    """
    responses: dict[str, Any] = {}
    reasons: dict[str, str] = {}
    grains = Grains.of(arrays, particle)
    try:
        result = pile.measure_pile(grains, settings, arrays["in_pile"])
    except NoFlankError as error:
        # There is no pile to measure, so all responses are missing for the same reason.
        for name in (CALIBRATED_ANGLE, "height_mm", *MEAN_KEYS.values()):
            reasons[name] = error.reason
    else:
        responses |= result.record()
        for definition, reason in result.reasons.items():
            reasons[MEAN_KEYS[definition]] = reason
        # The calibrated angle repeats the angle by the definition `settings.response`.
        if settings.response in result.reasons:
            reasons[CALIBRATED_ANGLE] = result.reasons[settings.response]

    if extra_names:
        from repose.measure import further_responses

        try:
            measured = further_responses.measure_pour(
                arrays, particle, settings, plate_mm
            )
        except NoFlankError as error:
            reasons |= dict.fromkeys(extra_names, error.reason)
        else:
            responses |= {name: measured[name] for name in extra_names}
    return responses, reasons


def draw_side_view(
    arrays: Arrays,
    particle: ConvexBody,
    settings: MeasureSettings,
    azimuth_deg: float = 0.0,
) -> np.ndarray:
    """Draw the silhouette of a pour's pile.

    Parameters
    ----------
    arrays : mapping
        The pour's arrays by name, as for `pile_responses`.
    particle : ConvexBody
        The shape of the grains.
    settings : MeasureSettings
        Scale of the picture, and whether loose grains are left out.
    azimuth_deg : float
        Direction of the view about the z axis.

    Returns
    -------
    ndarray
        The picture (H, W), dark on light; the plate is its lower border.
    """
    grains = Grains.of(arrays, particle)
    if settings.largest_pile_only:
        grains = grains[arrays["in_pile"]]
    return draw_silhouette(grains, azimuth_deg, settings.mm_per_pixel)

"""Responses of a pile from the final positions of its grains."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.common.errors import NoFlankError
from repose.measure import pile
from repose.measure.angles import MEAN_KEYS
from repose.measure.saved_pours import Arrays
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains, silhouette

if TYPE_CHECKING:
    from repose.grain.particle import Particle


def pile_responses(
    arrays: Arrays,
    particle: "Particle",
    settings: MeasureSettings,
    plate_mm: float,
    further: Sequence[str] = (),
) -> tuple[dict[str, Any], dict[str, str]]:
    """Responses of a pile by name, and the reasons for missing ones."""
    responses: dict[str, Any] = {}
    reasons: dict[str, str] = {}
    try:
        seen = pile.measure_pile(
            Grains.of(arrays, particle), settings, arrays["in_pile"]
        )
        responses |= seen.record()
        reasons |= {MEAN_KEYS[name]: why for name, why in seen.reasons.items()}
        if settings.response in seen.reasons:
            reasons["aor_deg"] = seen.reasons[settings.response]
    except NoFlankError as error:
        reasons |= dict.fromkeys(
            ("aor_deg", "height_mm", *MEAN_KEYS.values()), error.reason
        )
    if further:
        from repose.measure import further_responses

        try:
            more = further_responses.of_pour(arrays, particle, settings, plate_mm)
            responses |= {name: more[name] for name in further}
        except NoFlankError as error:
            reasons |= dict.fromkeys(further, error.reason)
    return responses, reasons


def side_view(
    arrays: Arrays,
    particle: "Particle",
    settings: MeasureSettings,
    azimuth_deg: float = 0.0,
) -> np.ndarray:
    """Silhouette (H, W) of a pour's pile, the plate at its lower border; `arrays` as in `pile_responses`."""
    grains = Grains.of(arrays, particle)
    shown = grains[arrays["in_pile"]] if settings.largest_pile_only else grains
    return silhouette(shown, azimuth_deg, settings.mm_per_pixel)

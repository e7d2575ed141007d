"""Responses that a study of further responses tries."""

from collections.abc import Iterable

from repose.calibrate.responses import list_responses
from repose.measure.definitions import CALIBRATED_ANGLE, MEAN_KEYS
from repose.measure.further_responses import BENCH


def offered(targets: Iterable[str], definition: str) -> tuple[str, ...]:
    """List the responses that an experimenter could measure on the same pile.

    They are those of the bench test that are no target yet, in its order. `definition`
    is that of the calibrated angle.
    """
    targeted = {CALIBRATED_ANGLE, *targets}
    if CALIBRATED_ANGLE in targets:
        targeted.add(MEAN_KEYS[definition])
    names = [response.name for response in list_responses(BENCH)]
    return tuple(name for name in names if name not in targeted)

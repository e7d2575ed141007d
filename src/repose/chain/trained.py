"""The trained surrogate of a study, read and checked against the study's targets."""

import os

from repose.core.errors import InputError
from repose.core.responses import Definitions, require_same_definitions
from repose.core.targets import Targets
from repose.surrogate.base import Surrogate, load


def read_surrogate(
    surrogate_json: str | os.PathLike, targets: Targets, definitions: Definitions, source: object
) -> Surrogate:
    """Read the surrogate of the verb network and check it by `require_targets`."""
    model = load(surrogate_json)
    require_targets(model, surrogate_json, targets, definitions, source)
    return model


def require_targets(
    model: Surrogate, path: object, targets: Targets, definitions: Definitions, source: object
) -> None:
    """Refuse a surrogate with other responses than the targets, in another order, or with other definitions of them."""
    if model.outputs != targets.names:
        allowed = f"the responses of the targets, {', '.join(targets.names)}"
        raise InputError(path, "outputs", list(model.outputs), allowed)
    require_same_definitions(model.definitions, path, definitions, source)

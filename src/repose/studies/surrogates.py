"""The trained surrogate that a study asks, once it is known to be of the study's targets."""

import os

from repose.core.errors import InputError
from repose.core.responses import Definitions, require_same_definitions
from repose.core.targets import Targets
from repose.surrogate.base import Surrogate, load


def read_surrogate(
    surrogate_json: str | os.PathLike, targets: Targets, definitions: Definitions, source: object
) -> Surrogate:
    """Read a surrogate of the targets.

    Parameters
    ----------
    surrogate_json : path
        What the verb network wrote.
    targets, definitions, source
        As for `require_targets`.

    Returns
    -------
    Surrogate

    Raises
    ------
    InputError
        For a bad file, and as `require_targets`.
    """
    model = load(surrogate_json)
    require_targets(model, surrogate_json, targets, definitions, source)
    return model


def require_targets(
    model: Surrogate, path: object, targets: Targets, definitions: Definitions, source: object
) -> None:
    """Refuse a surrogate of other responses than the targets', or of other definitions of them.

    Parameters
    ----------
    model : Surrogate
    path : path
        Its file, for the error.
    targets : Targets
        Their responses must be the surrogate's, in the same order.
    definitions : mapping
        How the study defines its responses.
    source : object
        Where these definitions stand, for the error.

    Raises
    ------
    InputError
    """
    if model.outputs != targets.names:
        allowed = f"the responses of the targets, {', '.join(targets.names)}"
        raise InputError(path, "outputs", list(model.outputs), allowed)
    require_same_definitions(model.definitions, path, definitions, source)

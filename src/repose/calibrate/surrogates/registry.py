"""Surrogates by name: make an untrained one, or load a trained one from its file."""

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

from repose.calibrate.scales import SCALES
from repose.calibrate.surrogates.base import REGISTERED, Surrogate
from repose.calibrate.surrogates.settings import AS_PUBLISHED, NetworkSettings
from repose.common.errors import InputError
from repose.common.files import read_json

KEYS = {"surrogate": str, "inputs": list, "outputs": list}


def names() -> tuple[str, ...]:
    """Return the names of all surrogates, in the order of their registration."""
    return tuple(_import_kinds())


def find_surrogate_class(name: str, source: object = "surrogate") -> type[Surrogate]:
    """Return the class that is registered under a name.

    Parameters
    ----------
    name : str
        One of `names`.
    source : object, optional
        A file or a key, which the error names.

    Raises
    ------
    InputError
        If there is no such class.
    """
    kinds = _import_kinds()
    if name not in kinds:
        raise InputError(
            source=source,
            key="surrogate",
            value=name,
            allowed=f"one of {', '.join(sorted(kinds))}",
        )
    return kinds[name]


def _import_kinds() -> dict[str, type[Surrogate]]:
    """Return all surrogates by name.

    Those of the package are imported when the first name is looked up, so that a
    program that needs none starts without waiting for them.
    """
    from repose.calibrate.surrogates import kinds  # noqa: F401

    return REGISTERED


def make(
    name: str, settings: NetworkSettings = AS_PUBLISHED, source: object = "surrogate"
) -> Surrogate:
    """Make an untrained surrogate.

    Parameters
    ----------
    name : str
        One of `names`.
    settings : NetworkSettings, optional
        Settings for `Surrogate.of`; by default the published ones.
    source : object, optional
        A file or a key, which the error names.

    Returns
    -------
    Surrogate

    Raises
    ------
    InputError
        If no surrogate has this name.
    """
    return find_surrogate_class(name, source).of(settings)


def wrap_for_scale(model: Surrogate, scale: Mapping[str, str]) -> Surrogate:
    """Wrap a surrogate so that it learns each input on the input's scale.

    Parameters
    ----------
    model : Surrogate
        The surrogate.
    scale : mapping
        Name of the scale of each input whose scale is not linear.

    Returns
    -------
    Surrogate
        The given surrogate inside a `ScaledInputs`, or the given surrogate itself if
        all scales are linear.
    """
    if not scale:
        return model
    from repose.calibrate.surrogates.scaled_inputs import ScaledInputs

    return ScaledInputs(model, scale)


def load(path: str | os.PathLike, outputs: Sequence[str] | None = None) -> Surrogate:
    """Load a trained surrogate from a file written by `Surrogate.save`.

    Parameters
    ----------
    path : path
        The file.
    outputs : sequence of str, optional
        Responses that the surrogate must have, in this order. By default (None) any
        responses are accepted.

    Returns
    -------
    Surrogate

    Raises
    ------
    InputError
        If the file cannot be read, does not contain a surrogate, or has other
        responses.
    """
    content = read_json(path, KEYS, "a surrogate's JSON file")
    kind = find_surrogate_class(content["surrogate"], path)
    _check_finite(content, path)
    # Damaged content may raise any of these errors in `from_dict`. Catch all of them,
    # and raise one error that names the file, the kind of surrogate and the cause.
    try:
        samples = _check_sample_numbers(content.get("samples", []))
        model = wrap_for_scale(kind.from_dict(content), _check_scale(content))
        # This sets the names of inputs and outputs, which the file has, too.
        model.describe(
            inputs=content["inputs"],
            outputs=content["outputs"],
            definitions=content.get("definitions"),
            samples=samples,
        )
    except (LookupError, ValueError, TypeError, ArithmeticError) as error:
        raise InputError(
            source=path,
            key=kind.name,
            value=repr(error),
            allowed="the content that `save` of this surrogate writes",
        ) from error
    if outputs is not None and model.outputs != tuple(outputs):
        raise InputError(
            source=path,
            key="outputs",
            value=list(model.outputs),
            allowed=f"the targets {', '.join(outputs)}",
        )
    return model


def _check_finite(content: Mapping[str, Any], path: object) -> None:
    """Raise InputError for NaN and infinity, which `Surrogate.save` never writes."""
    try:
        json.dumps(content, allow_nan=False)
    except ValueError:
        raise InputError(
            source=path,
            key="numbers",
            value="not all finite",
            allowed="finite numbers, as in every surrogate",
        ) from None


def _check_scale(content: Mapping[str, Any]) -> Mapping[str, str]:
    """Return the scales of the inputs; ValueError if one is unknown."""
    scale: Mapping[str, str] = content.get("scale", {})
    is_known = set(scale) <= set(content["inputs"]) and set(scale.values()) <= {*SCALES}
    if not is_known:
        raise ValueError(f"scale {scale}")
    return scale


def _check_sample_numbers(samples: Sequence[Any]) -> Sequence[int]:
    """Return numbers of samples; ValueError if they are not distinct integers."""
    are_distinct = len(set(samples)) == len(samples)
    are_integers = all(type(sample) is int for sample in samples)
    if not are_distinct or not are_integers:
        raise ValueError(f"samples {samples}")
    return samples

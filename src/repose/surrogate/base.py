"""What every surrogate can do, the registry of them, and their files.

A surrogate is a fast model of the simulator: it learns the responses of a few hundred simulated parameter sets, and
then gives them for any parameter set, with errors. The rest of the program calls only what stands here::

    model = make("gaussian_process", settings).describe(PARAMETERS, targets.names, definitions)
    model.fit(X, Y).save("surrogate.json")
    mean, std = load("surrogate.json").predict(X_new, return_std=True)

To add a surrogate, write a subclass of `Surrogate` in a module of its own, put `@register("its_name")` above it, import
the module in `repose.surrogate`, and add the name to the key `surrogate` of the configuration's schema.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from repose.core.errors import InputError
from repose.core.files import read_json, write_json
from repose.core.responses import Definitions

KEYS = {"surrogate": str, "inputs": list, "outputs": list}


class Surrogate(ABC):
    """A model of k responses as functions of d parameters.

    Attributes
    ----------
    name : str
        In the configuration and in files; set by `register`.
    inputs, outputs : tuple of str
        Names of the d parameters and of the k responses; set by `describe`.
    definitions : mapping
        For each response the configuration keys, with their values, that define it; set by `describe`.
    samples : tuple of int
        Numbers of the n samples that it was fitted to, in their order; set by `describe`.
    """

    name: ClassVar[str]
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    definitions: Definitions = {}  # noqa: RUF012 - replaced as a whole, never changed in place
    samples: tuple[int, ...] = ()

    @classmethod
    @abstractmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        """An untrained surrogate.

        Parameters
        ----------
        settings : mapping
            The section `network` of the configuration, with `seed`. A surrogate takes the keys that it knows and
            leaves the others.
        """

    @abstractmethod
    def fit(
        self,
        X: np.ndarray,
        Y: np.ndarray,
        *,
        precision: np.ndarray | None = None,
        noise_covariance: np.ndarray | None = None,
    ) -> Self:
        """Learn from samples.

        Parameters
        ----------
        X : array (n, d)
            Parameter sets. A column may be constant.
        Y : array (n, k)
            Their responses, means over seeds.
        precision : array (n,) or (n, k), optional
            The noise variance of a value is one unknown number, divided by the value's precision. Only ratios matter;
            `repose.surrogate.samples.weights_from_errors` makes them from standard errors.
        noise_covariance : array (k, k), optional
            Covariance of the noise of the responses, up to a factor. `precision` is then the same for all responses
            of a sample.

        Raises
        ------
        ValueError
            For other shapes, values that are not finite, or fewer samples than the surrogate needs.
        """

    @abstractmethod
    def predict(self, X: np.ndarray, return_std: bool = False, noise: bool = True):
        """Responses (n, k) at parameter sets X (n, d).

        With `return_std` also their standard deviations (n, k): of one new value with precision 1, or with
        ``noise=False`` of the mean alone.
        """

    @abstractmethod
    def covariance(self, X: np.ndarray) -> np.ndarray:
        """Covariance (n, k, k) of the predicted means at X (n, d), without noise."""

    @abstractmethod
    def shifted(self, offset: np.ndarray) -> Self:
        """A copy that predicts `offset` (k,) more."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """All that `from_dict` needs, as lists and numbers that JSON can hold."""

    @classmethod
    @abstractmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The trained surrogate in a file; KeyError or ValueError when the content is something else.

        `content` is what `to_dict` gave, with `inputs`, `outputs`, `definitions` and `samples`.
        """

    def response_function(self, low: np.ndarray, high: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The prediction as a function of points (n, d) in [-1, 1].

        `low` and `high` (d,) are what -1 and 1 stand for. A search calls this function millions of times.
        """
        middle, half = (np.add(low, high)) / 2, np.subtract(high, low) / 2
        return lambda points: self.predict(middle + points * half)

    def report(self) -> dict[str, Any]:
        """Numbers about the training, for metrics.json."""
        return {}

    def start_rows(self) -> list[dict[str, Any]]:
        """What each start of the training ended with, rows of starts.csv; empty for a method without starts."""
        return []

    def describe(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        definitions: Definitions | None = None,
        samples: Sequence[int] = (),
    ) -> Self:
        """Name the parameters, the responses and their definitions, and the samples of the fit; returns self."""
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self.definitions, self.samples = dict(definitions or {}), tuple(int(sample) for sample in samples)
        return self

    def save(self, path: str | os.PathLike) -> None:
        """Write a JSON file that `load` reads."""
        described = {
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "surrogate": self.name,
            "definitions": self.definitions,
            "samples": list(self.samples),
        }
        write_json(path, described | self.to_dict())


_REGISTRY: dict[str, type[Surrogate]] = {}
Kind = TypeVar("Kind", bound=type[Surrogate])


def register(name: str) -> Callable[[Kind], Kind]:
    """Class decorator that makes a surrogate known by a name.

    Raises
    ------
    ValueError
        If another class has the name.
    """

    def enter(kind: Kind) -> Kind:
        if _REGISTRY.setdefault(name, kind) is not kind:
            raise ValueError(f"surrogate {name!r} is registered already, by {_REGISTRY[name].__name__}")
        kind.name = name
        return kind

    return enter


def names() -> tuple[str, ...]:
    """Names of all surrogates, in the order of their registration."""
    return tuple(_REGISTRY)


def make(name: str, settings: Mapping[str, Any], source: object = "surrogate") -> Surrogate:
    """An untrained surrogate.

    Parameters
    ----------
    name : str
        One of `names`.
    settings : mapping
        As `Surrogate.of` takes them.
    source : object
        Named in the error: a file or a key.

    Raises
    ------
    InputError
        If no surrogate has this name.
    """
    return _kind(name, source).of(settings)


def load(path: str | os.PathLike, outputs: Sequence[str] | None = None) -> Surrogate:
    """The trained surrogate in a file that `Surrogate.save` wrote.

    Parameters
    ----------
    path : path
    outputs : sequence of str, optional
        Responses that the surrogate must have, in this order.

    Raises
    ------
    InputError
        If the file cannot be read, is not a surrogate's, or has other responses.
    """
    content = read_json(path, KEYS, "a surrogate's JSON file")
    kind = _kind(content["surrogate"], path)
    try:
        model = kind.from_dict(content)
    except (KeyError, ValueError, TypeError) as error:
        raise InputError(path, kind.name, repr(error), "as `save` of this surrogate writes it") from error
    model.describe(
        content["inputs"], content["outputs"], content.get("definitions"), content.get("samples", ())
    )
    if outputs is not None and model.outputs != tuple(outputs):
        raise InputError(path, "outputs", list(model.outputs), f"the targets {', '.join(outputs)}")
    return model


def _kind(name: str, source: object) -> type[Surrogate]:
    """The class that is registered by a name."""
    if name not in _REGISTRY:
        raise InputError(source, "surrogate", name, f"one of {', '.join(sorted(_REGISTRY))}")
    return _REGISTRY[name]

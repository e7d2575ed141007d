"""The interface of all surrogates, their registry, and their files.

A surrogate is a fast model of the simulator: it learns the responses of a few hundred simulated parameter sets, and
then gives them for any parameter set, with errors. The rest of the program calls only this interface::

    model = make("gaussian_process", settings).describe(PARAMETERS, targets.names, definitions)
    model.fit(X, Y).save("surrogate.json")
    mean, std = load("surrogate.json").predict(X_new, return_std=True)

To add a surrogate, write a subclass of `Surrogate` in a module of its own, put `@register("its_name")` above it, and
import the module in `repose.calibrate.surrogates`; then the configuration knows the name.
"""

import copy
import json
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Protocol, Self, TypedDict, TypeVar, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.responses import Definitions
from repose.calibrate.surrogates.settings import AS_PUBLISHED, NetworkSettings
from repose.common.errors import InputError, require
from repose.common.files import read_json, write_json

KEYS = {"surrogate": str, "inputs": list, "outputs": list}
Names = Sequence[str]


class Predictor(Protocol):
    """Interface that the posterior and the report require of a model; every `Surrogate` has it."""

    @property
    def name(self) -> str: ...

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        """As `Surrogate.predict`."""

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """As `Surrogate.covariance`."""


class Noise(TypedDict, total=False):
    """What is known of the noise of samples; `Surrogate.fit` explains it."""

    precision: ArrayLike | None
    noise_covariance: ArrayLike | None
    noise_freedom: float


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
    of_all_samples : bool
        Whether a study fits it to all samples, once the split has shown its accuracy on unseen samples.
    is_network : bool
        Whether it is trained from several starts, each until its error on validation samples rises.
    """

    name: ClassVar[str]
    of_all_samples: ClassVar[bool] = True
    is_network: ClassVar[bool] = False
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    definitions: Definitions = {}  # noqa: RUF012 - replaced as a whole, never changed in place
    samples: tuple[int, ...] = ()
    offset_: np.ndarray

    @staticmethod
    def least_samples(inputs: int) -> int:
        """Count the samples that it needs.

        Parameters
        ----------
        inputs : int
            Number d of the parameters.

        Returns
        -------
        int
            0 for a surrogate that any number determines.
        """
        return 0

    @classmethod
    @abstractmethod
    def of(cls, settings: NetworkSettings) -> Self:
        """Make an untrained surrogate.

        Parameters
        ----------
        settings : NetworkSettings
            The section `network` of the configuration. A surrogate takes the keys that it knows and ignores the others.

        Returns
        -------
        Surrogate
        """

    @abstractmethod
    def fit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Learn from samples.

        Parameters
        ----------
        X : array (n, d)
            Parameter sets. A column may be constant.
        Y : array (n, k)
            Their responses, means over seeds.
        precision : array (n,) or (n, k), optional
            The noise variance of a value is one unknown number, divided by the value's precision: for means over runs
            their number. Without `noise_freedom` only ratios matter.
        noise_covariance : array (k, k), optional
            Covariance of the noise of the responses, up to a factor. `precision` is then the same for all responses
            of a sample.
        noise_freedom : float, optional
            Degrees of freedom from which replicates estimated `noise_covariance`, which then belongs to one value of
            precision 1. A surrogate may ignore it.

        Returns
        -------
        Surrogate
            The same surrogate.

        Raises
        ------
        ValueError
            For other shapes, values that are not finite, or fewer samples than the surrogate needs.
        """

    @abstractmethod
    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        """Predict responses at parameter sets.

        Parameters
        ----------
        X : numpy.ndarray, (n, d)
        return_std : bool, optional
            Whether to return the standard deviations too.
        noise : bool, optional
            Whether the standard deviations belong to one new value with precision 1, or else to the
            mean alone.

        Returns
        -------
        mean : numpy.ndarray, (n, k)
            In the responses' units.
        std : numpy.ndarray, (n, k)
            Only with `return_std`.
        """

    @abstractmethod
    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (n, k, k) of the predicted means at parameter sets X (n, d), without noise."""

    @property
    def knows_its_errors(self) -> bool:
        """Whether `covariance` is available; False for a surrogate saved without its training data."""
        return True

    def shifted(self, offset: np.ndarray) -> Self:
        """Copy it with an offset (k,) added to its predictions.

        It changes `offset_`, which `predict` adds to the responses. A surrogate without `offset_` has a `shifted` of
        its own.
        """
        moved = copy.copy(self)
        moved.offset_ = self.offset_ + offset
        return moved

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Collect all that `from_dict` needs, as lists and numbers that JSON can hold."""

    @classmethod
    @abstractmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Make the trained surrogate of a file's content.

        Parameters
        ----------
        content : mapping
            The result of `to_dict`, with `inputs`, `outputs`, `definitions` and `samples`.

        Returns
        -------
        Surrogate

        Raises
        ------
        KeyError, ValueError
            If the content is something else.
        """

    def response_function(
        self, low: np.ndarray, high: np.ndarray
    ) -> Callable[[np.ndarray], np.ndarray]:
        """Make the prediction a function of points (n, d) in [-1, 1], which stand for `low` and `high` (d,).

        A search calls this function millions of times.
        """
        middle, half = (np.add(low, high)) / 2, np.subtract(high, low) / 2
        return lambda points: self.predict(middle + points * half)

    def report(self) -> dict[str, Any]:
        """Collect numbers about the training, for metrics.json."""
        return {}

    def start_rows(self) -> list[dict[str, Any]]:
        """List the result of each start of the training, as rows of starts.csv; empty for a method without starts."""
        return []

    def describe(
        self,
        inputs: Names,
        outputs: Names,
        definitions: Definitions | None = None,
        samples: Sequence[int] = (),
    ) -> Self:
        """Name the parameters, the responses and their definitions, and the samples of the fit.

        Parameters
        ----------
        inputs, outputs : sequence of str
            Names of the d parameters and of the k responses.
        definitions : mapping, optional
            For each response the configuration keys, with their values, that define it.
        samples : sequence of int, optional
            Numbers of the samples, in the order of the fit.

        Returns
        -------
        Surrogate
            The same surrogate.
        """
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self.definitions, self.samples = (
            dict(definitions or {}),
            tuple(int(sample) for sample in samples),
        )
        return self

    def save(self, path: str | os.PathLike) -> None:
        """Write a JSON file that `load` reads."""
        names = {
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "surrogate": self.name,
        }
        about = {"definitions": self.definitions, "samples": list(self.samples)}
        write_json(path, {**names, **about, **self.to_dict()})


_REGISTRY: dict[str, type[Surrogate]] = {}
Kind = TypeVar("Kind", bound=type[Surrogate])


def register(name: str) -> Callable[[Kind], Kind]:
    """Make a surrogate known by a name, as a class decorator, in the configuration and in files.

    Raises
    ------
    ValueError
        If another class has the name.
    """

    def enter(kind: Kind) -> Kind:
        if _REGISTRY.setdefault(name, kind) is not kind:
            raise ValueError(
                f"surrogate {name!r} is registered already, by {_REGISTRY[name].__name__}"
            )
        kind.name = name
        return kind

    return enter


def names() -> tuple[str, ...]:
    """Return the names of all surrogates, in the order of their registration."""
    return tuple(_known())


def _known() -> dict[str, type[Surrogate]]:
    """Return every surrogate by its name; a job that needs none does not wait for their import."""
    from repose.calibrate.surrogates import kinds  # noqa: F401

    return _REGISTRY


def make(
    name: str, settings: NetworkSettings = AS_PUBLISHED, source: object = "surrogate"
) -> Surrogate:
    """Make an untrained surrogate.

    Parameters
    ----------
    name : str
        One of `names`.
    settings : NetworkSettings, optional
        As `Surrogate.of` takes them; by default the published ones.
    source : object
        Named in the error: a file or a key.

    Returns
    -------
    Surrogate

    Raises
    ------
    InputError
        If no surrogate has this name.
    """
    return kind_of(name, source).of(settings)


def load(path: str | os.PathLike, outputs: Sequence[str] | None = None) -> Surrogate:
    """Read the trained surrogate in a file that `Surrogate.save` wrote.

    Parameters
    ----------
    path : path
    outputs : sequence of str, optional
        Responses that the surrogate must have, in this order.

    Returns
    -------
    Surrogate

    Raises
    ------
    InputError
        If the file cannot be read, is not a surrogate's, or has other responses.
    """
    content = read_json(path, KEYS, "a surrogate's JSON file")
    kind = kind_of(content["surrogate"], path)
    try:
        json.dumps(content, allow_nan=False)
    except ValueError:  # `save` never writes NaN or infinity
        raise InputError(
            path, "numbers", "not all finite", "finite ones, as a surrogate has them"
        ) from None
    try:
        samples = content.get("samples", [])
        if len(set(samples)) < len(samples) or any(
            type(sample) is not int for sample in samples
        ):
            raise ValueError(f"samples {samples}")
        model = kind.from_dict(content)
        model.describe(
            content["inputs"], content["outputs"], content.get("definitions"), samples
        )
    except (LookupError, ValueError, TypeError, ArithmeticError) as error:
        raise InputError(
            path, kind.name, repr(error), "as `save` of this surrogate writes it"
        ) from error
    if outputs is not None and model.outputs != tuple(outputs):
        raise InputError(
            path, "outputs", list(model.outputs), f"the targets {', '.join(outputs)}"
        )
    return model


def kind_of(name: str, source: object = "surrogate") -> type[Surrogate]:
    """Find the class that is registered by a name.

    Parameters
    ----------
    name : str
        One of `names`.
    source : object, optional
        What an error names.

    Returns
    -------
    type

    Raises
    ------
    InputError
        If there is none.
    """
    require(
        name in _known(),
        source,
        "surrogate",
        name,
        f"one of {', '.join(sorted(_REGISTRY))}",
    )
    return _REGISTRY[name]

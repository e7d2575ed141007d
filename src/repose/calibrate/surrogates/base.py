"""The interface of all surrogates, their registration, and their files.

A surrogate is a fast model of the simulator. It learns the responses of a few hundred
simulated parameter sets, and then predicts them for any parameter set, with errors. The
rest of the program uses only this interface::

    model = make("gaussian_process", settings)
    model.describe(PARAMETERS, targets.names, definitions)
    model.fit(X, Y).save("surrogate.json")
    mean, std = load("surrogate.json").predict(X_new, return_std=True)

To add a surrogate, write a subclass of `Surrogate` in a module of its own, put
`@register("its_name")` above it, and import the module in
`repose.calibrate.surrogates.kinds`. The configuration then knows the name.
"""

import copy
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Protocol, Self, TypedDict, TypeVar, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.responses import Definitions
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.common.files import write_json

Names = Sequence[str]


class Predictor(Protocol):
    """Interface that the posterior and the report require of a model.

    Every `Surrogate` has it.
    """

    @property
    def name(self) -> str: ...

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        """Predict responses, as `Surrogate.predict`."""

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance of the means, as `Surrogate.covariance`."""

    def moments(self, X: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Predict means with their covariance, as `Surrogate.moments`."""


class Noise(TypedDict, total=False):
    """Knowledge about the noise of samples; `Surrogate.fit` explains the entries."""

    precision: ArrayLike | None
    noise_covariance: ArrayLike | None
    noise_freedom: float


class Surrogate(ABC):
    """A model of k responses as functions of d parameters.

    Attributes
    ----------
    name : str
        Name in the configuration and in files; set by `register`.
    inputs, outputs : tuple of str
        Names of the d parameters and of the k responses; set by `describe`.
    definitions : mapping
        For each response, the configuration keys that define it, with their values; set
        by `describe`.
    samples : tuple of int
        Numbers of the n samples that it was fitted to, in their order; set by
        `describe`.
    of_all_samples : bool
        Whether a study finally fits it to all samples. A first fit to the training part
        shows its accuracy at the other samples.
    is_network : bool
        Whether it is trained from several starts.
    scale : mapping
        Name of the scale of each input that it learns on a scale that is not linear.
    """

    name: ClassVar[str]
    of_all_samples: ClassVar[bool] = True
    is_network: ClassVar[bool] = False
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    definitions: Definitions = {}  # noqa: RUF012 - never changed in place
    scale: Mapping[str, str] = {}
    samples: tuple[int, ...] = ()
    offset_: np.ndarray

    @staticmethod
    def least_samples(inputs: int) -> int:
        """Return the smallest number of samples that a fit needs.

        Parameters
        ----------
        inputs : int
            Number d of the parameters.

        Returns
        -------
        int
            0 for a surrogate that can be fitted to any number of samples.
        """
        return 0

    @classmethod
    @abstractmethod
    def of(cls, settings: NetworkSettings) -> Self:
        """Make an untrained surrogate.

        Parameters
        ----------
        settings : NetworkSettings
            The section `network` of the configuration. A surrogate takes the keys that
            it knows and ignores the others.

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
            The noise variance of a value is one unknown number divided by the precision
            of the value. For means over runs the precision is the number of runs.
            Without `noise_freedom` only ratios matter.
        noise_covariance : array (k, k), optional
            Covariance of the noise of the responses, up to a factor. `precision` is
            then the same for all responses of a sample.
        noise_freedom : float, optional
            Degrees of freedom from which replicates estimated `noise_covariance`, which
            then belongs to one value of precision 1. A surrogate may ignore it.

        Returns
        -------
        Surrogate
            The same surrogate.

        Raises
        ------
        ValueError
            For other shapes, values that are not finite, or fewer samples than the
            surrogate needs.
        """

    def refit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Return a copy that has learned other responses of the same samples.

        A surrogate may start from its present fit, and keep its hyperparameters. By
        default, the copy is fitted from scratch.

        Parameters
        ----------
        X : array (n, d)
            The parameter sets of the fit, in any order.
        Y : array (n, k)
            Other responses of these parameter sets.
        **noise
            As in `fit`.

        Returns
        -------
        Surrogate
        """
        return copy.copy(self).fit(X, Y, **noise)

    @abstractmethod
    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        """Predict responses at parameter sets.

        Parameters
        ----------
        X : numpy.ndarray, (n, d)
            Parameter sets.
        return_std : bool, optional
            Whether to return standard deviations too.
        noise : bool, optional
            Whether the standard deviations belong to one new value of precision 1, or
            only to the mean.

        Returns
        -------
        mean : numpy.ndarray, (n, k)
            Predicted means, in the units of the responses.
        std : numpy.ndarray, (n, k)
            Their standard deviations, returned only with `return_std`.
        """

    @abstractmethod
    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (n, k, k) of the predicted means, without noise."""

    def moments(self, X: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Predict means (n, k) and their covariance (n, k, k).

        A model that computes both at once overrides this method.
        """
        return self.predict(X), self.covariance(X)

    @property
    def can_predict_errors(self) -> bool:
        """Whether `covariance` is available.

        It is not for a surrogate that was saved without its training data.
        """
        return True

    def shifted(self, offset: np.ndarray) -> Self:
        """Return a copy with an offset (k,) added to its predictions.

        `predict` must add `offset_` to the responses. A surrogate without `offset_`
        overrides this method.
        """
        surrogate = copy.copy(self)
        surrogate.offset_ = self.offset_ + offset
        return surrogate

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Collect the input of `from_dict`, as lists and numbers that JSON can hold."""

    @classmethod
    @abstractmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Restore a trained surrogate from the content of its file.

        Parameters
        ----------
        content : mapping
            The result of `to_dict`, with `inputs`, `outputs`, `definitions` and
            `samples`.

        Returns
        -------
        Surrogate

        Raises
        ------
        KeyError, ValueError
            If the content is not that of such a surrogate.
        """

    def response_function(
        self, low: np.ndarray, high: np.ndarray
    ) -> Callable[[np.ndarray], np.ndarray]:
        """Make a function that predicts at points (n, d) in [-1, 1].

        -1 and 1 stand for `low` and `high` (d,). A search calls the function millions
        of times, so a surrogate may return a faster form of `predict`.
        """
        middle = np.add(low, high) / 2
        half = np.subtract(high, low) / 2
        return lambda points: self.predict(middle + points * half)

    def report(self) -> dict[str, Any]:
        """Collect numbers about the training, for metrics.json."""
        return {}

    def start_rows(self) -> list[dict[str, Any]]:
        """List the result of each start of the training, as rows of starts.csv.

        The list is empty for a method without starts.
        """
        return []

    def describe(
        self,
        inputs: Names,
        outputs: Names,
        definitions: Definitions | None = None,
        samples: Sequence[int] = (),
    ) -> Self:
        """Set the attributes with the names of parameters, responses and samples.

        Parameters
        ----------
        inputs, outputs : sequence of str
            Names of the d parameters and of the k responses.
        definitions : mapping, optional
            For each response, the configuration keys that define it, with their values.
        samples : sequence of int, optional
            Numbers of the samples, in the order of the fit.

        Returns
        -------
        Surrogate
            The same surrogate.
        """
        self.inputs = tuple(inputs)
        self.outputs = tuple(outputs)
        self.definitions = dict(definitions or {})
        self.samples = tuple(int(sample) for sample in samples)
        return self

    def save(self, path: str | os.PathLike) -> None:
        """Write the surrogate to a JSON file, which `load` reads."""
        description = {
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "surrogate": self.name,
            "definitions": self.definitions,
            "samples": list(self.samples),
        }
        write_json(path, {**description, **self.to_dict()})


REGISTERED: dict[str, type[Surrogate]] = {}
Kind = TypeVar("Kind", bound=type[Surrogate])


def register(name: str) -> Callable[[Kind], Kind]:
    """Return a class decorator that registers a surrogate.

    The configuration and saved files refer to the surrogate by this name.

    Raises
    ------
    ValueError
        If another class has the name.
    """

    def add(kind: Kind) -> Kind:
        registered = REGISTERED.setdefault(name, kind)
        if registered is not kind:
            raise ValueError(
                f"surrogate {name!r} is registered already, by {registered.__name__}"
            )
        kind.name = name
        return kind

    return add

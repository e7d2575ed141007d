"""A surrogate that learns some of its inputs on a scale that is not linear."""

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.responses import Definitions
from repose.calibrate.scales import to_coordinates
from repose.calibrate.surrogates.base import Names, Noise, Surrogate
from repose.calibrate.surrogates.settings import NetworkSettings


class ScaledInputs(Surrogate):
    """A surrogate of any kind that works in the coordinates of the scales.

    Like every surrogate, it takes parameter sets. It converts them to coordinates
    (`repose.calibrate.scales`), from which the surrogate inside learns and predicts.

    Parameters
    ----------
    model : Surrogate
        The surrogate inside.
    scale : mapping
        Name of the scale of each input whose scale is not linear.
    """

    def __init__(self, model: Surrogate, scale: Mapping[str, str]) -> None:
        self.model = model
        self.scale = dict(scale)
        self.describe(model.inputs, model.outputs, model.definitions, model.samples)

    @property
    def name(self) -> str:  # type: ignore[override]
        """Kind of the surrogate inside."""
        return self.model.name

    @property
    def of_all_samples(self) -> bool:  # type: ignore[override]
        """The value of the surrogate inside."""
        return self.model.of_all_samples

    @property
    def is_network(self) -> bool:  # type: ignore[override]
        """The value of the surrogate inside."""
        return self.model.is_network

    @property
    def can_predict_errors(self) -> bool:
        return self.model.can_predict_errors

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        raise TypeError("a surrogate with scaled inputs is made from another surrogate")

    def describe(
        self,
        inputs: Names,
        outputs: Names,
        definitions: Definitions | None = None,
        samples: Sequence[int] = (),
    ) -> Self:
        """Set the names, as `Surrogate.describe`, here and in the surrogate inside."""
        self.model.describe(inputs, outputs, definitions, samples)
        return super().describe(inputs, outputs, definitions, samples)

    def fit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Fit the surrogate inside; the arguments are those of `Surrogate.fit`."""
        self.model.fit(self._coordinates(X), Y, **noise)
        return self

    def refit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Refit the surrogate inside, as `Surrogate.refit`."""
        return self._with(self.model.refit(self._coordinates(X), Y, **noise))

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        return self.model.predict(self._coordinates(X), return_std, noise)

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (n, k, k) of the predicted means, without noise."""
        return self.model.covariance(self._coordinates(X))

    def response_function(
        self, low: np.ndarray, high: np.ndarray
    ) -> Callable[[np.ndarray], np.ndarray]:
        """Make a function that predicts at points (n, d) in [-1, 1].

        -1 and 1 stand for `low` and `high` (d,), and the points between them are evenly
        spread in the coordinates of the scales.
        """
        ends = self._coordinates(np.array([low, high]))
        return self.model.response_function(*ends)

    def shifted(self, offset: np.ndarray) -> Self:
        """Return a copy with an offset (k,) added to its predictions."""
        return self._with(self.model.shifted(offset))

    def to_dict(self) -> dict[str, Any]:
        """Collect the content of the surrogate inside, and the scales."""
        return {**self.model.to_dict(), "scale": self.scale}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        raise TypeError("`repose.calibrate.surrogates.load` reads its content")

    def report(self) -> dict[str, Any]:
        return self.model.report()

    def start_rows(self) -> list[dict[str, Any]]:
        return self.model.start_rows()

    def _with(self, model: Surrogate) -> Self:
        """Return a copy with another surrogate inside."""
        surrogate = copy.copy(self)
        surrogate.model = model
        return surrogate

    def _coordinates(self, X: ArrayLike) -> np.ndarray:
        """Turn parameter sets (n, d) into coordinates (n, d)."""
        return to_coordinates(np.asarray(X, dtype=float), self.inputs, self.scale)

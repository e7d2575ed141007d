"""The network as an estimator of scikit-learn, for pipelines and cross-validation."""

from typing import Any, Self, Unpack

from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils import Tags
from sklearn.utils.validation import check_is_fitted, validate_data

from repose.calibrate.surrogates.base import Noise
from repose.calibrate.surrogates.bayesian_bp import BayesianBP


class BayesianBPRegressor(RegressorMixin, BayesianBP, BaseEstimator):  # noqa: D101
    __doc__ = BayesianBP.__doc__

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        **noise: Unpack[Noise],
    ) -> Self:
        X, y = validate_data(
            self,
            X,
            y,
            dtype=float,
            multi_output=True,
            y_numeric=True,
            ensure_min_samples=2,
        )
        return super().fit(X, y, sample_weight, **noise)

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        check_is_fitted(self)
        X = validate_data(self, X, dtype=float, reset=False)
        return super().predict(X, return_std, noise)

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    fit.__doc__ = BayesianBP.fit.__doc__
    predict.__doc__ = BayesianBP.predict.__doc__

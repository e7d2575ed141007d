"""The network as an estimator of scikit-learn, for pipelines and cross-validation."""

from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from repose.surrogate.bayesian_bp import BayesianBP


class BayesianBPRegressor(RegressorMixin, BayesianBP, BaseEstimator):
    __doc__ = BayesianBP.__doc__

    def fit(self, X, y, sample_weight=None, precision=None, noise_covariance=None):
        X, y = validate_data(self, X, y, dtype=float, multi_output=True, y_numeric=True, ensure_min_samples=2)
        return super().fit(X, y, sample_weight, precision, noise_covariance)

    def predict(self, X, return_std=False, noise=True):
        check_is_fitted(self)
        X = validate_data(self, X, dtype=float, reset=False)
        return super().predict(X, return_std, noise)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    fit.__doc__ = BayesianBP.fit.__doc__
    predict.__doc__ = BayesianBP.predict.__doc__

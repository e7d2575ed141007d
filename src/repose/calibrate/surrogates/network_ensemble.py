"""Predict responses by the mean of several networks, and errors also by their scatter.

The starts of `repose.calibrate.surrogates.bayesian_bp.BayesianBP` end at different
networks, whose evidence hardly differs. The errors of each network include only the
uncertainty of its own weights, not the disagreement between the networks. This
surrogate predicts by a mixture of the networks: its mean is the mean of their means,
and its covariance is the mean of their covariances plus the covariance of their means.
No more networks are trained than to find the best network alone.

  (LPB17)  Lakshminarayanan, Pritzel & Blundell 2017, Simple and scalable predictive
           uncertainty estimation using deep ensembles, Adv. Neural Inf. Process. Syst.
           30: the moments of such a mixture
"""

import copy
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.surrogates.base import Noise, Surrogate, register
from repose.calibrate.surrogates.bayesian_bp import BayesianBP, compute_covariances
from repose.calibrate.surrogates.levenberg_marquardt import CONVERGED
from repose.calibrate.surrogates.samples import check_points
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.two_layer import (
    make_response_function,
    scale_columns,
    unscale_columns,
)

# A member may have at most this much less log evidence than the best start, in nats.
# Laplace's approximation of the evidence has errors of this size.
MAX_EVIDENCE_GAP = 50.0
MEMBER_ARRAYS = ("W1", "b1", "W2", "b2")
ALL_WEIGHTS = "all weights"


class _Prediction(NamedTuple):
    """Means that all networks predict."""

    points: np.ndarray  # (n, d)
    means: np.ndarray  # (members, n, k)


@register("network_ensemble")
class NetworkEnsemble(Surrogate):
    """Networks of all converged starts whose log evidence is close to the largest.

    It may be smaller by at most `MAX_EVIDENCE_GAP`. The attribute `members_` has the
    networks, the best first.
    """

    is_network = True

    def __init__(self, networks: Iterable[BayesianBP]) -> None:
        self._set_members(networks)

    def _set_members(self, networks: Iterable[BayesianBP]) -> None:
        """Set the networks, the best first, and clear the caches."""
        self.members_ = list(networks)
        self._stacks: dict[str, np.ndarray] = {}  # of `_stack`, by key
        self._last: _Prediction | None = None  # of `_predict_means`

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        """Make untrained networks with the settings of `BayesianBP.of`."""
        return cls([BayesianBP.of(settings)])

    def fit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        """Train a network from each start, and choose the members of the ensemble.

        Parameters
        ----------
        X : array (n, d)
            Parameter sets.
        Y : array (n, k)
            Their responses.
        **noise
            As in `Surrogate.fit`.

        Returns
        -------
        NetworkEnsemble
            The same ensemble.
        """
        # The first member has the settings of all. Its fit trains a network from each
        # start, and gives it the weights of the best one.
        best = self.members_[0]
        best.inputs = self.inputs  # it names the inputs in its report
        best.fit(X, Y, **noise)

        # Choose the starts that converged, and whose evidence is near the largest one.
        # The decrement is how far a start ended above the minimum of its objective.
        self.member_starts_ = []
        for statistics in best.starts_:
            min_evidence = best.log_evidence_ - MAX_EVIDENCE_GAP
            is_near = statistics["log_evidence"] >= min_evidence
            if is_near and statistics["decrement"] < CONVERGED:
                self.member_starts_.append(statistics["start"])

        # The best network is a member even if no start converged.
        others = [
            best.get_network_of_start(k)
            for k in self.member_starts_
            if k != best.best_start_
        ]
        self._set_members([best, *others])
        return self

    def refit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        ensemble = copy.copy(self)
        ensemble._set_members(member.refit(X, Y, **noise) for member in self.members_)
        return ensemble

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        mean = self._predict_means(X).mean(axis=0)
        if not return_std:
            return mean
        variance = np.diagonal(self.covariance(X), axis1=1, axis2=2)
        noise_variance = np.mean(
            [member.noise_std_**2 for member in self.members_], axis=0
        )
        return mean, np.sqrt(variance + noise * noise_variance)

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance (n, k, k) of the mixture, without noise (LPB17)."""
        means = self._predict_means(X)
        deviations = means - means.mean(axis=0)
        within = compute_covariances(self.members_, X, self._stack(ALL_WEIGHTS)).mean(
            axis=0
        )
        between = np.einsum("mni,mnj->nij", deviations, deviations) / len(self.members_)
        return within + between

    def response_function(
        self, low: np.ndarray, high: np.ndarray
    ) -> Callable[[np.ndarray], np.ndarray]:
        # The mean of networks is one network that has all their neurons.
        return make_response_function(self._join(), low, high)

    def shifted(self, offset: np.ndarray) -> Self:
        ensemble = copy.copy(self)
        ensemble._set_members(member.shifted(offset) for member in self.members_)
        return ensemble

    def report(self) -> dict[str, Any]:
        """Collect the report of the best network, and the number of networks."""
        return self.members_[0].report() | {"members": len(self.members_)}

    def start_rows(self) -> list[dict[str, Any]]:
        """List the rows of the best network, and which starts are members."""
        rows = self.members_[0].start_rows()
        return [row | {"member": row["start"] in self.member_starts_} for row in rows]

    def to_dict(self) -> dict[str, Any]:
        """Collect the best network as in its own file, and the other weights."""
        best, *others = (member.to_dict() for member in self.members_)
        return best | {"others": [_select_weights(other) for other in others]}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Restore the networks from the result of `to_dict`."""
        networks = [BayesianBP.from_dict(content)]
        for other in content["others"]:
            training = content["training"] | other["training"]
            networks.append(
                BayesianBP.from_dict({**content, **other, "training": training})
            )
        return cls(networks)

    def _predict_means(self, X: ArrayLike) -> np.ndarray:
        """Predict the means of all networks at once.

        The last result is kept in `_last`, because a sampler needs mean and covariance
        at the same points. `_set_members` clears it, so change the members only through
        this method. The caller must not change the result in place.

        Parameters
        ----------
        X : array (n, d)
            Parameter sets.

        Returns
        -------
        array (members, n, k)
            The means that each network predicts, in the units of the responses.
        """
        first = self.members_[0]
        X = check_points(X, len(first.input_min_))
        if self._last is not None and np.array_equal(X, self._last.points):
            return self._last.means
        scaled_inputs = scale_columns(
            X, first.input_min_, first.input_max_, first.scaled_range
        )
        # All networks have the same scalings, so one product handles all their weights.
        W1 = self._stack("W1")
        b1 = self._stack("b1")
        W2 = self._stack("W2")
        b2 = self._stack("b2")
        # Indices: member m, sample n, input i, hidden neuron h, response k (Eq. 6-8).
        hidden = np.tanh(np.einsum("ni,mhi->mnh", scaled_inputs, W1) + b1[:, None])
        scaled_outputs = np.einsum("mnh,mkh->mnk", hidden, W2) + b2[:, None]
        means = unscale_columns(
            scaled_outputs, first.output_min_, first.output_max_, first.scaled_range
        )
        self._last = _Prediction(points=X.copy(), means=means)
        return means

    def _stack(self, key: str) -> np.ndarray:
        """Stack an array of all networks as (members, ...), and keep it in a cache.

        The key is one of `MEMBER_ARRAYS`, or `ALL_WEIGHTS`.
        """
        if key not in self._stacks:
            if key == ALL_WEIGHTS:
                arrays = [member._weights() for member in self.members_]
            else:
                arrays = [getattr(member, f"{key}_") for member in self.members_]
            self._stacks[key] = np.array(arrays)
        return self._stacks[key]

    def _join(self) -> dict[str, Any]:
        """Make one network with the neurons of all members, for `response_function`."""
        return self.members_[0].to_dict() | {
            "W1": np.concatenate(self._stack("W1")),
            "b1": np.concatenate(self._stack("b1")),
            "W2": np.concatenate(self._stack("W2"), axis=1) / len(self.members_),
            "b2": self._stack("b2").mean(axis=0),
        }


def _select_weights(content: Mapping[str, Any]) -> dict[str, Any]:
    """Select weights and their regularisation from the content of a network.

    Scalings and samples are the same in all networks.
    """
    weights = {key: content[key] for key in MEMBER_ARRAYS}
    training = {key: content["training"][key] for key in ("alpha", "beta")}
    return weights | {"training": training}

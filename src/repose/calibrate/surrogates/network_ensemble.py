"""The mean of the networks at the ends of several starts, with their scatter in its errors.

Starts of `repose.calibrate.surrogates.bayesian_bp.BayesianBP` end at different networks, whose evidence hardly differs. The error
bars of each are those about its own weights; the disagreement of the networks is in none of them. Here the prediction
is a mixture of the networks: its mean is the mean of their means, its covariance the mean of their covariances plus the
covariance of their means. Nothing more is trained than for the best network alone.

  (LPB17)  Lakshminarayanan, Pritzel & Blundell 2017, Simple and scalable predictive uncertainty estimation using deep
           ensembles, Adv. Neural Inf. Process. Syst. 30: the moments of such a mixture
"""

import copy
from collections.abc import Callable, Iterable, Mapping
from operator import attrgetter
from typing import Any, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from repose.calibrate.surrogates.base import Noise, Surrogate, register
from repose.calibrate.surrogates.bayesian_bp import BayesianBP, covariances
from repose.calibrate.surrogates.levenberg_marquardt import CONVERGED
from repose.calibrate.surrogates.samples import checked_points
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.surrogates.two_layer import response_function, scale, width

# Laplace's approximation of the evidence has errors of this size; starts further below found a worse network.
NATS = 50.0
OF_EACH = ("W1", "b1", "W2", "b2")


@register("network_ensemble")
class NetworkEnsemble(Surrogate):
    """Networks of all converged starts whose log evidence is within `NATS` of the largest; the best comes first."""

    is_network = True

    def __init__(self, networks: Iterable[BayesianBP]) -> None:
        self._take(networks)

    def _take(self, networks: Iterable[BayesianBP]) -> None:
        """Take over networks, the best first."""
        self.members_ = list(networks)
        self._kept: dict[
            str, Any
        ] = {}  # arrays of all networks, and the last points with their means

    @classmethod
    def of(cls, settings: NetworkSettings) -> Self:
        """Make untrained networks with the settings of `BayesianBP.of`."""
        return cls([BayesianBP.of(settings)])

    def fit(self, X: ArrayLike, Y: ArrayLike, **noise: Unpack[Noise]) -> Self:
        best = self.members_[0]
        best.inputs = self.inputs
        best.fit(X, Y, **noise)
        near = (
            start
            for start in best.starts_
            if start["log_evidence"] >= best.log_evidence_ - NATS
        )
        self.near_ = [
            start["start"] for start in near if start["decrement"] < CONVERGED
        ]
        self._take(
            [best, *(best.of_start(k) for k in self.near_ if k != best.best_start_)]
        )
        return self

    def predict(
        self, X: ArrayLike, return_std: bool = False, noise: bool = True
    ) -> Any:
        mean = self._means(X).mean(axis=0)
        if not return_std:
            return mean
        variance = np.diagonal(self.covariance(X), axis1=1, axis2=2)
        return mean, np.sqrt(
            variance
            + noise
            * np.mean([member.noise_std_**2 for member in self.members_], axis=0)
        )

    def covariance(self, X: ArrayLike) -> np.ndarray:
        """Compute the covariance of the mixture's means, without noise (LPB17)."""
        means = self._means(X)
        off = means - means.mean(axis=0)
        own = covariances(self.members_, X, self._stacked("all weights")).mean(axis=0)
        return own + np.einsum("mni,mnj->nij", off, off) / len(self.members_)

    def response_function(
        self, low: np.ndarray, high: np.ndarray
    ) -> Callable[[np.ndarray], np.ndarray]:
        # The mean of networks is one network that has all their neurons.
        return response_function(self._as_one(), low, high)

    def shifted(self, offset: np.ndarray) -> Self:
        moved = copy.copy(self)
        moved._take(member.shifted(offset) for member in self.members_)
        return moved

    def report(self) -> dict[str, Any]:
        """Give the report of the best network, and how many networks there are."""
        return self.members_[0].report() | {"members": len(self.members_)}

    def start_rows(self) -> list[dict[str, Any]]:
        """List rows of the best network, and which starts are members."""
        return [
            row | {"member": row["start"] in self.near_}
            for row in self.members_[0].start_rows()
        ]

    def to_dict(self) -> dict[str, Any]:
        """Collect the best network as in its own file, and the own part of each other network."""
        best, *others = (member.to_dict() for member in self.members_)
        return best | {"others": [_own_part(other) for other in others]}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Make the networks of a `to_dict`."""
        training = content["training"]
        others = (
            {**content, **other, "training": training | other["training"]}
            for other in content["others"]
        )
        return cls(map(BayesianBP.from_dict, [content, *others]))

    def _means(self, X: ArrayLike) -> np.ndarray:
        """Predict means (members, n, k) of all networks, in one pass through their hidden layers.

        The last ones are kept: a sampler asks for the mean and the covariance at the same points.
        """
        first = self.members_[0]
        X = checked_points(X, len(first.input_min_))
        if "points" in self._kept and np.array_equal(X, self._kept["points"]):
            return self._kept["means"]
        x = scale(X, first.input_min_, first.input_max_, first.scaled_range)
        a = np.tanh(
            np.einsum("ni,mhi->mnh", x, self._stacked("W1"))
            + self._stacked("b1")[:, None]
        )
        y = (
            np.einsum("mnh,mkh->mnk", a, self._stacked("W2"))
            + self._stacked("b2")[:, None]
        )
        low, high = first.scaled_range
        means = first.output_min_ + (y - low) / (high - low) * width(
            first.output_min_, first.output_max_
        )
        self._kept |= {"points": X.copy(), "means": means}
        return means

    def _stacked(self, key: str) -> np.ndarray:
        """Stack one of the arrays of `OF_EACH`, or all weights, for all networks (members, ...)."""
        if key not in self._kept:
            of_one = (
                BayesianBP._weights if key == "all weights" else attrgetter(f"{key}_")
            )
            self._kept[key] = np.array([of_one(member) for member in self.members_])
        return self._kept[key]

    def _as_one(self) -> dict[str, Any]:
        """Make the arrays of the network that has the neurons of all members."""
        return self.members_[0].to_dict() | {
            "W1": np.concatenate(self._stacked("W1")),
            "b1": np.concatenate(self._stacked("b1")),
            "W2": np.concatenate(self._stacked("W2"), axis=1) / len(self.members_),
            "b2": self._stacked("b2").mean(axis=0),
        }


def _own_part(content: Mapping[str, Any]) -> dict[str, Any]:
    """Keep weights and their regularisation; scalings and samples are the same in all networks."""
    own = {key: content[key] for key in OF_EACH}
    return own | {
        "training": {key: content["training"][key] for key in ("alpha", "beta")}
    }

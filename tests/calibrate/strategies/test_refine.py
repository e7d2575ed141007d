"""The second stage: where it runs, what it adds to the fit, and the whole strategy with a free simulator."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.spatial.distance import cdist
from shared import target
from test_strategies import STUDY, simulate

import repose
from repose.calibrate import training as train
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies import Answer, Batch
from repose.calibrate.strategies.refined import places
from repose.calibrate.strategies.refined.places import draw_near_targets
from repose.calibrate.targets import Targets

pytestmark = pytest.mark.usefixtures("short_searches")
SPACE = ParameterSpace(("a", "b"), np.array([0.0, 10.0]), np.array([1.0, 20.0]))
TARGETS = Targets.of(
    [target("aor_deg", 30.0, 2.0, 28, 32), target("height_mm", 60.0, 2.0, 57, 63)]
)
ERRORS = np.array([0.4, 0.8])
CORRELATION = 0.5


class Plane:
    """An angle of 25 to 35 along a, a Height of 50 to 70 along b, errors that are the same everywhere."""

    def predict(self, X, return_std=False, noise=True):
        X = np.asarray(X)
        return np.column_stack([25.0 + 10.0 * X[:, 0], 50.0 + 2.0 * (X[:, 1] - 10.0)])

    def covariance(self, X):
        matrix = np.outer(ERRORS, ERRORS) * (CORRELATION + 0.5 * np.eye(2))
        return np.tile(matrix, (len(X), 1, 1))


def drawn(count=50, seed=1, tolerance=2.0):
    return draw_near_targets(
        Plane(),
        SPACE,
        TARGETS,
        count=count,
        tolerance_percent=tolerance,
        random=np.random.default_rng(seed),
    )


def test_places_are_drawn_once_each_and_the_same_for_the_same_numbers():
    first = drawn()
    assert first.shape == (50, 2)
    assert len(np.unique(first, axis=0)) == 50
    np.testing.assert_array_equal(first, drawn())
    assert not np.array_equal(first, drawn(seed=2))


def test_places_are_drawn_by_the_probability_to_meet_the_targets(monkeypatch):
    monkeypatch.setattr(places, "N_CANDIDATES", 64)
    monkeypatch.setattr(places, "N_NEAREST", 64)
    monkeypatch.setattr(places, "CHUNK_SIZE", 16)
    # twin: the probability of each candidate, one by one
    unit = stats.qmc.Sobol(2, scramble=False).random(64)
    cov = np.outer(ERRORS, ERRORS) * (CORRELATION + 0.5 * np.eye(2))
    slow = []
    for point in unit:
        mean = [25 + 10 * point[0], 50 + 20 * point[1]]
        law = stats.multivariate_normal(mean, cov)
        slow.append(law.cdf([30.6, 61.2], lower_limit=[29.4, 58.8]))
    slow = np.array(slow) / np.sum(slow)

    class AllPlaces:
        """Draws all places, and keeps the probabilities with which it should draw them."""

        def choice(self, n, size, replace, p):
            assert (size, replace) == (1, False)
            self.probabilities = p
            return np.arange(n)

    random = AllPlaces()
    found = draw_near_targets(
        Plane(), SPACE, TARGETS, count=1, tolerance_percent=2.0, random=random
    )
    rows = cdist(found, unit).argmin(axis=1)
    assert sorted(rows) == list(range(64))
    # The probabilities are integrals to 0.001.
    assert random.probabilities == pytest.approx(slow[rows], abs=1e-3)


def test_a_target_out_of_reach_takes_the_nearest_places():
    unreachable = Targets.of([target("aor_deg", 300.0, 2.0, 280, 320)])

    class Angle(Plane):
        def predict(self, X, return_std=False, noise=True):
            return super().predict(X)[:, :1]

        def covariance(self, X):
            return super().covariance(X)[:, :1, :1]

    found = draw_near_targets(
        Angle(),
        SPACE,
        unreachable,
        count=40,
        tolerance_percent=2.0,
        random=np.random.default_rng(1),
    )
    assert len(np.unique(found, axis=0)) == 40
    assert found[:, 0].min() > 0.8


def test_added_samples_leave_the_split_as_it_was():
    design = pd.DataFrame(
        {"sample": np.arange(1, 41), "round": pd.array([pd.NA] * 40, dtype="Int64")}
    )
    added = pd.DataFrame({"sample": [41, 42, 43], "round": [1, 1, 1]})
    shares = [0.7, 0.15, 0.15]
    before = train.split_rows(design, shares, 3)
    after = train.split_rows(pd.concat([design, added]), shares, 3)
    for name in ("validation", "test"):
        np.testing.assert_array_equal(after[name], before[name])
    np.testing.assert_array_equal(after["train"], [*before["train"], 40, 41, 42])


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """A study with its proposals: the design, the second stage, the answer."""
    file = tmp_path_factory.mktemp("refined") / "study.csv"
    study = repose.Study(**STUDY, strategy="refined", file=file)
    proposals = [study.proposal]
    while not study.done:
        study.tell(simulate(study.ask()))
        proposals.append(study.proposal)
    return study, proposals


def test_the_strategy_runs_the_design_then_single_runs_then_answers(walked):
    study, (design, second, answer) = walked
    assert isinstance(design, Batch)
    assert design.samples["seeds"].tolist() == 24 * [2]
    assert isinstance(second, Batch)
    assert second.samples["seeds"].tolist() == 6 * [1]
    assert second.samples["sample"].tolist() == list(range(25, 31))
    assert isinstance(answer, Answer)
    assert answer.samples["seeds"].tolist() == [4]
    assert len(study.runs) == 24 * 2 + 6


def test_the_second_stage_is_near_the_targets_and_the_answer_has_all_runs(walked):
    study, (design, second, answer) = walked
    targets = study.targets
    names = list(study.parameters.names)

    def distance(samples):
        mean = simulate(samples.assign(run=1), noise=0.0)[list(targets.names)]
        return (abs(mean - targets.aim) / targets.whole).sum(axis=1).mean()

    assert distance(second.samples) < 0.2 * distance(design.samples)
    assert answer.notes["fit"]["n_fitted"] == 30
    found = distance(
        pd.DataFrame([dict(zip(names, answer.values, strict=True))]).assign(sample=1)
    )
    assert found < 0.02


def test_the_answer_has_the_expected_optimism_of_its_prediction(walked):
    study, (*_, answer) = walked
    rows = answer.notes["optimism"]
    assert [row["response"] for row in rows] == list(study.targets.names)
    assert all(row["role"] == "representative" for row in rows)
    assert all(np.isfinite([row["optimism"], row["optimism_se"]]).all() for row in rows)

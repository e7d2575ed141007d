"""No verdict 'out of reach' without a run at the ends where the targets come nearest."""

import numpy as np
import pandas as pd
import pytest
from decades import FRICTIONS, REPETITIONS, SCATTER, responses

import repose
from repose.calibrate.answer import ENDS_NOT_SIMULATED, is_out_of_reach
from repose.calibrate.inversion import _find_missing_simulation
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.base import Batch
from repose.calibrate.strategies.sequential import strategy
from repose.calibrate.strategies.sequential.advise import (
    UNREACHABLE_PROBABILITY,
    _find_reason_to_stop,
    find_nearest_ends,
    has_run_at,
)
from repose.calibrate.surrogates.support import Support

SPACE = ParameterSpace.of({"gamma": [0.0, 10.0], "mu": [0.1, 0.9]})


def test_an_end_is_one_at_which_half_of_the_nearest_points_lie():
    points = np.array([[0.0, 0.2, 1.0], [0.0, 1.0, 0.9995], [0.3, 0.4, 1.0]])
    assert find_nearest_ends(points).tolist() == pytest.approx(
        [0.0, np.nan, 1.0], nan_ok=True
    )


def test_one_run_stands_at_all_ends_together():
    ends = np.array([0.0, np.nan, 1.0])
    apart = np.array([[0.0, 0.5, 0.5], [0.5, 0.5, 1.0]])
    assert not has_run_at(ends, apart)
    assert has_run_at(ends, np.vstack([apart, [0.0005, 0.2, 1.0]]))
    assert has_run_at(np.full(3, np.nan), apart), "inside the ranges there is no end"


@pytest.mark.parametrize(
    ("is_end_simulated", "n_samples", "reason"),
    [(True, 4, "out_of_reach"), (False, 4, None), (False, 0, "budget")],
)
def test_the_reason_is_out_of_reach_only_with_a_run_there(
    is_end_simulated, n_samples, reason
):
    section = repose.Study(
        {"a": (0, 1)}, {"y": (1.0, 0.1)}
    ).settings.sequential.model_copy(update={"probability": 0.7})
    stop = _find_reason_to_stop(
        section,
        probability=0.0,
        reachable=0.0,
        reach_probability=UNREACHABLE_PROBABILITY / 2,
        n_samples=n_samples,
        is_past_start=True,
        is_end_simulated=is_end_simulated,
    )
    assert stop == reason


def table_of(gamma, seed):
    """Two runs of each of 12 sets, with these energies and frictions over the range."""
    random = np.random.default_rng(seed)
    mu = random.permutation(np.linspace(*FRICTIONS, len(gamma)))
    rows = []
    for energy, friction in zip(np.repeat(gamma, 2), np.repeat(mu, 2), strict=True):
        angle, height = responses(energy, friction) * (
            1 + 0.01 * random.standard_normal(2)
        )
        rows.append({"gamma": energy, "mu": friction, "angle": angle, "height": height})
    return pd.DataFrame(rows)


@pytest.mark.slow
def test_a_response_that_is_steep_at_an_end_is_simulated_there_before_a_verdict():
    # the targets are met at 0.005 J/m2; no run lies below 0.4
    angle, height = responses(5e-3, 0.4)
    study = repose.Study(
        {"gamma": (0, 10), "mu": FRICTIONS},
        {
            "angle": (angle, SCATTER * angle, REPETITIONS),
            "height": (height, SCATTER * height, REPETITIONS),
        },
        sequential={"start_samples": 8, "most_runs": 60},
    )
    study.tell(table_of(np.linspace(0.4, 9.6, 12), seed=1))
    proposal = strategy.propose(study, study.runs)
    assert isinstance(proposal, Batch)
    assert proposal.notes["stop"] is None
    assert proposal.samples["gamma"].min() < 0.01
    early = study.answer()
    assert early.card["out_of_reach"] is False
    assert "there is no run at an end of a range" in early.why
    assert "o parameter set is predicted" not in str(early)


def test_a_search_on_a_surrogate_makes_no_verdict_at_an_end_without_samples():
    random = np.random.default_rng(1)
    solutions = pd.DataFrame({"gamma": [0.0], "mu": [0.4], "feasible": [False]})
    inside = random.random((40, 2)) * 0.9 + 0.05
    support = Support.from_space(SPACE.values(inside), SPACE)
    middle = np.zeros(2)
    stop = _find_missing_simulation(solutions, SPACE, support, middle)
    assert stop == {"stop": ENDS_NOT_SIMULATED}
    assert not is_out_of_reach({"feasible": False, **stop})
    at_end = Support.from_space(SPACE.values(np.vstack([inside, [0.005, 0.5]])), SPACE)
    assert _find_missing_simulation(solutions, SPACE, at_end, middle) == {}
    assert is_out_of_reach({"feasible": False})
    away = solutions.assign(gamma=5.0)
    assert _find_missing_simulation(away, SPACE, support, middle) == {}
    # The answer stays among the samples, and the search comes nearer at the end.
    end = np.array([-1.0, 0.0])
    assert _find_missing_simulation(away, SPACE, support, end) == stop
    assert _find_missing_simulation(away, SPACE, at_end, end) == {}
    feasible = solutions.assign(feasible=True)
    assert _find_missing_simulation(feasible, SPACE, support, end) == {}

"""Where no parameter set meets a target, the answer is the nearest place that runs support.

The surface is a known quadratic with its top, 30, at 0.3 of the coded units of textbook
designs; the target lies above it. In the far corners, where no design has a run but that
of the factorial, the surface lies below 19. There a model is uncertain enough to make any
target look possible.
"""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import qmc

from repose import Study
from repose.calibrate.designs.box_behnken import box_behnken
from repose.calibrate.designs.central_composite import central_composite
from repose.calibrate.expected_loss import minimise_expected_loss
from repose.calibrate.strategies.base import strategy
from repose.calibrate.strategies.runs import checked_runs
from repose.calibrate.surrogates.gaussian_process import GaussianProcess
from repose.calibrate.surrogates.quadratic import QuadraticSurface
from repose.calibrate.surrogates.support import Support

pytestmark = pytest.mark.usefixtures("short_designs")
TOP = 30.0
CENTRE = 0.3
CURVATURE = 6.0
NOISE = 0.3
DESIGNS = {
    "rotatable": central_composite(2, "rotatable", 5),
    "face-centred": central_composite(3, "face_centred", 5),
    "Box-Behnken": box_behnken(3, 5),
}


def surface(coded):
    return TOP - CURVATURE * ((coded - CENTRE) ** 2).sum(axis=-1)


def answer_of(coded, target, seed):
    """The answer from one run of each row of a design, in coded units."""
    noise = NOISE * np.random.default_rng(seed).normal(size=len(coded))
    names = [f"p{k}" for k in range(coded.shape[1])]
    farthest = np.abs(coded).max()
    study = Study(
        dict.fromkeys(names, (-farthest, farthest)),
        {"y": (target, 0.5, 10)},
        seed=1,
    )
    runs = pd.DataFrame(coded, columns=names)
    study.tell(runs.assign(y=surface(coded) + noise, run=range(len(runs))))
    answer = strategy("sequential").answer(study, study.runs)
    support = Support(
        coded, np.full(len(names), -farthest), np.full(len(names), farthest), names
    )
    return answer, support


@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize(
    ("target", "seed"),
    [(36.0, 1)]
    + [pytest.param(t, k, marks=pytest.mark.slow) for t in (33, 45) for k in (2, 3)],
)
def test_the_answer_is_near_the_top_of_the_surface(design, target, seed):
    coded = getattr(DESIGNS[design], "coded", DESIGNS[design])
    answer, support = answer_of(coded, target, seed)
    # Nearer than all but the best runs of the design, and no corner.
    assert surface(answer.values) > TOP - 2.0
    assert not support.is_sparse(answer.values[None])[0]
    assert answer.why.endswith("the answer is the nearest")
    # A prediction from what is supported is true.
    assert abs(answer.mean[0] - surface(answer.values)) < 3 * answer.error[0]


def test_a_target_below_the_top_is_met_as_before():
    """The nearest is no answer where a set is predicted inside the range."""
    answer, _ = answer_of(DESIGNS["rotatable"].coded, 28.0, 1)
    assert abs(answer.mean[0] - 28.0) < 0.02 * 28.0
    assert "nearest" not in answer.why
    assert abs(surface(answer.values) - 28.0) < 3 * answer.error[0]


@pytest.mark.slow
def test_the_surfaces_of_response_surface_end_at_the_top():
    """Its steps make their own designs, so it calls the surface as a simulator."""
    names = ["p0", "p1", "p2"]
    random = np.random.default_rng(1)

    def simulate(row):
        coded = np.array([row[name] for name in names])
        return {"y": surface(coded) + NOISE * random.normal()}

    study = Study(
        dict.fromkeys(names, (-1.7, 1.7)),
        {"y": (36.0, 0.5, 10)},
        seed=1,
        strategy="response_surface",
    )
    answer = study.calibrate(simulate).parameters
    coded = np.array([answer[name] for name in names])
    assert surface(coded) > TOP - 0.5


def ridge(coded):
    """A bell along the diagonal, with the same top as the quadratic."""
    along = (coded - CENTRE).sum(axis=-1) / np.sqrt(coded.shape[-1])
    across = ((coded - CENTRE) ** 2).sum(axis=-1) - along**2
    return TOP * np.exp(-(0.2 * along**2 + 0.1 * across))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.parametrize("function", [surface, ridge])
@pytest.mark.parametrize("surrogate", ["network_ensemble", "gaussian_process"])
def test_published_answers_where_runs_are(surrogate, function, seed):
    """Six parameters, 40 single runs: a surrogate extrapolates above the top."""
    coded = 2 * qmc.LatinHypercube(6, rng=seed).random(40) - 1
    names = [f"p{k}" for k in range(6)]
    study = Study(
        dict.fromkeys(names, (-1.0, 1.0)),
        {"y": (36.0, 0.5, 10)},
        seed=1,
        strategy="published",
        surrogate=surrogate,
        **({"network": {"starts": 5}} if surrogate == "network_ensemble" else {}),
        miga={"rounds": 60},
    )
    noise = NOISE * np.random.default_rng(seed).normal(size=40)
    runs = pd.DataFrame(coded, columns=names).assign(y=function(coded) + noise)
    answer = strategy("published").propose(study, checked_runs(study, runs))
    support = Support(coded, np.full(6, -1.0), np.full(6, 1.0), names)
    assert not support.is_sparse(answer.values[None])[0]
    # Nearer to the target than nine runs in ten. In the corners it is farther.
    assert function(answer.values) > np.quantile(function(coded), 0.9)


@pytest.mark.parametrize("design", ["face-centred", "Box-Behnken"])
@pytest.mark.parametrize("surrogate", [GaussianProcess, QuadraticSurface])
def test_the_least_expected_loss_of_published_is_near_the_top(design, surrogate):
    """The answer of `published`, without its search, of two surrogates."""
    coded = getattr(DESIGNS[design], "coded", DESIGNS[design])
    names = [f"p{k}" for k in range(coded.shape[1])]
    farthest = np.abs(coded).max()
    study = Study(
        dict.fromkeys(names, (-farthest, farthest)), {"y": (36.0, 0.5, 10)}, seed=1
    )
    noise = NOISE * np.random.default_rng(1).normal(size=len(coded))
    model = surrogate().fit(coded, (surface(coded) + noise)[:, np.newaxis])
    answer = minimise_expected_loss(model, study.parameters, study.targets)
    assert surface(np.array([answer[name] for name in names])) > TOP - 2.0

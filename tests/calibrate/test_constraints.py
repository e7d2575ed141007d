"""Constraints between parameters; the twin of each part is rejection sampling."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.spatial.distance import cdist, pdist

import repose
from repose.calibrate.constraints import Constraint, Term
from repose.calibrate.designs.allowed import make_allowed_design, take_allowed_points
from repose.calibrate.designs.latin_hypercube import make_points_in_space, optimal_lhs
from repose.calibrate.expected_loss import minimise_expected_loss
from repose.calibrate.inversion import invert
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.search.settings import MigaSettings
from repose.calibrate.strategies.response_surface import ResponseSurface
from repose.calibrate.study_file import make_targets
from repose.calibrate.surrogates import make
from repose.calibrate.surrogates.support import Support
from repose.calibrate.uncertainty.sampler import compute_joint_information, draw_chains
from repose.common.errors import InputError
from repose.config.dependencies import select_stage_settings
from repose.config.pipeline import PipelineConfig
from repose.report.study_view import StudyView

PARAMETERS = {"mur": [0.01, 0.5], "mus": [0.1, 0.9]}
RULE = "mur <= 0.5 * mus"
SPACE = ParameterSpace.of(PARAMETERS, constraints=[RULE])
# Of the area: the mean over mus of (0.5 mus - 0.01) / 0.49
SHARE = 0.24 / 0.49
TARGETS = {"y": (1.0, 0.1, 3), "z": (2.0, 0.1, 3)}
NAMES = ("mur", "mus", "a b", "3")


def rejected(n, seed, space=SPACE):
    """Points of the unit cube that the constraints allow, by rejection sampling."""
    random = np.random.default_rng(seed)
    found = []
    while len(found) < n:
        point = random.random(space.dimensions)
        mur, mus = space.values(point[None])[0, :2]
        if mur <= 0.5 * mus:
            found.append(point)
    return np.array(found)


@pytest.mark.parametrize(("text", "smaller", "larger"), [
    ("mur <= mus", Term(1.0, "mur"), Term(1.0, "mus")),
    ("mur>=0.5*mus", Term(0.5, "mus"), Term(1.0, "mur")),
    (" 1e-2 * mus <= 2*mur ", Term(0.01, "mus"), Term(2.0, "mur")),
    ("-1 * a b <= mus", Term(-1.0, "a b"), Term(1.0, "mus")),
    ("3 <= 2 * 3", None, None),
    ("2 * 3 <= mus", Term(2.0, "3"), Term(1.0, "mus")),
])  # fmt: skip
def test_a_constraint_has_two_terms(text, smaller, larger):
    if smaller is None:
        with pytest.raises(ValueError, match="both sides have 3"):
            Constraint.parse(text, NAMES)
        return
    assert Constraint.parse(text, NAMES) == Constraint(text, smaller, larger)


@pytest.mark.parametrize(("text", "words"), [
    ("mur < mus", "with <= or >="), ("mur <= mus <= 1", "with <= or >="), ("mur", "with <= or >="),
    ("mur <= mux", "'mux' is not a parameter"), ("mur <= 0.5", "'0.5' is not a parameter"),
    ("mur <= 0 * mus", "not 0"), ("mur <= mus + 1", "is not a parameter"), (3, "with <= or >="),
    ("mur <= __import__('os')", "is not a parameter"), ("mur <= 1e999 * mus", "not 0"),
])  # fmt: skip
def test_any_other_text_is_refused_with_the_form(text, words):
    with pytest.raises(ValueError, match="also with factors") as raised:
        Constraint.parse(text, NAMES)
    assert words in str(raised.value)


def test_the_allowed_share_and_the_marginals_are_those_of_the_area():
    assert SPACE.allowed_fraction == pytest.approx(SHARE, abs=2e-3)
    unit = np.random.default_rng(1).random((1000, 2))
    values = SPACE.values(unit)
    is_allowed = values[:, 0] <= 0.5 * values[:, 1]
    assert (SPACE.is_allowed(unit) == is_allowed).all()
    assert ((SPACE.violation(unit) > 0) == ~is_allowed).all()
    assert (np.isneginf(SPACE.log_prior(unit)) == ~is_allowed).all()
    allowed = rejected(2000, seed=2)
    for column in SPACE.marginal_cdf(allowed).T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3
    quantiles = SPACE.marginal_quantiles(np.array([0.25, 0.75]))
    twin = np.quantile(SPACE.values(allowed), [0.25, 0.75], axis=0)
    assert quantiles == pytest.approx(twin, abs=0.03)


@pytest.mark.usefixtures("short_search")
def test_without_constraints_nothing_changes():
    free = ParameterSpace.of(PARAMETERS)
    unit = np.random.default_rng(1).random((20, 2))
    assert free.allowed_fraction == 1.0
    assert free.is_allowed(unit).all()
    assert (free.marginal_cdf(unit) == free.prior_cdf(unit)).all()
    assert (make_points_in_space(free, 12, "optimal", 3) == optimal_lhs(12, 2, 3)).all()
    first = stats.qmc.Sobol(2, rng=1).random(64)
    assert (take_allowed_points(stats.qmc.Sobol(2, rng=1), 64, free) == first).all()


def test_a_sequence_gives_its_first_allowed_points():
    points = take_allowed_points(stats.qmc.Sobol(2, rng=1), 64, SPACE)
    more = stats.qmc.Sobol(2, rng=1).random(512)
    assert (points == more[SPACE.is_allowed(more)][:64]).all()


@pytest.mark.usefixtures("short_search")
def test_a_design_is_spread_more_evenly_over_what_is_allowed_than_random_ones():
    n = 24
    design = make_points_in_space(SPACE, n, "optimal", 3)
    assert design.shape == (n, 2)
    assert SPACE.is_allowed(design).all()
    assert (design == make_points_in_space(SPACE, n, "optimal", 3)).all()
    places = rejected(3000, seed=5)

    def hole(points):
        """Mean distance of allowed places from the nearest sample."""
        return cdist(places, points).min(axis=1).mean()

    random_designs = [rejected(n, seed) for seed in range(10, 40)]
    assert hole(design) < min(map(hole, random_designs))
    assert pdist(design).min() > max(pdist(one).min() for one in random_designs)
    # Each quarter of mur has its share of the samples, within two.
    edges = np.quantile(places[:, 0], [0.25, 0.5, 0.75])
    counts = np.bincount(np.searchsorted(edges, design[:, 0]), minlength=4)
    assert np.abs(counts - n / 4).max() <= 2


@pytest.mark.usefixtures("short_search")
def test_a_design_with_a_scale_and_a_prior_obeys_too():
    space = ParameterSpace.of(
        {"mur": {"range": [1e-3, 0.5], "scale": "log"},
         "mus": {"prior": {"mean": 0.3, "sd": 0.1}, "range": [0.1, 0.9]}},
        constraints=[RULE],
    )  # fmt: skip
    design = make_allowed_design(
        lambda size: optimal_lhs(size, 2, 1), 16, space, follows_prior=True
    )
    mur, mus = space.values(design).T
    assert (mur <= 0.5 * mus).all()
    assert len(design) == 16


def line_model():
    unit = np.random.default_rng(3).random((40, 2))
    sets = SPACE.values(unit)
    random = np.random.default_rng(4)
    Y = sets + 0.002 * random.standard_normal(sets.shape)
    return make("quadratic").describe(SPACE.names, ("y", "z")).fit(sets, Y)


def test_the_search_and_the_answer_stay_where_they_are_allowed():
    # The targets are met at mur 0.4, mus 0.4; the nearest allowed sets lie on the line.
    targets = make_targets(
        {
            "y": {"value": 0.4, "sd": 0.02, "repetitions": 10},
            "z": {"value": 0.4, "sd": 0.02, "repetitions": 10},
        }
    )
    settings = MigaSettings.with_defaults(rounds=6, solutions=20)
    result = invert(line_model(), SPACE, targets, settings)
    sets = result.solutions
    assert (sets["mur"] <= 0.5 * sets["mus"] + 1e-12).all()
    assert not result.summary["feasible"]
    best = sets.loc[sets["objective"].idxmin()]
    assert best["mur"] == pytest.approx(0.5 * best["mus"], abs=0.02)
    answer = minimise_expected_loss(line_model(), SPACE, targets)
    assert answer["mur"] <= 0.5 * answer["mus"]
    # Rejection sampling finds no allowed set with a smaller objective.
    values = SPACE.values(rejected(4000, seed=6))
    widths = targets.high - targets.low
    F = (np.abs(values - targets.aim) / widths).sum(axis=1)
    assert best["objective"] < F.min() + 0.05
    # Where all samples are far beyond the constraint, it still holds.
    unit = np.random.default_rng(7).random((400, 2))
    samples = SPACE.values(unit)
    violates = samples[:, 0] - 0.5 * samples[:, 1] > 0.15
    support = Support.from_space(samples[violates], SPACE)
    far = invert(line_model(), SPACE, targets, settings, support).solutions
    assert (far["mur"] <= 0.5 * far["mus"] + 1e-12).all()
    # Without the constraint the targets are met.
    free = ParameterSpace.of(PARAMETERS)
    assert invert(line_model(), free, targets, settings).summary["feasible"]


def test_the_posterior_is_that_of_the_allowed_area():
    def density(unit):
        return SPACE.log_prior(unit)

    chains = draw_chains(density, dimensions=2, walkers=64, steps=400, seed=1)
    draws = chains.points.reshape(-1, 2)
    assert SPACE.is_allowed(draws).all()
    twin = rejected(4000, seed=7)
    error = draws.std(axis=0) * np.sqrt(chains.times / chains.log_density.size)
    twin_error = twin.std(axis=0) / np.sqrt(len(twin))
    z = (draws.mean(axis=0) - twin.mean(axis=0)) / np.hypot(error, twin_error)
    assert np.abs(z).max() < 4
    # A flat likelihood tells nothing.
    flat = compute_joint_information(
        lambda unit: np.zeros(len(unit)),
        posterior_log_likelihoods=np.zeros(len(draws)),
        effective_draws=1000.0,
        space=SPACE,
        seed=1,
    )
    assert flat.bits == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("constraints", "words"), [
    (["mur <= mux"], ("constraints.0", "mur <= mux", "'mux' is not a parameter; did you mean mu")),
    ("mur <= mus", ("constraints", "expected a list:")),
    ([], ("constraints", "expected a list:")),
    (["mur >= 3 * mus"], ("constraints", "at least 5 % of the ranges, and of their priors; these allow 1.7 %")),
    (["e <= 2 * f"], ("constraints.0", "a constraint with a parameter that is not fixed")),
])  # fmt: skip
def test_a_fault_of_a_study_names_key_value_and_what_is_expected(constraints, words):
    parameters = {**PARAMETERS, "e": {"fixed": 0.4}, "f": {"fixed": 0.5}}
    with pytest.raises(InputError) as raised:
        repose.Study(parameters, TARGETS, constraints=constraints)
    for part in words:
        assert part in str(raised.value)


def test_a_strategy_of_fixed_places_is_refused(monkeypatch):
    monkeypatch.setattr(ResponseSurface, "obeys_constraints", False)
    parameters = {**PARAMETERS, "e": [0.2, 0.8]}
    options = {"constraints": [RULE], "strategy": "response_surface"}
    with pytest.raises(
        InputError, match=r"strategy is 'response_surface'; expected .*"
    ):
        repose.Study(parameters, TARGETS, **options)
    options["constraints"] = ["mur_gg <= 0.5 * mus_gg"]
    with pytest.raises(InputError, match=r"strategy.* where there are constraints"):
        PipelineConfig.load(overrides=options)


@pytest.mark.usefixtures("short_search")
def test_a_run_outside_is_data_and_proposals_obey():
    study = repose.Study(
        PARAMETERS,
        TARGETS,
        constraints=[RULE],
        sequential={"start_samples": 8, "most_runs": 20},
    )
    asked = study.ask()
    assert (asked["mur"] <= 0.5 * asked["mus"]).all()
    assert asked["sample"].nunique() == 8
    runs = pd.DataFrame({"mur": [0.4, 0.3], "mus": [0.2, 0.9], "y": 1.0, "z": 2.0})
    study.tell(runs)
    assert len(study.runs) == 2


def test_the_pipeline_takes_constraints_and_records_them_only_where_given():
    without = PipelineConfig.load().config
    assert "constraints" not in without
    assert "constraints" not in select_stage_settings(without, "design")
    rule = "mur_gg <= 0.5 * mus_gg"
    study = PipelineConfig.load(overrides={"constraints": [rule]})
    assert [one.text for one in study.parameters.constraints] == [rule]
    for stage in ("design", "network", "miga", "posterior"):
        assert select_stage_settings(study.config, stage)["constraints"] == [rule]
    assert (
        StudyView(study.config).parameters.constraints == study.parameters.constraints
    )
    with pytest.raises(
        InputError, match=r"constraints.0 is .* 'mus' is not a parameter"
    ):
        PipelineConfig.load(overrides={"constraints": ["mur_gg <= mus"]})


@pytest.mark.slow
def test_a_campaign_asks_for_allowed_runs_only_and_finds_the_truth():
    random = np.random.default_rng(1)
    truth = {"mur": 0.19, "mus": 0.4}

    def respond(run):
        y = 20 + 30 * run["mur"] + 10 * run["mus"]
        z = 40 - 20 * run["mur"] + 30 * run["mus"]
        return {"y": y, "z": z}

    means = respond(truth)
    asked = []

    def simulate(run):
        asked.append((run["mur"], run["mus"]))
        return {
            name: value * (1 + 0.01 * random.standard_normal())
            for name, value in respond(run).items()
        }

    study = repose.Study(
        PARAMETERS,
        {name: (value, 0.02 * value, 10) for name, value in means.items()},
        constraints=[RULE],
        sequential={"start_samples": 12, "most_runs": 48},
        posterior={"walkers": 32, "steps": 200},
    )
    answer = study.calibrate(simulate)
    mur, mus = np.array(asked).T
    assert (mur <= 0.5 * mus + 1e-12).all()
    draws = answer.posterior.draws
    assert (draws["mur"] <= 0.5 * draws["mus"] + 1e-12).all()
    for name, interval in answer.intervals.items():
        assert interval["low"] <= truth[name] <= interval["high"]
    assert (answer.solutions["mur"] <= 0.5 * answer.solutions["mus"] + 1e-12).all()

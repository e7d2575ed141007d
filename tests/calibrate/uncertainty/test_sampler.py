"""The sampler and the sensitivity of a surrogate, on models with closed forms."""

import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from linear import Linear
from refusals import input_error, value_error
from scipy import stats
from scipy.special import logsumexp
from shared import targets_of

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.surrogates import make, names
from repose.calibrate.surrogates.bayesian_bp import BayesianBP
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.uncertainty import sampler, sensitivity
from repose.calibrate.uncertainty.likelihood import compute_log_likelihood
from repose.calibrate.uncertainty.settings import SensitivitySettings

CUBE = ParameterSpace.of({name: [0.0, 1.0] for name in "ab"}, names=tuple("ab"))
LOW = np.full(3, -np.pi)
HIGH = np.full(3, np.pi)
UNIT = {name: [0.0, 1.0] for name in PARAMETERS}
SETTINGS = SensitivitySettings(samples=256, resamples=20, seed=1)
SLOPES = [
    {"e_gg": 1.0, "mus_gp": 2.0},
    {"mur_gg": 5.0},
    {"mus_gp": 1.0},
    {"e_gp": 3.0, "mur_gp": 4.0},
]


@pytest.fixture(scope="module")
def linear():
    A = np.array([[8.0, 3.0], [-2.0, 10.0]])
    c = np.array([20.0, 50.0])
    truth = np.array([0.45, 0.55])
    mean = A @ truth + c
    covariance = np.array([[0.3, 0.1], [0.1, 0.4]])
    known = np.linalg.inv(A.T @ np.linalg.solve(covariance, A))

    def log_density(theta):
        return compute_log_likelihood(
            theta @ A.T + c, np.zeros((len(theta), 2, 2)), (mean, covariance)
        )

    return log_density, sampler.draw_chains(log_density, 2, 24, 1200, 3), truth, known


def test_the_linear_posterior_has_its_closed_form_with_a_prior_too(linear):
    log_density, chains, truth, known = linear
    draws = chains.points.reshape(-1, 2)
    effective = chains.log_density.size / chains.times.max()
    assert chains.log_density.ravel() == pytest.approx(log_density(draws))
    assert effective > 1000
    error = np.sqrt(np.diag(known) / effective)
    assert draws.mean(axis=0) == pytest.approx(truth, abs=4 * error.max())
    assert np.cov(draws.T) == pytest.approx(
        known, abs=5 * known.max() * math.sqrt(2 / effective)
    )
    assert (sampler.compute_split_r_hat(chains.points) < 1.01).all()
    # KL(normal || uniform on the cube) = -entropy, since the uniform density is one
    joint = -0.5 * np.log2((2 * math.pi * math.e) ** 2 * np.linalg.det(known))
    effective = chains.log_density.size / chains.density_time
    found, error = sampler.compute_joint_information(
        log_density, chains.log_density.ravel(), effective, CUBE, 1
    )
    assert found == pytest.approx(joint, abs=0.03)
    assert error < 0.05
    for k in range(2):
        marginal = -0.5 * math.log2(2 * math.pi * math.e * known[k, k])
        effective = draws[:, k].size / chains.times[k]
        assert sampler.compute_information_bits(
            draws[:, k], effective
        ) == pytest.approx(marginal, abs=0.06)
    draws = np.random.default_rng(3).normal(0.55, 0.1 / math.sqrt(2), (20_000, 1))

    def likelihood(u):
        return -0.5 * ((u[:, 0] - 0.6) / 0.1) ** 2

    def transform_to_prior(probabilities):
        return stats.norm(0.5, 0.1).ppf(np.clip(probabilities, 1e-9, 1 - 1e-9))

    space = SimpleNamespace(
        dimensions=1, transform_to_prior=transform_to_prior, constraints=()
    )
    found, _ = sampler.compute_joint_information(
        likelihood, likelihood(draws), 20_000, space, 1
    )
    # between normals: ln(sd / sd') + (sd'^2 + shift^2) / (2 sd^2) - 1 / 2
    known = 0.5 * math.log(2) + (0.5 + 0.25) / 2 - 0.5
    assert found == pytest.approx(known / math.log(2), abs=0.02)


def test_chains_end_at_their_bounds():
    chains = sampler.draw_chains(lambda u: 3 * u[:, 0] - 5000.0, 1, 96, 250, 1).points
    assert chains.min() >= 0
    assert chains.max() <= 1
    assert chains.mean() == pytest.approx(1 / (1 - math.exp(-3)) - 1 / 3, abs=0.01)


@pytest.mark.usefixtures("short_search")
def test_chains_follow_from_their_seed():
    first = sampler.draw_chains(lambda u: -u[:, 0], 2, 16, 100, 1).points
    second = sampler.draw_chains(lambda u: -u[:, 0], 2, 16, 100, 1).points
    other = sampler.draw_chains(lambda u: -u[:, 0], 2, 16, 100, 2).points
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)


def test_a_flat_density_has_its_times():
    chains = sampler.draw_chains(lambda theta: np.zeros(len(theta)), 2, 16, 50, 1)
    assert chains.density_time == 50
    assert np.isfinite(chains.times).all()


def test_no_walkers_stay_where_there_is_no_weight():
    heights = np.array([0.0, -12.0])
    sds = np.array([0.01, 0.05])
    centres = np.array([[0.2, 0.3, 0.3], [0.75, 0.7, 0.6]])

    def log_density(theta):
        return logsumexp(
            heights - 0.5 * ((theta[:, None] - centres) ** 2).sum(axis=2) / sds**2,
            axis=1,
        )

    mass = np.exp(heights) * sds**3
    chains = sampler.draw_chains(log_density, 3, 32, 1500, 5)
    draws = chains.points.reshape(-1, 3)
    assert mass[1] / mass.sum() < 1e-3
    assert (draws[:, 0] > 0.5).mean() < 0.02
    assert draws.std(axis=0) == pytest.approx(0.01, rel=0.1)


def test_r_hat_of_known_chains_and_information_of_known_draws():
    random = np.random.default_rng(1)
    good = random.normal(size=(4, 2000, 1))
    assert sampler.compute_split_r_hat(good) == pytest.approx(1, abs=0.005)
    apart = good + np.array([0, 0, 0, 3.0])[:, None, None]
    # means 0, 0, 0, 3 twice each: variance 18 - 9 * 8 / 16 over 7 beside one within
    expected = math.sqrt(1 + (18 - 4.5) / 7)
    assert sampler.compute_split_r_hat(apart) == pytest.approx(expected, rel=0.02)
    drifting = good + np.linspace(0, 3, 2000)[None, :, None]
    # halves' means 0.75 and 2.25 four times each, and a ramp of 1.5 within each
    expected = math.sqrt(1 + 4.5 / 7 / (1 + 1.5**2 / 12))
    assert sampler.compute_split_r_hat(drifting) == pytest.approx(expected, rel=0.02)
    # Uniform: none. Density 2u: 1 - 1 / (2 ln 2) bits. A quarter of the range: two.
    random = np.random.default_rng(2)
    u = random.uniform(size=40_000)
    assert sampler.compute_information_bits(u, 40_000) < 0.002
    assert sampler.compute_information_bits(np.sqrt(u), 40_000) == pytest.approx(
        1 - 1 / (2 * math.log(2)), abs=0.01
    )
    assert sampler.compute_information_bits(u / 4, 40_000) == pytest.approx(2, abs=0.01)
    few = [
        sampler.compute_information_bits(random.uniform(size=400), 400)
        for _ in range(200)
    ]
    assert np.mean(few) < 0.02  # 0.07 without the correction


def ishigami(X, a=7.0, b=0.1):
    return (
        np.sin(X[:, 0]) + a * np.sin(X[:, 1]) ** 2 + b * X[:, 2] ** 4 * np.sin(X[:, 0])
    )


def ishigami_indices(a=7.0, b=0.1):
    """First-order and total (Ishigami & Homma 1990)."""
    first = 0.5 * (1 + b * np.pi**4 / 5) ** 2
    second = a**2 / 8
    both = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    total = first + second + both
    return np.array([first, second, 0]) / total, np.array(
        [first + both, second, both]
    ) / total


def test_ishigamis_function_has_its_indices():
    found = sensitivity.compute_sobol_indices(ishigami, LOW, HIGH, 4096, 100, 7)
    for name, known in zip(("first", "total"), ishigami_indices(), strict=True):
        assert found[name][0] == pytest.approx(known, abs=0.015)
        width = found[f"{name}_high"] - found[f"{name}_low"]
        assert ((width[0] > 0.005) & (width[0] < 0.15)).all()
        assert (found[f"{name}_low"][0] <= known + 0.01).all()
        assert (known - 0.01 <= found[f"{name}_high"][0]).all()


def test_weighted_sums_have_their_indices():
    def weigh(X):
        return np.column_stack([1000 + X @ [1, 2, 0], -50 + X @ [0, 3, 4]])

    found = sensitivity.compute_sobol_indices(
        weigh, np.zeros(3), np.ones(3), 2048, 20, 1
    )
    known = np.array([[1, 4, 0], [0, 9, 16]]) / np.array([[5], [25]])
    assert found["first"] == pytest.approx(known, abs=0.01)
    assert found["total"] == pytest.approx(known, abs=0.01)


def test_main_effects_are_those_by_hand():
    grid, means = sensitivity.compute_main_effects(ishigami, LOW, HIGH, 3, points=9)
    assert grid.shape == (3, 9)
    assert means[1] == pytest.approx(7 * np.sin(grid[1]) ** 2, abs=0.05)
    expected = np.sin(grid[0]) * (1 + 0.1 * np.pi**4 / 5) + 3.5
    assert means[0] == pytest.approx(expected, abs=0.05)


def test_bad_indices_are_refused_and_a_fixed_parameter_has_none():
    value_error(
        "does not vary",
        sensitivity.compute_sobol_indices,
        lambda X: np.ones(len(X)),
        LOW,
        HIGH,
        64,
        20,
        1,
    )
    space = contact_space(UNIT | {"e_gg": {"fixed": 0.9}})
    targets = targets_of(drum_slip_deg=30.0)
    table, effects = sensitivity.analyse_surrogate(
        Linear(targets.names, SLOPES[:1]), space, targets, SETTINGS
    )
    assert "e_gg" not in set(table["parameter"]) | set(effects["parameter"])
    assert table.set_index("parameter").loc["mus_gp", "first"] == pytest.approx(
        1, abs=0.02
    )
    middle = effects[(effects["parameter"] == "mus_gp") & (effects["value"] == 0.5)]
    # e_gg is 0.4 above its middle
    assert middle["drum_slip_deg"].item() == pytest.approx(30.4)


# The density of x <= y is 2 on a triangle, so a x + b y has
# (a^2 + a b + b^2) / 18 as its variance, E[y | x] is (1 + x) / 2, E[x | y] is y / 2, and
# Var(x | y) is y^2 / 12.
@pytest.mark.parametrize("slopes", [(1.0, 1.0), (2.0, -1.0), (0.0, 3.0)])
def test_shares_on_a_triangle_are_the_closed_forms(slopes):
    a, b = slopes
    found = sensitivity.compute_allowed_fractions(
        lambda X: np.column_stack([5 + X @ [a, b], X[:, 0]]),
        np.zeros(2),
        np.ones(2),
        is_allowed=lambda unit: unit[:, 0] <= unit[:, 1],
        samples=2048,
        resamples=250,
        seed=1,
    )
    variance = a**2 + a * b + b**2
    explained = np.array([(a + b / 2) ** 2, (b + a / 2) ** 2]) / variance
    remaining = 0.75 * np.array([a**2, b**2]) / variance
    known = {
        "explained": np.array([explained, [1, 1 / 4]]),
        "remaining": np.array([remaining, [3 / 4, 0]]),
    }
    for name, shares in known.items():
        assert found[name] == pytest.approx(shares, abs=0.01)
    for name in ("explained", "remaining"):
        width = found[f"{name}_high"] - found[f"{name}_low"]
        assert (width < 0.05).all()
        assert width.max() > 0.002
    # Shares by one parameter alone add up to more or less than 1.
    if slopes == (1.0, 1.0):
        assert explained.sum() == pytest.approx(1.5)


def test_shares_without_a_forbidden_point_are_the_indices():
    found = sensitivity.compute_allowed_fractions(
        ishigami,
        LOW,
        HIGH,
        is_allowed=lambda unit: np.ones(len(unit), dtype=bool),
        samples=2048,
        resamples=20,
        seed=7,
    )
    first, total = ishigami_indices()
    assert found["explained"][0] == pytest.approx(first, abs=0.02)
    assert found["remaining"][0] == pytest.approx(total, abs=0.02)


def test_shares_are_those_of_rejection_sampling():
    """The twin: nested loops over allowed points, with a curved response."""

    def respond(X):
        return X[:, 0] ** 2 + 2 * X[:, 1] * X[:, 2]

    def is_allowed(unit):
        return unit[:, 0] <= 0.7 * unit[:, 1]

    found = sensitivity.compute_allowed_fractions(
        respond,
        np.zeros(3),
        np.ones(3),
        is_allowed=is_allowed,
        samples=4096,
        resamples=20,
        seed=1,
    )
    random = np.random.default_rng(2)
    points = random.random((200_000, 3))
    points = points[is_allowed(points)]
    variance = respond(points).var()
    for k in range(3):
        # Means within narrow slices of input k.
        slices = np.floor(100 * points[:, k])
        groups = pd.Series(respond(points)).groupby(slices)
        weights = groups.size() / len(points)
        between = (weights * (groups.mean() - respond(points).mean()) ** 2).sum()
        assert found["explained"][0, k] == pytest.approx(between / variance, abs=0.01)
        # Variances over new values of input k, the others kept.
        within = []
        for point in points[:2000]:
            line = np.tile(point, (200, 1))
            line[:, k] = random.random(200)
            within.append(respond(line[is_allowed(line)]).var())
        expected = np.mean(within) / variance
        error = np.std(within) / np.sqrt(len(within)) / variance
        assert found["remaining"][0, k] == pytest.approx(expected, abs=0.01 + 4 * error)


def test_main_effects_are_means_over_what_is_allowed():
    grid, means = sensitivity.compute_main_effects(
        lambda X: 3 * X[:, 0] + X[:, 1],
        np.zeros(2),
        np.ones(2),
        seed=1,
        points=9,
        is_allowed=lambda unit: unit[:, 0] <= unit[:, 1],
    )
    x, y = grid
    assert means[0, :-1] == pytest.approx(3 * x[:-1] + (1 + x[:-1]) / 2, abs=0.02)
    assert means[1, 1:] == pytest.approx(y[1:] + 3 * y[1:] / 2, abs=0.02)
    # Hardly any allowed set has x = 1 or y = 0.
    assert np.isnan(means[0, -1])
    assert np.isnan(means[1, 0])


def test_with_a_constraint_tables_and_message_name_their_shares():
    targets = targets_of(aor_deg=30.0)
    space = ParameterSpace.of(UNIT, constraints=["mus_gg <= mus_gp"])
    slopes = [{"mus_gg": 1.0, "mus_gp": 1.0}]
    table, effects = sensitivity.analyse_surrogate(
        Linear(targets.names, slopes), space, targets, SETTINGS
    )
    assert not {"first", "total"} & set(table)
    rows = table.set_index("parameter")
    for name in ("mus_gg", "mus_gp"):
        assert rows.loc[name, "explained"] == pytest.approx(0.75, abs=0.03)
        assert rows.loc[name, "remaining"] == pytest.approx(0.25, abs=0.03)
    assert rows.loc["e_gg", "explained"] == pytest.approx(0, abs=0.03)
    assert effects.notna().all(axis=None)
    values = effects.loc[effects["parameter"] == "mus_gg", "value"]
    assert values.max() < 1
    words = sensitivity.describe_indices(table)
    assert "explained by a parameter alone (remaining if all others are known)" in words
    assert "mus_gg 0.7" in words
    assert "first-order" not in words


class Logarithms:
    """A response that is the sum of the logarithms of its inputs."""

    def predict(self, X, return_std=False, noise=True):
        return np.log(X).sum(axis=1, keepdims=True)


def test_with_a_constraint_and_scales_the_sets_are_even_in_the_logarithm():
    # In the logarithms a <= b is the triangle, and the response is their sum.
    entry = {"range": [1e-3, 1.0], "scale": "log"}
    space = ParameterSpace.of({"a": entry, "b": entry}, constraints=["a <= b"])
    targets = targets_of(aor_deg=30.0)
    settings = SensitivitySettings(samples=1024, resamples=20, seed=1)
    table, effects = sensitivity.analyse_surrogate(
        Logarithms(), space, targets, settings
    )
    assert table["explained"].to_numpy() == pytest.approx(np.full(2, 0.75), abs=0.01)
    assert table["remaining"].to_numpy() == pytest.approx(np.full(2, 0.25), abs=0.01)
    rows = effects[effects["parameter"] == "b"]
    # The mean logarithm of a below b is the middle between that of 1e-3 and of b.
    expected = 1.5 * np.log(rows["value"]) + 0.5 * np.log(1e-3)
    assert rows["aor_deg"].to_numpy() == pytest.approx(expected.to_numpy(), abs=0.15)


def sensitivity_of(surrogate_json, targets, folder, space=None):
    return sensitivity.analyse_from_file(
        surrogate_json,
        parameters=contact_space(UNIT) if space is None else space,
        targets=targets,
        definitions={},
        settings=SETTINGS,
        out_dir=folder,
    )


@pytest.mark.parametrize(
    "names",
    [("drum_slip_deg",), ("aor_deg", "height_mm", "base_radius_mm", "drum_slip_deg")],
)
def test_one_target_and_four(names):
    targets = targets_of(**dict.fromkeys(names, 30.0))
    slopes = SLOPES[: len(names)]
    table, effects = sensitivity.analyse_surrogate(
        Linear(names, slopes), ParameterSpace.of(UNIT), targets, SETTINGS
    )
    assert len(table) == 6 * len(names)
    first = table.set_index(["response", "parameter"])["first"]
    assert first[names[0], "mus_gp"] == pytest.approx(4 / 5, abs=0.02)
    if len(names) == 4:
        assert first["drum_slip_deg", "mur_gp"] == pytest.approx(16 / 25, abs=0.02)
    assert effects.columns.tolist() == ["parameter", "value", *names]


@pytest.mark.parametrize("name", names())
def test_tables_of_every_surrogate(name, tmp_path):
    random = np.random.RandomState(1)
    X = random.uniform(size=(60, 6))
    targets = targets_of(aor_deg=30.0, height_mm=60.0)
    model = make(
        name,
        NetworkSettings.from_keys(
            {"hidden": 3, "starts": 1, "epochs": 100, "goal": 0.0, "seed": 1}
        ),
    )
    model.describe(PARAMETERS, targets.names).fit(X, X @ random.uniform(size=(6, 2)))
    model.save(tmp_path / "network.json")
    path = tmp_path / "network.json"
    table = sensitivity_of(path, targets, tmp_path / "out")
    again = sensitivity_of(path, targets, tmp_path / "again")
    pd.testing.assert_frame_equal(table, again)
    assert len(table) == 12
    assert table.groupby("response")["first"].sum().to_numpy() == pytest.approx(
        [1, 1], abs=0.05
    )
    effects = pd.read_csv(tmp_path / "out/main_effects.csv")
    assert effects.columns.tolist() == ["parameter", "value", "aor_deg", "height_mm"]


def test_faults_are_reported_with_the_file(tmp_path):
    path = tmp_path / "network.json"
    targets = targets_of(aor_deg=30.0)
    X = np.random.RandomState(1).uniform(size=(20, 6))
    flat = BayesianBP(hidden=2, starts=1, epochs=20).fit(X, X[:, :1])
    flat.W1_ = 0 * flat.W1_
    flat.describe(PARAMETERS, targets.names).save(path)
    fixed = contact_space({name: {"fixed": 0.5} for name in PARAMETERS})
    flat = r"network\.json: surrogate is 'an output of the function does not vary"
    input_error(flat, sensitivity_of, path, targets, tmp_path)
    other = targets_of(height_mm=60.0)
    input_error("outputs", sensitivity_of, path, other, tmp_path)
    input_error("all fixed", sensitivity_of, path, targets, tmp_path, fixed)

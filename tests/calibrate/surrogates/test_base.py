"""What every surrogate promises, on functions with a known answer."""

import json
import math

import numpy as np
import pytest
from refusals import input_error, value_error

from repose.calibrate.responses import reject_other_definitions
from repose.calibrate.surrogates import base, load, make, names
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.common.faults import find_schema
from repose.config.models import make_settings_type

SETTINGS = NetworkSettings.from_keys(
    {"hidden": 6, "epochs": 200, "goal": 0.0, "starts": 3, "seed": 1}
)
INPUTS = ("a", "b", "c")
NOISE = np.array([0.2, 2.0, 0.02, 20.0])

every = pytest.mark.parametrize("name", names())
# an ensemble of one start is that network (test_process.py)
each_alone = pytest.mark.parametrize(
    "name", [name for name in names() if name != "network_ensemble"]
)
any_number = pytest.mark.parametrize("outputs", [1, 4])


def truth(X, outputs=2):
    """Responses of three inputs in [2, 4], of different units; gently curved, so that each surrogate can follow."""
    U = X - 3
    first = 5 + 2 * U[:, 0] - U[:, 1] + 0.5 * U[:, 0] * U[:, 1]
    second = 60 + 20 * U[:, 1] + 8 * U[:, 2] ** 2
    return np.column_stack(
        [first, second, 0.1 * first + 0.2 * U[:, 2], 10 * second - 100 * U[:, 0]]
    )[:, :outputs]


def points(count, seed):
    return np.random.default_rng(seed).uniform(2, 4, (count, 3))


def samples(count, outputs=2, seed=0, noise=1.0):
    X = points(count, seed)
    random = np.random.default_rng(seed + 100)
    return X, truth(X, outputs) + noise * NOISE[:outputs] * random.normal(
        size=(count, outputs)
    )


@pytest.fixture(scope="module")
def fitted():
    X, Y = samples(80)
    description = INPUTS, ("x_deg", "y_mm"), {"x_deg": {"a.b": 1}}
    return {
        name: make(name, SETTINGS).describe(*description).fit(X, Y) for name in names()
    }


@every
@any_number
def test_it_finds_the_function_behind_noisy_samples(name, outputs):
    model = make(name, SETTINGS).fit(*samples(80, outputs))
    X = points(200, 1)
    left = model.predict(X) - truth(X, outputs)
    assert left.shape == (200, outputs)
    assert (np.std(left, axis=0) < 0.6 * NOISE[:outputs]).all()
    assert model.covariance(X).shape == (200, outputs, outputs)


# The moments of a process are those of its closed form, says test_process.py.
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow)
        if name == "gaussian_process"
        else name
        for name in names()
        if name != "network_ensemble"
    ],
)
def test_error_bars_of_the_mean_cover_the_truth(name):
    """90 % intervals at the same point for 40 data sets: as a whole they cover it about as often as they say."""
    X = points(30, 1)
    inside = []
    for seed in range(40):
        model = make(name, SETTINGS.model_copy(update={"starts": 1, "epochs": 50})).fit(
            *samples(60, seed=seed)
        )
        mean, std = model.predict(X, return_std=True, noise=False)
        inside.append(np.abs(mean - truth(X)) < 1.645 * std)
    assert 0.83 < np.mean(inside) < 0.97


@every
def test_errors_of_single_values_hold_the_noise_and_the_covariance_their_squares(
    name, fitted
):
    X = points(20, 2)
    single = fitted[name].predict(X, return_std=True, noise=True)[1]
    mean = fitted[name].predict(X, return_std=True, noise=False)[1]
    noise = np.sqrt(single**2 - mean**2)
    assert noise == pytest.approx(np.broadcast_to(noise[0], noise.shape))
    assert noise[0] == pytest.approx(NOISE[:2], rel=0.3)
    covariance = fitted[name].covariance(X)
    std = fitted[name].predict(X, return_std=True, noise=False)[1]
    assert np.diagonal(covariance, axis1=1, axis2=2) == pytest.approx(std**2, rel=1e-6)
    assert covariance == pytest.approx(covariance.transpose(0, 2, 1))
    assert (
        np.linalg.eigvalsh(covariance / (std[:, :, None] * std[:, None, :])) > -1e-9
    ).all()


@every
@pytest.mark.parametrize(
    "uneven", [False, True], ids=["same weights", "weights differ"]
)
def test_a_file_gives_the_same_predictions_with_errors(name, uneven, tmp_path):
    X, Y = samples(40)
    precision = np.random.default_rng(3).uniform(0.5, 2, Y.shape) if uneven else None
    model = make(name, SETTINGS).fit(X, Y, precision=precision)
    model.describe(
        INPUTS, ("x_deg", "y_mm"), {"x_deg": {"a.b": 1}}, np.arange(40)[::-1]
    )
    model.save(tmp_path / "one.json")
    again = load(tmp_path / "one.json", ("x_deg", "y_mm"))
    assert again.name == name
    assert again.inputs == INPUTS
    assert again.outputs == ("x_deg", "y_mm")
    assert again.definitions == {"x_deg": {"a.b": 1}}
    fresh = points(10, 5)
    mean, error = model.predict(fresh, return_std=True)
    same_mean, same_error = again.predict(fresh, return_std=True)
    assert mean == pytest.approx(same_mean, rel=1e-6)
    assert error == pytest.approx(same_error, rel=1e-6)
    assert (model.predict(fresh) == again.predict(fresh)).all()
    assert again.covariance(fresh) == pytest.approx(model.covariance(fresh), rel=1e-5)
    again.save(tmp_path / "two.json")
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()


@every
def test_a_search_gets_the_same_responses(name, fitted):
    unit = np.random.default_rng(4).uniform(-1, 1, (50, 3))
    low = np.array([2.0, 2.5, 3.0])
    high = np.array([3.0, 4.0, 3.5])
    respond = fitted[name].response_function(low, high)
    expected = fitted[name].predict(low + (unit + 1) / 2 * (high - low))
    assert respond(unit) == pytest.approx(expected, rel=1e-9)


@every
def test_a_shift_moves_the_mean_alone(name, fitted, tmp_path):
    X = points(10, 6)
    offset = np.array([0.5, -3.0])
    moved = fitted[name].shifted(offset)
    mean, std = fitted[name].predict(X, return_std=True)
    moved_mean, moved_std = moved.predict(X, return_std=True)
    assert moved_mean == pytest.approx(mean + offset)
    assert moved_std == pytest.approx(std)
    assert fitted[name].predict(X) == pytest.approx(mean)
    moved.save(tmp_path / "moved.json")
    assert load(tmp_path / "moved.json").predict(X) == pytest.approx(mean + offset)
    assert moved.response_function(np.full(3, 2.0), np.full(3, 4.0))(
        X - 3
    ) == pytest.approx(mean + offset)


@every
def test_an_input_that_does_not_vary_has_no_effect(name):
    X = points(60, 0)
    X[:, 2] = 3.0
    model = make(name, SETTINGS).fit(X, truth(X))
    assert model.predict(X) == pytest.approx(truth(X), rel=0.02)
    assert np.isfinite(model.covariance(X)).all()


@each_alone
def test_a_sample_of_little_precision_hardly_counts(name):
    X, Y = samples(60, noise=0.3)
    spoiled = Y.copy()
    spoiled[7] += 15 * NOISE[:2]
    precision = np.ones(60)
    precision[7] = 1e-8
    cases = ((Y, None), (spoiled, precision), (spoiled, None))
    fits = (
        make(name, SETTINGS).fit(X, values, precision=weight)
        for values, weight in cases
    )
    clean, weighed, kept = (fit.predict(X) for fit in fits)
    assert (
        np.abs(weighed - clean).mean(axis=0) < 0.3 * np.abs(kept - clean).mean(axis=0)
    ).all()


@every
def test_correlated_noise_is_taken_and_what_is_no_covariance_is_refused(name):
    X, Y = samples(60)
    covariance = np.array([[0.04, 0.3], [0.3, 4.0]])
    model = make(name, SETTINGS).fit(X, Y, noise_covariance=covariance)
    assert (np.std(model.predict(X) - truth(X), axis=0) < 0.6 * NOISE[:2]).all()
    model = make(name, SETTINGS)
    value_error(
        "positive definite", model.fit, X, Y, noise_covariance=[[1.0, 2.0], [2.0, 1.0]]
    )
    value_error(
        "the same for all of them",
        model.fit,
        X,
        Y,
        precision=1 + X[:, :2],
        noise_covariance=covariance,
    )


def test_correlated_noise_is_noticed_and_definitions_of_a_response_do_not_mix():
    random = np.random.default_rng(0)
    X = points(60, 0)
    Y = truth(X)[:, [0, 0]] + 0.2 * (
        0.95 * random.normal(size=(60, 1)) + 0.3 * random.normal(size=(60, 2))
    )
    covariance = 0.04 * np.array([[1.0, 0.9], [0.9, 1.0]])
    found = (
        make("gaussian_process", {})
        .fit(X, Y, noise_covariance=covariance)
        .covariance(points(10, 1))
    )
    assert (found[:, 0, 1] / np.sqrt(found[:, 0, 0] * found[:, 1, 1]) > 0.6).all()
    secant = {"aor_deg": {"measure.response": "secant"}}
    flank = {"aor_deg": {"measure.response": "flank"}}
    reject_other_definitions(
        secant, "network.json", secant | {"height_mm": {}}, "dataset.csv"
    )
    mixed = r"network\.json: definition of aor_deg .*secant.*flank.* dataset\.csv"
    input_error(
        mixed, reject_other_definitions, secant, "network.json", flank, "dataset.csv"
    )


@every
def test_wrong_samples_are_refused(name, fitted):
    X, Y = samples(60)
    for arguments in ((X[:5], Y), (X, np.full_like(Y, np.nan)), (X[:1], Y[:1])):
        value_error(r"expected|finite", make(name, SETTINGS).fit, *arguments)
    value_error(r"expected \(samples, 3\)", fitted[name].predict, X[:, :2])


def test_a_quadratic_surface_is_exact():
    X = points(11, 0)
    fresh = points(20, 1)
    model = make("quadratic", {}).fit(X, truth(X))
    assert model.predict(fresh) == pytest.approx(truth(fresh))
    value_error("10 samples; expected at least 11", model.fit, X[:10], truth(X[:10]))


def test_the_covariance_of_a_quadratic_surface_is_that_of_fits_to_noise():
    X = points(25, 0)
    fresh = points(5, 1)
    random = np.random.default_rng(2)
    precision = random.uniform(0.2, 3.0, (25, 2))
    correlation = np.array([[1.0, 0.8], [0.8, 1.0]])
    root = np.linalg.cholesky(correlation)

    def fitted(Y):
        return make("quadratic", {}).fit(X, Y, precision=precision)

    # A predicted mean is a weighted sum of the values, so its covariance is known.
    exact = fitted(truth(X)).predict(fresh)
    weights = np.empty((25, 5, 2))
    for i in range(25):
        shift = np.zeros((25, 2))
        shift[i] = 1.0
        weights[i] = fitted(truth(X) + shift).predict(fresh) - exact
    weights /= np.sqrt(precision)[:, None]
    known = np.einsum("imj,imk->mjk", weights, weights) * correlation

    # An estimate from 15 degrees of freedom has an error of 37 %; the mean of 400 one of 2 %.
    claimed = []
    for _ in range(400):
        noise = random.normal(size=(25, 2)) @ root.T * NOISE[:2] / np.sqrt(precision)
        claimed.append(fitted(truth(X) + noise).covariance(fresh))
    found = np.mean(claimed, axis=0) / (NOISE[:2, None] * NOISE[:2])
    for k in range(5):
        assert found[k] == pytest.approx(known[k], abs=0.08 * known[k].max())


def test_surrogates_are_registered_once():
    class Other(base.Surrogate):
        pass

    value_error(
        "registered already, by QuadraticSurface", base.register("quadratic"), Other
    )
    input_error(
        f"surrogate is 'cubic'; expected one of {', '.join(sorted(names()))}",
        make,
        "cubic",
        {},
    )
    assert find_schema(("surrogate",), make_settings_type())["enum"] == list(names())


def test_load_names_what_is_wrong(tmp_path, fitted):
    input_error("missing", load, tmp_path / "missing.json")
    fitted["quadratic"].save(tmp_path / "good.json")
    good = json.loads((tmp_path / "good.json").read_text())
    for change, text in (
        ({"surrogate": "cubic"}, "surrogate is 'cubic'"),
        ({"surrogate": "network"}, "input_min"),
        ({"training": None}, "quadratic"),
        ({"outputs": 3}, "outputs"),
        ({"samples": ["a", "b"]}, "samples"),
        ({"samples": [1, 1]}, "samples"),
        ({"samples": [1.5]}, "samples"),
        ({"samples": [math.inf]}, "numbers is 'not all finite'"),
    ):
        (tmp_path / "bad.json").write_text(json.dumps(good | change))
        input_error(text, load, tmp_path / "bad.json")
    fitted["network"].save(tmp_path / "network.json")
    damaged = json.loads((tmp_path / "network.json").read_text()) | {
        "output_max": [math.nan, 1.0]
    }
    (tmp_path / "bad.json").write_text(json.dumps(damaged))
    # the mean of a network holds without it
    input_error("not all finite", load, tmp_path / "bad.json")
    message = r"outputs is \['x_deg', 'y_mm'\]; expected the targets y_mm, x_deg"
    input_error(message, load, tmp_path / "good.json", ("y_mm", "x_deg"))

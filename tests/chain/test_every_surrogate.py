"""The main chain with every surrogate: training, inversion, and the answer simulated again."""

import numpy as np
import pandas as pd
import pytest
import shared

from repose.chain import invert, train, validate
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.targets import Targets
from repose.surrogate import load, names

TARGETS = Targets.of(shared.TARGETS)
SPACE = ParameterSpace.of({key: [0.0, 1.0] for key in PARAMETERS} | {"e_gg": {"fixed": 0.5}})
TRAINING = {"hidden": 6, "epochs": 150, "goal": 0.0, "starts": 2, "seed": 1, "split": [0.7, 0.15, 0.15]}
TRAINING |= {"prior": "inputs", "weights_from_errors": True, "correlated_noise": True}
SEARCH = {
    "islands": 3,
    "population": 20,
    "rounds": 10,
    "generations": 10,
    "tournament": 3,
    "mutation_probability": 0.05,
    "mutation_amplitude": 0.1,
    "solutions": 10,
    "distance": 0.05,
    "seed": 1,
}
NOISE = np.array([0.3, 0.6])


def simulator(X):
    """Angle and Height of a made-up pile, as curved as a real one."""
    U = 2 * X - 1
    pull = 1.5 * U[:, 1] + 2 * U[:, 2] + U[:, 4] + 0.5 * U[:, 2] * U[:, 4] - 0.6 * U[:, 1] ** 2
    return np.column_stack([32.5 + 1.5 * pull, 66 + 3 * pull + 2 * U[:, 4] - U[:, 5]])


def poured(X, seeds, random):
    """Responses (samples, seeds, 2) with correlated noise."""
    noise = random.normal(size=(len(X), seeds, 2)) @ np.linalg.cholesky([[1.0, 0.8], [0.8, 1.0]]).T
    return simulator(X)[:, None, :] + NOISE * noise


def study(samples=70, seeds=6):
    """dataset and runs of a made-up study."""
    random = np.random.default_rng(0)
    X = SPACE.values(random.uniform(size=(samples, SPACE.dimensions)))
    values = poured(X, seeds, random)
    dataset = pd.DataFrame(X, columns=list(PARAMETERS))
    dataset.insert(0, "sample", np.arange(1, samples + 1))
    dataset["status"], dataset["n_seeds"] = "ok", seeds
    dataset[list(TARGETS.names)] = values.mean(axis=1)
    dataset[list(TARGETS.errors)] = values.std(axis=1, ddof=1) / np.sqrt(seeds)
    runs = pd.DataFrame(values.reshape(-1, 2), columns=list(TARGETS.names))
    runs.insert(0, "sample", np.repeat(dataset["sample"], seeds).to_numpy())
    runs["status"] = "ok"
    return dataset, runs


def jobs_of(solutions, seeds=16):
    """Pours of the solutions, as the bench test's jobs hold them."""
    values = poured(solutions[list(PARAMETERS)].to_numpy(float), seeds, np.random.default_rng(1))
    ended = {"status": "ok", "reason": "", "discharge_s": 16.0}
    return {
        "funnel": {
            sample: {"runs": [{"seed": k, **dict(zip(TARGETS.names, row, strict=True)), **ended}
                              for k, row in enumerate(rows)]}
            for sample, rows in zip(solutions["sample"], values.tolist(), strict=True)
        }
    }  # fmt: skip


@pytest.mark.parametrize("name", names())
def test_the_answer_of_the_chain_gives_the_targets_when_simulated_again(name, tmp_path):
    training = train.train(*study(), TARGETS, TRAINING | {"surrogate": name})
    assert training.metrics["test"][TARGETS.names[0]]["r2"] > 0.9
    training.model.save(tmp_path / "network.json")
    model = load(tmp_path / "network.json", TARGETS.names)
    assert model.name == name

    found = invert.invert(model, SPACE, TARGETS, SEARCH)
    best = found.solutions[found.solutions["representative"]]
    X = best[list(PARAMETERS)].to_numpy(float)
    assert (best["e_gg"] == 0.5).all()
    assert best[list(TARGETS.predicted)].to_numpy() == pytest.approx(model.predict(X), rel=1e-9)
    assert best[list(TARGETS.predicted)].to_numpy()[0] == pytest.approx(TARGETS.aim, rel=1e-3)

    solutions = validate.solutions_to_simulate(found.solutions, None, SPACE, TARGETS, 3)
    tables = validate.validate(solutions, jobs_of(solutions), TARGETS)
    assert (tables["representative"]["error_percent"] < 2).all()
    std = model.predict(X, return_std=True, noise=False)[1]
    assert (np.abs(simulator(X) - model.predict(X)) < 4 * std).all()

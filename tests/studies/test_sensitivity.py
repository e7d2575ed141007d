"""Sobol indices and main effects with closed forms."""

import numpy as np
import pandas as pd
import pytest
from linear import Linear
from refusals import input_error, value_error
from shared import targets_of
from synthetic import Study

from repose.core.errors import InputError
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.studies import sensitivity
from repose.surrogate import make, names
from repose.surrogate.bayesian_bp import BayesianBP
from repose.surrogate.settings import NetworkSettings

LOW, HIGH = [-np.pi] * 3, [np.pi] * 3


def ishigami(X, a=7.0, b=0.1):
    return np.sin(X[:, 0]) + a * np.sin(X[:, 1]) ** 2 + b * X[:, 2] ** 4 * np.sin(X[:, 0])


def ishigami_indices(a=7.0, b=0.1):
    """First-order and total (Ishigami & Homma 1990)."""
    first, second = 0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8
    both = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    total = first + second + both
    return np.array([first, second, 0]) / total, np.array([first + both, second, both]) / total


def test_ishigami():
    found = sensitivity.indices(ishigami, LOW, HIGH, 4096, 100, 7)
    for name, known in zip(("first", "total"), ishigami_indices(), strict=True):
        assert found[name][0] == pytest.approx(known, abs=0.015)
        width = found[f"{name}_high"] - found[f"{name}_low"]
        assert ((width[0] > 0.005) & (width[0] < 0.15)).all()
        assert (found[f"{name}_low"][0] <= known + 0.01).all()
        assert (known - 0.01 <= found[f"{name}_high"][0]).all()


def test_sums_have_their_indices_and_main_effects_are_means_over_the_other_inputs():
    def weigh(X):
        return np.column_stack([1000 + X @ [1, 2, 0], -50 + X @ [0, 3, 4]])

    found = sensitivity.indices(weigh, [0, 0, 0], [1, 1, 1], 2048, 20, 1)
    known = np.array([[1, 4, 0], [0, 9, 16]]) / np.array([[5], [25]])
    assert found["first"] == pytest.approx(known, abs=0.01)
    assert found["total"] == pytest.approx(known, abs=0.01)
    grid, means = sensitivity.main_effects(ishigami, LOW, HIGH, 3, points=9)
    assert grid.shape == (3, 9)
    assert means[1] == pytest.approx(7 * np.sin(grid[1]) ** 2, abs=0.05)
    assert means[0] == pytest.approx(np.sin(grid[0]) * (1 + 0.1 * np.pi**4 / 5) + 3.5, abs=0.05)


def test_bad_arguments_are_reported():
    value_error("samples is 100; expected a power of two", sensitivity.indices, ishigami, LOW, HIGH, 100, 20, 1)
    value_error("does not vary", sensitivity.indices, lambda X: np.ones(len(X)), LOW, HIGH, 64, 20, 1)


UNIT = {name: [0.0, 1.0] for name in PARAMETERS}
SECTION = {"samples": 256, "resamples": 20, "seed": 1}
SLOPES = [{"e_gg": 1.0, "mus_gp": 2.0}, {"mur_gg": 5.0}, {"mus_gp": 1.0}, {"e_gp": 3.0, "mur_gp": 4.0}]


def study_of(targets, space=None):
    """A study of these targets."""
    return Study(space or ParameterSpace.of(UNIT), targets, {"sensitivity": SECTION})


@pytest.mark.parametrize("names", [("drum_slip_deg",), ("aor_deg", "height_mm", "base_radius_mm", "drum_slip_deg")])
def test_one_target_and_four(names):
    targets, slopes = targets_of(**dict.fromkeys(names, 30.0)), SLOPES[: len(names)]
    table, effects = sensitivity.analyse(Linear(names, slopes), study_of(targets))
    assert len(table) == 6 * len(names)
    first = table.set_index(["response", "parameter"])["first"]
    assert first[names[0], "mus_gp"] == pytest.approx(4 / 5, abs=0.02)
    if len(names) == 4:
        assert first["drum_slip_deg", "mur_gp"] == pytest.approx(16 / 25, abs=0.02)
    assert effects.columns.tolist() == ["parameter", "value", *names]


def test_a_fixed_parameter_has_no_index():
    space = ParameterSpace.of(UNIT | {"e_gg": {"fixed": 0.9}})
    targets = targets_of(drum_slip_deg=30.0)
    table, effects = sensitivity.analyse(Linear(targets.names, SLOPES[:1]), study_of(targets, space))
    assert "e_gg" not in set(table["parameter"]) | set(effects["parameter"])
    assert table.set_index("parameter").loc["mus_gp", "first"] == pytest.approx(1, abs=0.02)
    middle = effects[(effects["parameter"] == "mus_gp") & (effects["value"] == 0.5)]
    assert middle["drum_slip_deg"].item() == pytest.approx(30.4)  # e_gg is 0.4 above its middle


@pytest.mark.parametrize("name", names())
def test_tables_of_every_surrogate(name, tmp_path):
    random = np.random.RandomState(1)
    X, targets = random.uniform(size=(60, 6)), targets_of(aor_deg=30.0, height_mm=60.0)
    model = make(name, NetworkSettings.of({"hidden": 3, "starts": 1, "epochs": 100, "goal": 0.0, "seed": 1}))
    model.describe(PARAMETERS, targets.names).fit(X, X @ random.uniform(size=(6, 2)))
    model.save(tmp_path / "network.json")
    parts = (tmp_path / "network.json", study_of(targets))
    table = sensitivity.run(*parts, tmp_path / "out")
    pd.testing.assert_frame_equal(table, sensitivity.run(*parts, tmp_path / "again"))
    assert len(table) == 12
    assert table.groupby("response")["first"].sum().to_numpy() == pytest.approx([1, 1], abs=0.05)
    effects = pd.read_csv(tmp_path / "out/main_effects.csv")
    assert effects.columns.tolist() == ["parameter", "value", "aor_deg", "height_mm"]
    assert "aor_deg: first-order (total)" in sensitivity.message(table)


def test_faults_are_reported_with_the_file(tmp_path):
    path, targets = tmp_path / "network.json", targets_of(aor_deg=30.0)
    X = np.random.RandomState(1).uniform(size=(20, 6))
    flat = BayesianBP(hidden=2, starts=1, epochs=20).fit(X, X[:, :1])
    flat.W1_ = 0 * flat.W1_
    flat.describe(PARAMETERS, targets.names).save(path)
    with pytest.raises(InputError, match=r"network\.json: surrogate is 'an output of the function does not vary"):
        sensitivity.run(path, study_of(targets), tmp_path)
    with pytest.raises(InputError, match="outputs"):
        sensitivity.run(path, study_of(targets_of(height_mm=60.0)), tmp_path)
    fixed = ParameterSpace.of({name: {"fixed": 0.5} for name in PARAMETERS})
    input_error("all fixed", sensitivity.run, path, study_of(targets, fixed), tmp_path)

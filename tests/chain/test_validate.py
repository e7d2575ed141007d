import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shared

from repose.chain import validate
from repose.cli import main
from repose.core.errors import InputError
from repose.core.parameter_sets import read_sample
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.published import published_count
from repose.core.targets import Targets
from repose.surrogate.support import Support

SPACE = ParameterSpace(PARAMETERS, np.zeros(6), np.ones(6))
TARGETS = Targets.of(shared.TARGETS)
PUBLISHED = (
    "solution,e_gg,mus_gg,mur_gg,e_gp,mus_gp,mur_gp,"
    "aor_predicted_deg,height_predicted_mm,aor_simulated_deg,height_simulated_mm\n"
    "22,0.217,0.611,0.038,0.233,0.509,0.183,32.5001,67.0000,32.00,65.63\n"
    "representative,0.203,0.642,0.037,0.244,0.483,0.185,32.5,67.00,,\n"
)


@pytest.fixture
def study(tmp_path):
    random = np.random.RandomState(1)
    feasible = pd.DataFrame(random.uniform(0.3, 0.7, (12, 6)), columns=list(PARAMETERS))
    feasible.insert(0, "solution", np.arange(1, 13))
    feasible["aor_predicted_deg"], feasible["height_predicted_mm"] = 32.5, 66.0
    feasible["objective"], feasible["feasible"] = np.arange(12) / 100, True
    feasible["representative"] = feasible["solution"] == 1
    feasible.to_csv(tmp_path / "feasible.csv", index=False)
    (tmp_path / "published4.csv").write_text(PUBLISHED)
    return tmp_path


def write_heaps(folder, solutions, failed=(), names=PARAMETERS):
    paths = []
    for row in solutions.to_dict("records"):
        runs = []
        for seed, (aor, height) in enumerate([(30.0, 64.0), (32.0, 66.0), (34.0, 68.0)]):
            ok = row["sample"] not in failed
            numbers = {
                "aor_deg": aor if ok else None,
                "height_mm": height if ok else None,
                "discharge_s": 16.0,
            }
            runs.append(
                {"seed": seed, "status": "ok" if ok else "jammed", "reason": "" if ok else "stuck"} | numbers
            )
        job = {"sample": row["sample"], "parameters": {name: row[name] for name in names}, "runs": runs}
        paths.append(folder / f"{row['sample']:03}.json")
        paths[-1].write_text(json.dumps(job))
    return paths


def select(folder, count=5):
    return validate.write_solutions(
        folder / "feasible.csv", folder / "published4.csv", SPACE, TARGETS, count, folder / "v/solutions.csv"
    )


def tables(folder, failed=()):
    paths = write_heaps(folder, select(folder), failed)
    return validate.run(folder / "v/solutions.csv", paths, folder / "published4.csv", TARGETS, folder / "v")


def test_solutions_are_samples_with_ours_first_and_the_published_from_101(study):
    select(study)
    written = pd.read_csv(study / "v/solutions.csv")
    assert written.columns[:7].tolist() == ["sample", *PARAMETERS]
    assert written["sample"].tolist() == [1, 2, 3, 4, 5, 6, 101, 102]
    assert written["role"].tolist() == ["representative"] + ["spread"] * 6 + ["representative"]
    assert written["solution"].tolist()[0] == "1"
    assert written["solution"].tolist()[-2:] == ["22", "representative"]
    assert written["solution"].is_unique
    assert written.loc[7, "mus_gg"] == 0.642


def test_published_solutions_have_the_same_numbers_in_a_table_of_their_own(study, tmp_path):
    both = select(study).set_index("sample")
    own = validate.write_published_solutions(study / "published4.csv", PARAMETERS, tmp_path / "theirs.csv")
    assert list(own["sample"]) == list(both.index[both["origin"] == "published"])
    np.testing.assert_array_equal(own[list(PARAMETERS)], both.loc[own["sample"], list(PARAMETERS)])


def test_too_few_solutions_are_named(study):
    with pytest.raises(InputError, match=r"feasible.csv: solutions is 12; allowed: at least 21"):
        select(study, count=20)


def test_table4_has_errors_as_published(study):
    found = tables(study)
    table = found["table4"]
    assert len(table) == 6
    row = table.iloc[0]
    assert row["aor_simulated_deg"] == pytest.approx(32.0)
    assert row["aor_se_deg"] == pytest.approx(2 / np.sqrt(3))
    assert row["aor_error_percent"] == pytest.approx(100 * 0.5 / 32.0)  # 1.56, as theirs for 32.50 and 32.00
    assert row["height_error_percent"] == pytest.approx(0.0)
    assert row["n_seeds"] == 3
    pd.testing.assert_frame_equal(pd.read_csv(study / "v/table4.csv")[["sample"]], table[["sample"]])
    published = found["published"].set_index("solution")
    assert published.loc["22", "aor_published_simulated_deg"] == 32.0
    assert published.loc["22", "height_difference_mm"] == pytest.approx(66.0 - 65.63)
    assert np.isnan(published.loc["representative", "aor_published_simulated_deg"])
    assert published.loc["representative", "aor_simulated_deg"] == pytest.approx(32.0)


def test_representative_against_the_physical_pile(study):
    table = tables(study)["representative"].set_index("response")
    assert table.loc["aor_deg", "error_percent"] == pytest.approx(100 * 0.87 / 32.87)
    assert table.loc["height_mm", "physical_sd"] == 4.10
    assert table["within_one_sd"].all()
    assert (table["within_1_percent"] <= table["within_2_percent"]).all()
    assert 0 < table["within_2_percent"].iloc[0] < 1
    far = validate.against_physical(
        {
            f"{a}_{b}_{c}": 40.0
            for a, c in (("aor", "deg"), ("height", "mm"))
            for b in ("predicted", "simulated", "se")
        }
        | {"n_seeds": 3, "status": "ok"},
        TARGETS,
    )
    assert not far["within_one_sd"].any()


def test_a_failed_simulation_keeps_its_row_without_numbers(study):
    result = tables(study, failed=(1, 3, 101))
    table = result["table4"].set_index("sample")
    assert table.loc[3, "status"] == "jammed"
    assert np.isnan(table.loc[3, "aor_simulated_deg"])
    assert np.isnan(table.loc[3, "aor_error_percent"])
    assert not result["representative"]["within_one_sd"].any()
    assert np.isnan(result["published"].set_index("sample").loc[101, "aor_difference_deg"])


def test_solutions_beyond_the_samples_carry_a_warning(study):
    """Samples fill 0.3 to 0.7 of every range, as our solutions do; the published mur_gg lie far below."""
    random = np.random.RandomState(2)
    support = Support(random.uniform(0.3, 0.7, (200, 6)), np.zeros(6), np.ones(6))
    paths = write_heaps(study, select(study))
    plain = validate.run(
        study / "v/solutions.csv", paths, study / "published4.csv", TARGETS, study / "v/plain"
    )
    result = validate.run(
        study / "v/solutions.csv", paths, study / "published4.csv", TARGETS, study / "v", support
    )
    for name in ("table4", "published"):
        assert result[name].columns.tolist() == [*plain[name].columns, "warning"]
    assert (result["table4"]["warning"] == "").sum() >= 3
    assert result["published"]["warning"].str.contains("nearest sample").all()


def test_a_missing_simulation_is_named(study):
    paths = write_heaps(study, select(study))
    with pytest.raises(InputError, match=r"samples without a file is \[102\]"):
        validate.run(study / "v/solutions.csv", paths[:-1], study / "published4.csv", TARGETS, study / "v")


WIDE = ParameterSpace(PARAMETERS, np.zeros(6), np.full(6, 2.0))


def cloud(feasible):
    x = np.linspace(0, 2, len(feasible))
    table = pd.DataFrame({name: np.ones(len(x)) for name in PARAMETERS})
    table["e_gg"], table["feasible"], table["objective"] = x, feasible, abs(x - 0.4)
    table["solution"], table["representative"] = np.arange(1, len(x) + 1), np.arange(len(x)) == 2
    return table


def test_validation_takes_the_representative_and_the_farthest_of_the_rest():
    picked = validate.select_for_validation(cloud([True] * 11), 3, WIDE)
    # positions 0.4; then 2.0 (1.6 away), then 1.2 (0.8 from both), then 0.0 (0.4) before 0.8 and 1.6 (0.4)
    assert picked["e_gg"].tolist() == pytest.approx([0.4, 2.0, 1.2, 0.0])
    assert picked["role"].tolist() == ["representative", "spread", "spread", "spread"]
    # the solution of least objective stands beside a representative that is another, and that is outside the ranges
    other = cloud([True] * 11).assign(objective=np.arange(11.0))
    picked = validate.select_for_validation(other, 3, WIDE)
    assert picked["e_gg"].tolist() == pytest.approx([0.4, 0.0, 2.0, 1.2])
    assert picked["role"].tolist() == ["representative", "least objective", "spread", "spread"]
    other.loc[2, "feasible"] = False
    assert validate.select_for_validation(other, 5, WIDE)["role"].iloc[0] == "representative"


def test_validation_prefers_feasible_solutions_while_there_are_enough():
    table = cloud([True] * 6 + [False] * 5)
    assert validate.select_for_validation(table, 5, WIDE)["feasible"].all()
    assert not validate.select_for_validation(table, 6, WIDE)["feasible"].all()


def test_published_solutions_without_the_targets_are_left_out(study):
    one = Targets([target for target in TARGETS if target.name == "height_mm"])
    other = pd.read_csv(study / "published4.csv").drop(columns=["height_predicted_mm"])
    other.to_csv(study / "other.csv", index=False)
    for path in (study / "other.csv", None):
        table = validate.write_solutions(
            study / "feasible.csv", path, SPACE, one, 3, study / "v/solutions.csv"
        )
        assert table["origin"].unique().tolist() == ["miga"]
        paths = write_heaps(study, table)
        found = validate.run(study / "v/solutions.csv", paths, path, one, study / "v")
        assert found["representative"]["response"].tolist() == ["height_mm"]
        assert found["published"].empty
        assert pd.read_csv(study / "v/published.csv").empty


def test_a_law_of_further_parameters_keeps_them_and_leaves_the_published_sets_out(study):
    names = (*PARAMETERS, "gamma_gg", "gamma_gp")
    space = ParameterSpace(names, np.zeros(8), np.ones(8), names=names)
    table = pd.read_csv(study / "feasible.csv").assign(gamma_gg=0.05, gamma_gp=0.02)
    table.to_csv(study / "feasible.csv", index=False)
    chosen = validate.write_solutions(
        study / "feasible.csv", study / "published4.csv", space, TARGETS, 5, study / "v/solutions.csv"
    )
    assert chosen["origin"].unique().tolist() == ["miga"]
    assert read_sample(study / "v/solutions.csv", 1)["gamma_gg"] == 0.05
    responses = TARGETS.responses
    assert published_count(study / "published4.csv", responses, PARAMETERS) == 2
    assert published_count(study / "published4.csv", responses, names) == 0
    with pytest.raises(InputError, match="column gamma_gg"):
        validate.write_published_solutions(study / "published4.csv", names, study / "v/published.csv")
    paths = write_heaps(study, chosen, names=names)
    found = validate.run(study / "v/solutions.csv", paths, study / "published4.csv", TARGETS, study / "v")
    assert found["table4"]["gamma_gp"].tolist() == [0.02] * 6
    assert found["published"].empty


def test_the_stage_lists_the_sets_of_a_kept_study(monkeypatch, tmp_path):
    root = Path(__file__).parents[2]
    monkeypatch.chdir(root)
    kept = root / "results/published/recommended"
    words = ("--config", str(kept / "config.json"), "--feasible", str(kept / "miga/feasible.csv"))
    assert main(["stage", "solutions", *words, "--out", str(tmp_path)]) == 0
    made, known = (pd.read_csv(folder / "solutions.csv") for folder in (tmp_path, kept / "validation"))
    pd.testing.assert_frame_equal(made, known)

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import shared
from refusals import input_error
from stage_runs import compared

from repose.bench.parameters import PARAMETERS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.runs import name_error_column
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.provenance import engine_hash
from repose.config import dependencies
from repose.config.pipeline import PipelineConfig
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import MeasureSettings
from repose.stages import validate
from repose.stages.parameter_sets import read_sample
from repose.stages.published import list_sets_to_simulate, read_sets, read_stored

SPACE = ParameterSpace(PARAMETERS, np.zeros(6), np.ones(6))
TARGETS = Targets.of(shared.TARGETS)
MEASURE = MeasureSettings.with_defaults(
    **shared.every_bench_test()["measure"] | {"response": "secant"}
)
# such a hash must stay a text
NOW = {
    "engine": "0123456789012345",
    "scene": "12e4567890123456",
}
PUBLISHED = (
    "solution,e_gg,mus_gg,mur_gg,e_gp,mus_gp,mur_gp,"
    "aor_predicted_deg,height_predicted_mm,aor_simulated_deg,height_simulated_mm\n"
    "22,0.217,0.611,0.038,0.233,0.509,0.183,32.5001,67.0000,32.00,65.63\n"
    "representative,0.203,0.642,0.037,0.244,0.483,0.185,32.5,67.00,,\n"
)
WIDE = ParameterSpace(PARAMETERS, np.zeros(6), np.full(6, 2.0))


@pytest.fixture
def study(tmp_path):
    feasible = pd.DataFrame(
        np.random.RandomState(1).uniform(0.3, 0.7, (12, 6)), columns=list(PARAMETERS)
    )
    feasible.insert(0, "solution", np.arange(1, 13))
    feasible["aor_predicted_deg"] = 32.5
    feasible["height_predicted_mm"] = 66.0
    feasible["objective"] = np.arange(12) / 100
    feasible["feasible"] = True
    feasible["representative"] = feasible["solution"] == 1
    feasible.to_csv(tmp_path / "feasible.csv", index=False)
    (tmp_path / "published4.csv").write_text(PUBLISHED)
    return tmp_path


def write_heaps(folder, solutions, failed=(), names=PARAMETERS):
    def run_of(seed, aor, failed):
        numbers = {"aor_deg": aor, "height_mm": aor + 34.0}
        numbers |= {name: aor - 4 * k for k, name in enumerate(MEAN_KEYS.values())}
        if failed:
            numbers = dict.fromkeys(numbers) | {"status": "jammed", "reason": "stuck"}
        return shared.good_run(seed, discharge_s=16.0, **numbers)

    def runs_of(row):
        return [
            run_of(seed, aor, row["sample"] in failed)
            for seed, aor in enumerate((30.0, 32.0, 34.0))
        ]

    return shared.write_jobs(solutions, folder, runs_of, names)


def settings_for(targets=TARGETS, names=PARAMETERS, measure=MEASURE):
    return shared.study_of(targets, SimpleNamespace(names=names), measure=measure)


def select(folder, count=5):
    return validate.write_solutions(
        folder / "feasible.csv", SPACE, TARGETS, count, folder / "v/solutions.csv"
    )


def stored(folder, failed=()):
    sets = validate.write_published_solutions(
        folder / "published4.csv", PARAMETERS, folder / "theirs.csv"
    )
    paths = write_heaps(folder, sets, failed)
    made = folder / "published_sets.csv"
    validate.write_published_sets(
        folder / "published4.csv",
        paths,
        made,
        parameter_names=PARAMETERS,
        targets=TARGETS,
        simulated_by=NOW,
    )
    return made


def published(path, targets=TARGETS, names=PARAMETERS, measure=MEASURE, now=NOW):
    return validate.compare_with_published(
        path,
        parameter_names=names,
        targets=targets,
        measure=measure,
        simulated_by=now,
    )


def tables(folder, failed=(), support=None):
    paths = write_heaps(folder, select(folder), failed)
    theirs = published(stored(folder, failed))
    return compared(
        folder / "v/solutions.csv", paths, settings_for(), theirs, folder / "v", support
    )


def test_solutions_and_published_sets_have_their_numbers(study):
    select(study)
    written = pd.read_csv(study / "v/solutions.csv")
    assert written.columns[:7].tolist() == ["sample", *PARAMETERS]
    assert written["sample"].tolist() == [1, 2, 3, 4, 5, 6]
    assert written["role"].tolist() == ["representative"] + ["spread"] * 5
    assert written["solution"].is_unique
    theirs = validate.write_published_solutions(
        study / "published4.csv", PARAMETERS, study / "theirs.csv"
    )
    assert theirs["sample"].tolist() == [101, 102]
    assert theirs.loc[1, "mus_gg"] == 0.642
    input_error(
        r"feasible.csv: solutions is 12; expected at least 21", select, study, count=20
    )


def test_sets_of_other_works_follow_by_number(study):
    row = "yu,someone,silicone rubber,.158,.454,.037,.195,.377,.063,31.27\n"
    (study / "others.csv").write_text(
        f"solution,source,wall,{','.join(PARAMETERS)},aor_measured_deg\n{row}"
    )
    assert list_sets_to_simulate(study / "published4.csv", TARGETS.responses) == [
        "22",
        "representative",
        "yu",
    ]
    table = read_stored(stored(study))
    assert table["sample"].tolist() == [101, 102, 103]
    names = ["source", "wall", "mus_gp", "aor_published_measured_deg"]
    assert table.loc[2, names].tolist() == ["someone", "silicone rubber", 0.377, 31.27]
    assert table.loc[:1, "wall"].isna().all()
    assert table.loc[0, "height_published_simulated_mm"] == 65.63
    found = published(study / "published_sets.csv").iloc[2]
    assert found["aor_simulated_deg"] == pytest.approx(28.0)
    assert np.isnan(found["aor_difference_deg"])


def test_table4_has_errors_as_published_and_every_definition_of_the_angle(study):
    found = tables(study)
    table = found["table4"]
    assert len(table) == 6
    row = table.iloc[0]
    assert row["aor_simulated_deg"] == pytest.approx(32.0)
    assert row["aor_se_deg"] == pytest.approx(2 / np.sqrt(3))
    # 1.56, as theirs for 32.50 and 32.00
    assert row["aor_error_percent"] == pytest.approx(100 * 0.5 / 32.0)
    assert row["height_error_percent"] == pytest.approx(0.0)
    assert row["n_seeds"] == 3
    pd.testing.assert_frame_equal(
        pd.read_csv(study / "v/table4.csv")[["sample"]], table[["sample"]]
    )
    theirs = found["published"].set_index("solution")
    assert theirs.loc["22", "aor_published_simulated_deg"] == 32.0
    assert theirs.loc["22", "height_difference_mm"] == pytest.approx(66.0 - 65.63)
    assert np.isnan(theirs.loc["representative", "aor_published_simulated_deg"])
    # the stored table has the angle by each definition, and this study calibrates the secant, the second
    assert theirs.loc["representative", "aor_simulated_deg"] == pytest.approx(28.0)
    for table in (found["table4"], found["published"]):
        for k, name in enumerate(MEAN_KEYS.values()):
            assert table[name].tolist() == pytest.approx([32.0 - 4 * k] * len(table))
            expected = [2 / np.sqrt(3)] * len(table)
            assert table[name_error_column(name)].tolist() == pytest.approx(expected)
        assert (table["line"] == "secant, foot to crest").all()
    lines = found["representative"].set_index("response")["line"]
    assert lines.to_dict() == {"aor_deg": "secant, foot to crest", "height_mm": ""}
    assert np.isnan(
        tables(study, failed=(3,))["table4"].set_index("sample").loc[3, "aor_flank_deg"]
    )


def test_the_answer_is_compared_with_the_measured_piles(study):
    found = tables(study)
    table = found["representative"].set_index("response")
    assert table.loc["aor_deg", "error_percent"] == pytest.approx(100 * 0.87 / 32.87)
    assert table.loc["height_mm", "physical_sd"] == 4.10
    assert table["within_one_sd"].all()
    assert (table["within_1_percent"] <= table["within_2_percent"]).all()
    assert 0 < table["within_2_percent"].iloc[0] < 1
    columns = (
        f"{a}_{b}_{c}"
        for a, c in (("aor", "deg"), ("height", "mm"))
        for b in ("predicted", "simulated", "se")
    )
    distant = dict.fromkeys(columns, 40.0) | {"n_seeds": 3, "status": "ok"}
    assert not validate.compare_with_measurement(distant, TARGETS)[
        "within_one_sd"
    ].any()


def test_definitions_that_are_targets_keep_their_column_and_stored_sets_may_be_stale(
    study,
):
    flank = Targets.of([shared.TARGETS[0] | {"response": "aor_flank_deg"}])
    sets = select(study).assign(aor_flank_predicted_deg=32.0)
    jobs = validate.read_jobs(write_heaps(study, sets), sets, flank)
    table = validate.compare_solutions(sets, jobs, flank, MEASURE)["table4"]
    assert (
        table["aor_flank_simulated_deg"].tolist()
        == table["aor_flank_deg"].tolist()
        == [32.0] * 6
    )
    assert table["line"].iloc[0].startswith("flank, ")
    path = stored(study)
    assert not published(path)["stale"].any()
    for name in NOW:
        assert published(path, now=NOW | {name: "another"})["stale"].all()
    assert read_stored(path)["engine"].tolist() == [NOW["engine"]] * 2


def test_the_stored_sets_of_the_repository_are_of_todays_engine_and_scene():
    """The table is made by `snakemake --cores 2 published_sets`; see resources/README.md."""
    path = "resources/published/simulated.csv"
    config = PipelineConfig.load("config/config.yaml").config
    assert config["validation"]["published_simulated"] == path
    table = read_stored(path)
    sets = read_sets(config["validation"]["published"])
    assert table["solution"].tolist() == sets["solution"].tolist()
    np.testing.assert_allclose(table[list(PARAMETERS)], sets[list(PARAMETERS)])
    assert set(table["engine"]) == {engine_hash()}
    assert set(table["scene"]) == {dependencies.hash_scene(config)}


def test_a_failed_or_missing_simulation_keeps_its_row_or_is_named(study):
    result = tables(study, failed=(1, 3, 101))
    table = result["table4"].set_index("sample")
    assert table.loc[3, "status"] == "jammed"
    assert np.isnan(table.loc[3, "aor_simulated_deg"])
    assert np.isnan(table.loc[3, "aor_error_percent"])
    assert not result["representative"]["within_one_sd"].any()
    theirs = result["published"].set_index("sample")
    assert theirs.loc[101, "status"] == "jammed"
    assert np.isnan(theirs.loc[101, "aor_difference_deg"])
    support = Support(
        np.random.RandomState(2).uniform(0.3, 0.7, (200, 6)),
        np.zeros(6),
        np.ones(6),
        PARAMETERS,
    )
    plain = tables(study)
    result = tables(study, support=support)
    for name in ("table4", "published"):
        assert result[name].columns.tolist() == [*plain[name].columns, "warning"]
    assert (result["table4"]["warning"] == "").sum() >= 3
    assert result["published"]["warning"].str.contains("nearest sample").all()
    paths = write_heaps(study, select(study))
    with pytest.raises(InputError, match=r"samples without a file is \[6\]"):
        compared(
            study / "v/solutions.csv",
            paths[:-1],
            settings_for(),
            published(None),
            study / "v",
        )


def cloud(feasible):
    x = np.linspace(0, 2, len(feasible))
    table = pd.DataFrame({name: np.ones(len(x)) for name in PARAMETERS})
    table["e_gg"] = x
    table["feasible"] = feasible
    table["objective"] = abs(x - 0.4)
    table["solution"] = np.arange(1, len(x) + 1)
    table["representative"] = np.arange(len(x)) == 2
    return table


def test_validation_takes_the_farthest_feasible():
    picked = validate.select_for_validation(cloud([True] * 11), 3, WIDE)
    # positions 0.4; then 2.0 (1.6 away), then 1.2 (0.8 from both), then 0.0 (0.4) before 0.8 and 1.6 (0.4)
    assert picked["e_gg"].tolist() == pytest.approx([0.4, 2.0, 1.2, 0.0])
    assert picked["role"].tolist() == ["representative", "spread", "spread", "spread"]
    # the solution of least objective stands beside a representative that is another, and that is outside the ranges
    other = cloud([True] * 11).assign(objective=np.arange(11.0))
    picked = validate.select_for_validation(other, 3, WIDE)
    assert picked["e_gg"].tolist() == pytest.approx([0.4, 0.0, 2.0, 1.2])
    assert picked["role"].tolist() == [
        "representative",
        "least objective",
        "spread",
        "spread",
    ]
    other.loc[2, "feasible"] = False
    assert (
        validate.select_for_validation(other, 5, WIDE)["role"].iloc[0]
        == "representative"
    )


def test_sets_outside_are_taken_where_too_few_are_feasible():
    table = cloud([True] * 6 + [False] * 5)
    assert validate.select_for_validation(table, 5, WIDE)["feasible"].all()
    assert not validate.select_for_validation(table, 6, WIDE)["feasible"].all()


def test_the_stored_sets_are_those_of_the_article():
    table = read_sets(shared.ROOT / "resources/published/table4.csv").set_index(
        "solution"
    )
    assert table.index.tolist() == [
        "22",
        "15",
        "56",
        "84",
        "2",
        "representative",
        "yu_2022",
    ]
    yu = table.loc["yu_2022"]
    assert yu[list(PARAMETERS)].tolist() == [0.158, 0.454, 0.037, 0.195, 0.377, 0.063]
    assert yu["wall"] == "silicone rubber"
    assert yu["aor_measured_deg"] == 31.27
    assert table["source"].notna().all()


def test_a_study_of_height_alone_and_one_without_a_stored_table(study):
    height_alone = Targets([target for target in TARGETS if target.name == "height_mm"])
    table = validate.write_solutions(
        study / "feasible.csv", SPACE, height_alone, 3, study / "v/solutions.csv"
    )
    paths = write_heaps(study, table)
    theirs = published(stored(study), height_alone)
    assert "aor_simulated_deg" not in theirs
    assert theirs["height_simulated_mm"].tolist() == [66.0, 66.0]
    for table in (theirs, published(None, height_alone)):
        found = compared(
            study / "v/solutions.csv",
            paths,
            settings_for(height_alone),
            table,
            study / "v",
        )
        assert found["representative"]["response"].tolist() == ["height_mm"]
        assert len(pd.read_csv(study / "v/published.csv")) == len(table)
    assert {"sample", "solution", "stale"} < set(pd.read_csv(study / "v/published.csv"))


def test_a_law_of_further_parameters_keeps_them_and_leaves_the_published_sets_out(
    study,
):
    names = (*PARAMETERS, "gamma_gg", "gamma_gp")
    space = ParameterSpace(names, np.zeros(8), np.ones(8), names=names)
    table = pd.read_csv(study / "feasible.csv").assign(gamma_gg=0.05, gamma_gp=0.02)
    table.to_csv(study / "feasible.csv", index=False)
    chosen = validate.write_solutions(
        study / "feasible.csv", space, TARGETS, 5, study / "v/solutions.csv"
    )
    assert read_sample(study / "v/solutions.csv", 1)["gamma_gg"] == 0.05
    responses = TARGETS.responses
    assert (
        len(list_sets_to_simulate(study / "published4.csv", responses, PARAMETERS)) == 2
    )
    assert list_sets_to_simulate(study / "published4.csv", responses, names) == []
    with pytest.raises(InputError, match="column gamma_gg"):
        validate.write_published_solutions(
            study / "published4.csv", names, study / "v/published.csv"
        )
    theirs = published(stored(study), names=names)
    assert theirs.empty
    paths = write_heaps(study, chosen, names=names)
    found = compared(
        study / "v/solutions.csv", paths, settings_for(), theirs, study / "v"
    )
    assert found["table4"]["gamma_gp"].tolist() == [0.02] * 6


def test_the_stage_lists_the_sets_of_a_kept_study(command, tmp_path):
    kept = shared.ROOT / "results/published/goji_berry"
    arguments = (
        "--config",
        kept / "config.json",
        "--feasible",
        kept / "miga/feasible.csv",
    )
    command("stage", "solutions", *arguments, "--out", tmp_path)
    made = pd.read_csv(tmp_path / "solutions.csv")
    known = pd.read_csv(kept / "validation" / "solutions.csv")
    pd.testing.assert_frame_equal(made, known)


def test_table_4_has_the_expected_optimism_of_each_role(study):
    paths = write_heaps(study, select(study))
    optimism = pd.DataFrame(
        [
            ("representative", "aor_deg", 0.4, 0.1, 20),
            ("representative", "height_mm", -0.2, 0.05, 20),
            ("spread", "aor_deg", 0.3, 0.1, 20),
            ("spread", "height_mm", -0.1, 0.05, 20),
        ],
        columns=["role", "response", "optimism", "optimism_se", "replicates"],
    )
    found = validate.write_comparison(
        study / "v/solutions.csv",
        paths,
        study / "v",
        targets=TARGETS,
        measure=MEASURE,
        published=published(stored(study)),
        optimism=optimism,
    )
    table4 = found["table4"]
    assert table4["aor_optimism_deg"].tolist() == [0.4] + 5 * [0.3]
    assert table4["height_optimism_se_mm"].tolist() == 6 * [0.05]
    assert found["representative"]["optimism"].tolist() == [0.4, -0.2]
    columns = list(table4)
    after = columns[columns.index("aor_predicted_deg") + 1 :]
    assert after[:3] == ["aor_optimism_deg", "aor_optimism_se_deg", "aor_simulated_deg"]

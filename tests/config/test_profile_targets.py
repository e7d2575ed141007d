"""Profiles among the targets: a file of heights becomes a target for each score, or is refused with its fault."""

import json

import numpy as np
import pytest
from refusals import input_error
from shared import written

import repose
from repose.calibrate.answer import Check
from repose.calibrate.strategies.sequential.goal import Goal
from repose.config import dependencies
from repose.config.pipeline import PipelineConfig
from repose.stages.card_study import describe_response

TABLE = """# read off a picture
x_mm,low_mm,z_mm,sd_mm
-30,,24.5,1
-20,17,16,1
-10,9,8.5,1
0,2,0.5,1
10,-7,-8,1
20,-16,,1
"""


@pytest.fixture
def table(tmp_path):
    return written(tmp_path / "surface.csv", TABLE)


@pytest.fixture
def entry(table):
    return {
        "response": "turning_profile_mm",
        "file": str(table),
        "sd": 1.2,
        "repetitions": 4,
        "functions": 3,
        "within": 0.9,
        "covered": 0.2,
    }


def study_of(quick, entry):
    targets = [*quick.config["targets"], entry]
    return PipelineConfig.of(quick.config | {"targets": targets})


def scores_of(study):
    return [target for target in study.targets if target.profile is not None]


def test_a_configuration_with_a_profile_is_read_from_json_as_it_was(quick, entry):
    config = study_of(quick, entry).config
    assert repr(json.loads(json.dumps(config))) == repr(config)


def test_a_profile_becomes_a_target_for_each_score(quick, entry):
    scores = scores_of(study_of(quick, entry))
    assert [score.name for score in scores] == [
        "turning_profile_1_mm",
        "turning_profile_2_mm",
        "turning_profile_3_mm",
    ]
    profile = scores[0].profile
    assert profile.x == (-30, -20, -10, 0, 10), "the last height is empty"
    values = [score.value for score in scores]
    np.testing.assert_allclose(values, profile.scores(profile.z))
    assert {score.whole for score in scores} == {profile.whole}


def test_errors_and_ranges_of_the_scores_add_up_to_those_of_the_heights(quick, entry):
    scores = scores_of(study_of(quick, entry))
    assert [score.weight for score in scores] == pytest.approx([1 / 3] * 3)
    assert sum(score.sd**2 for score in scores) == pytest.approx(1.2**2)
    widths = [score.high - score.low for score in scores]
    assert np.sqrt(np.square(widths).sum()) == pytest.approx(2 * 0.9)


def test_the_card_has_the_abscissae_of_the_scores_alone(quick, entry):
    study = study_of(quick, entry)
    for target in study.targets:
        described = describe_response(study, target.response, {})
        settings = described["definition"]["settings"]
        if target.profile is None:
            assert "profile" not in settings
        else:
            assert settings["profile"]["x"] == [-30, -20, -10, 0, 10]


def test_heights_and_errors_may_stand_in_other_columns(quick, entry):
    study = study_of(quick, entry | {"sd": "sd_mm", "z": "low_mm"})
    last = study.targets[-1]
    assert last.profile.x == (-20, -10, 0, 10, 20)
    # Each height has an error of 1 mm, which three scores share.
    assert last.sd == pytest.approx(1 / np.sqrt(3))


def test_different_errors_of_heights_are_averaged_as_squares(quick, entry, table):
    table.write_text(TABLE.replace("24.5,1", "24.5,3").replace("16,1", "16,2"))
    last = study_of(quick, entry | {"sd": "sd_mm"}).targets[-1]
    # Of errors of 3, 2, 1, 1 and 1 mm, the mean square is 16 / 5, which three scores share.
    assert last.sd == pytest.approx(np.sqrt(16 / 5 / 3))


def test_a_profile_has_more_heights_than_scores(quick, entry):
    del entry["functions"]
    input_error("rows is 5; expected more than functions, 5", study_of, quick, entry)


def test_a_score_without_its_profile_is_refused(quick):
    number = {
        "response": "turning_profile_1_mm",
        "apparatus": "turning",
        "value": 1.0,
        "sd": 1.0,
        "repetitions": 1,
        "range": [0.0, 2.0],
    }
    message = "turning_profile_mm with the file of its measured heights"
    input_error(message, study_of, quick, number)


def test_scores_are_defined_by_abscissae_and_share(quick, entry, table):
    before = study_of(quick, entry)
    table.write_text(TABLE.replace("16", "15"))
    heights = study_of(quick, entry)
    share = study_of(quick, entry | {"covered": 0.5})
    for settings_of in (
        lambda s: s.definitions,
        lambda s: dependencies.select_stage_settings(
            s.config, "measure_runs", "turning"
        ),
    ):
        assert settings_of(before) == settings_of(heights)
        assert settings_of(before) != settings_of(share)
    assert before.targets[-1].value != heights.targets[-1].value


def test_percents_of_a_profile_are_of_its_height(quick, entry):
    target = study_of(quick, entry).targets[-1]
    assert abs(target.value) < 0.1 * target.whole
    assert target.off_percent(target.value + 0.02 * target.whole) == pytest.approx(2.0)
    near = target.value + 0.02 * target.whole
    check = Check.from_target(
        target, simulated=near, standard_error=None, runs=4, status="ok"
    )
    assert check.difference_text.startswith("turning_profile_3_mm +2.0 %")
    goal = Goal.from_targets(study_of(quick, entry).targets, 2.0, quick.parameters)
    np.testing.assert_allclose(goal.half[-3:], 0.02 * target.whole)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"z": "height_mm"},
            r"surface.csv: column height_mm is 'missing'.*found: x_mm",
        ),
        ({"sd": "error_mm"}, r"surface.csv: column error_mm is 'missing'"),
        (
            {"file": "nowhere.csv"},
            r"targets.2.file is .nowhere.csv.; expected an existing CSV file",
        ),
        ({"functions": 5}, r"surface.csv: rows is 5; expected more than functions, 5"),
        (
            {"functions": 12},
            r"targets\.2\.functions is 12; expected an integer from 2 to 9",
        ),
        (
            {"response": "turning_deg"},
            r"targets\.2\.response is 'turning_deg'; expected the profile of a bench test",
        ),
        ({"apparatus": "drum"}, r"targets\.2\.apparatus is 'drum'; expected turning"),
        ({"hight": 3}, r"is 3; .*known"),
        (
            {"response": "turning_2_profile_mm"},
            r"response is 'turning_2_profile_1_mm'.*one of 1 speeds",
        ),
    ],
)
def test_a_wrong_entry_is_refused(quick, entry, change, message):
    input_error(message, study_of, quick, entry | change)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "0.5,1",
            "nan,1",
            r"surface.csv, row 4: z_mm is 'nan'; expected a finite number",
        ),
        (
            "8.5",
            "",
            r"surface.csv, row 3: z_mm is ''; expected a finite number; empty heights only at the ends",
        ),
        (
            "-10,9",
            "-25,9",
            r"surface.csv, row 3: x_mm is -25.0; expected above the previous row's -20",
        ),
        (
            "-30,",
            "-300,",
            r"targets\.2\.profile\.x.*inside the drum, between -95 and 95",
        ),
    ],
)
def test_a_wrong_table_is_refused(quick, entry, table, old, new, message):
    table.write_text(TABLE.replace(old, new))
    input_error(message, study_of, quick, entry)


@pytest.mark.slow
def test_a_study_with_a_simulator_of_the_users_own_calibrates_a_profile(
    table, tmp_path
):
    target = {
        "file": str(table),
        "sd": 0.2,
        "repetitions": 1,
        "functions": 3,
        "unit": "mm",
        "noise_sd": 0.1,
    }
    options = {
        "seed": 3,
        "file": tmp_path / "runs.csv",
        "posterior": {"walkers": 32, "steps": 200},
    }
    section = {
        "start_samples": 8,
        "seeds": 1,
        "batch": 2,
        "most_runs": 16,
        "tolerance_percent": 3.0,
    }
    parameters = {"slope": (-1.2, -0.4), "height": (-4.0, 4.0)}
    study = repose.Study(
        parameters, {"surface_mm": target}, sequential=section, **options
    )
    profile = study.targets.profiles["surface_mm"]
    random = np.random.default_rng(4)
    while not study.done:
        runs = study.ask()
        rows = []
        for run in runs.itertuples():
            line = run.slope * np.array(profile.x) + run.height
            rows.append(profile.columns(line + 0.1 * random.normal(size=5)))
        columns = {name: [row[name] for row in rows] for name in profile.names}
        study.tell(runs.assign(**columns))
    slope, height = np.polyfit(profile.x, profile.z, 1)
    answer = study.answer()
    expected = {
        "slope": pytest.approx(slope, abs=0.03),
        "height": pytest.approx(height, abs=0.3),
    }
    assert answer.parameters == expected
    low, high = (
        answer.posterior.parameters[["credible_low", "credible_high"]].to_numpy().T
    )
    assert (low < [slope, height]).all()
    assert (high > [slope, height]).all()
    table.unlink()  # the settings beside the runs hold the heights
    assert len(repose.Study.resume(tmp_path / "runs.csv").runs) == len(study.runs)

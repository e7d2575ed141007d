"""What every strategy must fulfil, in the loop of a study with the user's own simulator of one line."""

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from shared import entries, says
from synthetic import TARGETS, responses
from threadpoolctl import threadpool_info, threadpool_limits

import repose
from repose.calibrate import strategies

FEW_FACTORS = {"strategy": "response_surface", "response_surface": {"most_factors": 2}}
STUDY = {
    "parameters": {
        "friction": (0.2, 0.8),
        "rolling": (0.01, 0.2),
        "sliding": (0.0, 1.0),
    },
    "targets": {"angle_deg": (30.0, 1.2), "time": (4.0, 0.2, 10)},
    "seed": 1,
    "sequential": {"start_samples": 12, "batch": 4, "most_runs": 40},
    "posterior": {"walkers": 32, "steps": 100},
    "design": {"samples": 24},
    "miga": {
        "islands": 2,
        "population": 20,
        "rounds": 10,
        "generations": 5,
        "solutions": 10,
        "replicates": 2,
    },
    "refine": {"pours": 6, "design_seeds": 2, "seeds": 4},
    "response_surface": {"seeds": 2, "steps": 3, "checks": 2, "surface": "rotatable"},
}


def simulate(samples, noise=0.005):
    friction = samples["friction"]
    rolling = samples["rolling"]
    exact = np.column_stack(
        [
            18 + 18 * friction + 40 * rolling - 6 * friction**2,
            3 + 2 * friction - 2 * rolling,
        ]
    )
    drawn = [
        np.random.default_rng(run).normal(size=2)
        for run in samples[["sample", "run"]].to_numpy()
    ]
    found = pd.DataFrame(
        exact * (1 + noise * np.array(drawn)), columns=["angle_deg", "time"]
    )
    return found.assign(sample=samples["sample"], run=samples["run"])


def walk(study):
    asked = []
    while not study.done:
        asked.append(study.ask())
        study.tell(simulate(asked[-1]))
    return asked


@pytest.fixture(scope="module", params=strategies.names())
def walked(request, tmp_path_factory):
    file = tmp_path_factory.mktemp(request.param) / "study.csv"
    study = repose.Study(**STUDY, strategy=request.param, file=file)
    return study, walk(study), file


@pytest.mark.usefixtures("short_search")
def test_strategies_are_known_and_an_answer_takes_one_thread(tmp_path, monkeypatch):
    assert {"published", "refined", "response_surface", "sequential"} <= set(
        strategies.names()
    )
    input_error(
        "strategy is 'brute'; expected one of published, ", strategies.strategy, "brute"
    )
    seen = set()

    def calibrate(*_):
        seen.update(
            pool["num_threads"]
            for pool in threadpool_info()
            if pool["user_api"] == "blas"
        )

    monkeypatch.setattr("repose.calibrate.calibration.calibrate", calibrate)
    study = repose.Study(**STUDY, file=tmp_path / "study.csv")
    study.tell(simulate(study.ask()))
    with threadpool_limits(limits=2, user_api="blas"):
        study.answer()
    assert seen == {1}


@pytest.mark.slow
def test_the_answer_is_right(walked):
    study, _, _ = walked
    found = study.answer()
    answer = pd.DataFrame([found.parameters | {"sample": 1, "run": 1}])
    relative_error = (
        simulate(answer, noise=0.0)[["angle_deg", "time"]].iloc[0] / [30.0, 4.0] - 1
    )
    assert abs(relative_error).max() < 0.03
    assert (
        0
        <= found.probability["within_1_percent"]
        <= found.probability["within_2_percent"]
        <= 1
    )
    assert found.why
    assert list(found.prediction.index) == ["angle_deg", "time"]
    says(found._repr_html_(), "friction", "within 1 percent")


@pytest.mark.slow
def test_a_killed_study_goes_on_with_the_same_bytes(walked, tmp_path):
    study, asked, file = walked
    other = tmp_path / "study.csv"
    repose.Study(**STUDY, strategy=study.config["strategy"], file=other)
    for table in asked:
        # each time as after a kill: before the question, and before the answer to it
        again = repose.Study.resume(other)
        assert again.ask().equals(table)
        pd.testing.assert_frame_equal(repose.Study.resume(other).ask(), again.ask())
        again.tell(simulate(table).sample(frac=1, random_state=1))
    assert repose.Study.resume(other).done
    assert other.read_bytes() == file.read_bytes()


def test_returned_runs_must_be_those_of_ask(tmp_path):
    study = repose.Study(**STUDY, file=tmp_path / "study.csv")
    returned = simulate(study.ask())
    another = (
        r"sample and run is \['99', '1'\]; expected one of the 24 runs that `ask` gave"
    )
    input_error(another, study.tell, returned.assign(sample=99))
    input_error("column time is 'missing'", study.tell, returned.drop(columns="time"))
    input_error(
        "friction is 0.5; expected .*, as `ask` gave it",
        study.tell,
        returned.assign(friction=0.5),
    )
    assert study.runs.empty
    assert not (tmp_path / "study.csv").exists()
    study.tell(returned.assign(time=returned["time"].mask(returned["sample"] == 3)))
    assert (study.runs["status"] != "ok").sum() == 2
    input_error(
        "seed is 1; expected 2, the value of this study",
        repose.Study,
        **STUDY | {"seed": 2},
        file=tmp_path / "study.csv",
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"file": "study.json"},
            "file is 'study.json'; expected a path that ends in .csv",
        ),
        ({"strategie": "published"}, "did you mean strategy"),
        (
            {"strategy": "brute"},
            "published or refined or response_surface or sequential",
        ),
        (
            {"design": {"samples": 3}},
            "design.samples is 3; expected an integer from 12",
        ),
        (
            {"surrogate": "crystal"},
            "surrogate is 'crystal'; expected .*gaussian_process",
        ),
        ({"targets": {"time": 4.0}}, r"targets.time is 4.0; expected \(mean"),
        (FEW_FACTORS, "most_factors is 2; expected at least 3"),
    ],
)
def test_bad_settings_are_refused_by_name(changes, message):
    input_error(message, repose.Study, **STUDY | changes)


def test_a_surface_of_too_few_parameters_names_those_that_fit():
    for names, message in (
        (["friction"], "expected another strategy for 1 free parameter; box_behnken"),
        (
            ["friction", "rolling"],
            "expected rotatable or face_centred for 2 free parameters; box_behnken",
        ),
    ):
        parameters = {name: STUDY["parameters"][name] for name in names}
        targets = {"time": (4.0, 0.2)}
        input_error(
            message, repose.Study, parameters, targets, strategy="response_surface"
        )


@pytest.mark.slow
def test_a_study_of_our_bench_tests_is_the_same_loop():
    changes = {
        "strategy": "sequential",
        "sequential": {"start_samples": 16, "most_pours": 48, "seeds": 2},
        "posterior": {"walkers": 32, "steps": 100},
        "targets": entries(TARGETS),
    }
    config = repose.PipelineConfig.load("config/quick.yaml", overrides=changes)
    k = 0
    study = config.study()
    while not study.done:
        asked = study.ask()
        k = k + 1
        study.tell(
            asked.assign(
                **dict(zip(TARGETS.names, responses(asked, 0.5, k).T, strict=True))
            )
        )
    found = study.answer()
    assert len(study.runs) <= 48
    assert (
        abs(responses(pd.DataFrame([found.parameters]))[0] / TARGETS.aim - 1).max()
        < 0.03
    )


@pytest.mark.essential
@pytest.mark.slow
def test_the_loop_as_a_user_writes_it():
    random = np.random.default_rng(1)

    def simulate(samples):
        angle = (
            20
            + 12 * samples["mus_gg"]
            + 60 * samples["mur_gg"]
            + 0.3 * random.normal(size=len(samples))
        )
        angle[random.random(len(samples)) < 0.1] = np.nan  # runs that failed
        return pd.DataFrame({"sample": samples["sample"], "aor_deg": angle})

    ranges = {"mus_gg": (0.35, 0.75), "mur_gg": (0.02, 0.2)}
    targets = {"aor_deg": (32.87, 2.20)}
    study = repose.Study(
        parameters=ranges, targets=targets, strategy="sequential", seed=1
    )
    while not study.done:
        samples = study.ask()  # DataFrame: sample, parameters
        # DataFrame: sample, responses; NaN is a run that failed
        study.tell(simulate(samples))
    answer = study.answer()
    assert 20 + 12 * answer.parameters["mus_gg"] + 60 * answer.parameters[
        "mur_gg"
    ] == pytest.approx(32.87, abs=0.5)
    assert "mus_gg" in answer._repr_html_()

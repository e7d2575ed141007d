"""A bench test of one's own, as the example shows it: registered, configured, poured and measured."""

import importlib.util
import json
import pprint

import numpy as np
import pytest
import yaml
from goji import AXES_MM, BERRY, PARTICLE, named, own_example
from known import has_known_lines, is_known
from refusals import input_error, not_refused, value_error
from shared import BUILT_IN, ROOT

from repose.bench import Scene, bench, bench_tests, names, register
from repose.bench.settings import SceneSettings
from repose.calibrate import responses
from repose.calibrate.seeds import draw_run_seeds
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.stages.job import measure_job, run_job

EXAMPLES = ROOT / "examples/bench_tests"
SET = named((0.2, 0.6, 0.05, 0.2, 0.6, 0.2))
SECTION = {
    "berries": 5,
    "rate_per_s": 20.0,
    "seeds": 2,
    "height_mm": 50.0,
    "duration_s": 0.6,
}
TARGET = {
    "response": "spread_mm",
    "apparatus": "spread",
    "value": 30.0,
    "sd": 2.0,
    "repetitions": 5,
    "range": [25, 35],
}


def loaded(name, path):
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def spread():
    """The bench test of the guide; it may be in the package already."""
    if "spread" in names():
        yield bench("spread")
        return
    loaded("bench_test", ROOT / "examples/bench_test.py")
    yield bench("spread")
    registry = importlib.import_module("repose.bench.bench_test")
    del registry._REGISTRY["spread"], responses._REGISTRY["spread_mm"]


@pytest.fixture
def config(spread):
    quick = PipelineConfig.load("config/quick.yaml").config
    return quick | {"spread": dict(SECTION), "targets": [*quick["targets"], TARGET]}


def test_a_bench_test_is_found_by_name_with_its_responses(spread):
    assert bench("spread") is spread
    assert names()[-1] == "spread"
    assert responses.response("spread_mm").apparatus == "spread"
    assert responses.list_responses("spread") == spread.responses
    input_error(f"one of {', '.join(names())}", bench, "shaker")
    value_error("already registered", register("spread"), type(spread))
    for test in bench_tests():
        assert test.statuses[0] == "ok"
        assert test.settings.model_fields["seeds"].is_required()


def test_seeds_of_bench_tests_purposes_and_samples_differ(spread):
    seeds = []
    for name in names():
        for sample in range(1, 151):
            seeds += draw_run_seeds(1, "design", sample, 8, name)
        for sample in (*range(1, 7), *range(101, 107)):
            seeds += draw_run_seeds(1, "validation", sample, 8, name)
    seeds += draw_run_seeds(2, "design", 1, 8, "funnel")
    assert len(set(seeds)) == len(seeds)
    # the first bench test is the one that is meant without a name
    assert draw_run_seeds(1, "design", 1, 2) == seeds[:2]
    assert draw_run_seeds(1, "design", 1, 2, names()[0]) == seeds[:2]
    # the stream of the drum alone says so by its purpose
    assert draw_run_seeds(1, "drum", 1, 2, "drum") == draw_run_seeds(1, "drum", 1, 2)


def test_its_section_is_part_of_the_configuration(config):
    PipelineConfig.of(config)
    assert Targets.of(config["targets"]).apparatus == ("funnel", "spread")
    wrong = {
        "berries": (0, "an integer from 1 to 20000"),
        "duration_s": (0.1, "the time of the fall"),
        "hight_mm": (3.0, "did you mean height_mm"),
    }
    for key, (value, allowed) in wrong.items():
        input_error(
            rf"spread\.{key}.*{allowed}",
            PipelineConfig.of,
            config | {"spread": SECTION | {key: value}},
        )
    del config["spread"]
    input_error(
        r"targets\.2\.apparatus is 'spread'; .*in a section with the name of the bench test",
        PipelineConfig.of,
        config,
    )


IMPOSSIBLE = yaml.safe_load((ROOT / "tests/bench/impossible.yaml").read_text())


def configured(name, **keys):
    """The example of a bench test with some keys of its section changed."""
    config = own_example(name)
    config[name] = config[name] | keys
    return config


def test_every_bench_test_has_an_example_that_is_a_study():
    for test in bench_tests():
        study = PipelineConfig.of(configured(test.name))
        study.check_inputs()
        assert test.name in study.targets.apparatus
        assert not list(test.misfits(SceneSettings(study.config), AXES_MM))


def test_the_scenes_of_the_built_in_bench_tests_are_known():
    scenes = {}
    for test in map(bench, BUILT_IN):
        scene = Scene.of(configured(test.name), SET, BERRY, PARTICLE, 1)
        scenes[test.name] = test.world(scene, PARTICLE.bounding_radius_m) | {
            "ends_s": test.duration_s(scene.settings)
        }
    is_known("scenes.txt", pprint.pformat(scenes, width=120, compact=True))


def test_the_responses_of_the_built_in_bench_tests_are_known():
    has_known_lines(
        "responses.txt",
        [
            f"{response.apparatus}: {response.name} in {response.unit} from "
            f"{response.low:g} to {response.high:g}, by {', '.join(response.definition)}"
            for test in map(bench, BUILT_IN)
            for response in test.responses
        ],
    )


def test_a_bench_test_that_cannot_run_is_refused():
    cases = [
        ((name, {key: value}), rf"{name}\.{key}.*{text}")
        for name, key, value, text in IMPOSSIBLE
    ]
    assert not not_refused(
        lambda case: PipelineConfig.of(configured(case[0], **case[1])),
        cases,
        InputError,
    )


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("cylinder", {"diameter_mm": 20.0}),
        ("discharge", {"outlet_diameter_mm": 9.0, "inlet_diameter_mm": 20.0}),
        ("turning", {"length_mm": 20.0, "factory_height_mm": 90.0}),
        ("drawdown", {"slot_mm": 9.0, "depth_mm": 20.0}),
        ("lifted_cylinder", {"diameter_mm": 20.0}),
    ],
)
def test_a_berry_has_to_fit(name, keys):
    too_small = [
        key
        for key, _ in bench(name).misfits(
            SceneSettings(configured(name, **keys)), AXES_MM
        )
    ]
    assert too_small == [f"{name}.{key}" for key in keys]


def test_its_job_pours_and_measures(spread, config, tmp_path):
    pours = run_job(
        spread,
        Scene.of(config, SET, BERRY, PARTICLE),
        "007",
        [3, 4],
        tmp_path,
        interval_s=0.1,
    )
    saved = json.loads(pours.read_text())
    assert saved["sample"] == 7
    assert saved["apparatus"] == "spread"
    assert len(saved["pours"]) == 2
    with np.load(tmp_path / "007_trajectory_3.npz") as frames:
        assert frames["position"].shape == (6, 5, 3)
    result = measure_job(Scene.of(config, {}, BERRY, PARTICLE), pours)
    assert json.loads((tmp_path / "007.json").read_text()) == result
    spread = [run["spread_mm"] for run in result["runs"]]
    with np.load(tmp_path / "007.npz") as arrays:
        x, y, _ = arrays["position_4"].T
    assert spread[1] == pytest.approx(1e3 * np.hypot(x, y).mean(), rel=1e-5)
    assert result["summary"]["spread_mm"] == pytest.approx(np.mean(spread))
    expected = abs(spread[0] - spread[1]) / 2
    assert result["summary"]["spread_se_mm"] == pytest.approx(expected)


def test_a_job_of_another_bench_test_or_status_is_refused(spread, config, tmp_path):
    path = tmp_path / "001.pours.json"
    wrong = [
        ("shaker", "ok", "apparatus is 'shaker'"),
        ("spread", "jammed", "status is 'jammed'; expected ok, unstable"),
    ]
    for name, status, message in wrong:
        path.write_text(
            json.dumps({"apparatus": name, "pours": [{"seed": 1, "status": status}]})
        )
        input_error(message, measure_job, Scene.of(config, {}, BERRY, PARTICLE), path)


@pytest.mark.parametrize("bench_test", ["funnel", "drum"])
def test_responses_name_keys_that_define_them_and_limits_that_fit(config, bench_test):
    for response in bench(bench_test).responses:
        for key in response.definition:
            section, name = key.split(".")
            assert name in config[section]
        assert response.low < response.high


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in EXAMPLES.glob("*.yaml")))
def test_the_example_of_a_bench_test_is_measured_drawn_and_filmed(
    name, tmp_path, monkeypatch
):
    monkeypatch.syspath_prepend(EXAMPLES)
    assert (
        loaded("run", EXAMPLES / "run.py").main(name, tmp_path, pictures=2, width=100)[
            "status"
        ]
        == "ok"
    )
    assert {path.name for path in tmp_path.glob(f"{name}.*")} >= {
        f"{name}.png",
        f"{name}.gif",
    }

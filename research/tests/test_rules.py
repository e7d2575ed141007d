"""The rules of the studies, beside those of the method: what would run. Nothing is simulated here."""

import re
import shutil
from types import SimpleNamespace

import jinja2
import pytest
from plans import ROOT, as_ours, planned, snakemake

from repose.common.ledger import LEDGER
from repose.config.pipeline import PipelineConfig
from research import settings

pytestmark = pytest.mark.slow

RULES = ("-s", "research/Snakefile", "--configfile", "config/quick.yaml")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the workflow and the studies without any results."""
    folder = tmp_path_factory.mktemp("project")
    for part in ("config", "profiles", "resources", "workflow", "research"):
        shutil.copytree(ROOT / part, folder / part)
    return folder


def test_the_pool_grows_without_pouring_again(project):
    settings_file = project / "research.yaml"
    settings_file.write_text("pool: {fresh_samples: 5}")
    jobs = planned(project, "pool", *RULES)
    assert jobs["pool_pour"] == 29
    assert jobs["measure_pool_runs"] == 29
    assert jobs["pool_dataset"] == 1
    assert jobs["fresh_dataset"] == 1
    assert "pour" not in jobs

    listed = snakemake(project, "pool", "-n", "--summary", *RULES)
    for line in listed.stdout.splitlines()[1:]:
        path = project / line.split("\t")[0]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (project / "results/quick" / LEDGER).touch()  # the folder of a study
    as_ours(project / "results/quick/pool")
    snakemake(project, "pool", "--touch", "--cores", "1", *RULES, status=0)
    settings_file.write_text("pool: {fresh_samples: 8}")
    assert planned(project, "pool", *RULES)["pool_pour"] == 3
    (project / "results/quick/pool/dataset.csv").write_text("someone's")
    done = snakemake(project, "pool", "-n", *RULES, status=2)
    assert "results/quick/pool/dataset.csv: content is 'something else'" in done.stderr
    shutil.rmtree(project / "results")
    shutil.rmtree(project / ".snakemake")


def test_a_bad_setting_ends_in_one_message_before_any_work(project):
    (project / "research.yaml").write_text("pool: {sead: 5}")
    done = snakemake(project, "pool", "-n", *RULES)
    (project / "research.yaml").unlink()
    assert done.returncode == 2
    assert (
        "repose: error: research.yaml: pool.sead is 5; expected a known key; did you mean seed?"
        in done.stderr
    )


@pytest.mark.parametrize(
    ("target", "expected", "others"),
    [
        (
            "compare",
            ("compare_accuracy", "draw_accuracy", "compare_sampling", "dataset"),
            ("network", "miga"),
        ),
        ("shape_study", ("shape_cell", "shape_selection"), ("pour",)),
        (
            "measurement_study",
            ("pour", "published_solutions", "measurement_study"),
            ("miga",),
        ),
        (
            "second_responses",
            ("measure_responses", "second_responses_tables", "draw_second_responses"),
            ("miga",),
        ),
        (
            "seeds_per_sample",
            ("design", "warm_up", "seeds_per_sample"),
            ("pour", "miga"),
        ),
        pytest.param(
            "compare_all",
            ("search_tables", "whole_tables", "comparison_table", "network"),
            ("miga",),
            marks=pytest.mark.essential,  # the rules of most studies
        ),
    ],
)
def test_each_study_plans_its_own_rules(project, target, expected, others):
    jobs = planned(project, target, *RULES)
    assert set(expected) <= set(jobs)
    assert not set(others) & set(jobs)


def test_joint_targets_run_every_further_bench_test_on_a_part_of_the_design(project):
    settings_file = project / "research.yaml"
    settings_file.write_text("joint_targets: {samples: 12}")
    for target in ("joint_targets", "second_responses_benches"):
        jobs = planned(project, target, *RULES)
        assert jobs["joint_pour"] == jobs["measure_joint_runs"] == 4 * 12
        assert jobs[target] == 1
    settings_file.unlink()


def test_the_shape_study_is_checked_when_it_is_asked_for(project):
    changes = ("--config", "funnel={inlet_diameter_mm: 60, factory_diameter_mm: 50}")
    done = snakemake(project, "shape_study", "-n", *RULES, *changes, status=2)
    assert (
        "shape_study.fillings.open_cone: funnel.factory_diameter_mm is 150.0"
        in done.stderr
    )


def test_every_caption_is_used_and_can_be_filled_in():
    rules = "".join(
        path.read_text() for path in (ROOT / "research/rules").glob("*.smk")
    )
    config = PipelineConfig.load(ROOT / "config/config.yaml").config
    config |= settings.read_settings(config)
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)
    captions = sorted((ROOT / "research/report").glob("*.rst"))
    assert captions
    for path in captions:
        assert re.search(rf"\b{path.stem}\b", rules), path.name
        text = environment.from_string(path.read_text()).render(
            snakemake=SimpleNamespace(config=config)
        )
        assert text.strip(), path.name
        assert "{" not in text, path.name

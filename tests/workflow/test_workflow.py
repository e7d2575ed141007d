"""The workflow's graph: what would run, and what a changed or bad key does. Nothing is simulated here."""

import json
import re

import pytest
from plans import MIXED, declared, planned, snakemake
from shared import target

from repose.stages.published import STORED_COLUMNS

pytestmark = pytest.mark.slow

STAGES = {
    # the article's method
    "berry",
    "shape",
    "design",
    "pour",
    "measure_runs",
    "dataset",
    "network",
    "miga",
    "solutions",
    "validation_pour",
    "measure_validation_runs",
    "validate",
    # the drum
    "drum_run",
    "drum",
    # its report
    "measure",
    "posterior_tables",
    "page",
    "draw_drum",
    *(f"draw_figure{number:02d}" for number in (2, 5, 6, 7, 8, 10, 13, 14, 15)),
}
FORMATS = ("png", "svg", "pdf")
POURS = ("pour", "validation_pour", "trajectory", "drum_run")
QUICK = ("--configfile", "config/quick.yaml")


@pytest.mark.essential
def test_the_recommended_study_has_every_stage_and_one_job_a_sample(project):
    jobs = planned(project)
    assert set(jobs) >= STAGES
    assert jobs["pour"] == 150
    assert jobs["validation_pour"] == 6
    assert jobs["drum_run"] == 6
    assert not (project / "results").exists(), "a dry run writes nothing"


def test_the_workflow_runs_from_either_file_and_the_small_run_has_the_same_rules(
    project,
):
    small = planned(project, *QUICK)
    itself = planned(project, *QUICK, "-s", "workflow/Snakefile")
    itself["everything"] = itself.pop("all")
    assert small == itself
    # The piles of the small run have no stored table of published sets.
    assert set(small) == set(planned(project)) - {"draw_published"}
    assert small["everything"] == 1
    assert small["pour"] == 14
    assert small["drum_run"] == 2


@pytest.mark.parametrize(
    ("targets", "folders"),
    [
        (MIXED, ("heaps", "drum_runs")),
        (MIXED[1:], ("drum_runs",)),
    ],
)
def test_samples_run_in_every_bench_test_of_the_targets(project, targets, folders):
    mine = {"targets": targets, "posterior": {"shape_study": None}}
    (project / "mine.yaml").write_text(json.dumps(mine))
    arguments = (*QUICK, "mine.yaml", "--", "dataset")
    jobs = planned(project, *arguments)
    assert jobs["pour"] == 14 * len(folders)
    assert jobs["measure_runs"] == len(folders)
    shown = snakemake(project, "-n", "-p", *arguments).stdout
    for folder in folders:
        assert f"results/quick/{folder}/014.json" in shown
        assert shown.count(f"measure_runs results/quick/{folder} --samples ") == 1
    assert "--apparatus drum" in shown


def test_the_drum_alone_draws_no_funnel(project):
    drum = {
        "targets": [target("drum_slip_deg", 44.0, 2.0, 40.0, 48.0, 5)],
        "surrogate": "gaussian_process",
        "posterior": {"shape_study": None},
    }
    (project / "drum.json").write_text(json.dumps(drum))
    # Other tests leave results in the study's own folder.
    nowhere = (
        "--config",
        "results_dir=results/nowhere",
        "validation={published_simulated: null}",
    )
    both = planned(project, *QUICK, *nowhere)
    alone = planned(project, *QUICK, "drum.json", *nowhere)
    of_the_funnel = {
        "draw_figure05",
        "draw_figure06",
        "draw_figure08",
        "draw_definitions",
        "draw_outline",
        "measure",
        "trajectory",
    }
    of_two_targets = {"draw_plane"}
    of_a_network_with_nodes = {"draw_figure10"}
    assert set(alone) < set(both)
    expected = of_the_funnel | of_two_targets | of_a_network_with_nodes
    assert set(both) - set(alone) == expected


CALL = "command line (--config)"
STABLE = "expected at most 0.00062, the largest stable time step of a grain between two others, at a restitution of 0.1"
STABLE += "; the modulus from resources/compression.csv is 1.1e+05 Pa"


@pytest.mark.essential
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--config", "funnel={seeds: 0}"],
            f"{CALL}: funnel.seeds is 0; expected an integer from 1 to 100",
        ),
        (
            ["--config", "simulation={time_step_s: 2e-3}"],
            f"{CALL}: simulation.time_step_s is 0.002; {STABLE}",
        ),
        (
            ["--configfile", "mine.yaml"],
            "mine.yaml: funnel.seads is 3; expected a known key; did you mean seeds?",
        ),
    ],
)
def test_a_bad_value_ends_in_one_message_before_any_work(project, arguments, message):
    (project / "mine.yaml").write_text("funnel: {seads: 3}\n")
    done = snakemake(project, "--cores", "1", *arguments)
    assert done.returncode != 0
    assert done.stdout == ""
    assert [line for line in done.stderr.splitlines() if "profile" not in line] == [
        f"repose: error: {message}"
    ]
    assert not (project / "results").exists()


@pytest.mark.essential
@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (
            b"label: pea # gr\xfcn\n",
            "file is 'not text'; expected a YAML or JSON file in ",
        ),
        (b"label: pea\n\tseed: 1\n", "expected spaces in place of the tab"),
        (b"", "content is 'empty'; expected keys with values"),
        (b"- label\n", "content is ['label']; expected keys with values"),
    ],
)
def test_the_folders_own_configuration_is_named_with_its_fault(
    project, tmp_path, content, fault
):
    (tmp_path / "config.yaml").write_bytes(content)
    snakefile = str(project / "workflow/Snakefile")
    done = snakemake(tmp_path, "--snakefile", snakefile, "-n", status=2)
    (message,) = [line for line in done.stderr.splitlines() if "profile" not in line]
    assert message.startswith("repose: error: config.yaml")
    assert fault in message


def test_a_changed_key_reruns_what_depends_on_it_and_nothing_before(project):
    made = ("results/quick/design/samples.csv", "results/quick/berry/particle.json")
    snakemake(
        project, "--cores", "1", *made, "--configfile", "config/quick.yaml", status=0
    )
    assert (
        json.loads((project / "results/quick/config.json").read_text())["design"][
            "samples"
        ]
        == 14
    )
    arguments = ("results/quick/heaps/001.json", "--configfile", "config/quick.yaml")
    assert set(planned(project, *arguments)) == {
        "warm_up",
        "pour",
        "measure_runs",
        "total",
    }
    fewer = planned(project, *arguments, "--config", "design={samples: 25}")
    assert set(fewer) == {"design", "warm_up", "pour", "measure_runs", "total"}
    heavier = planned(project, *arguments, "--config", "berry={density_kg_m3: 900}")
    assert set(heavier) == {
        "berry",
        "shape",
        "warm_up",
        "pour",
        "measure_runs",
        "total",
    }


@pytest.mark.essential
def test_the_figures_have_the_configured_formats_and_are_drawn_again_for_others(
    project,
):
    snakemake(project, "--cores", "1", "results/figures/figure02.png", status=0)
    assert [
        path.suffix for path in (project / "results/figures").glob("figure02*")
    ] == [".png"]
    assert "draw_figure02" not in planned(project, "figures")
    for change in ("dpi: 90", "format: [png, svg]"):
        assert (
            planned(project, "figures", "--config", f"figures={{{change}}}")[
                "draw_figure02"
            ]
            == 1
        )
    arguments = (
        "figures",
        "posterior",
        "response_surface",
        "--config",
        "figures={format: [png, svg, pdf]}",
    )
    listed = snakemake(project, "-n", "--summary", *arguments).stdout
    files = {
        suffix: set(re.findall(rf"^(\S+)\.{suffix}\t.*draw_", listed, re.M))
        for suffix in FORMATS
    }
    assert len(files["png"]) > 24, "every figure"
    assert files["png"] == files["svg"] == files["pdf"]


@pytest.mark.parametrize(
    ("change", "measured", "poured"),
    [
        ("measure={response: whole}", ("measure_runs", "measure_validation_runs"), ()),
        (
            "measure={mm_per_pixel: 0.3}",
            ("measure_runs", "measure_validation_runs", "drum"),
            (),
        ),
        (
            "funnel={rest_motion_mm: 2}",
            ("measure_runs", "measure_validation_runs"),
            POURS[:3],
        ),
        ("drum={fit_share: 0.5, depth_bin_mm: 4}", ("drum",), ()),
        ("drum={record_s: 0.2}", (), ("drum_run",)),
        ("network={hidden: 4}", (), ()),
        (
            "validation={seeds: 3, representative_seeds: 3}",
            ("measure_validation_runs",),
            ("validation_pour",),
        ),
    ],
)
def test_a_changed_measurement_measures_again_and_pours_nothing(
    finished, change, measured, poured
):
    project, arguments = finished
    before = planned(project, *arguments, change, "--", "dataset")
    # what the study would pour again because its solution has moved is left out here
    alone = (*POURS[1:], "measure_validation_runs", "validate", "drum", "film")
    targets = ("validate", "results/quick/drum/runs.csv", "film")
    jobs = before | planned(
        project, *arguments, change, "--allowed-rules", *alone, "--", *targets
    )
    made = {"dataset", "validate", "film", "total"} | (
        {"drum"} if "drum_run" in poured else set()
    )
    assert set(jobs) - made == {*measured, *poured}
    for rule, count in (
        ("pour", 12),
        ("measure_runs", 1),
        ("measure_validation_runs", 1),
    ):
        assert jobs.get(rule, count) == count


def test_an_engine_compiled_again_is_no_reason_to_pour_again_and_uncertainty_is_a_target_of_its_own(
    finished,
):
    project, arguments = finished
    for targets in (("calibration",), ("drum", "film")):
        assert (
            planned(project, *arguments, "--forcerun", "warm_up", "--", *targets)[
                "total"
            ]
            == 1
        )
    # the posterior's tables belong to every study
    results = (
        "noise_tables",
        "sensitivity_tables",
    )
    drawn = (
        "draw_noise",
        "draw_corner",
        "draw_discrepancy",
        "draw_sobol",
    )
    drawn = (*drawn, "draw_main_effects", "draw_region")  # intervals: the report's
    # of the finished study only empty files are there, so nothing before the tables has to run
    expected = {
        *results,
        *drawn,
        "uncertainty",
        "total",
    }
    assert set(planned(project, *arguments, "--", "uncertainty")) == expected
    assert not {*results, *drawn} & set(planned(project, *arguments, "--forceall"))


@pytest.mark.essential
def test_the_published_sets_are_poured_on_request_and_shown_from_a_stored_table(
    project,
):
    none = ("validation={published_simulated: null}",)
    arguments = (
        "--configfile",
        "config/quick.yaml",
        "--config",
        "results_dir=results/other",
    )
    jobs = planned(project, *arguments, *none, "--", "published_sets")
    made = {
        "validation_pour": 7,
        "measure_published_runs": 1,
        "published_solutions": 1,
        "published_sets": 1,
    }
    assert made.items() <= jobs.items()
    assert "pour" not in jobs
    jobs = planned(project, *arguments, *none)
    assert jobs["validation_pour"] == 3
    assert not {"published_solutions", "published_sets", "draw_published"} & set(jobs)
    columns = [
        *(getattr(entry, "name", entry) for entry in STORED_COLUMNS),
        "aor_flank_deg",
        "height_mm",
    ]
    rows = [",".join(columns), ",".join(["101", *["0.3"] * (len(columns) - 1)])]
    (project / "stored.csv").write_text("\n".join(rows) + "\n")
    stored = (
        "validation={published_simulated: stored.csv}",
        "measure={response: flank}",
    )
    shown = planned(project, *arguments, *stored)
    assert set(shown) - set(jobs) == {"draw_published"}
    assert shown["validation_pour"] == 3


def test_every_job_declares_memory_and_time_and_more_of_both_when_it_is_tried_again(
    tmp_path,
):
    rules = declared(tmp_path)
    assert len(rules) > 60
    for rule in rules:
        for first, second in (rule.memory_mb, rule.minutes):
            assert second == 2 * first > 0, rule.rule


def test_a_figure_is_drawn_again_where_a_file_changed_that_no_rule_of_it_makes(
    finished,
):
    project, arguments = finished
    plane = "results/quick/figures/plane.png"
    assert planned(project, *arguments, "--", plane) == {}
    pool = project / "results/quick/pool/dataset.csv"
    pool.parent.mkdir(exist_ok=True)
    pool.write_text("sample\n1\n")
    assert planned(project, *arguments, "--", plane) == {"draw_plane": 1, "total": 1}
    pool.unlink()

"""The simulated campaign, on campaigns whose time is known; what counts as a cluster job's work."""

import re
from pathlib import Path

import campaign
import overhead
import pytest

SNAKEFILE = Path(__file__).parents[2] / "workflow" / "Snakefile"


def test_one_core_takes_all_jobs_one_after_another_and_enough_cores_take_the_longest_job():
    assert campaign.makespan_s(
        [10.0] * 4, cores=1, start_s=5.0, submitted_per_s=1e9
    ) == pytest.approx(60.0)
    assert campaign.makespan_s(
        [10.0, 30.0, 20.0], cores=3, start_s=5.0, submitted_per_s=1e9
    ) == pytest.approx(35.0)


def test_submitting_takes_its_time_and_local_rules_and_other_jobs_are_no_cluster_jobs(
    tmp_path,
):
    assert campaign.makespan_s(
        [1.0] * 100, cores=100, start_s=0.0, submitted_per_s=2.0
    ) == pytest.approx(50.5)
    for name, seconds in (("001", 12.5), ("001_measured", 2.5)):
        (tmp_path / f"{name}.tsv").write_text(
            f"s\tmax_rss\tcpu_time\n99.0\t100\t{seconds}\n"
        )
    assert campaign.measured_s(tmp_path) == [15.0]
    listed = re.findall(
        r"^ *localrules:\n((?: +\w+,\n)+)", SNAKEFILE.read_text(), re.MULTILINE
    )
    assert len(listed) == 3
    # The card's rule is written once for several strategies, and says so itself.
    report = (SNAKEFILE.parent / "rules" / "report.smk").read_text()
    assert re.search(r"card\{of_strategy\}.*localrule: True", report, re.DOTALL)
    assert {*re.findall(r"\w+", "".join(listed)), "card"} == overhead.LOCAL
    for name in ("heaps/001", "berry"):
        path = tmp_path / "results" / "benchmarks" / f"{name}.tsv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("s\tmax_rss\n4.0\t1\n")
    assert overhead.benchmarks_s(tmp_path) == [4.0]
    lines = [
        "COMPLETED 2026-01-01T00:00:00 2026-01-01T00:00:09",
        "FAILED 2026-01-01T00:00:00 2026-01-01T00:00:05",
    ]
    assert overhead.slurm_s(lines) == [9.0]

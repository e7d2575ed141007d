"""Why runs fail: every status has its words, and the pages list all."""

import re

from shared import ROOT

from repose.bench import bench, names
from repose.common.statuses import (
    FAILURE_CLAUSES,
    describe_failures,
    describe_status,
    replace_statuses,
)
from repose.stages.settings import RUN_STATUSES

OWN = set(RUN_STATUSES) - {"ok"}


def statuses_in_table(page):
    """The first cells of a page's tables that hold one word of code."""
    return set(re.findall(r"^\| `(\w+)` \| ", (ROOT / page).read_text(), re.MULTILINE))


def test_every_status_has_words_and_no_other_has():
    ours = {status for name in names() for status in bench(name).statuses}
    missing = {
        status for name in names() for status in bench(name).missing_status.values()
    }
    assert missing <= ours
    assert set(FAILURE_CLAUSES) == (ours | OWN) - {"ok"}


def test_the_page_of_the_files_lists_them():
    text = (ROOT / "docs/files.md").read_text()
    section = text.partition("## Why a run failed\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*) \|$", section, re.MULTILINE)
    assert rows == list(FAILURE_CLAUSES.items())
    assert "The last six" in section
    assert set(list(FAILURE_CLAUSES)[-6:]) == OWN


def test_the_page_on_simulators_lists_those_of_a_program():
    assert statuses_in_table("docs/simulators.md") >= OWN


def test_failures_are_explained_the_most_frequent_first():
    text = describe_failures({"jammed": 1, "not_at_rest": 2}, "failed")
    assert text == (
        "2 failed because the grains still moved when they should have been at rest, "
        "1 failed because grains got stuck on their way out"
    )
    assert describe_failures({}, "failed") == ""


def test_a_status_of_a_user_is_quoted():
    assert describe_status("diverged") == "their status is 'diverged'"


def test_the_reason_of_a_sample_is_written_in_words():
    reason = "1 of 6 runs not_at_rest (a grain moved 4 mm); 2 of 6 runs jammed"
    assert replace_statuses(reason) == (
        "1 of 6 runs failed because the grains still moved when they should have been "
        "at rest (a grain moved 4 mm); 2 of 6 runs failed because grains got stuck on "
        "their way out"
    )
    assert replace_statuses("2 runs lost, 1 runs no_slip").count("failed because") == 2
    assert replace_statuses("3 runs were made") == "3 runs were made"

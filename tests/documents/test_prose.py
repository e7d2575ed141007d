"""What stands in tables only: commits and models of processors."""

import re

import pytest
from shared import ROOT

FOLDERS = ("docs", "research/docs", "config", "crops")
PAGES = sorted(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md"))
# Seven or more hexadecimal digits with a letter and a digit; no part of a path, and not
# the beginning of a longer hash.
COMMIT = re.compile(
    r"(?<![\w/.])(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,12}(?![\w/]|\.\.\.)"
)
PROCESSOR = re.compile(r"\bEPYC\b|\bXeon\b|\bZen \d|\bfamily \d+")


def prose_of(text):
    """The lines of a page outside tables and code."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    lines = text.splitlines()
    return [line for line in lines if not line.startswith(("|", "    ", "<!--"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commits_and_processors_stand_in_tables(page):
    named = [
        line
        for line in prose_of(page.read_text())
        if COMMIT.search(line) or PROCESSOR.search(line)
    ]
    assert not named


def test_pages_refer_to_the_contradiction_about_the_particle_of_the_article():
    """One answer, by a link to the note of the page on the article."""
    keys = (ROOT / "config/README.md").read_text()
    (row,) = [line for line in keys.splitlines() if line.startswith("| `particle` |")]
    assert "3.1 contradicts itself" in row
    assert "docs/article.md#notes" in row
    paper = (ROOT / "config/paper.yaml").read_text()
    assert "particle: ellipsoid # 3.1 contradicts itself: docs/article.md" in paper
    article = (ROOT / "docs/article.md").read_text()
    assert "| particle | 3.1 contradicts itself" in article
    assert "**E. Particle.** Two statements" in article

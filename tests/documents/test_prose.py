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
    assert "particle: ellipsoid # 3.1 contradicts itself: note E of" in paper
    article = (ROOT / "docs/article.md").read_text()
    assert "| particle | 3.1 contradicts itself" in article
    assert "**E. Particle.** Two statements" in article


def test_the_glossary_is_sorted_short_and_has_the_words_of_report_and_terminal():
    text = (ROOT / "docs/glossary.md").read_text()
    rows = [line.split("|")[1:3] for line in text.splitlines() if line.startswith("| ")]
    words = [re.sub(r"^[^a-z]+", "", word.strip(" `").lower()) for word, _ in rows[1:]]
    assert words == sorted(words)
    needed = "doubtful, expected optimism, kept run, left open, met, plausible, reach"
    needed += ", scatter, steepest, straightest, undecided, verdict"
    assert set(needed.split(", ")) <= set(words)
    assert not [word for word, meaning in rows if len(meaning.split()) > 20]


def test_the_index_has_one_table_and_each_page_of_docs():
    text = (ROOT / "docs/index.md").read_text()
    assert text.count("|---|") == 1
    assert text.count("```{toctree}") == 1
    tree = set(text.split("```{toctree}")[1].split())
    pages = (ROOT / "docs").rglob("*.md")
    names = {str(page.relative_to(ROOT / "docs").with_suffix("")) for page in pages}
    names = {name for name in names if not name.startswith("_build")}
    assert names - {"index"} <= tree


def test_the_drum_has_at_most_three_possible_explanations():
    """Not all simulations with a lower wall friction were made, and both pages say so."""
    for page, heading in (
        ("docs/results.md", "Three explanations are possible:"),
        ("research/docs/drum_slip.md", "Three explanations remain"),
    ):
        text = (ROOT / page).read_text()
        after = text.split(heading)[1]
        numbers = re.findall(r"^(\d)\. ", after, re.MULTILINE)
        assert numbers[:3] == ["1", "2", "3"], page
        assert "4" not in numbers, page
        assert re.search(r"not (been )?fully test|not fully tested", text), page
        assert "none of them is right" not in text, page

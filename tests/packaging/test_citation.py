"""What other places print about the program, in step: CITATION.cff, the archive's record, the paper, the changelog."""

import datetime
import json
import re
from pathlib import Path

import yaml

import repose

ROOT = Path(__file__).parents[2]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text())
ARCHIVE = json.loads((ROOT / ".zenodo.json").read_text())
FRONT, PAPER = (ROOT / "paper.md").read_text().removeprefix("---\n").split("\n---\n", 1)
AUTHORS = [author["name"] for author in CITATION["authors"]]


def test_version_and_date_are_those_of_the_newest_release():
    changelog = (ROOT / "CHANGELOG.md").read_text()
    version, date = re.search(r"^## \[(\d[\d.]*)\] - ([\d-]+)$", changelog, re.MULTILINE).groups()
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text())
    assert version == repose.__version__ == CITATION["version"] == ARCHIVE["version"] == recipe["context"]["version"]
    assert date == CITATION["date-released"] == ARCHIVE["publication_date"]
    written = datetime.datetime.strptime(yaml.safe_load(FRONT)["date"], "%d %B %Y").date()
    assert written.isoformat() == date


def test_the_archive_says_what_the_citation_says():
    same = {"title": "title", "abstract": "description", "keywords": "keywords", "license": "license"}
    assert {there: CITATION[here] for here, there in same.items()} == {there: ARCHIVE[there] for there in same.values()}
    assert [creator["name"] for creator in ARCHIVE["creators"]] == AUTHORS
    cited = [reference["doi"] for reference in CITATION["references"]]
    assert [related["identifier"] for related in ARCHIVE["related_identifiers"]] == cited
    assert ARCHIVE["upload_type"] == CITATION["type"]


def test_the_paper_has_the_form_of_its_journal():
    front = yaml.safe_load(FRONT)
    assert (front["title"], [author["name"] for author in front["authors"]]) == (CITATION["title"], AUTHORS)
    assert {*CITATION["keywords"]} <= {*front["tags"]}
    assert front["bibliography"] == "paper.bib"
    assert re.findall(r"^# (.+)$", PAPER, re.MULTILINE) == [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Quality control",
        "Research impact statement",
        "AI usage disclosure",
        "References",
    ]
    assert 750 <= len(PAPER.split()) <= 1750


def test_the_paper_cites_its_references_and_shows_pictures_that_are_there():
    references = (ROOT / "paper.bib").read_text()
    keys = re.findall(r"^@\w+\{(\w+),$", references, re.MULTILINE)
    assert sorted(keys) == sorted({*re.findall(r"@(\w+)", PAPER)})
    assert all((ROOT / path).is_file() for path in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", PAPER))


def test_a_reference_has_an_identifier_only_where_the_documents_have_it():
    known = CITATION["references"][0]["doi"]
    assert re.findall(r"doi = \{([^}]+)\}", (ROOT / "paper.bib").read_text()) == [known]

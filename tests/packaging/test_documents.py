"""Python in the documents runs as it stands there, section by section, in a fresh process and an empty folder."""

import re
from pathlib import Path

import pytest
from shared import ROOT, run_python

pytestmark = pytest.mark.slow

DOCUMENTS = (
    "README.md",
    "CONTRIBUTING.md",
    "docs/start.md",
    "docs/notebook.md",
    "docs/reference.md",
)


def sections(document, between="\n"):
    """The Python of each section of a document, by its heading."""
    parts = re.split(r"^#+ (.+)$", (ROOT / document).read_text(), flags=re.MULTILINE)
    found = {}
    for heading, text in zip(parts[1::2], parts[2::2], strict=True):
        blocks = re.findall(
            r"^```(?:python|{code-cell} ipython3)\n(.*?)^```$",
            text,
            re.MULTILINE | re.DOTALL,
        )
        if blocks:
            found[heading] = between.join(blocks)
    return found


EXAMPLES = {
    f"{document}: {heading}": code
    for document in DOCUMENTS
    for heading, code in sections(document).items()
}


@pytest.mark.parametrize(
    "what", ["contact law", "response", "figure", "surrogate", "strategy"]
)
def test_contributing_shows_how_to_add_one(what):
    assert f"CONTRIBUTING.md: Add a {what}" in EXAMPLES


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_runs(name, tmp_path):
    run_python("-c", EXAMPLES[name], cwd=tmp_path)


PLACES = {
    "contact law": "src/repose/dem/laws/hertz.py",
    "bench test": "src/repose/bench/spread.py",
    "figure": "src/repose/report/figures/response_histograms.py",
    "surrogate": "src/repose/calibrate/surrogates/cubic_surface.py",
    "strategy": "src/repose/calibrate/strategies/random_search.py",
}


def file_to_add(what):
    """The example of CONTRIBUTING: its first block, or the bench test that it links to."""
    if what == "bench test":
        return (ROOT / "examples" / "bench_test.py").read_text()
    return sections("CONTRIBUTING.md", "\0")[f"Add a {what}"].split("\0")[0]


@pytest.mark.parametrize("what", PLACES)
def test_the_file_to_add_passes_the_checks_of_style(what):
    file = file_to_add(what)
    for arguments in (["check"], ["format", "--check"]):
        run_python(
            "-m",
            "ruff",
            *arguments,
            "--stdin-filename",
            PLACES[what],
            "-",
            cwd=ROOT,
            input=file,
        )


def test_the_files_to_add_have_types(tmp_path):
    for what, place in PLACES.items():
        (tmp_path / Path(place).name).write_text(file_to_add(what))
    run_python(
        "-m",
        "mypy",
        "--config-file",
        "pyproject.toml",
        *tmp_path.glob("*.py"),
        cwd=ROOT,
    )

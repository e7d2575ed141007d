"""Python in the documents runs as it stands there, section by section, in a fresh process and an empty folder."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
DOCUMENTS = ("CONTRIBUTING.md", "docs/start.md", "docs/tutorials/simulate.md")


def sections(document):
    """The Python of each section of a document, by its heading."""
    parts = re.split(r"^#+ (.+)$", (ROOT / document).read_text(), flags=re.MULTILINE)
    found = {}
    for heading, text in zip(parts[1::2], parts[2::2], strict=True):
        blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
        if blocks:
            found[heading] = "\n".join(blocks)
    return found


EXAMPLES = {
    f"{document}: {heading}": code for document in DOCUMENTS for heading, code in sections(document).items()
}


@pytest.mark.parametrize("what", ["contact law", "response", "bench test", "surrogate"])
def test_contributing_shows_how_to_add_one(what):
    assert f"CONTRIBUTING.md: Add a {what}" in EXAMPLES


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_runs(name, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", EXAMPLES[name]], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr

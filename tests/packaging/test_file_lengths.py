"""No file of code is long: a file has one purpose."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FEWER_THAN = 400
FILES = sorted(
    path
    for folder in ("src", "workflow", "tests")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in (".py", ".smk") and ".snakemake" not in path.parts
)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_has_fewer_lines_than_allowed(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) < FEWER_THAN


def test_all_three_folders_are_looked_at():
    assert {path.relative_to(ROOT).parts[0] for path in FILES} == {"src", "workflow", "tests"}

"""Every mutant still has its line, and its tests."""

from pathlib import Path

import pytest
import yaml

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
GROUPS = yaml.safe_load((HERE / "mutants.yaml").read_text())


@pytest.mark.parametrize("group", GROUPS, ids=[group["file"] for group in GROUPS])
def test_every_line_to_be_mutated_stands_once_in_its_file(group):
    source = (ROOT / "src/repose" / group["file"]).read_text()
    table = (HERE / "table.md").read_text()
    for old, new, *_ in group["mutants"]:
        assert source.count(old) == 1, old
        assert f"| {group['file']} | `{old}` | `{new}` |" in table
    for test in group["tests"]:
        path, _, name = test.partition("::")
        assert f"def {name}" in (ROOT / path).read_text()

"""Which edits of the code plan which stages."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from repose.common import source_code
from repose.common.places import PACKAGE
from repose.common.source_code import IGNORED_MODULES, code_hash, find_dependencies

HASHES = """
import sys
from repose.common.source_code import code_hash
print(*[code_hash(name) for name in sys.argv[1:]])
"""


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A cache folder with summaries of the package, so that a test parses only what it edits."""
    cache = tmp_path_factory.mktemp("kept")
    hashes(PACKAGE, "stages", "report", "dem", cache=cache)
    return cache


@pytest.fixture
def package(tmp_path, kept):
    """A copy of the package that a test may edit."""
    folder = tmp_path / "repose"
    shutil.copytree(
        PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__", "data")
    )
    shutil.copytree(kept, tmp_path / "cache")
    return folder


def hashes(package, *modules, cache=None):
    """Hash modules of the copy in a process of its own."""
    environment = os.environ | {
        "PYTHONPATH": str(package.parent),
        "XDG_CACHE_HOME": str(cache or package.parent / "cache"),
    }
    done = subprocess.run(
        [sys.executable, "-c", HASHES, *modules],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


def edit(path):
    """Add a statement to a module."""
    path.write_text(path.read_text(encoding="utf-8") + "\nEDITED = 1\n")


@pytest.mark.parametrize(
    ("module", "changed"),
    [
        # targets enter the table of samples and the inversion
        ("calibrate/targets.py", {"stages.dataset", "calibrate.inversion"}),
        # the variance of runs enters the training
        ("calibrate/variance.py", {"calibrate.training"}),
        # a law is imported by its name
        ("dem/laws/jkr.py", {"dem"}),
    ],
)
def test_an_edit_changes_the_stages_that_use_the_module(package, module, changed):
    stages = (
        "stages.dataset",
        "calibrate.inversion",
        "calibrate.training",
        "calibrate.designs.exchange_search",
        "dem",
    )
    before = dict(zip(stages, hashes(package, *stages), strict=True))
    edit(package / module)
    after = dict(zip(stages, hashes(package, *stages), strict=True))
    differing = {name for name in stages if before[name] != after[name]}
    assert changed <= differing
    assert "calibrate.designs.exchange_search" not in differing


def test_comments_docstrings_format_messages_and_types_change_nothing(package):
    path = package / "probe.py"
    path.write_text(
        'def half(value):\n    """Halve."""\n    if value < 0:\n'
        '        raise ValueError("negative")\n    return value / 2\n'
    )
    (before,) = hashes(package, "probe")
    path.write_text(
        '"""A module."""\n\n\ndef half(value: float) -> float:\n'
        '    """Return half of a value."""\n    # not for negative ones\n'
        "    if value < 0:\n"
        '        raise ValueError(f"{value} is negative; expected 0 or more")\n'
        "    return (\n        value\n        / 2\n    )\n"
    )
    assert hashes(package, "probe") == [before]
    path.write_text(path.read_text().replace("/ 2", "/ 3"))
    assert hashes(package, "probe") != [before]


def test_the_meaning_of_a_key_changes_nothing_and_its_bounds_do(package):
    field = 'from pydantic import Field\nseeds = Field(ge=1, description="runs")\n'
    (package / "probe.py").write_text(field)
    (before,) = hashes(package, "probe")
    (package / "probe.py").write_text(field.replace("runs", "runs of a sample"))
    assert hashes(package, "probe") == [before]
    (package / "probe.py").write_text(field.replace("ge=1", "ge=2"))
    assert hashes(package, "probe") != [before]


def test_the_caption_of_a_figure_changes_nothing_and_its_inputs_do(package):
    path = package / "report/figures/catalogue.py"
    (before,) = hashes(package, "report.figures")
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("Figure 10. ", "Figure 10: "), encoding="utf-8")
    assert hashes(package, "report.figures") == [before]
    path.write_text(text.replace("dataset.csv", "other.csv"), encoding="utf-8")
    assert hashes(package, "report.figures") != [before]


def test_old_summaries_are_dropped(package):
    store = package.parent / "cache/repose/source_code.json"
    most = source_code.MAX_SUMMARIES
    store.write_text(json.dumps({f"old {number}": {} for number in range(most)}))
    (package / "probe.py").write_text("NUMBER = 1\n")
    hashes(package, "probe")
    kept = json.loads(store.read_text())
    assert len(kept) == most
    assert "old 0" not in kept
    assert f"old {most - 1}" in kept


def test_a_data_file_counts_where_a_module_of_its_folder_names_it(package):
    (package / "probe.py").write_text('NAME = "probe.csv"\n')
    (before,) = hashes(package, "probe")
    (package / "other.csv").write_text("1\n")
    assert hashes(package, "probe") == [before]
    (package / "probe.csv").write_text("1\n")
    (with_data,) = hashes(package, "probe")
    assert with_data != before
    (package / "probe.csv").write_text("2\n")
    assert hashes(package, "probe") != [with_data]


def test_what_is_kept_between_calls_gives_the_same_hash(package):
    store = package.parent / "cache/repose/source_code.json"
    store.unlink()
    first = hashes(package, "calibrate.designs.exchange_search")
    assert store.is_file()
    assert hashes(package, "calibrate.designs.exchange_search") == first
    store.write_text("{")
    assert hashes(package, "calibrate.designs.exchange_search") == first


def test_an_import_for_type_checkers_alone_counts_nothing(package):
    (package / "probe.py").write_text(
        "from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n"
        "    from repose.calibrate import targets\n"
    )
    (before,) = hashes(package, "probe")
    edit(package / "calibrate/targets.py")
    assert hashes(package, "probe") == [before]


def test_modules_that_compute_no_number_exist_and_are_no_dependency(kept, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(kept))
    for name in IGNORED_MODULES:
        assert source_code._list_modules_of(name), name
    for module in find_dependencies("stages", "report"):
        assert not source_code.is_ignored(module)


def test_a_module_that_is_missing_is_named():
    with pytest.raises(ModuleNotFoundError, match=r"repose\.stages\.nothing"):
        code_hash("stages.nothing")

"""The guide of CONTRIBUTING.md, step by step: a bench test of two files passes the tests."""

import os
import re
import shutil
import subprocess

import pytest
from shared import ROOT, run_python

pytestmark = [pytest.mark.slow, pytest.mark.essential]
TESTS = ("tests/bench", "tests/config", "tests/bad_input", "tests/packaging")


def copy_of_the_tree(folder):
    """Copy the files of the checkout, those that are not yet committed included."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    # A test asks git for the files of the checkout.
    for words in (["init", "-q"], ["add", "-A"]):
        subprocess.run(["git", *words], cwd=folder, check=True)


def test_a_bench_test_of_two_files_passes_the_tests(tmp_path):
    copy_of_the_tree(tmp_path)
    guide = (ROOT / "CONTRIBUTING.md").read_text()
    source, module = re.search(r"^    cp (\S+) (\S+)$", guide, re.MULTILINE).groups()
    line = re.search(r"^    (from repose\.bench import .*)$", guide, re.MULTILINE)[1]
    shutil.copy(tmp_path / source, tmp_path / module)
    package = tmp_path / "src/repose/bench/__init__.py"
    others = re.findall(
        r"^from repose\.bench import \w+  # noqa.*\n", package.read_text(), re.MULTILINE
    )
    text = package.read_text().replace(others[-1], f"{others[-1]}{line}\n")
    package.write_text(text)
    of_the_copy = {
        "cwd": tmp_path,
        "env": os.environ | {"PYTHONPATH": str(tmp_path / "src")},
    }
    shown = run_python(
        "-c", "import repose.bench as b; print(b.names())", **of_the_copy
    )
    assert "'drop'" in shown
    run_python("-m", "pytest", "-n", "0", "-q", *TESTS, **of_the_copy)

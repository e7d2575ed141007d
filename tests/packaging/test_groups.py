"""Which tests share a worker of pytest-xdist: those that call the same kernels, so that these are compiled once."""

import re
import shutil
from pathlib import Path

import pytest
from shared import run_python

pytestmark = pytest.mark.slow

TESTS = Path(__file__).parents[1]
FILES = (
    "bench/test_a",
    "cli/test_c",
    "dem/test_b",
    "common/test_e",
    "common/test_f",
    "measure/test_g",
    "measure/test_h",
)


def test_tests_of_the_same_kernels_run_on_one_worker(tmp_path):
    for name in FILES:
        path = tmp_path / "tests" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            "import time\n\n"
            + "".join(f"def test_{k}(): time.sleep(0.05)\n" for k in range(6))
        )
    shutil.copy(TESTS / "conftest.py", tmp_path / "tests")
    arguments = [
        "-v",
        "-n",
        "2",
        "--dist",
        "loadscope",
        "-p",
        "no:cacheprovider",
        "--rootdir",
        ".",
    ]
    printed = run_python("-m", "pytest", *arguments, cwd=tmp_path)
    workers = {}
    for worker, name in re.findall(
        r"^\[(gw\d)\].* tests/(\S+)\.py::", printed, re.MULTILINE
    ):
        workers.setdefault(name, set()).add(worker)
    assert set(workers) == set(FILES)
    assert all(len(found) == 1 for found in workers.values())
    assert workers["bench/test_a"] == workers["cli/test_c"] == workers["dem/test_b"]
    assert (
        workers["dem/test_b"] != workers["measure/test_g"] == workers["measure/test_h"]
    )

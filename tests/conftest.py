import importlib
import os
import sys
from pathlib import Path

import pytest

# As in `repose.__main__`, and before numpy is loaded: threads that wait for each other on small matrices cost minutes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))
importlib.import_module("repose.apparatus")  # makes the responses known by name

# Tests that run the engine stay on one worker, so that its kernels are compiled once; all others stay by their file.
# Clumps have kernels of their own, which the other worker compiles in the meantime.
ENGINE = ("apparatus", "cli", "dem", "verification")
OWN_KERNELS = ("dem/test_clumps.py",)


# Before xdist's own hook, which reads the groups.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Groups for `--dist loadgroup`."""
    tests = Path(__file__).parent
    for item in items:
        path = item.path.relative_to(tests).as_posix()
        group = "engine" if path.startswith(ENGINE) and path not in OWN_KERNELS else path
        item.add_marker(pytest.mark.xdist_group(group))

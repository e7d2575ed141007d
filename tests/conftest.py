import copy
import functools
import importlib
import os
import pickle
import sys
from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling

# As in `repose.__main__`, and before numpy is loaded: threads that wait for each other on small matrices cost minutes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))
importlib.import_module("repose.apparatus")  # makes the responses known by name


def _once(function, when=lambda *_: True):
    """A function whose results are kept for calls with equal arguments, if `when` holds for the arguments."""
    kept = {}

    @functools.wraps(function)
    def wrapper(*arguments):
        if not when(*arguments):
            return function(*arguments)
        key = pickle.dumps(arguments)
        if key not in kept:
            kept[key] = function(*arguments)
        return copy.deepcopy(kept[key])

    return wrapper


def _is_built(_berry, section):
    """Whether the particle's mesh is built from axes and mass, not read from a file, which may change."""
    return section["stl"] is None


# Hundreds of tests read the same defaults (PyYAML needs 50 ms for them) and make the same berry (3 s).
for module, name, *when in (
    ("repose.config.reading", "parse"),
    ("repose.particle.support_fit", "fit_components"),
    ("repose.particle.build", "of_settings", _is_built),
):
    module = importlib.import_module(module)
    setattr(module, name, _once(getattr(module, name), *when))

# Each set of kernels takes a minute to compile, so tests that call the same ones stay on one worker: those of a study's
# contact law, those of the library's, and those of clumps and the linear spring. Those of `repose.verification` come
# late, as their files are small: then either worker finds the kernels in numba's cache. Photographs are a group,
# which comes early as it is large.
GROUPS = {
    "photographs": ("tests/measure/",),
    "other kernels": tuple(f"tests/dem/test_{name}" for name in ("clumps", "laws", "rest")),
    "library": ("tests/dem/", "tests/apparatus/test_bounds"),
    "study": ("tests/apparatus/", "tests/cli/"),
}


class ByKernels(LoadScopeScheduling):
    """Workers take whole groups: those of `GROUPS`, or the tests of one file."""

    def _split_scope(self, nodeid):
        path = nodeid.split("::")[0]
        return next((name for name, places in GROUPS.items() if path.startswith(places)), path)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """For `--dist loadscope`, which pyproject.toml asks for."""
    return ByKernels(config, log) if config.getoption("dist") == "loadscope" else None

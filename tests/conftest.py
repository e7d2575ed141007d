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


def _once(function):
    """A function whose results are kept, as long as it is called with equal arguments."""
    kept = {}

    @functools.wraps(function)
    def wrapper(*arguments):
        key = pickle.dumps(arguments)
        if key not in kept:
            kept[key] = function(*arguments)
        return copy.deepcopy(kept[key])

    return wrapper


# Hundreds of tests read the same defaults (PyYAML needs 50 ms for them) and fit the same berry (2 s).
for module, name in (("repose.config.reading", "parse"), ("repose.particle.support_fit", "fit_components")):
    module = importlib.import_module(module)
    setattr(module, name, _once(getattr(module, name)))

# Tests that run the engine stay on one worker, so that its kernels are compiled once. Those of `repose.verification`
# come late, as their files are small: then either worker finds the kernels in numba's cache.
ENGINE = tuple(f"tests/{room}/" for room in ("apparatus", "cli", "dem"))
# Clumps and the linear spring have kernels of their own, which the other worker compiles in the meantime.
OTHER_KERNELS = tuple(f"tests/dem/test_{name}" for name in ("clumps", "laws", "rest"))


class ByKernels(LoadScopeScheduling):
    """Workers take whole groups: the tests of the engine, those of other kernels, or those of one file."""

    def _split_scope(self, nodeid):
        path = nodeid.split("::")[0]
        if path.startswith(OTHER_KERNELS):
            return "other kernels"
        return "engine" if path.startswith(ENGINE) else path


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """For `--dist loadscope`, which pyproject.toml asks for."""
    return ByKernels(config, log) if config.getoption("dist") == "loadscope" else None

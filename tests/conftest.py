import copy
import gc
import importlib
import os
import re
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling

# What is imported and made until all is collected stays: looking through it takes a third of the time.
gc.disable()
# As in `repose.__main__`, and before numpy is loaded: threads that wait for each other on small matrices cost minutes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))
importlib.import_module("repose.bench")  # makes the responses known by name
ALL_SLOW = re.compile(r"^pytestmark = \[?pytest\.mark\.slow\b", re.MULTILINE)
# Files of which an expression of marks takes no test, by what is or is not written in them.
HAS_NONE = {
    "not slow": ALL_SLOW.search,
    "slow and essential": lambda text: "mark.essential" not in text,
}


@pytest.fixture(autouse=True, scope="session")
def _in_the_project():
    os.chdir(Path(__file__).parents[1])


@pytest.fixture(scope="session")
def _studies():
    from repose.config.pipeline import PipelineConfig

    return {
        name: PipelineConfig.load(f"config/{name}.yaml") for name in ("config", "quick")
    }


@pytest.fixture
def config(_studies):
    return copy.deepcopy(_studies["config"].config)


@pytest.fixture
def quick(_studies):
    return _studies["quick"]


@contextmanager
def _few_rounds():
    """Designs of few exchanges."""
    from repose.calibrate.designs import latin_hypercube

    latin_hypercube._optimal_lhs.cache_clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(latin_hypercube, "ROUNDS_PER_POWER", 5)
        yield
    latin_hypercube._optimal_lhs.cache_clear()


@contextmanager
def _few_points():
    """Designs of few exchanges, and posteriors from few draws."""
    from repose.calibrate import calibration
    from repose.calibrate.uncertainty import sampler

    infer = calibration.infer_posterior

    def infer_briefly(*arguments, settings, **others):
        few = settings.model_copy(update={"steps": 20})
        return infer(*arguments, settings=few, **others)

    with _few_rounds(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibration, "infer_posterior", infer_briefly)
        patch.setattr(sampler, "N_ENSEMBLES", 2)
        patch.setattr(sampler, "N_POPULATION", 128)
        patch.setattr(sampler, "N_PRIOR_DRAWS", 2 * sampler.CHUNK_SIZE)
        yield


# For tests that say nothing of how good designs and posteriors are: a whole module, or a single test.
@pytest.fixture(scope="module")
def short_designs():
    with _few_rounds():
        yield


@pytest.fixture(scope="module")
def short_searches():
    with _few_points():
        yield


@pytest.fixture
def short_search():
    with _few_points():
        yield


@pytest.fixture
def command(capsys):
    """Runs `repose WORDS`, which must end with a status; what it printed, as capsys has it."""
    from repose.cli import main

    def run(*arguments, status=0):
        try:
            ended = main([str(word) for word in arguments])
        except SystemExit as end:  # of argparse
            ended = end.code
        printed = capsys.readouterr()
        assert ended == status, printed
        return printed

    return run


# A first set of kernels takes a minute and a half to compile and each further one half a minute or more, as they share
# what no law changes. So the tests that call them are one group, which comes first as it takes longest. In two groups
# one worker would wait for what the other one compiles. Photographs are the other worker's.
KERNELS = "kernels"
GROUPS = {
    "photographs": ("tests/measure/",),
    KERNELS: (
        "tests/dem/",
        "tests/bench/",
        "tests/cli/",
        "tests/random_pours/",
        "tests/verification/",
    ),
}


@pytest.hookimpl(hookwrapper=True)
def pytest_collection():
    """Let the garbage collector look only at what the tests make."""
    yield
    gc.freeze()
    gc.enable()


def pytest_ignore_collect(collection_path, config):
    """Leave out files of which no test runs, so that they are not imported; None: what pytest would do."""
    has_none = HAS_NONE.get(config.option.markexpr)
    if has_none is None or not collection_path.name.startswith("test_"):
        return None
    return True if has_none(collection_path.read_text()) else None


class ByKernels(LoadScopeScheduling):
    """Workers take whole groups: those of `GROUPS`, or the tests of one file; larger ones first, kernels before all."""

    def _split_scope(self, nodeid):
        path = nodeid.split("::")[0]
        return next(
            (name for name, places in GROUPS.items() if path.startswith(places)), path
        )

    def _assign_work_unit(self, node):
        if KERNELS in self.workqueue:  # few of the essential tests, which take long
            self.workqueue.move_to_end(KERNELS, last=False)
        super()._assign_work_unit(node)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """For `--dist loadscope`, which pyproject.toml asks for."""
    return ByKernels(config, log) if config.getoption("dist") == "loadscope" else None

"""Without the compiler (NUMBA_DISABLE_JIT=1), as the coverage of the kernels is measured, a test makes few time steps.

A test that needs more is skipped when it has made these; the kernels that it called are counted.
"""

import numpy as np
import pytest

from repose.dem.kernels.jit import JIT_OFF
from repose.dem.simulation import Simulation

MOST = 200  # steps of a tile of 32 bodies, some seconds
_left = MOST
_advance = Simulation._advance


def _advance_few(engine, steps):
    global _left
    if engine.threads > 1:
        pytest.skip("threads meet by atomic operations of the compiler")
    tiles = 1 + engine.n_bodies // 32
    if _left < tiles:
        pytest.skip("it needs more time steps than can be made without the compiler")
    made = _advance(engine, min(steps, _left // tiles))
    _left -= made * tiles
    return made


@pytest.fixture(scope="session", autouse=True)
def _few_steps_without_the_compiler():
    if not JIT_OFF:
        yield
        return
    with (
        pytest.MonkeyPatch.context() as patch,
        np.errstate(divide="ignore", invalid="ignore"),
    ):
        patch.setattr(Simulation, "_advance", _advance_few)
        yield


@pytest.fixture(autouse=True)
def _steps_of_its_own(_few_steps_without_the_compiler):
    global _left
    _left = MOST

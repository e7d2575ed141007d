"""The compiler's settings hold for every kernel of a process, in whatever order its modules are loaded."""

from pathlib import Path

import repose

HOME = Path(repose.__file__).parent


def test_modules_with_kernels_of_their_own_load_the_settings_first():
    # numba makes its compiler when the first kernel is called; later settings would not reach it, and the engine would
    # be compiled a second time, for narrower vectors
    texts = {
        path: path.read_text()
        for path in HOME.rglob("*.py")
        if HOME / "dem" not in path.parents
    }
    sources = {path.name: text for path, text in texts.items() if "@numba.njit" in text}
    assert "speed.py" in sources
    assert not [
        name
        for name, text in sources.items()
        if "from repose.dem.kernels import jit" not in text
    ]

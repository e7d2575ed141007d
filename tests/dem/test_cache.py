"""Compiled code on disk: it is found by the sources, is kept where it can be, and is compiled by one process only."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import repose
from repose.dem.kernels.jit import JIT_OFF

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(JIT_OFF, reason="there is no compiled code"),
]

# Calls a kernel that calls another; prints how often code of both was found, how often it was not, and whether what
# numba needs to compile was loaded.
SCRIPT = """
import sys
import numpy as np
from repose.dem.kernels import frames

values = np.arange(3.0)
frames.rotate_to_world(np.arange(12.0), values, 0)
assert values.tolist() == [14.0, 23.0, 32.0], values
called = (frames.rotate_to_world.from_python, frames.out_of_frame.from_kernels)
found, missed = ([sum(getattr(one.stats, name).values()) for one in called] for name in ("cache_hits", "cache_misses"))
print(*found, *missed, "numba.np.npyimpl" in sys.modules)
"""
# A process that goes on after a kernel could not be compiled.
FAILING = """
import sys
from numba.core.errors import TypingError
from repose.dem.kernels.jit import kernel

@kernel
def add_to_nothing(x):
    return x + unknown

try:
    add_to_nothing(1.0)
except TypingError:
    print("failed", flush=True)
sys.stdin.read()
"""
# of found code no other kernel is needed
COMPILED = "0 0 1 1 True"
FOUND = "1 0 0 0 False"


@pytest.fixture
def copied(tmp_path):
    def copy(name):
        home = Path(repose.__file__).parent
        package = tmp_path / name / "repose"
        shutil.copytree(
            home / "dem", package / "dem", ignore=shutil.ignore_patterns("__pycache__")
        )
        shutil.copy(home / "__init__.py", package)
        return package

    return copy


def start(script, package, cache, **environment):
    paths = {"PYTHONPATH": str(package.parent), "NUMBA_CACHE_DIR": str(cache)}
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    return subprocess.Popen(
        [sys.executable, script],
        env=os.environ | paths | environment,
        text=True,
        **pipes,
    )


@pytest.fixture
def run(tmp_path):
    script = tmp_path / "calling.py"
    script.write_text(SCRIPT)

    def run(*arguments, **environment):
        process = start(script, *arguments, **environment)
        out, errors = process.communicate(timeout=120)
        assert process.returncode == 0, errors
        return out.strip(), errors

    return run


def test_the_same_sources_at_another_path_compile_nothing_and_edited_ones_do(
    copied, run, tmp_path
):
    first = copied("first")
    second = copied("second")
    assert run(first, tmp_path / "cache") == (COMPILED, "")
    assert run(second, tmp_path / "cache") == (FOUND, "")
    # a kernel's code has that of the functions it calls, whatever their file
    with (second / "dem" / "kernels" / "geometry.py").open("a") as file:
        file.write("\n")
    assert run(second, tmp_path / "cache") == (COMPILED, "")
    assert run(first, tmp_path / "cache") == (FOUND, "")


def test_a_kernel_is_compiled_anew_for_another_processor_or_in_part(
    copied, run, tmp_path
):
    package = copied("package")
    assert run(package, tmp_path) == (COMPILED, "")
    assert run(package, tmp_path, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="") == (
        COMPILED,
        "",
    )
    assert run(package, tmp_path) == (FOUND, "")
    package = copied("other")
    cache = tmp_path / "cache"
    run(package, cache)
    (path,) = cache.glob("*/*rotate_to_world*")
    path.write_bytes(path.read_bytes()[:1000])
    assert run(package, cache) == ("0 1 1 0 True", "")
    assert run(package, cache) == (FOUND, "")


def test_a_folder_that_cannot_be_written_is_read_and_one_warning_says_that_nothing_is_kept(
    copied, run, tmp_path
):
    package = copied("package")
    cache = tmp_path / "cache"
    run(package, cache)
    next(cache.glob("*/locks")).unlink()
    before = sorted(cache.rglob("*"))
    assert run(package, cache) == (FOUND, "")
    assert sorted(cache.rglob("*")) == before
    no_folder = tmp_path / "file"
    no_folder.touch()
    out, errors = run(package, no_folder)
    assert out == COMPILED
    assert errors.count("keeps no compiled code: Not a directory") == 1


def test_processes_that_start_together_compile_a_kernel_once(copied, tmp_path):
    package = copied("package")
    script = tmp_path / "calling.py"
    script.write_text(SCRIPT)
    together = [start(script, package, tmp_path) for _ in range(3)]
    assert sorted(
        process.communicate(timeout=120)[0].strip() for process in together
    ) == [COMPILED, FOUND, FOUND]


def test_nothing_waits_for_a_process_that_failed_to_compile(copied, tmp_path):
    package = copied("package")
    script = tmp_path / "failing.py"
    script.write_text(FAILING)
    first = start(script, package, tmp_path)
    second = start(script, package, tmp_path)
    assert first.stdout.readline() == second.stdout.readline() == "failed\n"
    for process in (first, second):
        process.communicate()

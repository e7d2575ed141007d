"""The engine loads with numpy and numba alone; other packages only when something needs them."""

import importlib.util

from shared import ROOT, run_python

# A finder that hides every package but the standard library and those that the engine
# needs. An import of another one ends with the message "PACKAGE is hidden".
SCRIPT = """
import importlib
import pkgutil
import sys

sys.path.insert(0, sys.argv[1])
VISIBLE = {"repose", "numpy", "numba", "llvmlite", *sys.stdlib_module_names}
asked_by_engine = []


class Hide:
    def find_spec(self, name, path=None, target=None):
        package = name.partition(".")[0]
        if package in VISIBLE:
            return None
        caller = sys._getframe(1)
        while caller.f_globals.get("__name__", "").startswith("importlib"):
            caller = caller.f_back
        if caller.f_globals["__name__"].startswith("repose"):
            asked_by_engine.append((caller.f_globals["__name__"], name))
        raise ModuleNotFoundError(f"{name} is hidden", name=name)


sys.meta_path.insert(0, Hide())
import repose.dem

for module in pkgutil.walk_packages(repose.dem.__path__, "repose.dem."):
    importlib.import_module(module.name)
for name in repose.dem.__all__:
    getattr(repose.dem, name)
for laws in (repose.dem.laws.CONTACT_LAWS, repose.dem.laws.ROLLING_LAWS):
    for name in laws:
        laws[name]
assert not asked_by_engine, asked_by_engine
loaded = {name.partition(".")[0] for name in sys.modules}
print(*sorted(loaded & {"numpy", "numba", "pandas", "scipy", "pydantic", "yaml"}))
"""


def test_the_engine_loads_with_numpy_and_numba_alone():
    printed = run_python("-c", SCRIPT, str(ROOT / "src"))
    assert printed.split() == ["numba", "numpy"]


def test_other_packages_are_visible_to_this_test():
    """Else the first test would pass in any environment that lacks them."""
    assert importlib.util.find_spec("scipy") is not None
    assert importlib.util.find_spec("pandas") is not None

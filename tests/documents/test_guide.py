"""The guide of CONTRIBUTING, step by step in a copy of the checkout: what it adds works, and the tests pass.

A section of the guide names the new module and shows its code, or the file to copy; it
also shows the line that registers the module, and names the file of that line.
"""

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from shared import ROOT, run_python

pytestmark = pytest.mark.slow

GUIDE = (ROOT / "CONTRIBUTING.md").read_text()
# Folders from which the uses below import.
PATHS = ("src", "tests", "tests/bench", "tests/measure")
# Every addition is a value of a key and a part of the package.
ALWAYS = ("tests/config/test_settings.py", "tests/packaging/test_metadata.py")
ALWAYS_ONLY = "known or registered or reference"


def section(thing):
    """The text of the guide about one thing."""
    return re.search(rf"^## Add a {thing}$(.*?)^## ", GUIDE, re.M | re.S)[1]


def blocks(thing):
    """The blocks of code of a section."""
    return re.findall(r"^```python\n(.*?)^```$", section(thing), re.M | re.S)


@dataclass
class Checkout:
    """A copy of the checkout to which the guide adds one thing."""

    folder: Path

    def python(self, *arguments, **environment):
        """Run Python in the copy and return what it prints."""
        paths = [self.folder / path for path in PATHS]
        variables = {"PYTHONPATH": os.pathsep.join(map(str, paths))} | environment
        return run_python(*arguments, cwd=self.folder, env=os.environ | variables)

    def add_module(self, thing):
        """Write the module of the guide and the line that registers it."""
        text = section(thing)
        paths = re.findall(r"`(src/[\w/]+\.py)`", text)
        copied = re.search(r"^    cp (\S+) (\S+)$", text, re.M)
        if copied:
            source, module = copied.groups()
            shutil.copy(self.folder / source, self.folder / module)
        else:
            module = next(path for path in paths if not (ROOT / path).exists())
            (self.folder / module).write_text(blocks(thing)[0])
        register = next(path for path in paths if (ROOT / path).exists())
        name = Path(module).stem
        line = re.search(rf"^    (.*\b{name}\b.*)$", text.split("```")[0], re.M)[1]
        if copied:
            line = re.search(rf"^    (from .*\b{name}\b.*)$", text, re.M)[1]
        self.add_line(register, line, name)

    def add_figure(self):
        """Write the module of the guide, and its entry at the end of the list."""
        text = section("figure")
        module, catalogue = re.findall(r"`(src/[\w/]+\.py)`", text)
        (self.folder / module).write_text(blocks("figure")[0])
        entry = re.search(r'^    ".*?^    \),$', text, re.M | re.S)[0]
        figures = (self.folder / catalogue).read_text().removesuffix("}\n")
        (self.folder / catalogue).write_text(f"{figures}{entry}\n}}\n")

    def add_line(self, path, line, name):
        """Add a line below the last one of the same form, with another name.

        The line of a law has other properties, too.
        """
        form = re.escape(line).replace(name, r"\w+")
        form = re.sub(r"\w+=True", lambda _: r"\w+=True", form)
        text = (self.folder / path).read_text()
        last = list(re.finditer(rf"^( *){form}\n", text, re.M))[-1]
        added = f"{last[0]}{last[1]}{line}\n"
        text = text[: last.start()] + added + text[last.end() :]
        (self.folder / path).write_text(text)

    def check(self, only, *tests, marks="", **environment):
        """Run those tests, in the files `tests`, whose names have a word of `only`."""
        self.python(
            "-m",
            "pytest",
            "-n",
            "0",
            "-q",
            "-m",
            marks,
            "-k",
            f"{only} or {ALWAYS_ONLY}",
            *tests,
            *ALWAYS,
            **environment,
        )


@pytest.fixture
def checkout(tmp_path):
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
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tmp_path / name)
    # A test asks git for the files of the checkout.
    for arguments in (["init", "-q"], ["add", "-A"]):
        subprocess.run(["git", *arguments], cwd=tmp_path, check=True)
    return Checkout(tmp_path)


# Two spheres meet head-on without damping for 1.8 ms, and so exchange their velocities.
ELASTIC_HIT = """
import numpy as np
from repose.config.pipeline import PipelineConfig
from repose.dem import Contact, Material, Shape, Simulation

simulation = Simulation(
    {"ball": Shape.sphere(0.005, 2500.0, "steel")},
    {"steel": Material(shear_modulus_pa=1e6, poisson_ratio=0.3)},
    {("steel", "steel"): Contact(0.5, 0.0, 0.0)},
    1e-5,
    capacity=2,
    contact_law="hertz",
    gravity_m_s2=(0.0, 0.0, 0.0),
    lower=(-0.02, -0.02, -0.02),
    upper=(0.02, 0.02, 0.02),
)
for side in (-1, 1):
    x_m = side * 0.00501
    simulation.add("ball", (x_m, 0, 0), velocity_m_s=(-side * 0.5, 0, 0))
simulation.run_steps(250)
np.testing.assert_allclose(simulation.velocities[:, 0], [-0.5, 0.5], rtol=1e-3)

laws = {"simulation": {"contact_law": "hertz"}}
PipelineConfig.load("config/config.yaml", overrides=laws)
"""


def check_laws(checkout):
    """Run the tests that concern a new law; its kernels run as Python."""
    checkout.check(
        "law or laws or engine",
        "tests/config/test_law_parameters.py",
        "tests/dem/test_dependencies.py",
        "tests/dem/test_laws.py",
        "tests/export/test_export.py",
        marks="not slow",
        NUMBA_DISABLE_JIT="1",
    )


def test_a_contact_law_of_two_files(checkout):
    checkout.add_module("contact law")
    # Each change of a law compiles all kernels anew; here they run as Python.
    checkout.python("-c", ELASTIC_HIT, NUMBA_DISABLE_JIT="1")
    check_laws(checkout)


# A sphere rolls on a plane. Its speed falls as exp(-mu_r g t / 1.4), as its moment of
# inertia about the contact is 1.4 m r^2 and the torque mu_r m g r^2 w.
VISCOUS_ROLL = """
import math

from repose.bench import bench
from repose.bench.settings import SceneSettings
from repose.config.pipeline import PipelineConfig
from repose.dem import Contact, Material, Plane, Shape, Simulation

radius_m, speed_m_s, seconds, friction = 0.005, 0.02, 0.06, 1.0
simulation = Simulation(
    {"ball": Shape.sphere(radius_m, 2500.0, "steel")},
    {"steel": Material(shear_modulus_pa=1e6, poisson_ratio=0.3)},
    {("steel", "steel"): Contact(0.5, 0.5, friction)},
    5e-5,
    walls={"floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), material="steel")},
    capacity=1,
    rolling_law="viscous",
    gravity_m_s2=(0.0, 0.0, -9.81),
    lower=(-0.02, -0.02, -0.01),
    upper=(0.02, 0.02, 0.02),
)
simulation.add(
    "ball",
    (0.0, 0.0, radius_m),
    velocity_m_s=(speed_m_s, 0.0, 0.0),
    angular_velocity_rad_s=(0.0, speed_m_s / radius_m, 0.0),
)
simulation.run_steps(round(0.02 / 5e-5))
before = simulation.velocities[0, 0]
simulation.run_steps(round(seconds / 5e-5))
after = simulation.velocities[0, 0]
rate = math.log(before / after) / seconds
assert abs(rate / (friction * 9.81 / 1.4) - 1.0) < 0.02, rate

laws = {"simulation": {"rolling_law": "viscous"}}
config = PipelineConfig.load("config/config.yaml", overrides=laws).config
(refused,) = bench("inclined_plane").contradictions(SceneSettings(config))
assert "viscous lets it creep" in refused[1]
"""


def test_a_rolling_law_of_two_files(checkout):
    checkout.add_module("rolling law")
    # Each change of a law compiles all kernels anew; here they run as Python.
    use = "from repose.dem.laws.viscous import *\n"
    use += "from repose.dem.laws.viscous import _scratch_rows\n"
    checkout.python("-c", use + blocks("rolling law")[1], NUMBA_DISABLE_JIT="1")
    checkout.python("-c", VISCOUS_ROLL, NUMBA_DISABLE_JIT="1")
    check_laws(checkout)


# A cone of grains whose height and base are known from the measurement itself.
SLENDER_PILE = """
import numpy as np
from goji import AXES_MM, BERRY, PARTICLE, named
from shared import target
from test_simulated_piles import cone_of_berries

from repose.bench import Scene, bench
from repose.config.pipeline import PipelineConfig

targets = [target(name, 30.0, 1.0, 29.0, 31.0) for name in (
    "slenderness_percent", "base_radius_mm", "aor_deg")]
config = PipelineConfig.load("config/quick.yaml", overrides={"targets": targets}).config
scene = Scene.of(config, named([0.3] * 6), BERRY, PARTICLE, 1)
centres, quaternions = cone_of_berries(30.0, np.random.default_rng(1))
arrays = {
    "position": centres, "quaternion": quaternions, "in_pile": np.full(500, True)
}
record = {"seed": 1, "status": "ok", "reason": ""}
run = bench("funnel").result(record, arrays, scene)
assert run["status"] == "ok", run["reason"]
slenderness = 50.0 * run["height_mm"] / run["base_radius_mm"]
assert run["slenderness_percent"] == slenderness
# The base is measured one grain above the plate, where a cone of 30 deg is narrower.
grain_mm = np.prod(AXES_MM) ** (1 / 3)
cone = 50.0 * np.tan(np.radians(30.0)) / (1.0 - grain_mm / run["height_mm"])
assert abs(slenderness / cone - 1.0) < 0.1
"""


def test_a_response_of_one_file(checkout):
    path = checkout.folder / "src/repose/bench/funnel.py"
    line = re.search(r"^    (\w+,)$", section("response"), re.M)[1]
    # The module has the imports of the example already.
    code = re.sub(r"^from .*\n+", "", blocks("response")[0])
    before, responses, after = re.split(
        r"^(RESPONSES = \(\n.*?)^\)\n", path.read_text(), maxsplit=1, flags=re.M | re.S
    )
    path.write_text(f"{before}{code}\n{responses}    {line}\n)\n{after}")
    checkout.python("-c", SLENDER_PILE)
    checkout.check("responses", "tests/bench/test_bench.py")


@pytest.mark.essential
def test_a_bench_test_of_two_files(checkout):
    checkout.add_module("bench test")
    # `test_bench.py` pours and measures the bench test `spread`.
    checkout.check(
        "test_bench or test_configuration",
        "tests/bench/test_bench.py",
        "tests/bad_input/test_configuration.py",
        marks="not slow",
    )


def test_a_figure_of_two_files(checkout):
    checkout.add_figure()
    use = "from repose.report.figures.response_histograms import *\n"
    checkout.python("-c", use + blocks("figure")[1])
    planned = checkout.python(
        "-m",
        "snakemake",
        "-n",
        "--quiet",
        "rules",
        "--cores",
        "1",
        "--configfile",
        "config/quick.yaml",
        "--",
        "draw_response_histograms",
    )
    assert "draw_response_histograms" in planned
    checkout.check("response_histograms or titles", "tests/report/test_figures.py")


def test_a_surrogate_of_two_files(checkout):
    checkout.add_module("surrogate")
    checkout.python("-c", "import numpy as np\n" + blocks("surrogate")[1])
    checkout.check("cubic_surface", "tests/calibrate/surrogates/test_base.py")


def test_a_strategy_of_two_files(checkout):
    checkout.add_module("strategy")
    use = "from repose.calibrate.strategies.random_search import *\n"
    imports = "import numpy as np\n"
    checkout.python("-c", imports + use + blocks("strategy")[1])
    checkout.check(
        "random_search or names_targets",
        "tests/calibrate/strategies/test_strategies.py",
        "tests/cli/test_run.py",
        "tests/stages/test_answer.py",
    )

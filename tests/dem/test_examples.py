"""What is shown to newcomers runs as it stands: the example of the engine's README, and pictures of any simulation."""

import re
import runpy
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from dem.test_vtk import among
from PIL import Image
from shared import ROOT

from repose.dem import Cylinder, Plane, Recorder
from repose.report.renderer.film import animate
from repose.report.renderer.render import render_simulation
from repose.report.renderer.scenery import make_scenery

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
README = ROOT / "src" / "repose" / "dem" / "README.md"


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    folder = tmp_path_factory.mktemp("readme")
    code = re.search(r"```python\n(.*?)```", README.read_text(), re.S).group(1)
    assert len(code.splitlines()) < 30
    names = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec(compile(code, str(README), "exec"), names)
    return names["simulation"], folder


def test_the_box_is_that_of_the_readme(box):
    simulation, folder = box
    assert (
        simulation.time_s
        == simulation.steps * simulation.time_step_s
        == pytest.approx(1.0)
    )
    positions = simulation.positions
    assert (np.abs(positions[:, :2]) < 0.05).all()
    assert (positions[:, 2] > 0.004).all()
    assert positions[:, 2].max() < 0.08
    assert simulation.kinetic_energies().sum() < 1e-5
    assert (
        len(list(ET.parse(folder / "box" / "box.pvd").getroot().iter("DataSet")))
        == 2 * 21
    )


def test_a_picture_shows_balls_and_panels(box):
    simulation, _folder = box
    picture = render_simulation(simulation, width=160, height=120).astype(int)
    red = picture[..., 0] > picture[..., 2] + 40
    grey = ~red & (picture.max(axis=-1) < 215)
    assert min(red.mean(), grey.mean()) > 0.05
    scenery = make_scenery(simulation)
    assert scenery.plate_m is None
    assert len(scenery.panels) == 5
    for panel in (
        scenery.panels
    ):  # the panels close the box up to the top: normals point at its middle
        assert (
            panel.normal @ (np.array([0.0, 0.0, 0.075]) - panel.corners_m.mean(axis=0))
            > 0
        )


def test_a_scaled_body_is_drawn_at_its_size():
    sizes = []
    for shape, scale in (("ball", 1.0), ("ball", 2.0), ("berry", 1.0)):
        simulation = among({}, largest_scale=2.0)
        simulation.add(shape, (0.0, 0.0, 0.05), scale=scale)
        frame = np.array([(-0.03, -0.03, 0.02), (0.03, 0.03, 0.08)])
        picture = render_simulation(
            simulation, width=120, height=120, frame_m=frame
        ).astype(int)
        # the first shape; the second is blue
        sandy = picture[..., 0] > picture[..., 2] + 60
        sizes.append((picture.max(axis=-1) - picture.min(axis=-1) > 20).sum())
        assert sandy.any() == (shape == "berry")
    assert sizes[1] / sizes[0] == pytest.approx(4.0, rel=0.15)


def test_any_simulation_becomes_an_animation(tmp_path):
    walls = {
        "floor": Plane((0, 0, 0), (0, 0, 1), "m"),
        "shell": Cylinder((0, 0, 0), (0, 0, 1), 0.1, 0.03, "m"),
    }
    simulation = among(walls, lower=(-0.03, -0.03, 0.0), upper=(0.03, 0.03, 0.1))
    simulation.add("berry", (0.0, 0.0, 0.08))
    frames = Recorder()
    simulation.run(0.08, progress=False, record=frames, record_every_s=0.02)
    animate(simulation, frames.frames(), tmp_path / "fall.gif", width=60, height=80)
    with Image.open(tmp_path / "fall.gif") as film:
        assert film.n_frames == 5
        assert film.size == (60, 80)
    assert make_scenery(simulation).plate_m == 0.0
    assert [(w.r_low_m, w.z_high_m) for w in make_scenery(simulation).frusta] == [
        (0.03, 0.1)
    ]


# Arguments that make each example small, and what it then says.
SMALL = {
    "chute": (
        {"bodies": 24, "seconds": 0.1},
        r"3 frames in .*; the front is at -\d+ mm",
    ),
    "mixed_bed": (
        {"bodies": 48, "seconds": 0.3},
        r"[1-9]\d* contacts, \d+ % of them between .*",
    ),
    "size_distribution": (
        {"layers": 3, "seconds": 0.1},
        r"scales 0\.\d+ to 1\.\d+, mean \d\.\d+; .*",
    ),
    "bench_test": (
        {"berries": 3, "duration_s": 0.4},
        r"(rolling friction 0\.\d: spread \d+\.\d mm\s?){2}",
    ),
}


@pytest.mark.parametrize(
    "path", [p for p in EXAMPLES if p.stem != "bench_test"], ids=lambda path: path.stem
)
def test_a_scene_of_the_examples_runs(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments, expected = SMALL[path.stem]
    runpy.run_path(str(path))["main"](**arguments)
    assert re.fullmatch(expected, capsys.readouterr().out.strip())
    folder = tmp_path / "results" / "examples" / path.stem
    with Image.open(folder / f"{path.stem}.png") as picture:
        assert np.ptp(np.asarray(picture)) > 100
    series = ET.parse(folder / f"{path.stem}.pvd").getroot().iter("DataSet")
    assert all((folder / entry.get("file")).is_file() for entry in series)


def test_the_example_of_a_bench_test_runs():
    # it registers the bench test, so it runs in another process
    arguments, expected = SMALL["bench_test"]
    call = f"import runpy; runpy.run_path('examples/bench_test.py')['main'](**{arguments!r})"
    done = subprocess.run(
        [sys.executable, "-c", call], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(expected, done.stdout.strip())

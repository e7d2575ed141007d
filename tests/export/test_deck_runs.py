"""The decks in the programs themselves; a program that is not installed is left out."""

import importlib
import math
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from export.jobs import BALL, BERRY, CONFIG, THREE, job_of
from shared import ROOT

from repose import export
from repose.config.pipeline import PipelineConfig
from repose.dem.laws import CONTACT_LAWS
from repose.grain import build

pytestmark = pytest.mark.slow
RUNS = {
    "liggghts": (["liggghts", "-in", "in.pour"], "pile.dump"),
    "lammps": (["lmp", "-in", "in.pour"], "pile.dump"),
    "yade": (["yade", "-n", "-x", "-j1", "pour.py"], "pile.csv"),
}


@pytest.fixture(scope="module")
def config():
    return PipelineConfig.load(CONFIG).config


def installed(program):
    command, _ = RUNS[program]
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed")
    return command


def ran(program, job, folder):
    command = installed(program)
    result = RUNS[program][1]
    export.write_deck(job, program, folder)
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=500,
    )
    assert (folder / result).exists(), done.stdout[-600:] + done.stderr[-600:]
    lines = (folder / result).read_text().splitlines()
    start = next(k for k, line in enumerate(lines) if "radius" in line)
    columns = lines[start].replace(",", " ").replace("ITEM: ATOMS", "").split()
    rows = np.array(
        [line.replace(",", " ").split() for line in lines[start + 1 :]], float
    )
    return dict(zip(columns, rows.T, strict=True))


def few(job, berries, **funnel):
    return replace(
        job,
        funnel=job.funnel.model_copy(
            update={"berries": berries, "rate_per_s": 50.0} | funnel
        ),
    )


def places(end, job):
    at = np.stack([end[axis] for axis in "xyz"], axis=1).reshape(
        -1, len(job.particle.spheres_m), 3
    )
    expected = np.linalg.norm(
        job.particle.spheres_m[:, None, :3] - job.particle.spheres_m[None, :, :3],
        axis=2,
    )
    for spheres in at:
        assert np.linalg.norm(
            spheres[:, None] - spheres[None], axis=2
        ) == pytest.approx(expected, abs=1e-6)
    return at


@pytest.mark.parametrize("particle", [THREE, BALL], ids=["clump", "sphere"])
@pytest.mark.parametrize("program", RUNS)
def test_grains_fall_freely_and_stay_rigid(config, program, particle, tmp_path):
    job = few(job_of(config, particle), 2, duration_s=0.06)
    end = ran(program, job, tmp_path)
    at = places(end, job)
    assert len(at) == 2
    assert end["radius"] == pytest.approx(np.tile(job.particle.spheres_m[:, 3], 2))
    fallen = job.factory_height_m - at.mean(axis=1)[:, 2].min()
    expected = 0.5 * job.simulation.gravity_m_s2 * job.funnel.duration_s**2
    assert fallen == pytest.approx(expected, abs=5e-4)


@pytest.mark.parametrize(
    ("program", "law"),
    [*((name, "hertz_mindlin") for name in RUNS), ("liggghts", "sjkr")],
)
def test_a_sphere_rebounds_with_the_calibrated_restitution(
    config, program, law, tmp_path
):
    stiff = BERRY | {"shear_modulus_pa": 4e6}  # an impact is short and shallow
    job = job_of(config, BALL, law, berry=stiff, e_gp=0.5, k_gg=2e5, k_gp=2e5)
    fall = job.factory_height_m - 0.005
    gravity = job.simulation.gravity_m_s2
    seconds = 1.25 * math.sqrt(2.0 * fall / gravity)  # on its way up again
    end = ran(
        program, few(job, 1, factory_diameter_mm=12.0, duration_s=seconds), tmp_path
    )
    height = end["z"][0] - 0.005 + end["vz"][0] ** 2 / (2.0 * gravity)
    restitution = math.sqrt(height / fall)
    if law == "sjkr":
        assert restitution < 0.45
    else:
        assert restitution == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(
    ("program", "law"),
    [*((name, "hertz_mindlin_rescaled") for name in RUNS), ("liggghts", "sjkr")],
)
def test_the_default_grain_is_poured_as_a_clump(config, program, law, tmp_path):
    installed(program)  # before the spheres are packed
    study = PipelineConfig.load(CONFIG)
    grain = study.settings.berry.model_copy(
        update={"particle": "multisphere", "spheres": 14}
    )
    job = job_of(
        config,
        build.make_configured_particle(study.grain, grain),
        law,
        k_gg=3e3,
        k_gp=1e3,
    )
    job = few(job, 3, duration_s=0.8)
    at = places(ran(program, job, tmp_path), job)
    assert len(at) == 3
    low = (at[:, :, 2] - job.particle.spheres_m[:, 3]).min()
    assert -5e-4 < low < 1e-5  # one lies on the plate, not in it
    assert at[:, :, 2].max() < job.surfaces.outlet_height_m


@pytest.mark.parametrize("program", RUNS)
def test_a_grazing_impact_keeps_coulombs_law(config, program, monkeypatch):
    command = installed(program)
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    one_contact = importlib.import_module("one_contact")
    CONTACT_LAWS.pop("body_damping", None)  # of the benchmarks; no other test knows it
    case = one_contact.CASES["grazes the plate, across"]
    job = job_of(config, THREE)
    _, velocities = one_contact.theirs(
        program, job, case, 4e-5, {program: " ".join(command)}
    )
    change = velocities[0] - case.velocities[0]
    # it slides nearly all the time, only first the spring winds up; and the plate only pushes
    assert 0.85 < -change[1] / change[2] / job.on_wall.static_friction < 1.01

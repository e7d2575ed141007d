"""A scanned grain as a user has it: an STL in any pose is poured and exported with its mass, volume and axes."""

import re

import numpy as np
import pytest
import trimesh
import yaml

from repose.bench import bench
from repose.cli import main
from repose.config.pipeline import PipelineConfig
from repose.stages.job import run_once

VESSEL = {
    "berries": 60,
    "rate_per_s": 200.0,
    "duration_s": 1.2,
    "diameter_mm": 60.0,
    "height_mm": 30.0,
    "collar_mm": 80.0,
    "core_margin_mm": 2.0,
    "speed_m_s": 0.5,
    "seeds": 1,
}


@pytest.mark.slow
def test_a_scan_of_a_bumpy_body_is_poured_and_exported_with_its_mass_volume_and_axes(
    tmp_path,
):
    scan = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    # bumps
    scan.vertices *= 1.0 + 0.06 * np.sin(9.0 * scan.vertices).prod(
        axis=1, keepdims=True
    )
    scan.apply_scale([21.0, 13.0, 10.0])
    moments, axes = np.linalg.eigh(scan.moment_inertia)
    volume = scan.volume
    extents = np.ptp(scan.vertices @ axes, axis=0)
    scan.apply_transform(
        trimesh.transformations.euler_matrix(0.5, 1.1, 2.3)
    ).apply_translation([40.0, -7.0, 3.0])
    scan.export(tmp_path / "scan.stl")
    berry = {
        "stl": str(tmp_path / "scan.stl"),
        "particle": "multisphere",
        "spheres": 24,
        "density_kg_m3": 900.0,
    }
    configuration = {
        "berry": berry,
        "cylinder": VESSEL,
        "simulation": {"time_step_s": "auto"},
        "validation": {"published": None},
    }
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(configuration))
    study = PipelineConfig.load("config/config.yaml", tmp_path / "own.yaml")
    record, run = run_once(bench("cylinder"), study.scene(study.parameters.centre, 1))
    lie = (run.arrays["position"][:, 2] < 0.03).sum()
    vessel = np.pi * 30.0**2 * 30.0
    assert record["bulk_density_kg_m3"] == pytest.approx(
        lie * 900.0 * volume / vessel, rel=1e-4
    ), record["reason"]
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(study.config))
    arguments = f"export --to lammps --set mus_gg=0.5 --config {tmp_path / 'own.yaml'} --out {tmp_path}"
    main(arguments.split())
    text = (tmp_path / "grain.mol").read_text()
    mass = np.fromstring(re.search("(.*) mass", text)[1], sep=" ")
    inertia = np.fromstring(re.search("(.*) inertia", text)[1], sep=" ")
    assert mass == pytest.approx(9e-7 * volume, rel=1e-4)
    expected = [*(9e-13 * moments), 0.0, 0.0, 0.0]
    assert inertia == pytest.approx(expected, rel=1e-4, abs=1e-15)
    parts = (
        re.search(rf"{name}\n\n(.*?)\n\n", text, re.DOTALL)[1]
        for name in ("Coords", "Diameters")
    )
    centres, twice = (1e3 * np.loadtxt(part.splitlines())[:, 1:] for part in parts)
    low = (centres - twice / 2).min(axis=0)
    high = (centres + twice / 2).max(axis=0)
    assert high - low == pytest.approx(extents, rel=0.05)
    points = np.random.default_rng(1).uniform(low, high, (100_000, 1, 3))
    solid = (np.linalg.norm(points - centres, axis=2) < twice[:, 0] / 2).any(axis=1)
    assert solid.mean() * (high - low).prod() == pytest.approx(volume, rel=0.05)

"""One pile in the files that LIGGGHTS and Yade wrote for it: VTK, a dump and text."""

import re
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from repose.common.errors import InputError
from repose.measure import particle_files
from repose.measure.particles import measure_particles
from repose.measure.settings import MeasureSettings

FOLDER = Path(__file__).with_name("vtk")
FILES = sorted(FOLDER.glob("*.vt?"))
RADIUS = 0.005  # m
SETTINGS = MeasureSettings.with_defaults(
    views=6, response="whole", berry_height_mm=2e3 * RADIUS
)


def test_a_vtk_file_is_one_of_particles_whatever_bytes_it_holds():
    assert len(FILES) == 7
    assert all(particle_files.is_particle_file(path) for path in FILES)


def test_without_pyvista_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    words = r"yade.vtu: file is 'VTK'; expected pyvista.*repose-dem\[vtk\]"
    with pytest.raises(InputError, match=words):
        particle_files.read_particles(FOLDER / "yade.vtu")


def test_every_file_gives_the_angles_of_the_dump():
    pytest.importorskip("pyvista")
    dump = measure_particles(
        particle_files.read_particles(FOLDER / "liggghts.dump"), SETTINGS, source="dump"
    )
    assert dump.n_grains == 30
    assert not np.isnan(dump.result.aor_deg)
    for path in [FOLDER / "yade.txt", *FILES]:
        pile = measure_particles(
            particle_files.read_particles(path), SETTINGS, source=path
        )
        assert pile.result.aor_deg == pytest.approx(dump.result.aor_deg, abs=0.05), path
        assert pile.result.height_mm == pytest.approx(dump.result.height_mm, abs=0.01)
        assert (pile.up, pile.n_grains, pile.n_particles) == ("z", 30, 30)
        assert pile.other_responses["loose_percent"] == 0.0


def test_files_of_vtk_without_particles_are_refused(tmp_path):
    pytest.importorskip("pyvista")
    text = (FOLDER / "liggghts.vtp").read_text()

    def refused(words, name, content):
        path = tmp_path / name
        path.write_text(content)
        with pytest.raises(InputError, match=words) as fault:
            particle_files.read_particles(path)
        assert str(path) in str(fault.value)

    refused(
        "size is 'missing'.*found: x, y, z", "facets.vtp", text.replace("radius", "n")
    )
    points = re.sub(r'NumberOfPoints="\d+"', 'NumberOfPoints="0"', text)
    refused("without particles|VTK file", "no_points.vtp", points)
    refused("VTK file|without particles", "cut.vtp", text[: len(text) // 3])
    other = text.replace('type="PolyData"', 'type="Collection"')
    refused("'Collection'; expected one of Unstruct", "run.pvd", other)


@pytest.mark.parametrize("alone", [-1, "-1"])
def test_a_particle_outside_clumps_is_a_grain(tmp_path, alone):
    table = pd.DataFrame({"x": range(5), "y": 0.0, "z": 0.0, "radii": 0.5})
    table["clumpId"] = [alone, 3, 3, alone, 0]
    path = tmp_path / "clumps.csv"
    table.to_csv(path, index=False)
    grains = particle_files.read_particles(path).grains
    assert grains.tolist() == [0, 1, 1, 2, 3]

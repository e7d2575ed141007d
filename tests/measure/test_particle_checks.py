"""Files of particles that are no single pile: refused, doubtful or with a note."""

import re

import numpy as np
import pandas as pd
import pytest
from test_particles import RADIUS, SETTINGS, cone, dump_text, make_particles

from repose.common.errors import InputError
from repose.measure import particle_files
from repose.measure.particles import measure_particles

STEP = 2 * RADIUS


def measure(centres, *, radius=RADIUS, types=None, **options):
    """The pile of spheres at these centres."""
    fields = {} if types is None else {"types": np.array(types)}
    return measure_particles(
        make_particles(centres, radius, **fields), SETTINGS, **options
    )


def floor(height):
    """Centres of a square layer of touching spheres, far wider than the cone."""
    lattice = STEP * np.arange(-30, 31)
    x, y = np.meshgrid(lattice, lattice)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])


def test_a_good_pile_has_no_remark():
    pile = measure(cone(), types=["1"] * len(cone()))
    assert (pile.warnings, pile.notes) == ((), ())
    ellipsoids = make_particles(cone(), RADIUS * np.array([0.9, 0.95, 1.0]))
    assert measure_particles(ellipsoids, SETTINGS, up="z", base=0.0).warnings == ()


def test_a_particle_that_is_there_twice_is_refused():
    centres = cone()
    words = f"row 1 is 'a particle at the position of row {len(centres) + 1}'; .*once"
    with pytest.raises(InputError, match=words):
        measure(np.vstack([centres, centres + 1e-6]))


def test_diameters_taken_for_radii_are_refused():
    with pytest.raises(InputError, match=r"radius is '0\.01 m'.*100% of the pile"):
        measure(cone(), radius=2 * RADIUS, up="z", base=0.0)


def test_spheres_of_clumps_without_numbers_have_no_packing():
    # Each sphere of the cone becomes a clump of nine, which fills the same space.
    corners = np.stack(np.meshgrid(*[[-1, 1]] * 3), axis=-1).reshape(-1, 3)
    centres = cone()
    parts = [centres + 0.1 * RADIUS * corner for corner in corners]
    clumps = measure(np.vstack([centres, *parts]), radius=0.9 * RADIUS, up="z")
    assert "packing_percent" not in clumps.other_responses
    assert "packing_percent" in measure(centres).other_responses


def test_a_plate_that_no_grain_touches_is_refused():
    words = "base is -137.0; expected the height .*lowest grain is at 0 .--base"
    with pytest.raises(InputError, match=words):
        measure(cone(), base=-137.0)
    # Grains that lie apart on a table hold the plane, and a stand holds the pile.
    table = 3 * floor(0.0) + np.array([0.0, 0.0, RADIUS - 0.1])
    both = np.vstack([cone(), table])
    with pytest.raises(InputError, match=r"base is -0.1; .*lowest grain is at 0 "):
        measure(both, up="z")
    assert (
        measure(both, up="z", base=0.0).result.height_mm
        == measure(cone()).result.height_mm
    )


def test_a_wrong_direction_of_gravity_is_refused():
    with pytest.raises(
        InputError, match=r"base is 'unclear: .*expected --up, .*--base"
    ):
        measure(cone(), up="x")


def test_a_floor_below_a_given_plate_holds_no_grains():
    centres = cone()
    expected = measure(centres)
    pile = measure(np.vstack([centres, floor(-RADIUS)]), up="z", base=0.0)
    assert pile.n_grains == len(centres)
    assert pile.result.aor_deg == expected.result.aor_deg
    assert pile.other_responses == expected.other_responses
    assert len(pile.notes) == 1
    assert (
        "particles do not belong to the measured pile, 3721 of them below"
        in (pile.notes[0])
    )


def test_a_dump_in_another_unit_is_refused(tmp_path):
    path = tmp_path / "pile.dump"
    text = dump_text(100 * cone(), radius=100 * RADIUS)
    path.write_text(f"ITEM: UNITS\ncgs\nITEM: TIME\n0.1\n{text}")
    particles = particle_files.read_particles(path)
    with pytest.raises(InputError, match="unit of lengths is 'm'; expected cm, which"):
        measure_particles(particles, SETTINGS)
    found = measure_particles(particles, SETTINGS, unit="cm").result.height_mm
    assert found == pytest.approx(measure(cone()).result.height_mm)


def test_shapes_that_are_no_single_pile_are_doubtful():
    centres = cone()
    top = centres[:, 2].max()
    column = np.zeros((30, 3))
    column[:, 2] = top + STEP * np.arange(1, 31)
    (warning,) = measure(np.vstack([centres, column])).warnings
    assert warning.startswith("doubtful: the outline falls by 8")
    other = centres + np.array([16 * STEP, 0.0, 0.0])
    both = np.unique(np.vstack([centres, other]).round(6), axis=0)
    warnings = measure(both).warnings
    assert any("as with two piles" in warning for warning in warnings)
    on_floor = np.vstack([centres, floor(-RADIUS)])
    types = ["1"] * len(centres) + ["2"] * len(floor(0.0))
    pile = measure(on_floor, types=types, up="z")
    assert any(
        "as with a floor made of particles" in warning for warning in pile.warnings
    )
    assert f"types 1 ({len(centres)}), 2 (3721)" in pile.notes[0]


def test_grains_as_wide_as_boulders_and_a_second_pile_get_a_note():
    (note,) = measure_particles(make_particles(20 * cone(), 20 * RADIUS)).notes
    assert note.startswith("its grains are 0.2 m wide; is the unit of lengths wrong")
    apart = cone() + np.array([1.0, 0.0, 0.0])
    (note,) = measure(np.vstack([cone(), apart])).notes
    n = len(apart)
    assert note.startswith(f"{n} of {2 * n} particles do not belong")


def test_a_doubtful_pile_is_left_out_of_the_results(tmp_path, command):
    runs = tmp_path / "samples.csv"
    runs.write_text("sample,run,friction\n1,1,0.3\n2,1,0.4\n")
    half = cone()[cone()[:, 0] > -1e-9]
    for name, centres in (("1_1", cone()), ("2_1", half)):
        table = pd.DataFrame(centres, columns=["x", "y", "z"]).assign(r=RADIUS)
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    files = (tmp_path / "1_1.csv", tmp_path / "2_1.csv")
    given = ("--runs", runs, "--out", tmp_path, "--grain-mm", 10)
    text = command("measure", *files, *given).out
    assert "  doubtful: its views have angles" in text
    assert re.search(
        r"  note: \d+ of 18 side views have two sides that differ by", text
    )
    assert "doubtful piles: 1, not in results.csv; --doubtful counts them" in text
    notes = pd.read_csv(tmp_path / "piles.csv", keep_default_na=False)["note"]
    assert notes[0] == ""
    assert notes[1].startswith("doubtful: its views")
    responses = pd.read_csv(tmp_path / "results.csv")["aor_deg"]
    assert responses.isna().tolist() == [False, True]
    command("measure", *files, *given, "--doubtful")
    assert pd.read_csv(tmp_path / "results.csv")["aor_deg"].notna().all()
    error = command("measure", files[0], "--unit", "mm", status=2).err
    assert "of particles 0.01 mm wide (--unit mm)" in error

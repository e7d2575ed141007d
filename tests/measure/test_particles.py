"""Piles of other simulators, measured from files of particles."""

import math

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from scipy.spatial.transform import Rotation

from repose.common.errors import InputError
from repose.grain.particle import Particle
from repose.measure import particle_files
from repose.measure.particles import (
    DIRECTIONS,
    Ellipsoids,
    _make_rotation_to_z,
    find_up,
    measure_particles,
)
from repose.measure.pile import measure_pile
from repose.measure.settings import MeasureSettings
from repose.measure.silhouette import Grains, find_top

RADIUS = 0.005  # m
SETTINGS = MeasureSettings.with_defaults(
    views=6, mm_per_pixel=0.25, response="whole", berry_height_mm=2e3 * RADIUS
)


def cone(slope_deg=30.0, height=0.06):
    """Centres (N, 3) of touching spheres in a cone on the plate z = 0, in m.

    They lie in square layers of a cubic lattice, so that all of them are connected.
    """
    step = 2 * RADIUS
    foot = height / math.tan(math.radians(slope_deg))
    n = int(foot / step) + 1
    lattice = step * np.arange(-n, n + 1)
    x, y, z = np.meshgrid(lattice, lattice, RADIUS + step * np.arange(n), indexing="ij")
    centres = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    top = centres[:, 2] + RADIUS
    is_inside = np.hypot(*centres[:, :2].T) <= foot * (1 - top / height) + 1e-9
    return centres[is_inside]


def dump_text(centres, radius=RADIUS, step=0):
    """Text of one time step, as LAMMPS and LIGGGHTS write it."""
    lines = [
        "ITEM: TIMESTEP",
        str(step),
        "ITEM: NUMBER OF ATOMS",
        str(len(centres)),
        "ITEM: BOX BOUNDS ff ff ff",
        "-1 1",
        "-1 1",
        "-1 1",
    ]
    lines.append("ITEM: ATOMS id type x y z radius vx vy vz")
    for k, (x, y, z) in enumerate(centres, start=1):
        lines.append(f"{k} 1 {x:.6g} {y:.6g} {z:.6g} {radius:g} 0 0 0")
    return "\n".join(lines) + "\n"


@pytest.fixture
def written(tmp_path):
    """Write the pile of spheres in every format, and give the paths."""
    centres = cone()
    table = pd.DataFrame(centres, columns=["x", "y", "z"])
    dump = tmp_path / "pile.dump"
    dump.write_text(dump_text(centres + 1.0, step=0) + dump_text(centres, step=100))
    csv = tmp_path / "pile.csv"
    table.assign(Diameter=2 * RADIUS).to_csv(csv, index=False)
    blanks = tmp_path / "pile.txt"
    table.assign(radius=RADIUS).to_csv(blanks, index=False, sep=" ")
    yade = tmp_path / "pile.yade"
    rows = "\n".join(f"{x:.9g}\t{y:.9g}\t{z:.9g}\t{RADIUS}" for x, y, z in centres)
    yade.write_text(f"#format x_y_z_r\n{rows}\n")
    axes = tmp_path / "axes.csv"
    ellipsoids = table.assign(a=RADIUS, b=RADIUS, c=RADIUS, qw=1, qx=0, qy=0, qz=0)
    ellipsoids.to_csv(axes, index=False)
    return [dump, csv, blanks, yade, axes]


def test_every_format_gives_the_same_numbers(written):
    centres = cone()
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(centres), 1))
    sphere = Particle.from_record(sphere_record())
    ours = measure_pile(Grains(centres, upright, sphere), SETTINGS)
    for path in written:
        found = measure_particles(particle_files.read_particles(path), SETTINGS)
        assert found.result.height_mm == pytest.approx(ours.height_mm, abs=0.01)
        for name, angles in ours.aor.items():
            np.testing.assert_allclose(
                found.result.aor[name], angles, atol=0.05, err_msg=f"{path} {name}"
            )
        assert found.up == "z"
        assert found.n_grains == len(centres)
        assert found.base == pytest.approx(0.0, abs=1e-5)


def sphere_record():
    """The record of a sphere of `RADIUS`."""
    volume = 4 / 3 * math.pi * RADIUS**3
    mass = 1000.0 * volume
    inertia = np.full(3, 0.4 * mass * RADIUS**2)
    half = np.full(3, RADIUS)
    return Particle(
        "ellipsoid", half[None], 1000.0, volume, mass, inertia, RADIUS, 0.0, 0.0
    ).record()


@pytest.mark.parametrize("up", DIRECTIONS)
def test_gravity_and_base_are_found_and_change_no_number(up, tmp_path):
    centres = cone()
    rotation = _make_rotation_to_z(np.array(DIRECTIONS[up]))
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ DIRECTIONS[up], [0, 0, 1])
    turned = (centres + np.array([0.0, 0.0, 0.3])) @ rotation
    path = tmp_path / "pile.csv"
    table = pd.DataFrame(1e3 * turned, columns=["x", "y", "z"])
    table.assign(radius=1e3 * RADIUS).to_csv(path, index=False)
    particles = particle_files.read_particles(path)
    assert find_up(particles) == up
    found = measure_particles(particles, SETTINGS, unit="mm")
    assert found.base == pytest.approx(300.0, abs=1e-6)
    upright = tmp_path / "upright.csv"
    table = pd.DataFrame(centres, columns=["x", "y", "z"])
    table.assign(radius=RADIUS).to_csv(upright, index=False)
    expected = measure_particles(particle_files.read_particles(upright), SETTINGS)
    assert found.result.height_mm == pytest.approx(expected.result.height_mm, abs=1e-6)
    assert found.result.aor_deg == pytest.approx(expected.result.aor_deg, abs=0.05)


def test_loose_grains_are_counted_and_leave_the_pile(tmp_path):
    centres = cone()
    loose = np.array([[0.3, 0.0, RADIUS], [0.0, -0.3, RADIUS], [0.3, 0.3, RADIUS]])
    path = tmp_path / "pile.dump"
    path.write_text(dump_text(np.vstack([centres, loose])))
    found = measure_particles(particle_files.read_particles(path), SETTINGS)
    percent = 100 * 3 / (len(centres) + 3)
    assert found.other_responses["loose_percent"] == pytest.approx(percent)
    path.write_text(dump_text(centres))
    alone = measure_particles(particle_files.read_particles(path), SETTINGS)
    assert found.result.aor_deg == alone.result.aor_deg
    assert alone.other_responses["loose_percent"] == 0.0


def test_grains_that_fell_from_the_plate_do_not_move_the_base(tmp_path):
    fallen = np.array([[0.5, 0.1 * k, -0.4 + 0.03 * k] for k in range(5)])
    path = tmp_path / "pile.dump"
    path.write_text(dump_text(np.vstack([cone(), fallen])))
    found = measure_particles(particle_files.read_particles(path), SETTINGS)
    assert found.up == "z"
    assert found.base == pytest.approx(0.0, abs=1e-6)


def test_ellipsoids_of_their_own_axes_have_their_exact_outline():
    rng = np.random.default_rng(7)
    semi_axes = rng.uniform(0.002, 0.006, (5, 3))
    quaternions = Rotation.random(5, random_state=3).as_quat(scalar_first=True)
    centres = rng.uniform(-0.01, 0.01, (5, 3))
    bodies = Ellipsoids(centres, quaternions, None, semi_axes_m=semi_axes)
    # the highest point of each from a fine mesh of its surface
    directions = rng.normal(size=(200_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    highest = -np.inf
    for centre, quaternion, axes in zip(centres, quaternions, semi_axes, strict=True):
        turn = Rotation.from_quat(quaternion, scalar_first=True)
        surface = turn.apply(axes * directions) + centre
        highest = max(highest, surface[:, 2].max())
    assert find_top(bodies) == pytest.approx(highest, abs=1e-6)
    assert find_top(bodies) >= highest


def test_ellipsoids_that_are_nearly_spheres_have_the_angles_of_spheres():
    centres = cone()
    sizes = np.full((len(centres), 3), RADIUS)
    spheres = make_particles(centres, sizes)
    ellipsoids = make_particles(centres, sizes * [1.0, 1.0, 1.0001])
    expected = measure_particles(spheres, SETTINGS).result
    found = measure_particles(ellipsoids, SETTINGS).result
    assert found.aor_deg == pytest.approx(expected.aor_deg, abs=0.05)
    assert found.height_mm == pytest.approx(expected.height_mm, abs=0.01)


def make_particles(centres, semi_axes=RADIUS, **fields):
    """Upright particles, each of which is a grain."""
    n = len(centres)
    sizes = np.broadcast_to(semi_axes, (n, 3))
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    return particle_files.Particles(centres, sizes, turns, np.arange(n), **fields)


def test_files_that_are_no_pile_of_particles_are_refused(tmp_path):
    centres = cone()

    def refused(message, name, text):
        path = tmp_path / name
        path.write_text(text)
        with pytest.raises(InputError, match=message) as fault:
            measure_particles(
                particle_files.read_particles(path), SETTINGS, source=path
            )
        assert str(path) in str(fault.value)

    whole = dump_text(centres)
    refused("a complete dump", "cut.dump", whole[: len(whole) // 2].rpartition("\n")[0])
    refused("without ITEM: ATOMS", "head.dump", whole.partition("ITEM: ATOMS")[0])
    _, _, body = whole.partition("ITEM: BOX")
    refused("NUMBER OF ATOMS is 'missing'", "count.dump", f"ITEM: BOX{body}")
    words = whole.replace(f"ATOMS\n{len(centres)}\n", "ATOMS\nmany\n")
    refused("NUMBER OF ATOMS is 'many'", "word.dump", words)
    twice = dump_text(np.vstack([centres, centres[:1]]))
    twice = twice.replace(f"\n{len(centres) + 1} 1 ", "\n1 1 ")
    refused(f"row {len(centres) + 1} is '1'; .* once", "twice.dump", twice)
    refused("column z is 'missing'", "no_z.csv", "x,y,radius\n1,2,3\n")
    refused("size is 'missing'.*found: x, y, z", "no_size.csv", "x,y,z\n1,2,3\n")
    refused("orientation is 'missing'", "axes.csv", "x,y,z,a,b,c\n0,0,0,1,2,3\n")
    refused("row 2 is 'far'", "word.csv", "x,y,z,r\n0,0,0,1\nfar,0,0,1\n")
    refused("row 1 is 0.0; .* above 0", "point.csv", "x,y,z,r\n0,0,0,0\n")
    refused("without particles", "empty.csv", "x,y,z,r\n")
    refused(
        "row 2 is '3 values'; expected 4: ",
        "row.txt",
        "#format x_y_z_r\n0 0 0 1\n0 0 1\n",
    )
    axes = "x,y,z,a,b,c,qw,qx,qy,qz\n0,0,0,1,2,3,1,0,0,0\n0,0,0,1,2,3,0,0,0,0\n"
    refused("orientation, row 2 is 0; expected a quaternion$", "turned.csv", axes)
    refused("rows is 0; expected a table with a header$", "nothing.csv", "")
    no_text = tmp_path / "no_text.csv"
    no_text.write_bytes(b"x,y,z,r\n\xff")
    message = f"^{no_text}: table is .*; expected text in UTF-8, or in UTF-16"
    input_error(message, particle_files.read_particles, no_text)
    in_mm = pd.DataFrame(1e3 * centres, columns=["x", "y", "z"]).assign(r=5.0)
    refused("is the unit of lengths wrong", "mm.csv", in_mm.to_csv(index=False))
    cloud = np.random.default_rng(1).uniform(0, 1, (200, 3))
    refused("direction of gravity is 'unclear", "cloud.dump", dump_text(cloud))


def test_every_form_of_text_gives_the_same_particles(tmp_path):
    centres = cone()
    path = tmp_path / "pile.csv"
    rows = pd.DataFrame(centres, columns=["x", "y", "z"]).assign(radius=RADIUS)
    commas = rows.to_csv(index=False)
    semicolons = rows.to_csv(index=False, sep=";", decimal=",")
    headless = rows[["x", "y", "z"]].to_csv(
        index=False, header=False, sep=";", decimal=","
    )
    yade = rows.to_csv(index=False, header=False, sep="\t")
    for text, encoding in (
        (commas, "utf-8-sig"),
        (commas, "utf-16"),
        (dump_text(centres), "utf-8-sig"),
        (
            commas.replace("radius", "Größe µm,radius").replace("0.005\n", "1,0.005\n"),
            "utf-8",
        ),
        (f"# my pile; as poured\n{commas}", "utf-8"),
        (semicolons, "utf-8"),
        (f"#format x_y_z_r\n# my pile\n{yade}", "utf-8"),
        (headless, "utf-8"),
    ):
        path.write_text(text, encoding=encoding)
        assert particle_files.is_particle_file(path)
        radius = RADIUS if text is headless else None
        found = particle_files.read_particles(path, radius)
        np.testing.assert_allclose(found.centres, centres, atol=1e-6, err_msg=text[:60])
        np.testing.assert_allclose(found.semi_axes, RADIUS)


def test_faults_of_a_table_are_named_by_what_is_missing(tmp_path):
    path = tmp_path / "pile.csv"

    def refused(message, text, radius=None):
        path.write_text(text)
        return input_error(message, particle_files.read_particles, path, radius)

    refused(
        "header is 'missing'.*x,y,z,radius; .*line is 1 2 3 4$", "1 2 3 4\n5 6 7 8\n"
    )
    refused("header is 'missing'.*as x,y,z; .*line is 1,2,3,4$", "1,2,3,4\n", 1.0)
    refused("header is 'missing'.*line is 30$", "30\nP 1 2 3\n")
    refused("column x, row 1 is 'nan'; expected a finite", "x,y,z,r\nnan,0,0,1\n")
    steps = "time,id,x,y,z,r\n0,1,0,0,0,1\n1,1,0,0,1,1\n"
    refused("column id, row 2 is '1'; .*once, at a single time$", steps)
    sizes = "x,y,z,radius,diameter\n0,0,0,1,2\n3,0,0,1,1\n"
    refused("column diameter, row 2 is 1.0; expected twice column radius", sizes)
    packed = path.rename(tmp_path / "pile.dump.gz")
    assert particle_files.is_particle_file(packed)
    message = r"file is 'compressed \(gzip\)'; expected the unpacked file$"
    input_error(message, particle_files.read_particles, packed)


@pytest.mark.parametrize(
    ("column", "grains"), [("mol", [0, 1, 2, 2]), ("clump", [0, 0, 1, 1])]
)
def test_a_particle_outside_molecules_is_a_grain(tmp_path, column, grains):
    path = tmp_path / "pile.csv"
    path.write_text(f"x,y,z,r,{column}\n0,0,0,1,0\n3,0,0,1,0\n6,0,0,1,1\n7,0,0,1,1\n")
    assert particle_files.read_particles(path).grains.tolist() == grains


def test_a_plate_above_all_grains_is_refused():
    spheres = make_particles(cone())
    with pytest.raises(InputError, match=r"pile: base is 10\.0; expected a height"):
        measure_particles(spheres, SETTINGS, up="z", base=10.0, source="pile")


def test_the_command_writes_a_table_and_refuses_pictures_beside(
    written, tmp_path, command
):
    out = tmp_path / "measured"
    dump = written[0]
    text = command("measure", dump, written[1], "--grain-mm", 10, "--out", out).out
    table = pd.read_csv(out / "piles.csv")
    assert list(table["up"]) == ["z", "z"]
    # Without a study a grain has 32 pixels across, as in a study of a simulator.
    settings = MeasureSettings.with_defaults(
        mm_per_pixel=2e3 * RADIUS / 32, berry_height_mm=2e3 * RADIUS
    )
    expected = measure_particles(particle_files.read_particles(dump), settings)
    assert table["aor_deg"][0] == pytest.approx(expected.result.aor_deg)
    assert f"{dump}: {table['aor_deg'][0]:.2f} deg (whole side, columns)" in text
    error = command("measure", dump, "--unit", "inch", status=2).err
    assert "--unit is 'inch'; expected one of m, cm, mm" in error
    picture = tmp_path / "pile.png"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n\0\0")
    error = command("measure", dump, picture, status=2).err
    assert "only files of particles" in error


def test_positions_alone_take_a_given_radius(written, tmp_path):
    expected = measure_particles(particle_files.read_particles(written[1]), SETTINGS)
    rows = pd.DataFrame(cone())
    for separator, header in ((",", False), (";", False), (" ", ["x", "y", "z"])):
        path = tmp_path / "positions.csv"
        rows.to_csv(path, index=False, header=header, sep=separator)
        found = measure_particles(particle_files.read_particles(path, RADIUS), SETTINGS)
        assert found.n_particles == len(rows)
        assert found.result.aor_deg == pytest.approx(expected.result.aor_deg)
        with pytest.raises(InputError):
            particle_files.read_particles(path)
    with pytest.raises(InputError, match="column Diameter is 'found'; expected no"):
        particle_files.read_particles(written[1], RADIUS)


def test_the_command_puts_piles_beside_the_runs_of_a_design(tmp_path, command):
    runs = tmp_path / "samples.csv"
    runs.write_text("sample,run,friction\n1,1,0.3\n2,1,0.4\n")
    pile = tmp_path / "2_1.csv"
    pd.DataFrame(cone()).to_csv(pile, index=False, header=False)
    given = ("--radius", RADIUS, "--runs", runs, "--out", tmp_path)
    command("measure", pile, *given)
    piles = pd.read_csv(tmp_path / "piles.csv")
    results = pd.read_csv(tmp_path / "results.csv")
    assert list(results) == ["sample", "run", "friction", "aor_deg", "height_mm"]
    assert list(results["friction"]) == [0.3, 0.4]
    assert results["aor_deg"].isna().tolist() == [True, False]
    for response in ("aor_deg", "height_mm"):
        assert results[response][1] == piles[response][0]
    command("measure", pile, *given, "--bench", "lifted_cylinder")
    lifted = pd.read_csv(tmp_path / "results.csv")
    assert lifted["lifted_aor_deg"][1] == results["aor_deg"][1]
    assert lifted["lifted_height_mm"][1] == results["height_mm"][1]
    error = command("measure", pile, *given, "--bench", "drum", status=2).err
    assert (
        "--bench is 'drum'; expected one of the bench tests that leave a pile: funnel"
        in error
    )
    other = pile.rename(tmp_path / "9_1.csv")
    error = command("measure", other, *given, status=2).err
    assert f"expected a row for {other}; the name of a file gives its sample" in error
    error = command("measure", other, "--radius", 0, status=2).err
    assert "--radius is 0.0; expected above 0" in error


def test_a_direction_may_begin_with_a_dash(tmp_path, command):
    pile = tmp_path / "pile.csv"
    centres = cone() * [1, 1, -1]
    pd.DataFrame(centres, columns=["x", "y", "z"]).assign(r=RADIUS).to_csv(pile)
    given = ("--out", tmp_path / "measured", "--grain-mm", 10)
    assert "up is -z" in command("measure", pile, "--up", "-z", *given).out
    assert "up is -z" in command("measure", pile, "--up=-z", *given).out

"""Checkpoints: the same bits as never having stopped, and clear words about files that cannot be gone on from."""

import functools
import itertools
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from dem.clump_scenes import LAW, ball_of_one, bent
from dem.common import GOJI, bits, mesh_of
from refusals import input_error, not_refused, raised

from repose.common.errors import InputError
from repose.dem import Contact, Cylinder, Material, Motion, Plane, Shape, Simulation
from repose.dem.kernels import state as st


def falling(kind="berries", **laws):
    """60 berries and balls above a floor that rises, in a tube; or 30 clumps, also with a block that rises and turns.

    They have two shapes, sizes and materials, and their lists have to grow.
    """
    clumps = kind != "berries"
    rising = (0.0, 0.0, 0.5)
    floor = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall", motion=Motion(rising))
    walls = {
        "floor": floor,
        "tube": Cylinder((0, 0, -0.1), (0, 0, 1), 0.5, 0.04, "wall"),
    }
    if clumps:
        shapes = {"bent": bent(), "ball": ball_of_one(0.005, "clay")}
    else:
        shapes = {
            "berry": Shape.ellipsoid((0.0106, 0.0057, 0.0049), 840.0, "body"),
            "ball": Shape.sphere(0.006, 1200.0, "clay"),
        }
    if kind == "clumps and a block":
        walls["block"] = mesh_of(
            trimesh.creation.box((0.02, 0.02, 0.02)),
            1e-3,
            motion=Motion(rising, (0, 0, 20)),
        )
    materials = {"body": GOJI, "clay": Material(1e5, 0.3), "wall": Material(1e7, 0.3)}
    constants = {"surface_energy_j_m2": 0.05} if laws else {}
    if clumps:
        laws = {"contact_law": LAW}
    pairs = itertools.combinations_with_replacement(materials, 2)
    contacts = {
        pair: Contact(0.3, 0.5, 0.02, constants=constants)
        for pair in pairs
        if pair != ("wall", "wall")
    }
    count = 30 if clumps else 60
    room = {
        "lower": (-0.04, -0.04, 0.0),
        "upper": (0.04, 0.04, 0.25),
        "capacity": count + 1,
        "largest_scale": 1.2,
        "floor_height_m": -0.05,
    }
    simulation = Simulation(
        shapes, materials, contacts, 1e-4, walls=walls, **room, **laws
    )
    rng = np.random.default_rng(3)
    for k in range(count):
        layer, place = divmod(k, 4)
        x, y = 0.016 * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)][place])
        place = (x, y, 0.024 + 0.024 * layer)
        turn = rng.normal(size=4)
        velocity = rng.normal(0, 0.2, 3)
        name = [*shapes][k % 3 == 0]
        scale = rng.uniform(0.9, 1.2)
        simulation.add(name, place, turn, velocity_m_s=velocity, scale=scale)
    return simulation


@pytest.fixture(scope="module")
def saved_of(tmp_path_factory):
    """For a scene of `falling`: a checkpoint on the way, and the bits at the end of a run without a stop."""

    @functools.cache
    def save(kind, **laws):
        path = tmp_path_factory.mktemp("checkpoint") / "half.npz"
        simulation = falling(kind, **laws)
        simulation.run_steps(1500)
        simulation.save(path)
        assert len(simulation.contacts()) > 10
        if kind != "berries":
            assert simulation.counts[st.N_CURVED] > 0
        if kind == "clumps and a block":
            assert simulation.counts[st.N_MESHED] > 0
        simulation.run_steps(500)
        return path, bits(simulation)

    return save


@pytest.fixture
def saved(saved_of):
    return saved_of("berries")


ESSENTIAL = (pytest.mark.slow, pytest.mark.essential)
BLOCK = pytest.param("clumps and a block", {}, id="block", marks=ESSENTIAL)
COHESIVE = pytest.param(
    "berries", {"contact_law": "jkr"}, id="cohesive", marks=pytest.mark.slow
)


@pytest.mark.parametrize(
    ("kind", "laws"), [("berries", {}), ("clumps", {}), BLOCK, COHESIVE]
)
def test_going_on_from_a_checkpoint_gives_the_same_bits_also_in_a_fresh_process(
    saved_of, kind, laws
):
    path, expected = saved_of(kind, **laws)
    simulation = Simulation.load(path)
    assert simulation.steps == 1500
    aligned = (simulation.bodies.rows, simulation.bodies.motion, simulation.pairs.data)
    assert all(array.ctypes.data % 64 == 0 for array in aligned)
    simulation.run_steps(500)
    assert bits(simulation) == expected
    # bodies can still be added, each with its shape
    simulation.add("ball", (0.0, 0.0, 0.4))
    assert simulation.shape_ids[-1] == 1
    code = "import sys; sys.path[:0] = [sys.argv[2]]; from dem.common import bits; from repose.dem import Simulation\n"
    code += "one = Simulation.load(sys.argv[1]); one.run_steps(500); sys.stdout.buffer.write(bits(one))\n"
    tests = str(Path(__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", code, str(path), tests], capture_output=True, check=True
    )
    assert done.stdout == expected


FEW_SPHERES = {"SPHERE_CONTACTS_PER_BODY": 1, "MOST_NEW": 0, "NEAR_PER_BODY": -7}


@pytest.mark.parametrize(
    ("kind", "room"),
    [
        ("berries", {"CONTACTS_PER_BODY": 0, "NEAR_PER_BODY": -4}),
        ("clumps", FEW_SPHERES),
        pytest.param("clumps and a block", FEW_SPHERES, marks=ESSENTIAL),
    ],
    ids=["berries", "clumps", "block"],
)
def test_lists_that_have_grown_are_saved_whole(
    saved_of, kind, room, tmp_path, monkeypatch
):
    _path, expected = saved_of(kind)
    for name, number in room.items():
        monkeypatch.setattr(f"repose.dem.contact_lists.{name}", number)
    simulation = falling(kind)
    before = len(simulation.pairs.first), len(simulation.pairs.near_limit)
    simulation.run_steps(1500)
    assert len(simulation.pairs.near_limit) > before[1]
    simulation.save(tmp_path / "grown.npz")
    loaded = Simulation.load(tmp_path / "grown.npz")
    assert len(loaded.pairs.near_limit) == len(simulation.pairs.near_limit)
    assert loaded.pairs.data.ctypes.data % 64 == 0
    loaded.run_steps(500)
    assert len(loaded.pairs.first) > before[0]
    assert bits(loaded) == expected


def test_chunks_records_and_checkpoints_do_not_change_the_bits(saved, tmp_path):
    _path, expected = saved
    simulation = falling()
    times = []
    path = tmp_path / "on_the_way.npz"
    recorded = {"record": lambda s: times.append(s.time_s), "record_every_s": 0.03}
    simulation.run(0.15, progress=False, checkpoint=path, every_s=0.01, **recorded)
    np.testing.assert_allclose(times, [0.0, 0.03, 0.06, 0.09, 0.12, 0.15])
    assert Simulation.load(path).steps == 1500
    simulation.run(0.05, progress=times.append)
    assert times[-1] == pytest.approx(0.2)
    assert bits(simulation) == expected


def test_an_interrupt_leaves_a_checkpoint_to_go_on_from(saved, tmp_path):
    _path, expected = saved
    path = tmp_path / "interrupted.npz"

    def interrupt(running):
        if running.steps > 0:
            raise KeyboardInterrupt

    raised(
        KeyboardInterrupt,
        None,
        falling().run,
        0.2,
        False,
        record=interrupt,
        record_every_s=0.06,
        checkpoint=path,
    )
    loaded = Simulation.load(path)
    assert loaded.steps == 600
    loaded.run_steps(1400)
    assert bits(loaded) == expected
    assert os.listdir(tmp_path) == ["interrupted.npz"]


def rewritten(path, target, **changes):
    """A copy of a checkpoint with other entries in its description."""
    with np.load(path) as store:
        arrays = dict(store)
    description = json.loads(arrays["about"].tobytes()) | changes
    arrays["about"] = np.frombuffer(json.dumps(description).encode(), np.uint8)
    with open(target, "wb") as handle:
        np.savez(handle, **arrays)
    return target


def test_the_file_holds_no_pickle_a_readable_description_and_no_flipped_bit(
    saved, tmp_path
):
    with np.load(saved[0], allow_pickle=False) as store:
        description = json.loads(store["about"].tobytes())
        assert all(store[name].dtype != object for name in store.files)
    assert description["shapes"]["ball"]["semi_axes_m"] == [[0.006, 0.006, 0.006]]
    assert description["walls"]["floor"][1]["motion"]["velocity_m_s"] == [0.0, 0.0, 0.5]
    content = bytearray(saved[0].read_bytes())
    with zipfile.ZipFile(saved[0]) as store:
        largest = max(store.infolist(), key=lambda member: member.compress_size)
    content[largest.header_offset + largest.compress_size // 2] ^= 1
    target = tmp_path / "flipped.npz"
    target.write_bytes(content)
    input_error(r"flipped\.npz: checkpoint is ", Simulation.load, target)


def test_a_file_that_cannot_be_gone_on_from_is_named(saved, tmp_path):
    def load(case):
        number, damage = case
        target = tmp_path / f"bad_{number}.npz"
        damage(saved[0], target)
        Simulation.load(target)

    cases = [
        (lambda path, to: to, "file is None; expected an existing checkpoint"),
        (
            lambda path, to: to.write_bytes(path.read_bytes()[:-900]),
            "checkpoint is .*a whole file",
        ),
        (
            lambda path, to: to.write_bytes(b"no archive at all"),
            "checkpoint is .*a whole file",
        ),
        (lambda path, to: rewritten(path, to, format=99), "format is 99; expected 1"),
        (
            lambda path, to: rewritten(path, to, engine="0123"),
            "engine sources is '0123'; expected '",
        ),
        (lambda path, to: rewritten(path, to, walls={}), "content is .*a whole file"),
    ]
    wrong = [
        ((k, damage), rf"bad_{k}\.npz.*{message}")
        for k, (damage, message) in enumerate(cases)
    ]
    assert not not_refused(load, wrong, InputError)

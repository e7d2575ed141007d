"""Checkpoints: the same bits as never having stopped, and clear words about files that cannot be gone on from."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from dem.common import bits
from refusals import input_error, not_refused

from repose.core.errors import InputError
from repose.dem import Contact, Cylinder, Material, Motion, Plane, Shape, Simulation


def falling_berries():
    """60 bodies of two shapes, sizes and materials above a floor that rises, in a tube; lists that have to grow."""
    floor = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "steel", motion=Motion((0.0, 0.0, 0.5)))
    walls = {"floor": floor, "tube": Cylinder((0, 0, -0.1), (0, 0, 1), 0.5, 0.04, "steel")}
    shapes = {"berry": Shape.ellipsoid((0.0106, 0.0057, 0.0049), 840.0, "berry")}
    shapes |= {"ball": Shape.sphere(0.006, 1200.0, "clay")}
    materials = {"berry": Material(4.3e4, 0.32), "clay": Material(1e5, 0.3), "steel": Material(1e7, 0.3)}
    pairs = [("berry", "berry"), ("berry", "clay"), ("clay", "clay"), ("berry", "steel"), ("clay", "steel")]
    room = {"capacity": 61, "lower": (-0.04, -0.04, 0.0), "upper": (0.04, 0.04, 0.25), "floor_height_m": -0.05}
    contacts = {pair: Contact(0.3, 0.5, 0.02) for pair in pairs}
    simulation = Simulation(shapes, materials, contacts, 1e-4, walls=walls, largest_scale=1.2, **room)
    rng = np.random.default_rng(3)
    for k in range(60):
        layer, place = divmod(k, 4)
        x, y = 0.016 * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)][place])
        place, turn, velocity = (x, y, 0.02 + 0.024 * layer), rng.normal(size=4), rng.normal(0, 0.2, 3)
        name, scale = ("berry", "ball")[k % 3 == 0], rng.uniform(0.9, 1.2)
        simulation.add(name, place, turn, velocity_m_s=velocity, scale=scale)
    return simulation


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A checkpoint on the way, and the bits at the end of a run without a stop."""
    path = tmp_path_factory.mktemp("checkpoint") / "half.npz"
    simulation = falling_berries()
    simulation.run_steps(1200)
    simulation.save(path)
    assert len(simulation.contacts()) > 10
    simulation.run_steps(800)
    return path, bits(simulation)


def test_going_on_from_a_checkpoint_gives_the_same_bits_also_in_a_fresh_process(saved):
    path, expected = saved
    simulation = Simulation.load(path)
    assert simulation.steps == 1200
    aligned = (simulation.bodies.rows, simulation.bodies.motion, simulation.pairs.data)
    assert all(array.ctypes.data % 64 == 0 for array in aligned)
    simulation.run_steps(800)
    assert bits(simulation) == expected
    # and bodies can still be added, each with its shape
    simulation.add("ball", (0.0, 0.0, 0.4))
    assert simulation.shape_ids[-1] == 1
    path, expected = saved
    code = (
        "import sys; sys.path[:0] = [sys.argv[2]]\n"
        "from dem.common import bits\n"
        "from repose.dem import Simulation\n"
        "simulation = Simulation.load(sys.argv[1]); simulation.run_steps(800)\n"
        "sys.stdout.buffer.write(bits(simulation))\n"
    )
    tests = str(Path(__file__).parents[1])
    done = subprocess.run([sys.executable, "-c", code, str(path), tests], capture_output=True, check=True)
    assert done.stdout == expected


def test_lists_that_have_grown_are_saved_whole(saved, tmp_path, monkeypatch):
    _path, expected = saved
    monkeypatch.setattr("repose.dem.contact_lists.CONTACTS_PER_BODY", 0)
    monkeypatch.setattr("repose.dem.contact_lists.NEAR_PER_BODY", -4)
    simulation = falling_berries()
    room = len(simulation.pairs.near_limit)
    simulation.run_steps(1500)
    assert len(simulation.pairs.near_limit) > room
    simulation.save(tmp_path / "grown.npz")
    loaded = Simulation.load(tmp_path / "grown.npz")
    assert len(loaded.pairs.near_limit) == len(simulation.pairs.near_limit)
    assert loaded.pairs.data.ctypes.data % 64 == 0
    loaded.run_steps(500)
    assert bits(loaded) == expected


def test_chunks_records_and_checkpoints_do_not_change_the_bits(saved, tmp_path):
    _path, expected = saved
    simulation = falling_berries()
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

    simulation = falling_berries()
    with pytest.raises(KeyboardInterrupt):
        simulation.run(0.2, False, record=interrupt, record_every_s=0.06, checkpoint=path)
    loaded = Simulation.load(path)
    assert loaded.steps == 600
    loaded.run_steps(1400)
    assert bits(loaded) == expected
    assert os.listdir(tmp_path) == ["interrupted.npz"]


def rewritten(path, target, **changes):
    """A copy of a checkpoint with other entries in its description."""
    with np.load(path) as store:
        arrays = dict(store)
    about = json.loads(arrays["about"].tobytes()) | changes
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    with open(target, "wb") as handle:
        np.savez(handle, **arrays)
    return target


def test_the_file_holds_no_pickle_a_readable_description_and_no_flipped_bit(saved, tmp_path):
    with np.load(saved[0], allow_pickle=False) as store:
        about = json.loads(store["about"].tobytes())
        assert all(store[name].dtype != object for name in store.files)
    assert about["shapes"]["ball"]["semi_axes_m"] == [[0.006, 0.006, 0.006]]
    assert about["walls"]["floor"][1]["motion"]["velocity_m_s"] == [0.0, 0.0, 0.5]
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
        (lambda path, to: to.write_bytes(path.read_bytes()[:-900]), "checkpoint is .*a whole file"),
        (lambda path, to: to.write_bytes(b"no archive at all"), "checkpoint is .*a whole file"),
        (lambda path, to: rewritten(path, to, format=99), "format is 99; expected 1"),
        (lambda path, to: rewritten(path, to, engine="0123"), "engine sources is '0123'; expected '"),
        (lambda path, to: rewritten(path, to, walls={}), "content is .*a whole file"),
    ]
    wrong = [((k, damage), rf"bad_{k}\.npz.*{words}") for k, (damage, words) in enumerate(cases)]
    assert not not_refused(load, wrong, InputError)

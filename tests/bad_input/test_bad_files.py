"""Measured tables, berries, particles, meshes and pictures with something wrong in them."""

import json
import math

import numpy as np
import pytest
from refusals import input_error
from shared import ROOT, check_all, written

from repose.common import files, reading, tables
from repose.common.errors import InputError
from repose.grain import berry_files
from repose.grain.mesh import load_mesh
from repose.grain.particle import Particle
from repose.measure.pile import read_image

SIZES = "long_mm,major_mm,minor_mm\n21,11,10\n22,12,11\n"


def raises(read, path, content, *more):
    fault = input_error("; expected ", read, written(path, content), *more)
    assert str(path) in str(fault)
    return fault


def test_another_encoding_is_reported_and_a_mark_of_the_byte_order_is_fine(tmp_path):
    for encoding in ("utf-32", "utf-16-le"):
        table = SIZES.encode(encoding)
        raises(berry_files.read_sizes, tmp_path / "a.csv", table)
        for read in (files.read_table, tables.read_sheet, files.read_json):
            raises(read, tmp_path / "a.csv", table, ("long_mm",))
    path = written(tmp_path / "a", b"\xef\xbb\xbf" + SIZES.encode())
    assert (
        len(berry_files.read_sizes(path))
        == len(files.read_table(path, ("long_mm",)))
        == 2
    )
    assert tables.read_sheet(path).text["long_mm"][1] == "22"
    path.write_bytes(b'\xef\xbb\xbf{"a": 1}')
    assert files.read_json(path) == {"a": 1}


BERRY = json.loads((ROOT / "results/published/goji_berry/berry/berry.json").read_text())
PARTICLE = json.loads(
    (ROOT / "results/published/goji_berry/berry/particle.json").read_text()
)
for description in BERRY, PARTICLE:
    description.pop("provenance")  # where it comes from, not what it is
BAD = ("text", None, [], {}, math.nan, math.inf, -1, 0, True, [1], "1")


def test_every_key_of_a_berry_and_a_particle_is_checked(tmp_path):
    def check(read, record, key):
        assert raises(read, tmp_path / "a.json", json.dumps(record)).key == key

    cases = []

    def add(read, record, key):
        value = record.get(key, "missing")
        cases.append((f"{read.__name__} {key} {value!r}", read, record, key))

    for key in (*berry_files.SIZE_COLUMNS, "density_kg_m3", "shear_modulus_pa"):
        for value in BAD:
            add(berry_files.read_grain, BERRY | {key: value}, key)
    for key in berry_files.LARGEST_VALUES:
        for value in BAD:
            if value != 0:
                add(berry_files.read_grain, BERRY | {key: value}, key)
    for key in PARTICLE:
        if key in ("kind", "stl"):
            continue
        for value in ("text", {}, math.nan, -1, [1, "a"], [[1]], [math.inf] * 3, True):
            add(Particle.load, PARTICLE | {key: value}, key)
    for key in PARTICLE:
        without_key = {name: PARTICLE[name] for name in PARTICLE if name != key}
        add(Particle.load, without_key, key)
    check_all(check, cases)


@pytest.mark.parametrize("key", berry_files.MODULI)
def test_a_simulation_needs_the_moduli_of_its_berry(refused, tmp_path, key):
    path = tmp_path / "berry.json"
    path.write_text(json.dumps({name: BERRY[name] for name in BERRY if name != key}))
    assert f"berry.json: {key} is None" in refused("pour", f"--berry={path}")


def test_a_file_that_was_cut(tmp_path):
    import trimesh

    whole = {
        "berry.json": (berry_files.read_grain, json.dumps(BERRY).encode()),
        "particle.json": (Particle.load, json.dumps(PARTICLE).encode()),
        "a.stl": (
            load_mesh,
            trimesh.creation.box((20.0, 11.0, 10.0)).export(file_type="stl"),
        ),
    }
    rng = np.random.default_rng(1)
    files.write_npz(tmp_path / "a.npz", {"position_1": rng.normal(size=(50, 3))})
    files.write_image(
        tmp_path / "a.png", rng.integers(0, 255, (60, 60), dtype=np.uint8)
    )
    for name, read in (("a.npz", files.read_npz), ("a.png", read_image)):
        whole[name] = (read, (tmp_path / name).read_bytes())

    def check(name, share):
        read, content = whole[name]
        if name == "a.png":
            share *= 0.5  # a picture that lacks only its end is read as far as it goes
        raises(read, tmp_path / name, content[: int(share * len(content))])

    shares = (0.0, 0.01, 0.2, 0.5, 0.9, 0.99)
    check_all(
        check, [(f"{name} {share}", name, share) for name in whole for share in shares]
    )


def test_a_reader_reads_any_bytes_and_text_or_reports_what_is_wrong(tmp_path):
    from hypothesis import HealthCheck, given, settings  # here, as it takes long
    from hypothesis import strategies as st

    readers = {
        "a.csv": (
            files.read_table,
            tables.read_sheet,
            berry_files.read_sizes,
            berry_files.read_compression,
        ),
        "a.json": (files.read_json, berry_files.read_grain, Particle.load),
        "a.npz": (files.read_npz,),
        "a.stl": (load_mesh,),
        "a.png": (read_image,),
        "a.yaml": (reading.read_yaml,),
    }
    text = st.text(
        alphabet='ab1.,;"\n\r \t-#é[]{}:&*!?|>%@`\x00\ufeff', max_size=60
    ).map(str.encode)

    @settings(
        max_examples=240,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        derandomize=True,
    )
    @given(
        content=st.one_of(st.binary(max_size=300), text),
        name=st.sampled_from(list(readers)),
    )
    def check(content, name):
        path = written(tmp_path / name, content)
        for read in readers[name]:
            message = str(path)
            try:
                read(path)
            except InputError as error:
                message = str(error)
            assert str(path) in message

    check()


@pytest.mark.parametrize(
    ("value", "allowed", "guess"),
    [
        ("sequental", "published or refined or sequential", "sequential"),
        ("figure1", "one of figure13, drum", "figure13"),
        ("random1", "one of random, lying", "random"),
        ("text{1}", "text, without braces", ""),
        (3, "one of a3, b3", ""),
        ("at least", "at least 1, or none", ""),
        ("xyzzy", "one of random, lying", ""),
        ("text{1}", "text", ""),
    ],
)
def test_a_wrong_name_has_a_guess_among_the_names_that_are_allowed(
    value, allowed, guess
):
    message = str(InputError("mine.yaml", "key", value, allowed))
    expected = f"mine.yaml: key is {value!r}; expected {allowed}{f'; did you mean {guess}?' if guess else ''}"
    assert message == expected

"""Measured tables, berries, particles, meshes and pictures with something wrong in them."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from repose.core import files
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.core.published import check_published
from repose.measure.pile import read_image
from repose.particle import berry_files
from repose.particle.mesh import load_mesh
from repose.particle.particle import Particle

ROOT = Path(__file__).parents[2]
SIZES = "long_mm,major_mm,minor_mm\n21,11,10\n22,12,11\n"
TESTS = ",".join(berry_files.COMPRESSION_COLUMNS) + "\n1,5,21,21.5,10,9,11\n2,6,22,22.4,10,9,11\n"
NO_NUMBERS = (
    "",
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "many",
    "1,5",
    "0x10",
    "1e999",
    "²",
    "1 2",
    "None",
    "TRUE",
    "'1'",
)


def raises(read, path, content, *more):
    """The fault of a file with this content."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        read(path, *more)
    assert str(path) in str(caught.value)
    assert "; allowed: " in str(caught.value)
    return caught.value


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize(("column", "row"), [(0, 1), (1, 2), (2, 1)])
def test_a_size_that_is_none(value, column, row, tmp_path):
    cells = [line.split(",") for line in SIZES.splitlines()]
    cells[row][column] = value
    raises(berry_files.read_sizes, tmp_path / "a.csv", "\n".join(map(",".join, cells)))


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize("column", range(7))
def test_a_compression_test_with_a_value_that_is_none(value, column, tmp_path):
    cells = [line.split(",") for line in TESTS.splitlines()]
    cells[2][column] = value
    raises(berry_files.read_compression, tmp_path / "a.csv", "\n".join(map(",".join, cells)))


TABLES = {
    "empty": "",
    "blank lines": "\n\n\n",
    "only a header": "{header}\n",
    "no header": "{rows}",
    "a column twice": "{header},long_mm\n",
    "a cell too many": "{header}\n{row},1\n",
    "a cell too few": "{header}\n1,2\n",
    "cut": "{header}\n{row}\n1",
    "semicolons": "{semicolons}",
    "tabs": "{tabs}",
    "zero bytes": "{header}\n\0\0\n",
    "json": '{{"a": 1}}',
    "xml": "<table><tr><td>1</td></tr></table>",
    "quotes that do not end": '{header}\n"1,2,3\n',
}


@pytest.mark.parametrize("wrong", TABLES)
@pytest.mark.parametrize(
    ("read", "text"),
    [
        (berry_files.read_sizes, SIZES),
        (berry_files.read_compression, TESTS),
        (
            lambda path: check_published(path, ()),
            "solution," + ",".join(PARAMETERS) + "\n1,.2,.5,.04,.2,.5,.2\n",
        ),
    ],
    ids=["sizes", "compression", "published"],
)
def test_a_table_that_is_none(read, text, wrong, tmp_path):
    header, *rows = text.splitlines()
    filled = TABLES[wrong].format(
        header=header,
        row=rows[0],
        rows="\n".join(rows),
        semicolons=text.replace(",", ";"),
        tabs=text.replace(",", "\t"),
    )
    raises(read, tmp_path / "a.csv", filled)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32", "utf-16-le"])
@pytest.mark.parametrize("read", [berry_files.read_sizes, files.read_table, files.read_rows, files.read_json])
def test_another_encoding_is_told(read, encoding, tmp_path):
    raises(
        read,
        tmp_path / "a.csv",
        SIZES.encode(encoding),
        *([("long_mm",)] if read is not berry_files.read_sizes else []),
    )


def test_a_mark_of_the_byte_order_is_fine_everywhere(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"\xef\xbb\xbf" + SIZES.encode())
    assert len(berry_files.read_sizes(path)) == len(files.read_table(path, ("long_mm",))) == 2
    assert files.read_rows(path, ("long_mm",))[1]["long_mm"] == "22"
    path.write_bytes(b'\xef\xbb\xbf{"a": 1}')
    assert files.read_json(path) == {"a": 1}


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("value", ["", "nan", "inf", "-1", "abc", "5e400"])
def test_a_published_parameter_that_is_none(name, value, tmp_path):
    row = dict.fromkeys(PARAMETERS, "0.3") | {name: value}
    text = "solution," + ",".join(row) + "\n1," + ",".join(row.values()) + "\n"
    told = raises(lambda path: check_published(path, ()), tmp_path / "a.csv", text)
    assert told.key == name
    assert "row 1" in str(told)


BERRY = json.loads((ROOT / "results/published/recommended/berry/berry.json").read_text())
PARTICLE = json.loads((ROOT / "results/published/recommended/berry/particle.json").read_text())
for about in BERRY, PARTICLE:
    about.pop("provenance")  # where it comes from, not what it is
BAD = ("text", None, [], {}, math.nan, math.inf, -1, 0, True, [1], "1")


@pytest.mark.parametrize("value", BAD, ids=repr)
@pytest.mark.parametrize("key", [*berry_files.SIZE_COLUMNS, "density_kg_m3", "shear_modulus_pa"])
def test_a_berry_with_a_value_that_is_none(key, value, tmp_path):
    told = raises(berry_files.read_berry, tmp_path / "berry.json", json.dumps(BERRY | {key: value}))
    assert told.key == key


NUMBERS = [key for key in PARTICLE if key not in ("kind", "stl")]


@pytest.mark.parametrize("key", NUMBERS)
@pytest.mark.parametrize("value", ["text", {}, math.nan, -1, [1, "a"], [[1]], [math.inf] * 3, True], ids=repr)
def test_a_particle_with_a_value_that_is_none(key, value, tmp_path):
    told = raises(Particle.load, tmp_path / "particle.json", json.dumps(PARTICLE | {key: value}))
    assert told.key == key


@pytest.mark.parametrize("key", list(PARTICLE))
def test_a_particle_without_a_key(key, tmp_path):
    record = {name: value for name, value in PARTICLE.items() if name != key}
    assert raises(Particle.load, tmp_path / "particle.json", json.dumps(record)).key == key


@pytest.mark.parametrize("share", [0.0, 0.01, 0.2, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("kind", ["berry.json", "particle.json", "a.npz", "a.png", "a.stl"])
def test_a_file_that_was_cut(kind, share, tmp_path):
    path = tmp_path / kind
    if kind == "a.npz":
        files.write_npz(path, {"position_1": np.random.default_rng(1).normal(size=(50, 3))})
        read = files.read_npz
    elif kind == "a.png":
        files.write_image(path, np.random.default_rng(1).integers(0, 255, (60, 60), dtype=np.uint8))
        read = read_image
    elif kind == "a.stl":
        path.write_bytes(_cube())
        read = load_mesh
    else:
        path.write_text(json.dumps(BERRY if kind == "berry.json" else PARTICLE))
        read = berry_files.read_berry if kind == "berry.json" else Particle.load
    content = path.read_bytes()
    if kind == "a.png":
        share *= 0.5  # a picture that lacks only its end is read as far as it goes
    path.unlink()
    raises(read, path, content[: int(share * len(content))])


def _cube():
    """A closed mesh as binary STL."""
    import trimesh

    return trimesh.creation.box((20.0, 11.0, 10.0)).export(file_type="stl")


def answer(read, path):
    """What a reader says of a file: the sentence of its fault, or the file's name."""
    try:
        read(path)
    except InputError as error:
        return str(error)
    return str(path)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(
    content=st.binary(max_size=300),
    name=st.sampled_from(["a.csv", "a.json", "a.npz", "a.stl", "a.png", "a.yaml"]),
)
def test_readers_take_any_bytes_or_tell_what_is_wrong(tmp_path, content, name):
    from repose.config import reading

    path = tmp_path / name
    path.write_bytes(content)
    readers = {
        "a.csv": (files.read_table, files.read_rows, berry_files.read_sizes, berry_files.read_compression),
        "a.json": (files.read_json, berry_files.read_berry, Particle.load),
        "a.npz": (files.read_npz,),
        "a.stl": (load_mesh,),
        "a.png": (read_image,),
        "a.yaml": (reading.read,),
    }
    for read in readers[name]:
        assert str(path) in answer(read, path)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(text=st.text(alphabet='ab1.,;"\n\r \t-#é[]{}:&*!?|>%@`\x00\ufeff', max_size=60))
def test_readers_of_text_take_any_text_or_tell_what_is_wrong(tmp_path, text):
    from repose.config import reading

    path = tmp_path / "a"
    path.write_bytes(text.encode())
    for read in (files.read_table, files.read_rows, files.read_json, berry_files.read_sizes, reading.read):
        assert str(path) in answer(read, path)

"""Measured tables, berries, particles, meshes and pictures with something wrong in them."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from refusals import input_error
from shared import check_all

from repose.config import reading
from repose.core import files, tables
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.core.published import check_published
from repose.measure.pile import read_image
from repose.particle import berry, berry_files
from repose.particle.mesh import load_mesh
from repose.particle.particle import Particle

ROOT = Path(__file__).parents[2]
SIZES = "long_mm,major_mm,minor_mm\n21,11,10\n22,12,11\n"
TESTS = ",".join(berry_files.COMPRESSION_COLUMNS) + "\n1,5,21,21.5,10,9,11\n2,6,22,22.4,10,9,11\n"
NO_NUMBERS = ("", "nan", "inf", "-inf", "-1", "0", "many", "1,5", "0x10", "1e999", "²", "1 2", "None", "TRUE", "'1'")


def raises(read, path, content, *more):
    """The fault of a file with this content."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        read(path, *more)
    assert str(path) in str(caught.value)
    assert "; expected " in str(caught.value)
    return caught.value


def test_every_cell_of_a_table_is_a_number(tmp_path):
    def check(read, text, row, column, value):
        cells = [line.split(",") for line in text.splitlines()]
        cells[row][column] = value
        fault = str(raises(read, tmp_path / "a.csv", "\n".join(map(",".join, cells))))
        # a comma makes another cell of it
        assert f"row {row}: {'cells' if ',' in value else cells[0][column]} is" in fault

    places = [(berry_files.read_sizes, SIZES, row, column) for row, column in ((1, 0), (2, 1), (1, 2))]
    places += [(berry_files.read_compression, TESTS, 2, column) for column in range(7)]
    cases = [(*place, value) for place in places for value in NO_NUMBERS]
    check_all(check, [(f"{case[0].__name__} {case[2:]}", *case) for case in cases])


def test_tables_in_another_unit_are_blamed_on_themselves(tmp_path):
    header, *rows = SIZES.split()

    def fault(sizes):
        return str(raises(berry_files.read_sizes, tmp_path / "a.csv", "\n".join([header, *sizes])))

    in_m = ["0.021,0.011,0.01", "0.022,0.012,0.011"]
    assert "long_mm is 0.0215; expected a median from 0.5 to 2000" in fault(in_m)
    assert "row 4: long_mm is 0.021; expected within a factor of 5 of the median" in fault([*rows, rows[0], in_m[0]])
    sizes, tests = tmp_path / "a.csv", tmp_path / "tests.csv"
    sizes.write_text(SIZES)
    tests.write_text(TESTS)
    berry.of_files(sizes, tests, None, 840.0)
    tests.write_text(TESTS.replace("10,9,11", "0.01,0.009,0.011"))
    input_error(r"tests\.csv: width_1_mm is .* near that of minor_mm", berry.of_files, sizes, tests, None, 840.0)


TABLES = {
    "empty": "", "blank lines": "\n\n\n", "only a header": "{header}\n", "no header": "{rows}",
    "a column twice": "{header},long_mm\n", "a cell too many": "{header}\n{row},1\n",
    "a cell too few": "{header}\n1,2\n", "cut": "{header}\n{row}\n1",
    "zero bytes": "{header}\n\0\0\n", "json": '{{"a": 1}}', "xml": "<table><tr><td>1</td></tr></table>",
    "quotes that do not end": '{header}\n"1,2,3\n',
}  # fmt: skip
PUBLISHED = "solution," + ",".join(PARAMETERS) + "\n1,.2,.5,.04,.2,.5,.2\n"


def test_a_file_that_is_no_table(tmp_path):
    def check(read, text, wrong):
        header, *rows = text.splitlines()
        filled = TABLES[wrong].format(header=header, row=rows[0], rows="\n".join(rows))
        raises(read, tmp_path / "a.csv", filled)

    kinds = ((berry_files.read_sizes, SIZES), (berry_files.read_compression, TESTS), (check_published, PUBLISHED))
    cases = [(read, text, wrong) for read, text in kinds for wrong in TABLES]
    check_all(check, [(f"{read.__name__} {wrong}", read, text, wrong) for read, text, wrong in cases])


def test_another_encoding_is_reported_and_a_mark_of_the_byte_order_is_fine(tmp_path):
    for encoding in ("utf-32", "utf-16-le"):
        table = SIZES.encode(encoding)
        raises(berry_files.read_sizes, tmp_path / "a.csv", table)
        for read in (files.read_table, tables.sheet, files.read_json):
            raises(read, tmp_path / "a.csv", table, ("long_mm",))
    path = tmp_path / "a"
    path.write_bytes(b"\xef\xbb\xbf" + SIZES.encode())
    assert len(berry_files.read_sizes(path)) == len(files.read_table(path, ("long_mm",))) == 2
    assert tables.sheet(path).text["long_mm"][1] == "22"
    path.write_bytes(b'\xef\xbb\xbf{"a": 1}')
    assert files.read_json(path) == {"a": 1}


def test_every_published_parameter_is_a_number(tmp_path):
    for name in PARAMETERS:
        for value in ("", "nan", "inf", "-1", "abc", "5e400"):
            row = dict.fromkeys(PARAMETERS, "0.3") | {name: value}
            text = "solution," + ",".join(row) + "\n1," + ",".join(row.values()) + "\n"
            message = raises(check_published, tmp_path / "a.csv", text)
            assert message.key == name
            assert "row 1" in str(message)


BERRY = json.loads((ROOT / "results/published/recommended/berry/berry.json").read_text())
PARTICLE = json.loads((ROOT / "results/published/recommended/berry/particle.json").read_text())
for about in BERRY, PARTICLE:
    about.pop("provenance")  # where it comes from, not what it is
BAD = ("text", None, [], {}, math.nan, math.inf, -1, 0, True, [1], "1")


def test_every_key_of_a_berry_and_a_particle_is_checked(tmp_path):
    def check(read, record, key):
        assert raises(read, tmp_path / "a.json", json.dumps(record)).key == key

    keys = (*berry_files.SIZE_COLUMNS, "density_kg_m3", "shear_modulus_pa")
    berry = [(berry_files.read_berry, BERRY | {key: value}, key) for key in keys for value in BAD]
    others = [(key, value) for key in berry_files.FROM_ZERO for value in BAD if value != 0]
    berry += [(berry_files.read_berry, BERRY | {key: value}, key) for key, value in others]
    numbers = [key for key in PARTICLE if key not in ("kind", "stl")]
    bad = ("text", {}, math.nan, -1, [1, "a"], [[1]], [math.inf] * 3, True)
    particle = [(Particle.load, PARTICLE | {key: value}, key) for key in numbers for value in bad]
    without = [(Particle.load, {name: PARTICLE[name] for name in PARTICLE if name != key}, key) for key in PARTICLE]
    cases = berry + particle + without
    named = [(f"{case[0].__name__} {case[2]} {case[1].get(case[2], 'missing')!r}", *case) for case in cases]
    check_all(check, named)


@pytest.mark.parametrize("key", berry_files.MODULI)
def test_a_simulation_needs_the_moduli_of_its_berry(refused, tmp_path, key):
    path = tmp_path / "berry.json"
    path.write_text(json.dumps({name: BERRY[name] for name in BERRY if name != key}))
    assert f"berry.json: {key} is None" in refused("pour", f"--berry={path}")


def test_a_file_that_was_cut(tmp_path):
    import trimesh

    whole = {
        "berry.json": (berry_files.read_berry, json.dumps(BERRY).encode()),
        "particle.json": (Particle.load, json.dumps(PARTICLE).encode()),
        "a.stl": (load_mesh, trimesh.creation.box((20.0, 11.0, 10.0)).export(file_type="stl")),
    }
    rng = np.random.default_rng(1)
    files.write_npz(tmp_path / "a.npz", {"position_1": rng.normal(size=(50, 3))})
    files.write_image(tmp_path / "a.png", rng.integers(0, 255, (60, 60), dtype=np.uint8))
    for name, read in (("a.npz", files.read_npz), ("a.png", read_image)):
        whole[name] = (read, (tmp_path / name).read_bytes())

    def check(name, share):
        read, content = whole[name]
        if name == "a.png":
            share *= 0.5  # a picture that lacks only its end is read as far as it goes
        raises(read, tmp_path / name, content[: int(share * len(content))])

    shares = (0.0, 0.01, 0.2, 0.5, 0.9, 0.99)
    check_all(check, [(f"{name} {share}", name, share) for name in whole for share in shares])


def answer(read, path):
    try:
        read(path)
    except InputError as error:
        return str(error)
    return str(path)


def drawn(check, **strategies):
    """Call `check` with 60 draws of hypothesis, which is imported here as it takes long."""
    from hypothesis import HealthCheck, given, settings

    settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)(
        given(**strategies)(check)
    )()


def test_a_reader_reads_any_bytes_or_reports_what_is_wrong(tmp_path):
    from hypothesis import strategies as st

    readers = {
        "a.csv": (files.read_table, tables.sheet, berry_files.read_sizes, berry_files.read_compression),
        "a.json": (files.read_json, berry_files.read_berry, Particle.load), "a.npz": (files.read_npz,),
        "a.stl": (load_mesh,), "a.png": (read_image,), "a.yaml": (reading.read,),
    }  # fmt: skip

    def check(content, name):
        path = tmp_path / name
        path.write_bytes(content)
        for read in readers[name]:
            assert str(path) in answer(read, path)

    drawn(check, content=st.binary(max_size=300), name=st.sampled_from(list(readers)))


def test_readers_of_text_take_any_text_or_tell_what_is_wrong(tmp_path):
    from hypothesis import strategies as st

    path = tmp_path / "a"

    def check(text):
        path.write_bytes(text.encode())
        for read in (files.read_table, tables.sheet, files.read_json, berry_files.read_sizes, reading.read):
            assert str(path) in answer(read, path)

    drawn(check, text=st.text(alphabet='ab1.,;"\n\r \t-#é[]{}:&*!?|>%@`\x00\ufeff', max_size=60))

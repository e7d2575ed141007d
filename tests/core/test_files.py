"""Files: one reader and one writer for each type."""

import json
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from repose.core import files, tables
from repose.core.errors import InputError
from repose.core.parameters import FURTHER

TABLE = pd.DataFrame({"sample": [1, 2], "aor_deg": [31.25, np.nan], "reason": ["", "stuck, twice"]})


def test_what_is_written_is_read_again_and_folders_are_made(tmp_path):
    folder = tmp_path / "new/folder"
    files.write_table(folder / "table.csv", TABLE)
    back = files.read_table(folder / "table.csv", ("sample", "aor_deg"))
    assert back["aor_deg"].tolist()[0] == 31.25
    assert tables.read(folder / "table.csv", [tables.Column("sample", int)]).rows()[1] == {
        "sample": 2,
        "aor_deg": "",
        "reason": "stuck, twice",
    }
    content = {"one": np.float64(0.1), "k": np.int64(2), "list": np.arange(3), "text": "µ"}
    files.write_json(folder / "content.json", content)
    assert files.read_json(folder / "content.json", {"one": float, "text": str}) == {
        "one": 0.1,
        "k": 2,
        "list": [0, 1, 2],
        "text": "µ",
    }
    arrays = {"position": np.random.default_rng(1).normal(size=(4, 3)).astype(np.float32)}
    files.write_npz(folder / "arrays.npz", arrays)
    assert np.array_equal(files.read_npz(folder / "arrays.npz", ("position",))["position"], arrays["position"])
    picture = np.arange(12, dtype=np.uint8).reshape(3, 4)
    files.write_image(folder / "picture.png", picture)
    assert np.array_equal(cv2.imread(str(folder / "picture.png"), cv2.IMREAD_GRAYSCALE), picture)
    assert not list(folder.glob("*.part"))


def test_a_table_is_written_as_pandas_writes_it(tmp_path):
    files.write_table(tmp_path / "ours.csv", TABLE, float_format="%.6g", index=True)
    TABLE.to_csv(tmp_path / "theirs.csv", float_format="%.6g")
    assert (tmp_path / "ours.csv").read_bytes() == (tmp_path / "theirs.csv").read_bytes()


def test_a_writer_that_fails_leaves_the_earlier_file(tmp_path):
    path = tmp_path / "content.json"
    files.write_json(path, {"whole": True})
    with pytest.raises(TypeError, match="object cannot be written as JSON"):
        files.write_json(path, {"bad": object()})
    assert files.read_json(path) == {"whole": True}
    with pytest.raises(InputError, match=r"suffix is '\.nothing'; expected the suffix of a picture"):
        files.write_image(tmp_path / "picture.nothing", np.zeros((2, 2), np.uint8))


@pytest.mark.parametrize("read", [files.read_table, tables.sheet, files.read_json, files.read_npz])
def test_every_fault_of_a_file_is_reported_with_its_name(tmp_path, read):
    path = tmp_path / "given"
    with pytest.raises(InputError, match=r"given: .* is .*No such file.*; expected a fine file"):
        read(path, what="a fine file")
    with pytest.raises(InputError, match=r".* is .*directory.*; expected a fine file"):
        read(tmp_path, what="a fine file")
    path.write_bytes(b"\xff\xfe\x00broken\x00\x9d")
    with pytest.raises(InputError, match="expected a fine file"):
        read(path, what="a fine file")


@pytest.mark.parametrize("column", ["aor_deg", "e_gg", *FURTHER])
def test_a_word_in_a_column_of_numbers_is_refused(column, tmp_path):
    (tmp_path / "given.csv").write_text(f"sample,{column}\n1,0.5\n2,much\n")
    with pytest.raises(InputError, match=rf"row 2: {column} is 'much'; expected a finite number"):
        files.read_table(tmp_path / "given.csv", ("sample", column))


def test_missing_parts_are_reported_with_what_there_should_be(tmp_path):
    files.write_table(tmp_path / "table.csv", TABLE)
    missing = r"table\.csv: column height_mm is 'missing'; expected columns sample, height_mm; found: sample"
    with pytest.raises(InputError, match=missing):
        files.read_table(tmp_path / "table.csv", ("sample", "height_mm"))
    files.write_json(tmp_path / "a.json", {"runs": {}, "sample": 3})
    for keys, message in (
        (("sample", "time"), r"time is None; expected a key of a job"),
        ({"runs": list}, r"runs is {}; expected a list in a job"),
        ({"sample": (str, dict)}, r"sample is 3; expected a text or a mapping in a job"),
    ):
        with pytest.raises(InputError, match=message):
            files.read_json(tmp_path / "a.json", keys, "a job")
    (tmp_path / "list.json").write_text(json.dumps([1]))
    with pytest.raises(InputError, match=r"content is \[1\]; expected a job"):
        files.read_json(tmp_path / "list.json", what="a job")
    files.write_npz(tmp_path / "a.npz", {"scale": np.ones(2)})
    with pytest.raises(InputError, match=r"position is None; expected an array in a pour"):
        files.read_npz(tmp_path / "a.npz", ("position",), "a pour")
    np.save(tmp_path / "plain.npy", np.ones(2))
    with pytest.raises(InputError, match="expected a pour"):
        files.read_npz(tmp_path / "plain.npy", what="a pour")


def test_half_an_archive_is_refused(tmp_path):
    files.write_npz(tmp_path / "a.npz", {"scale": np.random.default_rng(1).normal(size=500)})
    content = (tmp_path / "a.npz").read_bytes()
    Path(tmp_path / "half.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError, match=r"half\.npz: arrays is"):
        files.read_npz(tmp_path / "half.npz")

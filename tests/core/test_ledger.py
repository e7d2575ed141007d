"""What the program remembers of the files that it wrote."""

import ast
import errno
import os

import pytest

from repose.core import files, ledger, places
from repose.core.errors import InputError


@pytest.fixture
def folder(tmp_path):
    """Two files of ours."""
    for name in ("a.json", "b.json"):
        files.write_json(tmp_path / name, {"name": name})
    return tmp_path


def test_it_knows_the_names_of_its_files(folder):
    (folder / "somebodys.json").write_text("{}")
    (folder / "b.json").unlink()
    assert ledger.names(folder) == {"a.json", "b.json"}


def test_files_that_hold_something_else_are_found_and_lost_ones_are_not(folder):
    assert ledger.changed(folder) == []
    content = bytearray((folder / "a.json").read_bytes())
    content[5] ^= 1
    (folder / "a.json").write_bytes(bytes(content))
    (folder / "b.json").unlink()
    (folder / "somebodys.json").write_text("{}")
    assert ledger.changed(folder) == [folder / "a.json"]


@pytest.mark.parametrize("kept", [0, 20, 65, 72, 80, 140])
def test_a_ledger_that_a_full_disk_cut_off_is_written_on(folder, kept):
    """One write call may write less than it was given."""
    path = folder / ledger.LEDGER
    path.write_bytes(path.read_bytes()[:kept])
    files.write_json(folder / "c.json", {})
    files.write_json(folder / "c.json", {"again": True})
    assert ledger.is_own_file(folder / "c.json")
    assert ledger.changed(folder) == []


@pytest.mark.parametrize("content", ["mine\n", "mine", "0123456789  a.json\n"])
def test_somebodys_file_of_the_ledgers_name_is_left_alone(tmp_path, content):
    (tmp_path / ledger.LEDGER).write_text(content)
    with pytest.raises(InputError, match="content is 'something else'"):
        files.write_json(tmp_path / "a.json", {})
    assert (tmp_path / ledger.LEDGER).read_text() == content


def test_a_full_disk_is_reported_with_the_file_that_did_not_fit(folder):
    def full(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = (folder / "a.json").read_bytes()
    with pytest.raises(OSError, match=r"No space left on device: '.*a\.json'"):
        ledger.write_whole(folder / "a.json", full)
    assert (folder / "a.json").read_bytes() == before


def test_nobody_may_run_a_ledger(folder):
    assert (folder / ledger.LEDGER).stat().st_mode & 0o111 == 0


# Calls that write, rename or remove; what stands in these files is tested in tests/core and tests/faults.
WRITERS = {"core/ledger.py", "core/lock.py", "dem/io/whole.py", "dem/cache.py", "apparatus/kept_runs.py"}
WRITERS |= {"core/usage.py", "config/call.py"}  # beside the results: snakemake's benchmarks and records
BARE = {"rmtree", "unlink", "rmdir", "replace_file", "remove", "removedirs", "rename", "renames", "copyfile"}
BARE |= {"copy", "copytree", "move", "write_bytes", "truncate", "imwrite", "imsave", "tofile", "savez"}


def test_no_other_code_of_the_program_writes_or_removes_a_file():
    modules = ("os", "shutil", "cv2", "np", "path", "Path")  # np.copy copies an array, not a file
    found = []
    for path in places.PACKAGE.rglob("*.py"):
        name = path.relative_to(places.PACKAGE).as_posix()
        if name in WRITERS:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call):
                continue
            function = node.func
            called = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
            owner = getattr(getattr(function, "value", None), "id", "")
            texts = [
                argument.value
                for argument in node.args
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str)
            ]
            opens = called == "open" and any(set(text) <= set("rwabx+t") and set(text) & set("wax+") for text in texts)
            if opens or (called in BARE and owner in modules and (owner, called) != ("np", "copy")):
                found.append(f"{name}:{node.lineno} {called}")
    assert not found

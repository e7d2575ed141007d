"""Files: written in one move, under a lock, and listed in a ledger."""

import ast
import errno
import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from refusals import input_error, raised

from repose.bench.parameters import LAW_PARAMETERS
from repose.common import files, ledger, lock, places, tables, usage
from repose.common.lock import lock_folder, lock_folder_for_job

TABLE = pd.DataFrame(
    {"sample": [1, 2], "aor_deg": [31.25, np.nan], "reason": ["", "stuck, twice"]}
)
A_JOB = """
import sys, time
from repose.common.lock import lock_folder_for_job
with lock_folder_for_job(sys.argv[1]):
    print("holds it", flush=True)
    time.sleep(float(sys.argv[2]))
"""


def test_what_is_written_is_read_again_and_folders_are_made(tmp_path):
    folder = tmp_path / "new/folder"
    files.write_table(folder / "table.csv", TABLE)
    back = files.read_table(folder / "table.csv", ("sample", "aor_deg"))
    assert back["aor_deg"].tolist()[0] == 31.25
    second = {"sample": 2, "aor_deg": "", "reason": "stuck, twice"}
    assert (
        tables.read(folder / "table.csv", [tables.Column("sample", int)]).rows()[1]
        == second
    )
    content = {
        "one": np.float64(0.1),
        "k": np.int64(2),
        "list": np.arange(3),
        "text": "µ",
    }
    files.write_json(folder / "content.json", content)
    back = files.read_json(folder / "content.json", {"one": float, "text": str})
    assert back == {"one": 0.1, "k": 2, "list": [0, 1, 2], "text": "µ"}
    arrays = {
        "position": np.random.default_rng(1).normal(size=(4, 3)).astype(np.float32)
    }
    files.write_npz(folder / "arrays.npz", arrays)
    assert np.array_equal(
        files.read_npz(folder / "arrays.npz", ("position",))["position"],
        arrays["position"],
    )
    picture = np.arange(12, dtype=np.uint8).reshape(3, 4)
    files.write_image(folder / "picture.png", picture)
    assert np.array_equal(
        cv2.imread(str(folder / "picture.png"), cv2.IMREAD_GRAYSCALE), picture
    )
    assert not list(folder.glob("*.part"))


def test_a_table_is_written_as_pandas_writes_it_and_a_writer_that_fails_leaves_the_earlier_file(
    tmp_path,
):
    files.write_table(tmp_path / "ours.csv", TABLE, float_format="%.6g", index=True)
    TABLE.to_csv(tmp_path / "theirs.csv", float_format="%.6g")
    expected = (tmp_path / "theirs.csv").read_bytes()
    assert (tmp_path / "ours.csv").read_bytes() == expected
    path = tmp_path / "content.json"
    files.write_json(path, {"whole": True})
    raised(
        TypeError,
        "object cannot be written as JSON",
        files.write_json,
        path,
        {"bad": object()},
    )
    assert files.read_json(path) == {"whole": True}
    picture = tmp_path / "picture.nothing", np.zeros((2, 2), np.uint8)
    input_error(
        r"suffix is '\.nothing'; expected the suffix of a picture",
        files.write_image,
        *picture,
    )


@pytest.mark.parametrize(
    "read", [files.read_table, tables.read_sheet, files.read_json, files.read_npz]
)
def test_every_fault_of_a_file_is_reported_with_its_name(tmp_path, read):
    path = tmp_path / "given"
    input_error(
        r"given: .* is .*No such file.*; expected a fine file",
        read,
        path,
        what="a fine file",
    )
    input_error(
        r".* is .*directory.*; expected a fine file", read, tmp_path, what="a fine file"
    )
    path.write_bytes(b"\xff\xfe\x00broken\x00\x9d")
    input_error("expected a fine file", read, path, what="a fine file")


@pytest.mark.parametrize("column", ["aor_deg", "e_gg", *LAW_PARAMETERS])
def test_a_word_in_a_column_of_numbers_is_refused(column, tmp_path):
    (tmp_path / "given.csv").write_text(f"sample,{column}\n1,0.5\n2,much\n")
    message = rf"row 2: {column} is 'much'; expected a finite number"
    input_error(message, files.read_table, tmp_path / "given.csv", ("sample", column))


def test_a_missing_column_is_reported(tmp_path):
    files.write_table(tmp_path / "table.csv", TABLE)
    missing = r"table\.csv: column height_mm is 'missing'; expected columns sample, height_mm; found: sample"
    input_error(
        missing, files.read_table, tmp_path / "table.csv", ("sample", "height_mm")
    )


def test_missing_keys_and_wrong_types_are_reported(tmp_path):
    files.write_json(tmp_path / "a.json", {"runs": {}, "sample": 3})
    wrong = [
        (("sample", "time"), r"time is None; expected a key of a job"),
        ({"runs": list}, r"runs is {}; expected a list in a job"),
    ]
    for keys, message in [
        *wrong,
        (
            {"sample": (str, dict)},
            r"sample is 3; expected a text or a mapping in a job",
        ),
    ]:
        input_error(message, files.read_json, tmp_path / "a.json", keys, "a job")
    (tmp_path / "list.json").write_text(json.dumps([1]))
    input_error(
        r"content is \[1\]; expected a job",
        files.read_json,
        tmp_path / "list.json",
        what="a job",
    )


def test_missing_arrays_and_half_an_archive_are_reported(tmp_path):
    files.write_npz(tmp_path / "a.npz", {"scale": np.ones(2)})
    pour = tmp_path / "a.npz", ("position",), "a pour"
    input_error(r"position is None; expected an array in a pour", files.read_npz, *pour)
    np.save(tmp_path / "plain.npy", np.ones(2))
    input_error(
        "expected a pour", files.read_npz, tmp_path / "plain.npy", what="a pour"
    )
    files.write_npz(
        tmp_path / "a.npz", {"scale": np.random.default_rng(1).normal(size=500)}
    )
    content = (tmp_path / "a.npz").read_bytes()
    Path(tmp_path / "half.npz").write_bytes(content[: len(content) // 2])
    input_error(r"half\.npz: arrays is", files.read_npz, tmp_path / "half.npz")


def started_job(folder, lasts_s):
    """A job of the folder's workflow that holds it."""
    command = [sys.executable, "-c", A_JOB, folder, str(lasts_s)]
    job = subprocess.Popen(command, stdout=subprocess.PIPE)
    assert job.stdout.readline() == b"holds it\n"
    return job


def test_jobs_of_a_workflow_that_was_killed_are_waited_for(tmp_path, capfd):
    with lock_folder(tmp_path):
        pass
    with started_job(tmp_path, 0.5) as job:
        assert job.poll() is None
        with lock_folder(tmp_path):
            assert job.wait(timeout=5) == 0
    message = "waiting until the jobs of a workflow that was killed have ended"
    assert message in capfd.readouterr().err


def test_a_job_that_was_killed_holds_nothing_and_leaves_nothing(tmp_path, capfd):
    with lock_folder(tmp_path):
        pass
    with started_job(tmp_path, 60) as job:
        assert len(list(tmp_path.glob(f"{lock.JOB_LOCK_PREFIX}*"))) == 1
        job.kill()
    with lock_folder(tmp_path):
        assert {path.name for path in tmp_path.iterdir()} == {lock.WORKFLOW_LOCK}
    assert "waiting" not in capfd.readouterr().err


@pytest.mark.parametrize(
    "number", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.EIO]
)
def test_a_file_system_without_locks_holds_and_refuses_nothing_and_other_faults_are_reported(
    tmp_path, monkeypatch, number, capfd
):
    def flock(_file, _kind):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", flock)
    if number == errno.EIO:
        raised(OSError, os.strerror(number), lock_folder, tmp_path)
        return
    with lock_folder(tmp_path), lock_folder(tmp_path), lock_folder_for_job(tmp_path):
        pass
    assert capfd.readouterr().err.count("no locks on this system") == 1


def test_locks_obey_the_rules_of_nfs(tmp_path, monkeypatch):
    """There a shared lock needs a file open for reading, another one for writing."""
    flock = fcntl.flock
    kinds = []

    def flock_of_nfs(file, kind):
        mode = fcntl.fcntl(file, fcntl.F_GETFL) & os.O_ACCMODE
        kinds.append(kind)
        is_shared = kind & fcntl.LOCK_SH and mode == os.O_WRONLY
        is_exclusive = kind & fcntl.LOCK_EX and mode == os.O_RDONLY
        if is_shared or is_exclusive:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return flock(file, kind)

    monkeypatch.setattr(fcntl, "flock", flock_of_nfs)
    with lock_folder(tmp_path), lock_folder_for_job(tmp_path):
        pass
    with lock.lock_file(tmp_path / "runs.csv"):
        pass
    assert len(kinds) >= 6  # each is taken and released


def test_jobs_share_the_folder_and_a_second_workflow_is_refused_until_the_first_has_ended(
    tmp_path,
):
    with lock_folder(tmp_path):
        with lock_folder_for_job(tmp_path), lock_folder_for_job(tmp_path):
            pass
        pattern = r"workflow is 'process \d+ on .*'; expected one at a time"
        input_error(pattern, lock_folder, tmp_path)
    with lock_folder(tmp_path):
        pass


def test_a_folder_without_a_workflow_is_not_held(tmp_path):
    with lock_folder_for_job(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", [lock.WORKFLOW_LOCK, ".a.csv.lock"])
def test_a_lock_follows_no_link(tmp_path, name):
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    (tmp_path / name).symlink_to(mine)

    def hold():
        with lock_folder(tmp_path), lock.lock_file(tmp_path / "a.csv"):
            pass

    raised(OSError, "symbolic link", hold)
    assert mine.read_text() == "mine"


def test_what_cannot_be_a_path_is_refused_by_name(tmp_path):
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    cases = {
        "": "the path of a file$",
        5: "the path of a file$",
        "x" * 300 + ".csv": "File name too long",
        "a\0.csv": "null byte",
        str(loop): "symbolic links",
    }
    for name, reason in cases.items():
        input_error(
            f"study: file is .*; expected .*{reason}",
            files.convert_to_path,
            "file",
            name,
        )
    for name in ("a.csv", "new/a.csv", tmp_path):
        assert files.convert_to_path("file", name) == Path(name)


def test_a_line_and_the_name_of_the_holder_follow_no_link(tmp_path):
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / usage.TABLE_PATH).symlink_to(mine)
    usage.record_process(tmp_path)
    assert mine.read_text() == "mine"
    for flag in (os.O_APPEND, os.O_TRUNC):
        with (
            pytest.raises(OSError, match="symbolic link"),
            ledger.open_descriptor(tmp_path / usage.TABLE_PATH, flag),
        ):
            pass
    assert mine.read_text() == "mine"


@pytest.mark.skipif(os.name == "nt", reason="no rights of groups")
def test_a_lock_is_open_to_the_group_or_the_message_says_what_to_set(
    tmp_path, monkeypatch
):
    before = os.umask(0o002)
    try:
        with lock_folder(tmp_path):
            assert (tmp_path / lock.WORKFLOW_LOCK).stat().st_mode & 0o777 == 0o664
    finally:
        os.umask(before)

    def denied(*_, **__):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("filelock.FileLock.acquire", denied)
    message = r"\.lock: access is 'for others'; expected write access for you; .*umask 002.*chmod -R g\+rwX"
    input_error(message, lock_folder, tmp_path)


@pytest.fixture
def folder(tmp_path):
    for name in ("a.json", "b.json"):
        files.write_json(tmp_path / name, {"name": name})
    return tmp_path


def test_the_folder_knows_its_files_and_a_full_disk_is_reported(folder):
    (folder / "somebodys.json").write_text("{}")
    (folder / "b.json").unlink()
    assert ledger.list_names(folder) == {"a.json", "b.json"}
    assert (folder / ledger.LEDGER).stat().st_mode & 0o111 == 0

    def full(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = (folder / "a.json").read_bytes()
    raised(
        OSError,
        r"No space left on device: '.*a\.json'",
        ledger.write_listed_file,
        folder / "a.json",
        full,
    )
    assert (folder / "a.json").read_bytes() == before


def test_files_that_hold_something_else_are_found_and_lost_ones_are_not(folder):
    assert ledger.find_changed_files(folder) == []
    content = bytearray((folder / "a.json").read_bytes())
    content[5] ^= 1
    (folder / "a.json").write_bytes(bytes(content))
    (folder / "b.json").unlink()
    (folder / "somebodys.json").write_text("{}")
    assert ledger.find_changed_files(folder) == [folder / "a.json"]


@pytest.mark.parametrize("kept", [0, 20, 65, 72, 80, 140])
def test_a_ledger_that_a_full_disk_cut_off_is_written_on(folder, kept):
    path = folder / ledger.LEDGER
    path.write_bytes(path.read_bytes()[:kept])
    files.write_json(folder / "c.json", {})
    files.write_json(folder / "c.json", {"again": True})
    assert ledger.is_own_file(folder / "c.json")
    assert ledger.find_changed_files(folder) == []


@pytest.mark.parametrize("name", ["", "..", ledger.LEDGER, "a\nb"])
def test_a_name_that_cannot_stand_in_the_ledger_is_refused(name):
    """Also in a folder that does not exist yet, where nothing can be overwritten."""
    folder = Path("new_folder") if name else Path()
    input_error(
        "a file name of printable characters", ledger.check_replaceable, folder / name
    )


@pytest.mark.parametrize("content", ["mine\n", "mine", "0123456789  a.json\n"])
def test_somebodys_file_of_the_ledgers_name_is_left_alone(tmp_path, content):
    (tmp_path / ledger.LEDGER).write_text(content)
    input_error(
        "content is 'something else'", files.write_json, tmp_path / "a.json", {}
    )
    assert (tmp_path / ledger.LEDGER).read_text() == content


def test_a_ledger_with_a_strange_line_is_still_one(folder):
    with (folder / ledger.LEDGER).open("a") as file:
        file.write("mine\n")
    assert ledger.list_names(folder) == {"a.json", "b.json"}
    assert ledger.find_changed_files(folder) == []


# Calls that write, rename or remove; what stands in these files is tested in tests/common and tests/faults.
WRITERS = {
    "common/ledger.py",
    "common/lock.py",
    "common/source_code.py",  # in the user's cache folder
    "common/usage.py",  # beside the results: snakemake's benchmarks
    "dem/io/whole.py",
    "dem/cache.py",
    "stages/kept_runs.py",
    "stages/simulate.py",  # in the folder of a run of a user's own program
}
BARE = {
    "rmtree",
    "unlink",
    "rmdir",
    "replace_file",
    "remove",
    "removedirs",
    "rename",
    "renames",
    "copyfile",
}
BARE |= {
    "copy",
    "copytree",
    "move",
    "write_bytes",
    "truncate",
    "imwrite",
    "imsave",
    "tofile",
    "savez",
}


def test_no_other_code_of_the_program_writes_or_removes_a_file():
    # np.copy copies an array, not a file
    modules = (
        "os",
        "shutil",
        "cv2",
        "np",
        "path",
        "Path",
    )
    found = []
    for path in places.PACKAGE.rglob("*.py"):
        name = path.relative_to(places.PACKAGE).as_posix()
        if name in WRITERS:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call):
                continue
            function = node.func
            called = (
                function.attr
                if isinstance(function, ast.Attribute)
                else getattr(function, "id", "")
            )
            owner = getattr(getattr(function, "value", None), "id", "")
            texts = [
                argument.value
                for argument in node.args
                if isinstance(argument, ast.Constant)
                and isinstance(argument.value, str)
            ]
            opens = called == "open" and any(
                set(text) <= set("rwabx+t") and set(text) & set("wax+")
                for text in texts
            )
            if opens or (
                called in BARE
                and owner in modules
                and (owner, called) != ("np", "copy")
            ):
                found.append(f"{name}:{node.lineno} {called}")
    assert not found


def test_an_array_that_is_missing_is_named_before_any_is_unpacked(
    tmp_path, monkeypatch
):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, x=np.zeros(3))
    unpacked = []
    monkeypatch.setattr(np.lib.npyio.NpzFile, "__getitem__", unpacked.append)
    input_error(r"a\.npz: time_s is None", files.read_npz, path, ("time_s",))
    assert unpacked == []

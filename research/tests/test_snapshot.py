import pytest
from refusals import input_error

from repose.common.files import write_text
from research import snapshot


def study(tmp_path):
    """Some files of a study."""
    for name in (
        "card.json",
        "dataset.csv",
        "validation/table4.csv",
        "figures/figure13.png",
        "heaps/001.json",
        "refined/batches.csv",
        "refined/batch_1/dataset.csv",
        "refined/batch_1/heaps/1001.json",
        "pool/fresh_runs.csv",
        "pool/heaps/fresh/001.json",
        "comparison/accuracy.csv",
        "checked.json",
        "logs/a.log",
        "network/states.npz",
    ):
        write_text(tmp_path / "results" / name, name)
    return tmp_path / "results"


def content(folder):
    """Every file below a folder, with its bytes."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_tables_and_figures_are_kept_and_pours_are_not(tmp_path):
    out = tmp_path / "published"
    copied = snapshot.copy_study(study(tmp_path), out)
    assert sorted(p.relative_to(out).as_posix() for p in copied) == [
        "card.json",
        "comparison/accuracy.csv",
        "dataset.csv",
        "figures/figure13.png",
        "pool/fresh_runs.csv",
        "refined/batch_1/dataset.csv",
        "refined/batches.csv",
        "validation/table4.csv",
    ]
    assert (out / "dataset.csv").read_text() == "dataset.csv"


def test_the_command_prints_what_it_copied_and_refuses_an_unfinished_study(
    tmp_path, monkeypatch, capsys
):
    results = study(tmp_path)
    out = tmp_path / "published"
    monkeypatch.setattr("sys.argv", ["snapshot", str(results), "--out", str(out)])
    snapshot.main()
    assert capsys.readouterr().out.splitlines()[0] == str(out / "card.json")
    (results / "card.json").unlink()
    with pytest.raises(SystemExit, match="2"):
        snapshot.main()
    assert "a finished study" in capsys.readouterr().err


def test_a_snapshot_replaces_an_earlier_one_whole(tmp_path):
    results = study(tmp_path)
    out = tmp_path / "published"
    snapshot.copy_study(results, out)
    (results / "pool/fresh_runs.csv").unlink()
    (results / "dataset.csv").write_text("another study")
    snapshot.copy_study(results, out)
    assert not (out / "pool/fresh_runs.csv").exists()
    assert (out / "dataset.csv").read_text() == "another study"


@pytest.mark.parametrize(
    "where", ["results", ".", "thesis", "results/berry", "results/validation", "a_file"]
)
def test_a_folder_that_no_snapshot_made_is_left_as_it_is(tmp_path, where):
    results = study(tmp_path)
    write_text(results / "berry/berry.json", "{}")
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis/chapter.tex").write_text("years of work")
    (tmp_path / "a_file").write_text("text")
    before = content(tmp_path)
    input_error(
        r"expected a (new )?folder", snapshot.copy_study, results, tmp_path / where
    )
    assert content(tmp_path) == before


def test_a_file_that_somebody_added_or_changed_keeps_an_earlier_snapshot(tmp_path):
    results = study(tmp_path)
    out = tmp_path / "published"
    snapshot.copy_study(results, out)
    for name in ("notes.txt", "dataset.csv"):
        (out / name).write_text("mine")
        before = content(tmp_path)
        input_error(
            f"content is '{name}'; expected a new folder",
            snapshot.copy_study,
            results,
            out,
        )
        assert content(tmp_path) == before
        (out / name).unlink()


def test_what_cannot_be_kept_is_refused(tmp_path, monkeypatch):
    results = study(tmp_path)
    out = tmp_path / "published"
    monkeypatch.setattr(snapshot, "LARGEST_FILE", 5)
    input_error("at most 5 bytes", snapshot.copy_study, results, out)
    (results / "card.json").unlink()
    input_error("a finished study", snapshot.copy_study, results, out)
    assert not out.exists()


def test_a_study_in_a_folder_of_another_is_no_part_of_its_snapshot(tmp_path):
    results = study(tmp_path)
    out = tmp_path / "published"
    files = [path.relative_to(out) for path in snapshot.copy_study(results, out)]
    for name in ("fast", "published/fast", "sequential", "paper"):
        for part in (
            "config.json",
            "dataset.csv",
            "sequential/dataset.csv",
            "refined/batch_2/dataset.csv",
        ):
            write_text(results / name / part, "{}")
    for name in ("published/refined/batch_2/dataset.csv", "copies/batch_1/dataset.csv"):
        write_text(results / name, "in no study")
    assert [
        path.relative_to(out) for path in snapshot.copy_study(results, out)
    ] == files

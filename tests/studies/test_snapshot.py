import pytest

from repose.core.errors import InputError
from repose.studies import snapshot


def study(tmp_path):
    """Some files of a study."""
    for name in (
        "dataset.csv",
        "validation/table4.csv",
        "figures/figure13.png",
        "heaps/001.json",
        "refined/rounds.csv",
        "refined/round_0/round.csv",
        "refined/round_0/heaps/1001.json",
        "pool/fresh_runs.csv",
        "pool/heaps/fresh/001.json",
        "comparison/accuracy.csv",
        "logs/a.log",
    ):
        path = tmp_path / "results" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    return tmp_path / "results"


def test_tables_and_figures_are_kept_and_pours_are_not(tmp_path):
    out = tmp_path / "published"
    (out / "old").mkdir(parents=True)
    copied = snapshot.take(study(tmp_path), out)
    assert sorted(p.relative_to(out).as_posix() for p in copied) == [
        "comparison/accuracy.csv",
        "dataset.csv",
        "figures/figure13.png",
        "pool/fresh_runs.csv",
        "refined/round_0/round.csv",
        "refined/rounds.csv",
        "validation/table4.csv",
    ]
    assert not (out / "old").exists()
    assert (out / "dataset.csv").read_text() == "dataset.csv"


def test_an_unfinished_study_is_refused(tmp_path):
    results = study(tmp_path)
    (results / "validation" / "table4.csv").unlink()
    with pytest.raises(InputError, match="a finished study"):
        snapshot.take(results, tmp_path / "published")
    assert not (tmp_path / "published").exists()


def test_a_file_too_large_for_a_repository_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(snapshot, "LARGEST_FILE", 5)
    with pytest.raises(InputError, match="at most 5 bytes"):
        snapshot.take(study(tmp_path), tmp_path / "published")

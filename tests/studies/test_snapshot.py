import pytest

from repose.core.errors import InputError
from repose.core.files import write_text
from repose.studies import snapshot

STRATEGY = "(refined|sequential)"
KEEP = ("config.json", "card.json", "dataset.csv", "validation/.+csv", "figures/.+png", "refined/[^/]+csv")
KEEP += ("pool/[^/]+csv", "comparison/.+csv", "berry/.+json", "noise/.+csv", "network/.+npz")
KEEP += (
    rf"{STRATEGY}/(?P<batch>batch_\d+)/dataset\.csv",
    r"(?P<batch>sequential)/dataset\.csv",
)
MADE = ("card.json", "dataset.csv", "validation/table4.csv", "figures/figure13.png")


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
    copied = snapshot.take(study(tmp_path), out, KEEP)
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


def test_a_snapshot_replaces_an_earlier_one_whole(tmp_path):
    results, out = study(tmp_path), tmp_path / "published"
    snapshot.take(results, out, KEEP)
    (results / "pool/fresh_runs.csv").unlink()
    (results / "dataset.csv").write_text("another study")
    snapshot.take(results, out, KEEP)
    assert not (out / "pool/fresh_runs.csv").exists()
    assert (out / "dataset.csv").read_text() == "another study"


@pytest.mark.parametrize("where", ["results", ".", "thesis", "results/berry", "results/validation", "a_file"])
def test_a_folder_that_no_snapshot_made_is_left_as_it_is(tmp_path, where):
    results = study(tmp_path)
    write_text(results / "berry/berry.json", "{}")
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis/chapter.tex").write_text("years of work")
    (tmp_path / "a_file").write_text("text")
    before = content(tmp_path)
    with pytest.raises(InputError, match=r"allowed: a (new )?folder"):
        snapshot.take(results, tmp_path / where, KEEP)
    assert content(tmp_path) == before


def test_a_file_that_somebody_added_or_changed_keeps_an_earlier_snapshot(tmp_path):
    results, out = study(tmp_path), tmp_path / "published"
    snapshot.take(results, out, KEEP)
    for name in ("notes.txt", "dataset.csv"):
        (out / name).write_text("mine")
        before = content(tmp_path)
        with pytest.raises(InputError, match=f"content is '{name}'; allowed: a new folder"):
            snapshot.take(results, out, KEEP)
        assert content(tmp_path) == before
        (out / name).unlink()


def test_what_cannot_be_kept_is_refused(tmp_path, monkeypatch):
    results, out = study(tmp_path), tmp_path / "published"
    with pytest.raises(InputError, match=r"--keep is '\*.csv'"):
        snapshot.take(results, out, ["*.csv"])
    monkeypatch.setattr(snapshot, "LARGEST_FILE", 5)
    with pytest.raises(InputError, match="at most 5 bytes"):
        snapshot.take(results, out, KEEP)
    (results / "card.json").unlink()
    with pytest.raises(InputError, match="a finished study"):
        snapshot.take(results, out, KEEP)
    assert not out.exists()


def optional(results, strategy="published"):
    """The hash of the optional studies' files."""
    return snapshot.of_optional_studies(results, KEEP, [results / name for name in MADE], strategy)


def test_a_study_in_a_folder_of_another_is_no_part_of_its_snapshot(tmp_path):
    results, out = study(tmp_path), tmp_path / "published"
    before = optional(results)
    own = [path.relative_to(out) for path in snapshot.take(results, out, KEEP)]
    for name in ("fast", "published/fast", "sequential", "paper"):
        for part in ("config.json", "dataset.csv", "sequential/dataset.csv", "refined/batch_2/dataset.csv"):
            write_text(results / name / part, "{}")
    for name in ("published/refined/batch_2/dataset.csv", "copies/batch_1/dataset.csv"):
        write_text(results / name, "in no study")
    assert optional(results) == before
    assert [path.relative_to(out) for path in snapshot.take(results, out, KEEP)] == own


def test_files_of_the_strategy_are_no_optional_study(tmp_path):
    results = study(tmp_path)
    of_refined, of_others = optional(results, "refined"), optional(results)
    write_text(results / "refined/batch_2/dataset.csv", "the next round")
    assert optional(results, "refined") == of_refined
    assert optional(results) != of_others


def test_only_files_of_an_optional_study_change_the_hash_of_all_of_them(tmp_path):
    results = study(tmp_path)
    before = optional(results)
    (results / "dataset.csv").write_text("another study")
    (results / "logs/a.log").write_text("another log")
    assert optional(results) == before
    for name, text in (("noise/noise.csv", "noise"), ("comparison/accuracy.csv", "another comparison")):
        write_text(results / name, text)
        assert optional(results) != before
        before = optional(results)

"""The pages state what the kept runs have: parameters, bounds, samples that meet the targets."""

import pandas as pd
import parameter_sets
import pytest

NAMES = sorted(parameter_sets.TEXTS)


@pytest.mark.parametrize("page", parameter_sets.PAGES)
def test_a_page_states_what_the_kept_files_have(page):
    text = (parameter_sets.ROOT / page).read_text()
    assert "<!-- made by" in text
    assert parameter_sets.with_texts(text) == text, (
        "python tests/documents/parameter_sets.py"
    )


def test_each_text_stands_on_a_page():
    text = "".join(
        (parameter_sets.ROOT / page).read_text() for page in parameter_sets.PAGES
    )
    found = {match[2] for match in parameter_sets.BLOCK.finditer(text)}
    assert found == set(NAMES)


def test_the_paper_states_the_solutions_at_a_bound():
    solutions = parameter_sets.DEFAULT.table(parameter_sets.DEFAULT.solutions)
    at_bound = solutions["warning"].str.startswith("at a bound", na=False).sum()
    paper = " ".join((parameter_sets.ROOT / "paper.md").read_text().split())
    assert f"{at_bound} of the {len(solutions)} solutions" in paper


def test_a_changed_answer_changes_the_page(monkeypatch):
    page = "<!-- made by tests/documents/parameter_sets.py: answers -->\n\nold\n\n<!-- end -->"
    run = parameter_sets.DEFAULT
    monkeypatch.setattr(parameter_sets, "RUNS", (run,))
    answer = parameter_sets.answer_of(run)
    answer["e_gg"] = 0.4
    monkeypatch.setattr(parameter_sets, "answer_of", lambda run: answer)
    made = parameter_sets.with_texts(page)
    assert "old" not in made
    assert "| `goji_berry` | 0.400 (upper bound) | 0.404 |" in made


def test_pours_of_two_draws_are_pooled_like_one_sample(monkeypatch, tmp_path):
    pours = {"a": [30.0, 31.0, 32.5], "b": [29.0, 33.0]}
    rows = []
    for draw, values in pours.items():
        sample = pd.Series(values)
        error = sample.std() / len(sample) ** 0.5
        rows.append(
            {
                "processor": draw,
                "solution": 22,
                "n_seeds": len(sample),
                "aor_flank_deg": sample.mean(),
                "aor_flank_se_deg": error,
                "height_mm": sample.mean(),
                "height_se_mm": error,
            }
        )
    (tmp_path / "published_sets").mkdir()
    pd.DataFrame(rows).to_csv(tmp_path / "published_sets" / "draws.csv")
    monkeypatch.setattr(parameter_sets, "KEPT", tmp_path)
    pooled = parameter_sets.pooled_published_sets().iloc[0]
    together = pd.Series([*pours["a"], *pours["b"]])
    assert pooled["pours"] == len(together)
    assert pooled["aor_deg"] == pytest.approx(together.mean())
    assert pooled["aor_deg_se"] == pytest.approx(together.std() / len(together) ** 0.5)


def test_intervals_that_touch_overlap():
    assert parameter_sets.overlap((0.1, 0.2), (0.2, 0.3))
    assert not parameter_sets.overlap((0.1, 0.19), (0.2, 0.3))

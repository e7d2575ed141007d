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
    at_bound, _, count = parameter_sets.solutions_at_bounds(parameter_sets.DEFAULT)
    paper = " ".join((parameter_sets.ROOT / "paper.md").read_text().split())
    assert f"{at_bound} of the {count} solutions" in paper


def test_the_paper_states_the_checks_and_the_samples():
    paper = " ".join((parameter_sets.ROOT / "paper.md").read_text().split())
    for run in (parameter_sets.DEFAULT, parameter_sets.SECOND):
        cells = parameter_sets.check_cells(run)
        angle = cells[parameter_sets.ANGLE][0].replace("°", " degrees")
        assert f"{angle} and {cells[parameter_sets.HEIGHT][0]}" in paper
    samples, meeting = parameter_sets.meeting_samples(parameter_sets.DEFAULT)
    name, here, there = parameter_sets.most_different_spans()
    assert f"{len(meeting)} of the {len(samples)} samples lie in both" in paper
    assert f"they span {here} of the range of" in paper
    assert f"`{name}` ({there} on the other processor)" in paper
    fast = parameter_sets.RUN_OF_FOLDER["fast"]
    most = parameter_sets.largest_difference(fast, parameter_sets.DEFAULT)
    assert f"up to {most.rpartition(' to ')[2]} of a range apart" in paper
    above = parameter_sets.steepest_whole_side()
    assert f"the angle is {above:.1f} standard errors" in paper
    for run in parameter_sets.judged_runs()[parameter_sets.Verdict.UNDECIDED]:
        probability = parameter_sets.probability_inside(run)
        assert f"with a probability of {probability:.2f}" in paper
    assert all(map(parameter_sets.lies_inside, parameter_sets.RUNS))


def test_a_warning_names_each_end_of_a_range():
    ends = parameter_sets.ends_of(
        "at a bound: mus_gg low, mus_gp high; leverage 0.44, samples' largest 0.28"
    )
    assert ends == [("mus_gg", "lower"), ("mus_gp", "upper")]
    assert parameter_sets.ends_of("leverage 0.44, samples' largest 0.28") == []


def test_the_paper_states_the_intervals_with_their_discrepancy():
    paper = " ".join((parameter_sets.ROOT / "paper.md").read_text().split())
    pooled, secant, exact = parameter_sets.open_shares()
    assert f"each 95 % interval keeps {pooled.all} of its prior width" in paper
    assert (
        f"keeps {secant.narrowest}, and with a perfect simulator {exact.narrowest}"
        in paper
    )
    assert f"keep at least {exact.others.split()[0]} %" in paper
    assert pooled.size.replace("°", " degrees") in paper


def test_the_pooled_discrepancy_is_that_of_the_kept_posterior():
    stated, by_line = parameter_sets.discrepancy_rows()
    posterior = parameter_sets.posterior_of(parameter_sets.DEFAULT)
    pooled = by_line.loc["all six"]
    assert pooled["aor_sd_deg"] == pytest.approx(posterior["discrepancy_sd"][0], 1e-4)
    assert pooled["height_sd_mm"] == pytest.approx(posterior["discrepancy_sd"][1], 1e-4)
    last = parameter_sets.DEFAULT.table("posterior/discrepancy.csv").iloc[-1]
    for column in ("information_bits", "mus_gg_low", "mus_gg_high"):
        assert pooled[column] == pytest.approx(last[column], 1e-4)
    assert set(stated["evidence"]) == {"stated"}


def test_a_check_inside_both_ranges_is_sure_only_with_small_errors(monkeypatch):
    table = pd.DataFrame(
        {
            "response": ["aor_deg", "height_mm"],
            "n_seeds": 32,
            "simulated": [32.5, 66.5],
            "simulated_se": [0.01, 0.01],
        }
    )
    monkeypatch.setattr(parameter_sets, "check_of", lambda run: table)
    assert parameter_sets.probability_inside(None) == pytest.approx(1)
    # On the edge of both ranges half of the probability of each is inside.
    table["simulated"] = [31.0, 69.0]
    assert parameter_sets.probability_inside(None) == pytest.approx(0.25)


def test_a_changed_answer_changes_the_page(monkeypatch):
    page = "<!-- made by tests/documents/parameter_sets.py: answers -->\n\nold\n\n<!-- end -->"
    run = parameter_sets.DEFAULT
    monkeypatch.setattr(parameter_sets, "RUNS", (run,))
    answer = parameter_sets.answer_of(run)
    answer["e_gg"] = 0.4
    answer["mus_gg"] = 0.5
    monkeypatch.setattr(parameter_sets, "answer_of", lambda run: answer)
    made = parameter_sets.with_texts(page)
    assert "old" not in made
    assert "| `goji_berry` | 0.400 (upper bound) | 0.500 |" in made


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

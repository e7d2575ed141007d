"""The article's network and search on a table of samples, without a simulator.

The table is invented: its responses are lines of the parameters, with a little scatter.
"""

import copy
import json
import re

import numpy as np
import pandas as pd
import pytest
import yaml
from shared import ROOT, says

from repose.calibrate.study import Study
from repose.common.reading import read_yaml

STUDY = ROOT / "config/article_data.yaml"
CONTENT = read_yaml(STUDY)
PARAMETERS = CONTENT["parameters"]
RESPONSES = ("aor_deg", "height_mm")
SAMPLES = 40
SCATTER = 0.2  # of a response about its line
# A search and a network of seconds.
SMALL = {
    "network": {"hidden": 2, "starts": 1, "epochs": 60},
    "miga": {"islands": 2, "population": 20, "rounds": 40, "solutions": 20},
    "posterior": {"walkers": 32, "steps": 100},
}


def lines(values):
    """The responses at parameters in shares of their ranges, by hand."""
    share = {
        name: (values[name] - low) / (high - low)
        for name, (low, high) in PARAMETERS.items()
    }
    aor_deg = 28 + 5 * share["mus_gg"] + 4 * share["mur_gg"]
    height_mm = 62 + 4 * share["mus_gg"] + 4 * share["mur_gp"]
    return {"aor_deg": aor_deg, "height_mm": height_mm}


@pytest.fixture(scope="module")
def table():
    rng = np.random.default_rng(1)
    samples = pd.DataFrame(
        {name: rng.uniform(*ends, SAMPLES) for name, ends in PARAMETERS.items()}
    )
    for name, exact in lines(samples).items():
        samples[name] = exact + SCATTER * rng.normal(size=SAMPLES)
    return samples


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The study of config/ with a smaller network, search and posterior."""
    content = copy.deepcopy(CONTENT)
    for section, keys in SMALL.items():
        content[section] = content.get(section, {}) | keys
    path = tmp_path_factory.mktemp("study") / "small.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


@pytest.mark.slow
def test_network_search_and_intervals_come_from_the_table_alone(
    command, table, small, tmp_path
):
    table.to_csv(tmp_path / "table_s1.csv", index=False)
    words = ["--configfile", small, "--out", tmp_path / "out"]
    printed = command("calibrate", tmp_path / "table_s1.csv", *words).out

    # 70, 15 and 15 % of the samples, as the article splits its own.
    out = tmp_path / "out"
    metrics = json.loads((out / "metrics.json").read_text())
    sizes = {part: metrics[f"n_{part}"] for part in ("train", "validation", "test")}
    assert sizes == {"train": 28, "validation": 6, "test": 6}
    for name in RESPONSES:
        assert metrics["test"][name]["r2"] > 0.8
        assert f"{name}: R2 {metrics['test'][name]['r2']:.3f}" in printed
    accuracy = pd.read_csv(out / "accuracy.csv")
    np.testing.assert_allclose(accuracy["aor_deg"], table["aor_deg"], rtol=1e-6)

    # Each solution lies in the ranges of the targets, by the lines from which the table
    # was made, within the scatter of the table.
    solutions = pd.read_csv(out / "solutions.csv")
    assert len(solutions) > 5
    exact = lines(solutions)
    for name in RESPONSES:
        low, high = CONTENT["targets"][name]["range"]
        assert exact[name].between(low - 3 * SCATTER, high + 3 * SCATTER).all()

    # Table 3: the ends of the solutions, as shares of the searched ranges.
    intervals = pd.read_csv(out / "intervals.csv").set_index("variable")
    assert list(intervals.index) == list(PARAMETERS)
    for name, (low, high) in PARAMETERS.items():
        row = intervals.loc[name]
        assert low <= row["low"] <= row["high"] <= high
        share = 100 * (row["high"] - row["low"]) / (high - low)
        assert row["dispersion_percent"] == pytest.approx(share)

    page = (out / "report.html").read_text()
    for words in ("Span of the sets found", "that it has not learned from"):
        assert words in page


def test_a_missing_table_is_named_with_its_columns(command, tmp_path):
    missing = tmp_path / "table_s1.csv"
    words = ["calibrate", missing, "--configfile", STUDY, "--out", tmp_path / "out"]
    columns = ", ".join([*PARAMETERS, *RESPONSES])
    expected = (
        f"{missing}: file is 'No such file or directory'; expected a CSV file of runs "
        f"with the columns {columns}"
    )
    assert expected in command(*words, status=2).err
    assert not (tmp_path / "out").exists()


def test_a_table_without_a_column_is_refused(table, small, tmp_path, command):
    path = tmp_path / "table_s1.csv"
    table.drop(columns="mur_gp").to_csv(path, index=False)
    error = command("calibrate", path, "--configfile", small, status=2).err
    says(error, f"{path}: column mur_gp is 'missing'", "found: e_gg")


def test_the_study_is_that_of_the_article():
    paper = yaml.safe_load((ROOT / "config/paper.yaml").read_text())
    for target in paper["targets"]:
        own = CONTENT["targets"][target["response"]]
        for key in ("value", "aim", "sd", "repetitions", "range"):
            assert own[key] == target[key]
    for section in ("network", "miga"):
        assert CONTENT[section] == paper[section]
    table2 = pd.read_csv(ROOT / "resources/published/table2.csv").set_index("parameter")
    for name, ends in PARAMETERS.items():
        assert ends == table2.loc[name, ["low", "high"]].tolist()
    assert list(Study.own(STUDY).targets.aim) == [32.5, 66.5]


def test_the_page_names_file_columns_and_command():
    page = (ROOT / "docs/article.md").read_text()
    note = re.search(r"\*\*O\. Table S1\.\*\*.*?\n\n\*\*P\.", page, re.DOTALL)[0]
    for name in (*PARAMETERS, *RESPONSES):
        assert f"`{name}`" in note
    assert (
        "repose calibrate resources/published/table_s1.csv --configfile "
        "config/article_data.yaml" in note
    )


@pytest.mark.parametrize("aim", [0, 40, 30.9])
def test_an_aim_outside_its_range_is_refused(aim, tmp_path, command):
    content = copy.deepcopy(CONTENT)
    content["targets"]["aor_deg"]["aim"] = aim
    path = tmp_path / "own.yaml"
    path.write_text(yaml.safe_dump(content))
    error = command("design", "--configfile", path, status=2).err
    assert "targets.aor_deg.aim" in error
    assert "a number in the range, 31 to 34, but not 0" in error

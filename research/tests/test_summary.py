"""One table of all comparisons: every row finds its way, with its error and its budget."""

import pandas as pd
import pytest
from refusals import input_error

from repose.calibrate.responses import name_derived_column
from research.comparison import summary

SIZES = {
    "points": 30,
    "seeds": 4,
    "simulations": 120,
    "response": "aor_deg",
    "repetitions": 10,
}
SHARES = {"explainable": 0.9, "explainable_se": 0.01, "rmse": 0.5, "rmse_se": 0.02}
SEARCH = {f"{key}{end}": 7.0 for key in summary.SEARCH for end in ("", "_se")}
WHOLE = {
    "aor_off_deg": 0.3,
    "aor_off_deg_se": 0.1,
    "height_off_mm": 0.8,
    "height_off_mm_se": 0.2,
}


@pytest.fixture
def files(tmp_path):
    tables = {
        "sampling": {
            "comparison": "designs",
            "design": "Sobol",
            "data": "emulated",
            "fit": "network",
        }
        | SIZES
        | SHARES,
        "surrogates": {"model": "network", "training": "pool"} | SIZES | SHARES,
        "search": {"method": "miga", "evaluations": 100, "repetitions": 10} | SEARCH,
        "whole": {
            "data": "real",
            "samples": 60,
            "method": "linear",
            "simulations": 360,
            "repetitions": 5,
        }
        | WHOLE,
    }
    for name, row in tables.items():
        rows = [row | {"response": "height_mm"}, row] if name == "sampling" else [row]
        pd.DataFrame(rows).to_csv(tmp_path / f"{name}.csv", index=False)
    return {name: tmp_path / f"{name}.csv" for name in tables}


def test_every_comparison_is_in_the_table(files, tmp_path):
    summary.run(files, tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "comparison.csv")
    assert tuple(table.columns) == summary.COLUMNS
    assert table["part"].value_counts().to_dict() == {
        "designs": 4,
        "surrogate": 2,
        "search": 4,
        "whole": 2,
    }
    row = table[(table["part"] == "surrogate") & (table["measure"] == "rmse")].iloc[0]
    assert row["choice"] == "network, pool"
    assert row["data"] == "real"
    assert row["simulations"] == 120
    assert row["value"] == 0.5
    assert row["standard_error"] == 0.02
    assert row["repetitions"] == 10
    row = table[(table["part"] == "whole") & (table["response"] == "height_mm")].iloc[0]
    assert row["measure"] == "off"
    assert row["value"] == 0.8
    assert row["standard_error"] == 0.2
    assert row["points"] == 60
    assert (table.loc[table["part"] == "search", "data"] == "network").all()


def test_the_region_beside_the_searches_is_none(files, tmp_path):
    table = pd.read_csv(files["search"])
    region = table.assign(method="feasible region", evaluations=float("nan"))
    pd.concat([table, region]).to_csv(files["search"], index=False)
    assert set(summary.run(files, tmp_path).query("part == 'search'")["choice"]) == {
        "miga"
    }


def test_a_table_without_its_column_is_named(files, tmp_path):
    pd.read_csv(files["whole"]).drop(columns="aor_off_deg_se").to_csv(
        files["whole"], index=False
    )
    input_error(
        r"whole\.csv: column aor_off_deg_se", summary.run, files, tmp_path / "out"
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("names", [["slip_deg"], ["a_mm", "b_mm", "c_s", "d_percent"]])
def test_any_number_of_responses_of_any_names(files, tmp_path, names):
    for table in ("sampling", "surrogates"):
        table_of_file = pd.read_csv(files[table])
        pd.concat([table_of_file.assign(response=name) for name in names]).to_csv(
            files[table], index=False
        )
    row = pd.read_csv(files["whole"]).drop(columns=list(WHOLE))
    errors = {name_derived_column(name, "off"): 0.1 * k for k, name in enumerate(names)}
    row.assign(**errors, **{f"{key}_se": 0.01 for key in errors}).to_csv(
        files["whole"], index=False
    )
    table = summary.run(files, tmp_path)
    found = table[table["part"] == "whole"].set_index("response")["value"]
    assert found.to_dict() == {name: 0.1 * k for k, name in enumerate(names)}

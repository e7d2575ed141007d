"""All comparisons in one table: which part of the method, which choice, at which budget, and how good it is."""

from pathlib import Path

from repose.core.files import read_table

COLUMNS = (
    "part",
    "choice",
    "data",
    "points",
    "seeds",
    "simulations",
    "response",
    "measure",
    "value",
    "standard_error",
    "repetitions",
)
SHARES = ("explainable", "rmse")
# Measures of a search on the network, which costs evaluations and no simulations; of the whole method, by response.
SEARCH = ("evaluations_to_tolerance", "best", "listed_coverage", "met_coverage")
WHOLE = {"aor_off_deg": "aor_deg", "height_off_mm": "height_mm"}


def run(files, out_dir):
    """Write comparison.csv, a row for each choice, budget, response and measure; return the table.

    files: mapping with sampling, surrogates, search and whole, the tables of those comparisons. `data` tells rows of
    poured samples (real) from those of an emulator fitted to them (emulated) and of the trained network (network);
    explainable is the share of the explainable variance, rmse and off in the response's unit. Raises InputError for a
    file without its columns.
    """
    import pandas as pd

    rows = [*_sampling(files["sampling"]), *_surrogates(files["surrogates"])]
    rows += [*_search(files["search"]), *_whole(files["whole"])]
    table = pd.DataFrame(rows, columns=COLUMNS)
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "comparison.csv", index=False, float_format="%.6g")
    return table


def _sampling(path):
    sizes = ("points", "seeds", "simulations", "response", "repetitions")
    keys = ("comparison", "design", "data", "fit", *sizes, *_with_errors(SHARES))
    for row in read_table(path, keys).to_dict("records"):
        choice = f"{row['design']}, {row['fit']}"
        yield from _measured(row, SHARES, part=row["comparison"], choice=choice)


def _surrogates(path):
    sizes = ("points", "seeds", "simulations", "response", "repetitions")
    for row in read_table(path, ("model", "training", *sizes, *_with_errors(SHARES))).to_dict("records"):
        choice = f"{row['model']}, {row['training']}"
        yield from _measured(row, SHARES, part="surrogate", choice=choice, data="real")


def _search(path):
    table = read_table(path, ("method", "evaluations", "repetitions", *_with_errors(SEARCH)))
    for row in table.dropna(subset="evaluations").to_dict("records"):
        yield from _measured(row, SEARCH, part="search", choice=row["method"], data="network")


def _whole(path):
    keys = ("data", "samples", "method", "simulations", "repetitions", *_with_errors(WHOLE))
    for row in read_table(path, keys).to_dict("records"):
        about = {"part": "whole", "choice": row["method"], "points": row["samples"]}
        for key, response in WHOLE.items():
            for found in _measured(row, (key,), **about, response=response):
                yield found | {"measure": "off"}


def _with_errors(measures):
    return [f"{measure}{end}" for measure in measures for end in ("", "_se")]


def _measured(row, measures, **about):
    """Rows of the one table from a row of another: what both have in common, then each measure."""
    for measure in measures:
        value = {"measure": measure, "value": row[measure], "standard_error": row[f"{measure}_se"]}
        yield {key: row[key] for key in COLUMNS if key in row} | about | value

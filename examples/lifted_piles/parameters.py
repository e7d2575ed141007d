"""The parameters of the other project's tests, and nothing of their results.

    python examples/lifted_piles/parameters.py REPOSITORY

reads static friction, rolling friction and restitution of each row from four tables of a copy of its repository, and
writes them with the number of the row to parameters.csv. No other column is taken in.
"""

import argparse
import io
import subprocess
from pathlib import Path

import pandas as pd

COMMIT = "95f50e60cd55146520e2438cf3fbdab689dcb83e"
COLUMNS = ["fric", "rollfric", "rest"]
TABLES = {
    "pile": "results/phase7-lhs/lhs_results.csv",
    "drum": "results/phase9-drum/valley_check.csv",
    "discharge": "results/phase9-drum/drawdown-probe/drawdown_probe.csv",
    "tilted_drum": "results/phase10-validation/validation.csv",
}


def table_of(
    repository: str, test: str, columns: list[str] | None = None
) -> pd.DataFrame:
    """Columns of a table of theirs, by default all, by the number of the row."""
    call = ["git", "-C", repository, "show", f"{COMMIT}:{TABLES[test]}"]
    text = subprocess.run(call, check=True, capture_output=True, text=True).stdout
    table = pd.read_csv(io.StringIO(text), usecols=columns)
    return table.set_axis(range(1, len(table) + 1)).rename_axis("row")


def parameters(repository: str) -> pd.DataFrame:
    """Test, row and parameters of every row of the four tables; rows are numbered from 1."""
    found = {test: table_of(repository, test, COLUMNS)[COLUMNS] for test in TABLES}
    return pd.concat(found, names=["test"]).reset_index()


def main() -> None:
    """Write parameters.csv."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "repository", help="a clone of JoshuaMayo-vectr/DEM-calibration"
    )
    parameters(parser.parse_args().repository).to_csv(
        Path(__file__).with_name("parameters.csv"), index=False
    )


if __name__ == "__main__":
    main()

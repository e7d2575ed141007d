"""Reading a table that a step of the method needs."""

from repose.core.errors import InputError


def read_table(path, columns):
    """The CSV at path as a DataFrame with at least these columns.

    Raises InputError naming the file and the column where it cannot be read or a column is missing.
    """
    # pandas costs time at start-up that a heap job should not pay
    import pandas as pd

    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(path, "table", str(error), "a CSV file") from error
    for column in columns:
        if column not in table:
            raise InputError(path, column, None, f"columns {', '.join(columns)}")
    return table

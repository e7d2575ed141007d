"""Published tables that results are set beside."""

import csv
from pathlib import Path

from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS

TABLE4_COLUMNS = (
    "solution",
    *PARAMETERS,
    "aor_predicted_deg",
    "height_predicted_mm",
    "aor_simulated_deg",
    "height_simulated_mm",
)


def published_count(path):
    """Number of solutions in a published table; InputError unless the table has its columns."""
    with Path(path).open(encoding="utf-8", newline="") as lines:
        rows = csv.DictReader(lines)
        columns = rows.fieldnames or []
        for column in TABLE4_COLUMNS:
            if column not in columns:
                raise InputError(path, "header", ",".join(columns), f"columns {', '.join(TABLE4_COLUMNS)}")
        return len(list(rows))

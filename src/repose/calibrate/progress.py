"""Announce on stderr the steps that take long."""

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

# With at least this many samples a step takes many seconds, so its start is announced.
MIN_ANNOUNCED_SAMPLES = 200


def announce(step: str, runs: "pd.DataFrame") -> None:
    """Print that a step begins, if the number of samples makes it slow.

    Parameters
    ----------
    step : str
        Description of the step, which begins with a verb.
    runs : pandas.DataFrame
        All runs, with the column `sample`.
    """
    n_samples = 0 if runs.empty else runs["sample"].nunique()
    if n_samples >= MIN_ANNOUNCED_SAMPLES:
        print(f"repose: {n_samples} samples: {step}", file=sys.stderr, flush=True)

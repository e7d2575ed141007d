"""Linear effect of each parameter on every response of the pile, from one end of its range to the other."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from repose.calibrate.parameter_space import ParameterSpace


def effects(
    samples: pd.DataFrame,
    runs: pd.DataFrame,
    space: ParameterSpace,
    responses: Sequence[str],
    at_equal: str = "",
) -> pd.DataFrame:
    """Least squares of the samples' mean responses in all free parameters: a row for each parameter and response.

    `samples` have ``sample`` and the parameters, `runs` ``sample`` and the responses. With `at_equal` this response is
    one more variable, so the effects are those at equal values of it. ``effect`` and its standard error ``effect_se``
    are over the whole range, in the response's unit.
    """
    means = runs.groupby("sample")[list(responses)].mean()
    table = (
        samples.set_index("sample")[list(space.free)].join(means, how="inner").dropna()
    )
    more = [at_equal] if at_equal else []
    design = np.column_stack([np.ones(len(table)), table[[*space.free, *more]]])
    inverse = np.linalg.inv(design.T @ design)
    rows = []
    for name in (name for name in responses if name not in more):
        slopes = inverse @ design.T @ table[name]
        left = table[name] - design @ slopes
        errors = np.sqrt(
            np.diag(inverse) * (left @ left) / (len(table) - design.shape[1])
        )
        for k, parameter in enumerate(space.free):
            width = space.high[k] - space.low[k]
            row = {
                "parameter": parameter,
                "response": name,
                "effect": width * slopes[k + 1],
            }
            rows.append(
                row | {"effect_se": width * errors[k + 1], "at_equal": at_equal}
            )
    return pd.DataFrame(rows)

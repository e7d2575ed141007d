"""Count the simulated samples that already meet all targets, and how far they spread."""

from collections.abc import Mapping
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets

if TYPE_CHECKING:
    import pandas as pd


def find_samples_inside(
    samples: "pd.DataFrame", space: ParameterSpace, targets: Targets
) -> dict[str, Any]:
    """Find the samples whose mean responses lie inside all target ranges.

    Parameters
    ----------
    samples : pandas.DataFrame
        A row for each simulated parameter set, with columns of the parameters and of
        the mean responses.
    space : ParameterSpace
        The parameters of the study.
    targets : Targets
        The targets of the study.

    Returns
    -------
    dict
        ``samples``, the number of all samples, and ``inside``, that of the samples
        inside all ranges. With two or more of these, ``spans`` has the fraction of its
        range over which each free parameter varies in them.
    """
    is_inside = np.ones(len(samples), bool)
    for target in targets:
        is_inside &= samples[target.name].between(target.low, target.high)
    samples_inside = samples[is_inside]
    found: dict[str, Any] = {"samples": len(samples), "inside": len(samples_inside)}
    if len(samples_inside) < 2:
        return found
    spans = {}
    for name in space.free:
        # Rounding may put a value a little outside its range.
        fractions = np.clip(space.fractions_of_range(name, samples_inside[name]), 0, 1)
        spans[name] = float(np.ptp(fractions))
    return found | {"spans": spans}


def describe_samples_inside(found: Mapping[str, Any]) -> str:
    """Describe how many samples meet all targets, and how far apart they are.

    `found` is the result of `find_samples_inside`. The description is empty for fewer
    than two samples inside the ranges.
    """
    if "spans" not in found:
        return ""
    narrowest_name, narrowest = min(found["spans"].items(), key=itemgetter(1))
    widest_name, widest = max(found["spans"].items(), key=itemgetter(1))
    return (
        f"{found['inside']} of the {found['samples']} simulated samples already lie "
        "inside all target ranges, some of them by chance. Their values span between "
        f"{100 * narrowest:.0f} % (for {narrowest_name}) and {100 * widest:.0f} % (for "
        f"{widest_name}) of the searched ranges."
    )

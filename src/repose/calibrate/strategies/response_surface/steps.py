"""The steps of the strategy `response_surface`, and the numbers of their samples.

Samples of the first step are numbered from 1001, of the second from 2001, and so on.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd

from repose.calibrate.designs.latin_hypercube import tabulate_parameter_sets
from repose.calibrate.designs.optimal import AllowedDesign, replace_forbidden
from repose.calibrate.designs.region import Region
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets
from repose.common.errors import InputError

STEPS = ("screening", "ascent", "surface", "check")
NUMBERS_PER_STEP = 1000
# Prefix of a column with a parameter in coded units.
CODED_PREFIX = "coded_"
# Column that marks the runs that replace forbidden ones. Only a study with constraints
# has it.
NEW_RUN_COLUMN = "is_new"


def make_samples(
    step: str,
    space: ParameterSpace,
    unit_points: np.ndarray,
    factors: Sequence[str],
    coded: np.ndarray,
) -> pd.DataFrame:
    """Make the table of the samples of a step.

    Parameters
    ----------
    step : str
        One of `STEPS`.
    space : ParameterSpace
        The parameters of the study.
    unit_points : numpy.ndarray, (n, d)
        The free parameters in the unit cube.
    factors : sequence of str
        The parameters that the step varies.
    coded : numpy.ndarray, (n, factors)
        The same samples in coded units.

    Returns
    -------
    pandas.DataFrame
        `sample`, the parameters, and the factors in coded units, whose names begin with
        `CODED_PREFIX`.
    """
    first = NUMBERS_PER_STEP * (STEPS.index(step) + 1) + 1
    table = tabulate_parameter_sets(unit_points, space, first)
    for name, column in zip(factors, np.asarray(coded).T, strict=True):
        table[CODED_PREFIX + name] = column
    return table


def list_factors(table: pd.DataFrame) -> tuple[str, ...]:
    """Return the parameters that a step varied, given its result of `make_samples`."""
    return tuple(
        name.removeprefix(CODED_PREFIX)
        for name in table
        if name.startswith(CODED_PREFIX)
    )


def select_good_samples(table: pd.DataFrame, dataset: pd.DataFrame) -> pd.DataFrame:
    """Select the good samples of a step (those with the status ok), with their responses.

    Parameters
    ----------
    table : pandas.DataFrame
        The samples of the step.
    dataset : pandas.DataFrame
        All samples with `status` and responses.

    Returns
    -------
    pandas.DataFrame
        A row for each good sample of the step: its factors in coded units, and the
        columns of the dataset.

    Raises
    ------
    InputError
        If a sample is not in the dataset, or none is good.
    """
    missing = sorted(set(table["sample"]) - set(dataset["sample"]))
    if missing:
        raise InputError(
            source="runs",
            key="sample",
            value=missing,
            allowed="all samples of the step",
        )
    coded_columns = [CODED_PREFIX + name for name in list_factors(table)]
    joined = table[["sample", *coded_columns]].merge(dataset, on="sample")
    good = joined[joined["status"] == "ok"].reset_index(drop=True)
    if good.empty:
        statuses = sorted(set(joined["status"]))
        raise InputError(
            source="runs",
            key="status",
            value=statuses,
            allowed="ok for at least one sample of the step",
        )
    return good


def compute_scale(targets: Targets) -> np.ndarray:
    """Compute the scale (k,) of the deviations from the targets.

    It is the number that counts as 100 % of each target, divided by the root of the
    weight of the target.
    """
    return targets.whole / np.sqrt(targets.weight)


# --- constraints ----------------------------------------------------------------------


def make_region(
    space: ParameterSpace,
    convert_to_unit: Callable[[np.ndarray], np.ndarray],
    factors: int,
) -> Region | None:
    """Make the region of the cube of a step that the constraints allow.

    Parameters
    ----------
    space : ParameterSpace
        The parameters of the study.
    convert_to_unit : callable
        Function that converts points (n, factors) in coded units to points (n, d) of
        the unit cube.
    factors : int
        Number of factors that the step varies.

    Returns
    -------
    Region or None
        None if there are no constraints.
    """
    if not space.constraints:
        return None
    return Region(lambda coded: space.compute_excesses(convert_to_unit(coded)), factors)


def move_forbidden_runs(
    coded: np.ndarray, region: Region | None, order: str, space: ParameterSpace
) -> AllowedDesign:
    """Replace the runs of a design that violate constraints with allowed ones.

    If the centre of the cube is forbidden, the centre runs of the design are moved to
    the centre of the allowed region. The other forbidden runs are replaced with
    D-optimal ones, which determine the coefficients of the model as well as possible.

    Parameters
    ----------
    coded : numpy.ndarray, (n, factors)
        The design.
    region : Region or None
        The allowed part of the cube; None if all of it is allowed.
    order : str
        Order of the model, as for `fit_model`.
    space : ParameterSpace
        The parameters, whose constraints an error names.

    Returns
    -------
    AllowedDesign
        As many runs as `coded`, and which of them are new.

    Raises
    ------
    InputError
        If the allowed runs do not determine all coefficients of the model.
    """
    if region is None:
        # No run is forbidden, so this returns the design itself.
        return replace_forbidden(coded, None, order)
    is_centre = (coded == 0).all(axis=1)
    # Both calls raise a ValueError if the allowed region is empty or too narrow.
    try:
        moved = np.where(is_centre[:, None], region.centre, coded)
        design = replace_forbidden(moved, region, order)
    except ValueError as error:
        constraints = ", ".join(constraint.text for constraint in space.constraints)
        raise InputError(
            source="configuration",
            key="constraints",
            value=constraints,
            allowed=(
                f"constraints that allow enough different runs for a {order} model of "
                f"response_surface; {error}"
            ),
        ) from None
    # The centre runs are also new if the centre is no longer that of the cube, at 0.
    has_moved_centre = region.centre.any()
    is_moved = is_centre & has_moved_centre
    return AllowedDesign(design.coded, design.is_new | is_moved)


def add_new_run_column(
    table: pd.DataFrame, is_new: np.ndarray, space: ParameterSpace
) -> pd.DataFrame:
    """Add the column `NEW_RUN_COLUMN` to the samples of a step, if there are constraints."""
    return table.assign(**{NEW_RUN_COLUMN: is_new}) if space.constraints else table


def count_new_runs(table: pd.DataFrame) -> int:
    """Count the runs of a step that took the place of forbidden ones."""
    return int(table[NEW_RUN_COLUMN].sum()) if NEW_RUN_COLUMN in table else 0


def describe_new_runs(table: pd.DataFrame) -> str:
    """Describe in a sentence how many runs of a step were replaced; empty if none was."""
    count = count_new_runs(table)
    if not count:
        return ""
    return (
        f" The constraints forbid {count} of the {len(table)} runs of the design; "
        "D-optimal runs and the centre of the allowed region replace them."
    )

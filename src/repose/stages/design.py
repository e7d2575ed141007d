"""The stage `design`: choose the parameter sets that are simulated first."""

from pathlib import Path

import pandas as pd

from repose.calibrate.designs.latin_hypercube import make_designs
from repose.calibrate.designs.settings import DesignSettings
from repose.calibrate.parameter_space import ParameterSpace
from repose.common.files import StrPath, write_table


def write_design(
    parameters: ParameterSpace, settings: DesignSettings, out_dir: StrPath
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make the design and compare it with others; write samples.csv and comparison.csv.

    Returns
    -------
    pandas.DataFrame
        The samples.
    pandas.DataFrame
        The comparison of designs.
    """
    samples, comparison = make_designs(parameters, settings)
    write_table(Path(out_dir) / "samples.csv", samples, float_format="%.10g")
    write_table(Path(out_dir) / "comparison.csv", comparison, float_format="%.6g")
    return samples, comparison

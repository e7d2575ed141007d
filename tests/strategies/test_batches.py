"""Runs as a strategy takes them, beside the tables of the stage dataset from which they are read."""

import numpy as np
import pandas as pd
import pytest
from shared import targets_of
from synthetic import SPACE

from repose.chain.dataset import assemble
from repose.core.parameters import PARAMETERS
from repose.strategies import batches
from repose.strategies.runs import samples_of_runs
from repose.strategies.sequential.strategy import observed_of


def job(sample, name, good):
    """A job whose runs are good or not."""
    runs = [
        {"seed": seed, "status": "ok", "reason": "", name: 50.0 + sample + seed**2}
        if one
        else {"seed": seed, "status": "jammed", "reason": "stuck", name: None}
        for seed, one in enumerate(good)
    ]
    return {"sample": sample, "parameters": {}, "runs": runs}


@pytest.mark.parametrize("names", [("height_mm",), ("height_mm", "drum_slip_deg")])
def test_samples_are_those_of_the_dataset_also_where_runs_failed(names):
    targets = targets_of(**dict.fromkeys(names, 60.0))
    good = {
        "height_mm": [(1, 1, 1), (1, 0, 1), (0, 0, 1), (1, 1, 1), (0, 0, 0)],
        "drum_slip_deg": [(1, 1, 1), (1, 1, 0), (1, 1, 1), (0, 1, 0), (0, 0, 0)],
    }
    samples = pd.DataFrame(SPACE.values(np.random.default_rng(1).random((5, 6))), columns=list(PARAMETERS))
    samples.insert(0, "sample", range(1, 6))
    jobs = {
        target.response.apparatus: {k: job(k, target.name, good[target.name][k - 1]) for k in range(1, 6)}
        for target in targets
    }
    dataset, runs = assemble(samples, jobs, targets)
    data = batches.data_of(dataset, runs, targets)
    table = samples_of_runs(data, SPACE, targets)
    ok = dataset["status"] == "ok"
    assert ((table["status"] == "ok") == ok).all()
    assert (table["n_seeds"] == dataset["n_seeds"]).all()
    columns = ["sample", *PARAMETERS, *targets.names, *targets.errors]
    pd.testing.assert_frame_equal(table.loc[ok, columns], dataset.loc[ok, columns], check_dtype=False)
    observed, failed = observed_of(data, SPACE, targets)
    assert len(data) == 15
    np.testing.assert_allclose(SPACE.values(observed.unit), samples.loc[ok, list(PARAMETERS)])
    np.testing.assert_allclose(SPACE.values(failed), samples.loc[~ok, list(PARAMETERS)])

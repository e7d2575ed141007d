"""The proposals of the rounds on files."""

import os
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from repose.chain import invert, train
from repose.chain.dataset import read_definitions
from repose.core.errors import InputError
from repose.core.files import write_table
from repose.core.responses import Definitions, require_same_definitions
from repose.strategies.base import Studied
from repose.strategies.batches import read
from repose.strategies.refined.strategy import follow


def run_propose(
    folders: Sequence[str | os.PathLike],
    study: Studied,
    out_dir: str | os.PathLike,
    definitions: Definitions,
    source: object = "configuration",
) -> pd.DataFrame:
    """Write the proposal of the next round, and in network/ and miga/ the fit and the search behind it; return it.

    `folders` hold the design and all rounds so far. InputError, with `source`, for other `definitions`.
    """
    for folder in folders:
        own, path = read_definitions(Path(folder) / "dataset.csv")
        require_same_definitions(own, path, definitions, source)
    data = read(folders, study.targets)
    try:
        now = follow(study, data, len(folders) - 1)
    except InputError as error:
        raise InputError(folders[-1], error.key, error.value, error.allowed) from None
    for model in (now.training.model, now.model):
        model.describe(model.inputs, model.outputs, definitions, model.samples)
    out = Path(out_dir)
    train.write(now.training, out / "network")
    now.model.save(out / "miga" / "network.json")
    invert.write(now.inversion, out / "miga")
    write_table(out / "proposal.csv", now.proposal)
    return now.proposal

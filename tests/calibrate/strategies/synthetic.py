"""A simulator in one line for the strategies: two responses that three parameters set."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd
from shared import RANGES, calibration_settings_of, entries, target

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.strategies.response_surface import ResponseSurfaceSettings
from repose.calibrate.targets import Targets

SPACE = contact_space(RANGES)
# What `responses` gives at mus_gg 0.61, mur_gg 0.05, mus_gp 0.68.
TARGETS = Targets.of(
    [target("aor_deg", 33.89, 2.0, 32, 36), target("height_mm", 65.28, 4.0, 62, 68)]
)
SECTION = {
    "seeds": 3,
    "screening_runs": 12,
    "significance": 0.05,
    "most_factors": 4,
    "steps": 5,
    "surface": "box_behnken",
    "centres": 5,
    "reach": 0.25,
    "checks": 8,
}
SETTINGS = ResponseSurfaceSettings(**SECTION)
MATTER = {"mus_gg", "mur_gg", "mus_gp"}


class Study(NamedTuple):
    parameters: ParameterSpace
    targets: Targets
    config: dict
    definitions: Mapping = MappingProxyType({})

    @property
    def settings(self):
        return calibration_settings_of(self.config)


def study(targets=None, space=None, **sections):
    targets = TARGETS if targets is None else targets
    space = SPACE if space is None else space
    return Study(space, targets, configuration(targets, space, **sections))


def configuration(targets, space, **sections):
    parameters = {name: {"fixed": value} for name, value in space.fixed.items()}
    for name, low, high in zip(
        space.free, space.low.tolist(), space.high.tolist(), strict=True
    ):
        parameters[name] = [low, high]
        if name in space.prior:
            mean, sd = space.prior[name]
            parameters[name] = {"range": [low, high], "prior": {"mean": mean, "sd": sd}}
    base = {
        "label": "made_up",
        "results_dir": "results",
        "small_run": False,
        "design": {"seed": 1},
        "targets": entries(targets),
        "parameters": parameters,
        "miga": {"solutions": 20, "distance": 0.02},
    }
    return base | sections


def responses(table, noise=0.0, seed=1):
    """Angle and Height of parameter sets, with noise in percent: friction and rolling friction set both."""
    unit = SPACE.unit(table[list(PARAMETERS)].to_numpy(float))
    friction = unit[:, 1]
    rolling = unit[:, 2]
    plate = unit[:, 4]
    angle = (
        24
        + 7 * friction
        + 8 * rolling
        - 2.5 * rolling**2
        + 1.5 * plate
        + friction * rolling
    )
    height = 50 + 11 * friction + 9 * rolling + 6 * plate - 3 * plate**2
    values = np.column_stack([angle, height])
    return values * (
        1 + noise / 100 * np.random.default_rng(seed).normal(size=values.shape)
    )


def runs_of(table, pours, noise, seed, names=TARGETS.names):
    """Single runs of samples with noise in percent, as the verb dataset writes them."""
    every = table.loc[table.index.repeat(pours)].reset_index(drop=True)
    values = pd.DataFrame(responses(every, noise, seed), columns=list(TARGETS.names))[
        list(names)
    ]
    return pd.concat(
        [
            every[["sample"]].assign(
                seed=np.arange(len(every)), status="ok", reason=""
            ),
            values,
        ],
        axis=1,
    )


def write_tables(folder, table, runs, targets=TARGETS):
    """Tables of a batch as the verb dataset writes them."""
    folder.mkdir(parents=True, exist_ok=True)
    grouped = runs[runs["status"] == "ok"].groupby("sample")
    data = table[["sample", *PARAMETERS]].assign(reason="")
    data["n_seeds"] = grouped.size().reindex(table["sample"], fill_value=0).to_numpy()
    data["status"] = np.where(data["n_seeds"] > 0, "ok", "jammed")
    for entry in targets:
        data[entry.name] = (
            grouped[entry.name].mean().reindex(table["sample"]).to_numpy()
        )
        data[entry.response.standard_error] = (
            grouped[entry.name].sem().reindex(table["sample"]).to_numpy()
        )
    data.to_csv(folder / "dataset.csv", index=False)
    runs.to_csv(folder / "runs.csv", index=False)


def write_poured(folder, table, noise=0.0, seed=1, seeds=3):
    write_tables(folder, table, runs_of(table, seeds, noise, seed))


def dataset(table, noise=0.0, seed=1):
    found = table[["sample", *PARAMETERS]].assign(status="ok", reason="", n_seeds=3)
    found[list(TARGETS.names)] = responses(table, noise, seed)
    return found.assign(**{name: 0.1 for name in TARGETS.errors})

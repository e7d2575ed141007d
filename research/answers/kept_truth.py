"""A process fitted to kept pours of the default study: the truth of simulated data sets.

`Truth.of_kept` pools the pours of `results/published` that have today's laws and line: the design by two processors,
the pool of comparisons with its fresh points, and the answers that were simulated again, 60 to 180 pours each. A
Gaussian process of these gives the mean responses of any parameters; single pours scatter about it as the kept ones do.
"""

from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import pandas as pd

from repose.calibrate.surrogates import Surrogate, make
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Targets
from repose.calibrate.training import Replicates
from repose.common.files import read_table
from repose.config.pipeline import PipelineConfig
from research.comparison.emulator import ScalingNoise, scaling_noise
from research.comparison.points import Points, joined, read

KEPT = Path("results/published")
# Folder and prefix of the tables of samples and of their pours.
TABLES = (
    ("goji_berry", ""),
    ("comparison", ""),
    ("comparison/pool", ""),
    ("comparison/pool", "fresh_"),
)
# Answers of which the means are kept, with the number of their pours.
ANSWERS = ("goji_berry/validation/table4.csv",)
ROUNDS_OF_REFINEMENT = "refined/batches.csv"


class Truth(NamedTuple):
    """The simulated simulator."""

    process: Surrogate
    noise: ScalingNoise
    pours: int  # to which it is fitted

    @classmethod
    def of_kept(cls, study: PipelineConfig, folder: Path = KEPT) -> Self:
        """Fit the process to all kept pours."""
        names = study.targets.names
        parts = []
        for place, prefix in TABLES:
            tables = folder / place / f"{prefix}dataset.csv"
            runs = folder / place / f"{prefix}runs.csv"
            parts.append(read(tables, runs, names))
        points = joined(parts)
        counts = points.counts().astype(float)
        X = points.X
        means = points.means()
        for answers in _answers(folder, study):
            X = np.vstack([X, answers[list(study.parameters.names)].to_numpy(float)])
            simulated = [response.simulated for response in study.targets.responses]
            means = np.vstack([means, answers[simulated].to_numpy(float)])
            counts = np.concatenate([counts, answers["n_seeds"].to_numpy(float)])
        covariance = points.covariance()
        process = make(
            "gaussian_process", NetworkSettings.from_keys(dict(study.config["network"]))
        )
        process.fit(X, means, precision=counts, noise_covariance=covariance)
        noise = scaling_noise(points, covariance)
        return cls(process, noise, int(counts.sum()))

    def mean(self, X: np.ndarray) -> np.ndarray:
        """Mean responses (n, k) at parameters X (n, d)."""
        return self.process.predict(X)

    def pour(
        self, X: np.ndarray, seeds: int, random: np.random.Generator
    ) -> np.ndarray:
        """Single pours (n, seeds, k) at parameters X (n, d)."""
        return self.mean(X)[:, None] + self.noise.draw(X, seeds, random)


def _answers(folder: Path, study: PipelineConfig):
    """Tables of the answers with their simulated means and numbers of pours."""
    for path in (*ANSWERS, ROUNDS_OF_REFINEMENT):
        yield read_table(folder / path, (*study.parameters.names, "n_seeds"))


class DataSet(NamedTuple):
    """Samples with their simulated pours, as tables and as arrays."""

    X: np.ndarray  # (n, d)
    values: list[np.ndarray]  # the pours (pours, k) of each sample

    def and_pours(self, X: np.ndarray, values: np.ndarray) -> Self:
        """Add samples with pours (n, seeds, k)."""
        return type(self)(np.vstack([self.X, X]), [*self.values, *values])

    @property
    def pours(self) -> int:
        """Number of all pours."""
        return sum(map(len, self.values))

    def tables(
        self, study: PipelineConfig, targets: Targets
    ) -> tuple[pd.DataFrame, pd.DataFrame]:
        """The table of samples, and that of single pours."""
        samples = pd.DataFrame(self.X, columns=list(study.parameters.names))
        samples.insert(0, "sample", np.arange(1, len(samples) + 1))
        samples[list(targets.names)] = [values.mean(axis=0) for values in self.values]
        samples["status"] = "ok"
        runs = pd.DataFrame(np.concatenate(self.values), columns=list(targets.names))
        counts = [len(values) for values in self.values]
        runs.insert(0, "sample", np.repeat(samples["sample"], counts).to_numpy())
        runs["status"] = "ok"
        return samples, runs

    def fit(self, study: PipelineConfig, settings: NetworkSettings) -> Surrogate:
        """Fit the study's surrogate to all samples, as its last fit is."""
        targets = study.targets
        samples, runs = self.tables(study, targets)
        numbers = samples["sample"].tolist()
        noise = Replicates.estimate(runs, numbers, targets)
        model = make(study.settings.surrogate, settings)
        model.describe(study.parameters.names, targets.names, {}, numbers)
        means = samples[list(targets.names)].to_numpy(float)
        return model.fit(self.X, means, **noise._asdict())


def designed(study: PipelineConfig, folder: Path = KEPT) -> np.ndarray:
    """Parameters (150, d) of the default's design."""
    design = read_table(
        folder / "goji_berry/design/samples.csv", study.parameters.names
    )
    return design[list(study.parameters.names)].to_numpy(float)


def points_of(data: DataSet) -> Points:
    """A data set as `Points`; NaN fills the samples with fewer pours."""
    return joined(
        [
            Points(data.X[k : k + 1], values[None])
            for k, values in enumerate(data.values)
        ]
    )

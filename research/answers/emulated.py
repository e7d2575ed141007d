"""The emulated simulator of the benchmarks of the sequential strategy, and the options that they share.

A Gaussian process (Matern 5/2) fitted to the poured points of a pool is the truth, and a pour scatters about it as the
pool's pours do. The strategy's own model is such a process, too, so there are other truths:

  networks     the mean of several networks fitted to the same points
  ripple       the process with waves of 0.8 mm from crest to trough in the Height, 0.1 of a range long, as large a
               share of any other response: no budget resolves them
  deep_ripple  the same with 1.6 mm
  two_minima   the process with its most effective parameter folded: every value of it has a twin on the other side
"""

import argparse
from pathlib import Path

import numpy as np
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from repose.bench.space import contact_space
from repose.calibrate.strategies import plan
from repose.calibrate.strategies.sequential.kriging import ObservedSamples
from research.comparison import points
from research.comparison.emulator import scaling_noise, with_process
from research.comparison.models import configured_network

RIPPLE = {"ripple": 0.0061, "deep_ripple": 0.0122}  # amplitude, share of the response
WAVE_NUMBER = 60.0  # over a range
EMULATORS = ("process", "networks", *RIPPLE, "two_minima")


def options(doc: str, out: str | Path) -> argparse.ArgumentParser:
    """The options of every benchmark with emulated pours; `doc` is its text of help."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--pool", type=Path, default=Path("results/published/height_alone/pool")
    )
    parser.add_argument("--config", default="config/config.yaml")
    parser.add_argument("--responses", nargs="+", default=["height_mm"])
    parser.add_argument("--out", type=Path, default=Path(out))
    return parser


class Simulator:
    """The emulated simulator, with random numbers of its own for each use."""

    def __init__(
        self,
        folder,
        names,
        config,
        emulator="process",
        noise_percent=plan.DEFAULT_NOISE_PERCENT,
    ):
        """`noise_percent` of a pour; `plan.NOISE_PERCENT` is as in the pool."""
        self.times = noise_percent / plan.DEFAULT_NOISE_PERCENT
        space = contact_space(config["parameters"])
        parts = []
        for part in ("", "fresh_"):
            dataset = folder / f"{part}dataset.csv"
            simulated = points.read(dataset, folder / f"{part}runs.csv", names)
            parts.append(simulated._replace(X=space.unit(simulated.X)))
        poured = points.joined(parts)
        covariance = poured.covariance()
        errors = np.sqrt(np.diagonal(covariance) / poured.counts()[:, None])
        if emulator == "networks":
            settings = config["network"] | {"surrogate": "network_ensemble"}
            networks = configured_network(poured, settings, 1)

            def mean(unit):
                return networks(unit)[0]

            self.mean = mean
        else:
            self.mean = with_process(poured, errors, covariance, _matern, 1).mean
        if emulator in RIPPLE:
            self.mean = _rippled(self.mean, space.dimensions, RIPPLE[emulator])
        elif emulator == "two_minima":
            self.mean = _folded(self.mean, space.dimensions)
        self.noise = scaling_noise(poured, covariance)

    def pour(self, unit, pours, random):
        noise = self.times * self.noise.draw(unit, pours, random)
        return ObservedSamples(unit, self.mean(unit)[:, None] + noise)


def _matern(d):
    return ConstantKernel(1.0, (1e-2, 1e3)) * Matern(np.ones(d), (0.05, 100.0), nu=2.5)


def _rippled(mean, d, amplitude):
    """The mean responses with waves along one direction."""
    wave = np.random.default_rng(60).standard_normal(d)
    wave *= WAVE_NUMBER / np.linalg.norm(wave)
    return lambda unit: mean(unit) * (1 + amplitude * np.sin(unit @ wave))[:, None]


def _folded(mean, d):
    """The mean responses at points whose most effective parameter goes up and down again."""
    unit = np.random.default_rng(2).random((4000, d))
    correlation = np.abs(np.corrcoef(unit.T, mean(unit).T)[:d, d:])
    folded = correlation.max(axis=1).argmax()

    def two_minima(unit):
        unit = unit.copy()
        unit[:, folded] = np.sin(np.pi * unit[:, folded]) ** 2
        return mean(unit)

    return two_minima

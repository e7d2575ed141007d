"""A bench test: grains are dropped on a plate, and how far they spread is a response.

Copied to `src/repose/bench/spread.py` and imported in `repose/bench/__init__.py`, it is
known to every part of the program: `targets:` may name its response, and pours, tables
and workflow run it. Here it is registered by running it.
"""

from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from repose import dem
from repose.bench.bench_test import Arrays, BenchTest, Outcome, Run, bench, register
from repose.bench.factory import Disc, Factory, fill
from repose.bench.scene import Scene
from repose.bench.settings import Poured, SceneSettings
from repose.bench.trial import Progress, Trial
from repose.calibrate.responses import Response
from repose.common.section import Contradictions

NAME = "spread"
# 1. What it gives. `definition` names the keys on which the number depends.
SPREAD = Response(
    name="spread_mm",
    unit="mm",
    label="mean distance from the axis",
    symbol="spread",
    apparatus=NAME,
    low=0.0,
    high=1000.0,
    definition=("spread.height_mm",),
)


# 2. What its section of the configuration holds: each key with its type and bounds.
class SpreadSettings(Poured):
    """The section `spread`, with the keys of every test that pours."""

    height_mm: float = Field(ge=1, le=1000)
    duration_s: float = Field(ge=0.1, le=60)


# 3. The bench test: its scene, a run of it, and the responses of a run that was saved.
@register(NAME)
class SpreadTest(BenchTest[SpreadSettings]):
    """Grains that are dropped on a plate."""

    settings = SpreadSettings
    responses = (SPREAD,)
    statuses = ("ok", "unstable")
    required_arrays = ("position",)
    summary = "spread {spread_mm:.1f} mm"
    # A small and quick run, for the tests.
    example: ClassVar = {
        "spread": {
            "berries": 20,
            "rate_per_s": 20.0,
            "seeds": 2,
            "height_mm": 100.0,
            "duration_s": 2.0,
        },
        "targets": [
            {"response": "spread_mm", "value": 30.0, "sd": 2.0, "repetitions": 5}
        ],
    }

    def world(self, scene: Scene, largest_radius_m: float) -> dict[str, Any]:
        """Describe a plate."""
        section = self.section(scene.settings)
        top = 1e-3 * section.height_mm + 4.0 * largest_radius_m
        return {
            "capacity": section.berries,
            "walls": {"plate": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall")},
            "lower": (-0.2, -0.2, 0.0),
            "upper": (0.2, 0.2, top),
        }

    def run(
        self,
        scene: Scene,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> Run:
        """Drop the grains one by one, and let them roll."""
        section = self.section(scene.settings)
        trial = Trial(self.build, scene, section.berries, interval_s, progress)
        height_m = 1e-3 * section.height_mm
        area = Disc(2.0 * scene.particle.bounding_radius_m, height_m)
        factory = Factory(area, section.berries, section.rate_per_s)
        last_step = scene.simulation.steps(section.duration_s)
        with trial.bound(height_m).guard():
            fill(trial, factory, last_step)
            trial.run_to(last_step)
        outcome = Outcome(unstable=trial.broken, overlap_share=trial.overlap_share)
        return self.make_run(scene, outcome, trial.grains(), trial.frames())

    def measure_arrays(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
        """Measure the spread."""
        x, y, _ = arrays["position"].astype(float).T
        return {SPREAD.name: float(1e3 * np.hypot(x, y).mean())}

    def duration_s(self, settings: SceneSettings) -> float:
        """Return the longest simulated time of a run [s]."""
        return self.section(settings).duration_s

    def contradictions(self, settings: SceneSettings) -> Contradictions:
        """Yield keys whose values do not go together, with the allowed values."""
        section = self.section(settings)
        fall_s = (2e-3 * section.height_mm / settings.simulation.gravity_m_s2) ** 0.5
        if section.duration_s < fall_s:
            yield "spread.duration_s", f"at least {fall_s:.2g}, the time of the fall"


def main(berries: int = 20, duration_s: float = 2.0) -> None:
    """Drop grains without and with rolling friction."""
    from repose.bench.parameters import PARAMETERS
    from repose.config.pipeline import PipelineConfig
    from repose.grain.build import ellipsoid_mesh, fit_particle
    from repose.stages.job import run_once

    test = bench(NAME)
    config = PipelineConfig.load("config/quick.yaml").config
    config["spread"] = test.example["spread"] | {
        "berries": berries,
        "rate_per_s": 2.0 * berries / duration_s,
        "duration_s": duration_s,
    }
    config["targets"] = [
        {**target, "apparatus": NAME} for target in test.example["targets"]
    ]
    grain = {"shear_modulus_pa": 4.3e4, "poisson_ratio": 0.32}
    particle = fit_particle(ellipsoid_mesh([21.0, 11.4, 9.9]), density_kg_m3=840.0)
    for rolling in (0.0, 0.3):
        values = (0.2, 0.6, rolling, 0.2, 0.6, rolling)
        parameters = dict(zip(PARAMETERS, values, strict=True))
        scene = Scene.of(config, parameters, grain, particle, seed=1)
        measured, _ = run_once(test, scene)
        print(f"rolling friction {rolling}: {test.summary.format(**measured)}")


if __name__ == "__main__":
    main()

"""A bench test of one's own: berries are dropped on a plate, and how far they spread is a response.

Once this module is in `repose/bench/` and imported there, `targets:` may name the response, and the verbs pour and
measure_runs, the dataset and the workflow know the bench test. Here it is registered by running it.
"""

from typing import Any

import numpy as np
from pydantic import Field

from repose import dem
from repose.bench.bench_test import (
    Arrays,
    BenchTest,
    Contradictions,
    Ending,
    Progress,
    Run,
    Scene,
    bench,
    register,
    stated,
)
from repose.bench.factory import Disc, fill
from repose.bench.scene import Trial
from repose.bench.settings import Poured, SceneSettings
from repose.calibrate.responses import Response

NAME = "drop"
# 1. What it gives. `definition` names the keys on which the number depends.
SPREAD = Response(
    name="spread_mm",
    unit="mm",
    label="mean distance from the axis",
    symbol="spread",
    apparatus=NAME,
    low=0.0,
    high=1000.0,
    definition=("drop.height_mm",),
)


# 2. What its section of the configuration holds: each key with its type and bounds.
class DropSettings(Poured):
    """The section `drop`; `berries`, `rate_per_s` and `seeds` are those of every test that pours."""

    height_mm: float = Field(ge=1, le=1000)
    duration_s: float = Field(ge=0.1, le=60)


# 3. The bench test: its scene, a run of it, and the responses of a run that was saved.
@register(NAME)
class DropTest(BenchTest[DropSettings]):
    """Grains that are dropped on a plate."""

    settings = DropSettings
    responses = (SPREAD,)
    statuses = ("ok", "unstable")
    required_arrays = ("position",)
    summary = "spread {spread_mm:.1f} mm"

    def world(self, scene: Scene, reach_m: float) -> dict[str, Any]:
        """Describe a plate."""
        section = self.section(scene.settings)
        return {
            "capacity": section.berries,
            "walls": {"plate": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall")},
            "lower": (-0.2, -0.2, 0.0),
            "upper": (0.2, 0.2, 1e-3 * section.height_mm + 4.0 * reach_m),
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
        height_m, end = (
            1e-3 * section.height_mm,
            scene.simulation.steps(section.duration_s),
        )
        with trial.bound(height_m).guard():
            fill(
                trial,
                Disc(2.0 * scene.particle.bounding_radius_m, height_m),
                section,
                end,
            )
            trial.run_to(end)
        return self.ended(
            scene, Ending(unstable=trial.broken), trial.grains(), trial.frames()
        )

    def values(self, arrays: Arrays, scene: Scene) -> dict[str, Any]:
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
        early = section.duration_s < fall_s
        return stated(
            (early, "drop.duration_s", f"at least {fall_s:.2g}, the time of the fall")
        )


def main(berries: int = 20, duration_s: float = 2.0) -> None:
    """Drop berries without and with rolling friction."""
    from repose.bench.parameters import PARAMETERS
    from repose.config.pipeline import PipelineConfig
    from repose.grain.build import ellipsoid_mesh, fit_particle
    from repose.stages.job import run_once

    config = PipelineConfig.load("config/quick.yaml").config
    rate = 2.0 * berries / duration_s
    config["drop"] = {
        "berries": berries,
        "rate_per_s": rate,
        "seeds": 1,
        "height_mm": 100.0,
        "duration_s": duration_s,
    }
    config["targets"] = [
        {
            "response": "spread_mm",
            "apparatus": "drop",
            "value": 30.0,
            "sd": 2.0,
            "repetitions": 5,
            "range": [25.0, 35.0],
        }
    ]
    berry = {"shear_modulus_pa": 4.3e4, "poisson_ratio": 0.32}
    particle = fit_particle(ellipsoid_mesh([21.0, 11.4, 9.9]), density_kg_m3=840.0)
    for rolling in (0.0, 0.3):
        parameters = dict(
            zip(PARAMETERS, (0.2, 0.6, rolling, 0.2, 0.6, rolling), strict=True)
        )
        measured, _ = run_once(
            bench(NAME), Scene.of(config, parameters, berry, particle, 1)
        )
        print(f"rolling friction {rolling}: {bench(NAME).summary.format(**measured)}")


if __name__ == "__main__":
    main()

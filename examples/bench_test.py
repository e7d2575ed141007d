"""A bench test of one's own: berries are dropped on a plate, and how far they spread is a response.

Once this module is in `repose/apparatus/` and imported there, `targets:` may name the response, and the verbs pour and
measure_runs, the dataset and the workflow know the bench test. Here it is registered by running it.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from repose import dem
from repose.apparatus.bench_test import BenchTest, Config, Run, register
from repose.apparatus.bounds import Bounded, Unstable
from repose.apparatus.factory import Disc, fill
from repose.apparatus.scene import Filmed, berry_simulation
from repose.apparatus.settings import SimulationSettings
from repose.core.responses import Response
from repose.core.runs import Recorded
from repose.core.section import Section, Seeds

if TYPE_CHECKING:
    from repose.particle.particle import Particle

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
class Settings(Section):
    """The section `drop`."""

    berries: int = Field(ge=1, le=1000)
    seeds: Seeds
    height_mm: float = Field(ge=1, le=1000)
    duration_s: float = Field(ge=0.1, le=60)


def contradictions(config: Config) -> Iterator[tuple[str, str]]:
    """Keys whose values do not go together, and the allowed values."""
    gravity = SimulationSettings.of(config).gravity_m_s2
    fall_s = (2e-3 * config[NAME]["height_mm"] / gravity) ** 0.5
    if config[NAME]["duration_s"] < fall_s:
        yield "drop.duration_s", f"at least {fall_s:.2g}, the time of the fall"


# 3. The scene, and a run of it.
def build(
    config: Config,
    parameters: Mapping[str, float],
    particle: "Particle",
    berry: Mapping[str, Any],
    largest_scale: float = 1.0,
) -> dem.Simulation:
    """The empty simulation of a plate."""
    top = 1e-3 * config[NAME]["height_mm"] + 4.0 * particle.bounding_radius_m
    return berry_simulation(
        config,
        parameters,
        particle,
        berry,
        config[NAME]["berries"],
        walls={"plate": dem.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "wall")},
        lower=(-0.2, -0.2, 0.0),
        upper=(0.2, 0.2, top),
        largest_scale=largest_scale,
    )


def run(
    config: Config,
    parameters: Mapping[str, float],
    seed: int,
    particle: "Particle",
    berry: Mapping[str, Any],
    interval_s: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> Run:
    """Drop the berries within half of the time, and let them roll."""
    section, settings = config[NAME], SimulationSettings.of(config)
    simulation = build(config, parameters, particle, berry)
    height_m = 1e-3 * section["height_mm"]
    bounded = Bounded(simulation, height_m)
    filmed = Filmed(bounded, interval_s, progress)
    end = settings.steps(section["duration_s"])
    source = {"berries": section["berries"], "rate_per_s": 2.0 * section["berries"] / section["duration_s"]}
    factory = Disc(2.0 * particle.bounding_radius_m, height_m)
    record = {"seed": int(seed), "status": "ok", "reason": ""}
    try:
        fill(simulation, factory, source, seed, end, filmed.run_to)
        filmed.run_to(end)
        bounded.look()
    except Unstable as broken:
        record |= {"status": "unstable", "reason": str(broken)}
    return Run(record, {"position": simulation.positions.astype(np.float32)}, filmed.frames())


# 4. The responses of a run that was saved.
def measure(
    record: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
    config: Config,
    particle: "Particle",
    berry: Mapping[str, Any],
) -> dict[str, Any]:
    """The record with the spread; None where the run failed."""
    spread = None
    if record["status"] == "ok":
        x, y, _ = arrays["position"].astype(float).T
        spread = float(1e3 * np.hypot(x, y).mean())
    return {**record, SPREAD.name: spread}


# 5. The registration.
DROP = register(
    BenchTest(
        name=NAME,
        responses=(SPREAD,),
        recorded=Recorded(means=(SPREAD.name,), single=(SPREAD.name,)),
        statuses=("ok", "unstable"),
        settings=Settings,
        build=build,
        run=run,
        measure=measure,
        duration_s=lambda config: config[NAME]["duration_s"],
        contradictions=contradictions,
        kept=("position",),
        in_words="spread {spread_mm:.1f} mm",
    )
)


def main(berries: int = 20, duration_s: float = 2.0) -> None:
    """Drop berries without and with rolling friction."""
    from repose.apparatus.job import run_once
    from repose.config.study import Study
    from repose.core.parameters import PARAMETERS
    from repose.particle.build import ellipsoid_mesh, fit_particle

    config = Study.load("config/quick.yaml").config
    config["drop"] = {"berries": berries, "seeds": 1, "height_mm": 100.0, "duration_s": duration_s}
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
        parameters = dict(zip(PARAMETERS, (0.2, 0.6, rolling, 0.2, 0.6, rolling), strict=True))
        measured, _ = run_once(DROP, config, parameters, 1, particle, berry)
        print(f"rolling friction {rolling}: {DROP.in_words.format(**measured)}")


if __name__ == "__main__":
    main()

"""Effect of the time step on restitution and on the responses of a pile."""

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from repose.core.published import representative
from repose.core.responses import Response
from repose.core.runs import mean_and_error
from repose.core.targets import Targets
from repose.dem import Contact

from .case import Curve, Effort, Panel, Result, Row, close, reported
from .machine import berry_simulation

TIME_STEPS_S = (2.9e-5, 5e-5, 1e-4, 2e-4, 2.5e-4, 3e-4, 4e-4, 1e-3)
RECOMMENDED_S = 2.5e-4
PHASES = 12  # number of places within a step at which the impact begins
ASKED = 0.2
SPHERE_M = 0.00667  # radius of a sphere of the berry's volume
REFUSED = "refused by the simulator"


def restitution_at(step_s: float, **laws: Any) -> tuple[float, float]:
    """Mean restitution, and its standard error, of two spheres of a berry's volume that meet at 1.4 m/s.

    The impact begins at `PHASES` evenly spaced places within a time step. ValueError if the simulator refuses the step.
    """
    impacts = []
    for phase in np.arange(PHASES) / PHASES:
        contact, axes = Contact(ASKED, 0.0, 0.0), (SPHERE_M,) * 3
        simulation = berry_simulation(contact, step_s, capacity=2, axes=axes, **laws)
        simulation.add("berry", (-0.0068 - 0.7 * phase * step_s, 0.0, 0.0), velocity_m_s=(0.7, 0.0, 0.0))
        simulation.add("berry", (0.0068, 0.0, 0.0), velocity_m_s=(-0.7, 0.0, 0.0))
        simulation.run_steps(round(0.1 / step_s))
        impacts.append((simulation.velocities[1, 0] - simulation.velocities[0, 0]) / 1.4)
    return _mean_and_error(impacts)


def longest_step_named(message: str) -> float:
    """Longest time step [s] that the simulator's refusal names; NaN if the message has none."""
    named = re.search(r"at most ([-+.e\d]+)", message)
    return float(named.group(1)) if named else math.nan


def _mean_and_error(values: Sequence[float]) -> tuple[float, float]:
    """Mean and standard error, the latter NaN for one value."""
    mean, error = mean_and_error(values)
    return math.nan if mean is None else mean, math.nan if error is None else error


def _runs(step_s: float, pile: tuple, seeds: int) -> list[dict[str, Any]]:
    """Records of the runs of the published representative solution that can be used, in each target's bench test."""
    from repose.apparatus import bench
    from repose.apparatus.job import run_once

    config, particle, berry = pile
    changed = {**config, "simulation": {**config["simulation"], "time_step_s": step_s}}
    parameters = representative(config["validation"]["published"])
    records = [
        run_once(bench(name), changed, parameters, seed, particle, berry)[0]
        for name in Targets.of(config["targets"]).apparatus
        for seed in range(1, seeds + 1)
    ]
    return [record for record in records if record["status"] == "ok"]


def time_steps(effort: Effort) -> Result:
    """Restitution at each of `TIME_STEPS_S`, and the targets' responses if `effort.pile` is given.

    Only the restitution at the finest step is judged. A step that the simulator refuses has a row for the refusal.
    """
    rows, bounces, piles = [], [], []
    for step in TIME_STEPS_S:
        at = f"time step {step:.3g} s" + (" (recommended)" if step == RECOMMENDED_S else "")
        try:
            bounces.append((step, *restitution_at(step, **effort.laws)))
            rows.append(
                reported(
                    f"{at}: restitution",
                    "",
                    bounces[-1][1],
                    f"standard error {bounces[-1][2]:.2g}",
                    ASKED,
                    "asked for",
                )
            )
            if effort.pile is not None:
                piles += _pile_rows(rows, at, step, effort.pile, effort.seeds)
        except ValueError as error:
            limit = longest_step_named(str(error))
            rows.append(reported(f"{at}: longest step allowed", "s", limit, f"{REFUSED}: {error}"))
    finest = bounces[0]
    steps, bounced, errors = np.array(bounces).T
    rows.append(
        close("restitution at the finest step", "", finest[1], ASKED, tolerance=0.01, source="asked for")
    )
    panels = [
        Panel(
            "time step (s)",
            "restitution",
            (
                Curve("asked for", [TIME_STEPS_S[0], 3e-4], [ASKED, ASKED], reference=True),
                Curve("repose", steps, bounced, error=errors),
            ),
            log_x=True,
        )
    ]
    for response in dict.fromkeys(found[0] for found in piles):
        found = np.array([numbers for of, *numbers in piles if of == response], float)
        curve = Curve("repose, ± SE", found[:, 0], found[:, 1], error=np.nan_to_num(found[:, 2]))
        label = f"{response.label} ({response.unit})"
        panels.append(Panel("time step (s)", label, (curve,), log_x=True))
    return Result(
        "Convergence over the time step",
        f"restitution of two spheres; piles of the representative solution, {effort.seeds} seeds per step",
        rows,
        panels,
    )


def _pile_rows(
    rows: list[Row], at: str, step: float, pile: tuple, seeds: int
) -> list[tuple[Response, float, float, float]]:
    """Add a step's rows of the targets' responses; returns (response, step, mean, standard error) of each."""
    runs = _runs(step, pile, seeds)
    result = []
    for response in Targets.of(pile[0]["targets"]).responses:
        values = [run[response.name] for run in runs if run.get(response.name) is not None]
        if not values:
            continue
        mean, error = _mean_and_error(values)
        result.append((response, step, mean, error))
        note = f"standard error {error:.2g}, {len(values)} runs"
        rows.append(reported(f"{at}: {response.label}", response.unit, mean, note))
    return result

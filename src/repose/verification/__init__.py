"""Verification of the simulator: its results beside known references, as a table and as tests."""

import csv
import io
from collections.abc import Callable, Iterable, Mapping
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

from repose.common.errors import require
from repose.common.files import write_text

from . import (
    coulomb,
    energy,
    impacts,
    oblique,
    packing,
    resting,
    restitution,
    rolling,
    rotation,
    spinning,
)
from .case import FULL, Effort, Row

# Every case by name: a function of an `Effort` that returns its rows.
CASES = {
    "chung1": impacts.two_spheres, "chung2": impacts.sphere_on_plane, "chung3": impacts.damped_impact,
    "chung4": oblique.angles, "chung5": oblique.tangential_speeds, "chung6": spinning.plane_spins,
    "chung7": spinning.equal_spheres, "chung8": spinning.unequal_spheres, "coulomb": coulomb.sliding_hits,
    "loop": coulomb.closed_loop, "rolling": rolling.slip_to_roll, "slope": rolling.coulomb_slope,
    "rest": resting.berry_at_rest, "rocking": resting.rocking, "rotation": rotation.free_rotation,
    "momentum": energy.cloud_momentum, "energy": energy.energy_of_hits, "elastic": energy.elastic_impacts,
    "restitution": restitution.restitution_of_hits, "hexagonal": packing.hexagonal_packing,
    "packing": packing.poured_packing,
}  # fmt: skip

Report = Callable[[str, list[Row]], Any]

__all__ = ["CASES", "FULL", "Effort", "run", "write"]


def run(
    names: Iterable[str] | None, effort: Effort = FULL, report: Report | None = None
) -> dict[str, list[Row]]:
    """Run cases of the verification suite (by default all) and `report` each; InputError for an unknown name."""
    chosen = list(names or CASES)
    for name in chosen:
        require(name in CASES, "command line", "--case", name, ", ".join(CASES))
    results = {}
    for name in dict.fromkeys(chosen):
        results[name] = list(CASES[name](effort))
        if report is not None:
            report(name, results[name])
    return results


def write(results: Mapping[str, list[Row]], path: str | Path) -> None:
    """Write all rows of all cases as a table."""
    lines = io.StringIO(newline="")
    writer = csv.writer(lines)
    writer.writerow(["case", *(field.name for field in fields(Row))])
    for name, rows in results.items():
        for row in rows:
            writer.writerow(
                [name, *("" if value is None else value for value in astuple(row))]
            )
    write_text(path, lines.getvalue())

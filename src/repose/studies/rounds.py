"""Rounds of the refinement: which jobs a round has, and how its samples are numbered.

Samples of round k are numbered from 1000 (k + 1). The proposal's seeds are cut into jobs from 1 on, each a sample of
its own; the neighbours follow from 101.
"""

from collections.abc import Mapping
from typing import Any

OF_A_ROUND, FIRST_NEIGHBOUR = 1000, 101
PROPOSAL, NEIGHBOUR = "proposal", "neighbour"


def jobs(section: Mapping[str, Any], round_: int) -> list[tuple[int, str, int]]:
    """Jobs (sample, role, seeds) of a round: the proposal in blocks of seeds, then the neighbours.

    A block is one job, so that all cores work and a kill costs one block. `section` is `refine`; `round_` counts from
    0.
    """
    first, block = OF_A_ROUND * (round_ + 1), section["block"]
    counts = [min(block, section["seeds"] - start) for start in range(0, section["seeds"], block)]
    proposed = [(first + 1 + k, PROPOSAL, count) for k, count in enumerate(counts)]
    numbers = range(first + FIRST_NEIGHBOUR, first + FIRST_NEIGHBOUR + section["neighbours"])
    return proposed + [(number, NEIGHBOUR, section["neighbour_seeds"]) for number in numbers]


def round_of(sample: int) -> int:
    """Round to which a sample number belongs; -1 for a sample of the design."""
    return sample // OF_A_ROUND - 1


def goes_on(verdict: Mapping[str, Any], before: Mapping[str, Any] | None = None) -> bool:
    """Whether another round has something to gain: the bar is missed and there are new data to learn from.

    Where the targets are out of reach, the loop goes on as long as it comes nearer. `before` is the verdict of the
    round before; both are of `repose.studies.verdict`.
    """
    return verdict["outcome"] != "within" and verdict["usable"] > 0 and not stuck(verdict, before)


def stuck(verdict: Mapping[str, Any], before: Mapping[str, Any] | None) -> bool:
    """Whether a round with targets out of reach came no nearer than the round before."""
    if before is None or not verdict["out_of_reach"] or None in (verdict["objective"], before["objective"]):
        return False
    return verdict["objective"] >= before["objective"]

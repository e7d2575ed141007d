"""How a run failed, in words.

A table of runs has a word for it in the column ``status``, such as ``not_at_rest``. Where
a person reads, the clause of `ENDINGS` stands in its place. docs/files.md lists both.
"""

import re
from collections.abc import Mapping

# A clause for each status but ``ok``: of our bench tests, then of other programs.
ENDINGS = {
    "not_at_rest": "the grains still moved when they should have been at rest",
    "jammed": "grains got stuck on their way out",
    "left_plate": "too many grains rolled off the plate",
    "no_flank": "the grains made no pile with a side to measure",
    "unstable": "a speed, an energy or an overlap passed its bound",
    "lost": "a grain left the vessel, or found no place in it",
    "not_filled": "the grains did not fill the vessel as asked",
    "not_full": "the grains did not reach the rim of the cylinder",
    "no_surface": "the bed had no surface to measure",
    "no_slip": "nothing slipped until the end",
    "no_roll": "the grain did not begin to roll",
    "no_rebound": "the grain did not leave the plate again",
    "out_of_bounds": "a measured number lay outside its possible values",
    "exit_status": "the program ended with an error",
    "time_limit": "the program took longer than its time limit",
    "no_output": "the program did not write a file that is read",
    "bad_output": "the program wrote no finite number for a target",
    "no_pile": "the particles made no pile with two sides",
    "failed": "the program marked the run as failed",
}
# Counted runs with a status, as the column `reason` has them.
_COUNTED = re.compile(r"\b(\d+ (?:of \d+ )?runs) (\w+)")


def in_words(status: str) -> str:
    """Return the clause of a status; a status of a user's own is quoted."""
    return ENDINGS.get(status, f"their status is '{status}'")


def describe_failure(status: str, reason: str = "") -> str:
    """Describe a run that failed, as in ``failed because grains got stuck (2 grains)``."""
    details = f" ({reason})" if reason else ""
    return f"failed because {in_words(status)}{details}"


def explain(counts: Mapping[str, int], verb: str) -> str:
    """Tell how many runs or samples failed and why, the most frequent status first.

    Parameters
    ----------
    counts : mapping
        Number of failures by status.
    verb : str
        What happened to them, as in ``2 failed because grains got stuck``.
    """
    ordered = sorted(counts.items(), key=lambda entry: -entry[1])
    return ", ".join(
        f"{count} {verb} because {in_words(status)}" for status, count in ordered
    )


def reword(reason: str) -> str:
    """Replace the statuses in a cell of the column `reason` by their clauses."""

    def clause(found: re.Match[str]) -> str:
        runs, status = found.groups()
        if status not in ENDINGS:
            return found[0]
        return f"{runs} {describe_failure(status)}"

    return _COUNTED.sub(clause, reason)

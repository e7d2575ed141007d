"""Describe in words why a run failed.

The column ``status`` in a table of runs has a code for the reason, such as
``not_at_rest``. Messages have a clause from `FAILURE_CLAUSES` in place of the code.
docs/files.md lists both.
"""

import re
from collections.abc import Mapping

# A clause for each status except ``ok``. The first clauses are for our bench tests, the
# last ones for runs of other programs.
FAILURE_CLAUSES = {
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
# A number of runs with a status, as in the column `reason`. The groups are the number
# with the word "runs", and the status.
_COUNTED_RUNS = re.compile(r"\b(\d+ (?:of \d+ )?runs) (\w+)")


def describe_status(status: str) -> str:
    """Return the clause that describes a status; quote a status of the user's own."""
    return FAILURE_CLAUSES.get(status, f"their status is '{status}'")


def describe_failure(status: str, reason: str = "") -> str:
    """Describe a run that failed, as in ``failed because grains got stuck (2 grains)``."""
    details = f" ({reason})" if reason else ""
    return f"failed because {describe_status(status)}{details}"


def describe_failures(counts: Mapping[str, int], verb: str) -> str:
    """Describe how many runs or samples failed and why, the most frequent status first.

    Parameters
    ----------
    counts : mapping
        Number of failures by status.
    verb : str
        The verb after the number, as in ``2 failed because grains got stuck``.
    """
    ordered = sorted(counts.items(), key=lambda entry: -entry[1])
    return ", ".join(
        f"{count} {verb} because {describe_status(status)}" for status, count in ordered
    )


def replace_statuses(reason: str) -> str:
    """Replace each status in a cell of the column `reason` by a description.

    For example, ``2 of 5 runs jammed`` becomes ``2 of 5 runs failed because grains got
    stuck on their way out``.
    """

    def describe_match(match: re.Match[str]) -> str:
        """Return the number of runs and the description of their status."""
        runs, status = match.groups()
        # Leave words unchanged that are no status.
        if status not in FAILURE_CLAUSES:
            return match[0]
        return f"{runs} {describe_failure(status)}"

    return _COUNTED_RUNS.sub(describe_match, reason)

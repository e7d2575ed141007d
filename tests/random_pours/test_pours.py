"""Three of the random legal pours; README.md has the others."""

import pytest
from random_pours import pour

from repose.bench.bounds import Bounded

# a funnel of spheres, a drop, and clumps in a lifted tube, each with other laws
NUMBERS = (2, 5, 7)


@pytest.mark.slow
@pytest.mark.essential
@pytest.mark.parametrize("number", NUMBERS)
def test_a_random_pour_keeps_its_bounds(number, monkeypatch):
    seen = [pour.Largest()]
    monkeypatch.setattr(Bounded, "check", pour.noting(seen))
    row = pour.poured(number, *pour.study(), seen)
    assert row["status"] != "refused"
    assert pour.violation(row) == ""


def test_what_counts_as_a_violation():
    good = {
        "status": "ok",
        "apparatus": "funnel",
        "speed_over_fall": 0.5,
        "overlap_over_extent": 0.1,
        "wall_overlap_over_extent": 0.1,
        "energy_over_given": 0.9,
    }
    assert pour.violation(good) == ""
    assert pour.violation(good | {"status": "CRASH"}) == "CRASH"
    assert pour.violation(good | {"speed_over_fall": 4.0}).startswith("exploded")
    assert pour.violation(good | {"energy_over_given": 1.1}) == "energy gained"
    assert pour.violation(good | {"energy_over_given": float("nan")}) == "energy gained"
    unstable = good | {"status": "unstable", "speed_over_fall": 4.0}
    assert pour.violation(unstable) == ""

"""Linear effects of the parameters on a response with known slopes."""

import numpy as np
import pandas as pd
import pytest

from repose.bench.space import contact_space
from research.responses.linear_effects import effects

FIXED = {key: {"fixed": 0.3} for key in ("e_gg", "e_gp", "mus_gp", "mur_gp")}
SPACE = contact_space(FIXED | {"mus_gg": [0.1, 0.9], "mur_gg": [0.0, 0.1]})


def test_a_plane_has_its_slopes_and_at_equal_values_of_its_cause_none():
    """The packing falls with mus_gg, and the angle follows the packing and mur_gg alone."""
    rng = np.random.default_rng(3)
    samples = pd.DataFrame(
        {
            "sample": range(60),
            "mus_gg": rng.uniform(0.1, 0.9, 60),
            "mur_gg": rng.uniform(0, 0.1, 60),
        }
    )
    runs = samples.loc[samples.index.repeat(4)].reset_index(drop=True)
    noise = rng.normal(0, 0.05, (2, len(runs)))
    runs["packing_percent"] = (
        60 - 5 * runs["mus_gg"] + rng.normal(0, 0.5, 60).repeat(4) + noise[0]
    )
    runs["aor_deg"] = 3 * runs["packing_percent"] + 20 * runs["mur_gg"] + noise[1]
    names = ("packing_percent", "aor_deg")
    alone = effects(samples, runs, SPACE, names).set_index(["parameter", "response"])
    assert alone.loc[("mus_gg", "packing_percent"), "effect"] == pytest.approx(
        -4.0, abs=0.6
    )
    assert alone.loc[("mus_gg", "aor_deg"), "effect"] == pytest.approx(-12.0, abs=1.8)
    equal = effects(samples, runs, SPACE, names, "packing_percent").set_index(
        ["parameter", "response"]
    )
    row = equal.loc[("mus_gg", "aor_deg")]
    assert abs(row["effect"]) < 4 * row["effect_se"] < 0.2
    assert equal.loc[("mur_gg", "aor_deg"), "effect"] == pytest.approx(2.0, abs=0.2)
    assert ("mus_gg", "packing_percent") not in equal.index

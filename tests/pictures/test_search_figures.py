"""Figure 14 for one target, for four, and for more than stand in a row."""

import json

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

from repose.core.parameters import PARAMETERS
from repose.core.responses import response
from repose.pictures.figures import search, style

SETS = (
    ("height_mm",),
    ("aor_deg", "height_mm", "packing_percent", "drum_slip_deg"),
    ("aor_deg", "height_mm", "packing_percent", "drum_slip_deg", "upper_deg"),
)


def config_of(names):
    known = {"value": 50.0, "sd": 2.0, "repetitions": 4, "range": [48.0, 52.0]}
    parameters = {name: [0.0, 1.0] for name in PARAMETERS} | {"mus_gp": {"fixed": 0.5}}
    targets = [{"response": name} | known for name in names]
    return {"targets": targets, "parameters": parameters}


def words(figure):
    return " | ".join(text.get_text() for text in figure.findobj(Text))


@pytest.mark.parametrize("names", SETS)
def test_solutions_have_a_strip_for_each_target(names, tmp_path):
    rng = np.random.default_rng(1)
    table = pd.DataFrame(rng.uniform(size=(20, 6)), columns=list(PARAMETERS)).assign(mus_gp=0.5)
    for name in names:
        table[response(name).predicted] = rng.uniform(48, 52, 20)
    table.assign(feasible=True, representative=np.arange(20) == 3).to_csv(tmp_path / "f.csv", index=False)
    (tmp_path / "s.json").write_text(json.dumps({"feasible": True}))
    with style.applied():
        figure = search.feasible_solutions(
            {"feasible": tmp_path / "f.csv", "summary": tmp_path / "s.json"}, config_of(names)
        )
        style.save(figure, tmp_path / "a.png", small_run=False)
    strips = figure.axes[1:]
    assert [panel.get_title(loc="left") for panel in strips] == list("bcdef")[: len(names)]
    labels = [panel.get_xlabel() for panel in strips]
    assert labels == [f"predicted {response(name).symbol} ({response(name).unit})" for name in names]
    assert len(figure.axes[0].get_yticklabels()) == 5  # the fixed parameter has no strip
    assert "20 feasible solutions" in words(figure)

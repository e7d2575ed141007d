"""Figures of the sensitivity of a study with a constraint name what they show."""

import pandas as pd
import pytest
from linear import Linear
from matplotlib.text import Text
from shared import entries, target

from repose.bench.parameters import PARAMETERS
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty.sensitivity import analyse_surrogate
from repose.calibrate.uncertainty.settings import SensitivitySettings
from repose.report.figures import sensitivity, style, surrogate
from repose.report.study_view import StudyView

RULE = "mus_gg <= mus_gp"
UNIT = {name: [0.0, 1.0] for name in PARAMETERS}
SPACE = ParameterSpace.of(UNIT, constraints=[RULE])
TARGETS = Targets.of([target("aor_deg", 30.0, 2.0, 28, 32)])
CONFIG = {"targets": entries(TARGETS), "parameters": UNIT, "constraints": [RULE]}
# The angle rises with mus_gg and falls with mus_gp by as much.
MODEL = Linear(TARGETS.names, [{"mus_gg": 1.0, "mus_gp": -1.0}])
MODEL.inputs = PARAMETERS


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensitivity")
    settings = SensitivitySettings(samples=256, resamples=20, seed=1)
    found = analyse_surrogate(MODEL, SPACE, TARGETS, settings)
    found.indices.to_csv(folder / "sobol.csv", index=False)
    found.effects.to_csv(folder / "effects.csv", index=False)
    samples = pd.DataFrame([dict.fromkeys(PARAMETERS, 0.5)])
    samples = samples.assign(sample=1, status="ok", aor_deg=30.0)
    samples.to_csv(folder / "dataset.csv", index=False)
    return {
        name: str(folder / f"{name}.csv") for name in ("sobol", "effects", "dataset")
    }


@pytest.mark.parametrize("name", ["draw_sobol_indices", "draw_main_effects"])
def test_figures_name_the_shares_and_no_index(files, name):
    with style.applied():
        figure = getattr(sensitivity, name)(files, StudyView(CONFIG))
        figure.draw_without_rendering()
    words = " ".join(" ".join(text.get_text().split()) for text in figure.findobj(Text))
    assert "Var(E[y|x]) / Var(y)" in words
    assert "constraints allow" in words
    assert "first" not in words
    if name == "draw_main_effects":
        # On the triangle x1 <= x2, each explains (1 - 1/2)^2 = 1/4 of x1 - x2.
        panel = figure.axes[list(PARAMETERS).index("mus_gg")]
        percent = float(panel.get_title(loc="right").removesuffix(" %"))
        assert percent == pytest.approx(25, abs=3)


def test_the_influence_is_the_remaining_share_and_the_arrow_that_of_allowed_sets():
    found = surrogate.compute_influence(MODEL, SPACE, seed=1)
    share = dict(zip(PARAMETERS, found.fraction[0], strict=True))
    # 3/4 a^2 / (a^2 + a b + b^2), with a = 1 and b = -1
    assert share["mus_gg"] == pytest.approx(0.75, abs=0.02)
    assert share["mus_gp"] == pytest.approx(0.75, abs=0.02)
    assert share["e_gg"] == pytest.approx(0, abs=0.01)
    direction = dict(zip(PARAMETERS, found.direction[0], strict=True))
    assert direction["mus_gg"] == 1
    assert direction["mus_gp"] == -1

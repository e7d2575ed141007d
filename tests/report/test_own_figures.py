"""Figures of a calibration with a simulator of one's own: what is drawn is what was told."""

import json
import re

import numpy as np
import pytest
from made_up import texts_of
from matplotlib.patches import Rectangle
from refusals import input_error

from repose import Study
from repose.report.figures import own
from repose.report.page import own as page_own

pytestmark = pytest.mark.usefixtures("short_searches")
QUICK = {"posterior": {"walkers": 32, "steps": 100}}
QUICK["sequential"] = {
    "start_samples": 8,
    "batch": 4,
    "probability": 0.9,
    "most_runs": 40,
}
TARGETS = {
    "y": {"value": 1.0, "sd": 0.05, "repetitions": 4, "range": [0.9, 1.2]},
    "z": (0.5, 0.05),
}


def calibrated(parameters, targets):
    """The answer of a simulator whose runs differ by a little."""
    study = Study(parameters, targets, seed=1, **QUICK)
    random = np.random.default_rng(1)

    def simulate(row):
        found = {"y": row["a"] + row.get("b", 0.5), "z": row["a"]}
        return {name: found[name] + random.normal(0, 0.03) for name in targets}

    return study.calibrate(simulate)


@pytest.fixture(scope="module")
def answer():
    return calibrated(
        {"a": (0.0, 1.0), "b": (0.0, 1.0), "c_mpa": {"fixed": 5.0}}, TARGETS
    )


def points(panel, label):
    (bars,) = [bars for bars in panel.containers if bars.get_label().endswith(label)]
    return np.array(bars.lines[0].get_data(), float)


def test_the_points_are_the_runs_and_the_box_is_the_range(answer, tmp_path):
    figure = own.plot(answer, tmp_path / "own.png")
    assert (tmp_path / "own.png").read_bytes().startswith(b"\x89PNG")
    plane, _, off_y, off_z, *_ = figure.axes
    means = answer.runs.groupby("sample", sort=False)[["y", "z"]].mean()
    (samples,) = [
        line
        for line in plane.lines
        if line.get_label() == f"{len(means)} parameter sets, simulated"
    ]
    np.testing.assert_allclose(np.transpose(samples.get_data()), means)
    (box,) = (patch for patch in plane.patches if isinstance(patch, Rectangle))
    assert box.get_x() == pytest.approx(0.9)
    assert box.get_width() == pytest.approx(0.3)
    # two standard errors of 0.05 to each side of 0.5
    assert box.get_y() == pytest.approx(0.4)
    assert box.get_height() == pytest.approx(0.2)
    (square,) = [
        line for line in plane.lines if line.get_label() == "the answer, predicted"
    ]
    assert np.ravel(square.get_data()).tolist() == answer.answer.mean.tolist()
    assert "the answer, simulated" not in texts_of(figure)
    for panel, name, value, mean in zip(
        (off_y, off_z), "yz", (1.0, 0.5), answer.answer.mean, strict=True
    ):
        place, deviation = points(panel, "simulated ± standard error")
        np.testing.assert_allclose(deviation, 100 * (means[name] / value - 1))
        # the start is the first batch
        assert (np.round(place)[:8] == 1).all()
        assert (np.diff(place) > 0).all()
        # the prediction follows the last batch
        expected = [np.round(place[-1]) + 1, 100 * (mean / value - 1)]
        predicted = points(panel, "predicted ± standard error")
        assert predicted[:, 0] == pytest.approx(expected)


def copied_text(text):
    """What the button of a report copies."""
    content = re.search(r'id="content">(.*?)</script>', text, re.DOTALL).group(1)
    return json.loads(content)["copy"]


def test_the_report_has_the_figures_and_says_that_the_targets_are_predicted_to_be_met(
    answer, tmp_path
):
    assert list(own.list_figures(answer)) == ["plane", "history", "intervals", "corner"]
    page_own.write(answer, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert text.count('src="data:image/png;base64,') == 4
    assert "<b>Targets predicted: met (" in text
    absent = ("not checked", "no result", ">unknown<", "Blue: the new simulations")
    assert not any(phrase in text for phrase in absent)
    # parameters of the user's own have no other name than this
    assert '"name":"a","label":""' in text
    assert re.search(r"^a: [\d.e-]+$", copied_text(text), re.MULTILINE)
    input_error(
        r"ending is '\.gif'; expected \.png or \.pdf or \.svg",
        own.plot,
        answer,
        tmp_path / "own.gif",
    )


def test_one_parameter_and_one_target_have_no_planes(tmp_path):
    answer = calibrated({"a": (0.0, 1.0)}, {"z": (0.5, 0.05)})
    drawn = own.plot(answer)
    assert set(own.list_figures(answer)) <= {"history", "intervals"}
    (label,) = [tick.get_text() for tick in drawn.axes[-1].get_yticklabels()]
    assert label == "a"
    answer = answer._replace(runs=answer.runs.copy())
    answer.runs.attrs.clear()  # a table of the user's own knows no batches
    assert list(own.list_figures(answer)) == ["intervals"]

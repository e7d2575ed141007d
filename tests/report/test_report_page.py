"""The report: its numbers, its 3-D scene, and what it says; the page itself is tested in a browser."""

import json
import os
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from made_up_report import made_up_study
from markupsafe import escape
from refusals import input_error
from shared import RANGES, TARGETS, says, target

from repose import __version__
from repose.bench.parameters import PARAMETERS
from repose.calibrate.responses import derived
from repose.calibrate.runs import error_of
from repose.calibrate.surrogates import load
from repose.calibrate.targets import Targets
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import MeasureSettings, line_of
from repose.report.page import page, prediction, scene, three
from repose.report.page.templates import asset
from repose.stages.published import STALE

BOTH = Targets.of(TARGETS)
MORE = [*TARGETS, target("drum_slip_deg", 44, 2, 40, 48, 5)]


def test_sources_are_kept_within_half_a_step_and_spheres_lack_what_others_hide():
    positions = np.random.default_rng(1).uniform(-300, 300, (4, 50, 3))
    positions[0, :20] = np.nan
    whole, low, step = scene.quantised(positions)
    assert (whole[0, :20] == scene.ABSENT).all()
    there = np.isfinite(positions).all(axis=2)
    assert (whole[there] <= scene.STEPS).all()
    assert (
        np.abs(low + step * whole[there] - positions[there]).max()
        <= 0.5001 * step.max()
        < 0.005
    )
    spheres = np.array([[-3e-3, 0, 0, 5e-3], [3e-3, 0, 0, 5e-3], [0, 0, 0, 1e-3]])
    points, normals, triangles = scene.grain_surface(
        SimpleNamespace(is_clump=True, spheres_m=spheres), 10_000
    )
    distance = (
        np.linalg.norm(points[:, None] - 1e3 * spheres[:, :3], axis=2)
        - 1e3 * spheres[:, 3]
    )
    np.testing.assert_allclose(np.abs(distance).min(axis=1), 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    # Each triangle has a corner that no sphere holds: the small sphere is gone, the others are cut.
    outside = (distance > -1e-9).all(axis=1)
    assert outside[triangles].any(axis=1).all()
    assert np.abs(points[outside, 0]).max() == pytest.approx(8.0, abs=0.1)
    a, b, c = points[triangles].transpose(1, 0, 2)
    assert (
        np.einsum("ij,ij->i", np.cross(b - a, c - a), normals[triangles[:, 0]]) > 0
    ).all()


@pytest.mark.parametrize(("frames", "count"), [(181, 500), (181, 20_000), (3, 10)])
def test_frames_hold_both_ends_and_keep_to_the_size(frames, count):
    shown = scene.choose_frames(np.linspace(0, 18, frames), count)
    assert (shown[0], shown[-1]) == (0, frames - 1)
    assert len(shown) * count * scene.BYTES_PER_GRAIN <= scene.MAX_BYTES
    assert len(shown) == min(frames, scene.FRAMES) or count == 20_000


def written(study, folder, tables=()):
    """The text of the page of a study, as it is written into a folder."""
    page.write(*study, dict(tables), folder / "report.html")
    return (folder / "report.html").read_text()


def values_of(text):
    return json.loads(
        re.search(r'id="content">(.*?)</script>', text, re.DOTALL).group(1)
    )


@pytest.mark.parametrize(
    ("targets", "fixed"),
    [(TARGETS[:1], ()), (TARGETS, ("e_gg", "e_gp")), (MORE, ())],
    ids=["1", "2", "3"],
)
def test_any_number_of_targets_and_fixed_parameters(targets, fixed, tmp_path):
    text = written(
        made_up_study(tmp_path, targets, fixed=fixed),
        tmp_path,
        {"All samples": tmp_path / "dataset.csv"},
    )
    values = values_of(text)
    assert [target["name"] for target in values["targets"]] == [
        target["response"] for target in targets
    ]
    assert [
        parameter["name"] for parameter in values["parameters"] if parameter["fixed"]
    ] == list(fixed)
    assert text.count("<td") > 60 * 8
    assert text.count("<b>A small run, its numbers are no calibration: targets ") == 1
    assert values["copy"].startswith(
        "# made <up> & small: A small run, its numbers are no calibration: targets "
    )
    table4 = text[text.index("Table 4") :]
    assert all(
        f"simulated ({one.response.unit})" in table4 for one in Targets.of(targets)
    )
    assert table4.count('data-head="role">spread') == 5
    says(text, "The intervals are not settled", "made &lt;up&gt; &amp; small")
    assert "e_gg: 0.2  #" in values["copy"]
    assert not re.search(r'(src|href)="(?!data:)', text), "no network"


def test_the_page_has_the_same_piles_by_other_lines_and_calls_stale_sets_so(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    table = pd.read_csv(files["table4"])
    for k, name in enumerate(MEAN_KEYS.values()):
        table[name], table[error_of(name)] = 30.0 + k, 0.25
    table.to_csv(files["table4"], index=False)
    pd.DataFrame({"solution": ["22"], "stale": [True]}).to_csv(
        tmp_path / "sets.csv", index=False
    )
    text = written(
        (config, jobs, files), tmp_path, {"Published": tmp_path / "sets.csv"}
    )
    lines = text[
        text.index("The same piles by other lines") : text.index("<h3>Table 4")
    ]
    measure = MeasureSettings.with_defaults(**config["measure"])
    for k, name in enumerate(MEAN_KEYS):
        says(lines, f"{line_of(measure, name)}</td>", f"{30 + k} ± 0.25 deg")
    assert lines.count("calibrated") == 1
    assert f"Published, {escape(STALE)}" in text


def test_a_surrogate_that_is_no_network_is_shown_along_each_parameter(tmp_path):
    model = values_of(
        written(
            made_up_study(tmp_path, TARGETS, "quadratic", fixed=("mur_gp",)), tmp_path
        )
    )["model"]
    assert model["kind"] == "curves"
    assert "mur_gp" not in model["curves"]
    point = np.array(
        [[0.4, 0.5, 0.04, 0.3, 0.6, 0.2]]
    )  # the answer with e_gg at its upper end
    mean, std = load(tmp_path / "network.json").predict(
        point, return_std=True, noise=False
    )
    np.testing.assert_allclose(model["curves"]["e_gg"]["mean"][-1], mean[0])
    np.testing.assert_allclose(model["curves"]["e_gg"]["std"][-1], std[0])
    assert len(model["curves"]["e_gg"]["mean"]) == prediction.CURVE_POINTS


NOT_MET = r"targets NOT met\.</b> Angle of repose .* No parameter set is predicted inside both ranges; "
NOT_MET += r"the simulated means lie inside both ranges\. Nothing met\."
MET = r"<b>A small run, its numbers are no calibration: targets met\.</b> Angle of repose \(\S.*?\) \S+ ± \S+ deg "
MET += r"\(measured \S+, \S+ %\), Height .*\. With a probability of more than 99 % both responses"
JAMMED = {"sample": 1, "parameters": {}, "runs": [{"status": "jammed", "seed": 1}]}
VERDICTS = [
    ({"summary": {"feasible": False, "message": "Nothing met."}}, "bad", NOT_MET)
]
VERDICTS += [
    (
        {"job_funnel": JAMMED},
        "fair",
        r"targets met\.</b> .* How probable this is, is unknown",
    )
]
VERDICTS += [({}, "good", MET)]


@pytest.mark.parametrize(("change", "kind", "words"), VERDICTS)
def test_the_page_begins_with_whether_the_targets_are_met(
    change, kind, words, tmp_path
):
    study = made_up_study(tmp_path, TARGETS)
    for name, content in change.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    text = written(study, tmp_path)
    found = re.search(r'class="verdict (\w+)">(.*?)</p>', text)
    assert found.group(1) == kind
    assert re.search(words, found.group(2))
    assert (
        text.index("</h1>") < text.index('class="verdict') < text.index('id="origin"')
    ), "the verdict stands first"
    assert re.search(r"Simulated less measured: .* [+-]\d+\.\d ± \d+\.\d % \(\d", text)


def test_a_row_of_the_answer_tells_bounds(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    table = pd.read_csv(files["posterior"]).set_index("parameter")
    table.loc["e_gg", ["credible_low", "credible_high"]] = (
        0.3,
        0.35,
    )  # the answer is 0.2
    table.to_csv(files["posterior"])
    low = RANGES["mur_gp"][0]
    sets = pd.read_csv(files["table4"])
    sets.loc[0, "mur_gp"] = low
    sets.to_csv(files["table4"], index=False)
    for posterior in (True, False):
        given = {
            name: files[name] for name in files if posterior or name != "posterior"
        }
        rows = re.findall(r"<tr><td.*?</tr>", written((config, jobs, given), tmp_path))
        told = {
            name: next(row for row in rows if f">{name}</td>" in row)
            for name in PARAMETERS
        }
        assert "at the lower bound of the range" in told["mur_gp"]
        assert ("interval widened to hold the answer" in told["e_gg"]) is posterior
        assert ("0.2 to 0.35" in told["e_gg"]) is posterior
        assert "widened" not in told["mus_gg"] + told["mur_gp"]


def test_three_js_keeps_its_licence_has_the_used_classes_and_ends_no_script():
    script = three.library()
    assert "Copyright 2010-2021 Three.js Authors" in script[:100]
    used_classes = set(re.findall(r"THREE\.(\w+)", asset("view.js")))
    assert "InstancedMesh" in used_classes
    for name in used_classes:
        assert re.search(rf"\.{name}\b", script), name
    assert not re.search("</script|<!--", script)


def test_faults_name_the_input(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    (tmp_path / "photo.jpg").write_text("no picture")
    lacking = {name: files[name] for name in files if name != "table4"}
    cases = [
        (files | {"photo": "x"}, r"photo.*one of dataset"),
        (lacking, "a report needs"),
    ]
    for given, said in [
        *cases,
        (files | {"photograph": tmp_path / "photo.jpg"}, r"photo.jpg.*a PNG or JPEG"),
    ]:
        input_error(said, written, (config, jobs, given), tmp_path)


def test_the_page_says_when_and_by_what_its_results_were_made_and_is_the_same_twice(
    tmp_path,
):
    study, table4 = made_up_study(tmp_path, TARGETS), tmp_path / "table4.csv"
    os.utime(table4, 2 * (1_699_963_200,))  # noon of 14 November 2023
    record = {
        "verb": "validate",
        "origin": "o",
        "settings": "s",
        "repose": "9.8.7",
        "processor": "a <type>",
    }
    for commit, words in (("abc123", ", commit abc123"), (None, "")):
        (tmp_path / "table4.csv.provenance.json").write_text(
            json.dumps(record | {"commit": commit})
        )
        first = written(study, tmp_path)
        assert (
            f"Results of 2023-11-14, by repose 9.8.7{words}, on a &lt;type&gt;."
            in first
        )
        assert written(study, tmp_path) == first
    os.utime(table4, 2 * (1_800_014_400,))
    assert written(study, tmp_path) == first.replace("2023-11-14", "2027-01-15")
    (tmp_path / "table4.csv.provenance.json").unlink()
    assert f"by repose {__version__}" in written(study, tmp_path), (
        "a table without a record: this program's"
    )


def test_what_piles_cannot_be_stands_below_the_first_line(tmp_path, monkeypatch):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    reach = {
        "possible": False,
        "sentence": "500 grains cannot make it: at most 28 +- 1 deg.",
    }
    tests = [
        {"reach": reach},
        {"reach": reach | {"possible": True, "sentence": "It is possible."}},
        {},
    ]
    monkeypatch.setattr(
        "repose.report.page.sections.read_card",
        lambda path: {"tests": tests if path == "card" else []},
    )
    text = written((config, jobs, files | {"card": "card"}), tmp_path)
    below = text[text.index('<p class="verdict') :].split("</p>")[1].strip()
    assert (
        below == '<p class="verdict bad">500 grains cannot make it: at most 28 ± 1 deg.'
    )
    assert "It is possible" not in text


def test_the_expected_optimism_stands_beside_each_prediction(tmp_path):
    inputs = made_up_study(tmp_path, TARGETS, "quadratic")
    table4 = pd.read_csv(tmp_path / "table4.csv")
    for name in ("aor_deg", "height_mm"):
        table4[derived(name, "optimism")] = 0.376
        table4[derived(name, "optimism_se")] = 0.07
    table4.to_csv(tmp_path / "table4.csv", index=False)
    summary = json.loads((tmp_path / "summary.json").read_text())
    near = {"parameter": "mus_gg", "value": 0.36, "bound": 0.35}
    summary["near_bounds"] = [near | {"standard_error": 0.03}]
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    text = written(inputs, tmp_path)
    assert "(expected optimism +0.38 ± 0.07)" in text
    assert "expected optimism (deg)" in text
    assert "0.376 ± 0.07" in text
    assert "mus_gg 0.36 is within one standard error of the fit" in text
    first = values_of(text)["targets"][0]
    assert (first["optimism"], first["optimismError"]) == (0.376, 0.07)

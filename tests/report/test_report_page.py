"""The report: its numbers, its 3-D scene, and what it says; the page itself is tested in a browser."""

import base64
import json
import os
import re
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from made_up_report import made_up_study
from markupsafe import escape
from refusals import input_error
from shared import RANGES, ROOT, TARGETS, says, target

from repose import __version__
from repose.bench.parameters import PARAMETERS
from repose.calibrate.answer import Check
from repose.calibrate.responses import name_derived_column
from repose.calibrate.runs import name_error_column
from repose.calibrate.surrogates import load
from repose.calibrate.targets import Targets
from repose.calibrate.uncertainty.posterior import state_determination
from repose.measure.angles import MEAN_KEYS
from repose.measure.settings import MeasureSettings, line_of
from repose.report.page import captions, page, prediction, scene, sections, three
from repose.report.page.templates import read_asset
from repose.stages.published import STALE_WARNING

BOTH = Targets.of(TARGETS)
MORE = [*TARGETS, target("drum_slip_deg", 44, 2, 40, 48, 5)]


def test_positions_are_kept_within_half_a_step():
    positions = np.random.default_rng(1).uniform(-300, 300, (4, 50, 3))
    positions[0, :20] = np.nan
    whole, low, step = scene.quantise(positions)
    assert (whole[0, :20] == scene.ABSENT_POSITION).all()
    present = np.isfinite(positions).all(axis=2)
    assert (whole[present] <= scene.POSITION_STEPS).all()
    error = np.abs(low + step * whole[present] - positions[present]).max()
    assert error <= 0.5001 * step.max()
    assert 0.5001 * step.max() < 0.005


def test_the_surface_of_a_clump_lacks_what_its_spheres_hide():
    """Two large spheres overlap, and hide a small one in the middle."""
    spheres = np.array([[-3e-3, 0, 0, 5e-3], [3e-3, 0, 0, 5e-3], [0, 0, 0, 1e-3]])
    points, normals, triangles = scene.make_grain_surface(
        SimpleNamespace(is_clump=True, spheres_m=spheres), 10_000
    )
    from_centres = np.linalg.norm(points[:, None] - 1e3 * spheres[:, :3], axis=2)
    distance = from_centres - 1e3 * spheres[:, 3]
    np.testing.assert_allclose(np.abs(distance).min(axis=1), 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    # Each triangle has a corner that no sphere holds: the small sphere is gone, the others are cut.
    outside = (distance > -1e-9).all(axis=1)
    assert outside[triangles].any(axis=1).all()
    assert np.abs(points[outside, 0]).max() == pytest.approx(8.0, abs=0.1)
    # triangles are ordered so that they face outwards
    a, b, c = points[triangles].transpose(1, 0, 2)
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), normals[triangles[:, 0]])
    assert (outward > 0).all()


@pytest.mark.parametrize(("frames", "count"), [(181, 500), (181, 20_000), (3, 10)])
def test_frames_hold_both_ends_and_keep_to_the_size(frames, count):
    shown = scene.choose_frames(np.linspace(0, 18, frames), count)
    assert shown[0] == 0
    assert shown[-1] == frames - 1
    assert len(shown) * count * scene.BYTES_PER_GRAIN <= scene.MAX_BYTES
    assert len(shown) == min(frames, scene.MAX_FRAMES) or count == 20_000


def written(study, folder, tables=()):
    """The text of the page of a study, as it is written into a folder."""
    page.write_report(*study, dict(tables), folder / "report.html")
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
    expected = [target["response"] for target in targets]
    assert [target["name"] for target in values["targets"]] == expected
    assert [
        parameter["name"] for parameter in values["parameters"] if parameter["fixed"]
    ] == list(fixed)
    assert text.count("<td") > 60 * 8
    assert text.count("<b>A small run, its numbers are no calibration: targets ") == 1
    assert values["copy"].startswith(
        "# made <up> & small: A small run, its numbers are no calibration: targets "
    )
    table4 = text[text.index("<h3>Parameter sets that were") :]
    assert all(
        f"simulated ({entry.response.unit})" in table4 for entry in Targets.of(targets)
    )
    assert table4.count('data-head="role">spread') == 5
    says(text, "The intervals are not settled", "made &lt;up&gt; &amp; small")
    assert "e_gg: 0.2  #" in values["copy"]
    assert not re.search(r'(src|href)="(?!data:|#)', text), "no network"


def test_the_page_has_the_same_piles_by_other_lines_and_calls_stale_sets_so(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    table = pd.read_csv(files["table4"])
    for k, name in enumerate(MEAN_KEYS.values()):
        table[name] = 30.0 + k
        table[name_error_column(name)] = 0.25
    table.to_csv(files["table4"], index=False)
    pd.DataFrame({"solution": ["22"], "stale": [True]}).to_csv(
        tmp_path / "sets.csv", index=False
    )
    text = written(
        (config, jobs, files), tmp_path, {"Published": tmp_path / "sets.csv"}
    )
    lines = text[
        text.index("The same piles by other lines") : text.index(
            "<h3>Parameter sets that were"
        )
    ]
    measure = MeasureSettings.with_defaults(**config["measure"])
    for k, name in enumerate(MEAN_KEYS):
        says(lines, f"{line_of(measure, name)}</td>", f"{30 + k}.00 ± 0.25 deg")
    assert lines.count("calibrated") == 1
    assert f"Published, {escape(STALE_WARNING)}" in text


def test_a_surrogate_that_is_no_network_is_shown_along_each_parameter(tmp_path):
    model = values_of(
        written(
            made_up_study(tmp_path, TARGETS, "quadratic", fixed=("mur_gp",)), tmp_path
        )
    )["model"]
    assert model["kind"] == "curves"
    assert "mur_gp" not in model["curves"]
    # the answer with e_gg at its upper end
    point = np.array([[0.4, 0.5, 0.04, 0.3, 0.6, 0.2]])
    mean, std = load(tmp_path / "network.json").predict(
        point, return_std=True, noise=False
    )
    np.testing.assert_allclose(model["curves"]["e_gg"]["mean"][-1], mean[0])
    np.testing.assert_allclose(model["curves"]["e_gg"]["std"][-1], std[0])
    assert len(model["curves"]["e_gg"]["mean"]) == prediction.CURVE_POINTS
    # over each pair of the five free parameters, the last point at both upper ends
    assert len(model["planes"]) == 10
    count = model["planePoints"]
    means = np.frombuffer(
        base64.b64decode(model["planes"]["e_gg mus_gg"]["mean"]), dtype="<f4"
    ).reshape(count, count, 2)
    ends = np.array([[0.4, RANGES["mus_gg"][1], 0.04, 0.3, 0.6, 0.2]])
    expected = load(tmp_path / "network.json").predict(ends)[0]
    np.testing.assert_allclose(means[-1, -1], expected, rtol=1e-6)


def test_planes_of_many_parameters_keep_the_page_small():
    assert prediction.choose_plane_points(15, 2) == prediction.MAX_PLANE_POINTS
    for n_pairs in (45, 190, 400):
        count = prediction.choose_plane_points(n_pairs, 2)
        numbers = 2 * 2 * n_pairs * count**2
        is_least = count == prediction.MIN_PLANE_POINTS
        assert is_least or numbers <= prediction.MAX_PLANE_NUMBERS


NOT_MET = r"targets NOT met\.</b> Angle of repose .* No parameter set is predicted inside both ranges; "
NOT_MET += r"the simulated means lie inside both ranges\. Nothing met\."
MET = r"<b>A small run, its numbers are no calibration: targets met\.</b> Angle of repose \S+ ± \S+ deg "
MET += r"\(measured \S+, \S+ %; line: \S[^)]*\), Height .*\. With a probability of more than 99 % the means of both responses"
JAMMED = {"sample": 1, "parameters": {}, "runs": [{"status": "jammed", "seed": 1}]}
VERDICTS = [
    ({"summary": {"feasible": False, "message": "Nothing met."}}, "bad", NOT_MET),
    (
        {"job_funnel": JAMMED},
        "fair",
        r"targets met\.</b> .* The probability of this is unknown",
    ),
    ({}, "good", MET),
]


@pytest.mark.parametrize(("change", "kind", "pattern"), VERDICTS)
def test_the_page_begins_with_whether_the_targets_are_met(
    change, kind, pattern, tmp_path
):
    study = made_up_study(tmp_path, TARGETS)
    for name, content in change.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    text = written(study, tmp_path)
    found = re.search(r'class="verdict (\w+)">(.*?)</p>', text)
    assert found.group(1) == kind
    assert re.search(pattern, found.group(2))
    assert (
        text.index("</h1>") < text.index('class="verdict') < text.index('id="origin"')
    ), "the verdict stands first"
    assert re.search(r"Simulated minus measured: .* [+-]\d+\.\d ± \d+\.\d % \(\d", text)


def test_failed_runs_of_the_answer_are_explained_in_words(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    job = json.loads(jobs[0].read_text())
    n_runs = len(job["runs"])
    job["runs"][0] |= {"status": "not_at_rest", "reason": "a grain moved 4 mm"}
    job["runs"][1] |= {"overlap_share": 0.12}
    for run in job["runs"]:
        run |= {"measured_views": 18, "doubtful_views": 2}
    jobs[0].write_text(json.dumps(job))
    table = pd.read_csv(files["dataset"])
    table["reason"] = "1 of 6 runs not_at_rest (a grain moved 4 mm)"
    table.to_csv(files["dataset"], index=False)
    text = written((config, jobs, files), tmp_path, {"Samples": files["dataset"]})
    clause = "failed because the grains still moved when they should have been at rest"
    says(
        text,
        f"Of these {n_runs} simulations, 1 {clause}.",
        "In these simulations bodies overlap by up to 12 %",
        f"Of these piles, {2 * (n_runs - 1)} of {18 * (n_runs - 1)} side views have two "
        "sides that differ by more than 10 degrees; they count.",
        f"1 of 6 runs {clause} (a grain moved 4 mm)",
        "60 of 60 samples can be used; none left out. 178 of 180 single runs can be "
        "measured; 2 failed because grains got stuck on their way out.",
    )
    assert "not_at_rest" not in text


def test_the_span_of_the_sets_found_is_apart_from_the_intervals(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    text = written((config, jobs, files), tmp_path)
    answer, rest = text.split("</table>", maxsplit=1)
    assert "sets found" not in answer.lower()
    span = rest[rest.index("Where the search ended") :].partition("</table>")[0]
    sets = pd.read_csv(files["feasible"])
    says(
        span,
        f"The search kept {len(sets)} parameter sets that are predicted to meet the",
        "These ranges are not the uncertainties of the parameters",
        *(f"{sets[name].min():.3g} to {sets[name].max():.3g}" for name in PARAMETERS),
    )


def test_the_steps_say_how_large_the_search_was(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    config["miga"] = config["miga"] | {"islands": 3, "population": 20}
    config["miga"] |= {"rounds": 150, "generations": 10}
    summary = json.loads(files["summary"].read_text())
    files["summary"].write_text(json.dumps(summary | {"evaluations": 1234567}))
    says(
        written((config, jobs, files), tmp_path),
        "(MIGA) improved 3 islands of 20 parameter sets over 1,500 generations. It "
        "evaluated the surrogate 1,234,567 times and kept 6 parameter sets. 6 sets found.",
    )


def test_each_table_at_the_end_of_the_page_has_a_note_on_its_columns(tmp_path):
    rules = (ROOT / "workflow/rules/report.smk").read_text()
    tables = rules.split("tables = drop_missing(")[1].partition("\n    )")[0]
    titles = set(re.findall(r'^ +"([A-Z][^"]*)": ', tables, re.MULTILINE))
    assert titles == set(captions.TABLE_NOTES)
    study = made_up_study(tmp_path, TARGETS)
    page.write_report(
        *study, {"Designs compared": study[2]["dataset"]}, tmp_path / "report.html"
    )
    text = (tmp_path / "report.html").read_text()
    assert "A good design keeps its samples apart." in text


def test_a_row_of_the_answer_tells_bounds(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    table = pd.read_csv(files["posterior"]).set_index("parameter")
    # the answer is 0.2
    table.loc["e_gg", ["credible_low", "credible_high"]] = (
        0.3,
        0.35,
    )
    table.to_csv(files["posterior"])
    low = RANGES["mur_gp"][0]
    sets = pd.read_csv(files["table4"])
    sets.loc[0, "mur_gp"] = low
    sets.to_csv(files["table4"], index=False)
    for posterior in (True, False):
        files_given = {
            name: files[name] for name in files if posterior or name != "posterior"
        }
        rows = re.findall(
            r"<tr><td.*?</tr>", written((config, jobs, files_given), tmp_path)
        )
        row_of = {
            name: next(row for row in rows if f">{name}</td>" in row)
            for name in PARAMETERS
        }
        assert "at the lower bound of the range" in row_of["mur_gp"]
        assert ("interval widened to contain the answer" in row_of["e_gg"]) is posterior
        assert ("0.2 to 0.35" in row_of["e_gg"]) is posterior
        assert "widened" not in row_of["mus_gg"] + row_of["mur_gp"]


def test_three_js_keeps_its_licence_has_the_used_classes_and_ends_no_script():
    script = three.read_library()
    assert "Copyright 2010-2021 Three.js Authors" in script[:100]
    used_classes = set(re.findall(r"THREE\.(\w+)", read_asset("view.js")))
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
    for files_given, message in [
        *cases,
        (files | {"photograph": tmp_path / "photo.jpg"}, r"photo.jpg.*a PNG or JPEG"),
    ]:
        input_error(message, written, (config, jobs, files_given), tmp_path)


def test_a_mean_that_misses_its_aim_is_named_with_both_errors():
    goal = Targets.of([target("aor_deg", 30, 3, 28, 32, 9)])[0]
    check = Check.from_target(goal, None, None, 0, "ok")
    near = replace(check, simulated=29.5, standard_error=0.3, runs=9)
    far = replace(near, simulated=28.5)
    assert sections._describe_missed_means([check, near]) == []
    (sentence,) = sections._describe_missed_means([near, far])
    assert "it lies 5.0 of its standard errors below it" in sentence
    # 1.5 over the root of 0.3² + 1²
    assert "the distance is 1.4 standard errors" in sentence


def test_the_note_of_a_study_stands_below_the_verdict(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    without = config | {"note": None}
    assert 'id="data"' not in written((without, jobs, files), tmp_path)
    noted = config | {"note": "Measured by A & B in <2020>."}
    text = written((noted, jobs, files), tmp_path)
    assert "<b>The data.</b> Measured by A &amp; B in &lt;2020&gt;." in text
    assert text.index('class="verdict') < text.index('id="data"')


def test_the_page_says_when_and_by_what_its_results_were_made_and_is_the_same_twice(
    tmp_path,
):
    study = made_up_study(tmp_path, TARGETS)
    table4 = tmp_path / "table4.csv"
    os.utime(table4, 2 * (1_699_963_200,))  # noon of 14 November 2023
    record = {
        "verb": "validate",
        "origin": "o",
        "settings": "s",
        "repose": "9.8.7",
        "processor": "a <type>",
    }
    for commit, origin in (("abc123", ", commit abc123"), (None, "")):
        (tmp_path / "table4.csv.provenance.json").write_text(
            json.dumps(record | {"commit": commit})
        )
        first = written(study, tmp_path)
        assert (
            f"Results of 2023-11-14, by repose 9.8.7{origin}, on a &lt;type&gt;. On another "
            "type of processor, the same study gives other piles" in first
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
        table4[name_derived_column(name, "optimism")] = 0.376
        table4[name_derived_column(name, "optimism_se")] = 0.07
    table4.to_csv(tmp_path / "table4.csv", index=False)
    summary = json.loads((tmp_path / "summary.json").read_text())
    near = {"parameter": "mus_gg", "value": 0.36, "bound": 0.35}
    summary["near_bounds"] = [near | {"standard_error": 0.03}]
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    text = written(inputs, tmp_path)
    assert "(expected optimism +0.376 ± 0.070)" in text
    assert "expected optimism (deg)" in text
    assert "0.376 ± 0.070" in text
    assert "mus_gg 0.36 is within one standard error of the fit" in text
    first = values_of(text)["targets"][0]
    assert first["optimism"] == 0.376
    assert first["optimismError"] == 0.07


def card_of(folder):
    """A card of a simulated study with the parts that another program needs."""
    card = {
        "tests": [],
        "laws": {"normal": "Hertz with damping", "rolling": "constant <torque>"},
        "grain": {
            "density_kg_m3": 840.47,
            "elastic_modulus_pa": 113520.0,
            "shear_modulus_pa": 43005.0,
            "poisson_ratio": 0.32,
            "mean_axes_mm": [21.14, 11.37, 9.88],
            "volume_mm3": 1488.5,
            "mass_g": 1.251,
            "inertia_kg_m2": [2e-8, 5e-8, 6e-8],
        },
        "wall": {"shear_modulus_pa": 1.12e9, "poisson_ratio": 0.4},
        "parameters": {"e_gg": {"meaning": "restitution, grain-grain", "value": 0.2}},
        "simulation": {"gravity_m_s2": 9.81, "time_step_s": 5e-5},
    }
    (folder / "card.json").write_text(json.dumps(card))
    return folder / "card.json"


def test_another_program_finds_material_laws_and_time_step(tmp_path, monkeypatch):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    monkeypatch.setattr(
        "repose.report.page.sections.read_card",
        lambda path: json.loads(path.read_text()),
    )
    assert "For another program" not in written((config, jobs, files), tmp_path)
    files["card"] = card_of(tmp_path)
    text = written((config, jobs, files), tmp_path)
    values = text[text.index('id="material"') : text.index('id="check"')]
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", values)
    rows = dict(pairwise(cells))
    assert rows["grain: density"] == "840.5"
    assert rows["grain: length along x"] == "0.02114"  # SI units
    assert rows["grain: mass"] == "0.001251"
    # E = 2 G (1 + nu)
    assert float(rows["wall: Young&#39;s modulus"]) == pytest.approx(3.136e9)
    assert rows["time step"] == "5e-05"
    assert "constant &lt;torque&gt;" in values
    copied = values_of(text)["copyMaterial"]
    says(copied, "grain: density\t840.5\tkg/m³", "rolling\tconstant <torque>")


def test_table_4_has_parameters_errors_and_the_published_sets(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS[:1])
    sets = pd.DataFrame([{name: 0.25 for name in PARAMETERS}] * 2)
    sets["solution"] = ["22", "representative"]
    sets["aor_predicted_deg"] = [32.5, 32.5]
    sets["aor_simulated_deg"] = [32.0, np.nan]
    sets.to_csv(tmp_path / "published.csv", index=False)
    files["published"] = tmp_path / "published.csv"
    text = written((config, jobs, files), tmp_path)
    start = text.index("<h3>Parameter sets that were")
    table4 = text[start : text.index("Error: difference of predicted")]
    rows = [
        re.findall(r"<td[^>]*>([^<]*)</td>", row)
        for row in re.findall("<tr.*?</tr>", table4)
    ]
    answer = rows[1]
    assert answer[3:9] == ["0.2", "0.5", "0.04", "0.3", "0.6", "0.2"]
    row = pd.read_csv(files["table4"]).iloc[0]
    simulated = row["aor_simulated_deg"]
    percent = 100 * abs(row["aor_predicted_deg"] - simulated) / simulated
    assert float(answer[-1]) == pytest.approx(percent, abs=0.005)
    published = ["published 22", "published", "", *6 * ["0.25"], "32.5", "32", "1.56"]
    assert rows[-2] == published
    assert rows[-1][:2] == ["published answer", "published"]
    assert rows[-1][-2:] == ["not published", ""]
    assert table4.count('<tr class="screen">') == 2  # they are not printed


def test_the_published_answer_stands_beside_the_parameters(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS, fixed=("e_gp",))
    header = "<th>published answer</th>"
    assert header not in written((config, jobs, files), tmp_path)
    sets = pd.DataFrame([{name: 0.2531 for name in PARAMETERS}] * 2)
    sets = sets.assign(solution=["22", "representative"], source="Ji et al. 2026")
    files["published"] = tmp_path / "published.csv"
    sets.to_csv(files["published"], index=False)
    for given in (files, {name: files[name] for name in files if name != "posterior"}):
        text = written((config, jobs, given), tmp_path)
        table = text[text.index(header) : text.index('id="copy"')]
        rows = re.findall("<tr.*?</tr>", table)
        assert len(rows) == len(PARAMETERS)
        n_columns = text[: text.index(header)].rpartition("<tr>")[2].count("<th")
        for row in rows:
            cells = re.findall(r"<td[^>]*>([^<]*)</td>", row)
            assert cells[n_columns] == "0.253"
            assert len(cells) == n_columns + 1 + (2 if given is files else 0) + 1
        assert "recommends (Ji et al. 2026)" in text
    # The table of a publication that recommends no set
    sets[:1].to_csv(files["published"], index=False)
    assert header not in written((config, jobs, files), tmp_path)


def test_the_page_says_what_the_measurements_do_not_determine(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    table = pd.read_csv(files["posterior"])
    samples = pd.read_csv(files["dataset"])
    inside = np.ones(len(samples), bool)
    for entry in BOTH:
        inside &= samples[entry.name].between(entry.low, entry.high)
    assert inside.sum() > 1
    files["posterior_summary"] = tmp_path / "posterior.json"
    files["posterior_summary"].write_text('{"discrepancy_sd": [2.0204, 2.5433]}')
    for width, phrase in (
        (1.012, "determine none of the 6 parameters: each 95 % interval has 100 %"),
        (
            0.5,
            "narrow the intervals of 6 of the 6 parameters: the narrowest 95 % interval has 50 %",
        ),
    ):
        table["width_ratio"] = width
        table.to_csv(files["posterior"], index=False)
        text = written((config, jobs, files), tmp_path)
        assert phrase in text
        assert "With the assumed error of the simulator (2 deg, 2.5 mm), the" in text
        assert "101 %" not in text
        assert f"{inside.sum()} of the 60 simulated samples already lie inside" in text
    assert ("50 %: not determined" in text) is False
    # A wide interval with much information: the report says what the command says.
    for width, bits in ((0.93, 0.23), (0.89, 0.1), (0.95, 1.2)):
        table["width_ratio"] = width
        table["information_bits"] = bits
        table.to_csv(files["posterior"], index=False)
        row = {"below_centre": 0.6, **table.iloc[0], "parameter": "a"}
        is_open = "a is not determined" in state_determination(row)
        text = written((config, jobs, files), tmp_path)
        assert (f"{100 * width:.0f} %: not determined" in text) is is_open
        assert ("determine none of the 6" in text) is is_open
    table["width_ratio"] = 0.5
    table.to_csv(files["posterior"], index=False)
    del files["posterior_summary"]
    text = written((config, jobs, files), tmp_path)
    assert "With the assumed error of the simulator, the measurements narrow" in text


def test_the_drum_and_the_contents_have_places(tmp_path):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    text = written((config, jobs, files), tmp_path)
    assert 'href="#drum"' not in text
    rows = [
        ("first slip, turned", "before_turned_deg", 50.8, 1.2, 6),
        ("turned at the reported time", "report_turned_deg", 27.0, 1.6e-15, 6),
    ]
    columns = ["quantity", "key", "mean", "standard_error", "runs"]
    pd.DataFrame(rows, columns=columns).to_csv(tmp_path / "drum.csv", index=False)
    files["drum_summary"] = tmp_path / "drum.csv"
    text = written(
        (config, jobs, files), tmp_path, {"All samples": tmp_path / "dataset.csv"}
    )
    drum = text[text.index('id="drum"') : text.index('id="other-parameters"')]
    says(drum, "50.8 ± 1.2 deg", '<td data-head="simulated">27 deg</td>')
    # Without published sets there is nothing to compare with.
    assert 'id="drum-result"' not in text
    for name in re.findall(r'href="#([\w-]+)"', text):
        assert f'id="{name}"' in text, name


@pytest.mark.parametrize(("slip_deg", "disagrees"), [(50.8, True), (20.0, False)])
def test_a_slip_after_the_end_of_the_articles_run_stands_beside_the_verdict(
    tmp_path, slip_deg, disagrees
):
    config, jobs, files = made_up_study(tmp_path, TARGETS)
    sets = pd.DataFrame([{name: 0.25 for name in PARAMETERS}] * 2)
    sets["solution"] = ["22", "representative"]
    sets.to_csv(tmp_path / "published.csv", index=False)
    rows = [
        ("first slip, turned", "before_turned_deg", slip_deg, 1.2, 6),
        ("turned at the reported time", "report_turned_deg", 27.0, 0.0, 6),
    ]
    columns = ["quantity", "key", "mean", "standard_error", "runs"]
    pd.DataFrame(rows, columns=columns).to_csv(tmp_path / "drum.csv", index=False)
    files["published"] = tmp_path / "published.csv"
    files["drum_summary"] = tmp_path / "drum.csv"
    text = written((config, jobs, files), tmp_path)
    above = text[: text.index('id="origin"')]
    assert ('id="drum-result"' in above) == disagrees
    assert (f"first slips at {slip_deg:.0f}°" in above) == disagrees


def test_a_prediction_comes_with_its_expected_optimism(tmp_path):
    study = made_up_study(tmp_path, TARGETS)
    table4 = pd.read_csv(tmp_path / "table4.csv").drop(columns="n_seeds")
    table4.to_csv(tmp_path / "table4.csv", index=False)
    assert "The expected optimism of this prediction was not computed" in written(
        study, tmp_path
    )
    table4[name_derived_column("aor_deg", "optimism")] = 0.376
    table4[name_derived_column("aor_deg", "optimism_se")] = 0.07
    table4.to_csv(tmp_path / "table4.csv", index=False)
    sentence = "does not include the expected optimism of the prediction (angle of repose: expected optimism"
    assert f"{sentence} +0.376 ± 0.070 deg)" in written(study, tmp_path)

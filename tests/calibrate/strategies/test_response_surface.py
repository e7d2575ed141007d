"""The response surface strategy with a simulator of one line: every step reads the result of the step before."""

import json
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
import synthetic
from matplotlib.text import Text
from refusals import input_error
from shared import entries
from stage_runs import conclude, propose
from synthetic import (
    MATTER,
    RANGES,
    SECTION,
    SETTINGS,
    SPACE,
    TARGETS,
    dataset,
    responses,
)

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.designs import optimal
from repose.calibrate.designs.optimum import Optimum
from repose.calibrate.strategies import Answer
from repose.calibrate.strategies.response_surface import (
    ResponseSurface,
    screening,
    surface,
)
from repose.calibrate.strategies.response_surface.steps import (
    STEPS,
    list_factors,
    make_samples,
)
from repose.calibrate.targets import Targets
from repose.report.figures import response_surface as figures
from repose.report.figures import style
from repose.report.study_view import StudyView
from repose.stages import batches

CONFIG = {"targets": entries(TARGETS), "parameters": RANGES}


def campaign(folder, noise, section=SECTION, space=SPACE, seed=1):
    """All steps on files, in folders of their names; the table of the check."""
    steps = [folder / name for name in STEPS]
    study = synthetic.study(space=space, response_surface=section)
    for number, step in enumerate(steps):
        propose("response_surface", study, steps[:number], step)
        synthetic.write_poured(
            step,
            pd.read_csv(step / "samples.csv"),
            noise,
            [seed, number],
            section["seeds"],
        )
    assert propose("response_surface", study, steps, folder / "answer")["answer"]
    conclude("response_surface", study, [*steps, folder / "answer"], folder)
    return pd.read_csv(folder / "check.csv")


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("noisy")
    return folder, campaign(folder, 0.5)


@pytest.mark.parametrize("name", ["box_behnken", "rotatable"])
def test_without_noise_the_optimum_is_the_target_and_a_fixed_parameter_is_no_factor(
    name, tmp_path
):
    # a surface of second order is the simulator itself inside its design
    space = contact_space(RANGES | {"e_gg": {"fixed": 0.25}})
    check = campaign(
        tmp_path, 0.0, SECTION | {"surface": name, "most_factors": 3}, space
    )
    assert check["deviation_percent"].abs().max() < 1e-3
    assert json.loads((tmp_path / "optimum.json").read_text())["met"]
    for step in STEPS:
        table = pd.read_csv(tmp_path / step / "samples.csv")
        assert (table["e_gg"] == 0.25).all()
        assert "coded_e_gg" not in table


def test_the_screening_finds_the_parameters_that_matter(noisy):
    found = json.loads((noisy[0] / "screening.json").read_text())
    assert set(found["kept"]) >= MATTER
    assert found["kept"][0] in {"mus_gg", "mur_gg"}
    assert set(found["kept"]) | set(found["dropped"]) == set(PARAMETERS)
    table = screening.make_screening_samples(SPACE, SETTINGS)
    models = screening.fit_models(table, dataset(table, 0.1), TARGETS, "linear")
    none = {"significance": 1e-30}
    for changes, count in (
        (none, 3),
        (none | {"surface": "rotatable"}, 2),
        ({"significance": 0.999999}, 4),
    ):
        assert (
            len(screening.choose_factors(models, SETTINGS.model_copy(update=changes)))
            == count
        )


def test_the_ascent_goes_from_the_centre_to_the_edge_of_a_range(noisy):
    path = pd.read_csv(noisy[0] / "path.csv")
    factors = list_factors(path)
    first = path.loc[0, list(PARAMETERS)].to_numpy(float)
    assert first == pytest.approx(list(SPACE.centre.values()))
    others = [name for name in PARAMETERS if name not in factors]
    assert (path[others] == path.loc[0, others]).all(axis=None)
    coded = path[[f"coded_{name}" for name in factors]].to_numpy()
    assert np.abs(coded).max() == pytest.approx(1)
    # the best step is that of the least error
    (least,) = path.loc[path["best"], "error_percent"]
    assert least == path["error_percent"].min()


def test_the_surface_lies_about_the_best_point_of_the_ascent(noisy):
    path = pd.read_csv(noisy[0] / "path.csv")
    table = pd.read_csv(noisy[0] / "surface/samples.csv")
    unit = SPACE.unit(table[list(PARAMETERS)].to_numpy(float))
    assert unit.min() > -1e-12
    assert unit.max() < 1 + 1e-12
    best = SPACE.unit(path.loc[path["best"], list(PARAMETERS)].to_numpy(float))[0]
    for name in list_factors(table):
        k = SPACE.free.index(name)
        assert np.ptp(unit[:, k]) == pytest.approx(2 * SECTION["reach"])
        assert unit[:, k].mean() == pytest.approx(np.clip(best[k], 0.25, 0.75))


def test_the_check_pours_the_optimum_again(noisy):
    folder, check = noisy
    table = pd.read_csv(folder / "check/samples.csv")
    optimum = json.loads((folder / "optimum.json").read_text())
    assert len(table) == SECTION["checks"]
    expected = list(optimum["parameters"].values())
    assert (table[list(PARAMETERS)].to_numpy() == expected).all()
    assert check["simulated"].to_numpy() == pytest.approx(responses(table)[0], rel=0.01)
    summary = json.loads((folder / "summary.json").read_text())
    n_samples = sum(len(pd.read_csv(folder / name / "samples.csv")) for name in STEPS)
    assert summary["pours"] == 3 * n_samples


def test_coded_units_are_those_of_the_parameters(noisy):
    table = pd.read_csv(noisy[0] / "surface/samples.csv")
    for k in (0, 7, len(table) - 1):
        row = table.loc[k]
        coded = row[[f"coded_{name}" for name in list_factors(table)]].to_numpy(float)
        unit = surface.convert_to_unit_cube(table, coded, SPACE)
        expected = row[list(PARAMETERS)].to_numpy(float)
        assert SPACE.values(unit)[0] == pytest.approx(expected)


def about_the_centre(settings):
    """The design of a surface in the factors that matter, about the centre of the ranges."""
    points = pd.DataFrame({"error_percent": [1.0], "best": [True]})
    points = points.assign(
        **SPACE.centre, **{f"coded_{name}": 0.0 for name in sorted(MATTER)}
    )
    return surface.make_surface_samples(points, SPACE, settings)


@pytest.mark.slow
def test_the_interval_of_the_check_holds_what_it_says():
    # a surface of second order is right here, so 95 % of the checks lie inside: 1000 of them, standard error 0.7 %
    table = about_the_centre(SETTINGS)
    best = Optimum(np.array([0.3, -0.2, 0.5]), np.zeros(2), True, 1.0)
    check = surface.make_check_samples(table, best, SPACE, SETTINGS.checks)
    inside = []
    for k in range(500):
        models = screening.fit_models(
            table, dataset(table, 0.5, [k, 0]), TARGETS, "quadratic"
        )
        predicted = surface.predict_at_optimum(models, best, TARGETS, SECTION["checks"])
        inside.append(
            surface.add_check(predicted, dataset(check, 0.5, [k, 1]))["as_predicted"]
        )
    assert np.mean(inside) == pytest.approx(0.95, abs=0.021)


@pytest.mark.parametrize("name", ["rotatable", "face_centred"])
def test_axial_runs_of_a_central_composite_lie_at_the_reach(name):
    table = about_the_centre(SETTINGS.model_copy(update={"surface": name}))
    assert len(table) == 14 + SECTION["centres"]
    unit = SPACE.unit(table[list(PARAMETERS)].to_numpy(float))
    assert np.ptp(unit[:, SPACE.free.index(list_factors(table)[0])]) == pytest.approx(
        2 * SECTION["reach"]
    )


def bent(table):
    """A dataset of a response that the corners of the ranges underrate: 60 mm in their mean, 68 mm at the centre."""
    offset = SPACE.unit(table[list(PARAMETERS)].to_numpy(float)) - 0.5
    height = (
        68
        + 8 * offset[:, 1]
        + 4 * offset[:, 2]
        - 16 * (offset[:, 4] ** 2 + offset[:, 0] ** 2)
    )
    found = table[["sample", *PARAMETERS]].assign(status="ok", reason="", n_seeds=3)
    return found.assign(height_mm=height, aor_deg=30.0)


@pytest.mark.parametrize(("aim", "sign"), [(64.0, -1), (72.0, 1)])
def test_the_ascent_climbs_from_the_poured_centre_and_not_from_the_mean_of_the_corners(
    aim, sign
):
    height = synthetic.configuration(TARGETS, SPACE)["targets"][1]
    targets = Targets.of([height | {"value": aim, "range": [aim - 2, aim + 2]}])
    study = synthetic.study(targets, response_surface=SECTION)
    found = ResponseSurface().propose(
        study, bent(screening.make_screening_samples(SPACE, SETTINGS))
    )
    assert found.notes["screening"]["centre"]["height_mm"] == pytest.approx(68.0)
    assert found.notes["screening"]["corners"]["height_mm"] == pytest.approx(60.0)
    assert np.sign(found.samples["coded_mus_gg"].iloc[-1]) == sign


def test_steps_share_no_sample_and_leave_out_those_that_gave_no_pile():
    table = screening.make_screening_samples(SPACE, SETTINGS)
    data = dataset(table)
    data.loc[[0, 5], "status"] = "failed"
    data.loc[[0, 5], list(TARGETS.names)] = np.nan
    whole = screening.fit_models(table, dataset(table), TARGETS, "linear")
    assert (
        len(screening.fit_models(table, data, TARGETS, "linear")[0].response)
        == len(whole[0].response) - 2
    )
    steps = [
        set(
            make_samples(step, SPACE, np.zeros((500, 6)), (), np.zeros((500, 0)))[
                "sample"
            ]
        )
        for step in STEPS
    ]
    assert len(set().union(*steps)) == 2000


def test_too_few_piles_are_reported_with_their_folder(tmp_path):
    study = synthetic.study(response_surface=SECTION)
    table = screening.make_screening_samples(SPACE, SETTINGS)
    runs = synthetic.runs_of(table, 3, 0.0, 1)
    runs.loc[runs["sample"].isin(table["sample"].iloc[3:12]), "status"] = "failed"
    synthetic.write_tables(tmp_path, table, runs)
    step = "response_surface", study, [tmp_path], tmp_path / "next"
    input_error(f"{tmp_path}: .*enough for the model", propose, *step)
    synthetic.write_poured(tmp_path, table.iloc[:5])
    input_error("all samples of the step", propose, *step)


def test_the_figures_of_the_strategy_have_their_panels_and_targets(noisy):
    folder = noisy[0]
    surface = {
        name: str(folder / f"surface/{name}.csv") for name in ("samples", "dataset")
    }
    optimum = {"optimum": str(folder / "optimum.json")}
    factors = list_factors(pd.read_csv(folder / "surface/samples.csv"))
    # for each pair of factors a panel of either target
    pairs = len(factors) * (len(factors) - 1)
    drawings = [
        (
            figures.draw_pareto_charts,
            {"effects": str(folder / "screening_effects.csv")},
            2,
        ),
        (
            figures.draw_pareto_charts,
            {"effects": str(folder / "surface_effects.csv")},
            2,
        ),
        (figures.draw_perturbation_plots, surface, 2),
        (figures.draw_contour_plots, surface | optimum, pairs),
    ]
    for function, inputs, panels in drawings:
        with style.applied():
            figure = function(inputs, StudyView(CONFIG))
            figure.draw_without_rendering()
        assert len(figure.axes) == panels
        texts = " ".join(text.get_text() for text in figure.findobj(Text))
        assert "angle" in texts.lower() or "θ" in texts or "Height" in texts


def test_the_loop_of_a_study_is_that_of_the_files(noisy):
    study = synthetic.study(response_surface=SECTION)
    data = pd.DataFrame()
    for number, step in enumerate(STEPS, start=1):
        batch = ResponseSurface().propose(study, data)
        table = pd.read_csv(noisy[0] / step / "samples.csv")[["sample", *PARAMETERS]]
        assert (batch.samples["seeds"] == SECTION["seeds"]).all()
        np.testing.assert_allclose(batch.samples[list(table)], table, rtol=1e-9)
        data = batches.read_runs_of_batches(
            [noisy[0] / name for name in STEPS[:number]], TARGETS
        )
    found = ResponseSurface().propose(study, data)
    assert isinstance(found, Answer)
    solution = pd.read_csv(noisy[0] / "solutions.csv").iloc[0]
    expected = solution[list(PARAMETERS)].to_numpy(float)
    np.testing.assert_allclose(found.values, expected, rtol=1e-6)
    expected = solution[list(TARGETS.predicted)].to_numpy(float)
    np.testing.assert_allclose(found.mean, expected, rtol=1e-6)


def test_the_check_has_the_mean_of_its_good_runs_and_the_standard_error_of_the_mean():
    predicted = pd.DataFrame(
        {"response": ["aor_deg"], "target": [40.0], "low": [30.0], "high": [32.0]}
    )
    dataset = pd.DataFrame(
        {
            "aor_deg": [30.0, 32.0, 34.0, 99.0],
            "status": ["ok", "ok", "ok", "jammed"],
        }
    )
    checked = surface.add_check(predicted, dataset).iloc[0]
    assert checked["simulated"] == pytest.approx(32.0)
    assert checked["simulated_error"] == pytest.approx(2.0 / np.sqrt(3.0))
    assert checked["deviation_percent"] == pytest.approx(-20.0)
    assert checked["as_predicted"]

    one_run = surface.add_check(predicted, dataset.head(1)).iloc[0]
    assert one_run["simulated"] == 30.0
    assert np.isnan(one_run["simulated_error"])


# Half of the corners of the ranges are forbidden, and the known parameters are allowed.
RULE = "mur_gg <= 0.09 * mus_gg"


def places_of(folder):
    """The samples of all steps, and which of them obey the rule."""
    tables = [pd.read_csv(folder / step / "samples.csv") for step in STEPS]
    table = pd.concat(tables, ignore_index=True)
    return table, table["mur_gg"] <= 0.09 * table["mus_gg"]


@pytest.fixture
def one_start(monkeypatch):
    """D-optimal runs of one search, in tests that say nothing of their determinant; test_optimal.py does."""
    monkeypatch.setattr(optimal, "N_STARTS", 1)


@pytest.mark.usefixtures("one_start")
@pytest.mark.parametrize("name", ["box_behnken", "rotatable"])
def test_with_a_constraint_every_run_is_allowed_and_the_target_is_met(name, tmp_path):
    space = SPACE.with_constraints([RULE])
    section = SECTION | {"surface": name, "most_factors": 3}
    check = campaign(tmp_path, 0.0, section, space)
    assert check["deviation_percent"].abs().max() < 1e-3
    table, is_allowed = places_of(tmp_path)
    assert is_allowed.all()
    # Runs of the designs without constraints stay where they are allowed.
    first = table[table["sample"] < 2000].reset_index(drop=True)
    corners = screening.make_screening_samples(SPACE, SETTINGS)
    is_forbidden = corners["mur_gg"] > 0.09 * corners["mus_gg"]
    assert 4 <= is_forbidden.sum() <= 8
    assert (first["is_new"] == is_forbidden).all()
    kept = list(PARAMETERS)
    np.testing.assert_allclose(
        first.loc[~is_forbidden, kept], corners.loc[~is_forbidden, kept]
    )
    found = json.loads((tmp_path / "screening.json").read_text())
    assert found["new_runs"] == is_forbidden.sum()
    summary = json.loads((tmp_path / "summary.json").read_text())
    words = f"The constraints forbid {is_forbidden.sum()} of the 17 runs"
    assert words in summary["steps"][0]
    if name == "box_behnken":
        check_masks(tmp_path)


def check_masks(folder):
    """The contours and lines of a surface leave out what is forbidden."""
    files = {"optimum": str(folder / "optimum.json")}
    for name in ("samples", "dataset"):
        files[name] = str(folder / f"surface/{name}.csv")
    table = pd.read_csv(files["samples"])
    region = surface.make_surface_region(table, SPACE.with_constraints([RULE]))
    factors = list_factors(table)
    optimum = json.loads((folder / "optimum.json").read_text())["coded"]

    def are_allowed(config):
        """For each panel of contours whether all of its places are allowed."""
        with style.applied():
            figure = figures.draw_contour_plots(files, StudyView(config))
        found = []
        pairs = 2 * list(combinations(range(len(factors)), 2))
        for panel, pair in zip(figure.axes, pairs, strict=True):
            paths = panel.collections[0].get_paths()
            places = np.vstack([path.vertices for path in paths if len(path.vertices)])
            coded = np.tile([optimum[name] for name in factors], (len(places), 1))
            coded[:, pair] = places
            found.append((region.excesses(coded) < 1e-9).all())
        return found

    assert all(are_allowed(CONFIG | {"constraints": [RULE]}))
    assert not all(are_allowed(CONFIG))
    with style.applied():
        figure = figures.draw_perturbation_plots(
            files, StudyView(CONFIG | {"constraints": [RULE]})
        )
    for k, line in enumerate(figure.axes[0].lines[: len(factors)]):
        points = np.zeros((len(line.get_xdata()), len(factors)))
        points[:, k] = line.get_xdata()
        is_drawn = np.isfinite(line.get_ydata())
        assert (is_drawn == region.is_allowed(points)).all()


@pytest.mark.usefixtures("one_start")
def test_with_a_constraint_the_optimum_is_the_best_allowed_set(tmp_path):
    # The known parameters are forbidden; the optimum lies on the edge of what is allowed.
    space = SPACE.with_constraints(["mur_gg <= 0.06 * mus_gg"])
    campaign(tmp_path, 0.0, SECTION | {"most_factors": 3}, space)
    table = pd.read_csv(tmp_path / "surface/samples.csv")
    optimum = json.loads((tmp_path / "optimum.json").read_text())
    edge = 0.06 * optimum["parameters"]["mus_gg"]
    assert optimum["parameters"]["mur_gg"] == pytest.approx(edge, abs=2e-3)
    assert optimum["parameters"]["mur_gg"] <= edge
    # The twin: points all over the cube of the surface.
    random = np.random.default_rng(3)
    coded = random.uniform(-1, 1, (20_000, 3))
    unit = surface.convert_to_unit_cube(table, coded, SPACE)
    unit = unit[space.is_allowed(unit)]
    sets = pd.DataFrame(space.values(unit), columns=list(PARAMETERS))
    aims = TARGETS.aim

    def miss(sets):
        return ((responses(sets) / aims - 1) ** 2).sum(axis=1).min()

    best = pd.DataFrame([optimum["parameters"]])
    assert miss(best) < miss(sets) + 1e-7


def test_a_path_goes_on_along_a_constraint():
    space = SPACE.with_constraints([RULE])
    study = synthetic.study(space=space, response_surface=SECTION)
    table = screening.make_screening_samples(space, SETTINGS)
    models = screening.fit_models(table[:12], dataset(table), TARGETS, "linear")
    kept = ["mur_gg", "mus_gp", "e_gg"]
    centre = np.array([20.0, 40.0])
    path = screening.make_ascent_samples(models, centre, kept, study)
    assert len(path) == SECTION["steps"] + 1
    # mus_gg stays at its centre, 0.55, so mur_gg ends at 0.0495 and mus_gp goes on.
    assert path["mur_gg"].max() == pytest.approx(0.0495, abs=1e-6)
    assert (path["mur_gg"] <= 0.09 * path["mus_gg"]).all()
    assert path["mus_gp"].is_monotonic_increasing
    assert path["mus_gp"].iloc[-1] > path["mus_gp"].iloc[-2]


def test_a_region_without_room_for_the_model_is_refused_by_name():
    rules = ["mur_gg <= 0.09 * mus_gg", "mur_gg >= 0.09 * mus_gg"]
    input_error(
        "constraints is .*expected constraints that allow enough different runs for a linear model",
        screening.make_screening_samples,
        SPACE.with_constraints(rules),
        SETTINGS,
    )

"""The configuration: what is let through, and what one message says about the rest."""

import copy
import importlib
import json
import pickle
import pkgutil
import re
import shutil

import numpy as np
import pytest
from known import is_known
from refusals import input_error
from shared import BUILT_IN, ROOT, check_all, every_bench_test, put

import repose
from repose.bench import bench, names
from repose.bench.parameters import LAW_PARAMETERS
from repose.calibrate import strategies
from repose.calibrate import surrogates as surrogate
from repose.calibrate.study import Study
from repose.calibrate.study_file import OwnPosterior, OwnSequential, StudyFile
from repose.common import faults, reading
from repose.common.section import Section
from repose.config import cost, loader, page
from repose.config.computed import COMPUTED_SETTINGS
from repose.config.models import make_settings_type
from repose.config.pipeline import PipelineConfig
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS

PAGE = (ROOT / "config/README.md").read_text()
SHIPPED = ("config", "paper", "quick")
# Bench tests beside the built-in ones; `known/` does not hold their sections.
ADDED = [name for name in names() if name not in BUILT_IN]


# What is registered in the program, or added to it.
REGISTERED = {
    "strategies": strategies.names(),
    "surrogates": surrogate.names(),
    "contact laws": tuple(CONTACT_LAWS),
    "rolling laws": tuple(ROLLING_LAWS),
}


def without_names(text):
    """A text in which "all strategies" stands for their names, and so on."""
    for kind, names_of_kind in REGISTERED.items():
        text = text.replace(json.dumps(names_of_kind), json.dumps(f"all {kind}"))
        name = "|".join(map(re.escape, names_of_kind))
        text = re.sub(rf"\b(?:{name})(?: or (?:{name})\b)+", f"all {kind}", text)
    return text


@pytest.mark.parametrize(
    ("kind", "names_of_kind"),
    [
        ("strategies", ("published", "refined", "response_surface", "sequential")),
        (
            "surrogates",
            ("network", "gaussian_process", "network_ensemble", "quadratic"),
        ),
        ("contact laws", ("hertz_mindlin", "hertz_mindlin_rescaled", "linear_spring")),
        ("contact laws", ("jkr", "sjkr", "eepa")),
        ("rolling laws", ("budget", "constant_torque", "epsd", "epsd2")),
    ],
)
def test_names_that_studies_have_written_are_still_registered(kind, names_of_kind):
    assert set(names_of_kind) <= set(REGISTERED[kind])


def test_the_tables_of_the_page_are_those_of_the_sections():
    text = page.update_tables(PAGE)
    assert without_names(text) == without_names(PAGE), (
        "write the page by `python -m repose.config.page`"
    )
    sections = set(page.TABLE_PATTERN.findall(PAGE))
    assert sections == {name for name in page.make_tables() if name not in ADDED}


def test_a_section_without_a_table_on_the_page_is_named(tmp_path, monkeypatch, capsys):
    method = tmp_path / page.places.METHOD_CONFIG
    file = tmp_path / page.PAGE_PATH
    for copied in (method, file):
        copied.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / copied.relative_to(tmp_path), copied)
    monkeypatch.setattr(page.places, "find_program_folder", lambda: tmp_path)
    page.main()
    assert capsys.readouterr().out.count("no table of the section") == len(ADDED)

    text = PAGE.replace("<!-- keys: drum -->", "").replace("<!-- keys: wall -->", "")
    file.write_text(text)
    page.main()
    printed = capsys.readouterr().out
    assert printed.count("\n") == 2 + len(ADDED)
    for name in ("drum", "wall"):
        assert f"no table of the section {name}; expected the lines" in printed


def test_what_every_key_takes_is_known():
    sections_of_a_study = {
        "sequential": OwnSequential.model_fields,
        "posterior": OwnPosterior.model_fields,
    }
    lines = []
    for model, sections in (
        (make_settings_type(), every_bench_test()),
        (StudyFile, sections_of_a_study),
    ):
        for section, keys in sections.items():
            if section in ADDED or not isinstance(keys, dict):
                continue
            for key in keys:
                allowed = faults.describe_schema(
                    faults.find_schema([section, key], model)
                )
                lines.append(f"{section}.{key}: {allowed}")
    is_known("keys.txt", without_names("\n".join(lines)))


def below(kind):
    return [
        subclass
        for child in kind.__subclasses__()
        for subclass in (child, *below(child))
    ]


def test_the_limits_and_defaults_of_all_that_is_read_are_known():
    modules = {
        section.name: importlib.import_module(section.name)
        for section in pkgutil.walk_packages(repose.__path__, "repose.")
    }
    models = [
        model
        for model in below(Section)
        if getattr(modules.get(model.__module__), model.__name__, 0) is model
        and model not in [bench(name).settings for name in ADDED]
    ]
    parts = {
        model.__name__: model.model_json_schema().get("properties", {})
        for model in models
    }
    lines = sorted(
        f"{section}.{key}: {json.dumps(without_words(field))}"
        for section, part in parts.items()
        for key, field in part.items()
    )
    is_known("limits.txt", without_names("\n".join(lines)))


def without_words(schema):
    """A schema without the texts of the page."""
    if isinstance(schema, list):
        return [without_words(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        key: without_words(part)
        for key, part in schema.items()
        if key not in ("title", "description", "source", "allowed")
    }


@pytest.fixture(scope="module")
def matched():
    return PipelineConfig.load(ROOT / "config/matched.yaml", check_inputs=True).config


@pytest.fixture
def config(matched):
    return copy.deepcopy(matched) | {"figures": {}}


def test_shipped_configurations_pass_every_check_and_the_paper_has_the_published_settings():
    studies = [PipelineConfig.load(f"config/{name}.yaml") for name in SHIPPED]
    for study in studies:
        study.check_inputs()
    assert len({study.config["results_dir"] for study in studies}) == len(SHIPPED)
    config = PipelineConfig.load("config/paper.yaml").config
    assert config["simulation"]["time_step_s"] == 2.9256e-5
    assert config["funnel"]["duration_s"] == 18
    assert config["design"]["method"] == "lhsdesign"
    assert config["design"]["samples"] == 150
    assert config["funnel"]["seeds"] == 1
    assert [target["aim"] for target in config["targets"]] == [32.5, 66.5]


def test_a_target_may_leave_out_its_bench_test_and_its_range(config):
    short = {"value": 40.0, "sd": 3.0, "repetitions": 9}
    config["targets"] = [
        {"response": "drum_slip_deg"} | short,
        {"response": "height_mm"} | short | {"sd": 0.3},
    ]
    slip, height = PipelineConfig.of(config).config["targets"]
    # two standard errors to each side
    assert slip["apparatus"] == "drum"
    assert slip["range"] == [38.0, 42.0]
    # at least 1 %
    assert height["apparatus"] == "funnel"
    assert height["range"] == [39.6, 40.4]
    config["targets"] = [{"response": "weight_g"} | short]
    input_error("responses of funnel", PipelineConfig.of, config)


def test_every_key_is_explained():
    explained = (ROOT / "config" / "README.md").read_text()
    for name in PipelineConfig.load().config:
        assert f"`{name}`" in explained
        section = faults.find_schema([name], make_settings_type())
        for key in section.get("properties", ()):
            assert f"`{key}`" in explained, f"{name}.{key}"


def test_no_unknown_key_is_allowed_and_few_are_optional():
    schema = faults.make_schema(make_settings_type())
    bench_tests = {*names()} - {"funnel"}
    computed = {setting.key.partition(".")[2] for setting in COMPUTED_SETTINGS}
    may_be_absent = {
        "contact_law",
        "rolling_law",
        *{"mean_size", "note"},  # absent in results of earlier versions
        "constraints",
        *{"figures", "format", "dpi", "tilt_deg", "taps", "tap_mm"},
        *{"berries", "filling_height_mm"},  # one of the two
        *LAW_PARAMETERS,
        *computed,
        *bench_tests,
        "joint_targets",
        "shape_study",
    }
    sections = [
        faults.find_schema([name], make_settings_type())
        for name in schema["properties"]
        if name not in ADDED
    ]
    for section in [schema, *sections]:
        if "properties" not in section:
            continue
        assert section["additionalProperties"] is False
        optional = set(section["properties"]) - set(section.get("required", ()))
        assert optional <= may_be_absent


def test_a_key_may_be_auto_where_it_is_computed():
    found = set()
    for name in faults.make_schema(make_settings_type())["properties"]:
        section = faults.find_schema([name], make_settings_type())
        for key, field in section.get("properties", {}).items():
            if field.get("default") == "auto":
                found.add(f"{name}.{key}")
    assert found == {setting.key for setting in COMPUTED_SETTINGS}


BAD_VALUES = (
    ("refine.pours", 1, "an integer from 2 to 4096"),
    ("funnel.seeds", 0, "an integer from 1 to 100"),
    ("funnel.seeds", 2.5, "an integer"),
    ("funnel.seeds", "8", "an integer"),
    ("simulation.rest_energy_j", 0, "above 0"),
    ("simulation.tension", "maybe", "keep or release"),
    ("funnel", 3, "a section with the keys berries"),
    ("berry.poisson_ratio", 0.5, "a number from 0 to 0.49 or null"),
    ("berry.sizes", None, "a path"),
    ("label", "", "text of 1 to 60 characters"),
    ("note", "", "text of 1 to 600 characters on one line, or null"),
    ("results_dir", "my results", "a folder"),
    ("results_dir", "results/../src", "without .."),
    ("results_dir", "resources/mine", "outside"),
    ("results_dir", "results/published", "outside"),
    ("parameters.e_gg", [0.1, 1.2], "a pair [low, high] of numbers from 0.01 to 1"),
    ("parameters.e_gg", [0.4, 0.1], "low < high"),
    ("parameters.e_gg", [0.4, 0.4], "low < high"),
    (
        "parameters.e_gg",
        {"prior": {"mean": 0.3, "sd": 0.1}, "range": [0.4, 0.2]},
        "low < high",
    ),
    ("parameters.mur_gp", [0.1, 0.2, 0.3], "a pair"),
    ("targets.0.value", 40.0, "inside its range, 31 to 34"),
    ("targets.1.value", 60.0, "inside its range, 64 to 69"),
    ("targets.0.range", [34.0, 31.0], "low < high"),
    ("targets.0.range", [0.0, 34.0], "a pair [low, high] from 1 to 89"),
    ("targets.0.range", 3, "a pair [low, high] of numbers"),
    ("targets.0.sd", -1, "from 0 to"),
    ("targets.1.response", "aor_deg", "each response once"),
    ("targets.1.response", "weight_g", "the responses of funnel"),
    ("targets.0.apparatus", "shaker", "one of funnel, drum"),
    (
        "parameters.e_gg",
        {"fixed": 0.2, "prior": {"mean": 0.2, "sd": 0.1}},
        "fixed alone",
    ),
    (
        "parameters.e_gg",
        {"range": [0.2, 0.4]},
        "a pair [low, high]; the key range needs a prior or a scale beside it",
    ),
    ("targets.0.value", 240.0, "from 1 to 89"),
    ("measure.fit_to", 0.15, "at least 0.1 above measure.fit_from"),
    ("measure.fit_to", "crest", "berry or a number from 0.1 to 1"),
    ("measure.fit_from", 0.95, "berry or a number from 0 to 0.9"),
    (
        "measure.response",
        "slope",
        "flank or secant or steepest or whole or straightest",
    ),
    ("measure.berry_height_mm", 0, "above 0 and up to 1000 or null"),
    ("strategy", "guess", "published or refined or response_surface or sequential"),
    ("surrogate", "cubic", " or ".join(surrogate.names())),
    ("network.split", [0.7, 0.2, 0.2], "sum to 1"),
    ("network.split", [0.8, 0.2, 0.0], "above 0"),
    ("funnel.outlet_diameter_mm", 150.0, "below funnel.inlet_diameter_mm"),
    ("funnel.factory_diameter_mm", 151.0, "at most funnel.inlet_diameter_mm"),
    ("funnel.plate_diameter_mm", 30.0, "at least funnel.outlet_diameter_mm"),
    ("funnel.rest_window_s", 18.0, "below funnel.duration_s"),
    ("funnel.duration_s", 16.0, "above 16.8"),
    ("miga.tournament", 41, "at most miga.population"),
    ("drum.wall_thickness_mm", 100.0, "below half of drum.outer_diameter_mm"),
    ("drum.factory_height_mm", 95.0, "inside the drum"),
    ("drum.rotate_from_s", 1.7, "above 1.798"),
    ("drum.report_s", 4.0, "at least drum.rotate_from_s"),
    (
        "figures.format",
        ["pdf"],
        "a list with png, which the report shows, and no format twice",
    ),
    ("figures.format", ["png", "svg", "png"], "no format twice"),
    (
        "figures.format",
        ["png", "eps"],
        "a list of png and optionally pdf, svg or both",
    ),
)


def test_a_bad_value_is_reported_with_file_key_value_and_what_is_allowed(config):
    def check_message(key, value, allowed):
        fault = input_error(
            re.escape(allowed),
            PipelineConfig.of,
            put(copy.deepcopy(config), key, value),
            "my.yaml",
        )
        assert fault.source == "my.yaml"
        assert fault.key == key
        assert fault.value == value

    check_all(
        check_message,
        [
            (f"{key} {value!r}", key, value, allowed)
            for key, value, allowed in BAD_VALUES
        ],
    )


KNOWN = (
    ({"fixed": 2}, "fixed", "a number from 0.01 to 1"),
    ({"fixed": "0,5"}, "fixed", "a number from 0.01 to 1"),
    ({"fix": 0.5}, "fix", "a known key; did you mean fixed?"),
    ({"prior": {"mean": 0.2}}, "prior", "a section with the keys mean and sd"),
    (
        {"prior": {"mean": -0.2, "sd": 0.1}},
        "prior",
        "a mean that is a number from 0.01 to 1",
    ),
    ({"prior": {"mean": 0.2, "sd": 0}}, "prior", "an sd above 0 and up to 1"),
    (
        {"prior": {"mean": True, "sd": 0.1}},
        "prior",
        "a mean that is a number from 0.01 to 1",
    ),
)


@pytest.mark.parametrize(("entry", "key", "allowed"), KNOWN)
def test_a_fixed_value_and_a_prior_are_reported_by_their_own_keys(
    config, entry, key, allowed
):
    config["parameters"]["e_gg"] = entry
    fault = input_error(re.escape(allowed), PipelineConfig.of, config, "my.yaml")
    assert fault.key == f"parameters.e_gg.{key}"
    assert fault.value == entry[key]


def test_a_prior_may_be_narrow_ends_at_the_largest_friction_and_meets_its_range(config):
    for sd in (0.005, np.float64(0.05)):
        config["parameters"]["e_gg"] = {"prior": {"mean": np.float64(0.5), "sd": sd}}
        assert PipelineConfig.of(config).parameters.prior["e_gg"] == (0.5, sd)
    config["parameters"] |= {"mus_gg": {"prior": {"mean": 0.3, "sd": 3.0}}}
    config["parameters"] |= {"mur_gg": {"prior": {"mean": 0.5, "sd": 0.5}}}
    space = PipelineConfig.of(config).parameters
    ends = dict(zip(space.free, space.high, strict=True))
    assert ends["mus_gg"] == 5.0
    assert ends["mur_gg"] == 1.0
    known = config["parameters"]["mus_gg"] = {
        "prior": {"mean": 0.5, "sd": 0.01},
        "range": [0.52, 0.9],
    }
    assert PipelineConfig.of(config).parameters.prior["mus_gg"] == (0.5, 0.01)
    known["range"] = [0.57, 0.9]
    input_error(
        r"parameters\.mus_gg is .*; expected a range that overlaps 0\.47 to 0\.53",
        PipelineConfig.of,
        config,
    )


def test_what_follows_from_a_wrong_or_mistyped_key_is_reported_once(config):
    first, *others = (
        {key: value for key, value in target.items() if key != "range"}
        for target in config["targets"]
    )

    def check_key(key, value, allowed):
        wrong = config | {"targets": [first | {key: value}, *others]}
        assert (
            input_error(re.escape(allowed), PipelineConfig.of, wrong, "my.yaml").key
            == f"targets.0.{key}"
        )

    cases = [
        ("value in other units", "value", 240.0, "from 1 to 89"),
        ("a number of many digits", "value", 10**400, "a number from"),
        (
            "a large scatter",
            "sd",
            900.0,
            "so small that the mean with two standard errors",
        ),
    ]
    check_all(check_key, cases)
    ends = r"targets\.0\.range is \[88\.0.*, 89\.7.*\]; expected a pair \[low, high\] from 1"
    input_error(
        ends,
        PipelineConfig.of,
        config | {"targets": [first | {"value": 88.9, "sd": 0.1}, *others]},
        "my.yaml",
    )
    wrong = config | {"refin": config["refine"]}
    del wrong["refine"]
    input_error(
        r"^my.yaml: refin is \{.*did you mean refine\?$",
        PipelineConfig.of,
        wrong,
        "my.yaml",
    )
    config["funnel"]["seads"] = config["funnel"].pop("seeds")
    input_error(
        r"funnel\.seads is 6; .*did you mean seeds",
        PipelineConfig.of,
        config,
        "my.yaml",
    )


def test_noise_needs_replicates_of_every_bench_test_or_validation_samples(config):
    kept = copy.deepcopy(config)
    config["network"]["replicates"] = True
    once = config | {"funnel": config["funnel"] | {"seeds": 1}}
    input_error(
        r"funnel\.seeds is 1; expected at least 2, or network\.replicates: false",
        PipelineConfig.of,
        once,
    )
    config["drum"]["seeds"] = 1
    PipelineConfig.of(config)
    config["targets"].append(
        config["targets"][0] | {"response": "drum_slip_deg", "apparatus": "drum"}
    )
    input_error(r"drum\.seeds is 1; expected at least 2", PipelineConfig.of, config)
    config = kept
    network = config["network"] | {"validation_noise": True}
    message = r"network\.validation_noise is true; expected false where replicates"
    input_error(
        message, PipelineConfig.of, config | {"network": network | {"replicates": True}}
    )
    network |= {"replicates": False, "split": [0.7, 0.15, 0.15]}
    PipelineConfig.of(config | {"network": network})
    for split, samples in (([0.85, 0.0, 0.15], 150), ([0.7, 0.15, 0.15], 14)):
        study = config | {
            "network": network | {"split": split},
            "design": config["design"] | {"samples": samples},
        }
        input_error(
            r"network\.split is .*leaves more than 2 validation samples, or",
            PipelineConfig.of,
            study,
        )


def test_a_quadratic_surface_needs_more_samples_than_terms(config):
    """28 terms of six parameters, 21 of five; 0.7 of the samples train."""
    config |= {"surrogate": "quadratic"}
    config["design"]["samples"] = 41
    input_error(r"surrogate is 'quadratic'; .*below 29", PipelineConfig.of, config)
    config["design"]["samples"] = 42
    PipelineConfig.of(config)
    config["design"]["samples"] = 32
    config["parameters"]["e_gp"] = {"fixed": 0.3}
    PipelineConfig.of(config)


MISFITS = (
    ("response_surface.screening_runs", 10, "8 or 12 or 16 or 20 or 24"),
    ("response_surface.screening_runs", 8, None),
    ("response_surface.most_factors", 2, "at least 3 where surface is box_behnken"),
    ("response_surface.centres", 2, "at least 3 where surface is box_behnken"),
    ("sequential.seeds", 1, "at least 2: the noise comes from pours of one sample"),
    (
        "sequential.most_pours",
        15,
        "at least sequential.start_samples times sequential.seeds",
    ),
)


def test_a_strategy_that_cannot_run_with_its_section_is_refused(quick):
    def check_message(key, value, allowed):
        config = put(
            copy.deepcopy(quick.config) | {"strategy": key.partition(".")[0]},
            key,
            value,
        )
        if allowed is None:
            PipelineConfig.of(config)
        else:
            assert input_error(re.escape(allowed), PipelineConfig.of, config).key == key

    check_all(
        check_message,
        [(f"{key} {value}", key, value, allowed) for key, value, allowed in MISFITS],
    )


def test_a_study_may_do_without_compression_tests_and_published_solutions(config):
    config["berry"] |= {"compression": None, "poisson_ratio": 0.3}
    input_error(
        r"berry\.shear_modulus_pa is null; .* compression tests in berry\.compression",
        PipelineConfig.of,
        config,
    )
    config["berry"]["shear_modulus_pa"] = 4e4
    PipelineConfig.of(config).check_inputs()
    config["validation"]["published"] = None
    PipelineConfig.of(config).check_inputs()
    assert cost.describe_costs(config)["published_sets"].startswith("0 pours")


def test_inputs_are_checked_against_the_berry_and_the_disc(config):
    def check_message(key, value, allowed):
        changed = put(copy.deepcopy(config), key, value)
        assert (
            input_error(
                re.escape(allowed), PipelineConfig.of(changed, "my.yaml").check_inputs
            ).key
            == key
        )

    bad = (
        ("berry.sizes", "nowhere.csv", "an existing file"),
        ("validation.published", "nowhere.csv", "an existing file"),
        ("posterior.shape_study", "nowhere.csv", "an existing file"),
        ("photograph", "nowhere.jpg", "an existing file"),
        ("photograph", "resources", "an existing file"),
        ("simulation.time_step_s", 8e-4, "1/8 of the contact time"),
        ("simulation.time_step_s", 1e-3, "at most 0.000716"),
        ("funnel.outlet_diameter_mm", 9.0, "the size of a mean grain"),
        ("funnel.factory_diameter_mm", 20.0, "the size of a mean grain"),
    )
    check_all(
        check_message,
        [(f"{key} {value!r}", key, value, allowed) for key, value, allowed in bad],
    )


def test_the_named_tables_and_pictures_are_read_before_any_work(config):
    sizes = "resources/berries.csv"
    forces = "resources/compression.csv"
    for section, changed, message in (
        ("berry", {"sizes": forces}, r"compression\.csv: column long_mm is 'missing'"),
        (
            "validation",
            {"published": sizes},
            r"berries\.csv: column solution is 'missing'; expected columns solution",
        ),
        (
            "posterior",
            {"shape_study": sizes},
            r"berries\.csv: column particle is 'missing'",
        ),
        ("photograph", sizes, r"berries\.csv: picture is 'not a picture'"),
    ):
        changed = config[section] | changed if isinstance(changed, dict) else changed
        input_error(
            message, PipelineConfig.of(config | {section: changed}).check_inputs
        )


def test_resolved_configuration_is_rewritten_only_when_it_changed(config, tmp_path):
    path = tmp_path / "results" / "config.json"
    loader.write_resolved(config, path)
    assert PipelineConfig.load(path).config == config
    before = path.stat().st_mtime_ns
    loader.write_resolved(config, path)
    assert path.stat().st_mtime_ns == before
    config["label"] = "other"
    loader.write_resolved(config, path)
    assert PipelineConfig.load(path).config["label"] == "other"


@pytest.mark.usefixtures("short_search")
def test_a_study_and_a_configuration_can_be_handed_to_another_process():
    """As joblib, dask and multiprocessing do, also after their settings were made."""
    config = PipelineConfig.load(ROOT / "config/quick.yaml")
    label = config.settings.label
    study = Study({"mus": (0.1, 0.9), "mur": (0.01, 0.2)}, {"aor_deg": (30.0, 1.0)})
    assert pickle.loads(pickle.dumps(config)).settings.label == label
    for study_object in (study, config.study()):
        again = pickle.loads(pickle.dumps(study_object))
        assert again.ask().equals(study_object.ask())


def test_a_study_of_another_simulator_is_told_as_such_and_nothing_else_of_it():
    foreign = {"simulator": "EDEM", "parameters": {"mus": [0.1, 0.9]}}
    message = r"^own.yaml: simulator is 'EDEM'; expected a study without this section"
    input_error(message, PipelineConfig.of, foreign, "own.yaml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (r'sizes: "C:\Users\x.csv"', "line 1 is .*expected a path in single quotes"),
        ("small_run: \ttrue", "line 1 is .*; expected spaces in place of the tab"),
    ],
)
def test_a_path_in_double_quotes_and_a_tab_are_told_with_what_to_write(text, message):
    input_error(message, reading.parse_yaml, text, "a.yaml")


def test_a_parameter_that_begins_a_comment_is_refused():
    targets = {"aor_deg": (30.0, 1.0)}
    message = "parameters is '#f'; expected names that do not begin with #"
    input_error(message, Study, {"#f": (0.1, 0.9)}, targets)

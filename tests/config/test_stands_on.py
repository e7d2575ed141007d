"""What a stage reads of the configuration: a changed definition is none of a run's, and one of its measurement's."""

import copy

from shared import check_all

from repose.apparatus import bench, names
from repose.config import stands_on
from repose.config.models import named_files
from repose.config.study import Study


def check_used(check, config):
    check_all(check, [(name, config, name) for name in names() if name in config])


def test_a_run_stands_on_what_it_reads_in_any_order_and_not_on_its_measurement(config):
    def check(config, name):
        keys = [f"measure.{key}" for key in config["measure"]]
        keys += [f"{name}.{key}" for key in bench(name).measured_by]
        for dotted in keys:
            section, key = dotted.split(".")
            changed = copy.deepcopy(config)
            changed[section][key] = "another"
            assert stands_on.pouring(changed, name) == stands_on.pouring(config, name)
            assert stands_on.measuring(changed, name) != stands_on.measuring(config, name)
            assert stands_on.settings_of(changed, "next") != stands_on.settings_of(config, "next"), dotted

    check_used(check, config)

    def check(config, name):
        own = [(name, key) for key in config[name] if key not in ("seeds", *bench(name).measured_by)]
        shared = [(section, key) for section in ("wall", "simulation") for key in config[section]]
        for section, key in (*own, *shared, ("design", "seed")):
            changed = copy.deepcopy(config)
            changed[section][key] = "another"
            assert stands_on.pouring(changed, name) != stands_on.pouring(config, name), (section, key)

    check_used(check, config)

    def turned(value):
        return {key: turned(value[key]) for key in reversed(value)} if isinstance(value, dict) else value

    def check(config, name):
        other = turned(config)
        for what in (stands_on.pouring, stands_on.measuring):
            assert str(what(other, name)) == str(what(config, name))
        sections = [str(stands_on.sections(one, "berry", "miga")) for one in (config, other)]
        assert sections[0] == sections[1]

    check_used(check, config)


def test_keys_of_a_bench_test_define_what_its_targets_are():
    """No rule runs again for a key of a bench test without a target, so the files of before must stay good."""
    study = Study.load()
    assert "height_mm" in study.definitions
    assert "drum_slip_deg" not in study.definitions
    other = copy.deepcopy(study.config)
    other["cylinder"]["diameter_mm"] *= 2
    other["drum"]["fit_share"] /= 2
    assert Study.of(other).definitions == study.definitions
    other["targets"][1] |= {"response": "drum_slip_deg", "apparatus": "drum"}
    assert Study.of(other).definitions["drum_slip_deg"]["drum.fit_share"] == other["drum"]["fit_share"]


def test_results_do_not_depend_on_the_files_of_figures(config):
    for verb in ("material_card", "network", "report"):
        settings = stands_on.settings_of(config | {"figures": {"format": ["png", "pdf"]}}, verb)
        assert settings == stands_on.settings_of(config, verb)


def test_every_file_that_a_configuration_names_counts_by_its_content(config, tmp_path):

    def of(key, name, content):
        section, _, last = key.rpartition(".")
        path, changed = tmp_path / name, copy.deepcopy(config)
        path.write_text(content)
        (changed[section] if section else changed)[last] = str(path)
        return stands_on.settings_of(changed, "report")

    keys = named_files()
    assert {"photograph", "berry.sizes", "validation.published"} <= set(keys)
    for key in keys:
        assert of(key, "a", "one") == of(key, "b", "one") != of(key, "b", "two"), key

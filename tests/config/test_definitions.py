"""What a configuration says of its responses."""

import copy

from repose.config.study import Study

DRUM = {"response": "drum_slip_deg", "apparatus": "drum"}


def test_keys_of_a_bench_test_that_no_target_has_define_nothing():
    """No rule runs again for such a key, so the files of before must stay good."""
    study = Study.load()
    found = study.definitions
    assert "height_mm" in found
    assert "drum_slip_deg" not in found
    other = copy.deepcopy(study.config)
    other["cylinder"]["diameter_mm"] *= 2
    other["drum"]["fit_share"] /= 2
    assert Study.of(other).definitions == found


def test_keys_of_every_bench_test_with_a_target_do():
    config = Study.load().config
    target = config["targets"][0]
    config["targets"] = [target, target | DRUM]
    assert Study.of(config).definitions["drum_slip_deg"]["drum.fit_share"] == config["drum"]["fit_share"]

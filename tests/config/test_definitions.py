"""What a configuration says of its responses."""

import copy

from repose.config.definitions import definitions_of
from repose.config.study import Study

DRUM = {"response": "drum_slip_deg", "apparatus": "drum"}


def test_keys_of_a_bench_test_that_no_target_has_define_nothing():
    """No rule runs again for such a key, so the files of before must stay good."""
    config = Study.load().config
    found = definitions_of(config)
    assert "height_mm" in found
    assert "drum_slip_deg" not in found
    other = copy.deepcopy(config)
    other["cylinder"]["diameter_mm"] *= 2
    other["drum"]["fit_share"] /= 2
    assert definitions_of(other) == found


def test_keys_of_every_bench_test_with_a_target_do():
    config = Study.load().config
    target = config["targets"][0]
    config["targets"] = [target, target | DRUM]
    assert definitions_of(config)["drum_slip_deg"]["drum.fit_share"] == config["drum"]["fit_share"]

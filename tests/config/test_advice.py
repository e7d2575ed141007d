"""Advice before a study pours, against answers that are known."""

import copy
import math
from types import SimpleNamespace

import pytest

from repose.config import advice
from repose.config.study import Study
from repose.core import places

SPHERE = {"long_mm": 4.0, "major_mm": 4.0, "minor_mm": 4.0, "density_kg_m3": 1300.0, "poisson_ratio": 0.25}
GRAIN_M3 = math.pi / 6 * 4e-3**3


@pytest.fixture
def config():
    found = copy.deepcopy(Study.load(places.root() / "config/config.yaml").config)
    found["targets"] = [target("height_mm", 30.0), target("aor_deg", 30.0)]
    return found


def target(response, value):
    """A target of the funnel."""
    shared = {"sd": 1.0, "repetitions": 10, "range": [value - 1, value + 1], "apparatus": "funnel"}
    return {"response": response, "value": value} | shared


def column(modulus_pa, height_m, gravity, layers):
    """Share of its Height that a column of layers loses, added contact by contact."""
    d, young = 4e-3, modulus_pa / 0.75
    depths = [(k + 0.5) * height_m / layers for k in range(layers)]
    forces = [0.6 * 1300 * gravity * z * d**2 for z in depths]
    overlaps = [(3 * force / (4 * young * math.sqrt(d / 4))) ** (2 / 3) for force in forces]
    return sum(overlaps) / layers / d


def test_the_sinking_is_that_of_a_column_added_contact_by_contact(config):
    found = advice.softening(config, SPHERE | {"shear_modulus_pa": 1e6})
    assert found.sinking == pytest.approx(column(1e6, 0.03, 9.81, 2000), rel=1e-4)


def test_a_pile_of_the_softest_grain_sinks_by_what_is_allowed(config):
    softest = advice.softening(config, SPHERE | {"shear_modulus_pa": 7.7e7}).softest_pa
    assert softest < 7.7e7
    again = advice.softening(config, SPHERE | {"shear_modulus_pa": softest})
    assert again.sinking == pytest.approx(advice.LARGEST_SINKING)


def test_without_a_height_the_pile_is_the_cone_of_the_angle(config):
    config["targets"] = [target("aor_deg", 30.0)]
    height = advice.height_m(config, SPHERE)
    assert f"a cone of 30 deg and {1e3 * height:.3g} mm Height" in advice.filling(config, GRAIN_M3)[0]
    config["targets"] = [target("aor_deg", 45.0)]
    assert advice.height_m(config, SPHERE) == pytest.approx(height * 3 ** (1 / 3))


def test_grains_of_the_cones_volume_fill_it(config):
    cone = math.pi * 0.03**3 / (3 * math.tan(math.radians(30)) ** 2)
    config["funnel"]["berries"] = round(0.6 * cone / GRAIN_M3)
    assert advice.filling(config, GRAIN_M3)[1]
    for factor in (0.5, 2.0):
        config["funnel"]["berries"] = round(factor * 0.6 * cone / GRAIN_M3)
        sentence, fits = advice.filling(config, GRAIN_M3)
        assert not fits
        assert sentence.endswith(f"30 mm Height holds {1e6 * cone:.3g} ml")
        assert advice.needed_grains(config, GRAIN_M3) == math.ceil(0.6 * cone / GRAIN_M3)


def test_a_height_alone_asks_for_a_slope(config):
    config["targets"] = config["targets"][:1]
    slope = math.radians(25)
    config["funnel"]["berries"] = round(0.6 * math.pi * 0.03**3 / (3 * math.tan(slope) ** 2) / GRAIN_M3)
    sentence, fits = advice.filling(config, GRAIN_M3)
    assert fits
    assert "a slope of 25 deg" in sentence
    config["funnel"]["berries"] = 50
    sentence, fits = advice.filling(config, GRAIN_M3)
    assert not fits
    assert sentence.startswith("WARNING: 50 grains hold")
    assert sentence.endswith("; poured grains take 15 to 45 deg")


def test_an_angle_alone_gives_the_height_and_other_targets_nothing(config):
    config["targets"] = config["targets"][1:]
    assert "a cone of 30 deg" in advice.filling(config, GRAIN_M3)[0]
    config["targets"] = []
    assert advice.filling(config, GRAIN_M3)[1]


def test_sentences_tell_what_a_softer_grain_brings(config):
    berry = SPHERE | {"shear_modulus_pa": 7.7e7}
    softest = advice.softening(config, berry).softest_pa
    asked = []

    def longest_step_s(other):
        asked.append(other["shear_modulus_pa"])
        return 2.0 * config["simulation"]["time_step_s"]

    grain = SimpleNamespace(volume_m3=GRAIN_M3)
    stiffness, volume, grains, smaller, *_ = advice.of_funnel(config, berry, grain, longest_step_s)
    assert asked == [softest]
    assert stiffness.startswith("stiffness: the pile sinks by")
    assert stiffness.endswith("a run takes 0.5 of the time")
    assert volume.startswith("volume: ")
    assert grains.startswith("grains: the pile is 7.5 grains high.")
    assert f"of the time of {advice.needed_grains(config, GRAIN_M3)};" in smaller

"""Advice before a study pours, and what it needs, against answers that are known."""

import math
from types import SimpleNamespace

import pytest
import shared

from repose.config import advice, check, cost
from repose.config.models import make_settings
from repose.measure.definitions import PROPERTIES

SPHERE = {
    "long_mm": 4.0,
    "major_mm": 4.0,
    "minor_mm": 4.0,
    "density_kg_m3": 1300.0,
    "poisson_ratio": 0.25,
}
GRAIN_M3 = math.pi / 6 * 4e-3**3


def pours_of(config):
    settings = make_settings(config)
    return cost.list_strategy_runs(settings, settings.strategy)


@pytest.fixture
def config(config):
    return config | {"targets": [target("height_mm", 30.0), target("aor_deg", 30.0)]}


def target(response, value):
    return shared.target(response, value, 1.0, value - 1, value + 1)


def column(modulus_pa, height_m, gravity, layers):
    """Share of its Height that a column of layers loses, added contact by contact."""
    d = 4e-3
    young = modulus_pa / 0.75
    depths = [(k + 0.5) * height_m / layers for k in range(layers)]
    forces = [0.6 * 1300 * gravity * z * d**2 for z in depths]
    return (
        sum((3 * force / (4 * young * math.sqrt(d / 4))) ** (2 / 3) for force in forces)
        / layers
        / d
    )


def test_the_sinking_is_that_of_a_column_and_the_pile_the_cone_of_its_angle(config):
    found = advice.compute_softening(config, SPHERE | {"shear_modulus_pa": 1e6})
    assert found.sinking == pytest.approx(column(1e6, 0.03, 9.81, 2000), rel=1e-4)
    softest = advice.compute_softening(
        config, SPHERE | {"shear_modulus_pa": 7.7e7}
    ).softest_modulus_pa
    assert softest < 7.7e7
    again = advice.compute_softening(config, SPHERE | {"shear_modulus_pa": softest})
    assert again.sinking == pytest.approx(advice.MAX_SINKING)
    config["targets"] = [target("aor_deg", 30.0)]
    height = advice.estimate_pile_height_m(config, SPHERE)
    assert (
        f"a cone of 30 deg and {1e3 * height:.3g} mm Height"
        in advice.compare_volumes(config, GRAIN_M3)[0]
    )
    config["targets"] = [target("aor_deg", 45.0)]
    assert advice.estimate_pile_height_m(config, SPHERE) == pytest.approx(
        height * 3 ** (1 / 3)
    )
    config["targets"] = []
    assert advice.compare_volumes(config, GRAIN_M3)[1]


def test_grains_of_the_cones_volume_fill_it(config):
    cone = math.pi * 0.03**3 / (3 * math.tan(math.radians(30)) ** 2)
    config["funnel"]["berries"] = round(0.6 * cone / GRAIN_M3)
    assert advice.compare_volumes(config, GRAIN_M3)[1]
    config["measure"]["response"] = "whole"
    for factor in (0.5, 2.0):
        config["funnel"]["berries"] = round(factor * 0.6 * cone / GRAIN_M3)
        sentence, fits = advice.compare_volumes(config, GRAIN_M3)
        assert not fits
        assert sentence.startswith("WARNING: ")
        assert sentence.endswith(
            f"30 mm Height holds {1e6 * cone:.3g} ml, {1 / factor:.2g} times as much; "
            "count the grains, and check the scale of the photographs"
        )
        expected = math.ceil(0.6 * cone / GRAIN_M3)
        assert advice.count_needed_grains(config, GRAIN_M3) == expected


def test_the_cone_of_a_part_of_the_side_is_smaller_than_the_pile(config):
    """A line along the steep part of a side gives a steeper cone than the whole pile."""
    cone = math.pi * 0.03**3 / (3 * math.tan(math.radians(30)) ** 2)
    config["measure"]["response"] = "flank"
    for factor, fits in ((0.5, False), (2.0, True), (3.0, False)):
        config["funnel"]["berries"] = round(factor * 0.6 * cone / GRAIN_M3)
        assert advice.compare_volumes(config, GRAIN_M3).fits is fits


@pytest.mark.parametrize("name", PROPERTIES)
def test_the_factor_of_a_part_of_the_side_is_that_of_the_lines_along_a_part(
    name, config
):
    cone = math.pi * 0.03**3 / (3 * math.tan(math.radians(30)) ** 2)
    config["measure"]["response"] = name
    config["funnel"]["berries"] = round(2.0 * 0.6 * cone / GRAIN_M3)
    follows_a_part = not PROPERTIES[name].follows_whole_side
    assert advice.compare_volumes(config, GRAIN_M3).fits is follows_a_part


def test_a_height_alone_asks_for_a_slope(config):
    config["targets"] = config["targets"][:1]
    config["funnel"]["berries"] = round(
        0.6 * math.pi * 0.03**3 / (3 * math.tan(math.radians(25)) ** 2) / GRAIN_M3
    )
    sentence, fits = advice.compare_volumes(config, GRAIN_M3)
    assert fits
    assert "a slope of 25 deg" in sentence
    config["funnel"]["berries"] = 50
    sentence, fits = advice.compare_volumes(config, GRAIN_M3)
    assert not fits
    assert sentence.startswith("WARNING: 50 poured grains fill")
    assert sentence.endswith("; slopes of poured grains are 15 to 45 deg")


def test_sentences_tell_what_a_softer_grain_brings(config):
    berry = SPHERE | {"shear_modulus_pa": 7.7e7}
    softest = advice.compute_softening(config, berry).softest_modulus_pa
    moduli = []

    def longest_step_s(other):
        moduli.append(other["shear_modulus_pa"])
        return 2.0 * config["simulation"]["time_step_s"]

    grain = SimpleNamespace(volume_m3=GRAIN_M3)
    stiffness, volume, grains, smaller, *_ = advice.give_funnel_advice(
        config, berry, grain, longest_step_s
    )
    assert moduli == [softest]
    sinking = 100 * advice.compute_softening(config, berry)[0]
    assert stiffness.startswith(
        f"stiffness: the pile sinks by {sinking:.2g} % of its Height"
    )
    assert stiffness.endswith("a run takes 50 % of the time")
    assert volume.startswith("volume: ")
    n_needed = advice.count_needed_grains(config, GRAIN_M3)
    assert grains.startswith(
        f"grains: {n_needed} would fill the target pile, which is 7.5 grains high; "
    )
    assert f"of the time of {advice.count_needed_grains(config, GRAIN_M3)};" in smaller


def test_grains_softer_than_real_ones_are_doubted(config):
    """Forces in kgf that are read in N make the modulus 9.8 times too small."""
    softening = advice.compute_softening(config, SPHERE | {"shear_modulus_pa": 1.0})
    # Hertz's law: the modulus with which the pile sinks by 3 % and by 6 %
    for sinking, doubted in ((0.03, False), (0.06, True)):
        modulus_pa = (softening.sinking / sinking) ** advice.MODULUS_EXPONENT
        berry = SPHERE | {"shear_modulus_pa": modulus_pa}
        sentence = advice._describe_stiffness(config, berry, lambda grain: 1.0)
        assert sentence.startswith("WARNING") is doubted
        assert f"sinks by {100 * sinking:.2g} %" in sentence


def test_each_strategy_has_its_own_pours(config):
    config["response_surface"] |= {
        "screening_runs": 12,
        "steps": 5,
        "most_factors": 3,
        "centres": 5,
        "checks": 8,
        "surface": "box_behnken",
        "seeds": 3,
    }
    assert pours_of(config) is None
    config["strategy"] = "response_surface"
    pours = pours_of(config)
    # 12 runs and 5 centres; 12 edges of the cube and 5 centres
    assert pours == (
        ("screening", 17, 3),
        ("ascent", 6, 3),
        ("surface", 17, 3),
        ("check", 8, 3),
    )
    work = cost.estimate_work(config, 1e-7, pours)
    expected = 48 * cost.JOB_START_S + 144 * work.funnel_run_s
    assert work.total_s == pytest.approx(expected)
    config["strategy"] = "sequential"
    config["sequential"] |= {"most_pours": 120, "seeds": 3}
    assert pours_of(config) == (("at most", 40, 3), ("check", 1, 16))
    del config["drum"]
    config["design"]["samples"] = 30
    config["funnel"]["seeds"] = 4
    config["validation"] |= {
        "published": None,
        "solutions": 1,
        "seeds": 8,
        "representative_seeds": 16,
    }
    work = cost.estimate_work(config, 1e-7)
    expected = cost.OTHER_WORK_S + 32 * cost.JOB_START_S + 144 * work.funnel_run_s
    assert work.total_s == pytest.approx(expected)


def test_the_longest_job_is_that_of_the_slowest_bench_test(config):
    config["refine"]["seeds"] = 100
    slowest = max(cost.estimate_run_s(config, name) for name in ("funnel", "drum"))
    assert cost.estimate_longest_job_s(config) == pytest.approx(
        cost.JOB_START_S + 100 * slowest
    )
    config["validation"]["representative_seeds"] = 200
    assert cost.estimate_longest_job_s(config) == pytest.approx(
        cost.JOB_START_S + 200 * slowest
    )
    config["funnel"] |= {"berries": 100, "rate_per_s": 10.0, "duration_s": 10.0}
    config["simulation"]["time_step_s"] = 1e-4
    assert cost.estimate_run_s(config, "funnel", 1e-7) == pytest.approx(
        100 * 5.0 / 1e-4 * 1e-7
    )
    expected = 3 * cost.estimate_run_s(config, "funnel", 1e-7)
    assert cost.estimate_run_s(config, "funnel", 3e-7) == pytest.approx(expected)


def test_time_goes_with_the_steps_and_the_bench_tests(config):
    config["simulation"]["time_step_s"] = 2.5e-4
    work = cost.estimate_work(config)
    solutions = (("answer", 1, 64), ("other solutions", 5, 12))
    assert work.runs == (("design", 150, 6), *solutions)
    config["simulation"]["time_step_s"] /= 2
    # seven sets
    assert cost.describe_costs(config)["published_sets"].startswith("84 pours")
    assert cost.estimate_work(config).total_s > 1.65 * work.total_s
    config["simulation"]["time_step_s"] *= 2
    config["targets"].append(shared.target("drum_slip_deg", 40, 1, 35, 45))
    runs = (150 + 1 + 5) * config["drum"]["seeds"]
    expected_s = work.total_s + runs * cost.estimate_run_s(config, "drum")
    assert cost.estimate_work(config).total_s > expected_s


@pytest.mark.parametrize(
    ("volume_m3", "mesh_volume_m3", "is_coarse"),
    [
        (1.049e-6, 1e-6, False),
        (1.051e-6, 1e-6, True),
        (0.951e-6, 1e-6, False),
        (0.949e-6, 1e-6, True),
        (1.2e-6, None, False),
    ],
)
def test_a_particle_is_coarse_if_its_volume_is_5_percent_off_that_of_its_mesh(
    volume_m3, mesh_volume_m3, is_coarse
):
    particle = SimpleNamespace(volume_m3=volume_m3, mesh_volume_m3=mesh_volume_m3)
    assert check.is_coarse(particle) is is_coarse

"""How many grains a pile needs, by the table of piles of the engine's own."""

import pandas as pd
import pytest
import yaml
from shared import run_python, written

from repose.bench import funnel, scene_size
from repose.config.check import describe_study
from repose.config.pipeline import PipelineConfig

SEEDS = 1.8, 1.6, 1.5  # mm


def with_grains(config, grains, response="secant"):
    measure = config["measure"] | {"response": response}
    return {
        **config,
        "funnel": config["funnel"] | {"berries": grains},
        "measure": measure,
    }


def test_a_change_is_that_of_the_table():
    table = pd.read_csv(scene_size.TABLE_CSV).set_index(["grains", "label"])
    for name in ("whole", "secant"):
        found = scene_size.interpolate_change(500, 125, name)
        column = table[f"aor_{name}_deg"]
        assert found.angle_deg == pytest.approx((column[125] - column[500]).mean())
        expected = -found.angle_deg
        assert scene_size.interpolate_change(125, 500, name).angle_deg == pytest.approx(
            expected
        )
    heights = table["height_scaled_mm"]
    assert found.height == pytest.approx((heights[125] / heights[500]).mean())
    assert scene_size.interpolate_change(300, 300, "flank") == (0.0, 1.0)


def test_the_fewest_grains_change_an_angle_by_less_than_a_degree():
    for name in ("whole", "flank", "secant", "steepest"):
        found = scene_size.find_fewest_grains(1000, name)
        between = [
            n
            for n in scene_size.list_tabulated_numbers()
            if found is not None and found <= n < 1000
        ]
        assert all(
            abs(scene_size.interpolate_change(1000, n, name).angle_deg) <= 1
            for n in between
        )
        below = [n for n in scene_size.list_tabulated_numbers() if n < (found or 1000)]
        assert (
            not below
            or abs(scene_size.interpolate_change(1000, max(below), name).angle_deg) > 1
        )


def test_a_scaled_scene_keeps_its_proportions(config):
    section = funnel.FunnelSettings(**config["funnel"])
    smaller = scene_size.scale_funnel(section, 4, 13.34)
    expected = config["funnel"]["plate_diameter_mm"] / 5
    assert smaller["plate_diameter_mm"] == pytest.approx(expected)
    # a fifth would be narrower than the outlet
    assert smaller["inlet_diameter_mm"] == 2 * smaller["outlet_diameter_mm"]
    expected = config["funnel"]["rate_per_s"] * 5**-2.5
    assert smaller["rate_per_s"] == pytest.approx(expected)
    expected = min(config["funnel"]["outlet_diameter_mm"], 2.4 * 13.34)
    assert smaller["outlet_diameter_mm"] == pytest.approx(expected)
    expected = config["funnel"] | dict.fromkeys(scene_size.COMPUTED_KEYS, "auto")
    assert (
        scene_size.scale_funnel(section, config["funnel"]["berries"], 13.34) == expected
    )


def test_a_large_scene_gets_a_smaller_one_inside_the_table(config):
    small = list(scene_size.advise(with_grains(config, 500), 13.34, 65.0))
    assert len(small) == 1
    assert small[0].startswith("grains: the pile is 4.9 grains high.")
    assert (
        f"From {scene_size.find_fewest_grains(500, 'secant')} grains on the angle is within 1 deg of "
        "that of 500." in small[0]
    )
    flank = next(scene_size.advise(with_grains(config, 500, "flank"), 13.34, 65.0))
    assert (
        "No smaller number of grains is within 1 deg of that of 500; the secant angle is "
        f"from {scene_size.find_fewest_grains(500, 'secant')} on." in flank
    )
    half = scene_size.interpolate_change(500, 250, "flank")
    assert (
        "Scale effect: 250 grains instead of 500 would lower the flank angle by "
        f"{-half.angle_deg:.1f} deg" in flank
    )
    _, _, pasted, targets = scene_size.advise(with_grains(config, 1000), 13.34, 65.0)
    keys = yaml.safe_load(pasted)["funnel"]
    assert keys["berries"] == scene_size.find_fewest_grains(1000, "secant")
    before = config["targets"][-1]
    after = yaml.safe_load(targets)["targets"][-1]
    assert before["response"] == after["response"] == "height_mm"
    length = (keys["berries"] / 1000) ** (1 / 3)
    share = (
        length * scene_size.interpolate_change(1000, keys["berries"], "secant").height
    )
    assert after["value"] / before["value"] == pytest.approx(share, rel=1e-3)
    expected = config["funnel"]["inlet_diameter_mm"] * length
    assert keys["inlet_diameter_mm"] == pytest.approx(expected, rel=1e-3)
    PipelineConfig.of({**config, "funnel": config["funnel"] | keys})
    _, smaller, *_ = scene_size.advise(
        config, 13.34, 65.0, 25 * max(scene_size.list_tabulated_numbers())
    )
    assert "have not been compared" in smaller


@pytest.fixture
def seeds(tmp_path):
    """A study of seeds of 1.6 mm whose targets, 30 degrees and 60 mm, need 179,000 of them."""
    sizes = "\n".join(
        ",".join(f"{size * axis:.4f}" for axis in SEEDS) for size in (0.95, 1.0, 1.05)
    )
    (tmp_path / "sizes.csv").write_text(f"long_mm,major_mm,minor_mm\n{sizes}\n")
    shape = {"poisson_ratio": 0.3, "shear_modulus_pa": 2e6}
    scene = {
        "berries": 20000,
        "rate_per_s": 8000.0,
        "inlet_diameter_mm": 150.0,
        "outlet_diameter_mm": 15.0,
        "cone_angle_deg": 60.0,
        "outlet_height_mm": 100.0,
        "plate_diameter_mm": 400.0,
        "rim_radius_mm": 10.0,
        "duration_s": 20.0,
    }
    values = {"aor_deg": 30.0, "height_mm": 60.0}
    targets = [
        {"response": name, "value": mean, "sd": 0.02 * mean, "repetitions": 5}
        for name, mean in values.items()
    ]
    parameters = {"mus_gg": [0.2, 0.9], "mur_gg": [0.005, 0.1]}
    parameters |= {
        name: {"fixed": 0.5} for name in ("e_gg", "mus_gp", "mur_gp", "e_gp")
    }
    return {
        "label": "seeds",
        "berry": {"sizes": str(tmp_path / "sizes.csv"), "density_kg_m3": 1150.0}
        | shape,
        "wall": shape,
        "parameters": parameters,
        "funnel": scene,
        "targets": targets,
        "design": {"samples": 30},
        "surrogate": "gaussian_process",
        "validation": {"solutions": 1, "representative_seeds": 8, "seeds": 4},
        "results_dir": str(tmp_path / "results"),
    }


def lines_of(study, path):
    return list(
        describe_study(
            PipelineConfig.load(written(path, yaml.safe_dump(study)), check_inputs=True)
        )
    )


@pytest.mark.parametrize("response", ["flank", "secant"])
def test_fine_seeds_get_a_smaller_scene_that_the_check_calls_good(
    seeds, tmp_path, response
):
    seeds["measure"] = {"response": response}
    *messages, scene, targets = lines_of(seeds, tmp_path / "config.yaml")
    assert "smaller scene: 1000 grains" in messages[-1] or "time of 179" in messages[-1]
    assert "Pour such a pile by hand" in messages[-1]
    pasted = yaml.safe_load(f"{scene}\n{targets}")
    assert 62 <= pasted["funnel"]["berries"] <= 1000
    again = lines_of(
        seeds | {"targets": pasted["targets"], "funnel": pasted["funnel"]},
        tmp_path / "smaller.yaml",
    )
    assert [line for line in again if "WARNING" in line] == []


def test_more_grains_than_a_study_takes_are_refused_with_a_smaller_scene(
    seeds, tmp_path, command
):
    seeds["funnel"]["berries"] = 250_000
    path = written(tmp_path / "config.yaml", yaml.safe_dump(seeds))
    for verb in ("check", "plan"):
        out, error = command(verb, "--config", path, status=2)
        assert "funnel.berries is 250000" in error
        assert "smaller scene: 1000 grains take" in out
        assert yaml.safe_load(
            next(line for line in out.splitlines() if line.startswith("funnel: {"))
        )


def test_a_pile_that_reaches_the_outlet_is_told(seeds, tmp_path):
    seeds["funnel"]["outlet_height_mm"] = 55.0
    messages = lines_of(seeds, tmp_path / "config.yaml")
    assert any(
        "a pile of 60 mm reaches the outlet at 55 mm" in line for line in messages
    )


def test_a_process_that_pours_and_measures_does_not_wait_for_what_it_does_not_use():
    used = "repose.cli, repose.stages.job, repose.config.pipeline, repose.config.dependencies, repose.measure.pile"
    slow = {
        "pandas",
        "scipy.spatial",
        "scipy.sparse",
        "scipy.stats",
        "yaml",
        "matplotlib",
        "repose.calibrate.surrogates.kinds",
    }
    assert (
        run_python("-c", f"import sys, {used}; print(*({slow} & set(sys.modules)))")
        == "\n"
    )

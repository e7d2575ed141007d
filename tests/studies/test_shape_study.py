import copy
import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shared

from repose.apparatus import factory
from repose.config import loader
from repose.core.errors import InputError
from repose.core.targets import Targets
from repose.dem.rotations import random_quaternion, rotation_matrices
from repose.measure.angles import DEFINITIONS, MEAN_KEYS
from repose.studies import shape_study, shape_tables

ROOT = Path(__file__).parents[2]
PUBLISHED_PAIR = ["aor_simulated_deg", "height_simulated_mm"]
ANGLE, HEIGHT = shared.TARGETS
TARGETS = Targets.of([ANGLE, HEIGHT])


@pytest.fixture
def config(monkeypatch):
    monkeypatch.chdir(ROOT)
    config = copy.deepcopy(loader.load("config/quick.yaml"))
    config["shape_study"]["particles"] = {"egg": {"particle": "smooth"}, "clump": {"particle": "multisphere"}}
    config["shape_study"]["fillings"] = {"here": {}, "there": {"cone_angle_deg": 70.0}}
    config["shape_study"] |= {
        "sensitivity_particle": "egg",
        "sensitivity_filling": "there",
        "design_fillings": ["here"],
    }
    return config


def write_cell(folder, kind, particle, filling, rows, mass_g=1.25, axes_mm=(21.0, 11.0, 10.0)):
    """A cell's two files; rows: (set, seed, secant angle or None, Height)."""
    path = folder / f"{kind}-{particle}-{filling}.csv"
    records = [
        {
            "kind": kind,
            "particle": particle,
            "filling": filling,
            "set": name,
            "seed": seed,
            "height_mm": height,
        }
        | dict.fromkeys(MEAN_KEYS.values(), 10.0)
        | {"aor_secant_deg": angle, "status": "ok" if angle is not None else "no_flank"}
        for name, seed, angle, height in rows
    ]
    pd.DataFrame(records).to_csv(path, index=False)
    about = {"particle": particle, "axes_mm": axes_mm, "mass_g": mass_g, "volume_mm3": 1487.0}
    path.with_suffix(".json").write_text(json.dumps(about | {"measured_axes_mm": [21.0, 11.0, 10.0]}))
    return path


def a_design(rng, signal, noise, sets=60, seeds=4):
    means = 30 + signal * rng.normal(size=sets)
    return [
        (k, seed, means[k] + noise * rng.normal(), 60 + noise * rng.normal())
        for k in range(sets)
        for seed in range(seeds)
    ]


def test_cells_are_every_combination_the_sensitivities_and_a_design_for_each_particle(config):
    names = shape_study.cells(config)
    assert names[:4] == [
        "published-egg-here",
        "published-egg-there",
        "published-clump-here",
        "published-clump-there",
    ]
    assert names[4:] == [
        "sensitivity-egg-outlet_150_mm",
        "sensitivity-egg-rate_60_per_s",
        "sensitivity-egg-plate_250_mm",
        "sensitivity-egg-tube_20_mm",
        "design-egg-here",
        "design-clump-here",
    ]


def test_a_cell_changes_the_sections_it_names_and_nothing_else(config):
    kind, particle, filling, own = shape_study.cell_settings(config, "published-clump-there")
    assert (kind, particle, filling) == ("published", "clump", "there")
    assert own["berry"] == config["berry"] | {"particle": "multisphere"}
    assert own["funnel"] == config["funnel"] | {"cone_angle_deg": 70.0}
    assert {k: v for k, v in own.items() if k not in ("berry", "funnel")} == {
        k: v for k, v in config.items() if k not in ("berry", "funnel")
    }


def test_a_sensitivity_changes_its_filling(config):
    *_, own = shape_study.cell_settings(config, "sensitivity-egg-outlet_150_mm")
    assert own["funnel"] == config["funnel"] | {"cone_angle_deg": 70.0, "outlet_height_mm": 150.0}


@pytest.mark.parametrize(
    ("section", "changes", "key"),
    [
        ("particles", {"particle": "cube"}, "berry.particle"),
        ("fillings", {"cone_angle": 70.0}, "funnel"),
        ("sensitivities", {"rate_per_s": -1.0}, "funnel.rate_per_s"),
    ],
)
def test_a_variant_that_is_no_configuration_is_refused_by_name(config, section, changes, key):
    config["shape_study"][section]["odd"] = changes
    with pytest.raises(InputError) as caught:
        shape_study.check(config, "my.yaml")
    assert caught.value.source == f"my.yaml, shape_study.{section}.odd"
    assert caught.value.key.startswith(key)


def test_a_sensitivity_of_an_unknown_particle_and_an_unknown_cell_are_refused(config):
    with pytest.raises(InputError, match="--cell"):
        shape_study.cell_settings(config, "published-egg")
    config["shape_study"]["sensitivity_particle"] = "brick"
    with pytest.raises(InputError, match="sensitivity_particle is 'brick'; allowed: one of egg, clump"):
        shape_study.check(config)


def test_published_sets_end_with_the_representative_that_stands_for_the_physical_pile(config):
    table = shape_study.published_sets(config)
    assert table["set"].tolist() == ["22", "15", "56", "84", "2", "representative"]
    assert table.iloc[-1][PUBLISHED_PAIR].tolist() == [32.87, 65.57]
    assert table.iloc[0][PUBLISHED_PAIR].tolist() == [32.00, 65.63]


def test_the_choice_is_the_nearest_measured_berry_with_enough_signal(config, tmp_path):
    rng = np.random.default_rng(3)
    published = shape_study.published_sets(config).set_index("set")

    def piles(angle_off, height_off):
        pairs = published[PUBLISHED_PAIR]
        return [
            (name, seed, aor + angle_off + error, height + height_off - error)
            for name, (aor, height) in pairs.iterrows()
            for seed, error in enumerate((-0.5, 0.5, -0.5, 0.5))
        ]

    # nearest of all, but of another mass; then the egg in two fillings
    files = [
        write_cell(tmp_path, "published", "clump", "here", piles(0.0, 0.0), mass_g=1.05),
        write_cell(tmp_path, "published", "egg", "here", piles(2.20, 4.10)),
        write_cell(tmp_path, "published", "egg", "there", piles(1.10, 0.0)),
        write_cell(tmp_path, "design", "egg", "here", a_design(rng, 2.0, 1.0)),
    ]
    found = shape_study.run_tables(config, files, tmp_path / "out")
    assert (found["choice"]["particle"], found["choice"]["filling"]) == ("egg", "there")
    assert found["choice"]["definition"] == "secant"
    rows = found["combinations"].query("definition == 'secant'").set_index(["particle", "filling"])
    assert rows.at[("egg", "here"), "distance"] == pytest.approx(math.sqrt(2))
    assert rows.at[("egg", "there"), "distance"] == pytest.approx(0.5)
    assert rows.at[("clump", "here"), "distance"] == pytest.approx(0.0, abs=1e-12)
    assert not rows.at[("clump", "here"), "eligible"]
    # four seeds of +-0.5: sd sqrt(1/3), and six independent sets
    assert rows.at[("egg", "here"), "aor_se_deg"] == pytest.approx(math.sqrt(1 / 3) / 2 / math.sqrt(6))
    assert rows.at[("egg", "there"), "sets_within"] == 6
    assert json.loads((tmp_path / "out" / "choice.json").read_text())["filling"] == "there"


def test_nothing_is_chosen_where_the_signal_is_lost_in_noise(config, tmp_path):
    rng = np.random.default_rng(4)
    piles = [
        (name, seed, 32.0, 65.0) for name in shape_study.published_sets(config)["set"] for seed in range(3)
    ]
    files = [
        write_cell(tmp_path, "published", "egg", "here", piles),
        write_cell(tmp_path, "design", "egg", "here", a_design(rng, 0.7, 1.0)),
    ]
    found = shape_study.run_tables(config, files, tmp_path / "out")
    assert found["choice"] is None
    assert json.loads((tmp_path / "out" / "choice.json").read_text()) is None


@pytest.mark.parametrize(("signal", "noise"), [(2.0, 1.0), (1.0, 2.0)])
def test_signal_and_noise_of_a_known_model(signal, noise):
    rng = np.random.default_rng(5)
    rows = a_design(rng, signal, noise, sets=400, seeds=3)
    runs = pd.DataFrame(rows, columns=["set", "seed", "aor_secant_deg", "height_mm"])
    runs = runs.assign(
        particle="egg", filling="here", **{key: 1.0 for key in MEAN_KEYS.values() if key != "aor_secant_deg"}
    )
    table = shape_tables.noise_table(runs, TARGETS).set_index("response")
    found = table.loc["secant"]
    assert found["noise"] == pytest.approx(noise, rel=0.06)
    assert found["signal_to_noise"] == pytest.approx(signal / noise, abs=4 * found["standard_error"])
    assert 0 < found["standard_error"] < 0.15 * max(1.0, signal / noise)
    assert table.loc["height", "signal"] < 0.5 * noise


def fourth(name, value):
    return ANGLE | {"response": name, "value": value, "range": [value - 1, value + 1]}


def test_a_single_target_is_compared_alone(config):
    config["targets"] = [HEIGHT]
    assert [one.name for one in shape_study.compared_targets(config)] == ["height_mm"]
    assert shape_study.published_sets(config).columns[-1] == "height_simulated_mm"


def test_targets_that_nobody_published_are_left_out(config):
    config["targets"] = [ANGLE, fourth("packing_percent", 60.0), HEIGHT]
    config["targets"] += [fourth("drum_slip_deg", 45.0) | {"apparatus": "drum"}]
    assert [one.name for one in shape_study.compared_targets(config)] == ["aor_deg", "height_mm"]
    config["targets"] = config["targets"][1:2]
    with pytest.raises(InputError, match="some target's predicted and simulated values"):
        shape_study.compared_targets(config)


def test_a_study_without_published_solutions_is_refused(config):
    config["validation"]["published"] = None
    with pytest.raises(InputError, match=r"validation\.published"):
        shape_study.published_sets(config)


@pytest.mark.parametrize("names", [["height_mm"], ["aor_deg", "height_mm", "packing_percent", "upper_deg"]])
def test_tables_for_one_target_and_for_four(names):
    """Every pile is off by a standard deviation and a half unit in each target."""
    section = {"aor_deg": ANGLE, "height_mm": HEIGHT}
    targets = Targets.of([section.get(name) or fourth(name, 50.0) for name in names])
    published = pd.DataFrame({"set": ["a", "b"]} | {one.response.simulated: one.value for one in targets})
    rows = []
    for kind, noise in (("published", 0.1), ("design", 1.0)):
        for name, seed in ((name, seed) for name in "abcd" for seed in range(4)):
            if kind == "published" and name in "cd":
                continue
            row = {
                "kind": kind,
                "particle": "egg",
                "filling": "here",
                "set": name,
                "seed": seed,
                "status": "ok",
            }
            row |= dict.fromkeys(MEAN_KEYS.values(), 30.0)
            for one in targets:
                shift = 5 * "abcd".index(name) if kind == "design" else 0
                value = one.value + one.sd + shift + noise * (seed - 1.5) + 0.5 * (kind == "published")
                row |= {column: value for column in {shape_tables.measured_as(one, d) for d in DEFINITIONS}}
            rows.append(row)
    about = {"particle": "egg", "axes_mm": [21, 11, 10], "measured_axes_mm": [21, 11, 10]}
    about |= {"mass_g": 1.25, "volume_mm3": 1487.0}
    runs = pd.DataFrame(rows)
    assert set(shape_tables.run_columns(targets)) <= set(runs.columns)
    tables, choice = shape_tables.tables_of(runs, [about], published, targets, 1.25)
    distance = math.sqrt(sum(((one.sd + 0.5) / one.sd) ** 2 for one in targets))
    assert tables["combinations"]["distance"].tolist() == pytest.approx([distance] * 4)
    assert (
        tables["sets"][f"{names[0].rsplit('_', 1)[0]}_difference_{names[0].rsplit('_', 1)[1]}"].notna().all()
    )
    others = {one.response.quantity for one in targets if one.name != "aor_deg"}
    assert set(tables["noise"]["response"]) == others | set(DEFINITIONS)
    assert choice["sets_within"] == 0  # each pile is a tenth of a unit beyond one standard deviation, or more
    assert choice["signal_to_noise"] > 3


@pytest.mark.parametrize(("orientation", "level"), [("lying", 0.0), ("upright", 1.0)])
def test_new_berries_lie_or_stand_as_told(orientation, level):
    rng = np.random.default_rng(6)
    quaternions = np.array([factory.random_orientation(orientation, rng) for _ in range(300)])
    assert np.allclose(np.linalg.norm(quaternions, axis=1), 1.0)
    turned = rotation_matrices(quaternions)
    assert np.allclose(np.abs(turned[:, 2, 0]), level, atol=1e-12)
    # what is left free is uniform: no direction is preferred
    other = turned[:, :2, 0] if orientation == "lying" else turned[:, :2, 1]
    assert np.all(np.abs(other.mean(axis=0)) < 4 * math.sqrt(0.5 / 300))
    about = turned[:, 2, 1]
    assert np.var(about) == pytest.approx(0.5 * (1 - level), abs=0.1)


def test_random_berries_draw_as_they_always_did():
    one, two = np.random.default_rng(7), np.random.default_rng(7)
    assert np.array_equal(factory.random_orientation("random", one), random_quaternion(two))

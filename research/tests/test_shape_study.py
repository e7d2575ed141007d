import copy
import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import shared
from refusals import input_error

from repose.bench.bench_test import Run
from repose.calibrate.seeds import draw_run_seeds
from repose.calibrate.targets import Targets
from repose.common import attached, provenance
from repose.common.errors import InputError
from repose.common.files import write_json, write_table
from repose.config.pipeline import PipelineConfig
from research import settings
from research.shape import (
    shape_cells,
    shape_piles,
    shape_rule,
    shape_study,
    shape_tables,
)
from research.shape.__main__ import depends_on, script
from research.streams import STREAMS

ROOT = Path(__file__).parents[2]
PUBLISHED_PAIR = ["aor_simulated_deg", "height_simulated_mm"]
ANGLE, HEIGHT = shared.TARGETS
TARGETS = Targets.of([ANGLE, HEIGHT])


@pytest.fixture(scope="module")
def quick():
    config = PipelineConfig.load(ROOT / "config/quick.yaml").config
    return config | settings.read_settings(config)


@pytest.fixture(scope="module")
def small_study(quick):
    return config_of(quick)


@pytest.fixture
def config(quick, monkeypatch):
    monkeypatch.chdir(ROOT)
    return config_of(quick)


def config_of(quick):
    """The configuration of a shape study of few cells."""
    config = copy.deepcopy(quick)
    config["shape_study"] |= {
        "particles": {
            "egg": {"particle": "smooth"},
            "clump": {"particle": "multisphere"},
        },
        "tensions": ["keep", "release"],
        "fillings": {"here": {}, "there": {"cone_angle_deg": 70.0}},
        "main_fillings": ["here"],
        "all_fillings_of": ["egg"],
        "reference": "clump-keep-here",
    }
    return config


def test_first_cells_are_the_combinations_and_a_cylinder_for_each_particle_and_tension(
    config,
):
    assert shape_cells.first_cells(config) == [
        "published-egg-keep-here",
        "published-egg-keep-there",
        "published-egg-release-here",
        "published-egg-release-there",
        "published-clump-keep-here",
        "published-clump-release-here",
        "bulk-egg-keep-cylinder",
        "bulk-clump-keep-cylinder",
    ]


def test_second_cells_are_the_finalists_the_reference_and_sensitivities_of_the_first(
    config,
):
    rows = [
        ("egg", "keep", "there"),
        ("egg", "keep", "there"),
        ("clump", "keep", "here"),
    ]
    finalists = pd.DataFrame(rows, columns=shape_rule.CELL)
    names = shape_cells.second_cells(config, finalists)
    assert names == [
        "fresh-egg-keep-there",
        "fresh-clump-keep-here",
        "design-egg-keep-there",
        "design-clump-keep-here",
        "outlet_150_mm-egg-keep-there",
    ]
    for name in (*names, *shape_cells.first_cells(config)):
        shape_cells.cell_settings(config, name)


def test_a_cell_changes_the_sections_it_names_and_nothing_else(config):
    kind, names, cell_config = shape_cells.cell_settings(
        config, "published-clump-release-there"
    )
    assert kind == "published"
    assert names == {"particle": "clump", "tension": "release", "filling": "there"}
    assert cell_config["berry"] == config["berry"] | {"particle": "multisphere"}
    assert cell_config["funnel"] == config["funnel"] | {"cone_angle_deg": 70.0}
    assert cell_config["simulation"] == config["simulation"] | {"tension": "release"}
    changed = ("berry", "funnel", "simulation")
    expected = {k: v for k, v in config.items() if k not in changed}
    assert {k: v for k, v in cell_config.items() if k not in changed} == expected


def test_a_sensitivity_changes_its_filling(config):
    *_, cell_config = shape_cells.cell_settings(config, "outlet_150_mm-egg-keep-there")
    expected = config["funnel"] | {
        "cone_angle_deg": 70.0,
        "outlet_height_mm": 150.0,
    }
    assert cell_config["funnel"] == expected


def test_a_cell_depends_on_its_own_bench_test(config):
    bulk = shape_cells.dependencies(config, "bulk-egg-keep-cylinder")
    assert "cylinder" in bulk
    assert "funnel" not in bulk
    design = shape_cells.dependencies(config, "design-egg-keep-here")
    assert design["design_samples"] == 3
    assert design["funnel"]["berries"] == config["funnel"]["berries"]


def test_no_two_kinds_of_pours_share_a_seed():
    kinds = [*shape_cells.KINDS.values(), shape_cells.SENSITIVITY]
    seeds = [
        seed
        for _, purpose in kinds
        for number in range(40)
        for seed in draw_run_seeds(2026, STREAMS[purpose], number, 40)
    ]
    assert len(set(seeds)) == len(seeds)


@pytest.mark.parametrize(
    ("section", "changes", "key"),
    [
        ("particles", {"particle": "cube"}, "berry.particle"),
        ("fillings", {"cone_angle": 70.0}, "funnel"),
        ("sensitivities", {"rate_per_s": -1.0}, "funnel.rate_per_s"),
    ],
)
def test_an_invalid_variant_is_refused_by_name(config, section, changes, key):
    config["shape_study"][section]["odd"] = changes
    with pytest.raises(InputError) as caught:
        shape_cells.check(config, "my.yaml")
    assert caught.value.source == f"my.yaml, shape_study.{section}.odd"
    assert caught.value.key.startswith(key)


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("main_fillings", ["nowhere"], "some of here, there"),
        ("all_fillings_of", ["brick"], "some of egg, clump"),
        ("reference", "brick-keep-here", "PARTICLE-TENSION-FILLING"),
        (
            "sensitivities",
            {"fresh": {}},
            "names besides published, bulk, fresh, design",
        ),
    ],
)
def test_names_that_the_study_lacks_are_refused(config, key, value, allowed):
    config["shape_study"][key] = value
    input_error(allowed, shape_cells.check, config)


@pytest.mark.parametrize(
    "name", ["published-egg-keep", "bulk-egg-keep-here", "fresh-egg-cut-here"]
)
def test_an_unknown_cell_is_refused(config, name):
    input_error("--cell", shape_cells.cell_settings, config, name)


def test_published_sets_end_with_the_representative_that_stands_for_the_physical_pile(
    config,
):
    table = shape_cells.published_sets(config)
    assert table["set"].tolist() == ["22", "15", "56", "84", "2", "representative"]
    assert table.iloc[-1][PUBLISHED_PAIR].tolist() == [32.87, 65.57]
    assert table.iloc[0][PUBLISHED_PAIR].tolist() == [32.00, 65.63]


def test_a_cell_that_was_killed_goes_on_and_pours_nothing_twice(
    config, tmp_path, monkeypatch
):
    ran = []

    def run(scene, *_):
        seed = scene.seed
        ran.append(seed)
        arrays = {"position": np.random.default_rng(seed).normal(size=(4, 3))}
        return Run({"seed": seed, "status": "ok", "reason": ""}, arrays)

    def measure(record, arrays, *_):
        return record | {"height_mm": float(arrays["position"].max())}

    test = SimpleNamespace(name="cylinder", run=run, measure=measure)
    monkeypatch.setattr("repose.bench.bench", lambda name: test)
    sets = shape_cells.published_sets(config).head(2)

    def cell(**changes):
        ran.clear()
        settings = config | {
            name: config[name] | keys for name, keys in changes.items()
        }
        name = "bulk-egg-keep-cylinder"
        with provenance.record_stage("shape_cell", (), depends_on, runs="made"):
            provenance.note_config(shape_cells.cell_settings(settings, name)[2])
            shape_study.poured(settings, name, sets, None, {}, tmp_path)
        return len(ran)

    seeds = config["shape_study"]["bulk_seeds"]
    assert cell() == 2 * seeds
    assert cell() == 0
    assert cell(shape_study={"bulk_seeds": seeds + 1, "fresh_seeds": 9}) == 2, (
        "a further seed of each set"
    )
    assert cell(network={"hidden": 3}) == 0
    assert cell(simulation={"gravity_m_s2": 1.62}) == 2 * seeds


def test_a_cell_takes_no_longer_step_than_its_own_particle_bears(
    config, tmp_path, monkeypatch
):
    steps = []

    def poured(config, *_):
        steps.append(config["simulation"]["time_step_s"])
        return pd.DataFrame({"height_mm": []})

    monkeypatch.setattr(shape_study, "poured", poured)
    write_json(tmp_path / "berry.json", PipelineConfig.load("config/quick.yaml").grain)
    for own_s in (1e-4, 9e-3):
        config["simulation"]["time_step_s"] = own_s
        with provenance.record_stage("shape_cell", (), depends_on):
            shape_study.run_cell(
                config, "published-egg-keep-here", tmp_path / "berry.json", "", tmp_path
            )
    assert steps[0] == 1e-4
    assert 3e-4 < steps[1] < 1e-3


def test_cells_of_one_study_are_read_together_though_their_settings_differ(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(ROOT)
    paths = [
        tmp_path / f"published-smooth-{tension}-open_cone.csv"
        for tension in ("keep", "release")
    ]

    def run_cell(config, cell, *_):
        provenance.note_config(shape_cells.cell_settings(config, cell)[2])
        write_table(tmp_path / f"{cell}.csv", pd.DataFrame({"height_mm": [60.0]}))

    monkeypatch.setattr(shape_study, "run_cell", run_cell)
    for path in paths:
        script.run(
            [
                "cell",
                "--cell",
                path.stem,
                "--config",
                "config/config.yaml",
                "--out",
                str(tmp_path),
            ]
        )
    first, second = (attached.read_record(path) for path in paths)
    assert first["origin"] != second["origin"]
    provenance.reject_mixture(zip(paths, (first, second), strict=True))


# --- a whole study on made-up pours ----------------------------------------------------------------


def write_cell(folder, kind, cell, rows, density=510.0, **particle):
    """A cell's two files; rows: (set, seed, secant angle or None, Height)."""
    path = folder / f"{kind}-{cell}.csv"
    where = dict(zip(shape_rule.CELL, cell.split("-"), strict=True))
    records = []
    for name, seed, angle, height in rows:
        record = {"kind": kind, **where, "set": name, "seed": seed, "height_mm": height}
        record |= dict.fromkeys(shape_piles.COLUMNS.values(), 10.0)
        record |= dict.fromkeys(shape_tables.BULK, density)
        record["aor_secant_deg"] = angle
        record[shape_piles.DENSITY] = density + seed
        record["status"] = "ok" if angle is not None else "jammed"
        records.append(record)
    pd.DataFrame(records).to_csv(path, index=False)
    body = {
        "particle": where["particle"],
        "spheres": 0,
        "axes_mm": [21.0, 11.0, 10.0],
        "mass_g": 1.25,
        "volume_mm3": 1487.0,
        "deviation_rms_mm": 0.1,
        "deviation_max_mm": 0.2,
        "measured_axes_mm": [21.0, 11.0, 10.0],
    }
    path.with_suffix(".json").write_text(json.dumps(body | particle))
    return path


def piles(config, angle_off, height_off, seeds=4):
    pairs = shape_cells.published_sets(config).set_index("set")[PUBLISHED_PAIR]
    return [
        (name, seed, aor + angle_off + error, height + height_off - error)
        for name, (aor, height) in pairs.iterrows()
        for seed, error in enumerate((-0.5, 0.5) * (seeds // 2))
    ]


def a_design(signal, noise, sets=16, seeds=4, angle=30.0):
    """Samples whose angle goes with the Height by a degree a millimetre, 65 mm at `angle`."""
    rng = np.random.default_rng(3)
    steps = signal * np.linspace(-1.6, 1.6, sets)
    return [
        (
            k,
            seed,
            angle + steps[k] + noise * rng.normal(),
            65.0 + steps[k] + noise * rng.normal(),
        )
        for k in range(sets)
        for seed in range(seeds)
    ]


@pytest.fixture(scope="module")
def selected(small_study, tmp_path_factory):
    """Tables of a selection: a clump without volume that is nearest, then the egg, rough and truest particles."""
    config = small_study
    tmp_path = tmp_path_factory.mktemp("selected")
    config["shape_study"]["particles"] = {
        name: {"particle": "smooth"} for name in ("hollow", "egg", "light", "fine")
    }
    files = [
        write_cell(
            tmp_path,
            "published",
            "hollow-keep-here",
            piles(config, 0, 0),
            volume_mm3=1052.0,
        ),
        write_cell(
            tmp_path, "published", "light-keep-here", piles(config, 0, 0), density=400.0
        ),
        write_cell(tmp_path, "published", "egg-keep-here", piles(config, 2.20, 4.10)),
        write_cell(tmp_path, "published", "egg-keep-there", piles(config, 1.10, 0.0)),
        write_cell(tmp_path, "published", "egg-cut-there", piles(config, -4.4, 0.0)),
        write_cell(tmp_path, "published", "egg-release-here", piles(config, -4.4, 4.1)),
        write_cell(
            tmp_path, "published", "egg-release-there", piles(config, -6.6, 0.0)
        ),
        write_cell(
            tmp_path,
            "published",
            "fine-keep-here",
            piles(config, 6.6, 0.0),
            deviation_rms_mm=0.05,
        ),
        write_cell(
            tmp_path,
            "published",
            "fine-release-here",
            piles(config, 8.8, 0.0),
            deviation_rms_mm=0.05,
        ),
        write_cell(
            tmp_path,
            "bulk",
            "egg-keep-cylinder",
            piles(config, 0, 0)[:2],
            density=520.0,
        ),
    ]
    shape_study.run_selection(config, files, tmp_path)
    return config, tmp_path, files


def test_finalists_are_the_four_nearest_cells_of_right_particles_and_the_most_physical_one(
    selected,
):
    _, folder, _ = selected
    table = pd.read_csv(folder / "combinations.csv")
    secant = table.query("definition == 'secant'").set_index(shape_rule.CELL)
    assert secant.at[("egg", "keep", "here"), "distance"] == pytest.approx(
        math.sqrt(2), rel=1e-5
    )
    assert secant.at[("egg", "keep", "there"), "distance"] == pytest.approx(0.5)
    # four seeds of +-0.5: sd sqrt(1/3), and six independent sets
    assert secant.at[("egg", "keep", "here"), "aor_se_deg"] == pytest.approx(
        math.sqrt(1 / 3) / 2 / math.sqrt(6), rel=1e-5
    )
    for particle, why in (
        ("hollow", "measured_berry"),
        ("light", "packs_like_a_fruit"),
    ):
        row = secant.loc[(particle, "keep", "here")]
        assert not row[why]
        assert not row["eligible"]
    finalists = pd.read_csv(folder / "finalists.csv")
    cells = finalists[shape_rule.CELL].agg("-".join, axis=1).tolist()
    nearest = ["egg-keep-there", "egg-keep-here", "egg-cut-there", "egg-release-here"]
    assert cells == [*nearest, "fine-release-here", "hollow-keep-here"]
    assert finalists["role"].tolist() == ["finalist"] * 4 + ["physical", "effective"]
    piles_of = pd.read_csv(folder / "piles.csv").set_index(shape_rule.CELL)
    egg = piles_of.loc[("egg", "keep", "here")]
    assert egg["packing"] == pytest.approx(511.5 / 840.47, rel=1e-5)
    assert egg["cylinder_packing"] == pytest.approx(520.0 / 840.47, rel=1e-5)
    assert egg["share_of_piles"] == 1.0


def verdict(selected, out, first_off, signal=2.0, angle=32.0):
    """The choice, where the first finalist's fresh piles are off by `first_off`, and all others by far."""
    config, folder, files = selected
    cells = [
        "egg-keep-there",
        "egg-keep-here",
        "egg-cut-there",
        "egg-release-here",
        "fine-release-here",
        "hollow-keep-here",
    ]
    files = list(files)
    for cell in cells:
        facts = {"deviation_rms_mm": 0.05} if cell.startswith("fine") else {}
        facts |= {"volume_mm3": 1052.0} if cell.startswith("hollow") else {}
        offset = {cells[0]: first_off, cells[-1]: 0.0}.get(cell, 5.0)
        fresh = piles(config, offset, offset)
        design = a_design(signal, 1.0, angle=angle)
        files.append(write_cell(out, "fresh", cell, fresh, **facts))
        files.append(write_cell(out, "design", cell, design, **facts))
    return shape_study.run_verdict(config, files, folder / "finalists.csv", out)


def test_the_first_finalist_that_meets_the_published_piles_is_chosen(
    selected, tmp_path
):
    choice = verdict(selected, tmp_path, 2.0)
    assert choice["meets_the_published_piles"]
    assert [choice["chosen"][key] for key in shape_rule.COMBINATION] == [
        "egg",
        "keep",
        "there",
        "secant",
    ]
    assert choice["effective"]["particle"] == "hollow"
    assert choice["effective"]["meets"]
    assert choice["rule_sha256"] == shape_rule.sha256()
    assert json.loads((tmp_path / "choice.json").read_text()) == choice


@pytest.mark.parametrize(
    ("first_off", "signal", "angle", "reached"),
    [(2.3, 2.0, 32.0, True), (0.0, 0.1, 36.0, False)],
)
def test_without_a_near_finalist_the_most_physical_one_is_chosen(
    selected, tmp_path, first_off, signal, angle, reached
):
    choice = verdict(selected, tmp_path, first_off, signal, angle)
    assert not choice["meets_the_published_piles"]
    assert [choice["chosen"][key] for key in shape_rule.CELL] == [
        "fine",
        "release",
        "here",
    ]
    assert choice["angle_is_a_target"] == reached
    if reached:
        # the design passes through 32.57 degrees at the physical pile's 65.57 mm
        assert choice["chosen"]["definition"] == "secant"
        assert choice["chosen"]["angle_at_height"] == pytest.approx(32.57, abs=0.6)


def test_a_failed_pour_leaves_the_others_of_its_set(config, tmp_path):
    rows = [
        (*row[:2], None, None) if row[:2] == ("22", 0) else row
        for row in piles(config, 1.0, 0.0, seeds=2)
    ]
    files = [
        write_cell(tmp_path, "published", "egg-keep-here", rows),
        write_cell(tmp_path, "bulk", "egg-keep-cylinder", rows[2:3]),
    ]
    shape_study.run_selection(config, files, tmp_path)
    secant = (
        pd.read_csv(tmp_path / "combinations.csv")
        .query("definition == 'secant'")
        .iloc[0]
    )
    # the other pour of the set is half a degree and half a millimetre beside the mean
    assert secant["aor_difference_deg"] == pytest.approx(1.0 + 0.5 / 6, rel=1e-5)
    assert secant["height_difference_mm"] == pytest.approx(-0.5 / 6, rel=1e-4)
    assert secant["aor_se_deg"] == pytest.approx(0.5 / math.sqrt(6), rel=1e-5)
    assert secant["share_of_piles"] == pytest.approx(11 / 12, rel=1e-5)
    assert secant["eligible"]


def test_packings_at_the_bounds():
    assert shape_rule.packs_like_a_fruit(0.55, 0.0)
    assert shape_rule.packs_like_a_fruit(0.71, 0.006)
    assert not shape_rule.packs_like_a_fruit(0.71, 0.005)
    assert not shape_rule.packs_like_a_fruit(0.86, 0.01)
    assert not shape_rule.packs_like_a_fruit(math.nan, 0.01)


@pytest.mark.parametrize(("signal", "noise"), [(2.0, 1.0), (1.0, 2.0)])
def test_signal_and_noise_of_a_known_model(signal, noise):
    rng = np.random.default_rng(5)
    means = 30 + signal * rng.normal(size=400)
    rows = [
        (k, seed, mean + noise * rng.normal(), 60 + noise * rng.normal())
        for k, mean in enumerate(means)
        for seed in range(3)
    ]
    runs = pd.DataFrame(rows, columns=["set", "seed", "aor_secant_deg", "height_mm"])
    runs = runs.assign(
        particle="egg",
        tension="keep",
        filling="here",
        **{key: 1.0 for key in shape_piles.COLUMNS.values() if key != "aor_secant_deg"},
    )
    table = shape_tables.noise_table(runs, TARGETS).set_index("response")
    found = table.loc["secant"]
    assert found["noise"] == pytest.approx(noise, rel=0.06)
    assert found["signal_to_noise"] == pytest.approx(
        signal / noise, abs=4 * found["standard_error"]
    )
    assert 0 < found["standard_error"] < 0.15 * max(1.0, signal / noise)
    assert table.loc["height", "signal"] < 0.5 * noise


def fourth(name, value):
    return ANGLE | {"response": name, "value": value, "range": [value - 1, value + 1]}


def test_a_single_target_is_compared_alone(config):
    config["targets"] = [HEIGHT]
    assert [target.name for target in shape_cells.compared_targets(config)] == [
        "height_mm"
    ]
    assert shape_cells.published_sets(config).columns[-1] == "height_simulated_mm"


def test_targets_that_nobody_published_are_left_out(config):
    config["targets"] = [ANGLE, fourth("packing_percent", 60.0), HEIGHT]
    config["targets"] += [fourth("drum_slip_deg", 45.0) | {"apparatus": "drum"}]
    assert [target.name for target in shape_cells.compared_targets(config)] == [
        "aor_deg",
        "height_mm",
    ]
    config["targets"] = config["targets"][1:2]
    input_error(
        "some target's predicted and simulated values",
        shape_cells.compared_targets,
        config,
    )


def test_a_study_without_published_solutions_is_refused(config):
    config["validation"]["published"] = None
    input_error(r"validation\.published", shape_cells.published_sets, config)

"""The comparison of definitions: its statistics on numbers with a known answer, its shapes, its files."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from test_saved_pours import AXES, CONFIG, one_pour
from test_simulated_piles import BERRY as PARTICLE
from test_simulated_piles import cone_of_berries

from repose.bench.parameters import PARAMETERS
from repose.measure import pile
from repose.measure.silhouette import Grains
from research.measurement import measurement_study
from research.measurement.measurement_study import VARIANTS

LEVELS = "flank 10-80 %, levels"
COLUMNS = "flank 10-80 %, columns"
SETTINGS = pile.MeasureSettings.with_defaults(
    **CONFIG["measure"] | {"views": 2, "mm_per_pixel": 0.5}
).for_grain(AXES)


def test_spreads_of_a_drawn_design_are_those_it_was_drawn_with():
    rng = np.random.default_rng(4)
    true = rng.normal(25, 2.0, 800)
    table = pd.DataFrame(
        {"sample": np.repeat(np.arange(800), 8), "angle": np.repeat(true, 8)}
    )
    table["angle"] += rng.normal(0, 1.5, len(table))
    within, between = measurement_study.spreads(table, "angle")
    assert within == pytest.approx(1.5, rel=0.03)
    assert between == pytest.approx(true.std(ddof=1), rel=0.03)


def test_spreads_by_hand_with_samples_of_unequal_size():
    table = pd.DataFrame(
        {"sample": [1, 1, 2, 2, 2, 3], "angle": [10.0, 12.0, 20.0, 22.0, 24.0, 30.0]}
    )
    within, between = measurement_study.spreads(table, "angle")
    assert within**2 == pytest.approx((2.0 + 8.0) / 3)
    means_variance = np.var([11.0, 22.0, 30.0], ddof=1)
    expected = means_variance - within**2 * (1 / 2 + 1 / 3 + 1) / 3
    assert between**2 == pytest.approx(expected)


def test_noise_alone_has_no_spread_between_samples():
    table = pd.DataFrame(
        {"sample": np.repeat(np.arange(4), 2), "angle": [1.0, 9.0] * 4}
    )
    expected = (
        pytest.approx(math.sqrt(32)),
        0.0,
    )
    assert measurement_study.spreads(table, "angle") == expected


@pytest.mark.parametrize("angle", [20, 35])
def test_a_straight_cone_has_its_angle_by_every_variant_but_the_secant(angle):
    u = np.arange(2001) - 1000.0
    profile = np.maximum(124.0 - np.abs(u) * math.tan(math.radians(angle)), 0.0)
    found = measurement_study.variants_of_profile(profile, 1000, SETTINGS)
    berry = SETTINGS.berry_height_mm / SETTINGS.mm_per_pixel
    secant = math.degrees(
        math.atan(math.tan(math.radians(angle)) * 124.0 / (124.0 - berry))
    )
    assert set(found) == set(VARIANTS)
    for name, value in found.items():
        assert value == pytest.approx(
            secant if name == "secant" else angle, abs=1e-6
        ), name


def test_known_shapes_have_their_angle_but_for_the_bias():
    rng = np.random.default_rng(3)
    centres, quaternions = measurement_study.filled_cone(30, PARTICLE, rng)
    poured = {"position": centres, "quaternion": quaternions}
    filled = measurement_study.variants_of(poured, PARTICLE, SETTINGS)
    assert filled[LEVELS] == pytest.approx(30, abs=2)
    assert filled["Height"] == pytest.approx(60, abs=5)
    profiles = [measurement_study.strewn_triangle(30, rng, 0.5) for _ in range(60)]
    found = [
        measurement_study.variants_of_profile(p, int(p.argmax()), SETTINGS)[LEVELS]
        for p in profiles
    ]
    assert np.mean(found) == pytest.approx(30, abs=1.5)
    assert np.std(found) > 0.5


def save_job(folder, number, seeds, angle):
    """A job of cones of berries as the verb pour leaves it; its last pour has jammed. Returns the .npz."""
    arrays = {}
    for seed in seeds:
        centres, q = cone_of_berries(
            angle, np.random.default_rng([number, seed]), berries=250
        )
        arrays |= {f"position_{seed}": centres, f"quaternion_{seed}": q}
        arrays[f"in_pile_{seed}"] = np.ones(len(centres), bool)
    np.savez(folder / f"{number:03d}.npz", **arrays)
    pours = [*map(one_pour, seeds[:-1]), one_pour(seeds[-1], "jammed")]
    job = {
        "sample": number,
        "parameters": dict.fromkeys(PARAMETERS, 0.2),
        "pours": pours,
    }
    (folder / f"{number:03d}.pours.json").write_text(json.dumps(job))
    return folder / f"{number:03d}.npz"


def test_a_study_measures_what_is_ok_and_writes_its_tables(tmp_path):
    heaps = [
        save_job(tmp_path, number, (1, 2, 3), angle)
        for number, angle in ((1, 22), (2, 30), (3, 38))
    ]
    section = CONFIG["measure"] | {"views": 2, "mm_per_pixel": 0.5}
    out = tmp_path / "out"
    tables = measurement_study.run(
        heaps, heaps[1], PARTICLE, section, AXES, out, shapes=1
    )
    piles = pd.read_csv(out / "piles.csv")
    assert len(piles) == 8
    noise = pd.read_csv(out / "noise.csv").set_index("measured")
    assert list(noise.index) == ["Height", *VARIANTS]
    assert noise.loc[COLUMNS, "between"] == pytest.approx(8.0, abs=2.0)
    expected = noise["between"][COLUMNS] / noise["within"][COLUMNS]
    assert noise.loc[COLUMNS, "ratio"] == pytest.approx(expected)
    saved = np.load(heaps[0])
    measured = pile.measure_pile(
        Grains(saved["position_1"], saved["quaternion_1"], PARTICLE), SETTINGS
    )
    same = {
        "flank": "flank 30-80 %, levels",
        "secant": "secant",
        "whole": "whole",
        "straightest": "straightest, at least 1/3",
    }
    for definition, name in same.items():
        expected = measured.mean_deg(definition)
        assert piles.loc[0, name] == pytest.approx(expected, abs=0.02)
        expected = measured.aor[definition][0]
        assert piles.loc[0, f"{name} (view)"] == pytest.approx(expected, abs=0.02)
    assert list(tables["correlation"].columns) == [*VARIANTS, "Height"]
    assert tables["correlation"].loc[COLUMNS, "secant"] > 0.9
    assert tables["bias"]["measured"].tolist() == list(VARIANTS)
    input_error(
        "at least two jobs",
        measurement_study.run,
        heaps[:1],
        heaps[1],
        PARTICLE,
        section,
        AXES,
        out,
    )

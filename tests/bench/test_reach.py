"""Whether piles can have angle and Height at once: closed forms, the article's pair, samples of known shape."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from shared import ROOT

from repose.bench import funnel, reach, scene_size
from repose.calibrate.targets import complete_target
from repose.grain.particle import Particle
from repose.measure.angles import DEFINITIONS
from repose.measure.settings import MeasureSettings

# 500 of these are 744 ml; the cone of 65.57 mm and 32.87 degrees holds 707 ml.
BERRY_M3 = 1.25e-3 / 840.47
STRAIGHT_PART = {"response": "flank", "fit_from": 0.3, "fit_to": 0.8, "flank": "levels"}
MEASURED = {
    f"aor_{name}_deg": name for name in ("flank", "secant", "steepest", "whole")
}
WHOLE = {"response": "whole"}


def grain(axes_mm=reach.TABLE_GRAIN_MM, volume_m3=BERRY_M3):
    half = np.array([axes_mm]) * 5e-4
    return Particle(
        "ellipsoid",
        half,
        840.47,
        volume_m3,
        1e-3,
        np.ones(3),
        float(half.max()),
        0.0,
        0.0,
    )


def judged(config, line, dataset_csv=None, particle=None):
    config["measure"] |= line
    (found,) = reach.assess_targets(config, particle or grain(), dataset_csv).values()
    return found


def test_the_closed_cone_has_the_slope_of_its_height_and_volume():
    for angle in (10.0, 32.87, 60.0):
        slope = math.tan(math.radians(angle))
        volume = math.pi * 0.06557**3 / (3 * slope**2)
        assert reach.compute_cone_slope(65.57, volume) == pytest.approx(slope)
        assert reach.compute_steepest_angle(
            "whole", 65.57, reach.DENSEST_PACKING * volume
        ) == pytest.approx(angle)
    assert 1e6 * math.pi * 0.06557**3 / (
        3 * math.tan(math.radians(32.87)) ** 2
    ) == pytest.approx(707, abs=0.5)


def test_a_warning_needs_angle_and_height(config):
    angle, height = config["targets"]
    drum = {**angle, "response": "drum_slip_deg", "apparatus": "drum"}
    for targets in ([angle], [height], [drum], [drum, height], []):
        assert (
            list(
                reach.describe_assessments(config | {"targets": targets}, grain(), None)
            )
            == []
        )
    (line,) = reach.describe_assessments(config, grain(), None)
    assert line.startswith("reach: ")
    config["targets"][0]["response"] = "aor_secant_deg"
    config["measure"] |= WHOLE
    assert list(reach.assess_targets(config, grain())) == ["aor_secant_deg"]
    assert (
        reach.assess_targets(config, grain())["aor_secant_deg"].line
        == "secant, foot to crest"
    )


def test_a_side_is_no_steeper_than_the_cone_of_its_mass():
    """Sides of random piles, each the sum of four cones of other feet."""
    rng = np.random.default_rng(1)
    r = (np.arange(4000) + 0.5) / 4000
    for _ in range(200):
        feet = np.append(rng.uniform(0.05, 1, 3), 1.0)
        side = (
            rng.dirichlet(np.full(4, 0.5))[:, None]
            * np.maximum(1 - r / feet[:, None], 0)
        ).sum(axis=0)
        volume = 2 * math.pi * (side * r).mean()
        assert -np.polyfit(r, side, 1)[0] <= math.sqrt(math.pi / (3 * volume)) * (
            1 + 1e-4
        )


def test_the_articles_pair_is_out_of_reach_by_the_whole_side_alone(config):
    row, exact = reach.find_nearest_row(
        MeasureSettings.with_defaults(**config["measure"] | WHOLE), "whole", 0.2
    )
    assert exact
    assert row["largest"] < math.sqrt(reach.DENSEST_PACKING / funnel.PACKING)
    whole = judged(config, WHOLE)
    assert not whole.possible
    assert whole.bound_deg == pytest.approx(28.46, abs=0.01)
    assert whole.sentence.startswith(
        "Target out of reach: 32.9 deg at 65.6 mm by the line 'whole side, columns'; "
        "piles of this mass reach an estimated "
    )
    assert (
        "By estimate, the mass of 500 grains of 1487 mm3 allows at most 28.5 deg."
        in whole.sentence
    )
    straight = judged(config, STRAIGHT_PART)
    assert straight.possible
    assert straight.bound_deg is None
    assert straight.band.mean == pytest.approx(29.7, abs=0.5)
    assert straight.sentence.startswith(
        "Target attainable: 32.9 deg at 65.6 mm by the line 'flank, 30 to 80 %"
    )


def test_the_edge_of_a_band_is_at_two_standard_deviations(config):
    band = judged(config, STRAIGHT_PART).band
    angle = config["targets"][0]
    error = angle["sd"] / math.sqrt(angle["repetitions"])
    for side in (-1, 1):
        for sigmas, possible in ((1.95, True), (2.05, False)):
            angle["value"] = band.mean + side * sigmas * math.hypot(band.sd, error)
            assert judged(config, STRAIGHT_PART).possible is possible


def test_samples_of_the_study_stand_in_for_the_table(config, tmp_path):
    heights = np.random.default_rng(2).uniform(50, 80, 40)
    angles = np.degrees(
        np.arctan(math.tan(math.radians(30)) * (heights / 65.57) ** 1.5)
    )
    table = pd.DataFrame({"status": "ok", "aor_deg": angles, "height_mm": heights})
    failed = pd.DataFrame(
        {"status": ["no_flank"], "aor_deg": [80.0], "height_mm": [10.0]}
    )
    pd.concat([table, failed]).to_csv(tmp_path / "dataset.csv", index=False)
    found = judged(config, STRAIGHT_PART, tmp_path / "dataset.csv")
    assert found.band[:3] == pytest.approx((30.0, 0.0, 30.0), abs=1e-6)
    assert found.band.source == "40 samples of this study"
    for few in (table[: reach.FEWEST_SAMPLES - 1], table[["status"]]):
        few.to_csv(tmp_path / "few.csv", index=False)
        assert "goji" in judged(config, STRAIGHT_PART, tmp_path / "few.csv").band.source


@pytest.mark.parametrize("definition", DEFINITIONS)
@pytest.mark.parametrize("rule", ["columns", "rows", "levels"])
def test_every_line_has_a_band(config, definition, rule):
    found = judged(
        config,
        {"response": definition, "flank": rule, "fit_from": "berry", "fit_to": 0.85},
    )
    mean, sd, largest, source = found.band
    assert 20 < mean < mean + sd < largest < 60
    assert ("by the nearest line measured" in source) is (
        definition in ("flank", "steepest")
    )


def test_the_band_of_other_numbers_and_grains_says_so(config):
    before = judged(config, WHOLE).band
    assert before.source.endswith("samples of the goji berry")
    other = judged(config, WHOLE, particle=grain((10.0, 10.0, 10.0)))
    assert ", not of this grain" in other.sentence
    assert other.band.sd == pytest.approx(math.hypot(before.sd, reach.OTHER_GRAIN_DEG))
    config["funnel"]["berries"] = 1000
    change = scene_size.interpolate_change(500, 1000, "whole")
    smaller = grain(volume_m3=BERRY_M3 / 2)  # the same cone
    found = judged(config, WHOLE, particle=smaller).band
    turned = math.tan(math.radians(before.mean + change.angle_deg)) / change.height**1.5
    assert math.tan(math.radians(found.mean)) == pytest.approx(turned)
    assert "500 grains each, changed to 1000" in found.source


@pytest.mark.parametrize("crop", ["maize", "rapeseed", "soybean", "wheat"])
def test_the_band_holds_for_grains_that_the_table_has_not(crop):
    folder = ROOT / "results/published/crops" / crop
    crop_grain = json.loads((ROOT / f"crops/cards/{crop}.json").read_text())["grain"]
    body = grain(crop_grain["mean_axes_mm"], 1e-9 * crop_grain["volume_mm3"])
    config = json.loads((folder / "config.json").read_text())
    table = pd.read_csv(folder / "dataset.csv").query("status == 'ok'")
    height = table["height_mm"].mean()
    for name, definition in MEASURED.items():
        carried = np.tan(np.radians(table[name])) * (height / table["height_mm"]) ** 1.5
        mean = float(np.degrees(np.arctan(carried)).mean())
        entries = (
            {"response": name, "value": mean},
            {"response": "height_mm", "value": float(height)},
        )
        targets = [
            complete_target(entry | {"sd": 0.0, "repetitions": 1}) for entry in entries
        ]
        found = reach.assess_targets(config | {"targets": targets}, body)[name]
        assert found.possible, (definition, mean, found)
        assert ", not of this grain" in found.band.source

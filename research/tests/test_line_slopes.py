"""The table of lines beside the cone: piles of known shape, and its columns."""

import math

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from test_measurement_study import SETTINGS, save_job
from test_saved_pours import AXES, CONFIG

from repose.bench import funnel, reach
from repose.grain.particle import Particle
from repose.measure.angles import DEFINITIONS
from repose.measure.pile import measure_pile
from repose.measure.settings import MeasureSettings, line_of
from repose.measure.silhouette import Grains
from research.measurement import line_slopes

HALF = np.array([[21.14, 11.37, 9.88]]) * 5e-4
PARTICLE = Particle(
    "ellipsoid", HALF, 840.47, 1.5e-6, 1.25e-3, np.ones(3), HALF.max(), 0.0, 0.0
)


def test_lines_are_those_of_every_definition_each_once():
    found = line_slopes.lines()
    assert (
        {keys["definition"] for keys in found.values()}
        == set(DEFINITIONS)
        == set(reach.LINE_KEYS)
    )
    assert {
        "secant, foot to crest",
        "whole side, columns",
        "flank, 30 to 80 % of the height, levels",
    } <= set(found)


def test_ratios_of_cones_are_one_and_of_turned_cones_known():
    volume = 1e-3
    heights = np.array([50.0, 60.0, 70.0])
    samples = pd.DataFrame({"Height": heights})
    slopes = np.array([reach.compute_cone_slope(height, volume) for height in heights])
    for line in line_slopes.lines():
        factors = np.array([0.9, 1.0, 1.1]) if line.startswith("secant") else np.ones(3)
        samples[line] = np.degrees(np.arctan(factors * slopes))
    table = line_slopes.ratios(samples, volume).set_index("definition")
    assert table.loc["secant", ["mean", "sd", "largest"]].tolist() == pytest.approx(
        [1.0, 0.1, 1.1]
    )
    others = table.drop("secant")
    assert np.allclose(others[["mean", "sd", "largest"]], [1.0, 0.0, 1.0], atol=1e-9)
    assert (table["samples"] == 3).all()


def test_the_table_of_saved_piles_is_by_the_measured_angles(tmp_path):
    heaps = [
        save_job(tmp_path, number, (1, 2), angle)
        for number, angle in ((1, 25), (2, 30))
    ]
    config = {
        "measure": CONFIG["measure"] | {"views": 2, "mm_per_pixel": 0.5},
        "funnel": {"berries": 250},
    }
    out = tmp_path / "line_slopes.csv"
    table = line_slopes.run(heaps, PARTICLE, config, AXES, out)
    assert pd.read_csv(out)["definition"].tolist() == table["definition"].tolist()
    ratios = []
    for heap in heaps:
        arrays = np.load(heap)
        pile = measure_pile(
            Grains(arrays["position_1"], arrays["quaternion_1"], PARTICLE), SETTINGS
        )
        cone = reach.compute_cone_slope(
            pile.height_mm, 250 * PARTICLE.volume_m3 / funnel.PACKING
        )
        ratios.append(math.tan(math.radians(pile.mean_deg("whole"))) / cone)
    row = table[table["definition"] == "whole"].iloc[0]
    assert row["mean"] == pytest.approx(np.mean(ratios), rel=1e-9)
    input_error("two samples", line_slopes.run, heaps[:1], PARTICLE, config, AXES, out)
    assert (
        line_of(MeasureSettings.with_defaults(**CONFIG["measure"]))
        in line_slopes.lines()
    )

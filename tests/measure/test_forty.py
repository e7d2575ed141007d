"""Photographs by a renderer that casts rays at a random packing, with a camera above and soft shadows."""

import forty
import numpy as np
import pytest

from repose.measure.settings import MeasureSettings

FEW = 8, 10  # a camera 5.5 and 6.2 degrees above the crest
TOO_HIGH = 2  # 7.8 degrees, measured as 8.5


def errors(seeds, folder):
    """Measured minus true angle of the photographs that are measured without a doubt."""
    missed = []
    for seed in seeds:
        found, (true, own, _) = forty.outcome(forty.Scene(seed), folder)
        assert own == pytest.approx(true, abs=0.1), "a fit of our own"
        if found.measurement is not None and not found.doubts:
            missed.append(found.measurement.aor_deg - true)
    return np.array(missed)


@pytest.mark.slow
@pytest.mark.essential
def test_few_of_the_forty(tmp_path):
    missed = errors((*FEW, TOO_HIGH), tmp_path)
    assert len(missed) == len(FEW)
    assert (np.abs(missed) < 1.0).all()


@pytest.mark.slow
def test_all_forty(tmp_path):
    missed = errors(forty.JUDGED, tmp_path)
    print(len(missed), missed.round(2))
    assert len(missed) >= 20
    assert abs(missed.mean()) < 0.2
    assert np.abs(missed).max() < 1.2


def test_the_truth_of_a_drawing_is_its_side_view_without_perspective():
    """The highest point of ellipsoids is known without a picture."""
    scene = forty.Scene(1, number=200)
    centres, to_unit, number = scene.grains
    reach = np.linalg.norm(np.linalg.inv(to_unit)[:, 2], axis=1)  # of an ellipsoid along z
    angle, own, high = forty.truth(scene, MeasureSettings(berry_height_mm=scene.d))
    assert high == pytest.approx((centres[:number, 2] + reach[:number]).max(), abs=0.3)
    assert own == pytest.approx(angle, abs=0.1)

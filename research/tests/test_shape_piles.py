"""Measurements of the shape study on a pile: the flank rules beside those of one pile, and the density of its core."""

import math

import numpy as np
import pytest

from repose.grain.build import ellipsoid_mesh, fit_particle
from repose.measure import pile
from repose.measure.silhouette import Grains
from research.shape import shape_piles

PARTICLE = fit_particle(ellipsoid_mesh([12.0, 11.0, 10.0]), 840.0)
SETTINGS = pile.MeasureSettings.with_defaults(views=3, mm_per_pixel=0.5)


def cone(spacing_m, radius_m=0.1, height_m=0.065):
    """Points of a cubic lattice inside a cone."""
    side = np.arange(-0.1, 0.1, spacing_m) + 0.3 * spacing_m
    points = np.stack(
        np.meshgrid(side, side, side[side > 0], indexing="ij"), axis=-1
    ).reshape(-1, 3)
    away = np.hypot(points[:, 0], points[:, 1])
    return points[away < radius_m * (1 - points[:, 2] / height_m)]


def test_density_of_a_cone_of_known_density():
    centres = cone(2e-3)
    masses = np.full(len(centres), 4.8e-6)
    across = np.arange(-110.0, 110.5, 0.5)
    profile = np.clip(65.0 * (1 - np.abs(across) / 100.0), 0.0, None) / 0.5
    density = shape_piles.core_density(centres, masses, [profile], 0.5, 65.0, 13.0)
    assert density == pytest.approx(600.0, rel=0.02)
    # twice the berries near the surface alone do not count
    outer = np.hypot(centres[:, 0], centres[:, 1]) > 0.1 * (
        1 - (centres[:, 2] + 0.012) / 0.065
    )
    heavy = np.where(outer, 2.0, 1.0) * masses
    assert shape_piles.core_density(
        centres, heavy, [profile], 0.5, 65.0, 13.0
    ) == pytest.approx(density, rel=0.02)


def test_layers_at_the_plate_do_not_change_the_density():
    """Layers 10 mm apart, wherever they begin; a sharp lower end would miss a layer or count it."""
    across = np.arange(-110.0, 110.5, 0.5)
    profile = np.clip(65.0 * (1 - np.abs(across) / 100.0), 0.0, None) / 0.5
    found = []
    for first in (3.0, 5.0, 7.0, 9.0):
        centres = cone(1e-3)
        layered = np.isin(
            np.round(1e3 * centres[:, 2] - 0.3), np.arange(first, 65.0, 10.0)
        )
        kept = centres[layered]
        found.append(
            shape_piles.core_density(
                kept, np.full(len(kept), 6e-6), [profile], 0.5, 65.0, 10.0
            )
        )
    assert np.ptp(found) < 0.12 * np.mean(found)
    assert np.mean(found) == pytest.approx(600.0, rel=0.05)


def test_a_flat_pile_has_no_core():
    assert (
        shape_piles.core_density(
            np.zeros((1, 3)), np.ones(1), [np.ones(9)], 0.5, 30.0, 13.0
        )
        is None
    )


def test_definitions_are_those_of_a_measured_pile():
    centres = cone(11e-3)
    count = len(centres)
    arrays = {
        "position": centres,
        "quaternion": np.tile([1.0, 0, 0, 0], (count, 1)),
        "in_pile": np.ones(count, bool),
        "scale": np.ones(count),
    }
    found = shape_piles.measured(arrays, PARTICLE, SETTINGS)
    expected = {
        "height_mm",
        shape_piles.DENSITY,
        *shape_piles.COLUMNS.values(),
    }
    assert set(found) == expected
    for rule, name in shape_piles.FLANKS.items():
        settings = SETTINGS.model_copy(update={"flank": rule})
        alone = pile.measure_pile(Grains.of(arrays, PARTICLE), settings)
        assert found[f"aor_{name}_deg"] == pytest.approx(alone.mean_deg("flank"))
        if rule == SETTINGS.flank:
            for definition in ("secant", "steepest", "whole"):
                expected = alone.mean_deg(definition)
                assert found[f"aor_{definition}_deg"] == pytest.approx(expected)
    assert found["height_mm"] == pytest.approx(1e3 * centres[:, 2].max() + 5.0, abs=0.1)
    assert math.isfinite(found[shape_piles.DENSITY])

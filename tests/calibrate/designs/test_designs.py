"""Designs beside the printed tables, and beside what makes them what they are."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from refusals import value_error

from repose.calibrate.designs.ascent import compute_ascent_direction, make_ascent_path
from repose.calibrate.designs.box_behnken import BLOCKS, box_behnken
from repose.calibrate.designs.central_composite import central_composite
from repose.calibrate.designs.model import compute_terms, list_terms
from repose.calibrate.designs.plackett_burman import GENERATORS, plackett_burman

PRINTED = Path(__file__).parent / "printed"
# Centre runs of Box and Behnken's designs, and of rotatable ones (Box and Hunter 1957), as printed.
CENTRES = {3: 3, 4: 3, 5: 6, 6: 6, 7: 6}
ROTATABLE_CENTRES = {2: 5, 3: 6, 4: 7, 5: 6, 6: 9, 7: 14}

# Montgomery, Design and Analysis of Experiments: the design for 11 factors in 12 runs. He writes the generator down the
# first column, so his table is ours mirrored at its diagonal.
TWELVE_RUNS = """
+-+---+++-+
++-+---+++-
-++-+---+++
+-++-+---++
++-++-+---+
+++-++-+---
-+++-++-+--
--+++-++-+-
---+++-++-+
+---+++-++-
-+---+++-++
-----------
"""


def test_twelve_runs_are_as_printed_and_take_six_factors():
    printed = np.array(
        [[1.0 if sign == "+" else -1.0 for sign in row] for row in TWELVE_RUNS.split()]
    )
    design = plackett_burman(11, 12)
    assert np.array_equal(design[:11], printed[:11].T)
    assert np.array_equal(design[11], printed[11])
    assert plackett_burman(6, 12).shape == (12, 6)


@pytest.mark.parametrize("runs", GENERATORS)
def test_every_plackett_burman_design_is_orthogonal(runs):
    design = plackett_burman(runs - 1, runs)
    with_mean = np.column_stack([np.ones(runs), design])
    assert np.array_equal(with_mean.T @ with_mean, runs * np.eye(runs))
    assert "".join("+" if level > 0 else "-" for level in design[0]) == GENERATORS[runs]


def blocks_of(factors, centres=None):
    """A Box-Behnken design, and the block, from 1, of each run: the last runs of a block are its centre."""
    design = box_behnken(factors, centres or CENTRES[factors])
    centre = (design == 0).all(axis=1)
    return design, 1 + np.cumsum(np.concatenate([[False], centre[:-1] & ~centre[1:]]))


def test_three_factors_are_as_printed_and_centre_runs_spread_over_blocks():
    # Myers and Montgomery, Example 7.5, in standard order
    printed = np.loadtxt(PRINTED / "viscosity_runs.csv", delimiter=",", skiprows=1)[
        :, :3
    ]
    assert np.array_equal(box_behnken(3, 3), printed)
    design, blocks = blocks_of(4, centres=5)
    assert len(design) == 29
    assert [
        (design[blocks == number] == 0).all(axis=1).sum() for number in (1, 2, 3)
    ] == [2, 2, 1]


@pytest.mark.parametrize(
    ("factors", "runs", "blocks"),
    [(3, 15, 1), (4, 27, 3), (5, 46, 2), (6, 54, 1), (7, 62, 1)],
)
def test_box_behnken_has_the_printed_number_of_runs(factors, runs, blocks):
    design, numbers = blocks_of(factors)
    assert design.shape == (runs, factors)
    expected = [runs // blocks] * blocks
    assert np.unique(numbers, return_counts=True)[1].tolist() == expected
    assert set(np.unique(design)) == {-1, 0, 1}


@pytest.mark.parametrize("factors", BLOCKS)
def test_box_behnken_is_balanced(factors):
    design, blocks = blocks_of(factors)
    sets = [block for part in BLOCKS[factors] for block in part]
    # each factor is in equally many sets
    counts = {sum(k in block for block in sets) for k in range(1, factors + 1)}
    assert len(counts) == 1
    # up to five factors each pair is in one set
    if factors < 6:
        pairs = {pair for block in sets for pair in combinations(block, 2)}
        assert len(sets) == factors * (factors - 1) // 2
        assert len(pairs) == len(sets)
    # the quadratic model is determined
    values = compute_terms(design, list_terms(factors, "quadratic"))
    matrix = np.column_stack([np.ones(len(design)), values])
    assert np.linalg.matrix_rank(matrix) == matrix.shape[1]
    # orthogonal blocks (Box and Hunter 1957): every term has the same mean in each of them
    means = np.array(
        [values[blocks == number].mean(axis=0) for number in np.unique(blocks)]
    )
    assert np.allclose(means, means[0])


@pytest.mark.parametrize(
    ("factors", "alpha", "runs"),
    [
        (2, 1.414, 13),
        (3, 1.682, 20),
        (4, 2.0, 31),
        (5, 2.0, 32),
        (6, 2.378, 53),
        (7, 2.828, 92),
    ],
)
def test_rotatable_designs_as_printed(factors, alpha, runs):
    # Box and Hunter 1957; Cochran and Cox, Table 8A
    design, distance = central_composite(
        factors, "rotatable", ROTATABLE_CENTRES[factors]
    )
    assert len(design) == runs
    assert distance == pytest.approx(alpha, abs=5e-4)


@pytest.mark.parametrize("factors", ROTATABLE_CENTRES)
def test_a_rotatable_design_predicts_equally_well_at_equal_distance(factors):
    design, _ = central_composite(factors, "rotatable", ROTATABLE_CENTRES[factors])
    terms = list_terms(factors, "quadratic")
    matrix = np.column_stack([np.ones(len(design)), compute_terms(design, terms)])
    inverse = np.linalg.inv(matrix.T @ matrix)
    points = np.random.default_rng(3).normal(size=(20, factors))
    points *= 1.3 / np.linalg.norm(points, axis=1)[:, None]
    rows = np.column_stack([np.ones(20), compute_terms(points, terms)])
    variance = np.einsum("ni,ij,nj->n", rows, inverse, rows)
    assert np.ptp(variance) < 1e-9 * variance.mean()


def test_a_face_centred_design_has_three_levels():
    design, alpha = central_composite(3, "face_centred", centres=2)
    assert alpha == 1.0
    assert design.shape == (16, 3)
    assert set(np.unique(design)) == {-1, 0, 1}
    assert design[:3].tolist() == [[-1, -1, -1], [1, -1, -1], [-1, 1, -1]], (
        "standard order"
    )


def climbed(*slopes):
    return compute_ascent_direction(
        np.array([slopes]), np.array([1.0]), np.array([1.0])
    )


def test_the_path_and_the_direction_of_two_textbooks():
    # Montgomery, Example 11-1: 40.44 + 0.775 x1 + 0.325 x2; 5 minutes a step are 1 in x1 and 0.42 in x2, 2 degrees
    points = 12.0 * make_ascent_path(climbed(0.775, 0.325), 12)
    assert points[1] == pytest.approx([1, 0.42], abs=5e-3)
    natural = np.array([35.0, 155.0]) + 5.0 * points
    assert natural[0].tolist() == [35, 155]
    assert natural[10] == pytest.approx([85, 175], abs=1.0), "his tenth step"
    # the vignette of rsm: coefficients 0.875 and 0.625, and half ranges of 5
    found = climbed(0.875, 0.625)
    assert found == pytest.approx([0.8137335, 0.5812382], abs=5e-8)
    assert 5.0 * found == pytest.approx([4.068667, 2.906191], abs=5e-7)


def test_one_response_is_climbed_and_several_descend_the_sum_of_their_squared_misses():
    slope = np.array([[0.775, 0.325]])
    up = compute_ascent_direction(slope, np.array([3.0]), np.array([40.0]))
    assert up == pytest.approx(slope[0] / np.linalg.norm(slope))
    assert compute_ascent_direction(
        slope, np.array([-3.0]), np.array([40.0])
    ) == pytest.approx(-up)
    value_error("other than 0", climbed, 0.0, 0.0)
    slopes = np.array([[1.0, 0.5], [-0.2, 0.8]])
    missing = np.array([2.0, 1.0])
    scale = np.array([30.0, 65.0])

    def misses(x):
        return (((missing - slopes @ x) / scale) ** 2).sum()

    steps = [
        np.array([np.cos(a), np.sin(a)]) * 1e-5 for a in np.linspace(0, 2 * np.pi, 3601)
    ]
    expected = min(steps, key=misses) / 1e-5
    assert compute_ascent_direction(slopes, missing, scale) == pytest.approx(
        expected, abs=2e-3
    )

"""The sentences about how probably the targets are met."""

from types import SimpleNamespace

import pytest

from repose.report.page.verdict import describe_probability


@pytest.mark.parametrize(
    ("n_targets", "beginning"),
    [
        (
            1,
            "With a probability of 83 % the mean of the response lies inside its target range",
        ),
        (
            2,
            "With a probability of 83 % the means of both responses lie inside their target ranges",
        ),
        (
            3,
            "With a probability of 83 % the means of all 3 responses lie inside their target ranges",
        ),
        (
            4,
            "With a probability of 83 % the means of all 4 responses lie inside their target ranges",
        ),
    ],
)
def test_the_probability_is_that_of_all_targets(n_targets, beginning):
    study = SimpleNamespace(
        probability={"all": 0.83},
        probability_within={},
        targets=[None] * n_targets,
        get_number=lambda _name: 12.0,
    )
    text = describe_probability(study)
    assert text.startswith(beginning)
    assert "judged by 12 new simulations" in text

"""What jobs declare; test_quick_run.py compares it with what they took."""

import pytest
from plans import declared

pytestmark = pytest.mark.slow


def test_every_job_declares_memory_and_time_and_more_of_both_when_it_is_tried_again(tmp_path):
    rules = declared(tmp_path)
    assert len(rules) > 60
    for rule in rules:
        for first, second in (rule.memory_mb, rule.minutes):
            assert second == 2 * first > 0, rule.rule

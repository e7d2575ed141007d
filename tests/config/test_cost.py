"""What a run needs, against numbers that are known."""

import copy

import pytest

from repose.config import cost
from repose.config.study import Study
from repose.core import places
from repose.strategies import cost as strategies


@pytest.fixture
def config():
    return copy.deepcopy(Study.load(places.root() / "config/config.yaml").config)


def test_the_response_surface_has_its_own_pours(config):
    config["response_surface"] |= {"screening_runs": 12, "steps": 5, "most_factors": 3, "centres": 5, "checks": 8}
    config["response_surface"] |= {"surface": "box_behnken", "seeds": 3}
    assert strategies.pours(config) is None
    config["strategy"] = "response_surface"
    pours = strategies.pours(config)
    # 12 runs and 5 centres; 12 edges of the cube and 5 centres
    assert pours == (("screening", 17, 3), ("ascent", 6, 3), ("surface", 17, 3), ("check", 8, 3))
    work = cost.work(config, 1e-7, pours)
    assert work["total_s"] == pytest.approx(48 * cost.JOB_START_S + 144 * work["pour_s"])


def test_the_sequential_strategy_stops_at_its_budget(config):
    config["strategy"] = "sequential"
    config["sequential"] |= {"most_pours": 120, "seeds": 3}
    assert strategies.pours(config) == (("at most", 40, 3),)


def test_the_time_goes_with_what_was_measured(config):
    """Grains that appear over the whole pour are there for half of it."""
    config["funnel"] |= {"berries": 100, "rate_per_s": 10.0, "duration_s": 10.0}
    config["simulation"]["time_step_s"] = 1e-4
    assert cost.run_s(config, "funnel", 1e-7) == pytest.approx(100 * 5.0 / 1e-4 * 1e-7)
    assert cost.run_s(config, "funnel", 3e-7) == pytest.approx(3 * cost.run_s(config, "funnel", 1e-7))


def test_a_study_takes_its_runs_and_a_rest(config):
    del config["drum"]
    config["design"]["samples"], config["funnel"]["seeds"] = 30, 4
    config["validation"] |= {"published": None, "solutions": 1, "seeds": 8, "representative_seeds": 16}
    work = cost.work(config, 1e-7)
    assert work["total_s"] == pytest.approx(cost.REST_S + 32 * cost.JOB_START_S + 144 * work["pour_s"])


def test_the_longest_job_has_the_most_seeds_of_the_slowest_bench_test(config):
    config["refine"]["seeds"] = 100
    slowest = max(cost.run_s(config, name) for name in ("funnel", "drum"))
    assert cost.longest_job_s(config) == pytest.approx(cost.JOB_START_S + 100 * slowest)
    config["validation"]["representative_seeds"] = 200
    assert cost.longest_job_s(config) == pytest.approx(cost.JOB_START_S + 200 * slowest)


def test_work_counts_every_pour(config):
    config["simulation"]["time_step_s"] = 2.5e-4
    work = cost.work(config)
    solutions = (("representative", 1, 32), ("validation", 5, 12))
    assert work["pours"] == (("design", 150, 6), *solutions)
    config["simulation"]["time_step_s"] /= 2
    assert cost.costs(config)["published_sets"].startswith("84 pours")  # seven sets
    assert cost.work(config)["total_s"] > 1.65 * work["total_s"]
    config["simulation"]["time_step_s"] *= 2
    slip = {"response": "drum_slip_deg", "apparatus": "drum", "value": 40, "sd": 1, "repetitions": 3}
    config["targets"].append(slip | {"range": [35, 45]})
    runs = (150 + 1 + 5) * config["drum"]["seeds"]
    assert cost.work(config)["total_s"] > work["total_s"] + runs * cost.run_s(config, "drum")

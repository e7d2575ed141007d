"""The speed of the engine, as `repose bench` tells it."""

import numpy as np
import pytest
from shared import ROOT

from repose.bench import speed
from repose.bench.speed import Times
from repose.config.pipeline import PipelineConfig

CONFIG = PipelineConfig.load(ROOT / "config/quick.yaml").config
PARAMETERS = {"e_gg": 0.2}
POURS = {
    "a": [Times(80.0, 9.0), Times(100.0, 12.0), Times(300.0, 10.0)],
    "b": [Times(250.0, 30.0), Times(20.0, 31.0), Times(251.0, 5.0)],
}


def test_medians_are_set_beside_the_kernel():
    summary = speed.summarise_times([40.0, 700.0, 50.0], POURS)
    assert summary["reference_us"] == 50.0
    first, second = summary["particles"]
    assert first == {
        "name": "a",
        "us_per_step": 100.0,
        "job_s": 10.0,
        "ratio": 2.0,
        "to_first": 1.0,
    }
    assert second == {
        "name": "b",
        "us_per_step": 250.0,
        "job_s": 30.0,
        "ratio": 5.0,
        "to_first": 2.5,
    }
    result = summary | {"berries": 500, "time_step_s": 2e-4} | speed.describe_machine()
    table = speed.format_result(result).splitlines()
    assert table[0].startswith(
        "500 grains, time step 0.0002 s, one core; reference kernel 50.0 us; "
    )
    assert f"vectors of {speed.describe_machine()['vector_bits']} bits" in table[0]
    assert [" ".join(line.split()) for line in table[3:]] == [
        "a 100.0 1.00 2.000 10.00",
        "b 250.0 2.50 5.000 30.00",
    ]


def test_particles_are_poured_in_turn_after_a_short_pour_of_each(monkeypatch):
    poured = []

    def pour(config, parameters, seed, particle, berry):
        poured.append((particle, config["funnel"]["berries"]))
        assert parameters == PARAMETERS
        assert seed == 1
        assert berry == "berry"
        return Times({"A": 100.0, "B": 250.0}[particle], 10.0)

    monkeypatch.setattr(speed, "time_pour", pour)
    result = speed.run(CONFIG, {"a": "A", "b": "B"}, "berry", PARAMETERS)
    berries = CONFIG["funnel"]["berries"]
    assert poured == [("A", 2), ("B", 2)] + 3 * [("A", berries), ("B", berries)]
    assert result["berries"] == berries
    assert result["time_step_s"] == 4.9e-4
    assert [row["to_first"] for row in result["particles"]] == [1.0, 2.5]


def test_the_reference_kernel_does_every_step():
    x = 1.0
    for k in range(500):
        x = np.sqrt(x * 1.0000001 + 1e-9 * k) / (1.0 + 1e-7 * x)
    assert speed.reference_kernel(500) == pytest.approx(x, rel=1e-12)

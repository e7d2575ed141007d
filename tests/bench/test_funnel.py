"""The funnel: reproducible to the bit, at rest, and in agreement with an independent implementation."""

import hashlib
import math
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from goji import AXES_MM, BERRY, ROOT, named, particle
from numba import typeof

from repose.bench import Scene, bench, funnel
from repose.bench.settings import SceneSettings, SimulationSettings
from repose.bench.trial import Trial
from repose.config.pipeline import PipelineConfig
from repose.dem import simulation as engine
from repose.dem.kernels.engine import advance
from repose.measure import pile
from repose.measure.clusters import largest_cluster
from repose.measure.silhouette import Grains
from repose.stages.job import measure_job, run_job, run_once

TEST = funnel.FunnelTest()
REPRESENTATIVE = (0.203, 0.642, 0.037, 0.244, 0.483, 0.185)
CENTRE = (0.25, 0.55, 0.045, 0.35, 0.60, 0.20)
STEEP = (0.10, 0.75, 0.07, 0.20, 0.80, 0.30)
FLAT = (0.40, 0.35, 0.02, 0.50, 0.40, 0.10)
# an independent implementation: n, AoR (10 to 80 % of the height) and Height, each mean and seed-to-seed sd
REFERENCES = {
    "representative": (REPRESENTATIVE, 30, 21.6, 1.6, 59.0, 3.2),
    "centre": (CENTRE, 30, 23.9, 1.5, 61.5, 2.7),
    "steep corner": (STEEP, 6, 28.6, 1.0, 75.1, 3.4),
    "flat corner": (FLAT, 6, 17.2, 1.6, 43.6, 3.3),
    "spheres": (REPRESENTATIVE, 6, 17.1, 1.3, 47.8, 3.2),
}
LINE = {"response": "flank", "fit_from": 0.1, "fit_to": 0.8, "flank": "columns"}
# Spheres are quick: their Height is 50.9 +- 0.5 mm in 24 pours, 2.2 standard errors above the reference of six.
SEEDS = dict.fromkeys(REFERENCES, 8) | {"spheres": 24}
# Rows whose deviation is known. The other implementation damps by m* of whole bodies, this one by the mass at the
# contact, so an ellipsoid that is hit off its centre returns more, and its pile is lower.
KNOWN = {
    "centre": "8 pours give 21.75 degrees where 23.9 are given (5.2 standard errors), 40 pours 23.0 +- 0.3 (2.4)"
}
SCRIPT = """
import sys
sys.path[:0] = [{tests!r}, {tests!r} + "/bench"]
from test_funnel import *
print(digest(TEST.pour(scene_of(small()))))
print(len(advance.stats.cache_misses))
"""


def config(**keys):
    """The published experiment as the reference values were made, with some keys of its funnel changed."""
    whole = PipelineConfig.load(ROOT / "config/paper.yaml").config
    changed = {
        "funnel": keys,
        "simulation": {"time_step_s": 2e-4},
        "measure": {"views": 18} | LINE,
    }
    return whole | {
        section: whole[section] | values for section, values in changed.items()
    }


def scene_of(whole, seed=5, values=CENTRE):
    return Scene.of(whole, named(values), BERRY, particle(), seed)


class LimitedByAll(SimulationSettings):
    """Friction is limited by all of the normal force, as in the other implementation."""

    @property
    def laws(self):
        return super().laws | {"friction_limit": "total"}


def one_run(task):
    name, seed = task
    axes = np.full(3, np.prod(AXES_MM) ** (1.0 / 3.0)) if name == "spheres" else AXES_MM
    whole = config()
    settings = SceneSettings(whole, {"simulation": LimitedByAll(**whole["simulation"])})
    record, _ = run_once(
        bench("funnel"),
        Scene(settings, named(REFERENCES[name][0]), BERRY, particle(axes), seed),
    )
    return name, record


@pytest.fixture(scope="module")
def ensembles():
    tasks = [(name, 1000 + seed) for name in REFERENCES for seed in range(SEEDS[name])]
    found = {name: [] for name in REFERENCES}
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        for name, record in pool.map(one_run, tasks):
            # a slide in the last moment happens: 2 of 240 pours at these rows, with the funnel long empty
            if record["status"] != "not_at_rest":
                assert record["status"] == "ok", record
                found[name].append((record["aor_deg"], record["height_mm"]))
    assert all(len(values) >= SEEDS[name] - 1 for name, values in found.items()), found
    return {name: np.array(values) for name, values in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            name, marks=pytest.mark.xfail(reason=KNOWN[name]) if name in KNOWN else ()
        )
        for name in REFERENCES
    ],
)
def test_ensembles_agree_with_the_reference_values(ensembles, name):
    _, n, aor, aor_sd, height, height_sd = REFERENCES[name]
    ours = ensembles[name]
    mean = ours.mean(axis=0)
    variance = ours.var(axis=0, ddof=1) / len(ours)
    for k, (value, sd) in enumerate(((aor, aor_sd), (height, height_sd))):
        error = math.sqrt(variance[k] + sd**2 / n)
        assert abs(mean[k] - value) < 3.0 * error, (mean[k], value, error)


def small(**keys):
    return config(**{"berries": 60, "rate_per_s": 60.0, "duration_s": 3.0, **keys})


def heap():
    """A pour of 120 berries in 5 s: most pours of 60 leave a layer, none of 80 of these did."""
    return small(berries=120, duration_s=5.0)


def digest(poured):
    return hashlib.sha256(
        poured.centres_m.tobytes() + poured.quaternions.tobytes()
    ).hexdigest()


def in_a_new_process(**environment):
    command = [sys.executable, "-c", SCRIPT.format(tests=str(ROOT / "tests"))]
    done = subprocess.run(
        command,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    found, compiled = done.stdout.split()
    return found, int(compiled)


@pytest.mark.slow
def test_springs_may_be_linear():
    whole = small()
    whole["simulation"]["contact_law"] = "linear_spring"
    poured = TEST.pour(scene_of(whole))
    assert not poured.unstable
    assert poured.on_plate.sum() == 60
    assert poured.kinetic_energy_j / 60 < 1e-12
    assert digest(poured) != digest(TEST.pour(scene_of(small())))


@pytest.mark.slow
def test_code_compiled_or_cached_gives_the_same_bits(tmp_path, monkeypatch):
    signatures = set()

    def noting(*arguments):
        signatures.add(tuple(map(typeof, arguments)))
        return advance(*arguments)

    monkeypatch.setattr(engine, "advance", noting)
    expected = digest(TEST.pour(scene_of(small())))
    assert in_a_new_process() == (expected, 0)
    # this process has compiled the kernel itself where its cache was empty
    if not signatures <= set(advance.stats.cache_misses):
        assert in_a_new_process(NUMBA_CACHE_DIR=str(tmp_path)) == (expected, 1)


@pytest.fixture(scope="module")
def plain():
    whole = small()
    poured = TEST.pour(scene_of(whole))
    assert whole == small()
    return poured


@pytest.fixture(scope="module")
def filmed():
    return TEST.pour(scene_of(small()), interval_s=0.01)


def test_a_trajectory_has_its_frames_and_changes_nothing_and_another_seed_does(
    plain, filmed
):
    assert digest(plain) == digest(filmed)
    assert digest(plain) != digest(TEST.pour(scene_of(small(), 6)))
    assert 100 < len(filmed.frames["time_s"]) <= 300  # a pour ends when its pile rests
    assert np.allclose(np.diff(filmed.frames["time_s"]), 0.01)
    assert np.isnan(filmed.frames["position"][0]).any()
    assert np.allclose(filmed.frames["position"][-1], filmed.centres_m, atol=1e-6)


def test_frames_may_be_a_time_step_apart_and_a_pour_that_goes_on_after_its_pile_rests_changes_nothing(
    filmed,
):
    made = TEST.build(Scene.of(small(), named(CENTRE), BERRY, particle()))
    made.add("berry", (0.0, 0.0, 0.05))
    film = Trial(lambda *_: made, scene_of(small()), 1, made.time_step_s)
    film.bound(0.1)
    film.run_to(5)
    assert film.frames()["time_s"] == pytest.approx(made.time_step_s * np.arange(1, 6))
    went_on = TEST.pour(scene_of(small()), interval_s=0.01, until_rest=False)
    assert len(filmed.frames["time_s"]) < len(went_on.frames["time_s"]) == 300
    assert np.abs(filmed.centres_m - went_on.centres_m).max() < 2e-5
    assert filmed.largest_motion_m <= 1e-3 * small()["funnel"]["rest_motion_mm"]


@pytest.mark.parametrize(
    ("keys", "status", "reason"),
    [
        ({"outlet_diameter_mm": 14.0}, "jammed", "grains are still in the funnel"),
        ({"plate_diameter_mm": 40.0}, "left_plate", "left the plate"),
        ({"duration_s": 1.25, "rest_window_s": 0.02}, "not_at_rest", "J a grain"),
        ({"berries": 4}, "no_flank", " "),
    ],
)
def test_a_run_without_a_pile_has_a_status_and_a_reason(keys, status, reason):
    record, _ = run_once(bench("funnel"), scene_of(small(**keys)))
    assert record["status"] == status
    assert reason in record["reason"]
    assert record["aor_deg"] is None
    assert record["height_mm"] is None


def of_last_positions(heights_m, exits_s, radius_m=0.005):
    """A judged pour of grains at these heights, which touch each other, under an outlet at 0.1 m."""
    n = len(heights_m)
    simulation = SimpleNamespace(
        positions=np.column_stack([np.zeros((n, 2)), heights_m]),
        quaternions=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        scales=np.ones(n),
        present=np.ones(n, bool),
        radius=radius_m,
        exit_times_s=np.array(exits_s),
        contacts=lambda: np.column_stack([np.arange(n - 1), np.arange(1, n)]),
        kinetic_energies=lambda: np.zeros(n),
    )
    trial = SimpleNamespace(
        simulation=simulation, frames=lambda: None, broken="", overlap_share=0.0
    )
    return funnel._describe_final_state(trial, 0.1, None, funnel._WallTime(1.0, 1.0))


def test_a_pour_is_judged_by_its_last_positions():
    """A grain that hangs in the outlet has its centre less than a radius below the rim."""
    poured = of_last_positions(
        [0.01, 0.094, 0.096, 0.2, -1.0], [2.0, 3.5, 5.0, math.nan, 2.5]
    )
    assert poured.in_funnel == 2
    assert poured.off_plate == 1
    assert poured.on_plate.tolist() == [True, True, False, False, False]
    assert poured.discharge_s == 3.0
    for lost, status in (
        (6, "ok"),
        (7, "left_plate"),
    ):  # a tenth of the grains may leave the plate
        poured = of_last_positions([0.01] * (60 - lost) + [-1.0] * lost, [1.0] * 60)
        assert TEST.status_of(poured, SceneSettings(small()))[0] == status, lost


@pytest.mark.parametrize(
    ("in_pile", "on_plate"), [(3, 57), (2, 15), (1, 1), (9, 9), (28, 57), (0, 60)]
)
def test_berries_that_lie_apart_are_no_pile(in_pile, on_plate, plain):
    apart = replace(
        plain, in_pile=np.arange(60) < in_pile, on_plate=np.arange(60) < on_plate
    )
    status, reason = TEST.status_of(apart, SceneSettings(small()))
    assert status == "no_flank"
    assert f"{in_pile} of {on_plate} grains touch each other" in reason


def test_a_job_writes_what_it_returns_and_largest_cluster_is_found(tmp_path):
    pours = run_job(bench("funnel"), scene_of(small()), "007", [5, 6], tmp_path)
    result = measure_job(Scene.of(small(), {}, BERRY, particle()), pours)
    assert result["sample"] == 7
    assert [run["seed"] for run in result["runs"]] == [5, 6]
    assert np.load(tmp_path / "007.npz")["position_5"].shape == (60, 3)
    assert (tmp_path / "007.json").exists()
    assert not list(tmp_path.glob("*.part"))
    contacts = np.array([[0, 1], [1, 2], [3, 4], [5, 6]])
    allowed = np.array([True, True, True, True, True, True, False, True])
    assert list(largest_cluster(contacts, allowed)) == [True, True, True] + [False] * 5
    assert not largest_cluster(contacts, np.zeros(8, bool)).any()


def test_a_pile_rests_on_the_plate_and_is_measured_as_piles_are():
    record, run = run_once(bench("funnel"), scene_of(heap()))
    assert record["status"] == "ok"
    assert record["reason"] == ""
    assert record["kinetic_energy_J"] / record["berries_in_pile"] < 1e-12
    assert record["berries_on_plate"] == 120
    assert 1.8 < record["discharge_s"] < 2.2
    settings = pile.MeasureSettings.with_defaults(**heap()["measure"]).for_grain(BERRY)
    again = pile.measure_pile(
        Grains.of(run.arrays, particle()), settings, run.arrays["in_pile"]
    )
    assert {key: record[key] for key in again.record()} == again.record()


def test_a_pour_has_grains_of_several_sizes(plain):
    settings = small()
    settings["berry"] = settings["berry"] | {"size_distribution": "measured"}
    berry = BERRY | {"scale_sd": 0.083, "scale_low": 0.78, "scale_high": 1.16}
    poured = TEST.pour(Scene.of(settings, named(CENTRE), berry, particle(), 3))
    assert len(poured.scales) == len(poured.centres_m)
    assert 0.05 < poured.scales.std() < 0.11
    assert np.all(plain.scales == 1.0)

"""Further responses of saved pours, through the files of a job."""

import json
import math

import numpy as np
import pandas as pd
import pytest

from repose.calibrate.responses import list_responses
from repose.common.errors import InputError
from repose.grain.build import Particle
from repose.measure import further_responses
from repose.measure.angles import DEFINITIONS
from research.responses import saved_piles
from research.responses.offered import offered


@pytest.fixture
def job(tmp_path):
    """Two pours of spheres heaped on a cone, one that failed, and their runs."""
    random = np.random.default_rng(1)
    arrays = {}
    pours = []
    for seed, status in ((1, "ok"), (2, "jammed"), (3, "ok")):
        distance = 0.09 * np.sqrt(random.uniform(size=400))
        turn = random.uniform(0, 2 * math.pi, 400)
        z = 0.006 + random.uniform(size=400) * 0.05 * (1 - distance / 0.09)
        arrays[f"position_{seed}"] = np.column_stack(
            [distance * np.cos(turn), distance * np.sin(turn), z]
        )
        arrays[f"quaternion_{seed}"] = np.tile([1.0, 0, 0, 0], (400, 1))
        arrays[f"in_pile_{seed}"] = np.arange(400) >= 40
        pours.append({"seed": seed, "status": status})
    np.savez(tmp_path / "007.npz", **arrays)
    (tmp_path / "007.pours.json").write_text(json.dumps({"sample": 7, "pours": pours}))
    runs = pd.DataFrame(
        {"sample": 7, "seed": [1, 2, 3], "status": ["ok", "jammed", "ok"]}
    )
    for name in (response.name for response in list_responses("funnel")):
        if name not in further_responses.RESPONSE_NAMES:
            runs[name] = 30.0
    runs["reason"] = ""
    runs.to_csv(tmp_path / "runs.csv", index=False)
    return tmp_path


CONFIG = {
    "funnel": {"plate_diameter_mm": 600.0},
    "targets": [{"response": "aor_deg"}, {"response": "height_mm"}],
}
MEASURE = {
    "views": 2,
    "mm_per_pixel": 0.5,
    "response": "secant",
    "berry_height_mm": 12.0,
}
BALL = Particle(
    kind="ellipsoid",
    semi_axes_m=np.full((1, 3), 0.006),
    density_kg_m3=800.0,
    volume_m3=4 / 3 * math.pi * 0.006**3,
    mass_kg=7e-4,
    inertia_kg_m2=np.full(3, 1e-8),
    bounding_radius_m=0.006,
    deviation_max_m=0.0,
    deviation_rms_m=0.0,
)


def test_good_runs_of_a_job_are_measured_and_the_others_left_empty(job):
    config = CONFIG | {"measure": MEASURE}
    table = saved_piles.run(
        config, [job / "007.pours.json"], job / "runs.csv", BALL, {}, job / "out.csv"
    )
    assert table["status"].tolist() == ["ok", "jammed", "ok"]
    good = table["status"] == "ok"
    assert (
        table.loc[good, list(further_responses.RESPONSE_NAMES)].notna().all(axis=None)
    )
    assert (
        table.loc[~good, list(further_responses.RESPONSE_NAMES)].isna().all(axis=None)
    )
    assert table.loc[good, "loose_percent"].tolist() == [10.0, 10.0]
    expected = 90 * math.sqrt(0.9)
    assert table.loc[good, "radius_90_mm"].to_numpy() == pytest.approx(expected, abs=3)
    assert pd.read_csv(job / "out.csv").columns.tolist() == table.columns.tolist()


@pytest.mark.parametrize("definition", DEFINITIONS)
def test_the_table_keeps_the_definitions_that_are_offered(job, definition):
    config = CONFIG | {"measure": MEASURE | {"response": definition}}
    files = ([job / "007.pours.json"], job / "runs.csv")
    table = saved_piles.run(config, *files, BALL, {}, job / "out.csv")
    kept = {
        "sample",
        "seed",
        "status",
        *offered(("aor_deg", "height_mm"), definition),
    }
    assert set(table.columns) == {"aor_deg", "height_mm", *kept}


def test_a_run_without_its_pour_is_named(job):
    runs = pd.read_csv(job / "runs.csv")
    runs.loc[2, "seed"] = 99
    runs.to_csv(job / "runs.csv", index=False)
    with pytest.raises(InputError, match="99"):
        saved_piles.run(
            CONFIG | {"measure": MEASURE},
            [job / "007.pours.json"],
            job / "runs.csv",
            BALL,
            {},
            job / "out.csv",
        )


def test_runs_of_another_bench_test_are_kept_and_not_measured(job):
    runs = pd.read_csv(job / "runs.csv").assign(
        apparatus="funnel", drum_slip_deg=float("nan")
    )
    turned = runs.head(1).assign(apparatus="drum", drum_slip_deg=45.0)
    pd.concat([runs, turned]).to_csv(job / "runs.csv", index=False)
    config = CONFIG | {
        "targets": [*CONFIG["targets"], {"response": "drum_slip_deg"}],
        "measure": MEASURE,
    }
    files = ([job / "007.pours.json"], job / "runs.csv")
    table = saved_piles.run(config, *files, BALL, {}, job / "out.csv")
    assert table["drum_slip_deg"].tolist()[-1] == 45.0
    assert table["loose_percent"].isna().tolist() == [False, True, False, True]

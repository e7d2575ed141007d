"""Runs that are kept one by one: a further seed runs that seed only. No engine runs here."""

import shutil
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest
from refusals import input_error

from repose.bench import Scene, bench
from repose.bench.bench_test import Run
from repose.bench.parameters import PARAMETERS
from repose.common import places, provenance
from repose.config import dependencies
from repose.config.pipeline import PipelineConfig
from repose.stages import kept_runs
from repose.stages.job import run_job

CONFIG = PipelineConfig.load(places.find_program_folder() / "config/quick.yaml").config
SET = dict.fromkeys(PARAMETERS, 0.3)


class Stopped(Exception):
    """The end of a job before its runs are complete."""


@pytest.fixture
def pours():
    def pour(folder, seeds, config=CONFIG, parameters=SET, keeps_runs=True, stops=None):
        ran = []

        def run(scene, *_):
            seed = scene.seed
            if seed == stops:
                raise Stopped
            ran.append(seed)
            numbers = np.random.default_rng(seed).normal(size=(4, 3)).astype(np.float32)
            record = {
                "seed": seed,
                "status": "ok",
                "reason": "",
                "discharge_s": 0.1 * seed,
                "off": None,
            }
            return Run(record, {"position": numbers, "in_pile": numbers[:, 0] > 0})

        for path in folder.glob("001*.*"):  # as snakemake removes outputs
            path.unlink()
        test = SimpleNamespace(name="funnel", run=run)
        stage = provenance.record_stage(
            "pour",
            (),
            lambda configuration, _: dependencies.select_stage_settings(
                configuration, "pour"
            ),
            "funnel",
            "made",
        )
        with stage, suppress(Stopped):
            provenance.note_config(config)
            run_job(
                test,
                Scene.of(config, parameters, {}, None),
                "001",
                seeds,
                folder,
                keep_runs=keeps_runs,
            )
        return ran

    return pour


def test_a_further_seed_runs_that_seed_only_and_fewer_lose_none(pours, tmp_path):
    assert pours(tmp_path / "grown", [1, 2]) == [1, 2]
    assert pours(tmp_path / "grown", [1, 2, 3]) == [3]
    assert pours(tmp_path / "grown", [1, 2, 3]) == []
    pours(tmp_path / "fresh", [1, 2, 3], keeps_runs=False)
    for name in ("001.pours.json", "001.npz"):
        expected = (tmp_path / "fresh" / name).read_bytes()
        assert (tmp_path / "grown" / name).read_bytes() == expected
    assert not (tmp_path / "fresh" / "runs").exists()
    assert pours(tmp_path, [1, 2, 3]) == [1, 2, 3]
    assert pours(tmp_path, [1]) == []
    assert pours(tmp_path, [1, 2, 3, 4]) == [4]


def test_a_job_that_was_killed_goes_on(pours, tmp_path):
    assert pours(tmp_path, [1, 2, 3], stops=3) == [1, 2]
    assert not (tmp_path / "001.npz").exists()
    assert pours(tmp_path, [1, 2, 3]) == [3]
    assert (tmp_path / "001.npz").exists()


def test_each_run_is_kept_by_itself(pours, tmp_path):
    pours(tmp_path, [1, 2])
    names = {path.name for path in (tmp_path / "runs").iterdir()}
    assert names == {".repose", "001_1.npz", "001_2.npz"}
    (tmp_path / "runs/001_1.npz").unlink()
    assert pours(tmp_path, [1, 2]) == [1]


def test_a_run_of_other_settings_parameters_or_engine_is_made_again(
    pours, tmp_path, monkeypatch
):
    pours(tmp_path, [1])
    other = CONFIG | {"simulation": CONFIG["simulation"] | {"gravity_m_s2": 1.62}}
    assert pours(tmp_path, [1], other) == [1]
    assert pours(tmp_path, [1], other, SET | {"mus_gg": 0.4}) == [1]
    monkeypatch.setattr(provenance, "engine_hash", lambda: "edited")
    assert pours(tmp_path, [1], other, SET | {"mus_gg": 0.4}) == [1]


def test_a_damaged_run_never_reaches_a_result(pours, tmp_path):
    kept = "001_1.npz"
    pours(tmp_path / "kept", [1, 2], stops=2)
    pours(tmp_path / "right", [1, 2], keeps_runs=False)
    whole = (tmp_path / "kept/runs" / kept).read_bytes()
    damaged = [whole[: len(whole) // 2], b""]
    damaged += [
        whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :]
        for at in range(0, len(whole), 41)
    ]
    for number, content in enumerate(damaged):
        folder = tmp_path / str(number)
        shutil.copytree(tmp_path / "kept/runs", folder / "runs")
        (folder / "runs" / kept).write_bytes(content)
        assert pours(folder, [1, 2]) == [1, 2]
        for name in ("001.npz", "001.pours.json"):
            expected = (tmp_path / "right" / name).read_bytes()
            assert (folder / name).read_bytes() == expected


def test_a_run_that_somebody_changed_or_copied_is_made_again(pours, tmp_path):
    pours(tmp_path, [1, 2])
    first = tmp_path / "runs/001_1.npz"
    second = tmp_path / "runs/001_2.npz"
    right = (tmp_path / "001.npz").read_bytes()
    arrays = dict(np.load(second))
    second.write_bytes(first.read_bytes())
    assert pours(tmp_path, [1, 2]) == [2]
    for name, other in (
        ("position", arrays["position"] + 1),
        (kept_runs.DESCRIPTION_ARRAY, np.array("{")),
    ):
        np.savez(second, **{**arrays, name: other})
        assert pours(tmp_path, [1, 2]) == [2], name
        assert (tmp_path / "001.npz").read_bytes() == right


def test_without_a_stage_nothing_is_taken(pours, tmp_path):
    pours(tmp_path, [1])
    assert kept_runs.KeptRuns(tmp_path, "001", {}).read(1) is None


def test_a_pour_into_somebodys_file_is_refused_before_it_is_poured(tmp_path):
    (tmp_path / "heap.npz").write_text("mine")
    pour = bench("funnel"), Scene.of({}, {}, {}, None), "heap", [1], tmp_path
    input_error(r"heap\.npz: file is 'there already'", run_job, *pour)
    assert [path.name for path in tmp_path.iterdir()] == ["heap.npz"]

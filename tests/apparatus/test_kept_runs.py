"""Runs that are kept one by one: a further seed runs that seed only. No engine runs here."""

from types import SimpleNamespace

import numpy as np
import pytest

from repose.apparatus import bench, kept_runs
from repose.apparatus.bench_test import Run
from repose.apparatus.job import pour_job
from repose.config import stands_on
from repose.config.study import Study
from repose.core import places, provenance
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS

CONFIG = Study.load(places.root() / "config/quick.yaml").config
SET = dict.fromkeys(PARAMETERS, 0.3)


@pytest.fixture
def pours():
    """A function that pours with a bench test of no cost, and returns the seeds that it ran."""

    def pour(folder, seeds, config=CONFIG, parameters=SET, keeps_runs=True):
        ran = []

        def run(config, parameters, seed, *_):
            ran.append(seed)
            numbers = np.random.default_rng(seed).normal(size=(4, 3)).astype(np.float32)
            record = {"seed": seed, "status": "ok", "reason": "", "discharge_s": 0.1 * seed, "off": None}
            return Run(record, {"position": numbers, "in_pile": numbers[:, 0] > 0})

        test = SimpleNamespace(name="funnel", run=run)
        with provenance.stage(
            "pour", (), lambda one, _: stands_on.settings_of(one, "pour"), "funnel", "made"
        ):
            provenance.note_config(config)
            pour_job(test, config, "001", parameters, seeds, None, {}, folder, keeps_runs=keeps_runs)
        return ran

    return pour


def test_a_further_seed_runs_that_seed_only_and_gives_the_same_bytes(pours, tmp_path):
    assert pours(tmp_path / "grown", [1, 2]) == [1, 2]
    assert pours(tmp_path / "grown", [1, 2, 3]) == [3]
    assert pours(tmp_path / "grown", [1, 2, 3]) == []
    pours(tmp_path / "fresh", [1, 2, 3], keeps_runs=False)
    for name in ("001.pours.json", "001.npz"):
        assert (tmp_path / "grown" / name).read_bytes() == (tmp_path / "fresh" / name).read_bytes()
    assert not (tmp_path / "fresh" / "runs").exists()


def test_a_job_that_was_killed_goes_on(pours, tmp_path):
    pours(tmp_path, [1, 2])
    (tmp_path / "001.npz").unlink()
    (tmp_path / "001.pours.json").unlink()
    assert pours(tmp_path, [1, 2]) == []
    assert (tmp_path / "001.npz").exists()


def test_a_run_of_other_settings_parameters_or_engine_is_made_again(pours, tmp_path, monkeypatch):
    pours(tmp_path, [1])
    other = CONFIG | {"simulation": CONFIG["simulation"] | {"gravity_m_s2": 1.62}}
    assert pours(tmp_path, [1], other) == [1]
    assert pours(tmp_path, [1], other, SET | {"mus_gg": 0.4}) == [1]
    monkeypatch.setattr(provenance, "engine_hash", lambda: "edited")
    assert pours(tmp_path, [1], other, SET | {"mus_gg": 0.4}) == [1]


def test_a_damaged_run_never_reaches_a_result(pours, tmp_path):
    pours(tmp_path, [1])
    path, result = tmp_path / "runs" / "001_1.npz", tmp_path / "001.npz"
    whole, right = path.read_bytes(), result.read_bytes()
    for damaged in (whole[: len(whole) // 2], b""):
        path.write_bytes(damaged)
        assert pours(tmp_path, [1]) == [1]
        assert result.read_bytes() == right
    for at in range(0, len(whole), 41):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        pours(tmp_path, [1])
        assert result.read_bytes() == right, at


def test_a_run_that_somebody_changed_or_copied_is_made_again(pours, tmp_path):
    """With its record, by which it would be the same run."""
    pours(tmp_path, [1])
    first, second, right = (tmp_path / name for name in ("runs/001_1.npz", "runs/001_2.npz", "001.npz"))
    content = right.read_bytes()
    second.write_bytes(first.read_bytes())
    assert pours(tmp_path, [1, 2]) == [2]
    arrays = dict(np.load(first))
    for name, other in (("position", arrays["position"] + 1), (kept_runs.ABOUT, np.array("{"))):
        np.savez(first, **{**arrays, name: other})
        assert pours(tmp_path, [1]) == [1], name
        assert right.read_bytes() == content


def test_without_a_stage_nothing_is_taken(pours, tmp_path):
    pours(tmp_path, [1])
    assert kept_runs.read(tmp_path / "runs" / "001_1.npz", {}) is None


def test_a_pour_into_somebodys_file_is_refused_before_it_is_poured(tmp_path):
    (tmp_path / "heap.npz").write_text("mine")
    with pytest.raises(InputError, match=r"heap\.npz: file is 'there already'"):
        pour_job(bench("funnel"), {}, "heap", {}, [1], None, {}, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["heap.npz"]

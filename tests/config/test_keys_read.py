"""The keys of `dependencies.STAGE_KEYS` beside those that each stage reads, on made-up runs."""

import json
from functools import cached_property

import numpy as np
import pandas as pd
import pytest
from goji import PARTICLE
from recording import RecordedMapping, RecordedSection, entry_of, without_parents
from shared import good_run, write_jobs
from synthetic import responses, write_poured
from test_drum import saved
from test_simulated_piles import cone_of_berries

from repose.calibrate.strategies import strategy
from repose.calibrate.study import Study
from repose.cli import SUBCOMMANDS, USER_SUBCOMMANDS, make_parser
from repose.config import dependencies, loader
from repose.config.pipeline import PipelineConfig

pytestmark = [pytest.mark.slow, pytest.mark.essential]  # every stage is run once

# `next` needs runs of four sets in a further bench test, `simulate` a study with a program of the user's own.
NOT_RUN = {"next", "simulate"}
# strategies; here each proposes by a stage of its name
SEVERAL = (
    "sequential",
    "response_surface",
    "refined",
)
LISTED = dependencies.STAGE_KEYS | {name: strategy(name).reads for name in SEVERAL}
SMALL = {
    "surrogate": "gaussian_process",
    "miga": {
        "islands": 2,
        "population": 10,
        "rounds": 4,
        "generations": 2,
        "replicates": 2,
    },
    "posterior": {"walkers": 32, "steps": 100},
    "sensitivity": {"samples": 64, "resamples": 20},
    "sequential": {"probability": 0.05},
    "berry": {"particle": "ellipsoid"},
}


class RecordingConfig(PipelineConfig):
    """A configuration that records the keys that a stage reads."""

    def __init__(self, plain, keys):
        super().__init__(RecordedMapping(plain.config, keys), plain.source)
        vars(self).update(plain=plain, keys=keys)

    @cached_property
    def settings(self):
        return RecordedSection(self.plain.settings, self.keys)

    @property
    def definitions(self):
        """They change no result: files of other definitions are refused."""
        return self.plain.definitions

    def published(self, table):
        """The tables of published sets are inputs of the rules."""
        return self.plain.published(table)

    @cached_property
    def parameters(self):
        self.keys.add("parameters")
        return self.plain.parameters

    @cached_property
    def targets(self):
        self.keys.add("targets")
        return self.plain.targets

    def study(self, file=None):
        """The study of a strategy, whose settings are recorded.

        Its parameters, its targets and the name of its surrogate are handed over before
        the strategy is called.
        """
        plain = self.plain.study()
        settings = RecordedSection(plain.settings, self.keys)
        return Study.of(plain.parameters, plain.targets, settings, self.config, file)


@pytest.fixture(scope="module")
def plain():
    return PipelineConfig.load(
        "config/config.yaml", "config/quick.yaml", overrides=SMALL
    )


@pytest.fixture(scope="module")
def keys_of_scene(plain):
    """The keys whose values the hash of the scene stands for."""
    keys = set()
    dependencies.hash_scene(RecordedMapping(plain.config, keys))
    return keys


@pytest.fixture(scope="module")
def keys_read(plain, tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys")
    resolved = folder / "config.json"
    loader.write_resolved(plain.config, resolved)
    found = {}

    def run(verb, *positional, **options):
        """Run a stage as its rule does, without its record of provenance."""
        keys = found.setdefault(positional[0] if verb == "propose" else verb, set())
        named = [f"--{key}={value}" for key, value in options.items()]
        name = [verb] if verb in USER_SUBCOMMANDS else ["stage", verb]
        arguments = make_parser().parse_args(
            [*name, *map(str, positional), *named, f"--config={resolved}"]
        )
        SUBCOMMANDS[verb].run(arguments, RecordingConfig(plain, keys))

    def poured(samples_csv, out, seeds=2):
        write_poured(out, pd.read_csv(samples_csv), 2.0, len(str(out)), seeds)

    chain(run, folder)
    strategies(run, poured, folder)
    pictures(run, folder)
    return found


def measured(table, folder):
    first = iter(responses(table, 2.0, 0).tolist())
    second = iter(responses(table, 2.0, 1).tolist())

    def runs_of(_row):
        return [
            good_run(k, aor_deg=aor, height_mm=mm)
            for k, (aor, mm) in enumerate((next(first), next(second)))
        ]

    return write_jobs(table, folder, runs_of)


def chain(run, at):
    run("berry", out=at / "berry")
    run("shape", berry=at / "berry/berry.json", out=at / "berry")
    run("design", out=at / "design")
    jobs = measured(pd.read_csv(at / "design/samples.csv"), at / "heaps")
    run("dataset", *jobs, samples=at / "design/samples.csv", out=at)
    tables = {name: at / f"{name}.csv" for name in ("dataset", "runs")}
    run("network", **tables, out=at / "network")
    network = {"network": at / "network/network.json"}
    run("miga", **network, dataset=at / "dataset.csv", out=at / "miga")
    run("optimism", **network, **tables, out=at / "miga")
    run("solutions", feasible=at / "miga/feasible.csv", out=at / "validation")
    run("published_solutions", out=at / "validation")
    jobs = measured(
        pd.read_csv(at / "validation/published_solutions.csv"),
        at / "validation/published",
    )
    run("published_sets", *jobs, out=at)
    jobs = measured(
        pd.read_csv(at / "validation/solutions.csv"), at / "validation/heaps"
    )
    inputs = {
        "solutions": at / "validation/solutions.csv",
        "dataset": at / "dataset.csv",
    }
    inputs["optimism"] = at / "miga/optimism.csv"
    run("validate", *jobs, **inputs, out=at / "validation")
    run("noise", runs=at / "runs.csv", out=at / "noise")
    found = {
        "predictions": at / "network/predictions.csv",
        "feasible": at / "miga/feasible.csv",
    }
    run("posterior", **network, **tables, **found, out=at / "posterior")
    run("sensitivity", **network, out=at / "sensitivity")
    run("plausible", draws=at / "posterior/draws.csv", out=at / "next/samples.csv")


def strategies(run, poured, at):
    for name in SEVERAL:
        folders = [at] if name == "refined" else []
        while not (folders and is_answer(folders[-1])):
            folders.append(at / f"{name}/batch_{len(folders)}")
            run("propose", name, *folders[:-1], out=folders[-1])
            poured(folders[-1] / "samples.csv", folders[-1])
        run("conclude", name, *folders, out=at / name)
    batch = at / "sequential/batch_0"
    poured(batch / "samples.csv", at / "far")  # whose piles are out of reach
    for table in ("dataset", "runs"):
        rows = pd.read_csv(at / f"far/{table}.csv")
        rows.assign(height_mm=rows["height_mm"] + 40.0).to_csv(
            at / f"far/{table}.csv", index=False
        )
    run("propose", "sequential", at / "far", out=at / "far/batch_1")


def is_answer(folder):
    path = folder / "proposal.json"
    return path.exists() and json.loads(path.read_text())["answer"]


def pictures(run, at):
    centres, turned = cone_of_berries(30.0, np.random.default_rng(1), 200)
    np.savez(
        at / "001.npz",
        position_1=centres,
        quaternion_1=turned,
        in_pile_1=np.full(200, True),
    )
    PARTICLE.save(at / "particle.json")
    (at / "berry.json").write_text((at / "berry/berry.json").read_text())
    run(
        "silhouette", at / "001.npz", particle=at / "particle.json", out=at / "side.png"
    )
    grain = {"berry": at / "berry.json"}
    run(
        "measure_silhouette",
        at / "side.png",
        **grain,
        overlay=at / "over.png",
        out=at / "side.json",
    )
    slipped = saved(
        at, 1, 30.0, status="ok", before_turned_deg=1.0, after_turned_deg=3.0
    )
    with np.load(at / "drum_1.npz") as kept:
        arrays = dict(kept)
    arrays |= {
        f"{key}_{state}": arrays[key][0]
        for key in ("position", "quaternion")
        for state in ("before", "after")
    }
    np.savez(at / "drum_1.npz", **arrays)
    run("drum_tables", slipped, **grain, particle=at / "particle.json", out=at / "drum")


def test_every_stage_of_the_table_is_run_here(keys_read):
    assert set(keys_read) == LISTED.keys() - NOT_RUN


@pytest.mark.parametrize("verb", sorted(LISTED.keys() - NOT_RUN))
def test_a_stage_reads_the_keys_that_are_listed_and_no_others(
    verb, plain, keys_read, keys_of_scene
):
    listed = set(LISTED[verb])
    # A study has settings of its own, such as the noise of the user's simulator.
    read = {
        entry_of(key, listed)
        for key in without_parents(keys_read[verb])
        if key.partition(".")[0] in plain.config
    }
    if dependencies.SCENE in listed:
        assert keys_of_scene <= keys_read[verb]
        read -= {entry_of(key, listed) for key in keys_of_scene} - listed
        read.add(dependencies.SCENE)
    if verb in SEVERAL:
        # They are handed over before the strategy is called.
        read |= listed & {"parameters", "targets", "surrogate"}
    assert read == listed


def test_recorded_settings_name_the_keys_that_are_read(plain):
    keys = set()
    recorded = RecordingConfig(plain, keys)
    assert recorded.settings.miga.rounds == 4
    assert recorded.config["measure"]["views"] == plain.config["measure"]["views"]
    assert keys == {"miga.", "miga.rounds", "measure.", "measure.views"}
    assert without_parents(keys) == {"miga.rounds", "measure.views"}
    assert dict(recorded.settings.posterior) == dict(plain.settings.posterior)
    assert keys > {f"posterior.{name}" for name in plain.config["posterior"]}
    assert entry_of("miga.rounds", {"miga"}) == "miga"
    assert entry_of("miga.rounds", {"miga.rounds"}) == "miga.rounds"
    assert entry_of("drum.", {"drum"}) == "drum"
    assert entry_of("drum.", {"miga"}) == "drum"

"""The keys of `dependencies.KEYS` beside those that each stage reads, on made-up runs."""

import json
from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest
from goji import PARTICLE
from pydantic import BaseModel
from shared import good_run, write_jobs
from synthetic import responses, write_poured
from test_drum import saved
from test_simulated_piles import cone_of_berries

from repose.calibrate.responses import Response
from repose.calibrate.strategies import strategy
from repose.cli import TYPED, VERBS, parser
from repose.common import section
from repose.common.section import Section
from repose.config import dependencies, loader, models, pipeline
from repose.stages.published import find_sibling_table

pytestmark = [pytest.mark.slow, pytest.mark.essential]  # every stage is run once

NOT_RUN = {"next"}  # it needs runs of four sets in a further bench test
SEVERAL = (
    "sequential",
    "response_surface",
    "refined",
)  # strategies; here each proposes by a stage of its name
LISTED = dependencies.KEYS | {name: strategy(name).reads for name in SEVERAL}
SMALL = {
    "surrogate": "gaussian_process", "miga": {"islands": 2, "population": 10, "rounds": 4, "generations": 2},
    "posterior": {"walkers": 32, "steps": 100}, "sensitivity": {"samples": 64, "resamples": 20},
    "sequential": {"probability": 0.05}, "berry": {"particle": "ellipsoid"},
}  # fmt: skip


class Noted(Mapping, dict):
    """A mapping that notes the dotted keys which are read of it; reading a section is to read its keys."""

    def __init__(self, content, keys, prefix=""):
        dict.__init__(self, content)
        self.plain, self.keys_read, self.prefix = content, keys, prefix

    def __getitem__(self, key):
        value = dict.__getitem__(self, key)
        if isinstance(value, dict):
            return Noted(value, self.keys_read, f"{self.prefix}{key}.")
        self.keys_read.add(f"{self.prefix}{key}")
        return value

    def __iter__(self):  # without it dict(...) and ** would not call __getitem__
        return dict.__iter__(self)

    # to look whether a key is there is not to read it
    __len__, __contains__, __eq__ = dict.__len__, dict.__contains__, dict.__eq__

    def __or__(self, other):
        return dict(self.items()) | dict(other.items())

    def __ror__(self, other):
        return other | dict(self.items())


def is_section(field):
    """Whether a field of the whole configuration is a section."""
    kind = field.annotation
    return isinstance(kind, type) and issubclass(kind, Section)


def note_attributes(patch, keys):
    """Note also the keys that are read as attributes of typed sections, wherever these were made."""
    plain, fields = BaseModel.__getattribute__, models.settings_type().model_fields
    outside = {name for name, field in fields.items() if not is_section(field)}
    of_config, of_study = models.settings_of, pipeline.PipelineConfig.study
    valid_sections = models.valid_sections
    paused = []
    kinds = {
        name: field.annotation
        for name, field in fields.items()
        if isinstance(field.annotation, type)
    }
    sections = {
        kind: f"{name}." for name, kind in kinds.items() if issubclass(kind, Section)
    }

    def noting(section, name):
        value, kind = plain(section, name), type(section)
        # `dict` of a section, and its copies, read `__dict__`
        read = (
            kind.model_fields
            if name == "__dict__"
            else (name,)
            if name in kind.model_fields
            else ()
        )
        if kind in sections and not paused:
            keys.update(f"{sections[kind]}{key}" for key in read)
        if kind is models.settings_type() and name in outside and not paused:
            keys.add(name)
        return value

    def without_noting(function):
        """To make typed sections of a configuration, or a study of them, is no use of their keys."""

        def call(config, *more):
            paused.append(True)
            try:
                return function(config, *more)
            finally:
                paused.pop()

        return call

    def plain_of(function):
        return without_noting(
            lambda config, *more: function(getattr(config, "plain", config), *more)
        )

    patch.setattr(Section, "__getattribute__", noting)
    patch.setattr(models, "settings_of", plain_of(of_config))
    patch.setattr(dependencies, "valid_sections", plain_of(valid_sections))
    patch.setattr(pipeline.PipelineConfig, "study", without_noting(of_study))
    patch.setattr(
        section, "refuse", lambda _: None
    )  # a check of all keys is no use of them


def entry_of(key, listed):
    """The entry that lists a dotted key: it or its section; without one the key."""
    entries = (
        key,
        key.partition(".")[0],
        dependencies.RESPONSES if key == "targets" else key,
    )
    return next((entry for entry in entries if entry in listed), key)


@pytest.fixture(scope="module")
def keys_read(tmp_path_factory):
    folder, patch = tmp_path_factory.mktemp("keys"), pytest.MonkeyPatch()
    config = pipeline.PipelineConfig.load(
        "config/config.yaml", "config/quick.yaml", overrides=SMALL
    ).config
    config["results_dir"] = str(folder)
    loader.write_resolved(config, folder / "config.json")
    found, settings = {}, Response.settings

    def run(verb, *words, **options):
        """Run a stage as its rule does, without its record of provenance, which reads the listed keys."""
        keys = found.setdefault(words[0] if verb == "propose" else verb, set())
        patch.setattr(pipeline, "read_json", lambda path, what: Noted(config, keys))
        note_attributes(patch, keys)
        # no result depends on these: files of other definitions are refused, and a rule has its tables as inputs
        patch.setattr(
            Response, "settings", lambda response, _: settings(response, config)
        )
        patch.setattr(
            dependencies, "scene", lambda _: ""
        )  # the hash of the scene stands for its keys
        published = config["validation"]["published"]
        patch.setattr(
            pipeline.PipelineConfig,
            "published",
            lambda _, table: find_sibling_table(published, table),
        )
        given = [f"--{key}={value}" for key, value in options.items()]
        name = [verb] if verb in TYPED else ["stage", verb]
        given.append(f"--config={folder / 'config.json'}")
        VERBS[verb](parser().parse_args([*name, *map(str, words), *given]))

    def poured(samples_csv, out, seeds=2):
        write_poured(out, pd.read_csv(samples_csv), 2.0, len(str(out)), seeds)

    try:
        chain(run, folder)
        strategies(run, poured, folder)
        pictures(run, folder)
    finally:
        patch.undo()
    return found


def measured(table, folder):
    first, second = (iter(responses(table, 2.0, seed).tolist()) for seed in range(2))

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
    own = {"solutions": at / "validation/solutions.csv", "dataset": at / "dataset.csv"}
    run("validate", *jobs, **own, out=at / "validation")
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
        far = pd.read_csv(at / f"far/{table}.csv")
        far.assign(height_mm=far["height_mm"] + 40.0).to_csv(
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
def test_a_stage_reads_the_keys_that_are_listed_and_no_others(verb, keys_read):
    listed = set(LISTED[verb]) - {dependencies.SCENE, dependencies.MEASURED_BY}
    read = {entry_of(key, listed) for key in keys_read[verb]}
    if verb in SEVERAL:
        # The pipeline hands them over as objects, before the strategy is called.
        read |= listed & {"parameters", "surrogate"}
    assert read == listed

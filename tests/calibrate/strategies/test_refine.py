"""The refinement: proposals, added data, correction of any surrogate, and the whole loop with a free simulator."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from linear import Linear
from refusals import input_error, value_error
from shared import MIGA, good_run, studied, targets_of, write_jobs
from stage_runs import answer_of, conclude, propose, searched, trained
from synthetic import REFINE, Study, configuration

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate import training as train
from repose.calibrate.seeds import pour_seeds
from repose.calibrate.strategies import Answer
from repose.calibrate.strategies.refined import Refined, refine, rounds
from repose.calibrate.strategies.runs import runs_by_bench
from repose.calibrate.surrogates import load, make, names
from repose.calibrate.surrogates.support import Support
from repose.stages import batches, dataset

RANGES = {name: [0.0, 1.0] for name in PARAMETERS}
RANGES |= {"e_gg": [0.01, 0.99], "mus_gg": [2.0, 6.0], "e_gp": [0.01, 0.99]}
SPACE = contact_space(RANGES)
LOW, HIGH = SPACE.low, SPACE.high
SECTION = REFINE | {"rounds": 4, "reach": 0.1}
TARGETS = targets_of(aor_deg=30.0, height_mm=60.0)
MIDDLE = {name: sum(RANGES[name]) / 2 for name in PARAMETERS}


def flat(*names):
    return Linear(names, [{}] * len(names))


def solutions(**columns):
    return pd.DataFrame(
        [{"solution": 1, **MIDDLE, "representative": True, "warning": "", **columns}]
    )


def proposed(round_=0, space=SPACE, targets=TARGETS, table=None, **changes):
    table = solutions() if table is None else table
    study = Study(space, targets, {"refine": SECTION | changes, "design": {"seed": 7}})
    return refine.propose(table, flat(*targets.names), study, round_)


def test_the_box_is_cut_and_added_samples_leave_the_split_as_it_was():
    box = refine.search_box(
        SPACE, MIDDLE | {"e_gg": 0.05, "mus_gg": 4.0, "e_gp": 0.99}, 0.1
    )
    ends = dict(zip(box.free, zip(box.low, box.high, strict=True), strict=True))
    np.testing.assert_allclose(ends["e_gg"], [0.01, 0.148])
    np.testing.assert_allclose(ends["mus_gg"], [3.6, 4.4])
    np.testing.assert_allclose(ends["e_gp"], [0.892, 0.99])
    design = pd.DataFrame(
        {"sample": np.arange(1, 41), "round": pd.array([pd.NA] * 40, dtype="Int64")}
    )
    table = pd.concat(
        [design, pd.DataFrame({"sample": [1001, 1002, 2001], "round": [0, 0, 1]})]
    )
    before, after = (
        train.rows_of(design, [0.7, 0.15, 0.15], 3),
        train.rows_of(table, [0.7, 0.15, 0.15], 3),
    )
    for name in ("validation", "test"):
        np.testing.assert_array_equal(after[name], before[name])
    np.testing.assert_array_equal(after["train"], [*before["train"], 40, 41, 42])


def test_the_proposal_is_the_representative_and_neighbours_that_keep_fixed_parameters():
    table = proposed()
    assert (
        table[table["role"] == "proposal"][list(PARAMETERS)].to_numpy()
        == list(MIDDLE.values())
    ).all()
    near = table.loc[table["role"] == "neighbour", list(PARAMETERS)].to_numpy()
    unit = (near - LOW) / (HIGH - LOW) - 0.5
    assert (np.abs(unit) <= 0.1).all()
    assert (
        np.sort(np.floor((unit + 0.1) / 0.05), axis=0) == np.arange(4)[:, None]
    ).all(), "a Latin hypercube"
    assert (table[["aor_predicted_deg", "height_predicted_mm"]] == 30.0).all(axis=None)
    assert not np.allclose(
        near, proposed(1).loc[table["role"] == "neighbour", list(PARAMETERS)]
    )
    pd.testing.assert_frame_equal(table, proposed())
    assert set(proposed(neighbours=0)["role"]) == {"proposal"}
    space = contact_space(RANGES | {"e_gp": {"fixed": 0.5}, "mur_gp": {"fixed": 0.5}})
    table = proposed(space=space, targets=targets_of(drum_slip_deg=40.0))
    assert (table[["e_gp", "mur_gp"]] == 0.5).all(axis=None)
    assert (table["e_gg"].nunique(), list(table.columns)[-2:]) == (
        5,
        ["drum_slip_predicted_deg", "warning"],
    )
    table = proposed(table=solutions(warning="at a bound: e_gg low"))
    assert set(table.loc[table["role"] == "proposal", "warning"]) == {
        "at a bound: e_gg low"
    }
    assert set(table.loc[table["role"] == "neighbour", "warning"]) == {""}
    among_others = pd.concat(
        [solutions(warning=np.nan), solutions(warning="thin", representative=False)]
    )
    assert set(proposed(table=among_others)["warning"]) == {""}


@pytest.mark.parametrize(
    "names",
    [("drum_slip_deg",), ("aor_deg", "height_mm", "base_radius_mm", "drum_slip_deg")],
)
def test_the_correction_meets_the_samples_of_the_box_on_average_by_their_seeds(names):
    """A surrogate that gives 30 everywhere; response k of the samples is 29 + k and 33 + k, by 30 and 10 seeds."""
    rows = [
        {"sample": 1001 + k, **MIDDLE, "status": "ok", "n_seeds": n}
        for k, n in enumerate((30, 10, 8))
    ]
    table = pd.DataFrame(rows).assign(round=0)
    table = table.assign(
        **{name: [29.0 + k, 33.0 + k, 90.0] for k, name in enumerate(names)}
    )
    table.loc[2, "e_gg"] = 0.9  # outside the box
    designed = table.head(1).assign(sample=1, round=np.nan, **{names[0]: 10.0})
    table = pd.concat(
        [
            table,
            designed,
            table.head(1).assign(sample=1004, status="jammed", **{names[0]: np.nan}),
        ]
    )
    model, box = flat(*names), refine.search_box(SPACE, MIDDLE, 0.1)
    targets = targets_of(**dict.fromkeys(names, 30.0))
    corrected, offset, count = refine.correct_near(model, table, box, targets)
    wanted = (30 * -1 + 10 * 3) / 40 + np.arange(len(names))
    np.testing.assert_allclose(offset, wanted)
    np.testing.assert_allclose(
        corrected.predict(np.array([list(MIDDLE.values())])), [30 + wanted]
    )
    assert count == 2
    assert (model.constant == 30).all(), "the surrogate itself stays as it was"
    value_error(
        "at least one",
        refine.correct_near,
        model,
        table[table["round"].isna()],
        box,
        targets,
    )


@pytest.mark.parametrize("name", names())
def test_every_surrogate_can_be_corrected_and_is_saved_so(name, tmp_path):
    X = LOW + np.random.default_rng(2).random((60, 6)) * (HIGH - LOW)
    model = make(name, STUDY.settings.network).describe(PARAMETERS, TARGETS.names)
    model.fit(X, np.column_stack([X[:, 0] + 30, 60 - X[:, 2]]))
    rows = [{"sample": 1001, **MIDDLE, "status": "ok", "n_seeds": 8, "round": 0}]
    table = pd.DataFrame(rows).assign(aor_deg=35.0, height_mm=50.0)
    moved, offset, _ = refine.correct_near(
        model, table, refine.search_box(SPACE, MIDDLE, 0.1), TARGETS
    )
    middle = np.array([list(MIDDLE.values())])
    moved.save(tmp_path / "network.json")
    np.testing.assert_allclose(
        load(tmp_path / "network.json").predict(middle), [[35.0, 50.0]]
    )
    np.testing.assert_allclose(
        moved.predict(X) - model.predict(X), np.tile(offset, (60, 1))
    )
    np.testing.assert_allclose(moved.covariance(X), model.covariance(X))


# The whole loop

SPREAD = np.array([1.2, 2.4])
CONFIG = {
    "parameters": RANGES, "surrogate": "network", "design": {"samples": 60, "seed": 7}, "funnel": {"seeds": 6},
    "refine": SECTION | {"seeds": 200, "block": 50, "neighbours": 6, "neighbour_seeds": 20},
    "network": {"hidden": 4, "epochs": 150, "goal": 1e-4, "starts": 2, "seed": 1, "split": [0.7, 0.15, 0.15]},
    "miga": MIGA | {"islands": 2, "answer": "least_objective", "population": 20, "rounds": 15},
}  # fmt: skip
CONFIG["network"] |= {"replicates": True}
CONFIG["miga"] |= {
    "mutation_probability": 0.1,
    "solutions": 10,
    "distance": 0.02,
    "seed": 3,
}


class Simulator:
    """Piles of a smooth law with a hump that a network of four neurons on sixty samples does not see, and noise."""

    def __init__(self, hump=1.0, lift=0.0):
        self.hump, self.lift, self.poured = hump, lift, []

    def mean(self, parameters):
        unit = (np.array([parameters[name] for name in PARAMETERS]) - LOW) / (
            HIGH - LOW
        )
        aor = 24 + 3 * unit[1] + 4 * unit[2] + 5 * unit[4] + 2 * unit[5]
        height = 52 + 2 * unit[0] + 7 * unit[2] + 6 * unit[4] - unit[5]
        hump = self.hump * np.cos(5 * (unit[2] + unit[4]))
        return np.array([aor + hump + self.lift, height - 2 * hump])

    def run(self, row, seed):
        self.poured.append(seed)
        angle, height = self.mean(row) + SPREAD * np.random.default_rng(seed).normal(
            size=2
        )
        return good_run(seed, aor_deg=angle, height_mm=height)

    def pour(self, table, purpose, folder):
        def runs_of(row):
            return [
                self.run(row, seed)
                for seed in pour_seeds(7, purpose, row["sample"], row["seeds"])
            ]

        return write_jobs(table, folder, runs_of)


STUDY = Study(SPACE, TARGETS, CONFIG)


def designed(simulator, out):
    table = pd.DataFrame(
        LOW + np.random.default_rng(5).random((60, 6)) * (HIGH - LOW),
        columns=list(PARAMETERS),
    )
    table.insert(0, "sample", np.arange(1, 61))
    table.to_csv(out / "samples.csv", index=False)
    dataset.run(
        out / "samples.csv",
        simulator.pour(table.assign(seeds=6), "design", out / "heaps"),
        TARGETS,
        {},
        out,
    )


def closed(simulator, out, limit):
    """The whole loop, stage by stage as the workflow's rules have it; verdicts of all rounds."""
    designed(simulator, out)
    study = STUDY._replace(
        config=CONFIG | {"refine": CONFIG["refine"] | {"rounds": limit}}
    )
    verdicts, folders, found = [], [out], {"answer": False}
    while not found["answer"]:
        own = out / "refined" / f"batch_{len(folders)}"
        found = propose("refined", study, folders, own)
        verdicts += [found["notes"]["row"]] if "row" in found["notes"] else []
        folders.append(own)
        if not found["answer"]:
            table = pd.read_csv(own / "samples.csv")
            dataset.run(
                own / "samples.csv",
                simulator.pour(table, "refined", own / "heaps"),
                TARGETS,
                {},
                own,
            )
    conclude("refined", study, folders, out / "refined")
    return verdicts


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    out, simulator = tmp_path_factory.mktemp("loop"), Simulator(hump=1.5)
    return out / "refined", simulator, closed(simulator, out, 6)


def test_the_loop_brings_a_wrong_network_to_the_target_with_fresh_seeds_and_says_what_happened(
    loop,
):
    out, simulator, verdicts = loop
    assert (verdicts[0]["outcome"], verdicts[-1]["outcome"]) == ("not within", "within")
    wanted = TARGETS.aim
    off = [np.abs(simulator.mean(row) / wanted - 1).max() for row in verdicts]
    assert off[0] > 0.015, "the true mean, which the loop never sees"
    assert off[-1] < 0.012
    assert len(simulator.poured) == 360 + len(verdicts) * (200 + 6 * 20)
    assert len(set(simulator.poured)) == len(simulator.poured)
    table = pd.read_csv(out / "batches.csv")
    assert list(table["round"]) == list(range(len(verdicts)))
    assert (
        table.loc[table["outcome"] == "not within", "reason"]
        .str.contains("standard errors")
        .all()
    )
    summary = json.loads((out / "summary.json").read_text())
    assert summary["met"] is True
    assert "200 fresh seeds, in no fit before" in summary["claim"]
    points = pd.read_csv(out / "batch_1" / "samples.csv")
    assert (list(points["role"]), list(points["seeds"])) == (
        4 * ["proposal"] + 6 * ["neighbour"],
        4 * [50] + 6 * [20],
    )
    check = pd.read_csv(out / "check.csv")
    assert list(check["simulated"]) == pytest.approx(
        [verdicts[-1][one.response.simulated] for one in TARGETS]
    )
    assert list(check["predicted"]) == pytest.approx(
        [verdicts[-1][name] for name in TARGETS.predicted]
    )
    assert summary["check_pours"] == 200
    search = json.loads((out / "batch_2" / "proposal.json").read_text())["notes"][
        "search"
    ]
    assert search["reach"] in {0.0125, 0.025, 0.05, 0.1}


def test_round_0_is_the_answer_of_the_chain_and_the_loop_of_a_study_is_that_of_the_files(
    loop,
):
    out = loop[0].parent
    trained(out / "dataset.csv", out / "runs.csv", STUDY, out / "network")
    support = Support.of_dataset(out / "dataset.csv", SPACE)
    searched(out / "network" / "network.json", STUDY, None, out / "miga", support)
    notes = json.loads((out / "refined/batch_1/proposal.json").read_text())["notes"]
    for name, note in (
        ("network/metrics.json", "fit"),
        ("miga/summary.json", "search"),
    ):
        whole = json.loads((out / name).read_text())
        assert len(notes[note]) > 5
        assert {key: whole[key] for key in notes[note]} == notes[note]
    found = pd.read_csv(out / "miga/feasible.csv").query("representative")
    given = pd.read_csv(out / "refined/batch_1/samples.csv")
    assert (
        given[list(PARAMETERS)].iloc[0].tolist()
        == found[list(PARAMETERS)].iloc[0].tolist()
    )
    out, _, verdicts = loop
    folders = [out.parent, *(out / f"batch_{k + 1}" for k in range(len(verdicts)))]
    for k in range(len(verdicts)):
        batch = Refined().propose(STUDY, batches.read(folders[: k + 1], TARGETS))
        table = pd.read_csv(folders[k + 1] / "samples.csv")
        pd.testing.assert_frame_equal(
            batch.samples.drop(columns="warning"), table.drop(columns="warning")
        )
    found = Refined().propose(STUDY, batches.read(folders, TARGETS))
    assert isinstance(found, Answer)
    summary = json.loads((out / "summary.json").read_text())
    assert found.why == summary["why"]
    np.testing.assert_allclose(found.values, list(summary["solution"].values()))


def test_runs_of_another_definition_or_numbers_are_refused(loop, tmp_path):
    folders = [loop[0].parent, loop[0] / "batch_1"]
    for folder, name in zip(folders, ("a", "b"), strict=True):
        shutil.copytree(
            folder, tmp_path / name, ignore=shutil.ignore_patterns("heaps", "refined")
        )
    copies = [tmp_path / "a", tmp_path / "b"]
    summary = copies[1] / "dataset_summary.json"
    content, flank = (
        json.loads(summary.read_text()),
        {"aor_deg": {"measure.response": "flank"}},
    )
    summary.write_text(json.dumps(content | {"definitions": flank}))
    other = STUDY._replace(definitions={"aor_deg": {"measure.response": "secant"}})
    many = STUDY._replace(config=CONFIG | {"design": {"samples": 1000, "seed": 7}})
    for one, given, words in (
        (other, copies, r"b/dataset_summary\.json: definition of aor_deg"),
        (
            STUDY,
            [*folders, folders[1]],
            r"batch_1/dataset\.csv: sample is 1001; expected in one batch alone",
        ),
        (many, folders[:1], r"design\.samples is 1000; expected below 1000"),
    ):
        input_error(words, propose, "refined", one, given, tmp_path)


def test_a_target_out_of_reach_ends_at_the_limit_and_the_answer_says_what_is_met(
    tmp_path, loop
):
    verdicts = closed(Simulator(lift=-15.0), tmp_path, 1)
    assert [row["outcome"] for row in verdicts] == ["not within"] * 2
    summary = json.loads((tmp_path / "refined" / "summary.json").read_text())
    assert summary["met"] is False
    assert (
        "the limit of 1 refits is reached, and round 1 is not within: AoR"
        in summary["why"]
    )
    # a study stops there if its last round came no nearer, as the rules do
    data = batches.read(
        [tmp_path, *(tmp_path / f"refined/batch_{k}" for k in (1, 2))], TARGETS
    )
    jobs, runs = rounds.jobs(STUDY.settings.refine, 0), runs_by_bench(data, TARGETS)
    assert rounds.objective_of(jobs, runs, TARGETS) == pytest.approx(
        verdicts[0]["objective"], rel=1e-12
    )
    found = Refined().propose(STUDY, data)
    assert verdicts[1]["out_of_reach"]
    assert isinstance(found, Answer) == rounds.stuck(verdicts[1], verdicts[0])
    out, _, verdicts = loop
    folders = [out.parent, *(out / f"batch_{k + 1}" for k in range(len(verdicts) + 1))]
    early = r"proposal\.json: answer is False; expected true in the last folder"
    input_error(early, conclude, "refined", STUDY, folders[:-1], out)
    files = (
        out / name for name in ("summary.json", "representative.csv", "solutions.csv")
    )
    text = str(
        answer_of(studied(configuration(TARGETS, SPACE), strategy="refined"), *files)
    )
    assert text.splitlines()[0].startswith("made_up: targets met. Angle of repose ")
    assert text.endswith(
        f"\nNo more batches: round {len(verdicts) - 1} meets both targets."
    )
    assert "(runs: 200)" in text

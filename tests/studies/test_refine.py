"""The loop closed: its parts on made-up numbers, and the whole of it with a simulator that costs nothing."""

import json
from itertools import chain

import numpy as np
import pandas as pd
import pytest
from shared import TARGETS

from repose.chain import dataset, train
from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS
from repose.core.seeds import pour_seeds
from repose.search import miga
from repose.studies import refine
from repose.surrogate.bayesian_bp import evaluate

RANGES = {name: [0.0, 1.0] for name in PARAMETERS} | {"mus_gg": [2.0, 6.0]}
LOW, HIGH = np.array([RANGES[name] for name in PARAMETERS]).T
SECTION = {
    "rounds": 4,
    "seeds": 20,
    "block": 8,
    "neighbours": 4,
    "neighbour_seeds": 3,
    "reach": 0.1,
    "tolerance_percent": 1.0,
    "standard_error_percent": 0.7,
}
TARGET = {
    "aor_deg": 30.0,
    "height_mm": 60.0,
    "aor_range_deg": [28.0, 32.0],
    "height_range_mm": [57.0, 63.0],
}
MIDDLE = {name: sum(RANGES[name]) / 2 for name in PARAMETERS}
# a network of one neuron that gives 30 deg and 60 mm everywhere
FLAT = {
    "inputs": list(PARAMETERS),
    "outputs": ["aor_deg", "height_mm"],
    "W1": [[0.0] * 6],
    "b1": [0.0],
    "W2": [[0.0], [0.0]],
    "b2": [0.5, 0.5],
    "input_min": LOW.tolist(),
    "input_max": HIGH.tolist(),
    "output_min": [20.0, 50.0],
    "output_max": [40.0, 70.0],
    "scaled_range": [0.0, 1.0],
    "activation": ["tansig", "purelin"],
}


def solutions(**columns):
    """A search's table with one solution in the middle of the ranges, the representative."""
    return pd.DataFrame([{"solution": 1, **MIDDLE, "representative": True, "warning": "", **columns}])


def proposed(round_=0, **changes):
    return refine.propose(solutions(), FLAT, RANGES, SECTION | changes, round_, 7)


def runs_of(samples, aor_deg, height_mm):
    """Runs, all ok, of one sample a value."""
    rows = [
        {"sample": sample, "seed": seed, "status": "ok", "reason": "", "aor_deg": a, "height_mm": h}
        for seed, (sample, a, h) in enumerate(zip(samples, aor_deg, height_mm, strict=True))
    ]
    return pd.DataFrame(rows)


def judged(aor_deg, height_mm, **changes):
    """Verdict of round 0 whose proposal was poured with these results, in two blocks."""
    proposal = proposed(seeds=len(aor_deg), block=len(aor_deg) - 1)
    samples = [1001] * (len(aor_deg) - 1) + [1002]
    noise = runs_of([1101], [99.0], [99.0])  # a neighbour, which has no say
    runs = pd.concat([runs_of(samples, aor_deg, height_mm), noise])
    return refine.judge(proposal, runs, TARGET, SECTION | changes, 0)


def test_a_round_is_cut_into_blocks_of_its_seeds_and_neighbours():
    jobs = refine.jobs(SECTION, 2)
    assert jobs[:3] == [(3001, "proposal", 8), (3002, "proposal", 8), (3003, "proposal", 4)]
    assert jobs[3:] == [(number, "neighbour", 3) for number in (3101, 3102, 3103, 3104)]
    assert [refine.round_of(number) for number in (1001, 3104, 150)] == [0, 2, -1]


def test_no_seed_of_a_round_was_used_before():
    seeds = [
        pour_seeds(2026, "refine", sample, count)
        for round_ in range(4)
        for sample, _, count in refine.jobs(SECTION, round_)
    ]
    seeds.append(pour_seeds(2026, "validation", 1, 32))
    seeds += [pour_seeds(2026, "design", sample, 6) for sample in range(1, 151)]
    every = list(chain.from_iterable(seeds))
    assert len(every) == 4 * 32 + 32 + 900
    assert len(set(every)) == len(every)


def test_the_box_is_cut_to_the_ranges():
    box = refine.search_box(RANGES, MIDDLE | {"e_gg": 0.05, "mus_gg": 4.0, "e_gp": 1.0}, 0.1)
    np.testing.assert_allclose(box["e_gg"], [0.0, 0.15])
    np.testing.assert_allclose(box["mus_gg"], [3.6, 4.4])
    np.testing.assert_allclose(box["e_gp"], [0.9, 1.0])


def test_the_proposal_is_the_representative_and_its_neighbours_fill_the_next_box():
    table = proposed()
    own = table[table["role"] == "proposal"]
    assert (own[list(PARAMETERS)].to_numpy() == list(MIDDLE.values())).all()
    near = table.loc[table["role"] == "neighbour", list(PARAMETERS)].to_numpy()
    unit = (near - LOW) / (HIGH - LOW) - 0.5
    assert (np.abs(unit) <= 0.1).all()
    strata = np.sort(np.floor((unit + 0.1) / 0.05), axis=0)
    assert (strata == np.arange(4)[:, None]).all(), "a Latin hypercube"
    np.testing.assert_allclose(
        table[["aor_predicted_deg", "height_predicted_mm"]], [[30.0, 60.0]] * len(table)
    )
    assert not np.allclose(near, proposed(1).loc[table["role"] == "neighbour", list(PARAMETERS)])
    pd.testing.assert_frame_equal(table, proposed())
    assert set(proposed(neighbours=0)["role"]) == {"proposal"}


def test_a_warning_of_the_search_goes_with_the_proposal_alone():
    table = refine.propose(solutions(warning="at a bound: e_gg low"), FLAT, RANGES, SECTION, 0, 7)
    assert set(table.loc[table["role"] == "proposal", "warning"]) == {"at a bound: e_gg low"}
    assert set(table.loc[table["role"] == "neighbour", "warning"]) == {""}
    among_others = pd.concat([solutions(warning=np.nan), solutions(warning="thin", representative=False)])
    silent = refine.propose(among_others, FLAT, RANGES, SECTION, 0, 7)
    assert set(silent["warning"]) == {""}


def test_added_samples_train_and_leave_the_design_split_as_it_was():
    design = pd.DataFrame({"sample": np.arange(1, 41), "status": "ok"})
    rounds = [pd.DataFrame({"sample": [1001, 1002], "status": "ok"}), pd.DataFrame({"sample": [2001]})]
    table = refine.extended(design, rounds)
    assert table["round"].isna().sum() == 40
    assert list(table["round"].dropna()) == [0, 0, 1]
    before = train.rows_of(design, [0.7, 0.15, 0.15], 3)
    after = train.rows_of(table, [0.7, 0.15, 0.15], 3)
    for name in ("validation", "test"):
        np.testing.assert_array_equal(after[name], before[name])
    np.testing.assert_array_equal(after["train"], [*before["train"], 40, 41, 42])


@pytest.mark.parametrize("rounds", [[[1001], [1001]], [[150]]])
def test_samples_that_are_numbered_alike_are_refused(rounds):
    design = pd.DataFrame({"sample": np.arange(1, 151)})
    with pytest.raises(ValueError, match="allowed"):
        refine.extended(design, [pd.DataFrame({"sample": one}) for one in rounds])


def test_the_correction_meets_the_samples_of_the_box_on_average_by_their_seeds():
    rows = [{"sample": 1001 + k, **MIDDLE, "status": "ok", "n_seeds": n} for k, n in enumerate((30, 10, 8))]
    table = pd.DataFrame(rows).assign(aor_deg=[29.0, 33.0, 90.0], height_mm=[62.0, 58.0, 90.0], round=0)
    table.loc[2, "e_gg"] = 0.9  # outside the box
    designed = table.head(1).assign(sample=1, round=np.nan, aor_deg=10.0)
    failed = table.head(1).assign(sample=1004, status="jammed", aor_deg=np.nan)
    table = pd.concat([table, designed, failed])
    box = refine.search_box(RANGES, MIDDLE, 0.1)
    network, offset, count = refine.corrected(FLAT, table, box)
    np.testing.assert_allclose(offset, [(30 * -1 + 10 * 3) / 40, (30 * 2 - 10 * 2) / 40])
    np.testing.assert_allclose(evaluate(network, np.array([list(MIDDLE.values())])), [[30.0, 61.0]])
    assert count == 2
    assert FLAT["b2"] == [0.5, 0.5]
    with pytest.raises(ValueError, match="at least one"):
        refine.corrected(FLAT, table[table["round"].isna()], box)


def test_a_round_within_both_bars_is_within():
    verdict = judged([30.1, 30.3, 30.2, 30.2], [60.2, 59.8, 60.0, 60.0])
    assert (verdict["outcome"], verdict["reason"], verdict["n_seeds"]) == ("within", "", 4)
    assert verdict["aor_deviation_percent"] == pytest.approx(100 * 0.2 / 30)
    assert verdict["aor_se_deg"] == pytest.approx(np.std([30.1, 30.3, 30.2, 30.2], ddof=1) / 2)
    assert verdict["aor_deviation_se"] == pytest.approx(0.2 / verdict["aor_se_deg"])


def test_a_round_that_misses_says_by_how_much_each_response_is_off():
    verdict = judged([30.6, 31.0, 30.8, 30.8], [58.8, 59.2, 59.0, 59.0])
    assert verdict["outcome"] == "not within"
    assert verdict["reason"] == (
        "AoR 30.80 deg is 2.67 % (9.8 standard errors) above 30 deg; "
        "Height 59.00 mm is 1.67 % (12.2 standard errors) below 60 mm"
    )
    alone = judged([30.6, 31.0, 30.8, 30.8], [60.2, 59.8, 60.3, 60.3])
    assert alone["outcome"] == "not within"
    assert alone["reason"].endswith("Height 60.15 mm is 0.25 % (1.3 standard errors) above 60 mm, within 1 %")


def test_a_mean_that_is_near_by_luck_is_not_precise_enough():
    verdict = judged([28.0, 32.0, 30.0, 30.0], [60.2, 59.8, 60.0, 60.0])
    assert verdict["outcome"] == "not precise"
    assert "its standard error is 2.72 %, not below 0.7 %" in verdict["reason"]
    single = judged([30.0, 30.0], [60.0, 60.0], standard_error_percent=1e-9)
    assert single["outcome"] == "within", "a standard error of nought is below any"


def test_a_proposal_without_a_pile_has_an_outcome_of_its_own():
    runs = runs_of([1001, 1002], [30.0, 30.0], [60.0, 60.0]).assign(status="jammed", reason="stuck")
    verdict = refine.judge(proposed(seeds=2, block=1), runs, TARGET, SECTION, 0)
    assert verdict["outcome"] == "no pile"
    assert verdict["reason"] == "jammed: 2 of 2 runs jammed (stuck)"
    assert np.isnan(verdict["aor_simulated_deg"])


def test_the_loop_goes_on_while_there_is_something_to_learn():
    missed = {"round": 1, "outcome": "not within", "reason": "AoR off", "usable": 3}
    assert refine.goes_on(missed)
    assert "limit of 1 refits is reached, and round 1 is not within: AoR off" in refine.why_stopped(missed, 1)
    assert not refine.goes_on(missed | {"outcome": "within"})
    assert refine.why_stopped(missed | {"outcome": "within"}, 4) == "round 1 meets both targets"
    empty = missed | {"outcome": "no pile", "usable": 0}
    assert not refine.goes_on(empty)
    assert "no pile to learn from" in refine.why_stopped(empty, 4)


def test_rounds_with_a_gap_are_refused(tmp_path):
    (tmp_path / "verdict.json").write_text('{"round": 1, "outcome": "within"}')
    with pytest.raises(InputError, match="without a gap"):
        refine.write_tables([tmp_path / "verdict.json"], 4, tmp_path)


# The whole loop

SPREAD = np.array([1.2, 2.4])
CONFIG = {
    "parameters": RANGES,
    "targets": [
        TARGETS[0] | {"value": 30.0, "range": [28.0, 32.0]},
        TARGETS[1] | {"value": 60.0, "range": [57.0, 63.0]},
    ],
    "refine": SECTION | {"seeds": 200, "block": 50, "neighbours": 6, "neighbour_seeds": 20},
    "network": {
        "hidden": 4,
        "epochs": 150,
        "goal": 1e-4,
        "starts": 2,
        "seed": 1,
        "split": [0.7, 0.15, 0.15],
        "weights_from_errors": True,
    },
    "miga": {
        "islands": 2,
        "population": 20,
        "rounds": 15,
        "generations": 10,
        "tournament": 3,
        "mutation_probability": 0.1,
        "mutation_amplitude": 0.1,
        "solutions": 10,
        "distance": 0.02,
        "seed": 3,
    },
}


class Simulator:
    """Piles of a smooth law with a hump that a network of four neurons on sixty samples does not see, and noise."""

    def __init__(self, hump=1.0, lift=0.0):
        self.hump, self.lift, self.poured = hump, lift, []

    def mean(self, parameters):
        unit = (np.array([parameters[name] for name in PARAMETERS]) - LOW) / (HIGH - LOW)
        aor = 24 + 3 * unit[1] + 4 * unit[2] + 5 * unit[4] + 2 * unit[5]
        height = 52 + 2 * unit[0] + 7 * unit[2] + 6 * unit[4] - unit[5]
        hump = self.hump * np.cos(5 * (unit[2] + unit[4]))
        return np.array([aor + hump + self.lift, height - 2 * hump])

    def pour(self, table, seeds, purpose, folder):
        """A heap job's JSON file for each row of a table of samples; the paths."""
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        for row, count in zip(table.to_dict("records"), seeds, strict=True):
            runs = []
            for seed in pour_seeds(7, purpose, row["sample"], count):
                self.poured.append(seed)
                values = self.mean(row) + SPREAD * np.random.default_rng(seed).normal(size=2)
                runs.append({"seed": seed, "status": "ok", "reason": ""})
                runs[-1] |= dict(zip(("aor_deg", "height_mm"), values.tolist(), strict=True))
            parameters = {name: row[name] for name in PARAMETERS}
            paths.append(folder / f"{row['sample']}.json")
            paths[-1].write_text(
                json.dumps({"sample": row["sample"], "parameters": parameters, "runs": runs})
            )
        return paths


def study(simulator, out):
    """The main chain up to the search: a design, its network, its solutions; the folder of the published table."""
    rng = np.random.default_rng(5)
    table = pd.DataFrame(LOW + rng.random((60, 6)) * (HIGH - LOW), columns=list(PARAMETERS))
    table.insert(0, "sample", np.arange(1, 61))
    table.to_csv(out / "samples.csv", index=False)
    dataset.run(out / "samples.csv", simulator.pour(table, [6] * 60, "design", out / "heaps"), out)
    intervals = pd.DataFrame({"parameter": PARAMETERS, "low": LOW, "high": HIGH, "dispersion_percent": 0.0})
    intervals.to_csv(out / "table3.csv", index=False)
    train.run(out / "dataset.csv", out / "runs.csv", CONFIG["network"], out / "network")
    network = out / "network" / "network.json"
    miga.run(network, RANGES, TARGET, CONFIG["miga"], out / "table3.csv", out / "miga")
    return network, out / "miga" / "feasible.csv"


def closed(simulator, out, rounds):
    """The whole loop, stage by stage as the workflow's rules have it; verdicts of all rounds."""
    network, feasible = study(simulator, out)
    verdicts, folders = [], []
    for k in range(rounds + 1):
        own = out / "refined" / f"round_{k}"
        if k:
            refine.write_extended(out / "dataset.csv", out / "runs.csv", folders, own / "data")
            data = own / "data" / "dataset.csv"
            train.run(data, own / "data" / "runs.csv", CONFIG["network"], own / "network")
            near = folders[-1] / "proposal.csv"
            fitted = own / "network" / "network.json"
            refine.search(fitted, data, near, CONFIG, out / "table3.csv", own / "miga")
            network, feasible = own / "miga" / "network.json", own / "miga" / "feasible.csv"
        proposal = own / "proposal.csv"
        table = refine.write_proposal(feasible, network, RANGES, CONFIG["refine"], k, 7, proposal)
        dataset.run(proposal, simulator.pour(table, table["seeds"], "refine", own / "heaps"), own)
        files = (proposal, own / "dataset.csv", own / "runs.csv")
        verdicts.append(refine.write_verdict(*files, TARGET, CONFIG["refine"], own))
        folders.append(own)
        if not refine.goes_on(verdicts[-1]):
            break
    refine.write_tables([folder / "verdict.json" for folder in folders], rounds, out / "refined")
    return verdicts


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    out, simulator = tmp_path_factory.mktemp("loop"), Simulator(hump=1.5)
    return out / "refined", simulator, closed(simulator, out, 6)


def test_the_loop_brings_a_wrong_network_to_the_target(loop):
    _, simulator, verdicts = loop
    assert verdicts[0]["outcome"] == "not within"
    assert verdicts[-1]["outcome"] == "within"
    wanted = np.array([TARGET["aor_deg"], TARGET["height_mm"]])
    off = [np.abs(simulator.mean(verdict) / wanted - 1).max() for verdict in verdicts]
    assert off[0] > 0.015, "the true mean, which the loop never sees"
    assert off[-1] < 0.012


def test_every_pour_of_the_loop_had_a_seed_of_its_own(loop):
    _, simulator, verdicts = loop
    assert len(simulator.poured) == 360 + len(verdicts) * (200 + 6 * 20)
    assert len(set(simulator.poured)) == len(simulator.poured)


def test_the_tables_of_the_loop_say_what_happened(loop):
    out, _, verdicts = loop
    rounds = pd.read_csv(out / "rounds.csv")
    assert list(rounds["round"]) == list(range(len(verdicts)))
    assert rounds.loc[rounds["outcome"] == "not within", "reason"].str.contains("standard errors").all()
    summary = json.loads((out / "summary.json").read_text())
    assert summary["met"] is True
    assert "200 seeds, which no fit had seen" in summary["claim"]
    points = pd.read_csv(out / "round_0" / "round.csv")
    assert list(points["role"]) == ["proposal"] + 6 * ["neighbour"]
    assert list(points["n_seeds"]) == [200] + 6 * [20]
    assert points["aor_simulated_deg"].iloc[0] == pytest.approx(verdicts[0]["aor_simulated_deg"])
    search = json.loads((out / "round_1" / "miga" / "summary.json").read_text())
    assert search["reach"] in {0.0125, 0.025, 0.05, 0.1}


def test_a_target_out_of_reach_ends_at_the_limit_with_the_reason(tmp_path):
    simulator = Simulator(lift=-15.0)
    verdicts = closed(simulator, tmp_path, 1)
    assert [verdict["outcome"] for verdict in verdicts] == ["not within"] * 2
    summary = json.loads((tmp_path / "refined" / "summary.json").read_text())
    assert summary["met"] is False
    assert "the limit of 1 refits is reached, and round 1 is not within: AoR" in summary["why"]

"""Rounds and batches of a strategy."""

from functools import partial
from itertools import chain

import numpy as np
import pandas as pd
import pytest
from shared import RANGES, good_run, targets_of, write_jobs
from synthetic import REFINE as SECTION
from synthetic import SPACE, study

from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate.responses import response
from repose.calibrate.seeds import pour_seeds
from repose.calibrate.strategies.refined import RefineSettings, rounds
from repose.calibrate.strategies.runs import runs_by_bench, samples_of_runs
from repose.calibrate.strategies.sequential.strategy import arrange_runs
from repose.stages import batches, dataset

TARGETS = targets_of(aor_deg=30.0, height_mm=60.0)
FOUR = targets_of(
    aor_deg=30.0, height_mm=60.0, base_radius_mm=110.0, drum_slip_deg=40.0
)


def proposed(targets, seeds):
    table = pd.DataFrame(
        {"sample": [1001, 1002, 1101], "role": ["proposal", "proposal", "neighbour"]}
    )
    table = table.assign(
        **dict.fromkeys(PARAMETERS, 0.5), seeds=[seeds - 1, 1, 3], warning=""
    )
    return table.assign(**{one.response.predicted: one.value for one in targets})


def runs_of(samples, **responses):
    return pd.DataFrame({"sample": samples, "status": "ok", "reason": ""}).assign(
        **responses
    )


def judged(targets=TARGETS, section=SECTION, **responses):
    count = len(next(iter(responses.values())))
    noise = runs_of(
        [1101], **dict.fromkeys(responses, 99.0)
    )  # a neighbour, which has no say
    runs = pd.concat([runs_of([1001] * (count - 1) + [1002], **responses), noise])
    return rounds.judge(
        proposed(targets, count), runs, study(targets, refine=section), 0
    )


def test_a_round_is_cut_into_fresh_blocks_and_judged_by_both_bars():
    jobs = rounds.jobs(RefineSettings.model_construct(**SECTION), 2)
    assert jobs[:3] == [
        (3001, "proposal", 8),
        (3002, "proposal", 8),
        (3003, "proposal", 4),
    ]
    assert jobs[3:] == [(number, "neighbour", 3) for number in (3101, 3102, 3103, 3104)]
    assert [rounds.round_of(number) for number in (1001, 3104, 150)] == [0, 2, -1]
    jobs = chain.from_iterable(
        rounds.jobs(RefineSettings.model_construct(**SECTION), k) for k in range(4)
    )
    seeds = [pour_seeds(2026, "refined", sample, count) for sample, _, count in jobs]
    seeds.append(pour_seeds(2026, "validation", 1, 32))
    seeds += [pour_seeds(2026, "design", sample, 6) for sample in range(1, 151)]
    every = list(chain.from_iterable(seeds))
    assert (len(every), len(set(every))) == (4 * 32 + 32 + 900, len(every))
    row = judged(aor_deg=[30.1, 30.3, 30.2, 30.2], height_mm=[60.2, 59.8, 60.0, 60.0])
    assert (row["outcome"], row["reason"], row["n_seeds"]) == ("within", "", 4)
    assert row["aor_deviation_percent"] == pytest.approx(100 * 0.2 / 30)
    assert row["aor_se_deg"] == pytest.approx(
        np.std([30.1, 30.3, 30.2, 30.2], ddof=1) / 2
    )
    assert row["aor_deviation_se"] == pytest.approx(0.2 / row["aor_se_deg"])
    row = judged(aor_deg=[30.6, 31.0, 30.8, 30.8], height_mm=[58.8, 59.2, 59.0, 59.0])
    why = "AoR 30.80 deg is 2.67 % (9.8 standard errors) above 30 deg; "
    why += "Height 59.00 mm is 1.67 % (12.2 standard errors) below 60 mm"
    assert (row["outcome"], row["reason"]) == ("not within", why)
    alone = judged(aor_deg=[30.6, 31.0, 30.8, 30.8], height_mm=[60.2, 59.8, 60.3, 60.3])
    assert alone["outcome"] == "not within"
    assert alone["reason"].endswith(
        "Height 60.15 mm is 0.25 % (1.3 standard errors) above 60 mm, within 1 %"
    )
    row = judged(aor_deg=[28.0, 32.0, 30.0, 30.0], height_mm=[60.2, 59.8, 60.0, 60.0])
    assert row["outcome"] == "not precise"
    assert "its standard error is 2.72 %, not below 0.7 %" in row["reason"]
    single = judged(
        section=SECTION | {"standard_error_percent": 1e-9},
        aor_deg=[30.0, 30.0],
        height_mm=[60.0, 60.0],
    )
    assert single["outcome"] == "within", "a standard error of nought is below any"
    runs = runs_of([1001, 1002], aor_deg=30.0, height_mm=60.0).assign(
        status="jammed", reason="stuck"
    )
    row = rounds.judge(proposed(TARGETS, 2), runs, study(TARGETS, refine=SECTION), 0)
    assert (row["outcome"], row["reason"]) == (
        "no pile",
        "jammed: 2 of 2 runs jammed (stuck)",
    )
    assert np.isnan(row["aor_simulated_deg"])


def test_one_target_and_four_of_two_bench_tests():
    row = judged(targets_of(drum_slip_deg=40.0), drum_slip_deg=[40.2, 40.2, 40.0, 40.0])
    assert (row["outcome"], row["drum_slip_simulated_deg"]) == (
        "within",
        pytest.approx(40.1),
    )
    assert (
        rounds.why_stopped(row, 4, targets_of(drum_slip_deg=40.0))
        == "round 0 meets the target"
    )
    assert rounds.claim(row, targets_of(drum_slip_deg=40.0)).startswith(
        "slip 40.10 ± 0.06 deg (+0.25 %), mean"
    )
    seven = study(
        FOUR, contact_space(RANGES | {"gamma_gg": [0.0, 0.1]}), refine=SECTION
    )
    row = rounds.judge(
        proposed(FOUR, 4).assign(gamma_gg=0.05),
        of_two_bench_tests([40.0, 40.2, 44.0]),
        seven,
        0,
    )
    assert (row["poured"], row["n_seeds"], row["gamma_gg"]) == (7, 3, 0.05)
    assert (row["outcome"], row["base_radius_simulated_mm"]) == (
        "not within",
        pytest.approx(110),
    )
    assert row["drum_slip_se_deg"] == pytest.approx(
        np.std([40.0, 40.2, 44.0], ddof=1) / np.sqrt(3)
    )
    assert "slip 41.40 deg is 3.50 %" in row["reason"]
    failed = of_two_bench_tests([40.0, 40.2])
    failed.loc[failed["apparatus"] == "drum", ["status", "reason"]] = [
        "jammed",
        "stuck",
    ]
    row = rounds.judge(proposed(FOUR, 4), failed, study(FOUR, refine=SECTION), 0)
    assert (row["outcome"], row["reason"]) == (
        "no pile",
        "jammed: 2 of 2 runs jammed (stuck)",
    )
    assert (
        rounds.why_stopped(row | {"outcome": "within"}, 4, FOUR)
        == "round 0 meets all targets"
    )


def of_two_bench_tests(slip):
    """Runs of a proposal: four in the funnel, all on target, and one a value of slip in the drum."""
    funnel = runs_of(
        [1001] * 4, aor_deg=30.0, height_mm=60.0, base_radius_mm=110.0
    ).assign(apparatus="funnel")
    return pd.concat(
        [
            funnel,
            runs_of([1001] * len(slip), drum_slip_deg=slip).assign(apparatus="drum"),
        ]
    )


def test_the_loop_goes_on_while_it_learns_and_ends_out_of_reach():
    missed = {"round": 1, "outcome": "not within", "reason": "AoR off", "usable": 3}
    assert rounds.goes_on(missed)
    why = rounds.why_stopped(missed, 1, TARGETS)
    assert "limit of 1 refits is reached, and round 1 is not within: AoR off" in why
    assert not rounds.goes_on(missed | {"outcome": "within"})
    assert (
        rounds.why_stopped(missed | {"outcome": "within"}, 4, TARGETS)
        == "round 1 meets both targets"
    )
    empty = missed | {"outcome": "no pile", "usable": 0}
    assert not rounds.goes_on(empty)
    assert "no pile to learn from" in rounds.why_stopped(empty, 4, TARGETS)
    assert not judged(aor_deg=[29.0, 29.1, 28.9], height_mm=[60.0, 60.2, 59.8])[
        "out_of_reach"
    ]
    table = proposed(TARGETS, 3).assign(aor_predicted_deg=29.0)
    runs = runs_of([1001] * 3, aor_deg=[29.0, 29.1, 28.9], height_mm=[60.0, 60.2, 59.8])
    row = rounds.judge(table, runs, study(TARGETS, refine=SECTION), 1) | {"usable": 3}
    assert row["out_of_reach"]
    assert row["objective"] == pytest.approx(1 / (TARGETS.high - TARGETS.low)[0])
    nearer, farther = (
        row | {"objective": row["objective"] + off} for off in (-0.1, 0.1)
    )
    assert rounds.goes_on(row, farther)
    assert not rounds.goes_on(row, nearer)
    assert rounds.goes_on(row | {"out_of_reach": False}, nearer)
    assert "out of reach and came no nearer" in rounds.why_stopped(
        row, 4, TARGETS, nearer
    )
    assert "the limit of 4 refits" in rounds.why_stopped(row, 4, TARGETS, farther)


@pytest.mark.parametrize("names", [("height_mm",), ("height_mm", "drum_slip_deg")])
def test_samples_are_those_of_the_dataset_also_where_runs_failed(names, tmp_path):
    targets = targets_of(**dict.fromkeys(names, 60.0))
    good = {"height_mm": [(1, 1, 1), (1, 0, 1), (0, 0, 1), (1, 1, 1), (0, 0, 0)]}
    good |= {"drum_slip_deg": [(1, 1, 1), (1, 1, 0), (1, 1, 1), (0, 1, 0), (0, 0, 0)]}
    samples = pd.DataFrame(
        SPACE.values(np.random.default_rng(1).random((5, 6))), columns=list(PARAMETERS)
    )
    samples.insert(0, "sample", range(1, 6))
    samples.to_csv(tmp_path / "samples.csv", index=False)

    def runs_of(name, row):
        for seed, one in enumerate(good[name][row["sample"] - 1]):
            run = good_run(seed, **{name: 50.0 + row["sample"] + seed**2})
            yield (
                run
                if one
                else run | {"status": "not_at_rest", "reason": "moves", name: None}
            )

    jobs = []
    for name in names:
        jobs += write_jobs(
            samples,
            tmp_path,
            partial(runs_of, name),
            apparatus=response(name).apparatus,
        )
    dataset.run(tmp_path / "samples.csv", jobs, targets, {}, tmp_path)
    made, data = (
        pd.read_csv(tmp_path / "dataset.csv"),
        batches.read([tmp_path], targets),
    )
    assert runs_by_bench(data, targets)[
        "apparatus"
    ].value_counts().to_dict() == dict.fromkeys(targets.apparatus, 15)
    table = samples_of_runs(data, SPACE, targets)
    ok = made["status"] == "ok"
    assert ((table["status"] == "ok") == ok).all()
    assert (table["n_seeds"] == made["n_seeds"]).all()
    columns = ["sample", *PARAMETERS, *targets.names, *targets.errors]
    pd.testing.assert_frame_equal(
        table.loc[ok, columns], made.loc[ok, columns], check_dtype=False
    )
    observed = arrange_runs(data, SPACE, targets)
    assert len(data) == 15
    np.testing.assert_allclose(
        SPACE.values(observed.unit), samples.loc[ok, list(PARAMETERS)]
    )
    np.testing.assert_allclose(
        SPACE.values(observed.failed), samples.loc[~ok, list(PARAMETERS)]
    )

"""Whether two checkouts pour the same piles, as ensembles: a table of speed_history.md.

    python benchmarks/pour_ensembles.py pour FILE.npz [--seeds 64] [--processes 2]    in either checkout
    python benchmarks/pour_ensembles.py compare BEFORE.npz AFTER.npz                  in the newer one

Pours have the default's study at three parameter sets: the lowest and the highest end of each range, and the published
representative. One checkout measures all piles. Pours are chaotic, so the same seeds give other piles: means are
compared. All differences of a set together, d with covariance C of its mean, give d' C^-1 d, which has a chi-squared
distribution where both checkouts pour the same.
"""

import argparse
import multiprocessing
import time

import numpy as np
from scipy.stats import chi2

from repose.bench import Scene, funnel
from repose.bench.space import contact_space
from repose.config.pipeline import PipelineConfig
from repose.measure.pile import MeasureSettings
from repose.measure.saved_piles import pile_responses
from repose.stages import published

CONFIG = ("config/method.yaml", "config/config.yaml")
RESPONSES = (
    "aor_flank_deg",
    "aor_secant_deg",
    "aor_steepest_deg",
    "aor_whole_deg",
    "aor_straightest_deg",
    "height_mm",
    "base_radius_mm",
    "packing_percent",
    "radius_90_mm",
    "loose_percent",
)
KEPT = ("position", "quaternion", "in_pile", "scale")


def sets_of(study):
    """The parameter sets by name."""
    space = contact_space(study.config["parameters"])
    return {
        "lowest": space.centre | dict(zip(space.free, space.low.tolist(), strict=True)),
        "representative": published.read_representative(
            study.config["validation"]["published"]
        ),
        "highest": space.centre
        | dict(zip(space.free, space.high.tolist(), strict=True)),
    }


def pour_once(job):
    """A pour: its status, its processor time and its final state."""
    parameters, seed, config, particle, grain = job
    began = time.process_time()
    run = funnel.FunnelTest().run(Scene.of(config, parameters, grain, particle, seed))
    return (
        run.record["status"],
        time.process_time() - began,
        [run.arrays[name] for name in KEPT],
    )


def pour(path, seeds, processes):
    """Pour all seeds of all sets and write them to a file."""
    study = PipelineConfig.load(*CONFIG)
    common = study.config, study.particle, study.grain
    sets = sets_of(study)
    pour_once((sets["lowest"], 1, *common))  # compiles the engine
    jobs = [
        (values, seed, *common)
        for values in sets.values()
        for seed in range(1, seeds + 1)
    ]
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        runs = pool.map(pour_once, jobs, chunksize=1)
    arrays = {
        name: np.array([run[2][k] for run in runs]) for k, name in enumerate(KEPT)
    }
    names = np.repeat(list(sets), seeds)
    np.savez_compressed(
        path,
        set=names,
        status=[run[0] for run in runs],
        cpu_s=[run[1] for run in runs],
        **arrays,
    )


def measured(path, study):
    """Set, status and processor time of each pour, and its responses (N, R); NaN where it cannot be measured."""
    stored = np.load(path)
    settings = MeasureSettings.with_defaults(**study.config["measure"]).for_grain(
        study.grain
    )
    plate_mm = study.config["funnel"]["plate_diameter_mm"]
    arrays = {name: stored[name] for name in KEPT}
    further = [name for name in RESPONSES if name not in funnel.BASIC_NUMBERS]
    table = np.full((len(stored["set"]), len(RESPONSES)), np.nan)
    for k in np.flatnonzero(stored["status"] == "ok"):
        pile = {name: values[k] for name, values in arrays.items()}
        found, _ = pile_responses(pile, study.particle, settings, plate_mm, further)
        table[k] = [
            np.nan if found.get(name) is None else found[name] for name in RESPONSES
        ]
    return stored["set"], stored["status"], stored["cpu_s"], table


def compare(before, after):
    """Print every difference with its standard error, and the verdict of all together."""
    study = PipelineConfig.load(*CONFIG)
    sides = [measured(path, study) for path in (before, after)]
    sum_of_sets = 0.0
    degrees = 0
    largest = 0.0
    print("set\tresponse\tbefore\tafter\tdifference\tstandard error\tratio")
    for name in dict.fromkeys(sides[0][0].tolist()):
        good = [
            table[(sets == name) & np.isfinite(table).all(axis=1)]
            for sets, _, _, table in sides
        ]
        means = [table.mean(axis=0) for table in good]
        covariance = sum(np.cov(table.T) / len(table) for table in good)
        shift = means[1] - means[0]
        error = np.sqrt(np.diag(covariance))
        sum_of_sets += shift @ np.linalg.solve(covariance, shift)
        degrees += len(shift)
        largest = max(largest, np.abs(shift / error).max())
        for k, response in enumerate(RESPONSES):
            row = (means[0][k], means[1][k], shift[k], error[k], shift[k] / error[k])
            print(name, response, *(f"{value:.3f}" for value in row), sep="\t")
        for side, table in zip(("before", "after"), sides, strict=True):
            sets, status, cpu_s, _ = table
            here = sets == name
            kinds, numbers = np.unique(status[here], return_counts=True)
            counts = dict(zip(kinds, numbers, strict=True))
            print(
                f"{name}, {side}: {counts}, {np.median(cpu_s[here]):.2f} s of processor time, the median"
            )
    p = chi2.sf(sum_of_sets, degrees)
    print(
        f"chi squared {sum_of_sets:.1f} with {degrees} degrees of freedom, p {p:.3f}; largest ratio {largest:.2f}"
    )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("step", choices=("pour", "compare"))
    parser.add_argument("files", nargs="+")
    parser.add_argument("--seeds", type=int, default=64)
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    if arguments.step == "pour":
        pour(*arguments.files, arguments.seeds, arguments.processes)
    else:
        compare(*arguments.files)


if __name__ == "__main__":
    main()

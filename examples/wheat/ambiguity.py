"""Five published pairs of friction for wheat in one engine: a poured pile, a lifted cylinder, a drum.

    python examples/wheat/ambiguity.py

It goes on where it was stopped. README.md says what it asks and finds; every run is kept in results/examples/wheat.
"""

import math
import time
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

from repose.bench import Scene, bench, turning
from repose.calibrate.runs import mean_and_error
from repose.common.files import read_json, write_json
from repose.config.pipeline import PipelineConfig
from repose.report.figures import style
from repose.stages.job import run_once

OUT = Path("results/examples/wheat")
RESTITUTION = 0.5  # Wang's; the other sources say none


class Pair(NamedTuple):
    """Static and rolling friction of two grains, and of grain and wall: of two grains where a source says none."""

    static: float
    rolling: float
    wall: tuple[float, float]

    def values(self, wall: tuple[float, float] | None) -> dict:
        """The parameters by their names, with another wall if there is one."""
        mus_gp, mur_gp = wall or self.wall
        of_wall = {"e_gp": RESTITUTION, "mus_gp": mus_gp, "mur_gp": mur_gp}
        return {
            "e_gg": RESTITUTION,
            "mus_gg": self.static,
            "mur_gg": self.rolling,
            **of_wall,
        }


PAIRS = {
    "A": Pair(0.15, 0.36, (0.36, 0.29)),
    "B": Pair(0.30, 0.04, (0.30, 0.04)),
    "C": Pair(0.61, 0.018, (0.61, 0.018)),
    "D": Pair(0.25, 0.22, (0.25, 0.22)),
    "E": Pair(0.60, 0.12, (0.60, 0.12)),
}
LIFTED = {  # tube, mass and speed of Wang et al. 2023
    "berries": 752,  # 30 g
    "rate_per_s": 100.0,
    "lift_from_s": 8.0,
    "lifting_mm_s": 10.0,
    "settle_s": 6.0,
    "seeds": 4,
    "diameter_mm": 27.0,
    "length_mm": 190.0,
    "rim_radius_mm": 1.0,
    "plate_diameter_mm": 300.0,
}
TURNING = {  # diameter, speed and filling of Sugirbay et al. 2022
    "berries": 5500,
    "rate_per_s": 2500.0,
    "rotate_from_s": 3.0,
    "angular_velocity_rad_s": 5 * math.pi / 30,
    "measure_from_s": 2.5,
    "measure_until_s": 4.5,
    "seeds": 2,
    "outer_diameter_mm": 152.0,
    "wall_thickness_mm": 1.0,
    "length_mm": 32.0,  # theirs is 50
    "factory_height_mm": 40.0,
    "record_s": 0.1,
    "fit_share": 0.6,
}
CROP = {"berry": {"sizes": "crops/wheat/sizes.csv"}, "validation": {"published": None}}
CROP |= {
    "funnel": {"duration_s": 8.0}
}  # a grain of little rolling friction rolls for long


class Shown(NamedTuple):
    """A bench test: its name in the program, its response, seeds, title, and the angle measured of wheat."""

    test: str
    response: str
    seeds: int
    title: str
    measured: float | None
    wall: tuple[float, float] | None = (
        None  # friction of the wall; None: as the pair says
    )


BENCHES = {
    "pile": Shown("funnel", "aor_deg", 8, "poured pile", 29.89),
    "lifted": Shown("lifted_cylinder", "lifted_aor_deg", 4, "lifted cylinder", 31.7),
    "drum": Shown("turning", "turning_deg", 2, "turning drum", 36.17),
    "rough": Shown(
        "funnel", "aor_deg", 8, "pile, rough plate", None, (0.8, 0.3)
    ),  # the crop's own plate
}


def ran(study: PipelineConfig, name: str, of: str, seed: int) -> dict:
    """One run, measured, and its seconds of processor; a file keeps it, so that it is made once."""
    path, shown = OUT / name / f"{of}_{seed}.json", BENCHES[name]
    if not path.exists():
        test, config = (
            bench(shown.test),
            study.config | {"lifted_cylinder": LIFTED, "turning": TURNING},
        )
        began = time.process_time()
        scene = Scene.of(
            config, PAIRS[of].values(shown.wall), study.grain, study.particle, seed
        )
        measured, run = run_once(test, scene)
        took = {"cpu_s": time.process_time() - began}
        if shown.test == "turning":  # whether the flow is steady
            frames = (run.arrays[key] for key in ("position", "quaternion", "scale"))
            took["frames_deg"] = (
                turning.TurningTest().surface_angles(*frames, scene=scene).tolist()
            )
        write_json(path, {"run": measured, **took})
        print(
            f"{name} {of} {seed}: {measured['status']} {measured[shown.response]}",
            flush=True,
        )
    return read_json(path)


def angles(study: PipelineConfig) -> dict[str, dict[str, tuple]]:
    """Of each bench test and pair: mean angle and its standard error, runs that have one, and all runs."""
    found = {}
    for name, shown in BENCHES.items():
        found[name] = {}
        for of in PAIRS:
            runs = [
                ran(study, name, of, seed)["run"] for seed in range(1, shown.seeds + 1)
            ]
            values = [
                run[shown.response] for run in runs if run[shown.response] is not None
            ]
            found[name][of] = *mean_and_error(values), len(values), shown.seeds
    return found


def described(found: dict) -> str:
    """The table of angles, and how many standard errors two pairs differ by in each bench test."""
    lines = [
        "| pair | static, rolling | "
        + " | ".join(shown.title for shown in BENCHES.values())
        + " |"
    ]
    lines += ["|" + "---|" * (2 + len(BENCHES))]
    for of, pair in PAIRS.items():
        cells = [words(*found[name][of]) for name in BENCHES]
        lines += [
            f"| {of} | {pair.static:g}, {pair.rolling:g} | " + " | ".join(cells) + " |"
        ]
    for first, second in combinations(PAIRS, 2):
        cells = []
        for name in BENCHES:
            (a, a_error, *_), (b, b_error, *_) = found[name][first], found[name][second]
            if None in (a_error, b_error):
                cells.append("-")
            else:
                cells.append(
                    f"{a - b:+.1f} ({abs(a - b) / math.hypot(a_error, b_error):.1f} SE)"
                )
        lines += [f"{first} - {second}: " + ", ".join(cells)]
    return "\n".join(lines)


def words(mean: float | None, error: float | None, count: int, runs: int) -> str:
    """An angle with its standard error, and how many of the runs have one where not all do."""
    of_runs = "" if count == runs else f" ({count} of {runs})"
    return (
        "no pile" if mean is None else f"{mean:.1f} ± {error or math.nan:.1f}{of_runs}"
    )


def draw_figure(found: dict) -> None:
    """The pairs in their plane, and the angle of each in three bench tests beside the angles measured of wheat."""
    benches = {
        name: shown for name, shown in BENCHES.items() if shown.measured is not None
    }
    with style.applied():
        page = style.new_figure(style.PAGE, 2.9)
        plane, tests = page.subplots(1, 2, width_ratios=(1, 1.75))
        for x, shown in enumerate(benches.values()):
            label = "measured on wheat" if x == 0 else None
            tests.plot(
                [x - 0.12, x + 0.12],
                2 * [shown.measured],
                color=style.BLACK,
                lw=2.5,
                label=label,
            )
        for k, (of, pair) in enumerate(PAIRS.items()):
            look = {"color": style.SERIES[k], "marker": "osD^v"[k], "ms": 5}
            plane.plot(pair.static, pair.rolling, **look)
            means = [found[name][of] for name in benches]
            at = [
                (x, mean, 2 * (error or 0.0))
                for x, (mean, error, *_) in enumerate(means)
                if mean is not None
            ]
            x, mean, error = zip(*at, strict=True)
            tests.errorbar(x, mean, yerr=error, capsize=2, **look)
            beside = {
                "textcoords": "offset points",
                "color": look["color"],
                "fontweight": "bold",
            }
            plane.annotate(of, (pair.static, pair.rolling), (5, 4), **beside)
            tests.annotate(of, (x[-1], mean[-1]), (15, -3), **beside)
        plane.set(
            xlabel="static friction (–)",
            ylabel="rolling friction (–)",
            xlim=(0, 0.7),
            ylim=(0, 0.42),
        )
        plane.set_title("five pairs, each published for wheat")
        tests.set(ylabel="angle (deg)", xlim=(-0.3, len(benches) - 0.6))
        tests.set_xticks(
            range(len(benches)), [shown.title for shown in benches.values()]
        )
        tests.set_title("what they give in three bench tests, with the same grain")
        tests.errorbar(
            [],
            [],
            yerr=[],
            color=style.GREY,
            fmt="o",
            capsize=2,
            label="simulated ± 2 SE",
        )
        tests.legend(loc="upper left")
        style.save(page, OUT / "ambiguity.png", small_run=False)


def main() -> None:
    """Make what is missing of the runs; print the tables, draw the figure."""
    study = PipelineConfig.load("crops/wheat/config.yaml", overrides=CROP)
    found = angles(study)
    print(described(found))
    seconds = {
        name: [read_json(path)["cpu_s"] for path in (OUT / name).glob("*.json")]
        for name in BENCHES
    }
    for name, of_runs in seconds.items():
        print(
            f"{name}: {len(of_runs)} runs, {sum(of_runs) / len(of_runs):.0f} s of processor each"
        )
    print(f"{sum(map(sum, seconds.values())) / 60:.0f} minutes of processor")
    draw_figure(found)


if __name__ == "__main__":
    main()

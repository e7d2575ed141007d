"""A published calibration done again from its data: sliding, rolling and number of grains from two surfaces.

    python examples/granudrum/calibrate.py

It goes on where it was stopped, and from the drums in results/published/granudrum. README.md says what it asks and
finds; all files are in results/examples/granudrum.
"""

import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
from granudrum import YOUNG_PA, drum, surfaces

from repose import Study
from repose.core.files import read_json, write_json, write_table
from repose.pictures.figures import profiles as figure
from repose.pictures.figures import style
from repose.pictures.report import own
from repose.strategies.runs import checked_runs
from repose.studies import calibration

HERE, OUT = Path(__file__).parent, Path("results/examples/granudrum")
TURNED = Path("results/published/granudrum")  # drums that were turned before
X_MM = np.arange(-24.0, 25.0, 2.0)
RPM = (45, 15)  # in this order: from the steep bed the other is reached in a third of a second
WITHIN_MM = {45: 0.63, 15: 0.85}  # root mean square distance of the published answer
CORES = 2
PARAMETERS = {"sliding": (0.1, 1.0), "rolling": (0.0, 0.5), "grains": (20_000.0, 40_000.0)}
TARGETS = {
    f"surface_{rpm}rpm_mm": {
        "file": str(HERE / "surface.csv"),
        "z": f"measured_{rpm}rpm_mm",
        "sd": 0.25,  # a pixel of the pictures is 0.21 mm
        "repetitions": 1,
        "within": WITHIN_MM[rpm],
        "unit": "mm",
        "definition": "height of the line on which the bed covers a tenth of the frames, seen along the axis",
        "noise_sd": 0.45,  # of one drum, from the scatter of 0.2 s in two trial runs
    }
    for rpm in RPM
}
# A drum is two runs, one at each speed: 44, where at most 60 are allowed.
SEQUENTIAL = {"start_samples": 14, "seeds": 1, "batch": 4, "most_runs": 22}
# Within 6 % of the height, 0.7 and 0.9 mm, the strategy asks for more runs about its best point until the budget ends.
SEQUENTIAL |= {"tolerance_percent": 6.0, "probability": 0.9}
CHECKS = range(1001, 1005)  # seeds of the answer of the soft grains
# Four drums of that answer with stiffer grains give the shift of the scores by the modulus. With it the runs of softer
# grains count as those of stiffer ones, as if the shift were the same for all parameters. All together give the final
# answer. The first five drums had stiffer grains.
STIFF_PA, STIFF, OF_STIFF = 1e6, range(3001, 3005), 5  # a fifth of the published modulus; seeds; samples
FRESH = range(5001, 5005)  # seeds of that answer
ALL_RPM, PREDICTED_RPM = (45, 30, 15, 10), (30, 10)


def turned(
    name: str, parameters: dict[str, float], seed: int, rpm: tuple, young_pa: float = YOUNG_PA
) -> dict:
    """Mean surfaces of one drum by speed; a file keeps them, so that a drum is turned once."""
    path = OUT / "drums" / f"{name}.json"
    for kept in (path, TURNED / f"{name}.json"):
        known = read_json(kept) if kept.exists() else {}
        same = (known.get("parameters"), known.get("seed"), known.get("young_pa", young_pa))
        if same == (parameters, seed, young_pa):
            write_json(path, known)
            break
    else:
        began = time.process_time()
        found = surfaces(drum(**parameters, seed=seed, young_pa=young_pa), rpm, X_MM)
        heights = {str(speed): line.tolist() for speed, line in zip(rpm, found, strict=True)}
        minutes = (time.process_time() - began) / 60
        write_json(
            path,
            {
                "parameters": parameters,
                "seed": seed,
                "young_pa": young_pa,
                "heights_mm": heights,
                "minutes": minutes,
            },
        )
        print(f"{name}: {minutes:.2f} min of processor", flush=True)
    return {int(speed): np.array(line) for speed, line in read_json(path)["heights_mm"].items()}


def all_turned(jobs: list[tuple]) -> list[dict]:
    """`turned` of several drums, some at the same time."""
    with ProcessPoolExecutor(CORES) as pool:
        return [job.result() for job in [pool.submit(turned, *job) for job in jobs]]


def scores(study: Study, heights: dict) -> dict[str, float]:
    """Responses of a drum: the scores of its surfaces at the abscissae that were measured."""
    row = {}
    for rpm in RPM:
        profile = study.targets.profiles[f"surface_{rpm}rpm_mm"]
        row |= profile.columns(heights[rpm][np.isin(X_MM, profile.x)])
    return row


def calibrated() -> tuple[Study, calibration.Calibration]:
    """The runs that the strategy asks for, and its answer."""
    study = Study(
        PARAMETERS,
        TARGETS,
        "sequential",
        seed=2026,
        file=OUT / "runs.csv",
        simulator="repose.dem, examples/granudrum",
        label="microcrystalline_cellulose",
        sequential=SEQUENTIAL,
    )
    while not study.done:
        samples = study.ask()
        jobs = [
            (f"run_{row.sample:02}", {name: getattr(row, name) for name in PARAMETERS}, row.sample, RPM)
            for row in samples.itertuples()
        ]
        drums = all_turned(jobs)
        study.tell(samples.join(pd.DataFrame([scores(study, heights) for heights in drums])))
    return study, study.answer()


def stiffer(study: Study, answer: calibration.Calibration, checks: list[dict]) -> calibration.Calibration:
    """The answer for stiffer grains, from the runs, their shift, and four drums of stiffer grains."""
    best = answer.parameters
    jobs = [(f"check_{STIFF_PA:g}Pa_{seed}", best, seed, RPM, STIFF_PA) for seed in STIFF]
    stiff = pd.DataFrame([scores(study, heights) for heights in all_turned(jobs)])
    shift = stiff.mean() - pd.DataFrame([scores(study, heights) for heights in checks]).mean()
    print("shift of the scores:", shift.round(2).to_dict())
    runs = study.runs.copy()
    soft = runs["sample"].astype(int) > OF_STIFF
    runs.loc[soft, shift.index] += shift
    names = ["sample", *PARAMETERS, *shift.index]
    sample = runs["sample"].astype(int).max() + 1
    added = stiff.assign(sample=sample, **best)
    table = pd.concat([runs[names], added[names]], ignore_index=True)
    return calibration.calibrate(study, checked_runs(study, table))


def rms(off: np.ndarray) -> float:
    """Root mean square where there is a measured height."""
    return float(np.sqrt(np.nanmean(np.square(off))))


def compared(checks: list[dict]) -> pd.DataFrame:
    """How far fresh runs of the answer, their mean and the published answer are off the measured surface [mm]."""
    data, rows = pd.read_csv(HERE / "surface.csv", comment="#").set_index("x_mm").loc[X_MM], []
    for rpm in RPM:
        measured, theirs = (data[f"{of}_{rpm}rpm_mm"].to_numpy(float) for of in ("measured", "theirs"))
        lines = np.array([heights[rpm] for heights in checks])
        mean = lines.mean(axis=0)
        row = {"rpm": rpm, "single_runs_rms_mm": rms(lines - measured), "mean_rms_mm": rms(mean - measured)}
        row |= {"mean_mm": float(np.nanmean(mean - measured)), "scatter_mm": rms(lines.std(axis=0, ddof=1))}
        of_theirs = {
            "theirs_rms_mm": rms(theirs - measured),
            "theirs_mean_mm": float(np.nanmean(theirs - measured)),
        }
        rows.append(row | of_theirs)
    return pd.DataFrame(rows)


def predicted(drums: list[dict]) -> pd.DataFrame:
    """Surfaces at speeds that nobody used, with a band of two standard deviations [mm]."""
    tables = []
    for rpm in sorted(PREDICTED_RPM):
        lines = np.array([heights[rpm] for heights in drums])
        mean, half = lines.mean(axis=0), 2 * lines.std(axis=0, ddof=1)
        columns = {"x_mm": X_MM, "predicted_mm": mean, "low_mm": mean - half, "high_mm": mean + half}
        tables.append(pd.DataFrame({"rpm": rpm, **columns}))
    return pd.concat(tables).round(2)


def main() -> None:
    """Calibrate, check the answers with fresh seeds, predict the other speeds."""
    study, soft = calibrated()
    checks = all_turned([(f"check_{seed}", soft.parameters, seed, ALL_RPM) for seed in CHECKS])
    off = compared(checks).assign(young_pa=YOUNG_PA)
    answer = stiffer(study, soft, checks)
    calibration.write(answer, OUT)
    own.write(answer, OUT / "report.html")
    print(calibration.describe(answer), flush=True)
    jobs = [(f"fresh_{seed}", answer.parameters, seed, ALL_RPM, STIFF_PA) for seed in FRESH]
    fresh = all_turned(jobs)
    off = pd.concat([compared(fresh).assign(young_pa=STIFF_PA), off])
    write_table(OUT / "compared.csv", off)
    print(off.to_string(index=False))
    draw_figure(study, answer, fresh)
    write_table(OUT / "predicted.csv", predicted(fresh))
    minutes = {path.stem: read_json(path)["minutes"] for path in sorted((OUT / "drums").glob("*.json"))}
    used = [value for name, value in minutes.items() if name.startswith(("run", f"check_{STIFF_PA:g}"))]
    total = sum(minutes.values())
    print(f"{2 * len(used)} runs: {sum(used):.0f} minutes of processor; with the checks {total:.0f}")


def draw_figure(study: Study, answer: calibration.Calibration, checks: list[dict]) -> None:
    """Measured, predicted and simulated surfaces with their bands."""
    names, cov = study.targets.names, dict(zip(study.targets.names, answer.error, strict=True))
    mean = dict(zip(names, answer.mean, strict=True))
    with style.applied():
        page = style.new_figure(style.PAGE, 3.0)
        for panel, rpm in zip(page.subplots(1, len(RPM)), RPM, strict=True):
            profile = study.targets.profiles[f"surface_{rpm}rpm_mm"]
            there = np.isin(X_MM, profile.x)
            lines = np.array([heights[rpm][there] for heights in checks])
            error = figure.band(profile, np.array([cov[name] for name in profile.names]))
            figure.draw(
                panel,
                profile,
                TARGETS[profile.name]["sd"],
                (
                    figure.Line(
                        "predicted ± SE", profile.heights([mean[name] for name in profile.names]), error
                    ),
                    figure.Line("simulated ± SD", lines.mean(axis=0), lines.std(axis=0, ddof=1)),
                ),
            )
            panel.set_title(f"{rpm} rpm")
        style.save(page, OUT / "surfaces.png", small_run=False)


if __name__ == "__main__":
    main()

"""Which particle, which definition of the angle, which filling: every combination at the published solutions.

The paper gives six parameter sets with the piles that they made in its simulator, and leaves open what its particle,
its funnel and its angle were in detail. Here each particle (`shape_study.particles`, changes of the section `berry`) is
poured in each way (`shape_study.fillings`, changes of `heap`) with each published set and several seeds, and every pile
is measured by all definitions. A combination is judged by how far its piles are from the published ones, in units of
the physical pile's standard deviations; by whether its particle has the measured axes and mass; and by the
signal-to-noise ratio of its angle over a designed set of parameters.
"""

import copy
import json
import math
from pathlib import Path

import numpy as np
import pandas as pd

from repose.config import checks
from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.core.seeds import pour_seeds
from repose.core.targets import section_of
from repose.measure.angles import DEFINITIONS, MEAN_KEYS

PUBLISHED_PAIR = ("aor_simulated_deg", "height_simulated_mm")
KINDS = ("published", "sensitivity", "design")
RUN_COLUMNS = ("kind", "particle", "filling", "set", "seed", "status", "height_mm", *MEAN_KEYS.values())
# A particle stands for the measured berry when its extents and its mass are as near as this.
NEAR_AXES, NEAR_MASS = 0.05, 0.02
LEAST_SIGNAL_TO_NOISE = 1.3


def cells(config):
    """Names KIND-PARTICLE-FILLING of the study's jobs."""
    study = config["shape_study"]
    names = [
        f"published-{particle}-{filling}" for particle in study["particles"] for filling in study["fillings"]
    ]
    names += [f"sensitivity-{study['sensitivity_particle']}-{name}" for name in study["sensitivities"]]
    return names + [
        f"design-{particle}-{filling}"
        for filling in study["design_fillings"]
        for particle in study["particles"]
    ]


def check(config, source="configuration"):
    """InputError unless every particle, filling and sensitivity of the study is a good configuration."""
    study = config["shape_study"]
    for key, section in (("sensitivity_particle", "particles"), ("sensitivity_filling", "fillings")):
        if study[key] not in study[section]:
            allowed = "one of " + ", ".join(study[section])
            raise InputError(source, f"shape_study.{key}", study[key], allowed)
    for filling in study["design_fillings"]:
        if filling not in study["fillings"]:
            allowed = "some of " + ", ".join(study["fillings"])
            raise InputError(source, "shape_study.design_fillings", filling, allowed)
    for section, part in (("particles", "berry"), ("fillings", "funnel"), ("sensitivities", "funnel")):
        for name, changes in study[section].items():
            checks.check(changed(config, part, changes), f"{source}, shape_study.{section}.{name}")


def changed(config, section, changes):
    """A copy of the configuration with some keys of a section changed."""
    other = copy.deepcopy(config)
    other[section] = other[section] | changes
    return other


def parameter_sets(config, samples_csv, kind):
    """Table of the parameter sets of a kind of job: column set, the six, and the published pair where there is one."""
    if kind == "design":
        table = read_table(samples_csv, ("sample", *PARAMETERS)).head(config["shape_study"]["design_samples"])
        return table.rename(columns={"sample": "set"})[["set", *PARAMETERS]]
    table = published_sets(config)
    return table.tail(1) if kind == "sensitivity" else table


def published_sets(config):
    """The published solutions, the representative last, with what their piles were published to be.

    The representative's own pile is known only as nearly the physical one, which stands for it.
    """
    path = config["validation"]["published"]
    table = read_table(path, ("solution", *PARAMETERS, *PUBLISHED_PAIR)).rename(columns={"solution": "set"})
    table["set"] = table["set"].astype(str)
    target = (section_of(config)["physical_aor_deg"], section_of(config)["physical_height_mm"])
    for column, value in zip(PUBLISHED_PAIR, target, strict=True):
        table[column] = table[column].fillna(value)
    named = table["set"] == "representative"
    return pd.concat([table[~named], table[named]])[["set", *PARAMETERS, *PUBLISHED_PAIR]]


def cell_settings(config, cell):
    """Kind, particle's name, filling's name and the configuration of a cell, or InputError."""
    kind, _, rest = cell.partition("-")
    particle, _, filling = rest.partition("-")
    if cell not in cells(config):
        raise InputError("command line", "--cell", cell, "one of " + ", ".join(cells(config)))
    study = config["shape_study"]
    changes = study["fillings"].get(filling, {})
    if kind == "sensitivity":
        changes = study["fillings"][study["sensitivity_filling"]] | study["sensitivities"][filling]
    config = changed(config, "berry", study["particles"][particle])
    return kind, particle, filling, changed(config, "funnel", changes)


def dependencies(config, cell):
    """What a cell's pours and measurements depend on."""
    kind, _, _, own = cell_settings(config, cell)
    seeds = ("design_samples", "design_seeds") if kind == "design" else ("seeds",)
    found = {key: own["shape_study"][key] for key in seeds} | {"seed": own["design"]["seed"]}
    funnel = {key: value for key, value in own["funnel"].items() if key != "seeds"}
    kept = ("berry", "wall", "simulation", "measure", "targets")
    return found | {"funnel": funnel} | {key: own[key] for key in kept}


def run_cell(config, cell, berry_json, samples_csv, out_dir):
    """Pour and measure one cell of the study; write OUT/CELL.csv (RUN_COLUMNS) and OUT/CELL.json of its particle."""
    from repose.apparatus import bench
    from repose.apparatus.job import run_once
    from repose.particle import build

    kind, particle_name, filling, own = cell_settings(config, cell)
    section = own["berry"]
    out = Path(out_dir)
    particle = build.run(
        berry_json,
        section["stl"],
        out / "particles" / cell,
        kind=section["particle"],
        mass_g=section["mass_g"],
        spheres=section["spheres"],
        surface=section["surface"],
        time_step_s=own["simulation"]["time_step_s"],
    )
    berry = json.loads(Path(berry_json).read_text())
    study, rows = own["shape_study"], []
    sets = parameter_sets(own, samples_csv, kind)
    seeds = study["design_seeds" if kind == "design" else "seeds"]
    for number, one in enumerate(sets.to_dict("records")):
        for seed in pour_seeds(own["design"]["seed"], f"shape_{kind}", number, seeds):
            record, _ = run_once(bench("funnel"), own, one, seed, particle, berry)
            rows.append(
                {"kind": kind, "particle": particle_name, "filling": filling, "set": one["set"]}
                | {key: record[key] for key in RUN_COLUMNS if key in record}
            )
    about = {
        "particle": particle_name,
        "axes_mm": (1e3 * particle.axes_m).tolist(),
        "mass_g": 1e3 * particle.mass_kg,
        "volume_mm3": 1e9 * particle.volume_m3,
        "measured_axes_mm": [berry[name] for name in ("long_mm", "major_mm", "minor_mm")],
    }
    (out / f"{cell}.json").write_text(json.dumps(about, indent=1) + "\n")
    pd.DataFrame(rows, columns=list(RUN_COLUMNS)).to_csv(out / f"{cell}.csv", index=False)


def tables(config, cell_csvs, out_dir):
    """Write sets.csv, combinations.csv, noise.csv, particles.csv and choice.json into out_dir; return them by name.

    sets: mean and standard error of every particle, filling, definition and parameter set beside the published pile;
    combinations: the sets of a combination taken together, the best first; noise: signal-to-noise over the design.
    """
    runs = pd.concat([read_table(path, RUN_COLUMNS) for path in cell_csvs], ignore_index=True)
    runs["set"] = runs["set"].astype(str)
    about = pd.DataFrame([_particle_row(path, config) for path in cell_csvs]).drop_duplicates("particle")
    noise = noise_table(runs[runs["kind"] == "design"])
    sets = set_table(runs[runs["kind"] != "design"], published_sets(config))
    combinations = combination_table(sets[sets["kind"] == "published"], noise, about, section_of(config))
    eligible = combinations[combinations["eligible"]]
    choice = None if eligible.empty else eligible.iloc[0].to_dict()
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    named = {"sets": sets, "combinations": combinations, "noise": noise, "particles": about}
    for name, table in named.items():
        table.to_csv(out / f"{name}.csv", index=False, float_format="%.6g")
    text = json.dumps(choice, indent=1, default=lambda value: value.item())
    (out / "choice.json").write_text(text + "\n")
    return named | {"choice": choice}


def _particle_row(cell_csv, config):
    """Axes and mass of a cell's particle, and whether they are the measured berry's."""
    path = Path(cell_csv).with_suffix(".json")
    about = json.loads(path.read_text())
    axes, measured = np.array(about["axes_mm"]), np.array(about["measured_axes_mm"])
    mass, target = about["mass_g"], config["shape_study"]["measured_mass_g"]
    off_axes, off_mass = float(np.abs(axes / measured - 1).max()), abs(mass / target - 1)
    return {
        "particle": about["particle"],
        **{f"axis_{k + 1}_mm": value for k, value in enumerate(axes)},
        "mass_g": mass,
        "volume_mm3": about["volume_mm3"],
        "largest_axis_deviation": off_axes,
        "mass_deviation": off_mass,
        "measured_berry": off_axes <= NEAR_AXES and off_mass <= NEAR_MASS,
    }


def set_table(runs, published):
    """Mean, standard error and difference from the published pile of each cell, definition and parameter set."""
    rows, pairs = [], published.set_index("set")
    for (kind, particle, filling, name), group in runs.groupby(
        ["kind", "particle", "filling", "set"], sort=False
    ):
        height = _mean(group["height_mm"])
        for definition in DEFINITIONS:
            angle = _mean(group[MEAN_KEYS[definition]])
            rows.append(
                {
                    "kind": kind,
                    "particle": particle,
                    "filling": filling,
                    "definition": definition,
                    "set": name,
                }
                | {
                    "aor_deg": angle[0],
                    "aor_se_deg": angle[1],
                    "height_mm": height[0],
                    "height_se_mm": height[1],
                }
                | {
                    "aor_difference_deg": angle[0] - pairs.at[name, PUBLISHED_PAIR[0]],
                    "height_difference_mm": height[0] - pairs.at[name, PUBLISHED_PAIR[1]],
                    "n_ok": int((group["status"] == "ok").sum()),
                    "n": len(group),
                }
            )
    return pd.DataFrame(rows)


def combination_table(sets, noise, particles, target):
    """Each combination over all published sets: mean differences with standard errors, sets within the physical
    pile's standard deviations, and the distance sqrt(mean (dA / sd_A)^2 + (dH / sd_H)^2); eligible ones first."""
    sd_aor, sd_height = target["physical_aor_sd_deg"], target["physical_height_sd_mm"]
    rows = []
    for (particle, filling, definition), group in sets.groupby(
        ["particle", "filling", "definition"], sort=False
    ):
        aor, height = group["aor_difference_deg"], group["height_difference_mm"]
        off = (aor / sd_aor) ** 2 + (height / sd_height) ** 2
        signal, signal_se = _signal_of(noise, particle, filling, definition)
        measured = bool(particles.set_index("particle").at[particle, "measured_berry"])
        count = len(group)
        rows.append(
            {
                "particle": particle,
                "filling": filling,
                "definition": definition,
                "aor_difference_deg": aor.mean(),
                "aor_se_deg": math.sqrt((group["aor_se_deg"] ** 2).sum()) / count,
                "height_difference_mm": height.mean(),
                "height_se_mm": math.sqrt((group["height_se_mm"] ** 2).sum()) / count,
                "sets_within": int(((aor.abs() <= sd_aor) & (height.abs() <= sd_height)).sum()),
                "sets": count,
                "distance": math.sqrt(off.mean()),
                "signal_to_noise": signal,
                "signal_to_noise_se": signal_se,
                "measured_berry": measured,
                "eligible": bool(
                    measured
                    and signal + 2 * signal_se >= LEAST_SIGNAL_TO_NOISE
                    and not math.isnan(off.mean())
                ),
            }
        )
    table = pd.DataFrame(rows)
    return table.sort_values(["eligible", "distance"], ascending=[False, True], ignore_index=True)


def _signal_of(noise, particle, filling, definition):
    """Signal-to-noise ratio and its standard error; of the first filling that has one where this has none."""
    rows = noise[(noise["particle"] == particle) & (noise["response"] == definition)]
    own = rows[rows["filling"] == filling]
    row = own if len(own) else rows.head(1)
    if row.empty:
        return math.nan, math.nan
    return float(row["signal_to_noise"].iloc[0]), float(row["standard_error"].iloc[0])


def noise_table(runs):
    """Signal and noise of every particle's angle and Height over the designed parameter sets, for each filling.

    noise: standard deviation from seed to seed; signal: of the true means, the spread of the sets' means less what the
    noise adds to it; signal_to_noise with a standard error from leaving out one set at a time (jackknife).
    """
    columns = MEAN_KEYS | {"height": "height_mm"}
    rows = []
    for (particle, filling), group in runs.groupby(["particle", "filling"], sort=False):
        for response, column in columns.items():
            by_set = [one[column].dropna().to_numpy() for _, one in group.groupby("set")]
            by_set = [values for values in by_set if len(values) > 1]
            signal, noise = _signal_and_noise(by_set)
            left_out = [_ratio(by_set[:k] + by_set[k + 1 :]) for k in range(len(by_set))]
            spread = (len(by_set) - 1) * np.var(left_out) if by_set else math.nan
            rows.append(
                {
                    "particle": particle,
                    "filling": filling,
                    "response": response,
                    "signal": signal,
                    "noise": noise,
                    "signal_to_noise": _ratio(by_set),
                    "standard_error": math.sqrt(spread),
                    "sets": len(by_set),
                }
            )
    return pd.DataFrame(
        rows,
        columns=[
            "particle",
            "filling",
            "response",
            "signal",
            "noise",
            "signal_to_noise",
            "standard_error",
            "sets",
        ],
    )


def _signal_and_noise(by_set):
    """Standard deviations of the true means and of single runs, from the runs of each set."""
    if len(by_set) < 3:
        return math.nan, math.nan
    within = np.average(
        [values.var(ddof=1) for values in by_set], weights=[len(values) - 1 for values in by_set]
    )
    between = np.var([values.mean() for values in by_set], ddof=1)
    added = within * np.mean([1 / len(values) for values in by_set])
    return math.sqrt(max(between - added, 0.0)), math.sqrt(within)


def _ratio(by_set):
    signal, noise = _signal_and_noise(by_set)
    return signal / noise if noise else math.nan


def _mean(values):
    """Mean and standard error of what is there."""
    values = values.dropna().astype(float)
    if len(values) < 2:
        return math.nan, math.nan
    return float(values.mean()), float(values.std(ddof=1) / math.sqrt(len(values)))

"""Noise floor: how far the pours of one sample scatter, how far samples differ, what seeds buy.

The statistics are in `repose.core.variance`.
"""

import json
import math
from pathlib import Path

import numpy as np

from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.variance import CONFIDENCE, residual_correlation, variance_components
from repose.surrogate.bayesian_bp import RESPONSES

MOST_SEEDS = 64
WANTED_PERCENT = (0.5, 1.0, 2.0)  # standard errors, in percent of the target


def read_runs(runs_csv):
    """All runs of a study and those that gave a pile, or InputError where no sample has two of these."""
    runs = read_table(runs_csv, ("sample", "seed", "status", *RESPONSES))
    ok = runs[runs["status"] == "ok"]
    sizes = ok.groupby("sample").size()
    if len(sizes) < 2 or sizes.max() < 2:
        raise InputError(
            runs_csv,
            "runs a sample",
            int(sizes.max()) if len(sizes) else 0,
            "2 or more, of 2 samples or more",
        )
    return runs, ok


def run(runs_csv, target, out_dir):
    """Write noise.csv (one row a response), seeds.csv (1 to 64 seeds) and noise.json; return the summary.

    runs_csv: as `repose.chain.dataset` writes it; target: that section of the configuration. Raises InputError for a
    missing column, or where no sample has two runs that gave a pile.
    """
    import pandas as pd

    runs, ok = read_runs(runs_csv)
    failed = runs[runs["status"] != "ok"]
    found = {name: variance_components(ok[name], ok["sample"]) for name in RESPONSES}
    seeds = np.arange(1, MOST_SEEDS + 1)
    table = pd.DataFrame({"seeds": seeds})
    rows = []
    for name, one in found.items():
        response, unit = name.rsplit("_", 1)
        table[f"{response}_se_{unit}"] = one.standard_error(seeds)
        table[f"{response}_se_percent"] = 100 * one.standard_error(seeds) / target[name]
        for label, icc in (("", one.icc), ("_low", one.icc_low), ("_high", one.icc_high)):
            table[f"{response}_reachable_r2{label}"] = icc / (icc + (1 - icc) / seeds)
        rows.append(_row(name, one, ok, failed, target[name]))
    correlation = residual_correlation(ok[RESPONSES[0]], ok[RESPONSES[1]], ok["sample"])
    summary = {
        "responses": {row["response"]: row for row in rows},
        "correlation": dict(zip(("value", "low", "high", "degrees_of_freedom"), correlation, strict=True)),
        "confidence": CONFIDENCE,
    }
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows).to_csv(out / "noise.csv", index=False)
    table.to_csv(out / "seeds.csv", index=False)
    (out / "noise.json").write_text(json.dumps(summary, indent=1) + "\n")
    return summary


def message(summary):
    """The noise floor in words, one line a response."""
    lines = []
    for name, row in summary["responses"].items():
        unit = name.rsplit("_", 1)[1]
        lines.append(
            f"{name}: sd {row['sd_within']:.2f} {unit} within a sample, {row['sd_between']:.2f} between; intraclass "
            f"correlation {row['icc']:.3f} ({row['icc_low']:.3f} to {row['icc_high']:.3f}); a perfect predictor "
            f"reaches R2 {row['r2_single_runs']:.3f} on single runs, {row['r2_sample_means']:.3f} on the means here"
        )
    return "\n".join(lines)


def _row(name, one, ok, failed, target):
    """The row of noise.csv of one response."""
    row = {
        "response": name,
        "samples": one.groups,
        "runs": one.values,
        "failed_runs": len(failed),
        "samples_with_failures": int(failed["sample"].nunique()),
        "samples_without_runs": int((~failed["sample"].drop_duplicates().isin(ok["sample"])).sum()),
        "mean": one.mean,
        "sd_within": math.sqrt(one.within),
        "sd_within_low": math.sqrt(one.within_low),
        "sd_within_high": math.sqrt(one.within_high),
        "sd_between": math.sqrt(one.between),
        "icc": one.icc,
        "icc_low": one.icc_low,
        "icc_high": one.icc_high,
        "mean_seeds": one.harmonic_seeds,
        "r2_single_runs": float(one.reachable_r2(1)),
        "r2_sample_means": float(one.reachable_r2(one.harmonic_seeds)),
    }
    return row | {f"seeds_for_{p:g}_percent": one.seeds_for(p / 100 * target) for p in WANTED_PERCENT}

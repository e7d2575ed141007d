"""What a published error of an angle of repose is worth, given how far one pour scatters.

    python examples/published_errors/published_errors.py

prints two tables: how probable the published errors are from single pours, and how many pours a claim of 1 % needs with
each rig. It draws published_errors.png into results/examples/published_errors. README.md says what follows.
"""

import math
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import chi2, norm

from repose.calibrate.variance import variance_components
from repose.report.figures import style

HERE, OUT = Path(__file__).parent, Path("results/examples/published_errors")
RUNS = HERE.parents[1] / "results/published/goji_berry/runs.csv"
OTHERS = HERE.parents[1] / "results/published/joint_targets/responses/responses.csv"
# Piles of JoshuaMayo-vectr/DEM-calibration, with the standard deviation of one of their
# seeds (examples/lifted_piles/compare.py); those of crops are at least as steep as this.
LIFTED = HERE.parents[1] / "results/published/lifted_piles/compared_row.csv"
STEEP_DEG = 18.0
TUBE = "lifted tube, 4,000 spheres (LIGGGHTS)"
CERTAINTY, CLAIM_PERCENT = 0.9, 1.0
# Columns of runs of the default study, then responses of its further bench tests, in words.
PILE = {
    "aor_deg": "funnel, 500 berries: angle, 18 views",
    "aor_flank_view_deg": "funnel, 500 berries: angle, one view",
    "aor_whole_deg": "funnel: angle of the whole side, 18 views",
    "aor_whole_view_deg": "funnel: angle of the whole side, one view",
    "aor_secant_deg": "funnel: foot to crest, 18 views",
    "aor_secant_view_deg": "funnel: foot to crest, one view",
    "height_mm": "funnel: Height",
}
FURTHER = {
    "turning_deg": "drum: angle in steady turning",
    "drum_slip_deg": "drum: angle of the first slip",
    "drum_rest_deg": "drum: angle after it",
    "flow_g_s": "discharge: rate",
}
ELSEWHERE = {
    "ten measured piles of goji berries, one view": 100.0
    * 2.2
    / 32.87,  # doi:10.3390/agriculture16182012
}
DRAWN = {
    TUBE: style.GREEN,
    PILE["height_mm"]: style.BLUE,
    PILE["aor_deg"]: style.RED,
}


def within(
    error_percent: float, scatter_percent: float, bias_percent: float = 0.0
) -> float:
    """Probability that one pour lies within an error of the target, where the mean is off by a bias."""
    low, high = (
        norm.cdf((end - bias_percent) / scatter_percent)
        for end in (-error_percent, error_percent)
    )
    return float(high - low)


def tries(error_percent: float, scatter_percent: float) -> float:
    """How many pours the best of which lies within the error, with a probability of one half."""
    return math.log(0.5) / math.log1p(-within(error_percent, scatter_percent))


def pours_needed(
    claim_percent: float, scatter_percent: float, certainty: float = CERTAINTY
) -> int:
    """How many pours have a mean that lies within the claim of the true mean with a certainty."""
    return math.ceil(
        (norm.ppf(0.5 + 0.5 * certainty) * scatter_percent / claim_percent) ** 2
        * (1.0 - 1e-12)
    )


def scatter_of(errors_percent: np.ndarray) -> tuple[float, float, float]:
    """Scatter of single pours about the target that such errors have, with its interval of 95 %."""
    square, count = float(np.sum(np.square(errors_percent))), len(errors_percent)
    low, high = (math.sqrt(square / chi2.ppf(tail, count)) for tail in (0.975, 0.025))
    return math.sqrt(square / count), low, high


def of_lifted_tube(above_deg: float = STEEP_DEG) -> float:
    """Scatter of one pile of the lifted tube in percent of the mean angle of the piles above an angle."""
    piles = pd.read_csv(LIFTED).query("aor > @above_deg")
    scatter_deg = math.sqrt((piles["seeds_sd_theirs"] ** 2).mean())
    return float(100.0 * scatter_deg / piles["aor"].mean())


def scatters() -> pd.Series:
    """Scatter of one run in percent of its mean, by rig."""
    runs, found = pd.read_csv(RUNS), {}
    for column, words in PILE.items():
        there = runs.dropna(subset=[column])
        parts = variance_components(there[column], there["sample"])
        found[words] = 100.0 * math.sqrt(parts.within) / parts.mean
    others = pd.read_csv(OTHERS).set_index("response")
    found |= {
        words: 100.0 * others["sd_within"][name] / others["mean"][name]
        for name, words in FURTHER.items()
    }
    return pd.Series(found | {TUBE: of_lifted_tube()} | ELSEWHERE)


def by_error(errors: pd.DataFrame, of: pd.Series) -> pd.DataFrame:
    """Probability of each published error from a single pour of each rig that is drawn, and of all of them together."""
    table = pd.DataFrame(
        {rig: [within(e, of[rig]) for e in errors["error_percent"]] for rig in DRAWN},
        errors["id"],
    )
    table.loc["all of them"] = table.prod()
    return table


def draw(errors: pd.DataFrame, of: pd.Series) -> None:
    """The figure: probability over error, pours over scatter."""
    figure = style.new_figure(style.PAGE, 2.6)
    left, right = figure.subplots(1, 2)
    axis = np.linspace(0.01, 3.0, 200)
    for rig, colour in DRAWN.items():
        left.plot(
            axis,
            [within(e, of[rig]) for e in axis],
            color=colour,
            label=f"{rig}: {of[rig]:.1f} %",
        )
    left.plot(
        errors["error_percent"],
        np.zeros(len(errors)),
        "|",
        color=style.BLACK,
        ms=9,
        label="published errors",
    )
    left.set(
        xlabel="error, %",
        ylabel="probability that a pour is within",
        ylim=(-0.02, 1.0),
        xlim=(0.0, 3.0),
    )
    left.legend(loc="upper left")
    scatter = np.linspace(0.5, 13.0, 200)
    for claim, line in ((1.0, "-"), (2.0, "--")):
        needed = (norm.ppf(0.5 + 0.5 * CERTAINTY) * scatter / claim) ** 2
        right.plot(
            scatter,
            needed,
            line,
            color=style.GREY,
            label=f"mean within {claim:g} %, {CERTAINTY:.0%} certain",
        )
    for rig, value in of.items():
        right.plot(
            value,
            pours_needed(CLAIM_PERCENT, value),
            "o",
            ms=3.5,
            color=DRAWN.get(rig, style.BLACK),
        )
    right.set(
        xlabel="scatter of one pour, %",
        ylabel="pours",
        yscale="log",
        ylim=(1.0, 600.0),
        xlim=(0.0, 13.0),
    )
    right.legend(loc="lower right")
    style.save(figure, OUT / "published_errors.png", small_run=False)


def main() -> None:
    """Print the tables and draw the figure."""
    errors, of = pd.read_csv(HERE / "errors.csv"), scatters()
    print(
        "probability that a single pour is as near to its target, its mean being exact"
    )
    print(by_error(errors, of).to_string(float_format="{:.2g}".format))
    found, low, high = scatter_of(errors["error_percent"])
    print(f"\nscatter that such errors have: {found:.2f} %, {low:.2f} to {high:.2f}")
    print(
        f"\npours for a mean within {CLAIM_PERCENT:g} %, {CERTAINTY:.0%} certain, and tries for one within it"
    )
    rows = {
        rig: (s, pours_needed(CLAIM_PERCENT, s), tries(CLAIM_PERCENT, s))
        for rig, s in of.items()
    }
    table = pd.DataFrame(rows, ["scatter %", "pours", "tries"]).T
    print(table.round({"scatter %": 1, "pours": 0, "tries": 1}).to_string())
    every = of_lifted_tube(0.0)
    print(
        f"\n{TUBE}: piles above {STEEP_DEG:g} degrees; of all piles {every:.1f} %, "
        f"{pours_needed(CLAIM_PERCENT, every)} pours"
    )
    with style.applied():
        draw(errors, of)


if __name__ == "__main__":
    main()

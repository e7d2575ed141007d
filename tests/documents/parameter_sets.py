"""Tables of the pages that stand the answers of the kept runs beside the article's.

`python tests/documents/parameter_sets.py` counts them anew from `results/published` and writes them where a page has
the line `<!-- made by tests/documents/parameter_sets.py: NAME -->`, up to the line `<!-- end -->`.
"""

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

import repose.bench  # noqa: F401  (gives the responses their names in words)
from repose.bench import reach
from repose.calibrate.answer import Verdict, judge_probability
from repose.stages import card_text

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "results" / "published"
ARTICLE = ROOT / "resources" / "published"
PAGES = (
    "README.md",
    "docs/results.md",
    "docs/uncertainty.md",
    "docs/article.md",
    "research/docs/angle_line_tests.md",
    "research/docs/kept_runs.md",
    "research/docs/drum_slip.md",
    "research/docs/network_tests.md",
    "research/docs/uncertainty_tests.md",
    "research/docs/second_stage.md",
    "research/docs/sequential_tests.md",
    "docs/sequential.md",
)
PARAMETERS = ("e_gg", "mus_gg", "mur_gg", "e_gp", "mus_gp", "mur_gp")
ANGLE = "aor_deg"
HEIGHT = "height_mm"
# The angle by the line of the article's reference 19.
STRAIGHTEST = "straightest"
# The article gives the error of its representative set's simulation, and not its angle and Height.
ARTICLE_CHECK = ("predicted 32.5", "predicted 67.0")
# The parameter that the piles determine best, with any discrepancy.
NARROWEST = "mus_gg"
# The draw on this processor is the first twelve of the 48 pours of `poured_published_sets`.
REPEATED_ON = "Intel Xeon family 6 model 85"
AT_BOUND = 0.01  # of the range, as in the column `warning` of feasible.csv
BLOCK = re.compile(
    r"(<!-- made by tests/documents/parameter_sets\.py: (\w+) -->\n).*?(<!-- end -->)",
    re.DOTALL,
)


@dataclass(frozen=True)
class KeptRun:
    """Where a kept run has its files; None where it has no such file."""

    name: str
    folder: str
    answer: str
    samples: str | None = None
    solutions: str | None = None
    config: str = "config.json"

    def table(self, file):
        return pd.read_csv(KEPT / self.folder / file)

    def settings(self):
        return json.loads((KEPT / self.folder / self.config).read_text())


RUNS = (
    KeptRun(
        name="`goji_berry`",
        folder="goji_berry",
        answer="validation/table4.csv",
        samples="dataset.csv",
        solutions="miga/feasible.csv",
    ),
    KeptRun(
        name="`refined`",
        folder="refined",
        answer="table4.csv",
        config="../goji_berry/config.json",
    ),
    KeptRun(
        name="`paper`",
        folder="paper",
        answer="validation/table4.csv",
        samples="dataset.csv",
        solutions="miga/feasible.csv",
    ),
    KeptRun(
        name="`matched`",
        folder="matched",
        answer="validation/table4.csv",
        samples="dataset.csv",
        solutions="miga/feasible.csv",
    ),
    KeptRun(
        name="`fast`",
        folder="fast",
        answer="sequential/table4.csv",
    ),
)
# The default with a wider range of mus_gg and two pours a sample.
WIDER = KeptRun(
    name="`wider`",
    folder="wider",
    answer="validation/table4.csv",
    samples="dataset.csv",
    solutions="miga/feasible.csv",
)
# The default study again, on another type of processor.
SECOND = KeptRun(
    name="`second_processor`, the same study on another processor",
    folder="second_processor",
    answer="table4.csv",
    samples="dataset.csv",
    config="../goji_berry/config.json",
)
RUN_OF_FOLDER = {run.folder: run for run in RUNS}
DEFAULT = RUN_OF_FOLDER["goji_berry"]
PAPER = RUN_OF_FOLDER["paper"]
MATCHED = RUN_OF_FOLDER["matched"]
# Names of the columns of Table 4 that belong to a target.
COLUMN_STEMS = {ANGLE: "aor", HEIGHT: "height"}
# What the parameters are, as a sentence names them.
KIND = {
    "e_gg": "the coefficient of restitution between berries",
    "mus_gg": "the static friction between berries",
    "mur_gg": "the rolling friction between berries",
    "e_gp": "the coefficient of restitution of a berry on the plate and the wall",
    "mus_gp": "the static friction on the plate and the wall",
    "mur_gp": "the rolling friction on the plate and the wall",
}
# What the settings of a run with a list of solutions are, as a sentence names them.
SETTINGS = {
    "goji_berry": "our default settings",
    "paper": "the settings of the article",
    "matched": "another model of the berry and another contact law",
}
LINES = {
    "flank, 30 to 80 %, levels (calibrated)": "flank",
    "straightest window, at least a third of the side": "straightest",
    "secant": "secant",
    "whole side": "whole",
    "steepest part of the flank": "steepest",
}


FRICTION_RESPONSES = {
    HEIGHT: " mm",
    "aor_flank_deg": "°",
    "aor_straightest_deg": "°",
    "aor_whole_deg": "°",
    "aor_secant_deg": "°",
}


def with_error(mean, error):
    return f"{mean:.1f} ± {error:.1f}"


def markdown(head, rows):
    """A table of the pages."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def listed(words):
    """Words with commas and "and"."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"


def answer_of(run):
    """The row of a run's answer: parameters, simulated means and their errors."""
    answers = run.table(run.answer)
    return answers[answers["role"] == "representative"].iloc[0]


def bounds_of(run, parameter):
    low, high = run.settings()["parameters"][parameter]
    return low, high


def parameter_cell(run, parameter, value):
    """A value, with the bound at which it lies."""
    low, high = bounds_of(run, parameter)
    margin = AT_BOUND * (high - low)
    if value <= low + margin:
        return f"{value:.3f} (lower bound)"
    if value >= high - margin:
        return f"{value:.3f} (upper bound)"
    return f"{value:.3f}"


def published_set():
    """The article's representative set."""
    sets = pd.read_csv(ARTICLE / "table4.csv")
    return sets[sets["solution"] == "representative"].iloc[0]


def pooled_published_sets():
    """Mean and standard error of the earlier pours of each published set."""
    draws = pd.read_csv(KEPT / "published_sets" / "draws.csv")
    draws = draws[draws["processor"] != REPEATED_ON]
    rows = []
    for solution, of_set in draws.groupby("solution", sort=False):
        row = {"solution": solution, "pours": of_set["n_seeds"].sum()}
        for name, column in ((ANGLE, "aor_flank"), (HEIGHT, "height")):
            unit = name.rpartition("_")[2]
            means = of_set[f"{column}_{unit}"]
            errors = of_set[f"{column}_se_{unit}"]
            counts = of_set["n_seeds"]
            mean = np.average(means, weights=counts)
            within = ((counts - 1) * counts * errors**2).sum()
            between = (counts * (means - mean) ** 2).sum()
            variance = (within + between) / (row["pours"] - 1)
            row |= {name: mean, f"{name}_se": np.sqrt(variance / row["pours"])}
        rows.append(row)
    return pd.DataFrame(rows)


def answers():
    """The six parameters of each kept run beside the article's."""
    head = ["", *(f"`{name}`" for name in PARAMETERS), "angle, °", "Height, mm"]
    published = published_set()
    values = [f"{published[name]:.3f}" for name in PARAMETERS]
    poured = poured_published_sets()
    earlier = pooled_published_sets().set_index("solution")
    rows = [
        ["article", *values, *ARTICLE_CHECK],
        [
            "the article's set, simulated here: new piles; earlier piles",
            *values,
            f"{cell_of_set(poured, 'representative', ANGLE)}; {cell_of_set(earlier, 'representative', ANGLE)}",
            f"{cell_of_set(poured, 'representative', HEIGHT)}; {cell_of_set(earlier, 'representative', HEIGHT)}",
        ],
    ]
    for run in RUNS:
        answer = answer_of(run)
        rows.append(
            [
                run.name,
                *(parameter_cell(run, name, answer[name]) for name in PARAMETERS),
                with_error(answer["aor_simulated_deg"], answer["aor_se_deg"]),
                with_error(answer["height_simulated_mm"], answer["height_se_mm"]),
            ]
        )
    samples, meeting = meeting_samples(DEFAULT)
    shares = [
        f"{100 * covered_share(DEFAULT, meeting, name):.0f} %" for name in PARAMETERS
    ]
    inside = f"range of the {len(meeting)} of {len(samples)} samples of `goji_berry` that met both targets, in % of the searched range"
    ranges = [
        "target {:g} to {:g}".format(*target["range"])
        for target in DEFAULT.settings()["targets"]
    ]
    rows.append([inside, *shares, *ranges])
    return markdown(head, rows)


def largest_difference(run, other):
    """Smallest and largest difference of two answers, in percent of the ranges."""
    one, another = answer_of(run), answer_of(other)
    shares = []
    for name in PARAMETERS:
        low, high = bounds_of(DEFAULT, name)
        shares.append(abs(one[name] - another[name]) / (high - low))
    return percent_range(shares)


def probability_inside(run):
    """Probability that the true means of a check lie inside the ranges, by Student's t.

    The errors of the responses count as independent.
    """
    ranges = {
        target["response"]: target["range"] for target in DEFAULT.settings()["targets"]
    }
    probability = 1.0
    for row in check_of(run).itertuples():
        true_mean = stats.t(row.n_seeds - 1, row.simulated, row.simulated_se)
        low, high = ranges[row.response]
        probability *= true_mean.cdf(high) - true_mean.cdf(low)
    return probability


def number_word(count):
    """A small number as a sentence writes it."""
    words = ("none", "one", "two", "three", "four", "five", "six")
    return words[count] if count < len(words) else str(count)


def lies_inside(run):
    """Whether the means of a run's check lie in all target ranges."""
    ranges = {
        target["response"]: target["range"] for target in DEFAULT.settings()["targets"]
    }
    return all(
        ranges[row.response][0] <= row.simulated <= ranges[row.response][1]
        for row in check_of(run).itertuples()
    )


def all_calibrations():
    """Whether all calibrations reproduce the pile, the first result of the page of results."""
    outside = [run for run in RUNS if not lies_inside(run)]
    judged = judged_runs()
    unsure = [run for run in judged[Verdict.UNDECIDED] if run not in outside]
    first = (
        "**All calibrations give piles like the measured one.** Their mean angle and mean height lie within the target ranges."
        if not outside
        else f"**{number_word(len(RUNS) - len(outside)).capitalize()} of five calibrations give piles like the measured one.** "
        "Their mean angle and mean height lie within the target ranges."
    )
    if unsure:
        last = f" For {number_word(len(unsure))} of the five calibrations, this is not certain."
    else:
        last = ""
    return f"- {first}{last}\n"


def five_piles():
    """That the piles of the five calibrations agree, for README."""
    outside = [run for run in RUNS if not lies_inside(run)]
    count = (
        "all five"
        if not outside
        else f"{number_word(len(RUNS) - len(outside))} of the five"
    )
    return (
        "**The piles are similar, the parameters are not.** We calibrated the goji berry five times, with different settings. The mean "
        f"angles and heights of {count} calibrations lie within the target ranges, but each calibration has other parameters:\n"
    )


def certainty_of(run):
    """Whether a run meets its targets, a sentence; empty if it does with certainty."""
    verdict = judge_probability(probability_inside(run))
    if verdict is Verdict.MET:
        return ""
    piles = int(check_of(run)["n_seeds"].min())
    if verdict is Verdict.NOT_MET:
        return f" Its check, with {piles} piles, does not meet both targets."
    return (
        f" With only {piles} piles in its check, it is [not certain](docs/results.md#five-runs-five-parameter-sets) that it meets "
        "both targets."
    )


def at_bounds_of(run):
    """Which parameters of a run's answer lie at a bound, a sentence; empty if none does."""
    answer = answer_of(run)
    at_end = [
        f"`{name}`"
        for name in PARAMETERS
        if "bound" in parameter_cell(run, name, answer[name])
    ]
    if not at_end:
        return ""
    if len(at_end) == 1:
        return f" Its {at_end[0]} lies at a bound of the searched range."
    return f" Its {listed(at_end)} lie at bounds of the searched ranges."


def near_bounds_of(run):
    """Which parameters of a run's answer may lie at a bound, a sentence for each."""
    card = json.loads((KEPT / run.folder / "card.json").read_text())
    names = [text.split()[0] for text in card.get("near_bounds", [])]
    return "".join(
        f" Its `{name}` is so near to the bound of its range that the fit cannot tell them apart."
        for name in names
    )


def five_settings():
    """How the five calibrations differ, a list for README."""
    refined = RUN_OF_FOLDER["refined"]
    cells = check_cells(refined)[ANGLE][1], check_cells(DEFAULT)[ANGLE][1]
    words = {
        "goji_berry": "has the default settings. For simulations with this program and these "
        f"settings, run your own calibration, or use its parameters.{near_bounds_of(DEFAULT)}",
        "refined": f"continues `goji_berry` with more piles near its answer. Its angle is {cells[0]} off the measured one, and "
        f"that of `goji_berry` {cells[1]}. One run does not show that a second stage is better in general.",
        "paper": "has the settings of the article, as far as they are stated.",
        "matched": "simulates a rough clump of spheres instead of a smooth berry, and its contacts may pull.",
        "fast": "uses a search that needs fewer piles.",
    }
    return "".join(
        f"- **{run.name}** {words[run.folder]}{certainty_of(run)}{at_bounds_of(run)}\n"
        for run in RUNS
    )


def judged_runs():
    """The kept runs by the verdict on their checks."""
    runs = {verdict: [] for verdict in Verdict}
    for run in RUNS:
        runs[judge_probability(probability_inside(run))].append(run)
    return runs


def names_of(runs):
    return listed([run.name for run in runs])


def means_inside():
    """Whether the checks of all five runs lie in the target ranges, a paragraph."""
    outside = [run for run in RUNS if not lies_inside(run)]
    if not outside:
        return (
            "In all five runs, the mean angle and the mean height of the new piles that check the result lie within the target "
            "ranges."
        )
    return (
        f"In {number_word(len(RUNS) - len(outside))} of the five runs, the mean angle and the mean height of the new piles that "
        "check the result lie within the target ranges. Those of "
        f"{names_of(outside)} do not."
    )


def chances_inside():
    """How probable it is that each run meets the targets with very many piles, a paragraph."""
    judged = judged_runs()
    met, undecided = judged[Verdict.MET], judged[Verdict.UNDECIDED]
    parts = [
        "A result that is checked with only a few new piles may meet the targets by chance. The program therefore estimates "
        "the probability that the mean angle and height of very many piles would also lie within the target ranges."
    ]
    if met:
        least = min(probability_inside(run) for run in met)
        count = "all" if len(met) == len(RUNS) else number_word(len(met))
        parts.append(
            f"For {count} of our five runs, this probability is at least {floor_percent(least)}."
        )
    for run in undecided:
        piles = int(check_of(run)["n_seeds"].min())
        parts.append(
            f"For the run {run.name}, with {piles} new piles at rest, it is {probability_inside(run):.2f}."
        )
    if undecided:
        which = "such a result" if len(undecided) == 1 else "such results"
        parts.append(
            f"The program calls {which} [undecided](glossary.md). To decide, simulate more piles."
        )
    for run in judged[Verdict.NOT_MET]:
        parts.append(
            f"For the run {run.name}, it is only {probability_inside(run):.2f}, so this run does not meet the targets."
        )
    return " ".join(parts)


def floor_percent(probability):
    """A probability with two decimals that is not above it."""
    return f"{np.floor(100 * probability) / 100:.2f}"


def both_meet(run, other):
    """What a sentence says about the verdicts of two runs."""
    met = judged_runs()[Verdict.MET]
    if run in met and other in met:
        return "both meet the targets"
    return "the means of both checks lie within the target ranges"


def five_runs():
    """Which of the five runs meet the targets, and which compare one model with itself."""
    refined, fast = RUN_OF_FOLDER["refined"], RUN_OF_FOLDER["fast"]
    most = largest_difference(refined, DEFAULT).rpartition(" to ")[2]
    return (
        f"{means_inside()}\n\n"
        f"{chances_inside()}\n\n"
        "Different contact parameters can give similar piles, so do not read calibrated parameters as properties of the berry. "
        f"For example, the runs `goji_berry` and `fast` simulate the same model of the berry, and {both_meet(DEFAULT, fast)}. Yet "
        f"their parameters differ by {largest_difference(fast, DEFAULT)} of the width of the searched ranges. The "
        "[95 % intervals](uncertainty.md) of the parameters are wider than these differences.\n\n"
        "The five runs are not five independent repetitions:\n\n"
        "- The run `refined` continues the run `goji_berry` with more piles, so it uses the same piles of the first stage. Their "
        f"parameters differ by at most {most} of the width of the searched ranges.\n"
        "- The runs `paper` and `matched` use other models of the berry and another contact law.\n"
        "- Only `goji_berry` and `fast` calibrate the same model in separate searches.\n"
    )


def meeting_samples(run):
    """The samples of the design, and those whose poured means lie in all target ranges."""
    samples = run.table(run.samples)
    meets = pd.Series(True, index=samples.index)
    for target in run.settings()["targets"]:
        low, high = target["range"]
        meets &= samples[target["response"]].between(low, high)
    return samples, samples[meets]


def predicted_inside(run):
    """The samples whose means lie in all target ranges by the final surrogate."""
    predictions = run.table("network/predictions.csv")
    inside = pd.Series(True, index=predictions.index)
    for target in run.settings()["targets"]:
        stem = COLUMN_STEMS[target["response"]]
        unit = target["response"].rpartition("_")[2]
        inside &= predictions[f"{stem}_final_{unit}"].between(*target["range"])
    samples = run.table(run.samples)
    return samples[samples["sample"].isin(predictions.loc[inside, "sample"])]


def covered_share(run, samples, parameter):
    """Share of a parameter's range between the smallest and the largest of its values."""
    low, high = bounds_of(run, parameter)
    return np.ptp(samples[parameter]) / (high - low)


def widths_of(row):
    """Widths of the posterior intervals in a row of discrepancies, over the prior's."""
    shares = {}
    for parameter in PARAMETERS:
        low, high = bounds_of(DEFAULT, parameter)
        width = row[f"{parameter}_high"] - row[f"{parameter}_low"]
        shares[parameter] = min(1, width / (0.95 * (high - low)))
    return shares


def percent_range(shares):
    """Smallest and largest of some shares, in percent."""
    shares = list(shares)
    return f"{100 * min(shares):.0f} to {100 * max(shares):.0f} %"


def discrepancy_rows():
    """Posterior by the discrepancy: none, stated sizes, one line's models, all lines'."""
    table = DEFAULT.table("posterior/discrepancy.csv")
    stated = table[table["evidence"] == "stated"]
    by_line = pd.read_csv(ROOT / "research/answers/discrepancy_by_line.csv")
    return stated, by_line.set_index("line")


@dataclass(frozen=True)
class OpenShares:
    """How wide the intervals stay: all, of `mus_gg`, and of the other five."""

    all: str
    narrowest: str
    others: str
    size: str

    @classmethod
    def of(cls, row, size):
        shares = widths_of(row)
        others = [share for name, share in shares.items() if name != NARROWEST]
        return cls(
            all=percent_range(shares.values()),
            narrowest=f"{100 * shares[NARROWEST]:.0f} %",
            others=percent_range(others),
            size=size,
        )


def size_of(row):
    """A discrepancy by the shape study, in words."""
    return f"{row['aor_sd_deg']:.1f}° and {row['height_sd_mm']:.1f} mm"


def by_response(size):
    """The angle and the height of a discrepancy in words, each beside its name."""
    angle, height = size.split(" and ")
    return f"{angle} for the angle and {height} for the height"


def open_shares():
    """Widths of the intervals with all lines' models, the secant's, and no discrepancy."""
    stated, by_line = discrepancy_rows()
    pooled, secant = by_line.loc["all six"], by_line.loc["secant"]
    return (
        OpenShares.of(pooled, size_of(pooled)),
        OpenShares.of(secant, size_of(secant)),
        OpenShares.of(stated.iloc[0], "none"),
    )


def open_intervals():
    """How wide the intervals stay, with the discrepancy of each number."""
    pooled, secant, exact = open_shares()
    rows = [
        [f"{pooled.size}, the default", pooled.narrowest, pooled.others],
        [
            f"{secant.size}, one of our smaller estimates",
            secant.narrowest,
            secant.others,
        ],
        ["none: a perfect simulator", exact.narrowest, exact.others],
    ]
    head = [
        "assumed error of the simulator",
        f"`{NARROWEST}`, {KIND[NARROWEST]}",
        "the other five parameters",
    ]
    return markdown(head, rows)


def most_different_spans():
    """The parameter whose span of meeting samples differs most between two processors, and both spans."""
    spans = [
        {name: covered_share(run, meeting_samples(run)[1], name) for name in PARAMETERS}
        for run in (DEFAULT, SECOND)
    ]
    one, other = spans
    name = max(PARAMETERS, key=lambda name: abs(one[name] - other[name]))
    return name, *(f"{100 * span[name]:.0f} %" for span in spans)


def design():
    """What the design of `goji_berry` already meets."""
    samples, meeting = meeting_samples(DEFAULT)
    shares = {name: covered_share(DEFAULT, meeting, name) for name in PARAMETERS}
    least, most = min(shares, key=shares.get), max(shares, key=shares.get)
    noise = sample_noise(DEFAULT)
    predicted = predicted_inside(DEFAULT)
    both = set(predicted["sample"]) & set(meeting["sample"])
    of_network = {name: covered_share(DEFAULT, predicted, name) for name in PARAMETERS}
    narrowest = min(of_network, key=of_network.get)
    changed, here, there = most_different_spans()
    # Between the smallest and the largest of n points drawn evenly from a range.
    random_share = (len(meeting) - 1) / (len(meeting) + 1)
    return (
        "The targets exclude hardly any values of most parameters, so the pile alone cannot tell which values are right. In the "
        f"run `goji_berry`, our default calibration, {len(meeting)} of {len(samples)} samples meet both targets. From the "
        f"smallest to the largest value, they span {100 * shares[least]:.0f} % (`{least}`) to {100 * shares[most]:.0f} % "
        f"(`{most}`) of the searched ranges. For comparison, {len(meeting)} random values would span about "
        f"{100 * random_share:.0f} % of a range.\n\n"
        "The percentages depend on chance, because a single sample that meets the targets by chance can widen a span. For "
        f"`{changed}`, for example, the span is {here} in the run `goji_berry`. In the same study on another type of "
        f"processor, it is {there}.\n\n"
        "Some samples of the run `goji_berry` meet the targets only by chance, because the means of six piles vary. The program "
        "simulates six piles for each sample and uses their mean angle and height. On average over the "
        f"searched ranges, these means have standard errors of {noise[ANGLE]:.1f}° and {noise[HEIGHT]:.1f} mm. Near the "
        "parameter set that the run proposes, single piles vary less, so the standard errors are smaller there.\n\n"
        f"The targets probably restrict `{narrowest}`, {KIND[narrowest]}, more than single samples show. The neural network of "
        "the run `goji_berry` averages out the random variation of the piles. According to the network, "
        f"{len(predicted)} of the samples meet both targets, and {len(both)} of these did so in the simulations. These "
        f"{len(predicted)} samples cover {100 * of_network[narrowest]:.0f} % of the range of `{narrowest}`, and the samples "
        f"that met the targets in the simulations {100 * shares[narrowest]:.0f} %.\n"
    )


def network_widths():
    """What a perfect simulator would leave of the intervals, by the networks of two processors."""
    rows = [run.table("posterior/discrepancy.csv").iloc[0] for run in (DEFAULT, SECOND)]
    widths = [widths_of(row) for row in rows]
    here, there = (f"{100 * width[NARROWEST]:.0f}" for width in widths)
    others = min(
        share for width in widths for name, share in width.items() if name != NARROWEST
    )
    return (
        "The neural networks of `goji_berry` and of the same study on another processor smooth out the random variation of the "
        f"piles. If the simulator had no error, the networks would narrow the 95 % interval of `{NARROWEST}` to {here} and "
        f"{there} % of its width before the measurement. The intervals of the other parameters would keep "
        f"{100 * others:.0f} % or more.\n"
    )


def spread_of_samples():
    """How different the samples of `goji_berry` are that meet both targets."""
    samples, meeting = meeting_samples(DEFAULT)
    share, share_of_second = (
        f"{100 * covered_share(run, meeting_samples(run)[1], NARROWEST):.0f} %"
        for run in (DEFAULT, SECOND)
    )
    return (
        "The measured pile alone cannot tell you which contact parameters are right, because very different parameters give "
        f"similar piles. In the run `goji_berry`, for example, we simulated {len(samples)} parameter sets before the search, and "
        f"{len(meeting)} of them met both targets. For most parameters, the values of these {len(meeting)} sets are spread over "
        "nearly the whole searched range.\n\n"
        "To see how uncertain a parameter is, use its [95 % interval](uncertainty.md). Do not use the spread of the simulated "
        "parameter sets that meet the targets, because a single set that meets them by chance can widen this spread.\n\n"
        "For example, we ran the same study on two types of processor, and different parameter sets met the targets by chance. For "
        f"`{NARROWEST}`, {KIND[NARROWEST]}, the spread was {share} of the searched range on one processor and "
        f"[{share_of_second} on the other](../research/docs/kept_runs.md#the-samples-of-goji_berry). So the spread alone says little.\n"
    )


def ends_of(warning):
    """The ends of ranges that a warning of a parameter set names, as ("mus_gg", "lower")."""
    found = re.match(r"at a bound: ([^;]*)", warning)
    ends = [] if found is None else [end.split() for end in found[1].split(", ")]
    return [
        (name, "lower" if side == "low" else "upper") for name, side in map(tuple, ends)
    ]


def solutions_at_bounds(run):
    """How many solutions of a run lie at any bound, at each bound, and how many there are."""
    solutions = run.table(run.solutions)
    ends = [ends_of(warning) for warning in solutions["warning"].dropna()]
    counts = pd.Series([end for of_one in ends for end in of_one]).value_counts()
    return sum(map(bool, ends)), counts.to_dict(), len(solutions)


def summary_of(run):
    """What the search of a run writes beside its solutions."""
    return json.loads((KEPT / run.folder / "miga/summary.json").read_text())


def answer_and_bounds(run):
    """Which parameters of a run's answer lie at or near a bound, a sentence."""
    answer = answer_of(run)
    at_end = [
        name
        for name in PARAMETERS
        if "bound" in parameter_cell(run, name, answer[name])
    ]
    near = [
        entry
        for entry in summary_of(run)["near_bounds"]
        if entry["parameter"] not in at_end
    ]
    if at_end:
        first = f"The parameter set that the run proposes has {listed([f'`{name}`' for name in at_end])} at a bound."
    else:
        first = "The parameter set that the run proposes lies at no bound."
    words = [
        f"its `{entry['parameter']}` of {entry['value']:.3f} is so near to the bound of {entry['bound']:g} that the fitted "
        "model cannot tell the difference"
        for entry in near
    ]
    return f"{first} However, {listed(words)}." if words else first


def bounds():
    """How many solutions of `goji_berry` lie at a bound of the searched ranges."""
    at_any, counts, count = solutions_at_bounds(DEFAULT)
    old_low, _ = bounds_of(DEFAULT, "mus_gg")
    solutions = WIDER.table(WIDER.solutions)["mus_gg"]
    others = list(dict.fromkeys(f"`{name}`" for name, _ in counts if name != "mus_gg"))
    not_widened = (
        f" We did not search a wider range of {listed(others)}." if others else ""
    )
    introduction = (
        "If a search finds many parameter sets at the end of a searched range, better sets may lie beyond this end. To find out, "
        "repeat the calibration with a wider range.\n\n"
    )
    if at_any:
        parts = [
            f"{number} at the {side} bound of `{name}`, {KIND[name]}"
            for (name, side), number in counts.items()
        ]
        found = (
            "In our default calibration of the goji berry, the run `goji_berry`, "
            f"{at_any} of the {count} parameter sets that the search found lie at one bound or at several:\n\n"
            f"{''.join(f'- {part}{chr(10)}' for part in parts)}\n"
            f"{answer_and_bounds(DEFAULT)}\n\n"
        )
    else:
        found = (
            "In our default calibration of the goji berry, the run `goji_berry`, "
            f"none of the {count} parameter sets that the search found lies at a bound. {answer_and_bounds(DEFAULT)}\n\n"
        )
    return (
        f"{introduction}{found}"
        f"For `mus_gg`, {KIND['mus_gg']}, we searched a wider range in another run, which also contains smaller values than the "
        f"lower bound of {old_low:g}. The search of this run ended at values of `mus_gg` from {solutions.min():.2f} to "
        f"{solutions.max():.2f}, although it could have gone further. Parameter sets below the bound give the "
        "measured pile [about as often](../research/docs/kept_runs.md#a-wider-range-of-mus_gg) as those above it. So the bound "
        f"of `mus_gg` does not exclude the better sets.{not_widened}\n"
    )


def warned_solutions():
    """What the column `warning` says of the solutions of `goji_berry`, for its page."""
    at_any, _, count = solutions_at_bounds(DEFAULT)
    warnings = DEFAULT.table(DEFAULT.solutions)["warning"].dropna()
    far = int(warnings.str.contains("nearest").sum())
    outside = int(warnings.str.contains("leverage").sum())
    others = [
        f"{number} of them {words}"
        for number, words in (
            (far, "far from every sample"),
            (outside, "outside the cloud of samples"),
        )
        if number
    ]
    if others:
        rest = f"The column `warning` also marks {listed(others)}."
    else:
        rest = "The column `warning` marks no other problem of these sets."
    at_bound = f"{at_any} of the {count} sets" if at_any else "none of the sets"
    return (
        "If the search finds many parameter sets in which a parameter lies at a bound, search a wider range. The bounds are the "
        "ends of the range that you search, so better sets may lie beyond them. In our calibration of goji berries, "
        f"[{at_bound} lie at a bound](results.md#parameters-at-the-end-of-a-range). {rest}\n"
    )


def wider_run():
    """What the run with a wider range of mus_gg found beyond the article's bound."""
    old_low, _ = bounds_of(DEFAULT, "mus_gg")
    low, high = bounds_of(WIDER, "mus_gg")
    samples, meeting = meeting_samples(WIDER)
    beyond = samples["mus_gg"] < old_low
    meeting_beyond = meeting["mus_gg"] < old_low
    solutions = WIDER.table(WIDER.solutions)["mus_gg"]
    check = check_cells(WIDER)
    meets = judge_probability(probability_inside(WIDER)) is Verdict.MET
    counts = [
        [meeting_beyond.sum(), beyond.sum() - meeting_beyond.sum()],
        [(~meeting_beyond).sum(), (~beyond).sum() - (~meeting_beyond).sum()],
    ]
    chance = stats.fisher_exact(counts).pvalue
    return (
        f"In the run `wider`, we searched `mus_gg`, {KIND['mus_gg']}, from {low:g} to {high:g}. The lower bound of the other runs, "
        f"{old_low:g}, is that of Table 2 of Ji et al. 2026. The bound does not separate good parameter sets from bad ones. Below "
        f"it, {meeting_beyond.sum()} of {beyond.sum()} samples meet both targets, and above it {(~meeting_beyond).sum()} of "
        f"{(~beyond).sum()}. A difference of this size can easily arise by chance (Fisher's exact test, p = {chance:.2f}).\n\n"
        "Values of `mus_gg` below the bound are possible, but not needed. The search of the run `wider` ended near the bound, with "
        f"{len(solutions)} solutions between {solutions.min():.3f} and {solutions.max():.3f}. New piles with the calibrated "
        f"parameters have an angle of {check[ANGLE][0]} and a height of {check[HEIGHT][0]}, so "
        f"{'they meet both targets' if meets else 'it is not certain that they meet both targets'}.\n\n"
        "The calibrated parameters of the run `wider` differ from those of `goji_berry` by "
        f"{largest_difference(WIDER, DEFAULT)} of the width of the searched ranges.\n"
    )


def overlap(found, published):
    """Whether two intervals (low, high) have a point in common."""
    return found[0] <= published[1] and published[0] <= found[1]


def common_parameters(run):
    """The parameters whose spans of found solutions overlap the article's, and all."""
    table3 = pd.read_csv(ARTICLE / "table3.csv").set_index("parameter")
    published = {name: tuple(table3.loc[name, ["low", "high"]]) for name in PARAMETERS}
    solutions = run.table(run.solutions)
    found = {
        name: (solutions[name].min(), solutions[name].max()) for name in PARAMETERS
    }
    common = [name for name in PARAMETERS if overlap(found[name], published[name])]
    return common, found, published


def intervals():
    """The spans of the solutions found beside the article's Table 3."""
    head = ["", *(f"`{name}`" for name in PARAMETERS), "overlap with the article"]
    rows = []
    for run in RUNS:
        if run.solutions is None:
            continue
        common, found, published = common_parameters(run)
        if not rows:
            rows.append(
                ["article, Table 3", *map(interval_cell, published.values()), "-"]
            )
        names = ", ".join(f"`{name}`" for name in common)
        count = f"{len(common)} of 6"
        rows.append(
            [
                run.name,
                *map(interval_cell, found.values()),
                f"{count}: {names}" if common else count,
            ]
        )
    return markdown(head, rows)


def interval_cell(ends):
    low, high = ends
    return f"{low:.3f}-{high:.3f}"


def designs():
    """How many samples of each kept design meet both targets."""
    head = ["", "samples that meet both targets", *(f"`{name}`" for name in PARAMETERS)]
    rows = []
    for run in (DEFAULT, SECOND, *(run for run in RUNS if run is not DEFAULT)):
        if run.samples is None:
            continue
        samples, meeting = meeting_samples(run)
        at_rest = samples[ANGLE].notna().sum()
        shares = [
            f"{100 * covered_share(run, meeting, name):.0f} %" for name in PARAMETERS
        ]
        rows.append([run.name, f"{len(meeting)} of {at_rest}", *shares])
    return markdown(head, rows)


def poured_published_sets():
    """The published sets as the present engine pours them, by solution."""
    sets = pd.read_csv(ARTICLE / "simulated.csv").set_index("solution")
    return sets.rename(
        columns={
            "aor_flank_deg": ANGLE,
            "aor_flank_se_deg": f"{ANGLE}_se",
            "aor_straightest_deg": STRAIGHTEST,
            "aor_straightest_se_deg": f"{STRAIGHTEST}_se",
            "height_se_mm": f"{HEIGHT}_se",
            "n_seeds": "pours",
        }
    )


def cell_of_set(sets, solution, target):
    """Mean and standard error of a published set."""
    return with_error(sets.loc[solution, target], sets.loc[solution, f"{target}_se"])


def stated_by_article(solution, article):
    """What the article states as angle and Height of one of its sets."""
    if solution not in article.index:
        return "31.27 (measured), -"
    row = article.loc[solution]
    if pd.isna(row["aor_simulated_deg"]):
        return f"predicted {row['aor_predicted_deg']:.1f}, {row['height_predicted_mm']:.1f}"
    return f"{row['aor_simulated_deg']:.1f}, {row['height_simulated_mm']:.1f}"


def published_sets():
    """The article's sets as they pile up here, and in earlier draws."""
    head = [
        "set",
        "article: angle, Height",
        "here: `flank`, °",
        "`straightest`, °",
        "Height, mm",
        "pours",
        "earlier: `flank`, °",
        "Height, mm",
        "pours",
    ]
    article = pd.read_csv(ARTICLE / "table4.csv").set_index("solution")
    poured = poured_published_sets()
    earlier = pooled_published_sets().set_index("solution")
    rows = [
        [
            solution if solution in article.index else "Yu et al. 2022",
            stated_by_article(solution, article),
            cell_of_set(poured, solution, ANGLE),
            cell_of_set(poured, solution, STRAIGHTEST),
            cell_of_set(poured, solution, HEIGHT),
            poured.loc[solution, "pours"],
            cell_of_set(earlier, solution, ANGLE),
            cell_of_set(earlier, solution, HEIGHT),
            earlier.loc[solution, "pours"],
        ]
        for solution in poured.index
    ]
    return markdown(head, rows)


def flatter_by(line):
    """Mean difference of the article's angles from ours, and its standard error.

    The error is that of the scatter of the sets' differences. So it holds the errors of
    the article's single pours, too.
    """
    article = pd.read_csv(ARTICLE / "table4.csv").set_index("solution")
    simulated = article["aor_simulated_deg"].dropna()
    poured = poured_published_sets().loc[simulated.index, line]
    differences = simulated - poured
    return differences.mean(), differences.sem(), len(differences)


def published_verdict():
    """Whether the article's sets meet its own ranges, by both lines."""
    article = pd.read_csv(ARTICLE / "table4.csv").set_index("solution")
    sets = poured_published_sets().loc[article.index]
    angle_range, height_range = (
        target["range"] for target in DEFAULT.settings()["targets"]
    )
    low, high = angle_range
    inside = {line: sets[line].between(*angle_range) for line in (ANGLE, STRAIGHTEST)}
    height_inside = sets[HEIGHT].between(*height_range)
    all_heights = "all" if height_inside.all() else f"{height_inside.sum()} of"
    flatter, error, count = flatter_by(ANGLE)
    straight, straight_error, _ = flatter_by(STRAIGHTEST)
    return (
        "With the parameter sets that Ji et al. published, our piles have the right height. For "
        f"{all_heights} {len(sets)} sets, the mean height lies within its target range. Whether the angle is right depends on "
        "the line along which you measure it:\n\n"
        f"- **`straightest`**: the mean angle lies within its target range, {low:g} to {high:g}°, for "
        f"{inside[STRAIGHTEST].sum()} of the {len(sets)} sets.\n"
        f"- **`flank`**: {inside[ANGLE].sum() or 'none'} of the sets gives a mean angle within this range.\n\n"
        "With the same contact parameters, our piles seem to be flatter than those of Ji et al., but we cannot be certain. On "
        f"average, our angle is {with_error(flatter, error)}° smaller along the line between 30 and 80 % of the height (`flank`). "
        f"Along the straightest part of the side (`straightest`), it is {with_error(straight, straight_error)}° smaller. "
        "These standard errors "
        "[may be too small](../research/docs/kept_runs.md#the-published-parameter-sets), because Ji et al. report only "
        f"{count} simulated angles, each from a single pile. The difference may therefore be due to chance.\n\n"
        "You can still calibrate our simulator although its piles are flatter. The calibration changes the contact parameters "
        "until the simulated angle lies within its target range.\n"
    )


def published_difference():
    """How sure the difference of the article's simulated angles from ours is."""
    article = pd.read_csv(ARTICLE / "table4.csv").set_index("solution")
    sets = poured_published_sets().loc[article.index]
    low, _ = DEFAULT.settings()["targets"][0]["range"]
    clear = low - sets[ANGLE] > 2 * sets[f"{ANGLE}_se"]
    flatter, error, count = flatter_by(ANGLE)
    straight, straight_error, _ = flatter_by(STRAIGHTEST)
    # A pour of the article is taken to scatter as ours do.
    pour = (sets[f"{ANGLE}_se"] * np.sqrt(sets["pours"])).mean()
    return (
        f"Along `flank`, {clear.sum()} of the {len(sets)} published sets lie below the lower end of the target range, {low:g}°, by "
        "more than two standard errors. Along `straightest`, the set with the smallest angle has "
        f"{sets[STRAIGHTEST].min():.2f} ± {sets.loc[sets[STRAIGHTEST].idxmin(), f'{STRAIGHTEST}_se']:.2f}°.\n\n"
        f"Ji et al. 2026 report a simulated angle for {count} of their sets, each from a single pile. On average over these sets, "
        f"our angle is {with_error(flatter, error)}° smaller along `flank` and {with_error(straight, straight_error)}° smaller "
        "along `straightest`.\n\n"
        f"These standard errors may be too small, because each is estimated from only {count} differences. Suppose that "
        "the angles of single piles in the simulator of Ji et al. have a standard deviation of "
        f"{pour:.1f}°, as in ours. The mean difference then has a standard error of {pour / np.sqrt(count):.1f}°, and it may be "
        "due to chance.\n"
    )


def first_draw():
    """What the first pours of the article's representative set alone would have shown."""
    draws = pd.read_csv(KEPT / "published_sets" / "draws.csv")
    first = draws[
        (draws["processor"] == REPEATED_ON) & (draws["solution"] == "representative")
    ].iloc[0]
    pours = int(first["n_seeds"])
    all_pours = poured_published_sets().loc["representative"]
    return (
        "Do not judge a parameter set by only a few simulated piles, because they can meet a target by chance. This happened "
        "with the set that Ji et al. 2026 propose as their result (`representative`):\n\n"
        f"- Of the first twelve piles, {pours} came to rest. Their mean angle, "
        f"{with_error(first['aor_flank_deg'], first['aor_flank_se_deg'])}°, and their mean height, "
        f"{with_error(first['height_mm'], first['height_se_mm'])} mm, were within the target ranges.\n"
        f"- After more simulations, the mean angle of all {all_pours['pours']} piles that came to rest was only "
        f"{with_error(all_pours[ANGLE], all_pours[f'{ANGLE}_se'])}°, below the target range.\n"
    )


def verdict():
    """The verdict of `goji_berry` as the terminal prints it."""
    card = json.loads((KEPT / DEFAULT.folder / "card.json").read_text())
    first_line, *_ = card_text.format_verdict(card).splitlines()
    return f"    {first_line}\n"


def check_of(run):
    """The check of a run's answer: a row for each target."""
    return run.table(f"{Path(run.answer).parent}/representative.csv")


def check_cells(run):
    """Simulated mean, and percent off the measured mean, of a run's answer, by target."""
    cells = {}
    for row in check_of(run).itertuples():
        unit = "°" if row.response == ANGLE else " mm"
        # Adding zero turns -0.0 into 0.0.
        percent = round(100 * (row.simulated / row.physical_mean - 1), 1) + 0.0
        percent_error = 100 * row.simulated_se / row.physical_mean
        cells[row.response] = (
            f"{row.simulated:.1f} ± {row.simulated_se:.1f}{unit}",
            f"{percent:+.1f} ± {percent_error:.1f} %",
        )
    return cells


def deviation_range(run, target):
    """Smallest and largest deviation of a prediction from its check, in percent."""
    table4 = run.table(run.answer)
    percents = table4[f"{COLUMN_STEMS[target]}_error_percent"]
    return f"{percents.min():.1f} to {percents.max():.1f} %"


def metrics_of(run):
    """The accuracy of a run's network."""
    return json.loads((KEPT / run.folder / "network/metrics.json").read_text())


def r_squared(run):
    """R² on the test samples, for angle and Height."""
    metrics = metrics_of(run)
    values = [metrics["test"][name]["r2"] for name in (ANGLE, HEIGHT)]
    return ", ".join(f"{value:.2f}" for value in values)


def sample_noise(run):
    """Root mean square of the standard errors of the samples' means, by target."""
    samples = run.table(run.samples)
    return {
        target: np.sqrt((samples[f"{stem}_se_{target.rpartition('_')[2]}"] ** 2).mean())
        for target, stem in COLUMN_STEMS.items()
    }


def perfect_r_squared(run):
    """R² on the test samples of a model that knows their true means.

    The rest is the noise of the pours. That of a sample is the mean over the design.
    """
    predictions = run.table("network/predictions.csv")
    tests = predictions[predictions["split"] == "test"]
    noise = sample_noise(run)
    values = [
        f"{1 - noise[name] ** 2 / tests[name].var(ddof=0):.2f}"
        for name in (ANGLE, HEIGHT)
    ]
    return ", ".join(values)


def test_errors(run):
    """Root mean square error on the test samples, and the noise of one such sample."""
    metrics = metrics_of(run)
    errors = {name: metrics["test"][name]["rmse"] for name in (ANGLE, HEIGHT)}
    return tuple(
        f"{values[ANGLE]:.2f}°, {values[HEIGHT]:.2f} mm"
        for values in (errors, sample_noise(run))
    )


def within_cell(run):
    """Probabilities that both true means lie within 1 and 2 % of the measured ones."""
    row = check_of(run).iloc[0]
    return f"{row['within_1_percent']:.2f}, {row['within_2_percent']:.2f}"


def default_run():
    """The check and network of `goji_berry` beside the article's."""
    check = check_cells(DEFAULT)
    rmse, noise = test_errors(DEFAULT)
    rows = [
        [
            "angle of the answer, simulated",
            "one simulation, 0.76 % off",
            ", ".join(check[ANGLE]),
        ],
        [
            "Height of the answer, simulated",
            "one simulation, 1.33 % off",
            ", ".join(check[HEIGHT]),
        ],
        [
            "probability that both true means are within 1 %, 2 %",
            "-",
            within_cell(DEFAULT),
        ],
        [
            "predicted against simulated angle, six solutions (article: five)",
            "below 5 %",
            deviation_range(DEFAULT, ANGLE),
        ],
        [
            "predicted against simulated Height, the same",
            "below 5 %",
            deviation_range(DEFAULT, HEIGHT),
        ],
        [
            "R² on the test samples, angle and Height",
            "0.94, 0.94",
            r_squared(DEFAULT),
        ],
        [
            "the same for a perfect model, by the noise below",
            "-",
            perfect_r_squared(DEFAULT),
        ],
        ["root mean square error on the test samples", "1.06°, 0.84 mm", rmse],
        ["noise of a test sample (standard error of six pours)", "-", noise],
    ]
    return markdown(["number", "article", "`goji_berry`"], rows)


def sets_flatter_than_predicted():
    """How many sets of Table 4 have a smaller angle than predicted."""
    table4 = DEFAULT.table(DEFAULT.answer)
    return int((table4["aor_predicted_deg"] > table4["aor_simulated_deg"]).sum())


def counted_flatter():
    """How many of the sets simulated again were flatter than predicted, in words."""
    flatter, count = sets_flatter_than_predicted(), len(DEFAULT.table(DEFAULT.answer))
    return f"all {count}" if flatter == count else f"{flatter} of {count}"


def beside_article():
    """README's short table: checks and predictions beside the article's."""
    ours, refined = check_cells(DEFAULT), check_cells(RUN_OF_FOLDER["refined"])
    article = pd.read_csv(ARTICLE / "table4.csv").set_index("solution")
    article_sets = poured_published_sets().loc[article.index]
    rows = [
        [
            "angle of the answer: off the measured 32.87°, in % of it",
            "one simulation, 0.76 % off",
            f"`goji_berry`: {ours[ANGLE][1]}; `refined`: {refined[ANGLE][1]}",
        ],
        [
            "Height of the answer: off the measured 65.57 mm, in % of it",
            "one simulation, 1.33 % off",
            f"`goji_berry`: {ours[HEIGHT][1]}; `refined`: {refined[HEIGHT][1]}",
        ],
        [
            "error of the predicted angle, in % of the simulated; six sets (article: five)",
            "below 5 %",
            f"`goji_berry`: {deviation_range(DEFAULT, ANGLE)}; {counted_flatter()} flatter than predicted",
        ],
        [
            "error of the predicted Height, in % of the simulated",
            "below 5 %",
            f"`goji_berry`: {deviation_range(DEFAULT, HEIGHT)}",
        ],
        [
            "R² of the network on test samples (1 is perfect), angle and Height",
            "0.94, 0.94",
            f"`goji_berry`: {r_squared(DEFAULT)}; [a perfect model](research/docs/network_tests.md#what-the-articles-094-would-take) "
            f"is expected to have about {perfect_r_squared(DEFAULT)}; with {metrics_of(DEFAULT)['n_test']} samples, both vary by chance",
        ],
        [
            "the article's sets, simulated; it states five of six",
            "31.2 to 33.7°",
            f"[by `flank`](docs/results.md#the-published-parameter-sets-in-this-simulator) {degrees_of(article_sets[ANGLE])}, "
            f"by `straightest` {degrees_of(article_sets[STRAIGHTEST])}; target 31 to 34°",
        ],
    ]
    return markdown(["", "article", "this program"], rows)


def degrees_of(angles):
    """The smallest and the largest of some angles."""
    return f"{angles.min():.1f} to {angles.max():.1f}°"


def lines():
    """The angle of the answer of `goji_berry` by each line."""
    answer = answer_of(DEFAULT)
    rows = [
        [name, with_error(answer[f"aor_{key}_deg"], answer[f"aor_{key}_se_deg"]) + "°"]
        for name, key in LINES.items()
    ]
    return markdown(["line", "angle of the answer"], rows)


def drum_means(run):
    """Mean and standard error of each quantity of a run's drum."""
    summary = run.table("drum/summary.csv").set_index("key")
    return {
        key: with_error(row["mean"], row["standard_error"])
        if row["runs"] > 1
        else f"{row['mean']:.0f}"
        for key, row in summary.iterrows()
    }


def drum():
    """When and how the bed slips in the drum, at the answers of the kept runs."""
    means = drum_means(DEFAULT)
    runs = pd.read_csv(ROOT / "research/answers/drum_slip.csv")
    ours = runs[runs["case"] == "our answer"]
    again = mean_with_error(ours["before_turned_deg"])
    runs_of_paper = len(PAPER.table("drum/runs.csv"))
    single = ", a single simulation" if runs_of_paper == 1 else ""
    return (
        f"In our simulated drum, the bed of berries first slips after the drum has rotated by {means['before_turned_deg']}°. "
        "This is much later than in the drum of Ji et al. 2026: according to the times in their article, the bed slips after "
        "27°. For this comparison, we used the contact parameters from our default calibration, the run `goji_berry`. Just "
        f"before the slip, the surface of the simulated bed has a slope of {means['before_surface_deg']}°. After the slip, its "
        f"slope is {means['after_surface_deg']}°.\n\n"
        "The late slip in our simulated drum does not come from one particular calibration. According to the times in the "
        "article by Ji et al. 2026, the bed in their drum slips after 27° of rotation. In our drum, it slips much later with "
        "the contact parameters of each calibration that we tried:\n\n"
        "- Default settings on another type of processor (`second_processor`), six additional simulations: after "
        f"{again}° on average.\n"
        f"- Another particle and contact law (`matched`): after {drum_means(MATCHED)['before_turned_deg']}°.\n"
        f"- The settings of Ji et al. 2026 (`paper`){single}: after {drum_means(PAPER)['before_turned_deg']}°.\n"
    )


def drum_quantities():
    """The first slip of the drum of `goji_berry`."""
    means = drum_means(DEFAULT)
    rows = [
        ["time since the rotation began", f"{means['before_time_s']} s", "-"],
        ["rotation of the drum", f"{means['before_turned_deg']}°", "-"],
        [
            "angle of the surface",
            f"{means['before_surface_deg']}°",
            f"{means['after_surface_deg']}°",
        ],
        [
            "angle of the centre of mass",
            f"{means['before_bed_deg']}°",
            f"{means['after_bed_deg']}°",
        ],
        [
            "motion of the uppermost layer in the drum",
            "-",
            f"{means['surface_moved_mm']} mm",
        ],
        ["motion of the lowest layer", "-", f"{means['wall_moved_mm']} mm"],
    ]
    return markdown(["quantity", "at the first slip", "after the slip"], rows)


def optimism():
    """What the program expected its predictions to be off by, and what the check found."""
    table4 = DEFAULT.table(DEFAULT.answer)
    others = table4[table4["role"] != "representative"]
    expected = others["aor_optimism_deg"]
    answer = answer_of(DEFAULT)
    expected_answer = (
        f"{answer['aor_optimism_deg']:.2f} ± {answer['aor_optimism_se_deg']:.2f}°"
    )
    found = table4["aor_predicted_deg"] - table4["aor_simulated_deg"]
    found_answer = with_error(found[answer.name], answer["aor_se_deg"])
    found_others = found[others.index]
    typical_error = others["aor_se_deg"].mean()
    mean_error = typical_error / np.sqrt(len(others))
    mean_found = with_error(found_others.mean(), mean_error)
    rest = found[answer.name] - answer["aor_optimism_deg"]
    rest_error = np.hypot(answer["aor_se_deg"], answer["aor_optimism_se_deg"])
    if abs(rest) < 2 * rest_error:
        agreement = (
            "The estimate agrees with this result within the errors. However, the error of the simulated angle is so large that "
            "many other estimates would agree with it, too."
        )
    else:
        agreement = (
            f"The estimate explains hardly anything of this difference: the rest, {with_error(rest, rest_error)}°, is "
            f"{abs(rest) / rest_error:.0f} times its standard error."
        )
    rest_others = found_others.mean() - expected.mean()
    if abs(rest_others) < 2 * mean_error:
        of_others = "For these sets together, the estimate agrees with the simulations within the errors."
    else:
        of_others = "For these sets, too, the estimate covers only a part of the error."
    largest = found_others.abs().max()
    flatter = sets_flatter_than_predicted()
    network_error = posterior_of(DEFAULT)["network_ensemble_se"][0]
    if flatter == len(table4):
        bias = "All these predictions come from the same network, so a common error of the network is the likely cause."
    else:
        bias = (
            "The angles of single sets have standard errors of about "
            f"{typical_error:.1f}°, so this count alone does not show a bias. The large difference at the answer, with its small "
            "standard error, does."
            if abs(rest) >= 2 * rest_error
            else "So this run does not show a bias of the network."
        )
    return (
        "The expected optimism is an estimate by the program: the predicted angle minus the angle that new simulations will "
        "probably give. For the parameter set that our default calibration, the run `goji_berry`, proposes, this estimate is "
        f"{expected_answer}. In the simulations that followed, the mean angle was {found_answer}° smaller than predicted. "
        f"{agreement}\n\n"
        "Do not correct a predicted angle by the expected optimism, the program's estimate of its error, because this estimate "
        f"covers only a part of the error. To test it, we simulated {len(others)} additional solutions of our default "
        "calibration, the run `goji_berry`. A solution is a parameter set that is predicted to meet the targets. According to "
        f"the estimate, the predicted angles of these solutions are too large by {expected.mean():.1f}° on average.\n"
        f"In the simulations, they turned out to be too large by {mean_found}° on average. {of_others} For a single solution, "
        f"the simulated angle was up to {largest:.1f}° away from the predicted one, with a standard error of about "
        f"{typical_error:.1f}°.\n\n"
        "Always check predicted angles with new simulations, because the neural network that predicts them may have a bias near "
        "the solutions. When we simulated solutions of our default calibration, the run `goji_berry`, the angles of "
        f"{counted_flatter()} solutions were smaller than predicted. {bias}\n"
        f"The network itself reports only its random error, which is {network_error:.1f}° for "
        "these angles. The 95 % intervals of the parameters take this random error into account, but not a bias.\n"
    )


def check_cells_beside(run):
    """The simulated angle of a run's answer, its distance from the measured one, and the errors."""
    row = check_of(run).set_index("response").loc[ANGLE]
    value, error = measured(ANGLE)
    return row["simulated"] - value, row["simulated_se"], error


def verdict_words():
    """What the numbers of the verdict mean, and whether the angle agrees, for README."""
    row = check_of(DEFAULT).set_index("response")
    at_rest = int(row.loc[ANGLE, "n_seeds"])
    poured = DEFAULT.settings()["validation"]["representative_seeds"]
    failed = poured - at_rest
    deviations = [
        row.loc[name, "simulated_se"] * np.sqrt(row.loc[name, "n_seeds"])
        for name in (ANGLE, HEIGHT)
    ]
    if failed == 0:
        rest = "All piles came to rest."
    else:
        rest = f"{number_word(failed).capitalize()} more of the {poured} piles did not come to rest."
    distance, error, measured_error = check_cells_beside(DEFAULT)
    side = "below" if distance < 0 else "above"
    answer = answer_of(DEFAULT)
    along = [answer[f"aor_{key}_deg"] for key in LINES.values()]
    ranges = {
        target["response"]: "{:g} to {:g}".format(*target["range"])
        for target in DEFAULT.settings()["targets"]
    }
    if abs(distance) < 2 * error:
        agreement = "The simulated angle agrees with the measured mean within its standard error."
    else:
        agreement = (
            f"The simulated angle lies {abs(distance):.1f}° {side} the measured mean, which is {abs(distance) / error:.0f} times its "
            "standard error. So the calibration met the target range, but missed its aim, the measured mean. The measured mean "
            f"itself has a standard error of {measured_error:.1f}°. With both errors, the distance is "
            f"{abs(distance) / math.hypot(error, measured_error):.1f} standard errors."
        )
    return (
        "- **Targets met** means that the mean angle and the mean height of the new piles lie in their target ranges, "
        f"{ranges[ANGLE]}° and {ranges[HEIGHT]} mm.\n"
        "- **The angle of repose** is the slope of a line fitted to the side of a pile, here between 30 and 80 % of its height.\n"
        "- **The Height** is measured from the plate to the top of the pile. Ji et al. 2026 write it with a capital letter, and so "
        "do we.\n"
        f"- **A number after +-** is the standard error of the mean of {at_rest} simulated piles. {rest} Single piles vary much "
        f"more, with standard deviations of {deviations[0]:.1f}° and {deviations[1]:.1f} mm.\n"
        "- **A percentage** is the difference from the measured mean.\n\n"
        f"{agreement}\n\n"
        "An angle within its target range does not prove that the simulator is right. The article does not say along which part of "
        "a pile's side the angle was measured. We [chose a part](docs/angle_line.md) along which simulated piles can have the "
        "published angle. Along [other parts](docs/measurement.md#definitions), the same piles have angles from "
        f"{min(along):.0f} to {max(along):.0f}°.\n"
    )


def other_processor():
    """What the same study found on another type of processor, for README."""
    cells = check_cells(SECOND)
    meets = judge_probability(probability_inside(SECOND)) is Verdict.MET
    link = "research/docs/kept_runs.md#the-same-calibration-on-other-processors"
    result = "also met its targets" if meets else "is not certain to meet its targets"
    return (
        "On your computer, the study may give other piles and other parameters than ours. Each type of processor rounds numbers "
        "differently, and these differences grow during a simulation. On a second type of processor, the same study "
        f"[{result}]({link}), with an angle of {cells[ANGLE][0]}, a Height of {cells[HEIGHT][0]} and other parameters.\n"
    )


def meeting_words():
    """How far the samples that meet both targets are spread, for README."""
    samples, meeting = meeting_samples(DEFAULT)
    name, here, there = most_different_spans()
    return (
        "Very different parameters give piles within the target ranges, so with the error that we assume for the simulator, the "
        "pile by itself determines none of the six parameters. Of the "
        f"{len(samples)} sets that the run `goji_berry` simulated first, {len(meeting)} met both targets. The last row of the "
        f"table says how much of each searched range these {len(meeting)} sets cover. (Chance plays a part: they cover {here} of "
        f"the range of `{name}`, and {there} on another type of processor.)\n"
    )


def agreement_of_default():
    """How near the check of `goji_berry` comes to the measured means, for the page of results."""
    distance, error, measured_error = check_cells_beside(DEFAULT)
    side = "below" if distance < 0 else "above"
    cells = check_cells(DEFAULT)
    second = check_cells(SECOND)
    row = check_of(DEFAULT).iloc[0]
    if abs(distance) < 2 * error:
        agreement = (
            "The simulated angle of the run `goji_berry` agrees with the measured mean within its standard error. This good "
            "agreement does not prove that the simulator is right."
        )
    else:
        agreement = (
            "The piles of the run `goji_berry` lie within the target ranges, but their angle differs from the measured mean by "
            f"{abs(distance) / error:.0f} standard errors: it lies {with_error(abs(distance), error)}° {side} it. "
            "The probability that angle and "
            f"height are both within 2 % of the measured means is only {row['within_2_percent']:.2f}. For comparison, the measured "
            f"mean has a standard error of {measured_error:.1f}°."
        )
    return (
        f"{agreement}\n\n"
        "On another type of processor, the check gave another angle. In the run `goji_berry`, it deviates from the measured mean by "
        f"{cells[ANGLE][1]}, and [on another type of processor](../research/docs/kept_runs.md"
        f"#the-same-calibration-on-other-processors) by {second[ANGLE][1]}. Chance may explain this difference, and neither number "
        "says how far the method comes in general.\n\n"
        "An angle that agrees with the measured one does not prove that the simulator is right. We measure the angle along only a "
        "part of the side, between 30 and 80 % of the height of the pile. We chose this part by [a rule](angle_line.md), which "
        "accepts only parts along which simulated piles can have the measured angle. When we wrote the rule, we already knew the "
        "angles of earlier simulated piles. So the agreement may come from our choice of the part.\n"
    )


def predictions_of_default():
    """How good the network of `goji_berry` is, and what its solutions gave, for the page of results."""
    metrics = metrics_of(DEFAULT)
    tests = metrics["n_test"]
    found = [metrics["test"][name]["r2"] for name in (ANGLE, HEIGHT)]
    perfect = [float(value) for value in perfect_r_squared(DEFAULT).split(", ")]
    above = [
        name
        for name, value, limit in zip(("angle", "height"), found, perfect, strict=True)
        if round(value, 2) > limit
    ]
    lucky = (
        f" For the {listed(above)}, the network even has a larger R² than the estimate for a perfect model. This can only be "
        f"chance: both numbers come from the same {tests} test samples."
        if above
        else ""
    )
    flatter, count = sets_flatter_than_predicted(), len(DEFAULT.table(DEFAULT.answer))
    answer = answer_of(DEFAULT)
    off = with_error(
        abs(answer["aor_predicted_deg"] - answer["aor_simulated_deg"]),
        answer["aor_se_deg"],
    )
    which = f"all {number_word(count)}" if flatter == count else number_word(flatter)
    return (
        "The neural network of the run `goji_berry` predicts piles better than its R² of "
        f"{listed([f'{value:.2f}' for value in found])} (angle and height) suggests. R² compares the predicted angles and heights "
        "with simulated ones, and is 1 if they are equal. For each parameter set, the simulated value is the mean of only six "
        "piles, and single piles vary by chance. This random variation lowers R² even if the predictions are right. Without it, R² "
        f"would be [much higher](../research/docs/kept_runs.md#the-error-of-the-network).{lucky}\n\n"
        "Check a predicted angle by simulating piles, because the prediction can be wrong by a degree. In the run `goji_berry`, we "
        f"simulated piles with {number_word(count)} of the parameter sets that the search had found. For {which} of these sets, "
        "the piles were [flatter than predicted](../research/docs/kept_runs.md#why-simulated-angles-lie-below-their-prediction). "
        f"With the calibrated parameters, the angle differed from its prediction by {off}°. So judge calibrated parameters by the "
        "simulated piles, and not by the prediction.\n"
    )


def predicted_chance():
    """What the surrogate predicted for the check of `goji_berry`, and what the check gave."""
    predicted = summary_of(DEFAULT)["representative_judged"]["within"]
    row = check_of(DEFAULT).iloc[0]
    found = {"1 %": row["within_1_percent"], "2 %": row["within_2_percent"]}
    wrong = predicted["2 %"] - found["2 %"] > 0.5
    lesson = (
        "So do not rely on a prediction. The surrogate cannot see its own bias."
        if wrong
        else "In this run, the prediction for 2 % was about right."
    )
    return (
        "In our default calibration of the goji berry, the run `goji_berry`, the surrogate predicted a probability of "
        f"{predicted['2 %']:.2f} that the calibrated parameters lie within 2 % of both targets. After the check, this probability "
        f"was {found['2 %']:.2f}. {lesson}\n"
    )


def processors():
    """The same calibration on several processors; the first two runs are not kept."""
    rows = [
        [
            "processor",
            "AMD EPYC, family 25, model 17",
            "AMD EPYC, family 26, model 2",
            "Intel Xeon, family 6, models 85 and 106",
            "AMD EPYC, family 26, model 2",
        ],
        [
            "commit",
            "8d584bd3",
            "45783bd3",
            "646ecbbc, 07b5dc93, 53ef3fdd",
            "93872d0d, c958e677",
        ],
    ]
    kept = SECOND, DEFAULT
    poured = [int(run.table(run.samples)["n_seeds"].sum()) for run in kept]
    rows.append(["pours at rest, of 900", 881, 875, *poured])
    check_piles = [int(check_of(run)["n_seeds"].min()) for run in kept]
    rows.append(["piles of the check, at rest", "about 32", "about 32", *check_piles])
    cells = [check_cells(run) for run in kept]
    rows.append(
        ["angle of the answer", "32.3 ± 0.4°", "32.6 ± 0.3°"]
        + [cell[ANGLE][0] for cell in cells]
    )
    rows.append(
        ["Height of the answer", "65.9 ± 0.4 mm", "65.0 ± 0.4 mm"]
        + [cell[HEIGHT][0] for cell in cells]
    )
    rows.append(
        ["angle off its prediction, six solutions", "0.4 to 7.2 %", "0.3 to 3.8 %"]
        + [deviation_range(run, ANGLE) for run in kept]
    )
    rows.append(
        ["Height off its prediction", "0.0 to 1.6 %", "0.2 to 2.0 %"]
        + [deviation_range(run, HEIGHT) for run in kept]
    )
    rows.append(
        [
            "R² on the test samples",
            "0.78, 0.81",
            "0.78, 0.76",
            "0.72, 0.69",
            r_squared(DEFAULT),
        ]
    )
    head = [
        "",
        "first run",
        "second run",
        "third run, `second_processor`",
        "fourth run, `goji_berry`",
    ]
    return markdown(head, rows)


def largest_off():
    """How far simulated angles lie below their predictions on two processors, a list."""
    lines = []
    for run, where in (
        (DEFAULT, "In the run `goji_berry`"),
        (
            SECOND,
            "In the same study on another type of processor (`second_processor`)",
        ),
    ):
        table4 = run.table(run.answer)
        found = table4["aor_predicted_deg"] - table4["aor_simulated_deg"]
        answer = answer_of(run)
        others = table4.index[table4["role"] != "representative"]
        error = table4.loc[others, "aor_se_deg"].mean() / np.sqrt(len(others))
        lines.append(
            f"- {where}, the angle of the answer was {with_error(found[answer.name], answer['aor_se_deg'])}° smaller than "
            f"predicted. The expected optimism was {answer['aor_optimism_deg']:.2f}°. The angles of "
            f"{number_word(len(others))} other solutions were {with_error(found[others].mean(), error)}° below their predictions "
            "on average.\n"
        )
    return "".join(lines)


def network_error():
    """The error of the network of `goji_berry` without the noise of the test samples."""
    metrics, noise = metrics_of(DEFAULT), sample_noise(DEFAULT)
    words = {ANGLE: ("angle", "°"), HEIGHT: ("height", " mm")}
    parts, hidden = [], []
    for name, (word, unit) in words.items():
        square = metrics["test"][name]["rmse"] ** 2 - noise[name] ** 2
        if square > 0:
            parts.append(f"about {np.sqrt(square):.1f}{unit} for the {word}")
        else:
            hidden.append(word)
    own = (
        f"Without the noise, the network's own error is {listed(parts)} at the {metrics['n_test']} test samples."
        if parts
        else ""
    )
    lost = (
        f" For the {listed(hidden)}, the error is not larger than the noise, so the network's own error is too small to be seen."
        if hidden
        else ""
    )
    r_squares = [metrics["test"][name]["r2"] for name in (ANGLE, HEIGHT)]
    return (
        "So compare the network's errors with the noise in the "
        "[table of the run `goji_berry`](../../docs/results.md#the-run-goji_berry), not with zero. "
        f"{own}{lost}\n\n"
        "The neural network predicts the mean angle and height of the piles much better than its R² of "
        f"{listed([f'{value:.2f}' for value in r_squares])} in the run `goji_berry` suggests. This R² is low because the test "
        "compares the network with noisy simulations. To remove the effect of this noise, we tested a network with the same "
        "structure on 40 new parameter sets, and corrected R² for the noise of their piles. The corrected R² was "
        "[0.96 for the angle and 0.95 for the height](comparison.md#seeds-of-a-sample-seeds_per_sample), where 1 is perfect.\n"
    )


def noise_correlation():
    """The correlation of angle and height among the piles of `goji_berry`."""
    noise = json.loads((KEPT / DEFAULT.folder / "noise/noise.json").read_text())
    found = noise["correlation"]
    return (
        "The piles of the table of correlations were simulated with "
        "[earlier contact laws](../../docs/results.md#which-results-are-of-which-line-and-laws), so expect slightly different "
        "correlations with the present laws.\n"
        f"For example, the correlation between angle and height is {found['value']:.2f} in the run `goji_berry`, our calibration "
        f"with the default settings (95 % interval: {found['low']:.2f} to {found['high']:.2f}). In this run, each pile is viewed "
        "from 18 directions. The angle is measured along the default line, which follows the side of the pile between 30 and 80 % "
        "of its height.\n"
    )


def later_check():
    """What the checks of the two kept repetitions say beside the five earlier ones."""
    piles = int(check_of(DEFAULT).iloc[0]["n_seeds"])
    cell = check_cells(DEFAULT)[ANGLE][0]
    value, _ = measured(ANGLE)
    below = check_of(DEFAULT).iloc[0]["simulated"] < value
    direction_of = "points in the same direction" if below else "does not confirm this"
    return (
        "Piles that are simulated with our calibrated parameters of the goji berry are probably slightly too flat. In all five "
        "repetitions of our study, the mean angle of the check was below the target of 32.87 degrees, and chance alone does not "
        f"explain this. The check of the run `goji_berry`, with {piles} piles, {direction_of}: it gave {cell}.\n"
    )


def note_of_lines():
    """The angle of the answer along three lines, for the notes beside the article."""
    answer = answer_of(DEFAULT)
    whole, flank, steepest = (
        f"{answer[f'aor_{key}_deg']:.1f}°" for key in ("whole", "flank", "steepest")
    )
    return (
        '**D. Line of the angle.** Ji et al. fit a line to an "approximately linear" part of the pile\'s boundary. They do not say '
        "which part they mean, but cite Li et al. 2020 (reference 19). [The choice of this part matters](angle_line.md). With our "
        f"calibrated parameters, the angle is {whole} along the whole side, {flank} along the line that we use, and {steepest} along "
        "the steepest part.\n"
    )


def note_of_ranges():
    """How many solutions lie at bounds, for the notes beside the article."""
    at_any, counts, count = solutions_at_bounds(DEFAULT)
    found = f"{at_any} of the {count}" if at_any else "None of the"
    bounds = [
        f"the {end} bound of `{name}` ({number})"
        for (name, end), number in counts.items()
    ]
    where = "at " + (" or at ".join(bounds) or "a bound")
    return (
        f"**I. Ranges.** {found} solutions of the run `goji_berry` lie {where}. The bounds come from Table 2 of the article, which "
        "does not say why its ranges end there. For `mus_gg`, the static friction between berries, we also "
        "[searched a wider range](../research/docs/kept_runs.md#a-wider-range-of-mus_gg).\n"
    )


def near(cells, name):
    """A mean of a check and its distance from the measured one, for a sentence."""
    mean, percent = cells[name]
    value, _, rest = percent.partition(" ")
    side = "above" if float(value) > 0 else "below"
    if abs(float(value)) < 0.05:
        return mean, "as large as the measured mean"
    return mean, f"{value.lstrip('+-')} {rest} {side} the measured mean"


def which_set():
    """Which kept parameters to simulate goji berries with, for the page of results."""
    refined = RUN_OF_FOLDER["refined"]
    off = {run: check_of(run)["error_percent"].sum() for run in (DEFAULT, refined)}
    first, second = near(check_cells(DEFAULT), ANGLE), near(check_cells(refined), ANGLE)
    piles = {run: int(check_of(run)["n_seeds"].min()) for run in (DEFAULT, refined)}
    advice = (
        "To simulate goji berries with this program, use the contact parameters of the run `goji_berry`. It has the default "
        f"settings, and more new piles check its result than in the other runs ({piles[DEFAULT]}). The angle of these piles, "
        f"{first[0]}, is {first[1]}."
    )
    if off[refined] < off[DEFAULT] and refined in judged_runs()[Verdict.MET]:
        advice += (
            f"\n\nIf you need piles nearer to the measured ones, use the parameters of the run `refined`. In its check of {piles[refined]} "
            f"piles, the angle, {second[0]}, is {second[1]}. A check of so few piles "
            "[depends on chance](../research/docs/uncertainty_tests.md#a-single-check-depends-on-chance)."
        )
    return f"{advice}\n\nDo not use any of the five parameter sets in another simulator. Calibrate that simulator instead.\n"


def paper_words():
    """What the run with the article's settings found, a paragraph."""
    samples, meeting = meeting_samples(PAPER)
    at_rest = usable_samples(PAPER)
    piles = int(check_of(PAPER)["n_seeds"].min())
    verdict = judge_probability(probability_inside(PAPER))
    inside = lies_inside(PAPER)
    found = (
        "The search nevertheless found a parameter set whose piles are near the targets. The mean angle and the mean height of "
        f"{piles} new piles with this set are within the target ranges"
        if inside
        else f"The mean angle and the mean height of {piles} new piles with the parameter set that the search found are not both "
        "within the target ranges"
    )
    unsure = (
        f". With so few piles, this may be chance (the probability for very many piles is {probability_inside(PAPER):.2f})"
        if verdict is Verdict.UNDECIDED
        else ""
    )
    return (
        f"The run `paper` repeats the calibration with the settings of Ji et al. 2026: one pile for each of {len(samples)} parameter "
        f"sets, and one view of each pile. Of the {at_rest} piles that came to rest, only {len(meeting)} meet both targets. "
        f"{found}{unsure}:\n"
    )


def less_certain():
    """Which of our results are less certain than the others, for the page on the article."""
    undecided = judged_runs()[Verdict.UNDECIDED]
    if not undecided:
        return (
            "All five results meet the targets with a probability of at least 0.95.\n"
        )
    piles = [int(check_of(run)["n_seeds"].min()) for run in undecided]
    rows = listed(
        [
            f"{run.name} ({count} piles)"
            for run, count in zip(undecided, piles, strict=True)
        ]
    )
    one = len(undecided) == 1
    return (
        f"{'One' if one else number_word(len(undecided)).capitalize()} of our results {'is' if one else 'are'} less certain than "
        f"the others: {rows}. With so few new piles, the mean angle and height may meet the targets by chance.\n"
    )


def note_of_samples():
    """How many samples failed, for the notes beside the article."""
    failed = {
        run: len(run.table(run.samples)) - usable_samples(run)
        for run in (PAPER, DEFAULT)
    }
    of_default = (
        "no sample failed" if failed[DEFAULT] == 0 else f"{failed[DEFAULT]} failed"
    )
    return (
        "**N. Valid samples.** In the article, 13 of 150 samples formed no stable pile within 18 s. In our run `paper`, which also "
        f"simulates one pile for each sample, {number_word(failed[PAPER])} failed. We do not know why the numbers differ. The "
        f"simulators or the criteria of rest may be different. In the run "
        f"`goji_berry`, {of_default}, because the program simulates six piles for each "
        "sample and uses those that came to rest.\n"
    )


def fast_summary():
    path = KEPT / "fast/sequential/summary.json"
    return json.loads(path.read_text())


def fast_chance():
    """How sure the sequential strategy is of its answer with two targets, a bullet."""
    summary = fast_summary()
    inside = lies_inside(RUN_OF_FOLDER["fast"])
    sure = RUN_OF_FOLDER["fast"] in judged_runs()[Verdict.MET]
    if inside and sure:
        check = "Even so, the new piles met both target ranges on average."
    elif inside:
        check = "The new piles met both target ranges on average, but they are too few to be certain."
    else:
        check = "The new piles did not meet both target ranges on average."
    return (
        "- **With two targets, expect a less certain result.** With `config/fast.yaml`, which has an angle and a height as its "
        f"targets, the probability of lying within 1 % of both targets was only {summary['probability']:.2f} after "
        f"{summary['pours']} piles. {check}\n"
    )


def fast_run():
    """The run with the sequential strategy, three paragraphs."""
    run = RUN_OF_FOLDER["fast"]
    summary = fast_summary()
    piles = int(check_of(run)["n_seeds"].min())
    cells = check_cells(run)
    angle, height = near(cells, ANGLE), near(cells, HEIGHT)
    inside = (
        "Both means lie inside the target ranges of the goji berry article."
        if lies_inside(run)
        else "They do not both lie inside the target ranges of the goji berry article."
    )
    if run in judged_runs()[Verdict.UNDECIDED]:
        inside += f" For very many piles, the probability of this is {probability_inside(run):.2f}."
    bounds_near = len(summary["near_bounds"])
    if bounds_near:
        noun = "parameters" if bounds_near > 1 else "parameter"
        verb = "lie" if bounds_near > 1 else "lies"
        where = "a bound of their range" if bounds_near > 1 else "a bound of its range"
        bound_words = (
            "The sequential strategy with `config/fast.yaml` may not have found the best parameters, because better ones may lie "
            f"outside the searched ranges. {number_word(bounds_near).capitalize()} {noun} of its answer {verb} at {where}, or so near "
            "to it that the fitted model cannot tell the difference. In such a case, consider wider ranges.\n"
        )
    else:
        bound_words = "No parameter of the answer of `config/fast.yaml` lies at or near a bound of its range.\n"
    return (
        "**The targets of the goji berry article** (Ji et al. 2026), an angle and a height, are harder to meet than a single height. "
        f"With `config/fast.yaml`, the sequential strategy has an answer after {summary['pours']} simulated piles. It gives this "
        f"answer a probability of {summary['probability']:.2f} to lie within 1 % of both targets.\n\n"
        f"In {piles} new piles, the answer of `config/fast.yaml` gives a mean angle of {angle[0]} and a mean height of {height[0]} "
        f"(`results/published/fast`). {inside} The angle is {angle[1]}, and the height {height[1]}.\n\n"
        f"{bound_words}"
    )


def pours_of_default():
    """How many pours of the design of `goji_berry` came to rest."""
    summary = json.loads((KEPT / DEFAULT.folder / "dataset_summary.json").read_text())
    return (
        "The run `goji_berry` is our calibration of the goji berry with the default settings. Before its search, the program "
        f"simulates {summary['samples']} parameter sets, called samples, with six piles each. It uses the mean angle and the mean "
        "height of the six piles. A pile is left out if its berries are still moving after 18 s. This is rare: "
        f"{summary['runs_ok']} of the {summary['runs']} piles came to rest in time.\n"
    )


def refined_run():
    """The answers of `goji_berry` and of its second stage."""
    rows = []
    for run in (DEFAULT, RUN_OF_FOLDER["refined"]):
        answer = answer_of(run)
        check = check_cells(run)
        rows.append(
            [
                run.name,
                f"{answer['aor_predicted_deg']:.1f}°",
                f"{answer['aor_optimism_deg']:+.2f} ± {answer['aor_optimism_se_deg']:.2f}°",
                ", ".join(check[ANGLE]),
                f"{answer['height_predicted_mm']:.1f} mm",
                ", ".join(check[HEIGHT]),
            ]
        )
    head = [
        "answer of",
        "angle, predicted",
        "expected optimism",
        "angle, simulated, off 32.87°",
        "Height, predicted",
        "Height, simulated, off 65.57 mm",
    ]
    return markdown(head, rows)


def refined_words():
    """Whether the second stage brought the answer of `goji_berry` nearer, for its page."""
    refined = RUN_OF_FOLDER["refined"]
    first, second = (check_of(run).set_index("response") for run in (DEFAULT, refined))
    changes = second["simulated"] - first["simulated"]
    errors = np.hypot(first["simulated_se"], second["simulated_se"])
    sure = [name for name in (ANGLE, HEIGHT) if abs(changes[name]) > 2 * errors[name]]
    words = {ANGLE: ("angle", "°"), HEIGHT: ("height", " mm")}
    met = judged_runs()[Verdict.MET]
    if DEFAULT in met and refined in met:
        targets = "Before and after the second stage, the answer meets the targets for angle and height."
    else:
        unsure = [run for run in (DEFAULT, refined) if run not in met]
        targets = f"It is not certain that {names_of(unsure)} {'meets' if len(unsure) == 1 else 'meet'} both targets."
    loss = {
        run: (100 * (table["simulated"] / table["physical_mean"] - 1)).abs().sum()
        for run, table in ((DEFAULT, first), (refined, second))
    }
    change = "nearer to" if loss[refined] < loss[DEFAULT] else "farther from"
    if sure:
        changed = "; ".join(
            f"the mean {words[name][0]} of the new piles changed by {changes[name]:+.1f} ± {errors[name]:.1f}{words[name][1]}"
            for name in sure
        )
        found = (
            "When we refined our default calibration, the run `goji_berry`, with a second stage, the piles of the answer came "
            f"{change} the measured means: {changed}."
        )
    else:
        found = (
            "When we refined our default calibration, the run `goji_berry`, with a second stage, the answer became neither "
            "measurably better nor worse. The mean angles and heights of the new piles that check the two answers agree within "
            "their errors."
        )
    return (
        f"{found} {targets} To show a benefit from the second stage in general, many runs are needed, as in "
        "[the test with a statistical model](#with-a-statistical-model).\n"
    )


def noise_beside_signal():
    """How large the noise of the piles is beside what the parameters do, a sentence."""
    noise = DEFAULT.table("noise/noise.csv").set_index("response")
    ratio = noise["sd_within"] / noise["sd_between"]
    words = {
        name: "larger than" if ratio[name] > 1 else "smaller than"
        for name in (ANGLE, HEIGHT)
    }
    return (
        "For the piles of the goji berry, the noise is about as large as the differences between the samples. The noise of the "
        f"angle is slightly {words[ANGLE]} these differences, and that of the height slightly {words[HEIGHT]} them:\n"
    )


def noise_of_pours():
    """The variance of pours split into that of parameters and that of chance."""
    noise = DEFAULT.table("noise/noise.csv").set_index("response")
    rows = []
    for target, name, unit in ((ANGLE, "angle", "°"), (HEIGHT, "Height", " mm")):
        row = noise.loc[target]
        rows.append(
            [
                name,
                f"{row['sd_within']:.2f}{unit}",
                f"{row['sd_between']:.2f}{unit}",
                f"{row['icc']:.2f} ({row['icc_low']:.2f}-{row['icc_high']:.2f})",
                f"{row['r2_single_runs']:.2f}",
                f"{row['r2_sample_means']:.2f}",
            ]
        )
    head = [
        "",
        "scatter within a sample",
        "spread between samples",
        "fraction of the variance between",
        "best R², single pours",
        "best R², means of six",
    ]
    return markdown(head, rows)


def pours_for_a_percent():
    """How many pours give a mean to within 1 %."""
    noise = DEFAULT.table("noise/noise.csv").set_index("response")
    pours = noise["seeds_for_1_percent"].astype(int)
    return (
        "How many piles you need depends on how accurately you want to estimate their mean. For the goji berry, a standard "
        f"error of 1 % needs {pours[ANGLE]} simulated piles for the angle, but only {pours[HEIGHT]} for the height. If the "
        "estimate must lie within 1 % of the true mean with a probability of 90 %, you need 2.7 times as many piles.\n"
    )


def posterior_of(run):
    """What `posterior` states beside its tables."""
    return json.loads((KEPT / run.folder / "posterior/posterior.json").read_text())


def posterior_errors():
    """The errors that the posterior allows for."""
    posterior = posterior_of(DEFAULT)
    terms = (
        (
            "S_y",
            "error of the measured means: standard deviation over the root of the number of piles",
            "physical_se",
        ),
        (
            "S_d",
            "[discrepancy](#the-discrepancy): scatter of plausible models, an estimate of the simulator's own error",
            "discrepancy_sd",
        ),
        ("S_w", "error of the surrogate's mean", "network_ensemble_se"),
    )
    rows = [
        [term, meaning, "{:.2f}°, {:.2f} mm".format(*posterior[key])]
        for term, meaning, key in terms
    ]
    return markdown(["term", "meaning", "`goji_berry`"], rows)


def information():
    """How much the measurement says about the parameters."""
    table = DEFAULT.table("posterior/posterior.csv").set_index("parameter")
    bits = table["information_bits"]
    most = bits.idxmax()
    half = "lower" if table.loc[most, "below_centre"] > 0.5 else "upper"
    total = posterior_of(DEFAULT)["information_bits"]
    _, by_line = discrepancy_rows()
    secant = by_line.loc["secant"]
    size = size_of(by_line.loc["all six"])
    return (
        "The ten measured piles of goji berries give little information about the contact parameters. We measure information "
        "in bits, where one bit halves the possible range of a parameter. With the default error of the simulator, "
        f"{by_response(size)}, the piles give {total:.2f} bits of information about all six parameters together. The largest "
        f"part, {bits[most]:.2f} bits, is about `{most}`, {KIND[most]}. This parameter probably lies in the {half} half of its "
        f"range. About each of the other five parameters, the piles give at most {bits.drop(most).max():.2f} bits.\n\n"
        "The smaller the error that we assume for the simulator, the more information the ten measured goji berry piles give "
        "about the contact parameters. We measure information in bits, where one bit halves the possible range of a parameter. "
        f"With our default assumption, the piles give {total:.2f} bits about all six parameters together. If we assume a "
        f"smaller error, {by_response(size_of(secant))}, they give {secant['information_bits']:.1f} bits, and "
        f"{secant[f'{most}_bits']:.1f} bits about `{most}`, {KIND[most]}, alone.\n"
    )


def bits_by_discrepancy():
    """Information and intervals over the stated discrepancy."""
    stated, _ = discrepancy_rows()
    targets = {
        target["response"]: target["value"] for target in DEFAULT.settings()["targets"]
    }
    rows = []
    for percent, of_size in stated.groupby("discrepancy_percent"):
        angle, height = (percent / 100 * targets[name] for name in (ANGLE, HEIGHT))
        cells = [f"{percent:g} %: {angle:.1f}°, {height:.1f} mm"]
        for _, row in of_size.sort_values("discrepancy_correlation").iterrows():
            cells += [f"{row['information_bits']:.1f}", *open_cells(row)]
        rows.append(cells)
    correlated = f"correlation {stated['discrepancy_correlation'].max():g}:"
    names = ["bits", f"`{NARROWEST}`", "other five"]
    head = ["discrepancy", *names, *(f"{correlated} {name}" for name in names)]
    return markdown(head, rows)


def bits_by_line():
    """Information and intervals with the discrepancy of the models of each line."""
    _, by_line = discrepancy_rows()
    sources = {
        "all six": "six lines pooled, the default",
        "secant": "secant",
        "flank_levels": "flank, 10 to 80 %, levels",
        "whole": "whole side",
        "steepest": "steepest part",
    }
    rows = []
    for line, source in sources.items():
        row = by_line.loc[line]
        rows.append(
            [
                source,
                f"{row['aor_sd_deg']:.1f}°, {row['height_sd_mm']:.1f} mm",
                f"{row['discrepancy_correlation']:.2f}",
                f"{row['models']:.1f}",
                f"{row['information_bits']:.1f}",
                *open_cells(row),
            ]
        )
    head = [
        "line of the models",
        "discrepancy",
        "correlation",
        "effective models",
        "bits",
        f"`{NARROWEST}`",
        "other five",
    ]
    return markdown(head, rows)


def open_cells(row):
    """Widths of the intervals over the prior's: that of `NARROWEST`, and the others."""
    shares = OpenShares.of(row, "")
    return [shares.narrowest, shares.others]


def shape_study_discrepancy():
    """How the shape study gives the discrepancy, and what else it could give."""
    posterior = posterior_of(DEFAULT)
    _, by_line = discrepancy_rows()
    pooled = by_line.loc["all six"]
    lines = by_line.drop(index=["all six", "steepest"])["aor_sd_deg"]
    combinations = pd.read_csv(ROOT / "resources/shape_study.csv")
    eligible = combinations[combinations["eligible"]].dropna(subset=["distance"])
    weight = np.exp(-(eligible["distance"] ** 2) / 2)
    shares = weight.groupby(eligible["definition"]).sum() / weight.sum()
    models = len(eligible.groupby(["particle", "tension", "filling"]))
    secant = eligible[eligible["definition"] == "secant"]
    angle_sd, height_sd = secant[["aor_difference_deg", "height_difference_mm"]].std()
    return (
        f"To estimate the error of our simulator, we compared the piles of {models} plausible models of the goji berry. The "
        "models differ in the particle, the contact law and the filling of the funnel. The angle of a pile also depends on the "
        "line that is drawn along its side, so we measured each pile along six lines. Each combination of a model and a line "
        "counts as one possible simulator.\n"
        f"The results of these simulators vary with standard deviations of {by_response(size_of(pooled))}, with a correlation "
        f"of {pooled['discrepancy_correlation']:.2f}. By default, the program assumes that the simulator has an error of this "
        "size, called the discrepancy.\n\n"
        "In our estimate of the simulator's error, a model of the goji berry counts more if its piles are similar to those that "
        "Ji et al. 2026 simulated. For each model and each line along which the angle is measured, we calculate by how many "
        "standard deviations d the two differ. The weight is exp(-d²/2).\n"
        f"As a result, the line from foot to crest (the secant) has {100 * shares['secant']:.0f} % of the total weight, and the "
        f"line along the steepest part of a side {100 * shares['steepest']:.0f} %. With these unequal weights, the estimate is "
        f"only as reliable as one from {posterior['discrepancy_models']:.1f} models that all have the same weight.\n\n"
        "Our estimate of the simulator's error has four weaknesses:\n\n"
        "- It contains the differences between the six lines, although a study measures its piles along one line only. Along "
        f"most single lines, the angles of the models have a standard deviation of {lines.min():.1f} to {lines.max():.1f}°, and "
        f"{by_line.loc['steepest', 'aor_sd_deg']:.1f}° along the steepest part. The line that we calibrate with was not among "
        "the six.\n"
        "- The models use the parameter sets of the goji berry article (Ji et al. 2026). So they show how much a pile changes "
        "with the model, and not the error that is left after each model has been calibrated.\n"
        "- The weights compare the models with the article's single simulated piles, and not with real ones. Without weights "
        f"the models differ more (standard deviations along the secant: {angle_sd:.1f}° and {height_sd:.1f} mm), because some "
        "ways of filling the funnel make much lower piles.\n"
        "- The models were simulated with [earlier contact laws](../../docs/results.md#which-results-are-of-which-line-and-laws).\n"
    )


def open_region():
    """The share of the space that history matching leaves open."""
    region = DEFAULT.table("posterior/region.csv")
    # Every pair of parameters divides the same draws among its cells of equal weight.
    share = region["share"].mean()
    excluded = int((region["share"] == 0).sum())
    cells = "none is" if excluded == 0 else f"{excluded} of {len(region)} are"
    return (
        "For the goji berry, history matching rules out very few parameter sets: with the default error of the simulator, "
        f"{100 * share:.0f} % of the searched space remains possible. Of the cells in the next figure, {cells} ruled out:\n"
    )


def drum_cases():
    """The runs of research/answers/drum_slip.py: mean and standard error by case."""
    runs = pd.read_csv(ROOT / "research/answers/drum_slip.csv")
    rows = []
    for case, of_case in runs.groupby("case", sort=False):
        slipped = of_case["before_turned_deg"].dropna()
        slips = f"{len(slipped)} of {len(of_case)}"
        turned = "-" if slipped.empty else f"{mean_with_error(slipped)}°"
        rows.append(
            [
                case,
                f"{mean_with_error(of_case['start_surface_deg'])}°, {of_case['start_surface_deg'].std():.1f}°",
                f"{100 * of_case['moved_share'].mean():.2f} %",
                f"{of_case['bed_moved_mm'].mean():.1f} mm",
                slips,
                turned,
            ]
        )
    head = [
        "case",
        "surface at the start: mean, scatter of runs",
        "grains that moved by 27°",
        "motion of the whole bed by 27°",
        "runs with a slip",
        "turned at the slip",
    ]
    return markdown(head, rows)


def mean_with_error(values):
    """Mean and standard error of runs."""
    return with_error(values.mean(), values.sem())


def sensitivities():
    """Sobol indices of `goji_berry`: first-order, and total in brackets."""
    sobol = DEFAULT.table("sensitivity/sobol.csv").set_index(["response", "parameter"])
    rows = []
    for target, name in ((ANGLE, "angle"), (HEIGHT, "Height")):
        cells = []
        for parameter in PARAMETERS:
            index = sobol.loc[(target, parameter)]
            cells.append(f"{index['first']:.2f} ({index['total']:.2f})")
        rows.append([name, *cells])
    return markdown(["", *(f"`{name}`" for name in PARAMETERS)], rows)


def most_sensitive():
    """Which parameter changes the pile most, and which least, for README."""
    sobol = DEFAULT.table("sensitivity/sobol.csv").set_index("parameter")
    shares = {target: sobol[sobol["response"] == target] for target in (ANGLE, HEIGHT)}
    both = shares[ANGLE]["first"] + shares[HEIGHT]["first"]
    most = both.idxmax()
    least = both.idxmin()
    next_angle = shares[ANGLE]["first"].drop(most).idxmax()
    next_height = shares[HEIGHT]["first"].drop(most).idxmax()

    def share(target, parameter):
        return f"{100 * max(0, shares[target].loc[parameter, 'first']):.0f} %"

    def with_interval(target):
        low, high = 100 * shares[target].loc[most, ["first_low", "first_high"]]
        return f"{share(target, most)} ({low:.0f} to {high:.0f} %)"

    if next_height == next_angle:
        of_height = f"It is also the second for the height of the pile, with {share(HEIGHT, next_height)}."
    else:
        of_height = f"For the height of the pile, it is `{next_height}`, {KIND[next_height]}, with {share(HEIGHT, next_height)}."
    return (
        f"Of all contact parameters, `{most}`, {KIND[most]}, has the largest effect on the goji berry pile. When all parameters "
        f"vary over the searched ranges, `{most}` alone explains {with_interval(ANGLE)} of the variance of the pile's angle, "
        f"and {with_interval(HEIGHT)} of the variance of its height. The brackets contain 95 % intervals. {direction(most)}\n\n"
        f"The other contact parameters affect the goji berry pile less than `{most}`, {KIND[most]}. The second most important "
        f"parameter for the angle of the pile is `{next_angle}`, {KIND[next_angle]}, which explains {share(ANGLE, next_angle)} "
        f"of the variance (first-order Sobol index). {of_height} The least important parameter is `{least}`, {KIND[least]}. "
        f"{direction('mus_gg')}\n"
    )


def direction(parameter):
    """Whether the piles of the design are steeper with more of a parameter, a sentence."""
    samples = DEFAULT.table(DEFAULT.samples)
    correlation = samples[parameter].corr(samples[ANGLE], method="spearman")
    change = "steeper" if correlation > 0 else "flatter"
    return (
        f"With a larger `{parameter}`, piles become {change} "
        f"(rank correlation with the angle: {correlation:+.2f})."
    )


# An interval that nothing narrows holds 95 % of a uniform range.
UNNARROWED = 0.95


def kept_of_ranges(interval):
    """Widths of 95 % intervals over those without a measurement, by parameter.

    `interval` takes a name of a parameter and returns the ends of its interval.
    """
    widths = {}
    for name in PARAMETERS:
        low, high = bounds_of(DEFAULT, name)
        interval_low, interval_high = interval(name)
        share = (interval_high - interval_low) / (high - low) / UNNARROWED
        # The intervals are estimated, so some pass 1 by a little.
        widths[name] = min(1.0, share)
    return widths


def describe_kept(widths, named):
    """The widths of some parameters by name, and from which to which the others go."""
    parts = [f"`{name}` {100 * widths[name]:.0f} %" for name in named]
    others = [f"{100 * widths[name]:.0f}" for name in widths if name not in named]
    ends = dict.fromkeys((min(others, key=int), max(others, key=int)))
    span = f"{' to '.join(ends)} %"
    parts.append(f"the others {span}" if named else f"each {span}")
    return ", ".join(parts)


def further_tests():
    """What the pile and further measurements leave open, for README."""
    posterior = DEFAULT.table("posterior/posterior.csv").set_index("parameter")
    ends = ["credible_low", "credible_high"]
    by_default = kept_of_ranges(lambda name: posterior.loc[name, ends])
    discrepancy = pd.read_csv(KEPT / DEFAULT.folder / "posterior/discrepancy.csv")

    def by_discrepancy(percent):
        # The correlation of the errors that the study of several tests assumes.
        rows = discrepancy[
            (discrepancy["discrepancy_percent"] == percent)
            & (discrepancy["discrepancy_correlation"] == 0.9)
        ]
        row = rows.iloc[0]
        return kept_of_ranges(lambda name: (row[f"{name}_low"], row[f"{name}_high"]))

    tests = pd.read_csv(KEPT / "joint_targets" / "tests.csv")
    sets = pd.read_csv(KEPT / "joint_targets" / "sets.csv")
    by_set = pd.concat([tests, sets]).drop_duplicates("set").set_index("set")
    ways = pd.read_csv(KEPT / "joint_targets/responses/ways.csv")
    photographs = ways[ways["way"] == "profile"].iloc[0]
    perfect = open_shares()[2]
    second_perfect = widths_of(SECOND.table("posterior/discrepancy.csv").iloc[0])

    def of_set(name):
        row = by_set.loc[name]
        return {
            name: min(1.0, row[f"width_{name}"] / UNNARROWED) for name in PARAMETERS
        }

    def work(name):
        return f"{by_set.loc[name, 'minutes'] / 60:.1f} h"

    of_pile = of_set("pile")[NARROWEST]
    of_two = by_discrepancy(2)[NARROWEST]
    compared = (
        "Compare the synthetic measurements only roughly with the first three rows. The many numbers of the pile include its angle "
        f"and Height. Yet they leave {100 * of_pile:.0f} % of `{NARROWEST}`, and the two alone {100 * of_two:.0f} %, because the "
        "simulator and the line of the angle differ.\n\n"
        if of_pile > of_two
        else ""
    )
    default_errors = posterior_of(DEFAULT)["discrepancy_sd"]
    default_error = (
        f"{default_errors[0]:.1f}° and {default_errors[1]:.1f} mm, our default"
    )
    direct = ("mus_gg", "mur_gg", "e_gp", "mus_gp")
    four = " + ".join(f"direct {name}" for name in direct)
    rows = [
        [
            "angle and Height of ten piles",
            "-",
            default_error,
            describe_kept(by_default, ()),
        ],
        [
            "the same",
            "-",
            "2 %",
            describe_kept(by_discrepancy(2), ("mus_gg", "mur_gg")),
        ],
        [
            "the same",
            "-",
            "none",
            f"`{NARROWEST}` {perfect.narrowest} ({100 * second_perfect[NARROWEST]:.0f} % on another type of processor), "
            f"the others {perfect.others}",
        ],
        [
            "many numbers of ten new piles: several angles, loose grains, spread, packing",
            work("pile"),
            "2 %",
            describe_kept(of_set("pile"), ("mus_gg", "mur_gg", "mur_gp")),
        ],
        [
            "a drop test of `e_gp`",
            work("direct e_gp"),
            "any",
            describe_kept(of_set("direct e_gp"), ("e_gp",)),
        ],
        [
            "an inclined plane of the wall's material: `mus_gp`",
            work("direct mus_gp"),
            "any",
            describe_kept(of_set("direct mus_gp"), ("mus_gp",)),
        ],
        [
            f"a direct test of each of {listed([f'`{name}`' for name in direct])}",
            work(four),
            "any",
            describe_kept(of_set(four), direct),
        ],
    ]
    head = [
        "what you measure",
        "work",
        "assumed error of the simulator",
        "width of the 95 % intervals, in % of that without a measurement",
    ]
    return (
        f"{markdown(head, rows)}\n"
        "The first three rows of the table use the measured piles. The other measurements are "
        "[synthetic](research/docs/joint_targets.md), from an earlier version of the simulator. "
        "Their assumed standard deviations are 0.03 for a coefficient of "
        "restitution, 0.035 for static friction and 0.005 for rolling friction.\n\n"
        f"{compared}"
        "These measurements need half an hour or less:\n\n"
        "- **Seven more numbers from the photographs that you already have.** They [describe the shape of the "
        f"pile](research/docs/second_responses.md), and reading them takes {photographs['minutes']:.0f} minutes. They help most if "
        "the simulator is nearly right.\n"
        "- **One coefficient between grain and wall:** the friction on an inclined plane, or the restitution in a drop test. "
        f"Each takes {by_set.loc['direct mus_gp', 'minutes']:.0f} minutes. It only helps if this coefficient is important in your "
        "machine, because the pile hardly depends on it.\n"
    )


def left_open():
    """What a pile leaves open, in three short paragraphs, for README."""
    samples, meeting = meeting_samples(DEFAULT)
    region = DEFAULT.table("posterior/region.csv")["share"].mean()
    pooled, _, _ = open_shares()
    return (
        "**With the error that we assume for the simulator, the measured piles alone determine none of the six parameters.** Very "
        "different parameters give piles within the target ranges. "
        f"Of the {len(samples)} sets that the study simulates first, {len(meeting)} gave piles within both target ranges.\n\n"
        "The simulator may be wrong, too. We [estimate](research/docs/uncertainty_tests.md#where-the-size-of-the-discrepancy-comes-from) "
        f"the standard deviation of its error as {pooled.size}. With this error, "
        f"[{100 * region:.0f} % of the searched space](docs/uncertainty.md#the-region-that-is-not-excluded) remains possible after "
        "the measurement: there, each prediction lies within three standard deviations of the measured mean.\n\n"
        "So use the six calibrated values only together, and only for piles like the measured one. A pile alone does not give you "
        "parameters for a conveyor or a packing machine, but it shows which further tests you need.\n"
    )


def equal_berries():
    """What equal berries do to the pile, by the models of the shape study, for README."""
    models = pd.read_csv(ROOT / "resources" / "shape_study.csv")
    models = models[models["definition"] == "flank_levels"]
    cases = ["tension", "filling"]
    equal = models[models["particle"] == "smooth"].set_index(cases)
    unequal = models[models["particle"] == "smooth_sizes"].set_index(cases)
    columns = ["aor_difference_deg", "height_difference_mm"]
    changes = (unequal[columns] - equal[columns]).dropna()
    angle, height = (mean_with_error(changes[column]) for column in columns)
    return (
        "- **All 500 simulated berries are identical.** Real berries differ in size, but this hardly changes the pile. In "
        f"{len(changes)} pairs of models, berries of different sizes changed the angle by {angle}° and the height by {height} mm.\n"
    )


def effect_of_friction():
    """Linear effect of mus_gg over its range on the responses of the design."""
    samples = DEFAULT.table(DEFAULT.samples)
    columns = [np.ones(len(samples))]
    for name in PARAMETERS:
        low, high = bounds_of(DEFAULT, name)
        columns.append((samples[name] - low) / (high - low))
    design = np.column_stack(columns)
    inverse = np.linalg.inv(design.T @ design)
    place = 1 + PARAMETERS.index("mus_gg")
    cells = []
    for response, unit in FRICTION_RESPONSES.items():
        slopes = inverse @ design.T @ samples[response]
        rest = samples[response] - design @ slopes
        freedom = len(samples) - design.shape[1]
        error = np.sqrt(inverse[place, place] * (rest @ rest) / freedom)
        cells.append(f"{slopes[place]:+.1f} ± {error:.1f}{unit}")
    height, angle, straightest, whole, secant = cells
    return (
        "In our default calibration, the run `goji_berry`, piles become flatter but a little higher if `mus_gg`, "
        f"{KIND['mus_gg']}, increases. We fitted a linear model to all {len(samples)} parameter sets of this run. From the "
        f"lower to the upper bound of `mus_gg`, the height of the pile changes by {height}.\n\n"
        f"How much the angle of a pile changes with `mus_gg`, {KIND['mus_gg']}, depends on the line along which the angle is "
        "measured. From the lower to the upper bound of `mus_gg`, the angle changes most along the line that we use for our "
        "calibration, the flank:\n\n"
        f"- along the flank, the side between 30 and 80 % of the height: {angle}\n"
        f"- along the straightest part of a side: {straightest}\n"
        f"- along the whole side: {whole}\n"
        f"- along the secant, from foot to crest: {secant}\n"
    )


def carried_to(run, line, height_mm):
    """Angles of a design's samples by a line, carried to a Height at constant volume."""
    samples = run.table(run.samples)
    samples = samples[samples["status"] == "ok"]
    angles = samples[f"aor_{line}_deg"]
    return reach.convert_to_height(angles, samples[HEIGHT], height_mm)


def measured(name):
    """A target of `goji_berry`, with the standard error of its mean."""
    targets = {target["response"]: target for target in DEFAULT.settings()["targets"]}
    target = targets[name]
    return target["value"], target["sd"] / np.sqrt(target["repetitions"])


def whole_side_bound():
    """The steepest whole side by the volume of the berries in the pile."""
    berry = DEFAULT.settings()["berry"]
    by_mass_mm3 = 1e6 * berry["mass_g"] / berry["density_kg_m3"]
    by_axes_mm3 = np.pi / 6 * np.prod(reach.TABLE_GRAIN_MM)
    runs = DEFAULT.table("runs.csv")
    in_pile = runs.loc[runs["status"] == "ok", "berries_in_pile"].mean()
    poured = DEFAULT.settings()["funnel"]["berries"]
    angle_deg, angle_error_deg = measured(ANGLE)
    height_mm, height_error_mm = measured(HEIGHT)
    # The largest packing of the smooth bodies in research/docs/shape_study.md.
    simulated_packing = 0.65
    cases = (
        ("mass and density", by_mass_mm3, poured, reach.DENSEST_PACKING),
        ("mass and density", by_mass_mm3, in_pile, reach.DENSEST_PACKING),
        ("axes of an ellipsoid", by_axes_mm3, in_pile, simulated_packing),
        ("axes of an ellipsoid", by_axes_mm3, in_pile, reach.DENSEST_PACKING),
    )
    rows = []
    for source, berry_mm3, berries, packing in cases:
        fruit_m3 = 1e-9 * berry_mm3 * berries
        steepest_deg, at_next_deg = (
            np.degrees(np.arctan(reach.compute_cone_slope(height, fruit_m3 / packing)))
            for height in (height_mm, height_mm + height_error_mm)
        )
        error_deg = np.hypot(angle_error_deg, at_next_deg - steepest_deg)
        rows.append(
            [
                f"{source}: {berry_mm3:.0f} mm³",
                f"{berries:.0f}",
                f"{100 * packing:.0f} %",
                f"{1e6 * fruit_m3:.0f} ml",
                # An upper bound is rounded up.
                f"{np.ceil(10 * steepest_deg) / 10:.1f}°",
                f"{(angle_deg - steepest_deg) / error_deg:.1f}",
            ]
        )
    head = [
        "volume of a berry, by",
        "berries in the pile",
        "packing",
        "solid fruit",
        f"steepest whole side, at {height_mm:.2f} mm",
        f"{angle_deg:.2f}° lies above it by, standard errors",
    ]
    return markdown(head, rows)


def mean_berries_in_pile():
    runs = DEFAULT.table("runs.csv")
    return runs.loc[runs["status"] == "ok", "berries_in_pile"].mean()


def berries_in_pile():
    """How many berries are part of a pile, and which packings the bound takes."""
    in_pile = mean_berries_in_pile()
    poured = DEFAULT.settings()["funnel"]["berries"]
    return (
        "The largest possible angle of a goji berry pile also depends on how many of the "
        f"{poured} poured berries are part of the pile, and on how densely they are packed. In our simulations, about "
        f"{poured - round(in_pile)} berries lie loose on the plate, so {in_pile:.0f} are part of the pile.\n"
        "For the packing, we use two values. In our simulated piles, the berries fill at most about 65 % of the volume. As an upper "
        "limit, we take 74 %, the densest packing of equal spheres. The next table gives the largest angle along the whole side for "
        "several of these assumptions:\n"
    )


def mass_and_density():
    """What the published mass and density say of the whole side."""
    in_pile = mean_berries_in_pile()
    poured = DEFAULT.settings()["funnel"]["berries"]
    packing = reach.DENSEST_PACKING * in_pile / poured
    return (
        "If the published mass and density of a goji berry are right, Ji et al. 2026 probably did not measure their angle along the "
        "whole side of the pile. The mass and density give the volume of the berries, and this volume limits how steep the whole "
        "side can be. Even if the berries are packed as densely as possible, the published angle lies "
        f"{steepest_whole_side():.1f} standard errors above this limit.\n\n"
        f"The first row of the table with the largest angles assumes that all {poured} berries are part of the pile. In our "
        f"simulations, only {in_pile:.0f} of them are. A pile of {in_pile:.0f} berries is as large as this row assumes if the berries "
        f"fill {100 * packing:.0f} % of its volume.\n"
    )


def straightest_calibration():
    """The check of `goji_berry` along the line of the calibration along the straightest window."""
    # The mean of the 32 piles of the calibration along this line (no kept run).
    calibrated_deg = 32.6
    parts = []
    for run, where in (
        (DEFAULT, "the run `goji_berry`"),
        (SECOND, "the same study on another type of processor"),
    ):
        answer = answer_of(run)
        angle = answer["aor_straightest_deg"]
        parts.append(
            f"- {where}: {with_error(angle, answer['aor_straightest_se_deg'])}°, {calibrated_deg - angle:.1f}° smaller than after a "
            "calibration along the straightest window\n"
        )
    return (
        "For comparison, our default calibration, the run [`goji_berry`](../../docs/results.md#the-run-goji_berry), uses the flank, "
        "the side between 30 and 80 % of the height. We measured the piles that check its calibrated parameters along the "
        f"straightest window, too:\n\n{''.join(parts)}"
    )


def whole_side_runs():
    """Angles by the whole side of the kept designs, carried to the measured Height."""
    height_mm, _ = measured(HEIGHT)
    bodies = {
        DEFAULT: "smooth body of 1.25 g",
        PAPER: "ellipsoid of the axes, 1.05 g",
        MATCHED: "rough clump, 29 % lighter",
    }
    rows = []
    for run, body in bodies.items():
        angles = carried_to(run, "whole", height_mm)
        samples = run.table(run.samples)
        meets = samples["aor_whole_deg"].between(31, 34) & samples[HEIGHT].between(
            64, 69
        )
        rows.append(
            [
                run.name,
                body,
                f"{angles.mean():.1f} ± {angles.std():.1f}° ({angles.max():.1f}°)",
                f"{meets.sum()} of {len(angles)}",
            ]
        )
    head = [
        "run",
        "particle",
        f"whole side, carried to {height_mm:.2f} mm, ± sd (largest)",
        "samples that meet both targets by it",
    ]
    return markdown(head, rows)


def lines_of_default():
    """What the rule of the line reads, of the piles of `goji_berry`."""
    runs = DEFAULT.table("runs.csv")
    runs = runs[runs["status"] == "ok"]
    angle, angle_error = measured(ANGLE)
    height_mm, _ = measured(HEIGHT)
    rows = []
    for line in ("whole", "secant", "flank", "straightest"):
        piles = runs.groupby("sample")[f"aor_{line}_deg"]
        one_view, p_value = view_scatter(line)
        within = pooled_sd(piles)
        between = piles.mean().var() - within**2 / piles.count().mean()
        carried = carried_to(DEFAULT, line, height_mm)
        distance = (angle - carried.mean()) / np.hypot(carried.std(), angle_error)
        rows.append(
            [
                f"`{line}`",
                f"{piles.mean().mean():.1f}°",
                f"{carried.mean():.1f} ± {carried.std():.1f}°",
                f"{distance:.1f}",
                f"{one_view:.2f}° ({p_value:.3f})",
                f"{np.sqrt(between) / within:.2f}",
            ]
        )
    head = [
        "line",
        "mean",
        "carried to 65.57 mm, ± sd",
        "distance of 32.87°, standard deviations",
        "scatter of one view (p)",
        "ratio",
    ]
    return markdown(head, rows)


def view_scatter(line):
    """Scatter of one view along a line in `goji_berry`, and the p value of the rule."""
    runs = DEFAULT.table("runs.csv")
    runs = runs[runs["status"] == "ok"]
    one_view = pooled_sd(runs.groupby("sample")[f"aor_{line}_view_deg"])
    target = DEFAULT.settings()["targets"][0]
    freedom = target["repetitions"] - 1
    below = stats.chi2.cdf(freedom * (target["sd"] / one_view) ** 2, freedom)
    return one_view, 2 * min(below, 1 - below)


def straightest_by_default():
    """Whether the line `straightest` passes the rule on the piles of `goji_berry`."""
    _, p_value = view_scatter(STRAIGHTEST)
    if p_value >= 0.05:
        found = (
            f"Measured again on the piles of the run `goji_berry`, this line just passes, with p = {p_value:.3f}. The rule then still "
            "prefers the flank, which has the larger ratio:"
        )
    else:
        found = f"Measured again on the piles of the run `goji_berry`, this line only just fails, with p = {p_value:.3f}:"
    return (
        "- It excludes `straightest`, the line in the paper that Ji et al. 2026 cite, only because its angles vary too much. "
        f"{found}\n"
    )


def steepest_whole_side():
    """The steepest whole side by the published mass and density, and how far the angle lies above it."""
    berry = DEFAULT.settings()["berry"]
    berry_mm3 = 1e6 * berry["mass_g"] / berry["density_kg_m3"]
    runs = DEFAULT.table("runs.csv")
    in_pile = runs.loc[runs["status"] == "ok", "berries_in_pile"].mean()
    angle_deg, angle_error_deg = measured(ANGLE)
    height_mm, height_error_mm = measured(HEIGHT)
    volume_m3 = 1e-9 * berry_mm3 * in_pile / reach.DENSEST_PACKING
    steepest_deg, at_next_deg = (
        np.degrees(np.arctan(reach.compute_cone_slope(height, volume_m3)))
        for height in (height_mm, height_mm + height_error_mm)
    )
    error_deg = np.hypot(angle_error_deg, at_next_deg - steepest_deg)
    return (angle_deg - steepest_deg) / error_deg


def pooled_sd(groups):
    """Standard deviation within groups."""
    freedom = groups.count() - 1
    return np.sqrt((groups.var() * freedom).sum() / freedom.sum())


def split_sizes(run):
    """Numbers of samples for training, validation and test."""
    metrics = metrics_of(run)
    return ", ".join(
        str(metrics[f"n_{split}"]) for split in ("train", "validation", "test")
    )


def usable_samples(run):
    """How many samples have an angle."""
    return int(run.table(run.samples)[ANGLE].notna().sum())


def interval_shares(run):
    """Shares of the ranges that the solutions of a search span."""
    solutions = run.table(run.solutions)
    shares = [100 * covered_share(run, solutions, name) for name in PARAMETERS]
    return f"{min(shares):.0f} to {max(shares):.0f} %"


def article_results():
    """The numbers of the article's section 4, with places and numbers here."""
    check = check_cells(DEFAULT)
    deviations = (
        f"{deviation_range(DEFAULT, ANGLE)}, {deviation_range(DEFAULT, HEIGHT)}"
    )
    rmse, _ = test_errors(DEFAULT)
    slip = drum_means(DEFAULT)["before_turned_deg"]
    results = "[results](results.md#{})"
    rows = [
        [
            "4.1.1: valid samples",
            "137 of 150",
            f"{usable_samples(DEFAULT)} of 150; `paper` {usable_samples(PAPER)}",
            "N",
        ],
        [
            "4.1.1: training, validation, test",
            "95, 20, 22",
            f"{split_sizes(DEFAULT)}; `paper` {split_sizes(PAPER)}",
            "N",
        ],
        [
            "R², angle and Height",
            "0.9415, 0.9429",
            f"{r_squared(DEFAULT)}; `paper` {r_squared(PAPER)}",
            results.format("the-run-goji_berry"),
        ],
        ["RMSE, angle and Height", "1.0633°, 0.8447 mm", rmse, ""],
        ["Eq. 13: R²", "-", "[theory](theory.md#the-surrogate)", ""],
        [
            "Figure 13: predicted against simulated",
            "all 137 samples",
            "`figures/figure13.png`",
            "",
        ],
        [
            "Table S1: training data",
            "in the supplement",
            "not here; `config/article_data.yaml` reads it",
            "O",
        ],
        [
            "Table 3: spans of 90 solutions",
            "3.5 to 19 % of the ranges",
            f"`miga/intervals.csv`; {interval_shares(DEFAULT)}",
            "[kept runs](../research/docs/kept_runs.md#the-solutions-beside-those-of-the-article)",
        ],
        ["Figure 14: solutions", "-", "`figures/figure14.png`", ""],
        ['4.1.2: "local concentrated search"', "not explained", "absent", "P"],
        [
            "Table 4: predicted against simulated, five solutions",
            "angle 1.0-4.3 %, Height 2.1-5.0 %",
            f"`validation/table4.csv`, with the answer; {deviations}",
            "",
        ],
        [
            "representative solution",
            "0.203, 0.642, 0.037, 0.244, 0.483, 0.185",
            "the table at the top",
            "",
        ],
        [
            "its simulation, against the measurement",
            "0.76 %, 1.33 % off",
            f"{check[ANGLE][1]}, {check[HEIGHT][1]}",
            "Q",
        ],
        [
            "4.2.2: drum",
            "no angle; its times imply 27°",
            f"slip at {slip}°",
            results.format("the-drum-disagrees-with-the-article"),
        ],
        [
            "Figure 15: drum",
            "pictures, no angle",
            "`figures/figure15.png`, `drum/`",
            "",
        ],
        ["4.2.3: reference 11", "-", "`resources/published/others.csv`", "R"],
        [
            "4.3: comparisons asked for",
            "none made",
            "[research](../research/README.md)",
            "S",
        ],
    ]
    return markdown(
        ["article", "number there", "place and number in this project", "note"], rows
    )


def paper_run():
    """The run with the article's settings beside the article."""
    check = check_cells(PAPER)
    rows = [
        ["feasible solutions", "90", len(PAPER.table(PAPER.solutions))],
        [
            "angle of the answer",
            "one simulation, 0.76 % off",
            ", ".join(check[ANGLE]),
        ],
        [
            "Height of the answer",
            "one simulation, 1.33 % off",
            ", ".join(check[HEIGHT]),
        ],
        [
            "predicted against simulated, six solutions",
            "below 5 %",
            f"angle {deviation_range(PAPER, ANGLE)}, Height {deviation_range(PAPER, HEIGHT)}",
        ],
        [
            "R² on the test samples, angle and Height",
            "0.94, 0.94",
            r_squared(PAPER),
        ],
    ]
    return markdown(["number", "article", "`paper`"], rows)


def matched_run():
    """The run with the rough clump."""
    check = check_cells(MATCHED)
    summary = json.loads((KEPT / MATCHED.folder / "dataset_summary.json").read_text())
    rows = [
        ["pours at rest", f"{summary['runs_ok']} of {summary['runs']}"],
        ["angle of the answer", ", ".join(check[ANGLE])],
        ["Height of the answer", ", ".join(check[HEIGHT])],
        [
            "predicted against simulated angle, six solutions",
            deviation_range(MATCHED, ANGLE),
        ],
        [
            "predicted against simulated Height",
            deviation_range(MATCHED, HEIGHT),
        ],
        ["R² on the test samples", r_squared(MATCHED)],
    ]
    return markdown(["number", "`matched`"], rows)


TEXTS = {
    "agreement_of_default": agreement_of_default,
    "all_calibrations": all_calibrations,
    "answers": answers,
    "article_results": article_results,
    "berries_in_pile": berries_in_pile,
    "beside_article": beside_article,
    "bits_by_discrepancy": bits_by_discrepancy,
    "bits_by_line": bits_by_line,
    "bounds": bounds,
    "default_run": default_run,
    "design": design,
    "designs": designs,
    "drum": drum,
    "drum_cases": drum_cases,
    "drum_quantities": drum_quantities,
    "effect_of_friction": effect_of_friction,
    "equal_berries": equal_berries,
    "fast_chance": fast_chance,
    "fast_run": fast_run,
    "first_draw": first_draw,
    "five_piles": five_piles,
    "five_runs": five_runs,
    "five_settings": five_settings,
    "further_tests": further_tests,
    "information": information,
    "intervals": intervals,
    "largest_off": largest_off,
    "less_certain": less_certain,
    "later_check": later_check,
    "left_open": left_open,
    "lines": lines,
    "lines_of_default": lines_of_default,
    "mass_and_density": mass_and_density,
    "matched_run": matched_run,
    "meeting_words": meeting_words,
    "most_sensitive": most_sensitive,
    "network_error": network_error,
    "network_widths": network_widths,
    "noise_beside_signal": noise_beside_signal,
    "noise_correlation": noise_correlation,
    "noise_of_pours": noise_of_pours,
    "note_of_lines": note_of_lines,
    "note_of_ranges": note_of_ranges,
    "note_of_samples": note_of_samples,
    "open_intervals": open_intervals,
    "open_region": open_region,
    "optimism": optimism,
    "other_processor": other_processor,
    "paper_run": paper_run,
    "paper_words": paper_words,
    "posterior_errors": posterior_errors,
    "pours_for_a_percent": pours_for_a_percent,
    "pours_of_default": pours_of_default,
    "predicted_chance": predicted_chance,
    "predictions_of_default": predictions_of_default,
    "processors": processors,
    "published_difference": published_difference,
    "published_sets": published_sets,
    "published_verdict": published_verdict,
    "refined_run": refined_run,
    "refined_words": refined_words,
    "sensitivities": sensitivities,
    "shape_study_discrepancy": shape_study_discrepancy,
    "spread_of_samples": spread_of_samples,
    "straightest_by_default": straightest_by_default,
    "straightest_calibration": straightest_calibration,
    "verdict": verdict,
    "verdict_words": verdict_words,
    "warned_solutions": warned_solutions,
    "which_set": which_set,
    "whole_side_bound": whole_side_bound,
    "whole_side_runs": whole_side_runs,
    "wider_run": wider_run,
}


def with_texts(page):
    """A page's text with each marked part made anew."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{TEXTS[found[2]]()}\n{found[3]}", page)


if __name__ == "__main__":
    for name in PAGES:
        path = ROOT / name
        path.write_text(with_texts(path.read_text()))

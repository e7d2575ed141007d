"""Tables of the pages that stand the answers of the kept runs beside the article's.

`python tests/documents/parameter_sets.py` counts them anew from `results/published` and writes them where a page has
the line `<!-- made by tests/documents/parameter_sets.py: NAME -->`, up to the line `<!-- end -->`.
"""

import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "results" / "published"
ARTICLE = ROOT / "resources" / "published"
PAGES = ("README.md", "docs/results.md", "docs/uncertainty.md", "docs/article.md")
PARAMETERS = ("e_gg", "mus_gg", "mur_gg", "e_gp", "mus_gp", "mur_gp")
ANGLE, HEIGHT = "aor_deg", "height_mm"
# The article gives the error of its representative set's simulation, and not its angle and Height.
ARTICLE_CHECK = ("predicted 32.5", "predicted 67.0")
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
        folder="recommended",
        answer="validation/table4.csv",
        samples="dataset.csv",
        solutions="miga/feasible.csv",
    ),
    KeptRun(
        name="`refined`",
        folder="refined",
        answer="table4.csv",
        config="../recommended/config.json",
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
DEFAULT = RUNS[0]


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
    """Mean and standard error of all pours of each published set, over the kept draws."""
    draws = pd.read_csv(KEPT / "published_sets" / "draws.csv")
    rows = []
    for solution, of_set in draws.groupby("solution", sort=False):
        row = {"solution": solution, "pours": of_set["n_seeds"].sum()}
        for name, column in ((ANGLE, "aor_flank"), (HEIGHT, "height")):
            unit = name.rpartition("_")[2]
            means, errors = (
                of_set[f"{column}_{unit}"],
                of_set[f"{column}_se_{unit}"],
            )
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
    poured = pooled_published_sets().set_index("solution").loc["representative"]
    rows = [
        ["article", *values, *ARTICLE_CHECK],
        [
            "article's set, poured here",
            *values,
            with_error(poured[ANGLE], poured[f"{ANGLE}_se"]),
            with_error(poured[HEIGHT], poured[f"{HEIGHT}_se"]),
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
    inside = f"{len(meeting)} of {len(samples)} samples, share of range"
    ranges = [
        "{:g} to {:g}".format(*target["range"])
        for target in DEFAULT.settings()["targets"]
    ]
    rows.append([inside, *shares, *ranges])
    return markdown(head, rows)


def meeting_samples(run):
    """The samples of the design, and those whose poured means lie in all target ranges."""
    samples = run.table(run.samples)
    meets = pd.Series(True, index=samples.index)
    for target in run.settings()["targets"]:
        low, high = target["range"]
        meets &= samples[target["response"]].between(low, high)
    return samples, samples[meets]


def covered_share(run, samples, parameter):
    """Share of a parameter's range between the smallest and the largest of its values."""
    low, high = bounds_of(run, parameter)
    return np.ptp(samples[parameter]) / (high - low)


def share_left_open():
    """Smallest and largest width of the posterior intervals over the prior's, at most 1."""
    posterior = DEFAULT.table("posterior/posterior.csv")
    width = posterior["credible_high"] - posterior["credible_low"]
    widths = []
    for parameter, own_width in zip(posterior["parameter"], width, strict=True):
        low, high = bounds_of(DEFAULT, parameter)
        widths.append(own_width / (0.95 * (high - low)))
    return min(1, min(widths)), min(1, max(widths))


def design():
    """What the design of the default run already meets, and what the pile determines."""
    samples, meeting = meeting_samples(DEFAULT)
    shares = {name: covered_share(DEFAULT, meeting, name) for name in PARAMETERS}
    least, most = min(shares, key=shares.get), max(shares, key=shares.get)
    narrowest, widest = share_left_open()
    return (
        "Many different parameter sets give the measured pile, so the pile alone cannot tell them apart.\n"
        f"In the default run, {len(meeting)} of the {len(samples)} simulated parameter sets met both targets before the search had begun, "
        f"and they are spread over {100 * shares[least]:.0f} to {100 * shares[most]:.0f} % of the searched range of each parameter.\n"
        "A statistical analysis with ten measured piles, which allows for errors of the simulator, agrees: "
        f"{100 * narrowest:.0f} to {100 * widest:.0f} % of each range remains possible.\n"
        "None of the six parameters is therefore determined by the pile alone, although the pile that they give together is.\n"
    )


def bounds():
    """How many solutions of the default run lie at a bound of the searched ranges."""
    solutions = DEFAULT.table(DEFAULT.solutions)
    warnings = solutions["warning"].dropna()
    at_bound = warnings[warnings.str.startswith("at a bound: ")]
    counts = at_bound.str.removeprefix("at a bound: ").value_counts()
    listed_bounds = [
        f"{count} of the {len(solutions)} solutions lie at the "
        f"{'lower' if bound.endswith('low') else 'upper'} bound of `{bound.split()[0]}`"
        for bound, count in counts.items()
    ]
    answer = answer_of(DEFAULT)
    low, high = bounds_of(DEFAULT, "mus_gg")
    distance = (answer["mus_gg"] - low) / (high - low)
    return (
        "If many solutions lie at the end of a searched range, better ones may lie beyond it. "
        "A solution is a parameter set that is predicted to meet the targets.\n"
        f"In the default run, {'; '.join(listed_bounds)}, the static friction between two berries, "
        f"and the answer lies only {100 * distance:.1f} % of that range above it.\n"
        "Since we took this bound from the article (Table 2), it may have cut the search off. "
        "To find out, give the parameter a wider range and run the study again.\n"
    )


def overlap(found, published):
    """Whether two intervals (low, high) have a point in common."""
    return found[0] <= published[1] and published[0] <= found[1]


def common_parameters(run):
    """The parameters whose intervals of found solutions overlap the article's, and all."""
    table3 = pd.read_csv(ARTICLE / "table3.csv").set_index("parameter")
    published = {name: tuple(table3.loc[name, ["low", "high"]]) for name in PARAMETERS}
    solutions = run.table(run.solutions)
    found = {
        name: (solutions[name].min(), solutions[name].max()) for name in PARAMETERS
    }
    common = [name for name in PARAMETERS if overlap(found[name], published[name])]
    return common, found, published


def overlaps():
    """In how many parameters each search's solutions overlap the article's Table 3."""
    counts = {run.name: len(common_parameters(run)[0]) for run in RUNS if run.solutions}
    apart = [name for name, count in counts.items() if count == 0]
    common = [f"in {name} {count} do" for name, count in counts.items() if count]
    return (
        "The article gives an interval of solutions for each parameter (its Table 3).\n"
        f"In {listed(apart)} none of the six intervals found here overlaps it; {listed(common)}.\n"
    )


def intervals():
    """The intervals of the solutions found beside the article's Table 3."""
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
    for run in RUNS:
        if run.samples is None:
            continue
        samples, meeting = meeting_samples(run)
        at_rest = samples[ANGLE].notna().sum()
        shares = [
            f"{100 * covered_share(run, meeting, name):.0f} %" for name in PARAMETERS
        ]
        rows.append([run.name, f"{len(meeting)} of {at_rest}", *shares])
    return markdown(head, rows)


def published_sets():
    """The article's sets as they pile up here: all pours of a set together."""
    head = [
        "set",
        "article: angle, Height",
        "here: angle, °",
        "here: Height, mm",
        "pours",
    ]
    rows = []
    sets = pd.read_csv(ARTICLE / "table4.csv").set_index("solution")
    for row in pooled_published_sets().itertuples():
        if row.solution not in sets.index:
            stated = "31.27 (measured), -"
            name = "Yu et al. 2022"
        else:
            own = sets.loc[row.solution]
            name = row.solution
            simulated = (
                f"{own['aor_simulated_deg']:.1f}, {own['height_simulated_mm']:.1f}"
            )
            predicted = f"predicted {own['aor_predicted_deg']:.1f}, {own['height_predicted_mm']:.1f}"
            stated = predicted if pd.isna(own["aor_simulated_deg"]) else simulated
        rows.append(
            [
                name,
                stated,
                with_error(row.aor_deg, row.aor_deg_se),
                with_error(row.height_mm, row.height_mm_se),
                row.pours,
            ]
        )
    return markdown(head, rows)


TEXTS = {
    "answers": answers,
    "bounds": bounds,
    "design": design,
    "designs": designs,
    "intervals": intervals,
    "overlaps": overlaps,
    "published_sets": published_sets,
}


def with_texts(page):
    """A page's text with each marked part made anew."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{TEXTS[found[2]]()}\n{found[3]}", page)


if __name__ == "__main__":
    for name in PAGES:
        path = ROOT / name
        path.write_text(with_texts(path.read_text()))

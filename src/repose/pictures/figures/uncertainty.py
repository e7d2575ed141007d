"""How sure the answer is: noise floor, posterior, sensitivity."""

import json

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from repose.core.parameters import PARAMETERS, SYMBOLS

from . import style

COLOURS = (style.BLUE, style.ORANGE)
CREDIBLE_SHARES = (0.95, 0.5)  # of the posterior inside a contour


def noise_floor(inputs, config):
    """Runs of each sample about their mean; standard error and reachable R2 over the number of seeds."""
    runs = pd.read_csv(inputs["runs"])
    ok = runs[runs["status"] == "ok"]
    seeds = pd.read_csv(inputs["seeds"])
    with open(inputs["noise"]) as file:
        rows = json.load(file)["responses"]
    figure = style.new_figure(style.PAGE, 4.6)
    panels = figure.subplots(2, 2, height_ratios=[1.15, 1])
    for panel, (column, label, unit), letter, colour in zip(
        panels[0], style.RESPONSES, "ab", COLOURS, strict=True
    ):
        _runs_by_mean(panel, ok, column, colour)
        panel.set(xlabel="samples, in order of their mean", ylabel=f"{label} ({unit})")
        row = rows[column]
        panel.set_title(letter, fontweight="bold")
        text = (
            f"standard deviation within samples {row['sd_within']:.2f} {unit}\n"
            f"between samples {row['sd_between']:.2f} {unit}\n"
            f"intraclass correlation {row['icc']:.2f} ({row['icc_low']:.2f}–{row['icc_high']:.2f})"
        )
        bottom, top = panel.get_ylim()
        panel.set_ylim(bottom, top + 0.2 * (top - bottom))
        style.note(panel, text, y=0.99)
    for (column, label, _), colour in zip(style.RESPONSES, COLOURS, strict=True):
        response = column.rsplit("_", 1)[0]
        panels[1, 0].plot(seeds["seeds"], seeds[f"{response}_se_percent"], color=colour, label=label)
        panels[1, 1].fill_between(
            seeds["seeds"],
            seeds[f"{response}_reachable_r2_low"],
            seeds[f"{response}_reachable_r2_high"],
            color=colour,
            alpha=0.2,
            lw=0,
        )
        style_of = {"color": colour, "ls": "-" if response == "aor" else "--", "label": label}
        panels[1, 1].plot(seeds["seeds"], seeds[f"{response}_reachable_r2"], **style_of)
    panels[1, 0].set(ylabel="standard error of a mean\n(% of the target)", yscale="log")
    panels[1, 0].set_yticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
    panels[1, 0].minorticks_off()
    panels[1, 1].set(ylabel="R² of a perfect predictor\non means over the seeds", ylim=(None, 1))
    for panel, letter in zip(panels[1], "cd", strict=True):
        panel.set(xlabel="seeds a sample", xscale="log")
        panel.set_xticks([1, 2, 4, 8, 16, 32, 64], [1, 2, 4, 8, 16, 32, 64])
        panel.minorticks_off()
        panel.grid(True)
        panel.set_title(letter, fontweight="bold")
    panels[1, 0].legend()
    panels[1, 1].legend(loc="lower right", title="band: 95 % interval", title_fontsize=6.8)
    return figure


def _runs_by_mean(panel, ok, column, colour):
    means = ok.groupby("sample")[column].mean().sort_values()
    place = pd.Series(np.arange(len(means)), index=means.index)
    panel.scatter(ok["sample"].map(place), ok[column], s=2.5, color=colour, alpha=0.45, lw=0)
    panel.plot(place, means, color=style.BLACK, lw=1.2)


def corner(inputs, config):
    """Draws of the posterior in every pair of parameters and of each, with the search's cloud and the published
    intervals."""
    draws, table = pd.read_csv(inputs["draws"]), pd.read_csv(inputs["posterior"]).set_index("parameter")
    cloud = pd.read_csv(inputs["feasible"])
    with open(inputs["summary"]) as file:
        summary = json.load(file)
    ranges, count = config["parameters"], len(PARAMETERS)
    figure = style.new_figure(style.PAGE, style.PAGE)
    panels = figure.subplots(count, count, sharex="col")
    for row, down in enumerate(PARAMETERS):
        for column, across in enumerate(PARAMETERS):
            panel = panels[row, column]
            if column > row:
                panel.axis("off")
                continue
            low, high = ranges[across]
            panel.set_xlim(low - 0.02 * (high - low), high + 0.02 * (high - low))
            panel.tick_params(labelsize=6, labelleft=column == 0 and row > 0)
            if column == row:
                _marginal(panel, draws[across], ranges[across], table.loc[across])
            else:
                _pair(panel, draws, across, down, ranges)
                panel.scatter(cloud[across], cloud[down], s=5, color=style.RED, lw=0, zorder=4)
                panel.add_patch(_published_box(table, across, down))
            if row == count - 1:
                panel.set_xlabel(f"{SYMBOLS[across]} (–)", fontsize=8.5)
            if column == 0 and row > 0:
                panel.set_ylabel(f"{SYMBOLS[down]} (–)", fontsize=8.5)
    figure.text(0.47, 0.975, _account(summary), fontsize=7.5, va="top", linespacing=1.5)
    handles = [
        Rectangle((0, 0), 1, 1, color=style.BLUE, alpha=0.35, lw=0),
        Line2D([], [], color=style.GREY, ls="--", lw=0.9),
        Line2D([], [], marker="o", ls="", ms=3.5, color=style.RED),
        Rectangle((0, 0), 1, 1, fill=False, ec=style.BLACK, lw=1.1),
    ]
    labels = [
        "posterior: 50 and 95 % of it",
        "uniform prior",
        "solutions of the search",
        "published intervals",
    ]
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.63, 0.80), fontsize=7.5)
    return figure


def _marginal(panel, values, bounds, row):
    panel.hist(values, bins=25, range=tuple(bounds), density=True, color=style.BLUE, alpha=0.35)
    panel.axhline(1 / (bounds[1] - bounds[0]), color=style.GREY, lw=0.9, ls="--")
    panel.axvspan(row["published_low"], row["published_high"], fill=False, ec=style.BLACK, lw=0.9)
    panel.set_title(f"{row['information_bits']:.2f} bits", fontsize=6.5, loc="center", pad=2)
    panel.set_yticks([])
    panel.spines["left"].set_visible(False)


def _pair(panel, draws, across, down, ranges):
    """Smoothed counts of two parameters' draws, filled down to each credible share."""
    counts, x, y = np.histogram2d(
        draws[across], draws[down], bins=25, range=(tuple(ranges[across]), tuple(ranges[down]))
    )
    counts = _smoothed(_smoothed(counts).T).T
    order = np.sort(counts.ravel())[::-1]
    inside = np.cumsum(order) / order.sum()
    levels = [order[min(np.searchsorted(inside, share), order.size - 1)] for share in CREDIBLE_SHARES]
    levels = [levels[0], max(levels[1], levels[0] * (1 + 1e-9)), order[0] * (1 + 1e-6)]
    # the outermost cells are drawn out to the bounds, where the prior ends
    x, y = ((edges[:-1] + edges[1:]) / 2 for edges in (x, y))
    x[0], x[-1], y[0], y[-1] = *ranges[across], *ranges[down]
    panel.contourf(x, y, counts.T, levels=levels, colors=["#BCD9EC", "#6FAED6"])
    low, high = ranges[down]
    panel.set_ylim(low - 0.02 * (high - low), high + 0.02 * (high - low))


def _smoothed(counts):
    """Counts (n, m) smoothed along the first axis by (1, 2, 1) / 4 twice, their ends reflected."""
    for _ in range(2):
        wide = np.concatenate([counts[:1], counts, counts[-1:]])
        counts = (wide[:-2] + 2 * wide[1:-1] + wide[2:]) / 4
    return counts


def _published_box(table, across, down):
    (x0, x1), (y0, y1) = (
        table.loc[name, ["published_low", "published_high"]].astype(float) for name in (across, down)
    )
    return Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, ec=style.BLACK, lw=1.1, zorder=5)


def _account(summary):
    """What the posterior predicts, in words."""
    predicted = summary["predicted"]
    parts = [
        f"predicted {label} {predicted[column]['mean']:.1f} {unit} "
        f"({predicted[column]['low']:.1f}–{predicted[column]['high']:.1f})"
        for column, label, unit in style.RESPONSES
    ]
    distance = summary["misfit"]["squared_distance"] ** 0.5
    parts.append(f"best draw {distance:.2f} standard deviations from the piles")
    parts.append(f"{100 * summary['thin_share']:.0f} % of the draws lie where samples are thin")
    parts.append(
        f"R-hat ≤ {summary['largest_r_hat']:.3f}, effective draws ≥ {summary['least_effective_draws']:.0f}"
    )
    if summary["thin_share"] > 0.5:
        parts.append("EXTRAPOLATED")
    if not summary["converged"]:
        parts.append("NOT CONVERGED")
    return "\n".join(parts)


def intervals(inputs, config):
    """Credible intervals beside the published intervals and the search's cloud, in the parameters' ranges."""
    table = pd.read_csv(inputs["posterior"])
    figure = style.new_figure(style.PAGE, 3.3)
    panel = figure.subplots()
    for k, row in table.iterrows():
        y, low, width = len(table) - 1 - k, row["low"], row["high"] - row["low"]

        def place(*values, low=low, width=width):
            return (np.array(values) - low) / width

        panel.barh(y, 1, height=0.8, color="#EEF0F2", zorder=0)
        for ends, offset, colour, label in (
            (("credible_low", "credible_high"), 0.22, style.BLUE, "posterior, 95 % and median"),
            (("miga_low", "miga_high"), 0.0, style.RED, "solutions of the search"),
            (("published_low", "published_high"), -0.22, style.ORANGE, "published interval"),
        ):
            x = place(*row[list(ends)].astype(float))
            panel.plot(x, [y + offset] * 2, "-|", color=colour, lw=3, ms=7, label=label if k == 0 else None)
        panel.plot(place(row["median"]), [y + 0.22], "o", ms=4.5, color="white", mec=style.BLUE, zorder=5)
        text = f"{100 * row['width_ratio']:.0f} %   {row['information_bits']:.2f} bits"
        panel.text(1.03, y, text, fontsize=6.8, va="center")
        for x, value in ((0, row["low"]), (1, row["high"])):
            panel.text(x, y - 0.47, f"{value:g}", fontsize=6, ha="center", va="center", color=style.GREY)
    panel.text(1.03, len(table) - 0.45, "width, information", fontsize=6.3, va="bottom", color=style.GREY)
    panel.set_yticks(range(len(table)), [SYMBOLS[name] for name in reversed(PARAMETERS)], fontsize=9)
    panel.set(xlim=(-0.03, 1.17), ylim=(-1.2, len(table) - 0.35))
    panel.set_xticks([0, 0.25, 0.5, 0.75, 1.0])
    panel.set_xlabel("place in the parameter's range (dimensionless)")
    panel.legend(loc="lower center", ncols=3, bbox_to_anchor=(0.43, -0.02))
    panel.spines["left"].set_visible(False)
    panel.tick_params(axis="y", length=0)
    return figure


def sobol_indices(inputs, config):
    """First-order and total indices of each parameter, with their intervals."""
    table = pd.read_csv(inputs["sobol"])
    figure = style.new_figure(style.PAGE, 2.4)
    panels = figure.subplots(1, 2)
    place = np.arange(len(PARAMETERS))
    for panel, (column, label, _), letter in zip(panels, style.RESPONSES, "ab", strict=True):
        rows = table[table["response"] == column].set_index("parameter").loc[list(PARAMETERS)]
        for name, offset, colour, text in (
            ("first", -0.2, style.BLUE, "first order"),
            ("total", 0.2, style.ORANGE, "total"),
        ):
            value = rows[name].to_numpy()
            ends = np.abs([value - rows[f"{name}_low"], rows[f"{name}_high"] - value])
            panel.bar(place + offset, value, 0.38, color=colour, label=text)
            panel.errorbar(
                place + offset, value, yerr=ends, fmt="none", ecolor=style.BLACK, lw=0.8, capsize=2
            )
        panel.axhline(0, color=style.BLACK, lw=0.6)
        panel.set_xticks(place, [SYMBOLS[name] for name in PARAMETERS], fontsize=9)
        panel.set_title(f"{letter}   {label}", fontweight="bold")
        panel.set_ylim(None, 1.15 * panel.get_ylim()[1])
        alone = rows["first"].sum()
        style.note(panel, f"first orders sum to {alone:.2f}", x=0.97, ha="right")
    panels[0].set_ylabel("share of the variance (–)")
    panels[0].legend(loc="upper left")
    return figure


def main_effects(inputs, config):
    """Mean response of the network along each parameter, on the simulated points."""
    effects, table = pd.read_csv(inputs["effects"]), pd.read_csv(inputs["dataset"])
    sobol = pd.read_csv(inputs["sobol"]).set_index(["response", "parameter"])
    good = table[table["status"] == "ok"]
    figure = style.new_figure(style.PAGE, 3.3)
    panels = figure.subplots(2, len(PARAMETERS), sharex="col", sharey="row")
    for row, (column, label, unit) in enumerate(style.RESPONSES):
        for panel, name in zip(panels[row], PARAMETERS, strict=True):
            line = effects[effects["parameter"] == name]
            panel.scatter(good[name], good[column], s=4, color=style.GREY, alpha=0.6, lw=0)
            panel.plot(line["value"], line[column], color=style.BLUE, lw=1.8)
            share = sobol.loc[(column, name), "first"]
            panel.set_title(f"{100 * max(share, 0.0):.0f} %", fontsize=6.8, loc="right", pad=2)
            panel.set_xlim(config["parameters"][name])
        panels[row, 0].set_ylabel(f"{label} ({unit})")
    for panel, name in zip(panels[1], PARAMETERS, strict=True):
        panel.set_xlabel(f"{SYMBOLS[name]} (–)", fontsize=8.5)
    text = (
        "points: samples; line: mean of the network over the other five; %: first-order share of the variance"
    )
    figure.supxlabel(text, fontsize=6.8)
    return figure

"""The answer of the sequential strategy over the pours: its probability and its responses."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.common.files import read_table

from . import style
from .registry import Inputs, Shown, figure

INPUTS = {"batches": "sequential/batches.csv", "check": "sequential/check.csv"}
OF_STRATEGY: dict[str, Any] = {"folder": "sequential", "category": "Sequential"}
READS = ("targets", "sequential.tolerance_percent", "sequential.probability")


@figure(
    "sequential",
    "Probability and prediction by pours",
    INPUTS,
    reads=READS,
    **OF_STRATEGY,
)
def sequential(inputs: Inputs, study: Shown) -> Figure:
    """Draw probability and predicted responses of the best point after each batch, and the check.

    How the answer became certain. Left the probability that the best point meets all targets within the tolerance,
    after each batch of pours; dotted, the most that the pours left can make of it; squares, the probability that
    any parameter set meets them. Beside it: the responses predicted at the best point, with one standard error, in
    percent off the target; the band is the tolerance. The filled point at the end is the answer simulated again
    with fresh seeds, with the standard error of its mean. It took no part in finding the answer.
    """
    targets, section = study.targets, study.sequential
    columns = [f"{name}_{what}" for name in targets.names for what in ("mean", "error")]
    batches = read_table(
        inputs["batches"], ("pours", "probability", "reachable", "in_reach", *columns)
    )
    check = read_table(
        inputs["check"], ("response", "simulated", "simulated_error")
    ).set_index("response")
    figure, panels = style.grid(1 + len(targets), 2.2, columns=3, further=0.4)
    _probability(panels[0], batches, section)
    after = float(batches["pours"].iloc[-1]) * 1.06
    for panel, target in zip(panels[1:], targets, strict=True):
        off = 100 / target.whole * (batches[f"{target.name}_mean"] - target.aim)
        style.off_target(panel, target, section.tolerance_percent, "pours")
        look = {
            "fmt": "D",
            "ms": 4,
            "mfc": "white",
            "color": style.BLACK,
            "label": "predicted ± standard error",
        }
        panel.errorbar(
            batches["pours"],
            off,
            100 / target.whole * batches[f"{target.name}_error"],
            **look,
        )
        simulated, spread = check.loc[
            target.name, ["simulated", "simulated_error"]
        ].astype(float)
        look = {
            "fmt": "o",
            "ms": 5,
            "color": style.RED,
            "label": "the answer, simulated again ± standard error",
        }
        panel.errorbar(
            [after],
            [target.off_percent(simulated)],
            [100 * spread / target.whole],
            **look,
        )
    style.one_legend(panels, loc="outside lower center", ncols=3)
    reached = batches["probability"].iloc[-1]
    verdict = "reached" if reached >= section.probability else "NOT reached"
    words = f"{verdict}: all targets met with probability {reached:.2f}; asked for is {section.probability:g}"
    figure.suptitle(words, fontsize=7.5)
    return figure


def _probability(panel: Axes, batches: Any, section: Any) -> None:
    """Draw the probability after each batch, the one that the remaining pours can reach, and the required one."""
    for name, look, size, colour, label in (
        ("probability", "o-", 4, style.BLUE, "probability of the best point"),
        (
            "reachable",
            ":",
            4,
            style.GREY,
            "the most that the pours left can make of it",
        ),
        ("in_reach", "s-", 3, style.ORANGE, "probability that any set meets them"),
    ):
        panel.plot(
            batches["pours"], batches[name], look, ms=size, color=colour, label=label
        )
    panel.axhline(
        section.probability,
        color=style.RED,
        ls="--",
        lw=0.9,
        label="probability asked for",
    )
    panel.set(xlabel="pours", ylabel="probability", ylim=(-0.03, 1.02))
    panel.set_title(f"All targets within {section.tolerance_percent:g} %")

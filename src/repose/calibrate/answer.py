"""The result of a calibration: parameters, and whether their responses meet targets."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from repose.calibrate.chance import PERCENT
from repose.calibrate.responses import named as known_response
from repose.calibrate.targets import Target

# Remedy if only the prediction meets the targets.
MORE_POURS = (
    "`repose run refined`, which pours near the answer; or more samples, or more seeds "
    "for each"
)
CARD = "card.json"
REPORT = "report.html"
# Columns of the probabilities that all means lie within some percent of the aims.
WITHIN = {percent: f"within_{percent:g}_percent" for percent in PERCENT}
# Status of a check that was not made.
NOT_AGAIN = "not simulated again"
SAID = {True: "targets met", False: "targets NOT met", None: "targets not checked yet"}


@dataclass(frozen=True)
class Check:
    """One response of the representative solution, simulated with fresh seeds; its fields are keys of the card."""

    response: str
    apparatus: str  # its bench test
    unit: str
    measured: float  # mean of the physical repetitions
    sd: float  # standard deviation of the physical repetitions
    repetitions: int
    low: float  # of the target range
    high: float
    simulated: float | None  # mean of the runs; None if they failed
    standard_error: float | None  # None if they failed, or after a single run
    runs: int
    status: str  # "ok" if the runs can be measured; `NOT_AGAIN` without any
    whole: float | None = None  # of a profile's score: what percents are of
    predicted: float | None = None  # by the surrogate, before the runs
    line: str = ""  # of an angle of a pile, in words

    @classmethod
    def of(
        cls,
        target: Target,
        simulated: float | None,
        standard_error: float | None,
        runs: int,
        status: str,
        predicted: float | None = None,
        line: str = "",
    ) -> Self:
        """Make the check of a target."""
        return cls(
            response=target.name,
            apparatus=target.response.apparatus,
            unit=target.response.unit,
            measured=target.value,
            sd=target.sd,
            repetitions=target.repetitions,
            low=target.low,
            high=target.high,
            simulated=simulated,
            standard_error=standard_error,
            runs=runs,
            status=status,
            whole=None if target.profile is None else target.whole_value,
            predicted=predicted,
            line=line,
        )

    def row(self) -> dict[str, Any]:
        """Return its entry in the material card, without the definition of the response."""
        given = (
            name for name in ("whole", "predicted") if getattr(self, name) is not None
        )
        names = [
            "response",
            "apparatus",
            "unit",
            "measured",
            "sd",
            "repetitions",
            "low",
            "high",
            *given,
        ]
        names += ["simulated", "standard_error", "runs", "status", "met"]
        return {name: getattr(self, name) for name in names}

    @property
    def error_percent(self) -> float | None:
        """Relative error of the prediction, as in the article's Table 4; None without both numbers or of a score."""
        if self.predicted is None or not self.simulated or self.whole is not None:
            return None
        return 100 * abs(self.predicted / self.simulated - 1)

    @property
    def met(self) -> bool | None:
        """Whether the simulated mean lies in the target range; None where it was not simulated again."""
        if self.status == NOT_AGAIN:
            return None
        return self.simulated is not None and self.low <= self.simulated <= self.high

    @property
    def label(self) -> str:
        """The response in words; a response of the user's own has its name alone."""
        known = known_response(self.response)
        return self.response if known is None else known.label

    @property
    def margin(self) -> float:
        """Distance to the nearer end of the range: positive inside, negative outside, NaN without a number."""
        return (
            math.nan
            if self.simulated is None
            else min(self.simulated - self.low, self.high - self.simulated)
        )

    @property
    def distance(self) -> str:
        """Difference of the simulated from the measured mean, in percent and in standard deviations."""
        if self.simulated is None:
            return f"{self.response} unknown"
        off, percent = (
            self.simulated - self.measured,
            100 / (self.whole or abs(self.measured)),
        )
        error = (
            ""
            if self.standard_error is None
            else f" +- {percent * self.standard_error:.1f}"
        )
        spread = (
            f" ({abs(off) / self.sd:.2f} standard deviations of a repetition)"
            if self.sd > 0
            else ""
        )
        return f"{self.response} {round(percent * off, 1) + 0.0:+.1f}{error} %{spread}"

    @property
    def miss(self) -> str:
        """By how much the simulation misses the range, a clause."""
        if self.simulated is None:
            return f"the {self.label} has no number, as its runs ended {self.status}"
        side = "below" if self.simulated < self.low else "above"
        by = f"{-self.margin:.2g} {self.unit}".rstrip()
        return f"the simulated {self.label} lies {by} {side} its range"

    @property
    def numbers(self) -> str:
        """The simulated mean, or else the predicted one, beside the measured mean."""
        known = known_response(self.response) is not None
        label = self.label[0].upper() + self.label[1:] if known else self.label
        label += f" ({self.line})" if self.line else ""
        value, word = (
            (self.predicted, "predicted ")
            if self.simulated is None
            else (self.simulated, "")
        )
        if value is None:
            return f"{label} without a number (measured {self.measured:.4g})"
        off = (
            round(100 * (value - self.measured) / (self.whole or abs(self.measured)), 1)
            + 0.0
        )  # no -0.0
        number = f"{word}{value:.4g}{self._error} {self.unit}".rstrip()
        return f"{label} {number} (measured {self.measured:.4g}, {off:+.1f} %)"

    def __str__(self) -> str:
        aimed = f"target {self.low:g} to {self.high:g} {self.unit}"
        if self.simulated is None:
            return f"{self.response}: no number, the runs ended {self.status}; {aimed}: NOT met"
        verdict, side = ("met", "inside") if self.met else ("NOT met", "outside")
        return (
            f"{self.response}: simulated {self.simulated:.4g}{self._error} {self.unit} (runs: {self.runs}), measured "
            f"{self.measured:.4g}; {aimed}: {verdict}, {abs(self.margin):.2g} {self.unit} {side}"
        )

    @property
    def _error(self) -> str:
        """The standard error behind a mean; empty where it is unknown."""
        return "" if self.standard_error is None else f" +- {self.standard_error:.2g}"


@dataclass(frozen=True)
class Result:
    """The result of a calibration, simulated again.

    `within` has the probability, by percent of the aims, that all means lie so near to them; it comes from the runs of
    the check alone, and None means unknown.
    """

    label: str  # of the study
    parameters: Mapping[str, float]  # the representative solution
    feasible: bool  # whether the search found a set whose prediction meets the targets
    message: str  # of the search
    checks: tuple[Check, ...]  # one for each target
    folder: Path  # of the results
    within: Mapping[float, float | None]
    tables: Path = Path()  # folder of the check
    solutions: Path = Path()  # all parameter sets found
    advice: str = MORE_POURS  # remedy if only the prediction meets the targets
    why: str = ""  # why a strategy with several batches ended
    out_of_reach: bool = False  # as `out_of_reach` of a summary
    small_run: bool = False  # its numbers are no calibration
    labels: Mapping[str, str] = field(default_factory=dict)  # of the parameters

    @property
    def met(self) -> bool | None:
        """Whether the search found a feasible solution and its simulation meets every target; None without one."""
        if any(check.met is None for check in self.checks):
            return None
        return self.feasible and all(check.met for check in self.checks)

    @property
    def reason(self) -> str:
        """Why the targets are met or not, a sentence."""
        count = len(self.checks)
        ranges = ("the range", "both ranges", f"all {count} ranges")[min(count, 3) - 1]
        found = (
            "no parameter set is"
            if self.out_of_reach
            else f"the answer is{'' if self.feasible else ' not'}"
        )
        predicted = f"{found} predicted inside {ranges}"
        missed = " and ".join(check.miss for check in self.checks if check.met is False)
        inside = (
            f"the simulated mean{' lies' if count == 1 else 's lie'} inside {ranges}"
        )
        simulated = (
            f"the answer was {NOT_AGAIN}" if self.met is None else missed or inside
        )
        sentence = (
            simulated
            if self.feasible and self.met is not None
            else f"{predicted}; {simulated}"
        )
        return f"{sentence[0].upper()}{sentence[1:]}."

    @property
    def verdict(self) -> str:
        """Whether the targets are met, in one line with numbers."""
        return f"{self.label}: {in_one_line(self.met, self.checks, self.reason, self.small_run)}"

    def __str__(self) -> str:
        head = (
            "The calibrated parameters"
            if self.feasible
            else f"{self.message}\nThe nearest parameters"
        )
        lines = [self.verdict, f"{head}:"]
        lines += [
            f"  {name:7} {value:.4g}  {self.labels.get(name, name)}"
            for name, value in self.parameters.items()
        ]
        lines.append("Simulated again with fresh seeds:")
        lines += [
            f"  {line}" for line in (*self.checks, nearness(self.checks), self._chance)
        ]
        made = f"the report: {self.folder / REPORT}, and the material card: {self.folder / CARD}"
        lines.append(
            f"Tables: {self.tables}; all solutions: {self.solutions}; after the whole study {made}"
        )
        if self.why:
            lines.append(f"No more batches: {self.why}.")
        if not self.met:
            lines.append(
                f"What helps: {'' if self.feasible else 'wider parameters or targets; '}{self.advice}."
            )
        return "\n".join(lines)

    @property
    def _chance(self) -> str:
        """The probability that all means are near their targets."""
        if None in self.within.values():
            return "the distance of the means from their targets is unknown"
        shares = ", ".join(
            f"within {percent:g} %: {value:.2f}"
            for percent, value in self.within.items()
        )
        return f"probability that all means are near their targets, by these runs alone: {shares}"


def out_of_reach(summary: Mapping[str, Any]) -> bool:
    """Tell whether no parameter set is predicted to meet the targets, which a strategy with a `stop` judges itself."""
    return (
        not summary["feasible"]
        and summary.get("stop", "out_of_reach") == "out_of_reach"
    )


def in_one_line(
    met: bool | None, checks: Iterable[Check], reason: str, small_run: bool = False
) -> str:
    """Write the verdict with its numbers; where the targets are not met, with the reason."""
    small = "a small run, its numbers are no calibration: " if small_run else ""
    numbers = ", ".join(check.numbers for check in checks)
    return f"{small}{SAID[met]}. {numbers}." + ("" if met else f" {reason}")


def nearness(checks: Iterable[Check]) -> str:
    """Write in a sentence how far the simulated means are from the measured ones."""
    return f"Simulated less measured: {', '.join(check.distance for check in checks)}."


def describe_probability(chance: Mapping[str, float]) -> str:
    """Write how probably the means of another simulator meet all targets, a clause."""
    one, two, inside = (chance[name] for name in (*WITHIN.values(), "inside"))
    return f"within 1 % of all targets: {one:.2f}; within 2 %: {two:.2f}; inside all ranges: {inside:.2f}"

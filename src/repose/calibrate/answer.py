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
VERDICTS = {
    True: "targets met",
    False: "targets NOT met",
    None: "targets not checked yet",
}


@dataclass(frozen=True)
class Check:
    """A response of the representative solution, simulated with fresh seeds.

    Most fields are keys of the card.

    Attributes
    ----------
    response, apparatus, unit : str
        Name of the response, its bench test and its unit.
    measured, sd : float
        Mean and standard deviation of the physical repetitions.
    repetitions : int
        Their number.
    low, high : float
        The range of the target.
    simulated : float or None
        Mean of the runs; None if they failed.
    standard_error : float or None
        Of this mean; None if the runs failed, or after a single run.
    runs : int
    status : str
        "ok" if the runs can be measured; `NOT_AGAIN` without any.
    whole : float or None
        What 100 % means, for the score of a profile.
    predicted : float or None
        By the surrogate, before the runs.
    line : str
        Description of the line whose slope an angle of a pile is.
    """

    response: str
    apparatus: str
    unit: str
    measured: float
    sd: float
    repetitions: int
    low: float
    high: float
    simulated: float | None
    standard_error: float | None
    runs: int
    status: str
    whole: float | None = None
    predicted: float | None = None
    line: str = ""

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
        """Return its entry in the material card, without the definition."""
        row: dict[str, Any] = {
            "response": self.response,
            "apparatus": self.apparatus,
            "unit": self.unit,
            "measured": self.measured,
            "sd": self.sd,
            "repetitions": self.repetitions,
            "low": self.low,
            "high": self.high,
        }
        if self.whole is not None:
            row["whole"] = self.whole
        if self.predicted is not None:
            row["predicted"] = self.predicted
        row["simulated"] = self.simulated
        row["standard_error"] = self.standard_error
        row["runs"] = self.runs
        row["status"] = self.status
        row["met"] = self.met
        return row

    @property
    def error_percent(self) -> float | None:
        """Relative error of the prediction, as in Table 4 of the article.

        It is None without both numbers, and for the score of a profile.
        """
        if self.predicted is None or not self.simulated or self.whole is not None:
            return None
        return 100 * abs(self.predicted / self.simulated - 1)

    @property
    def met(self) -> bool | None:
        """Whether the simulated mean lies in the range of the target.

        It is None where it was not simulated again.
        """
        if self.status == NOT_AGAIN:
            return None
        return self.simulated is not None and self.low <= self.simulated <= self.high

    @property
    def label(self) -> str:
        """The response in words; the name alone for a response of the user."""
        known = known_response(self.response)
        return self.response if known is None else known.label

    @property
    def margin(self) -> float:
        """Distance to the nearer end of the range.

        It is positive inside, negative outside, and NaN without a number.
        """
        if self.simulated is None:
            return math.nan
        return min(self.simulated - self.low, self.high - self.simulated)

    @property
    def distance(self) -> str:
        """Difference of the simulated from the measured mean.

        It is in percent and in standard deviations of a repetition.
        """
        if self.simulated is None:
            return f"{self.response} unknown"
        difference = self.simulated - self.measured
        percent_of_one = 100 / self._whole_of_measured
        # Rounding may give -0.0, which the sum turns into 0.0.
        percent = round(percent_of_one * difference, 1) + 0.0
        error = ""
        if self.standard_error is not None:
            error = f" +- {percent_of_one * self.standard_error:.1f}"
        in_deviations = ""
        if self.sd > 0:
            count = abs(difference) / self.sd
            in_deviations = f" ({count:.2f} standard deviations of a repetition)"
        return f"{self.response} {percent:+.1f}{error} %{in_deviations}"

    @property
    def miss(self) -> str:
        """By how much the simulation misses the range, a clause."""
        if self.simulated is None:
            return f"the {self.label} has no number, as its runs ended {self.status}"
        side = "below" if self.simulated < self.low else "above"
        distance = f"{-self.margin:.2g} {self.unit}".rstrip()
        return f"the simulated {self.label} lies {distance} {side} its range"

    @property
    def numbers(self) -> str:
        """The simulated mean, or else the predicted one, with the measured mean."""
        label = self.label
        if known_response(self.response) is not None:
            label = label[0].upper() + label[1:]
        if self.line:
            label += f" ({self.line})"
        value = self.simulated
        kind = ""
        if value is None:
            value = self.predicted
            kind = "predicted "
        if value is None:
            return f"{label} without a number (measured {self.measured:.4g})"
        # Rounding may give -0.0, which the sum turns into 0.0.
        percent = 100 * (value - self.measured) / self._whole_of_measured
        percent = round(percent, 1) + 0.0
        number = f"{kind}{value:.4g}{self._error} {self.unit}".rstrip()
        return f"{label} {number} (measured {self.measured:.4g}, {percent:+.1f} %)"

    @property
    def _whole_of_measured(self) -> float:
        """What 100 % of the measured mean means."""
        return self.whole or abs(self.measured)

    def __str__(self) -> str:
        target = f"target {self.low:g} to {self.high:g} {self.unit}"
        if self.simulated is None:
            return (
                f"{self.response}: no number, the runs ended {self.status}; {target}: "
                "NOT met"
            )
        verdict, side = ("met", "inside") if self.met else ("NOT met", "outside")
        return (
            f"{self.response}: simulated {self.simulated:.4g}{self._error} {self.unit} "
            f"(runs: {self.runs}), measured {self.measured:.4g}; {target}: {verdict}, "
            f"{abs(self.margin):.2g} {self.unit} {side}"
        )

    @property
    def _error(self) -> str:
        """The standard error after a mean; empty where it is unknown."""
        return "" if self.standard_error is None else f" +- {self.standard_error:.2g}"


@dataclass(frozen=True)
class Result:
    """The result of a calibration, simulated again.

    Attributes
    ----------
    label : str
        Of the study.
    parameters : mapping
        The representative solution.
    feasible : bool
        Whether the search found a set whose prediction meets the targets.
    message : str
        Of the search.
    checks : tuple of Check
        One for each target.
    folder : Path
        Of the results.
    within : mapping
        Probability, by percent of the aims, that all means lie so near to them. It comes
        from the runs of the check alone; None means unknown.
    tables : Path
        Folder of the check.
    solutions : Path
        All parameter sets that were found.
    advice : str
        Remedy if only the prediction meets the targets.
    why : str
        Why a strategy with several batches ended.
    out_of_reach : bool
        Result of `out_of_reach` for the summary.
    small_run : bool
        Whether the study is too small for a calibration.
    labels : mapping
        Meanings of the parameters.
    """

    label: str
    parameters: Mapping[str, float]
    feasible: bool
    message: str
    checks: tuple[Check, ...]
    folder: Path
    within: Mapping[float, float | None]
    tables: Path = Path()
    solutions: Path = Path()
    advice: str = MORE_POURS
    why: str = ""
    out_of_reach: bool = False
    small_run: bool = False
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def met(self) -> bool | None:
        """Whether the solution is feasible and its simulation meets every target.

        It is None where a target was not simulated again.
        """
        if any(check.met is None for check in self.checks):
            return None
        return self.feasible and all(check.met for check in self.checks)

    @property
    def reason(self) -> str:
        """Why the targets are met or not, a sentence."""
        if self.met is None:
            sentence = f"{self._prediction}; the answer was {NOT_AGAIN}"
        elif self.feasible:
            sentence = self._simulation
        else:
            sentence = f"{self._prediction}; {self._simulation}"
        return f"{sentence[0].upper()}{sentence[1:]}."

    @property
    def _ranges(self) -> str:
        """The ranges of all targets, in words."""
        count = len(self.checks)
        return {1: "the range", 2: "both ranges"}.get(count, f"all {count} ranges")

    @property
    def _prediction(self) -> str:
        """What is predicted, a clause."""
        if self.out_of_reach:
            return f"no parameter set is predicted inside {self._ranges}"
        verb = "is" if self.feasible else "is not"
        return f"the answer {verb} predicted inside {self._ranges}"

    @property
    def _simulation(self) -> str:
        """What the simulation showed, a clause."""
        misses = [check.miss for check in self.checks if check.met is False]
        if misses:
            return " and ".join(misses)
        if len(self.checks) == 1:
            return f"the simulated mean lies inside {self._ranges}"
        return f"the simulated means lie inside {self._ranges}"

    @property
    def verdict(self) -> str:
        """Whether the targets are met, in one line with numbers."""
        line = in_one_line(self.met, self.checks, self.reason, self.small_run)
        return f"{self.label}: {line}"

    def __str__(self) -> str:
        lines = [self.verdict]
        if self.feasible:
            lines.append("The calibrated parameters:")
        else:
            lines += [self.message, "The nearest parameters:"]
        for name, value in self.parameters.items():
            lines.append(f"  {name:7} {value:.4g}  {self.labels.get(name, name)}")
        lines.append("Simulated again with fresh seeds:")
        lines += [f"  {check}" for check in self.checks]
        lines += [f"  {nearness(self.checks)}", f"  {self._probability}"]
        lines.append(
            f"Tables: {self.tables}; all solutions: {self.solutions}; after the whole "
            f"study the report: {self.folder / REPORT}, and the material card: "
            f"{self.folder / CARD}"
        )
        if self.why:
            lines.append(f"No more batches: {self.why}.")
        if not self.met:
            wider = "" if self.feasible else "wider parameters or targets; "
            lines.append(f"What helps: {wider}{self.advice}.")
        return "\n".join(lines)

    @property
    def _probability(self) -> str:
        """The probability that all means are near their targets, a clause."""
        if None in self.within.values():
            return "the distance of the means from their targets is unknown"
        probabilities = ", ".join(
            f"within {percent:g} %: {value:.2f}"
            for percent, value in self.within.items()
        )
        return (
            "probability that all means are near their targets, by these runs alone: "
            f"{probabilities}"
        )


def out_of_reach(summary: Mapping[str, Any]) -> bool:
    """Decide whether no parameter set is predicted to meet the targets.

    A strategy whose summary has the key `stop` decides it itself.
    """
    if summary["feasible"]:
        return False
    return summary.get("stop", "out_of_reach") == "out_of_reach"


def in_one_line(
    met: bool | None, checks: Iterable[Check], reason: str, small_run: bool = False
) -> str:
    """Write the verdict with its numbers, and the reason unless the targets are met."""
    numbers = ", ".join(check.numbers for check in checks)
    line = f"{VERDICTS[met]}. {numbers}."
    if small_run:
        line = f"a small run, its numbers are no calibration: {line}"
    return line if met else f"{line} {reason}"


def nearness(checks: Iterable[Check]) -> str:
    """Write how far the simulated means are from the measured ones, a sentence."""
    return f"Simulated less measured: {', '.join(check.distance for check in checks)}."


def describe_probability(chance: Mapping[str, float]) -> str:
    """Write how probably the means of another simulator meet all targets, a clause."""
    return (
        f"within 1 % of all targets: {chance['within_1_percent']:.2f}; within 2 %: "
        f"{chance['within_2_percent']:.2f}; inside all ranges: {chance['inside']:.2f}"
    )

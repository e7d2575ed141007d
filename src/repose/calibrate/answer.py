"""The result of a calibration: the parameters, and whether they meet the targets."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum
from pathlib import Path
from typing import Any, Self

from repose.calibrate.chance import REPORTED_PERCENTS, compute_range_probability
from repose.calibrate.responses import find_response as known_response
from repose.calibrate.targets import Target
from repose.common.numbers import (
    format_percent,
    format_significant,
    format_with_error,
)
from repose.common.statuses import describe_status

# Advice for an answer whose prediction meets the targets but whose simulation does not.
MORE_POURS_ADVICE = (
    "`repose run refined`, which pours where the fit may meet the targets; or more "
    "samples, or more seeds for each"
)
CARD_FILE = "card.json"
REPORT_FILE = "report.html"
# Columns of the probabilities that all means lie within some percent of the aims.
WITHIN_COLUMNS = {
    percent: f"within_{percent:g}_percent" for percent in REPORTED_PERCENTS
}
# Column of the probability that all means lie inside their ranges.
INSIDE_COLUMN = "within_ranges"
# Status of a check whose answer has not been simulated again.
NOT_SIMULATED_AGAIN = "not simulated again"
# Value of the key `stop` in a summary. The answer misses the targets, but nothing was
# simulated at the ends of the ranges where it lies, so the targets may be within reach.
ENDS_NOT_SIMULATED = "ends_not_simulated"
NEAR_BOUNDS_INTRODUCTION = "At a bound of the ranges, as far as the fit can tell"
# A check is decisive if the probability of lying inside the range is at least this
# number, or at most 1 minus this number.
DECISIVE_PROBABILITY = 0.95
# Width of the column of names in the description of the parameters. It fits the names
# of the goji study; longer names only shift their line.
NAME_WIDTH = 7
# Largest number of further runs that a verdict asks for.
MAX_FURTHER_RUNS = 1000


class Verdict(StrEnum):
    """Whether the targets are met, given the standard errors of the check."""

    MET = "met"
    NOT_MET = "NOT met"
    UNDECIDED = "undecided"
    UNCHECKED = "not checked yet"

    @property
    def met(self) -> bool | None:
        """The verdict as True or False; None if it is undecided or not checked yet."""
        return {Verdict.MET: True, Verdict.NOT_MET: False}.get(self)


def judge_probability(probability: float | None) -> Verdict:
    """Turn the probability of lying inside the range into a verdict.

    Without a probability (None), the verdict is undecided.
    """
    if (
        probability is None
        or 1 - DECISIVE_PROBABILITY < probability < DECISIVE_PROBABILITY
    ):
        return Verdict.UNDECIDED
    return Verdict.MET if probability >= DECISIVE_PROBABILITY else Verdict.NOT_MET


def describe_state(
    verdict: Verdict, predicted: float | None = None, out_of_reach: bool = False
) -> str:
    """Describe the state of an answer: its verdict, or what is predicted of it.

    Parameters
    ----------
    verdict : Verdict
        The verdict on the targets.
    predicted : float, optional
        Predicted probability that all means lie inside their ranges; None if unknown.
        It counts only if the answer was not simulated again.
    out_of_reach : bool, optional
        Whether no parameter set is predicted to meet the targets. It counts only if the
        probability is unknown.

    Returns
    -------
    str
        Such as "undecided" or "predicted: undecided (72 %)".
    """
    if verdict is not Verdict.UNCHECKED:
        return verdict.value
    if predicted is None:
        state = Verdict.NOT_MET if out_of_reach else Verdict.UNDECIDED
        return f"predicted: {state} (probability unknown)"
    return f"predicted: {judge_probability(predicted)} ({format_percent(predicted)})"


@dataclass(frozen=True)
class Check:
    """Comparison of one simulated response of the answer with its target.

    The answer is simulated with fresh seeds. Most fields are keys of the card.

    Attributes
    ----------
    response, apparatus, unit : str
        Name of the response, its bench test and its unit.
    measured, sd : float
        Mean and standard deviation of the physical repetitions.
    repetitions : int
        Number of physical repetitions.
    low, high : float
        Ends of the range of the target.
    simulated : float or None
        Mean of the runs; None if they failed.
    standard_error : float or None
        Standard error of this mean; None if the runs failed, or after a single run.
    runs : int
        Number of runs.
    status : str
        "ok" if the runs can be measured; `NOT_SIMULATED_AGAIN` without any run.
    whole : float or None
        For the score of a profile, the number that counts as 100 %; otherwise None, and
        the measured mean counts as 100 %.
    predicted : float or None
        Prediction of the surrogate before the runs.
    optimism : float or None
        Expected value of the prediction minus the true mean; None if unknown.
    optimism_error : float or None
        Standard error of `optimism`; None if unknown.
    line : str
        For the angle of a pile, the line whose slope it is; otherwise empty.
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
    optimism: float | None = None
    optimism_error: float | None = None

    @classmethod
    def from_target(
        cls,
        target: Target,
        simulated: float | None,
        standard_error: float | None,
        runs: int,
        status: str,
        predicted: float | None = None,
        line: str = "",
        optimism: float | None = None,
        optimism_error: float | None = None,
    ) -> Self:
        """Make the check of a target.

        The other arguments become the attributes of the same names.
        """
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
            optimism=optimism,
            optimism_error=optimism_error,
        )

    @classmethod
    def from_card_entry(cls, entry: Mapping[str, Any]) -> Self:
        """Make the check from an entry of the list `tests` of a material card."""
        names = [attribute.name for attribute in fields(cls)]
        return cls(**{name: entry[name] for name in names if name in entry})

    def make_card_entry(self) -> dict[str, Any]:
        """Make the entry of this check for the list `tests` of the material card.

        The caller adds the definition of the response and its bench test.

        Returns
        -------
        dict
            The keys are written to the card in this order. The keys `whole`,
            `predicted`, `optimism` and `optimism_error` are left out if they are
            unknown.
        """
        entry: dict[str, Any] = {
            "response": self.response,
            "apparatus": self.apparatus,
            "unit": self.unit,
            "measured": self.measured,
            "sd": self.sd,
            "repetitions": self.repetitions,
            "low": self.low,
            "high": self.high,
        }
        # Add the keys that only some checks have.
        if self.whole is not None:
            entry["whole"] = self.whole
        if self.predicted is not None:
            entry["predicted"] = self.predicted
        if self.optimism is not None:
            entry["optimism"] = self.optimism
            entry["optimism_error"] = self.optimism_error
        entry["simulated"] = self.simulated
        entry["standard_error"] = self.standard_error
        entry["runs"] = self.runs
        entry["status"] = self.status
        entry["met"] = self.verdict.met
        entry["verdict"] = self.verdict.value
        entry["probability_inside"] = self.probability
        return entry

    @property
    def error_percent(self) -> float | None:
        """Relative error of the prediction in percent, as in Table 4 of the article.

        It is None if the predicted or the simulated number is missing, and for the
        score of a profile.
        """
        if self.predicted is None or not self.simulated or self.whole is not None:
            return None
        return 100 * abs(self.predicted / self.simulated - 1)

    @property
    def prediction_clause(self) -> str:
        """Clause with the prediction and its optimism; empty if there is none."""
        if self.predicted is None:
            return ""
        text = (
            f"{self.response} {format_significant(self.predicted)} {self.unit}".rstrip()
        )
        return f"{text} ({self.optimism_clause})"

    @property
    def optimism_clause(self) -> str:
        """Clause with the expected optimism of the prediction, known or unknown."""
        if self.optimism is None:
            return "expected optimism unknown"
        return describe_optimism(self.optimism, self.optimism_error)

    @property
    def verdict(self) -> Verdict:
        """Whether the simulator's mean lies in the range of the target."""
        if self.status == NOT_SIMULATED_AGAIN:
            return Verdict.UNCHECKED
        if self.simulated is None:
            return Verdict.NOT_MET
        return judge_probability(self.probability)

    @property
    def probability(self) -> float | None:
        """Probability that the simulator's mean lies in the range of the target.

        It is None if fewer than two runs gave a number.
        """
        return self.compute_probability(self.runs)

    def compute_probability(self, total_runs: int) -> float | None:
        """Compute the probability that the mean lies in the range after more runs.

        The mean and the scatter are assumed to stay those of the runs made so far.

        Parameters
        ----------
        total_runs : int
            Number of runs, including those made so far; at least two.

        Returns
        -------
        float or None
            None if the mean or its standard error is unknown.
        """
        if self.simulated is None or self.standard_error is None or self.runs < 2:
            return None
        # The standard error of a mean falls with the root of the number of runs.
        error = self.standard_error * math.sqrt(self.runs / total_runs)
        return compute_range_probability(
            self.simulated, error, total_runs, self.low, self.high
        )

    @property
    def label(self) -> str:
        """Description of the response; its name if the user defined it."""
        known = known_response(self.response)
        return self.response if known is None else known.label

    @property
    def margin(self) -> float:
        """Distance of the simulated mean from the nearer end of the range.

        It is positive inside the range and negative outside. It is NaN if there is no
        simulated mean.
        """
        if self.simulated is None:
            return math.nan
        return min(self.simulated - self.low, self.high - self.simulated)

    @property
    def difference_text(self) -> str:
        """Text with the difference between the simulated and the measured mean.

        The signed difference is in percent, with its standard error. Its size is also
        compared with the standard deviation of a single measurement.
        """
        if self.simulated is None:
            return f"{self.response} unknown"
        difference = self.simulated - self.measured
        percent_per_unit = 100 / self._percent_reference
        percent = _round_percent(percent_per_unit * difference)
        error_text = ""
        if self.standard_error is not None:
            error_text = f" +- {percent_per_unit * self.standard_error:.1f}"
        scatter_text = ""
        if self.sd > 0:
            ratio = abs(difference) / self.sd
            scatter_text = (
                f" ({ratio:.2f} of the standard deviation of single measurements)"
            )
        return f"{self.response} {percent:+.1f}{error_text} %{scatter_text}"

    @property
    def miss_clause(self) -> str:
        """Clause that describes by how much the simulated mean misses its range."""
        if self.simulated is None:
            return f"the {self.label} has no number{self._failure_clause}"
        side = "below" if self.simulated < self.low else "above"
        distance = f"{format_significant(-self.margin, 2)} {self.unit}".rstrip()
        return f"the simulated {self.label} lies {distance} {side} its range"

    @property
    def mean_text(self) -> str:
        """Text that compares the simulated mean with the measured one.

        Without a simulated mean, the predicted one takes its place.
        """
        # Begin the text with a capital letter, unless it begins with the name of a
        # response that the user defined, whose spelling must stay.
        label = self.label
        if known_response(self.response) is not None:
            label = label[0].upper() + label[1:]
        # The angle of a pile is the slope of a line, of which there are several kinds.
        line_remark = f"; line: {self.line}" if self.line else ""
        measured = f"measured {format_significant(self.measured)}"

        # Write the simulated mean, or else the predicted one.
        if self.simulated is not None:
            prefix, mean = "", self.simulated
        elif self.predicted is not None:
            prefix, mean = "predicted ", self.predicted
        else:
            return f"{label} without a number ({measured}{line_remark})"
        number = f"{format_with_error(mean, self.standard_error)} {self.unit}".rstrip()
        percent = _round_percent(100 * (mean - self.measured) / self._percent_reference)
        difference = f"{percent:+.1f} %"
        return f"{label} {prefix}{number} ({measured}, {difference}{line_remark})"

    @property
    def _percent_reference(self) -> float:
        """The number that counts as 100 % for differences from the measured mean."""
        return self.whole or abs(self.measured)

    def __str__(self) -> str:
        target = (
            f"target {format_significant(self.low)} to {format_significant(self.high)} "
            f"{self.unit}"
        ).rstrip()
        if self.status == NOT_SIMULATED_AGAIN:
            prediction = self.prediction_clause or f"{self.response} not predicted"
            return f"{prediction}, {NOT_SIMULATED_AGAIN}; {target}"
        if self.simulated is None:
            return (
                f"{self.response}: no number{self._failure_clause}; {target}: NOT met"
            )
        side = "inside" if self.margin >= 0 else "outside"
        mean = format_with_error(self.simulated, self.standard_error)
        return (
            f"{self.response}: simulated {mean} {self.unit} (runs: {self.runs}), "
            f"measured {format_significant(self.measured)}; {target}: "
            f"{self.verdict}, {format_significant(abs(self.margin), 2)} {self.unit} {side}"
        )

    @property
    def _failure_clause(self) -> str:
        """Clause that explains a missing number; empty if the status does not."""
        if self.status in ("ok", NOT_SIMULATED_AGAIN):
            return ""
        return f", because {describe_status(self.status)}"


@dataclass(frozen=True)
class Assessment:
    """All checks of an answer, judged together.

    Attributes
    ----------
    checks : tuple of Check
        One for each target.
    feasible : bool
        Whether the answer is predicted to meet all targets.
    inside : float or None
        Probability that all means lie inside their ranges, estimated from the runs of
        the check. If it is None, the responses are treated as independent. If the
        answer was not simulated again, it is the predicted probability.
    out_of_reach : bool
        Whether no parameter set is predicted to meet the targets.
    """

    checks: tuple[Check, ...]
    feasible: bool
    inside: float | None = None
    out_of_reach: bool = False

    @property
    def verdict(self) -> Verdict:
        """Whether the solution is feasible and its simulation meets every target."""
        verdicts = [check.verdict for check in self.checks]
        if Verdict.UNCHECKED in verdicts:
            return Verdict.UNCHECKED
        if not self.feasible or Verdict.NOT_MET in verdicts:
            return Verdict.NOT_MET
        return judge_probability(self.probability)

    @property
    def probability(self) -> float | None:
        """Probability that all means lie inside their ranges; None if it is unknown."""
        n_runs = min(check.runs for check in self.checks)
        # `inside` accounts for the correlation of the responses. A few runs cannot show
        # this correlation, so the responses are then treated as independent.
        is_correlation_known = n_runs > len(self.checks) + 1
        if self.inside is not None and is_correlation_known:
            return self.inside
        return _multiply_probabilities(self.checks, further_runs=0)

    @property
    def state(self) -> str:
        """The verdict, or the predicted one with its probability (`describe_state`)."""
        return describe_state(self.verdict, self.inside, self.out_of_reach)

    @property
    def reason(self) -> str:
        """Sentence that explains why the targets are met or not.

        The sentence is about the prediction for the answer, its simulation, or both.
        """
        if self.verdict is Verdict.UNCHECKED:
            sentence = (
                f"{self._prediction_clause}; the answer was {NOT_SIMULATED_AGAIN}"
            )
        elif self.verdict is Verdict.UNDECIDED:
            remedy = describe_undecided(self.probability, self.checks)
            sentence = f"{self._simulation_clause}. {remedy}"
        elif self.feasible:
            # The targets are met or not met, and the simulation alone says why.
            sentence = self._simulation_clause
        else:
            # The targets are not met, because the prediction already misses them.
            sentence = f"{self._prediction_clause}; {self._simulation_clause}"
        return f"{sentence[0].upper()}{sentence[1:]}."

    @property
    def _ranges(self) -> str:
        """Text with the ranges of all targets."""
        count = len(self.checks)
        return {1: "the range", 2: "both ranges"}.get(count, f"all {count} ranges")

    @property
    def _prediction_clause(self) -> str:
        """Clause about the prediction for the answer."""
        if self.out_of_reach:
            return f"no parameter set is predicted inside {self._ranges}"
        verb = "is" if self.feasible else "is not"
        return f"the answer {verb} predicted inside {self._ranges}"

    @property
    def _simulation_clause(self) -> str:
        """Clause about the outcome of the simulation."""
        # A mean outside its range is a miss, even if its standard error leaves doubt.
        # The margin of a check without a number is NaN, which is not `>= 0` either.
        misses = [check.miss_clause for check in self.checks if not check.margin >= 0]
        if misses:
            return " and ".join(misses)
        if len(self.checks) == 1:
            return f"the simulated mean lies inside {self._ranges}"
        return f"the simulated means lie inside {self._ranges}"


@dataclass(frozen=True)
class Result:
    """The result of a calibration, with the checks of its answer.

    Attributes
    ----------
    label : str
        Name of the material of the study.
    parameters : mapping
        The answer: the value of each parameter by name.
    feasible : bool
        Whether the search found a set whose prediction meets the targets.
    message : str
        Sentence in which the search describes its result.
    checks : tuple of Check
        One for each target.
    folder : Path
        Folder of the report and the material card of this result.
    within : mapping
        For each tolerance in percent of the aims, the probability that all means lie
        within it. The probabilities come from the runs of the check alone. They are
        None if unknown.
    inside : float or None
        Probability that all means lie inside their ranges, from the same runs. If it is
        None, the responses are treated as independent. Without runs, it is predicted.
    tables : Path
        Folder of the tables of the check.
    solutions : Path
        Table of all parameter sets that were found.
    advice : str
        What to do if the prediction meets the targets and the simulation does not.
    why : str
        Why a strategy with several batches ended; empty for other strategies.
    out_of_reach : bool
        Result of `is_out_of_reach` for the summary.
    small_run : bool
        Whether the study is too small for a calibration.
    labels : mapping
        Meaning of each parameter, by name.
    near_bounds : tuple of str
        A clause for each parameter that lies at most one standard error away from a
        bound of its range (`repose.calibrate.bounds`).
    first_folder : Path or None
        Folder of the report and the material card of the study's first answer, if this
        result is another one; None if it is the first.
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
    advice: str = MORE_POURS_ADVICE
    why: str = ""
    out_of_reach: bool = False
    small_run: bool = False
    labels: Mapping[str, str] = field(default_factory=dict)
    inside: float | None = None
    near_bounds: tuple[str, ...] = ()
    first_folder: Path | None = None

    @property
    def assessment(self) -> Assessment:
        """The checks of the result, judged together."""
        return Assessment(
            checks=self.checks,
            feasible=self.feasible,
            inside=self.inside,
            out_of_reach=self.out_of_reach,
        )

    @property
    def verdict(self) -> Verdict:
        """Whether the solution is feasible and its simulation meets every target."""
        return self.assessment.verdict

    @property
    def probability(self) -> float | None:
        """Probability that all means lie inside their ranges; None if it is unknown."""
        return self.assessment.probability

    @property
    def reason(self) -> str:
        """Sentence that explains why the targets are met or not."""
        return self.assessment.reason

    @property
    def headline(self) -> str:
        """Whether the targets are met, in one line with numbers."""
        line = format_verdict_line(
            self.verdict,
            self.checks,
            self.reason,
            self.small_run,
            status=self.assessment.state,
        )
        return f"{self.label}: {line}"

    def __str__(self) -> str:
        """Describe the result in several lines, which a study prints at its end.

        The lines are the verdict, the parameters of the answer, the predictions, the
        checks, the folders of the results, and what may settle or change the verdict.
        """
        lines = [self.headline, *self._describe_parameters()]
        predictions = [
            check.prediction_clause for check in self.checks if check.prediction_clause
        ]
        if predictions:
            lines.append(f"Predicted: {'; '.join(predictions)}.")
        lines.append("Simulated again with fresh seeds:")
        lines += [f"  {check}" for check in self.checks]
        lines.append(f"  {describe_differences(self.checks)}")
        lines.append(f"  {self._probability_clause}")
        lines.append(
            f"Tables: {self.tables}; all solutions: {self.solutions}; after the whole "
            f"study, also the report: {self.folder / REPORT_FILE}, and the material card: "
            f"{self.folder / CARD_FILE}"
        )
        if self.why:
            lines.append(f"No more batches: {self.why}.")
        # Propose what may settle or change the verdict.
        if self.verdict is Verdict.UNDECIDED:
            lines.append("What helps: a larger validation.representative_seeds.")
        elif self.verdict is not Verdict.MET:
            remedy = "" if self.feasible else "wider ranges of parameters or targets; "
            lines.append(f"What helps: {remedy}{self.advice}.")
        if self.first_folder is not None:
            lines.append(
                f"The study's first answer stays in {self.first_folder / REPORT_FILE} "
                f"and {self.first_folder / CARD_FILE}."
            )
        return "\n".join(lines)

    def _describe_parameters(self) -> list[str]:
        """Describe the parameters of the answer in lines.

        A last line names the parameters that lie at or near a bound of their range.
        """
        if self.feasible:
            lines = ["The calibrated parameters:"]
        else:
            lines = [self.message, "The nearest parameters:"]
        for name, value in self.parameters.items():
            lines.append(
                f"  {name:{NAME_WIDTH}} {format_significant(value)}  "
                f"{self.labels.get(name, name)}"
            )
        if self.near_bounds:
            lines.append(f"{NEAR_BOUNDS_INTRODUCTION}: {'; '.join(self.near_bounds)}.")
        return lines

    @property
    def _probability_clause(self) -> str:
        """Clause with the probability that all means are near their targets."""
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


def is_out_of_reach(summary: Mapping[str, Any]) -> bool:
    """Return whether no parameter set is predicted to meet the targets.

    If the summary of a strategy has the key `stop`, this key decides. Its value is
    `ENDS_NOT_SIMULATED` if the answer lies at ends of ranges where nothing was
    simulated. The response may be steep there, so the targets may still be within
    reach.
    """
    if summary["feasible"]:
        return False
    return summary.get("stop", "out_of_reach") == "out_of_reach"


def format_verdict_line(
    verdict: Verdict,
    checks: Iterable[Check],
    reason: str,
    small_run: bool = False,
    status: str = "",
) -> str:
    """Format the verdict with its numbers, and the reason unless the targets are met.

    Parameters
    ----------
    verdict : Verdict
        The verdict on the targets.
    checks : iterable of Check
        One for each target.
    reason : str
        Sentence that explains the verdict.
    small_run : bool, optional
        Whether the study is too small for a calibration. The line then begins with a
        warning.
    status : str, optional
        The result of `describe_state`; by default the wording of `verdict`.

    Returns
    -------
    str
        A single line.
    """
    numbers = ", ".join(check.mean_text for check in checks)
    line = f"targets {status or verdict}. {numbers}."
    if small_run:
        line = f"a small run, its numbers are no calibration: {line}"
    return line if verdict is Verdict.MET else f"{line} {reason}"


def describe_undecided(probability: float | None, checks: Sequence[Check]) -> str:
    """Say how probably the targets are met, and how many further runs would decide.

    Parameters
    ----------
    probability : float or None
        Probability that all means lie inside their ranges; None if it is unknown.
    checks : sequence of Check
        One for each target.

    Returns
    -------
    str
        The sentence, without a full stop at its end.
    """
    if probability is None:
        return "Fewer than two runs gave a number, so their mean has no standard error"
    n_runs = count_further_runs(checks)
    if n_runs is None:
        ending = f"more than {MAX_FURTHER_RUNS} further runs would decide"
    else:
        noun = "run" if n_runs == 1 else "runs"
        ending = f"about {n_runs} further {noun} would decide, if the means stay"
    return (
        f"By these runs alone all means lie inside with a probability of "
        f"{100 * probability:.0f} %; {ending}"
    )


def count_further_runs(checks: Sequence[Check]) -> int | None:
    """Find the number of further runs of the answer that would settle the verdict.

    The means and the scatter of the runs are assumed to stay as they are.

    Parameters
    ----------
    checks : sequence of Check
        One for each target.

    Returns
    -------
    int or None
        None if more than `MAX_FURTHER_RUNS` runs are needed.
    """
    for further in range(1, MAX_FURTHER_RUNS + 1):
        probability = _multiply_probabilities(checks, further)
        if judge_probability(probability) is not Verdict.UNDECIDED:
            return further
    return None


def _multiply_probabilities(checks: Iterable[Check], further_runs: int) -> float | None:
    """Compute the probability that all means lie inside their ranges.

    The responses are treated as independent, so this is the product of the
    probabilities of the checks.

    Parameters
    ----------
    checks : iterable of Check
        One for each target.
    further_runs : int
        Number of runs to add to each check. The mean and the scatter of its runs are
        assumed not to change.

    Returns
    -------
    float or None
        None if the probability of any check is unknown.
    """
    joint_probability = 1.0
    for check in checks:
        probability = check.compute_probability(check.runs + further_runs)
        if probability is None:
            return None
        joint_probability *= probability
    return joint_probability


def _round_percent(percent: float) -> float:
    """Round a percentage to one decimal; the result is never -0.0."""
    # Rounding a small negative number gives -0.0. Adding 0.0 turns it into 0.0.
    return round(percent, 1) + 0.0


def describe_optimism(optimism: float, error: float | None) -> str:
    """Describe the expected optimism of a prediction, with its standard error."""
    if error is not None and not math.isfinite(error):
        error = None
    return f"expected optimism {format_with_error(optimism, error, sign='+')}"


def describe_missing_optimism(checks: Iterable[Check]) -> str:
    """Say what the probability of a prediction leaves out: its expected optimism."""
    if any(check.optimism is None for check in checks):
        return (
            "The expected optimism of this prediction is unknown. The search favours "
            "points where the surrogate errs towards the target, so the true "
            "probability is mostly lower."
        )
    return "This does not include the expected optimism of the predictions."


def describe_differences(checks: Iterable[Check]) -> str:
    """Describe in a sentence how far the simulated means are from the measured ones."""
    differences = ", ".join(check.difference_text for check in checks)
    return f"Simulated minus measured: {differences}."


def describe_probabilities(chance: Mapping[str, float]) -> str:
    """Describe in a clause how probably the means of a simulator meet all targets."""
    return (
        f"within 1 % of all targets: {chance['within_1_percent']:.2f}; within 2 %: "
        f"{chance['within_2_percent']:.2f}; inside all ranges: {chance['inside']:.2f}"
    )

"""The verdict of a report: whether the targets are met, and how probably."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from repose.calibrate.answer import (
    DECIDED,
    NOT_AGAIN,
    Check,
    Result,
    Verdict,
    describe_optimism,
    in_one_line,
    out_of_reach,
)
from repose.measure.settings import line_for
from repose.report.page.study import Results
from repose.report.page.templates import cell_text


class VerdictText(NamedTuple):
    """Whether the targets are met, in sentences.

    `rating` is a class of the style sheet: good, fair or bad.
    """

    rating: str
    text: str

    @property
    def headline(self) -> str:
        """The first sentence, without its full stop."""
        return self.text.partition(". ")[0]

    @property
    def details(self) -> str:
        """The other sentences."""
        return self.text.partition(". ")[2]


def verdict_of(study: Results) -> VerdictText:
    """Tell whether the targets are met: the line that ends a run, and its probability."""
    checks = tuple(checks_of(study))
    result = Result(
        label=study.label,
        parameters=dict(
            zip(study.parameters.names, study.answer.tolist(), strict=True)
        ),
        feasible=study.summary["feasible"],
        message=study.summary["message"],
        checks=checks,
        folder=Path(),
        within=study.probability_within,
        inside=study.probability["all"],
        out_of_reach=out_of_reach(study.summary),
        small_run=study.is_small_run,
    )
    line = in_one_line(
        result.verdict, checks, reason=result.reason, small_run=result.small_run
    )
    if result.feasible and result.verdict is Verdict.UNCHECKED:
        line = line.replace(
            f"targets {Verdict.UNCHECKED}", "targets predicted to be met"
        )
    first_sentence = line[0].upper() + line[1:]
    # Without a feasible set, the message says what the search found instead.
    ending = probability_text(study) if result.feasible else result.message
    return VerdictText(_rating(study, result), f"{first_sentence} {ending}")


def _rating(study: Results, result: Result) -> str:
    """Rate the answer as good, fair or bad."""
    if not result.feasible or result.verdict is Verdict.NOT_MET:
        return "bad"
    probability = study.probability["all"]
    if result.verdict is Verdict.UNDECIDED or probability is None:
        return "fair"
    return "good" if probability >= DECIDED else "fair"


def probability_text(study: Results) -> str:
    """Write in sentences how probably the targets are met."""
    probability = study.probability["all"]
    if probability is None:
        return (
            "How probable this is, is unknown: fewer than two runs of these "
            "parameters could be measured."
        )
    n_runs = study.number("n_seeds")
    if n_runs is None:
        evidence = (
            "as the surrogate predicts; these parameters were not simulated again"
        )
    else:
        evidence = f"judged by {n_runs:.0f} new simulations with these parameters"
    n_targets = len(study.targets)
    sentences = [
        f"With a probability of {percent_text(probability)} "
        f"{_responses_lie(n_targets)} inside the target range, {evidence}."
    ]
    targets = "target" if n_targets == 1 else "targets"
    for percent, within in study.probability_within.items():
        if within is not None:
            sentences.append(
                f"Within {percent:g} % of the {targets}: {percent_text(within)}."
            )
    if n_runs is None:
        sentences.append(_optimism_text(study))
    return " ".join(sentences)


def _optimism_text(study: Results) -> str:
    """Say how much too favourable the predictions of the answer are expected to be."""
    clauses = []
    for target in study.targets:
        response = target.response
        optimism = study.number(response.optimism)
        if optimism is not None:
            error = study.number(response.optimism_error)
            words = describe_optimism(optimism, error)
            clauses.append(f"{response.label}: {words} {response.unit}".rstrip())
    if not clauses:
        return (
            "The expected optimism of this prediction was not computed: the search takes "
            "places where the error of the surrogate helps, so the true probability is "
            "mostly lower."
        )
    return f"This does not count the expected optimism ({'; '.join(clauses)})."


def _responses_lie(n_targets: int) -> str:
    """Write subject and verb of a sentence on all responses."""
    if n_targets == 1:
        return "the response lies"
    if n_targets == 2:
        return "both responses lie"
    return f"all {n_targets} responses lie"


def percent_text(probability: float | None) -> str:
    """Write a probability, no more precise than the runs allow."""
    if probability is None:
        return "unknown"
    if probability > 0.995:
        return "more than 99 %"
    if probability < 0.005:
        return "less than 1 %"
    return f"{100 * probability:.0f} %"


def checks_of(study: Results) -> Iterator[Check]:
    """Give the predicted, simulated and measured response of the answer for each target."""
    n_runs = study.number("n_seeds")
    status = NOT_AGAIN
    if n_runs is not None:
        status = cell_text(study.answer_row.get("status"))
    for target in study.targets:
        response = target.response
        yield Check.of(
            target,
            simulated=study.number(response.simulated),
            standard_error=study.number(response.standard_error),
            runs=int(n_runs or 0),
            status=status,
            predicted=study.number(response.predicted),
            line=line_for(study.measure, target.name),
            optimism=study.number(response.optimism),
            optimism_error=study.number(response.optimism_error),
        )

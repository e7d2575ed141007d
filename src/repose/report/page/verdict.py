"""Describe whether the targets of a study are met, and how probably."""

from collections.abc import Iterator
from typing import NamedTuple

from repose.calibrate.answer import (
    DECISIVE_PROBABILITY,
    NOT_SIMULATED_AGAIN,
    Assessment,
    Check,
    Verdict,
    describe_optimism,
    format_verdict_line,
    is_out_of_reach,
)
from repose.measure.settings import describe_line_of_response
from repose.report.page.study import Results
from repose.report.page.templates import cell_text

# Half of the step to which `format_percent` rounds probabilities.
HALF_PERCENT = 0.005


class VerdictText(NamedTuple):
    """A description of whether the targets are met.

    `rating` is a class in the style sheet: good, fair or bad.
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


def make_verdict(study: Results) -> VerdictText:
    """Describe whether the answer meets the targets, and how probably.

    The description begins with the line that a study prints at its end.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    VerdictText
        The rating and the description.
    """
    checks = tuple(make_checks(study))
    assessment = Assessment(
        checks=checks,
        feasible=study.summary["feasible"],
        inside=study.probability["all"],
        out_of_reach=is_out_of_reach(study.summary),
    )
    is_only_predicted = assessment.feasible and assessment.verdict is Verdict.UNCHECKED
    line = format_verdict_line(
        assessment.verdict,
        checks,
        reason=assessment.reason,
        small_run=study.is_small_run,
        status="predicted to be met" if is_only_predicted else "",
    )
    first_sentences = line[0].upper() + line[1:]
    if assessment.feasible:
        # The line of an undecided verdict already states the probability that all means
        # are inside, so do not repeat it.
        is_undecided = assessment.verdict is Verdict.UNDECIDED
        last_sentences = describe_probability(study, names_inside=not is_undecided)
    else:
        # Without a feasible set, the message describes what the search found instead.
        last_sentences = study.summary["message"]
    rating = _rate_answer(assessment, study.probability["all"])
    return VerdictText(rating, f"{first_sentences} {last_sentences}")


def _rate_answer(assessment: Assessment, probability: float | None) -> str:
    """Rate the answer as good, fair or bad.

    `probability` is the probability that all targets are met, or None if it is unknown.
    """
    if not assessment.feasible or assessment.verdict is Verdict.NOT_MET:
        return "bad"
    if assessment.verdict is Verdict.UNDECIDED or probability is None:
        return "fair"
    return "good" if probability >= DECISIVE_PROBABILITY else "fair"


def describe_probability(study: Results, names_inside: bool = True) -> str:
    """Describe how probable it is that the answer meets the targets.

    Parameters
    ----------
    study : Results
        The results of the study.
    names_inside : bool
        Whether to begin with a sentence about all target ranges together.

    Returns
    -------
    str
        Several sentences.
    """
    probability = study.probability["all"]
    if probability is None:
        return (
            "How probable this is, is unknown: fewer than two runs of these "
            "parameters could be measured."
        )
    n_runs = study.get_number("n_seeds")
    if n_runs is None:
        evidence = (
            "as the surrogate predicts; these parameters were not simulated again"
        )
    else:
        evidence = f"judged by {n_runs:.0f} new simulations with these parameters"

    sentences = []
    if names_inside:
        sentences.append(
            f"With a probability of {format_percent(probability)} "
            f"{_describe_inside(len(study.targets))}, {evidence}."
        )
    sentences += _describe_within(study)
    if n_runs is None:
        sentences.append(_describe_optimism(study))
    return " ".join(sentences)


def _describe_within(study: Results) -> Iterator[str]:
    """Describe how probable it is that all means lie close to the measured ones.

    Parameters
    ----------
    study : Results
        The results of the study.

    Yields
    ------
    str
        A sentence for each percentage whose probability is known.
    """
    if len(study.targets) == 1:
        true_means = "the true mean lies"
        measured_means = "the measured mean"
    else:
        true_means = "all true means lie"
        measured_means = "the measured means"
    for percent, probability in study.probability_within.items():
        if probability is not None:
            yield (
                f"The probability that {true_means} within {percent:g} % of "
                f"{measured_means}, taken as exact, is {format_percent(probability)}."
            )


def _describe_optimism(study: Results) -> str:
    """Describe the expected optimism of the answer's predictions.

    Parameters
    ----------
    study : Results
        The results of the study.

    Returns
    -------
    str
        One sentence, which may say that the optimism is unknown.
    """
    clauses = []
    for target in study.targets:
        response = target.response
        optimism = study.get_number(response.optimism)
        if optimism is not None:
            error = study.get_number(response.optimism_error)
            description = describe_optimism(optimism, error)
            clause = f"{response.label}: {description} {response.unit}"
            clauses.append(clause.rstrip())
    if not clauses:
        return (
            "The expected optimism of this prediction was not computed. The search favours "
            "points where the surrogate errs towards the target, so the true probability "
            "is mostly lower."
        )
    return f"This does not count the expected optimism ({'; '.join(clauses)})."


def _describe_inside(n_targets: int) -> str:
    """Write the clause that the means of all responses are inside their ranges."""
    if n_targets == 1:
        return "the mean of the response lies inside its target range"
    responses = "both responses" if n_targets == 2 else f"all {n_targets} responses"
    return f"the means of {responses} lie inside their target ranges"


def format_percent(probability: float | None) -> str:
    """Format a probability in whole percent, but never as 0 % or 100 %.

    The number of runs is too small for such certainty.
    """
    if probability is None:
        return "unknown"
    # Beyond these limits, the rounded probability would be 0 % or 100 %.
    if probability > 1 - HALF_PERCENT:
        return "more than 99 %"
    if probability < HALF_PERCENT:
        return "less than 1 %"
    return f"{100 * probability:.0f} %"


def make_checks(study: Results) -> Iterator[Check]:
    """Make the check of the answer for each target.

    A check compares the predicted, simulated and measured values of a response.

    Parameters
    ----------
    study : Results
        The results of the study.

    Yields
    ------
    Check
        One check for each target, in the order of the targets.
    """
    n_runs = study.get_number("n_seeds")
    if n_runs is None:
        status = NOT_SIMULATED_AGAIN
    else:
        status = cell_text(study.answer_row.get("status"))
    for target in study.targets:
        response = target.response
        yield Check.from_target(
            target,
            simulated=study.get_number(response.simulated),
            standard_error=study.get_number(response.standard_error),
            runs=int(n_runs or 0),
            status=status,
            predicted=study.get_number(response.predicted),
            line=describe_line_of_response(study.measure, target.name),
            optimism=study.get_number(response.optimism),
            optimism_error=study.get_number(response.optimism_error),
        )

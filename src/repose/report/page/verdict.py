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
    judge_probability,
)
from repose.common.numbers import format_percent
from repose.measure.settings import describe_line_of_response
from repose.report.page.study import Results
from repose.report.page.templates import cell_text


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


def make_verdict(results: Results) -> VerdictText:
    """Describe whether the answer meets the targets, and how probably.

    The verdict (met, not met, undecided, or predicted only) comes from the checks of single
    targets. The description begins with the line that a study prints at its end. The
    rating chooses the colour of the description.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    VerdictText
        The rating and the description.
    """
    checks = tuple(make_checks(results))
    probability_inside = results.probability["all"]
    assessment = Assessment(
        checks=checks,
        feasible=results.summary["feasible"],
        inside=probability_inside,
        out_of_reach=is_out_of_reach(results.summary),
    )
    line = format_verdict_line(
        assessment.verdict,
        checks,
        reason=assessment.reason,
        small_run=results.is_small_run,
        status=assessment.state,
    )
    first_sentences = line[0].upper() + line[1:]  # the line is never empty
    if assessment.feasible:
        # The line of an undecided verdict already states the probability that all means
        # are inside, so do not repeat it.
        is_undecided = assessment.verdict is Verdict.UNDECIDED
        last_sentences = describe_probability(
            results, includes_target_ranges=not is_undecided
        )
    else:
        # Without a feasible set, the message describes what the search found instead.
        last_sentences = results.summary["message"]
    rating = _rate_answer(assessment, probability_inside)
    return VerdictText(rating, f"{first_sentences} {last_sentences}")


def _rate_answer(assessment: Assessment, probability: float | None) -> str:
    """Rate the answer as good, fair or bad.

    `probability` is the probability that all targets are met, or None if it is unknown.
    """
    if not assessment.feasible or assessment.verdict is Verdict.NOT_MET:
        return "bad"
    is_predicted = assessment.verdict is Verdict.UNCHECKED and probability is not None
    if is_predicted and judge_probability(probability) is Verdict.NOT_MET:
        return "bad"
    if assessment.verdict is Verdict.UNDECIDED or probability is None:
        return "fair"
    return "good" if probability >= DECISIVE_PROBABILITY else "fair"


def describe_probability(results: Results, includes_target_ranges: bool = True) -> str:
    """Describe how probable it is that the answer meets the targets.

    Parameters
    ----------
    results : Results
        The results of the study.
    includes_target_ranges : bool
        Whether to begin with the probability that all means are inside their target
        ranges.

    Returns
    -------
    str
        One or more sentences.
    """
    probability = results.probability["all"]
    if probability is None:
        return (
            "The probability of this is unknown: fewer than two runs of these "
            "parameters could be measured."
        )
    # Each run has its own seed. Without runs, only the surrogate predicts the
    # responses.
    n_runs = results.get_number("n_seeds")
    if n_runs is None:
        evidence = (
            "as the surrogate predicts; these parameters were not simulated again"
        )
    else:
        evidence = f"judged by {n_runs:.0f} new simulations with these parameters"

    sentences = []
    if includes_target_ranges:
        sentences.append(
            f"With a probability of {format_percent(probability)} "
            f"{_describe_inside(len(results.targets))}, {evidence}."
        )
    sentences += _describe_within_percent(results)
    if n_runs is None:
        # This sentence refers to the probabilities above, so it must come last.
        sentences.append(_describe_optimism(results))
    return " ".join(sentences)


def _describe_within_percent(results: Results) -> Iterator[str]:
    """Describe how probably all means lie within some percent of the measured means.

    Parameters
    ----------
    results : Results
        The results of the study.

    Yields
    ------
    str
        A sentence for each percentage whose probability is known.
    """
    if len(results.targets) == 1:
        true_means = "the true mean lies"
        measured_means = "the measured mean"
    else:
        true_means = "all true means lie"
        measured_means = "the measured means"
    for percent, probability in results.probability_within.items():
        if probability is not None:
            yield (
                f"The probability that {true_means} within {percent:g} % of "
                f"{measured_means}, taken as exact, is {format_percent(probability)}."
            )


def _describe_optimism(results: Results) -> str:
    """Describe the expected optimism of the answer's predictions.

    The search favours points where the surrogate errs towards the targets. The expected
    optimism is the part of the prediction's error that this selection causes. The
    sentence follows others that state a probability.

    Parameters
    ----------
    results : Results
        The results of the study.

    Returns
    -------
    str
        One sentence, which may say that the optimism is unknown.
    """
    optimism_of_responses = []
    for target in results.targets:
        response = target.response
        optimism = results.get_number(response.optimism)
        if optimism is not None:
            error = results.get_number(response.optimism_error)  # may be None
            description = describe_optimism(optimism, error)
            text = f"{response.label}: {description} {response.unit}"
            optimism_of_responses.append(text.rstrip())
    if not optimism_of_responses:
        return (
            "The expected optimism of this prediction was not computed. The search favours "
            "points where the surrogate errs towards the target, so the true probability "
            "is mostly lower."
        )
    return (
        "This probability does not include the expected optimism of the prediction "
        f"({'; '.join(optimism_of_responses)})."
    )


def _describe_inside(n_targets: int) -> str:
    """Write the clause that the means of all responses are inside their ranges."""
    if n_targets == 1:
        return "the mean of the response lies inside its target range"
    responses = "both responses" if n_targets == 2 else f"all {n_targets} responses"
    return f"the means of {responses} lie inside their target ranges"


def make_checks(results: Results) -> Iterator[Check]:
    """Compare the answer with each target.

    A check contains the predicted, the simulated and the measured value of a response.

    Parameters
    ----------
    results : Results
        The results of the study.

    Yields
    ------
    Check
        One check for each target, in the order of the targets.
    """
    n_runs = results.get_number("n_seeds")  # a run for each seed
    if n_runs is None:
        status = NOT_SIMULATED_AGAIN
    else:
        status = cell_text(results.answer_row.get("status"))
    for target in results.targets:
        # Attributes such as `simulated` are names of columns in the answer's row.
        response = target.response
        yield Check.from_target(
            target,
            simulated=results.get_number(response.simulated),
            standard_error=results.get_number(response.standard_error),
            runs=int(n_runs or 0),
            status=status,
            predicted=results.get_number(response.predicted),
            line=describe_line_of_response(results.measure, target.name),
            optimism=results.get_number(response.optimism),
            optimism_error=results.get_number(response.optimism_error),
        )

"""Figures of the studies here, drawn as those of the package."""

from repose.report.figures import Drawn
from research.figures import comparison, inversion, representations, second_look


def _named(*inputs: str) -> dict[str, str]:
    """Name the inputs; the rules of these studies know their places."""
    return dict.fromkeys(inputs, "")


FIGURES = {
    "search": Drawn(inversion.searches, _named("curves", "methods")),
    "whole": Drawn(inversion.whole, _named("whole")),
    "shape_study": Drawn(representations.study, _named("combinations", "sets")),
    "second_responses": Drawn(
        second_look.what_to_measure_next,
        _named("responses", "information", "narrowing", "ways"),
    ),
    "accuracy": Drawn(comparison.accuracy, _named("accuracy")),
    "surrogates": Drawn(comparison.surrogates, _named("surrogates")),
    "sampling": Drawn(comparison.sampling, _named("sampling")),
}

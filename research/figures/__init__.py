"""Figures of the studies here, drawn as those of the package."""

from repose.pictures.figures import Figure
from research.figures import comparison, inversion, representations, second_look

FIGURES = {
    "search": Figure(inversion.searches, ("curves", "methods")),
    "whole": Figure(inversion.whole, ("whole",)),
    "shape_study": Figure(representations.study, ("combinations", "sets")),
    "second_responses": Figure(
        second_look.what_to_measure_next,
        ("responses", "information", "narrowing", "ways"),
    ),
    "accuracy": Figure(comparison.accuracy, ("accuracy",)),
    "surrogates": Figure(comparison.surrogates, ("surrogates",)),
    "sampling": Figure(comparison.sampling, ("sampling",)),
}
